"""`tankcal camera …` as a user meets it: what is printed, exit status, what is refused."""

import hashlib
import json
import shutil
import tomllib

import numpy as np
import pytest

import tankcal
from tankcal.calibration.interiors import read_framed_cameras
from tankcal.camera.formats.published import convert_camera
from tankcal.camera.model import Form
from tankcal.cli import main
from tankcal.record import load as load_record
from tankcal.text.shipped import LANGUAGES, shipped_folder

SEVEN = shipped_folder("examples") / "pessoa-2017" / "cameras.toml"
PHOTOS = shipped_folder("examples") / "silva-1995-photos"
FILM = """
[cameras.longer]
format_mm = [180, 130]
c_mm = 100.3
convention = "correction_added"
affinity = "both_y"
s_c = 0.1
"""


@pytest.fixture(scope="module")
def record(adjusted_record):
    return adjusted_record


def run(*arguments):
    return main(["camera", *map(str, arguments), "--quiet"])


def test_compare_prints_a_list_of_pairs(capsys):
    assert run("compare", SEVEN, "--method", "zrot", "--as-published", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found) == 21
    assert list(found[0]) == ["a", "b", "method", "figure_px", "scatter_px", "similar"]
    assert found[-1] == {
        "a": "set6", "b": "set7", "method": "zrot",
        "figure_px": pytest.approx(9.50, abs=0.025),  # published: Pessoa 2017, table 13
        "scatter_px": None, "similar": False,
    }  # fmt: skip


def test_names_may_come_after_options(capsys):
    assert (
        run("compare", SEVEN, "--method", "rot", "--threshold", "2", "set1", "set2", "--json") == 0
    )
    assert [one["a"] for one in json.loads(capsys.readouterr().out)] == ["set1"]
    with pytest.raises(SystemExit) as stop:
        run("compare", SEVEN, "--methods", "rot")
    assert stop.value.code == 2
    with pytest.raises(SystemExit):
        main(["run", "job", "another"])


def test_pairs_keep_the_requested_order(capsys):
    assert run("compare", SEVEN, "set2", "set1", "--json") == 0
    (pair,) = json.loads(capsys.readouterr().out)
    assert (pair["a"], pair["b"]) == ("set2", "set1")
    assert run("compare", SEVEN, "--json") == 0
    pair = json.loads(capsys.readouterr().out)[0]
    assert (pair["a"], pair["b"]) == ("set1", "set2")


def test_compare_film_in_pixels_of_ones_own(tmp_path, capsys):
    (tmp_path / "film.toml").write_text(FILM + FILM.replace("longer", "again"), encoding="utf-8")
    assert run("compare", tmp_path / "film.toml", "--json") == 2
    assert "pixel_um" in capsys.readouterr().err
    assert run("compare", tmp_path / "film.toml", "--pixel-um", "10", "--json") == 0
    assert json.loads(capsys.readouterr().out)[0]["figure_px"] == 0


def test_compare_chosen_ones_by_another_threshold(capsys):
    arguments = ("set3", "set7", "--method", "spr", "--terrain", "II", "--threshold", "0.33")
    assert run("compare", SEVEN, *arguments) == 0
    printed = capsys.readouterr().out
    assert "SPR" in printed
    assert "0.33 px" in printed
    assert "set1" not in printed


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("sett3",), "did you mean set3?"),
        (("set1",), "1 calibration; expected two or more"),
        (("--grid", "46x35"), "--grid"),
        (("--terrain", "III"), "--terrain"),
        (("--seed", "-3"), "--seed"),
    ],
)
def test_incomparable_calibrations_are_reported(arguments, words, capsys):
    assert run("compare", SEVEN, *arguments) == 2
    told = capsys.readouterr()
    assert words in told.err
    assert told.out == ""


@pytest.mark.slow
def test_compare_writes_its_papers_and_refuses_foreign_folders(tmp_path, capsys):
    out = tmp_path / "papers"
    assert run("compare", SEVEN, "set1", "set2", "--grid", "6x5,300,300,700", "--out", out) == 0
    names = {path.name for path in out.iterdir()}
    assert {"camera.json", "pairs.csv", "report.pdf", "report.html", "report.ipynb"} <= names
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine", encoding="utf-8")
    assert run("compare", SEVEN, "--out", tmp_path / "mine") == 2
    assert "notes.txt" in capsys.readouterr().err


@pytest.mark.slow
def test_parameters_of_a_record(record, capsys):
    assert run("parameters", record, "--json", "--alpha", "0.1") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["kind"] == "parameters"
    assert found["alpha"] == 0.1
    assert [one["name"] for one in found["parameters"]][:3] == ["c", "x0", "y0"]
    assert found["with_all"] is None
    assert run("parameters", record) == 0
    assert "No adjustment was repeated" in " ".join(capsys.readouterr().out.split())


def in_spanish(folder):
    """The shipped photographs as a job that asks for papers in Spanish."""
    job = shutil.copytree(PHOTOS, folder / "job")
    text = (job / "job.toml").read_text(encoding="utf-8")
    written = text.replace("[table]", '[table]\nlanguage = "es"')
    (job / "job.toml").write_text(written, encoding="utf-8")
    return job


@pytest.mark.slow
def test_tables_are_in_the_language_of_the_job(tmp_path, capsys):
    job = in_spanish(tmp_path)
    assert run("parameters", job, "--no-trials") == 0
    assert "Grados de libertad" in capsys.readouterr().out
    assert run("parameters", job, "--no-trials", "--language", "pt-BR") == 0
    assert "Graus de liberdade" in capsys.readouterr().out


@pytest.mark.slow
def test_tables_are_in_the_language_of_the_record(record, tmp_path, capsys):
    found = json.loads(record.read_text(encoding="utf-8"))
    found["job"]["table"]["language"] = "pt-BR"
    (tmp_path / "record.json").write_text(json.dumps(found), encoding="utf-8")
    assert run("parameters", tmp_path / "record.json") == 0
    assert "Graus de liberdade" in capsys.readouterr().out
    assert run("parameters", record) == 0
    assert "Degrees of freedom" in capsys.readouterr().out


@pytest.mark.parametrize("what", ["parameters", "compare", "influence", "check"])
def test_every_analysis_refuses_a_language_without_words(what, capsys):
    more = ("--cameras", SEVEN) if what == "influence" else ()
    with pytest.raises(SystemExit) as stop:
        run(what, SEVEN, *more, "--language", "fr")
    assert stop.value.code == 2
    told = capsys.readouterr().err
    assert "--language" in told
    assert "pt-BR" in told


@pytest.mark.parametrize(
    ("option", "name", "words"),
    [
        ("--photo", "NOPHOTO", "--photo: found 'NOPHOTO'; expected one of "),
        ("--camera", "NOCAMERA", "--camera: found 'NOCAMERA'; expected one of UMK"),
    ],
)
def test_parameters_of_unknown_camera_or_photo(record, option, name, words, capsys):
    for source in (PHOTOS, record):
        assert run("parameters", source, "--no-trials", option, name) == 2
        told = capsys.readouterr()
        assert words in told.err
        assert told.out == ""


@pytest.mark.slow
def test_parameters_of_a_photo_with_parameters_of_its_own(tmp_path, capsys):
    job = shutil.copytree(PHOTOS, tmp_path / "job")
    text = (job / "job.toml").read_text(encoding="utf-8")
    own = '\n[adjustment.camera]\nx0 = "photo free"\n'
    (job / "job.toml").write_text(text + own, encoding="utf-8")
    name = tankcal.load(job, only="adjustment").measurements.photos[1].name
    out = tmp_path / "out"
    assert main(["run", str(job), "--only", "adjustment", "--out", str(out), "--quiet"]) == 0
    capsys.readouterr()
    for source in (job, out / "record.json"):
        assert run("parameters", source, "--no-trials", "--photo", name, "--json") == 0
        assert json.loads(capsys.readouterr().out)["photos"] == [name]


def test_parameters_without_photographs(capsys):
    assert run("parameters", shipped_folder("examples") / "total-station") == 2
    assert "no photographs" in capsys.readouterr().err


def test_several_sets_are_refused_before_the_work(tmp_path, capsys, monkeypatch):
    job = tmp_path / "job"
    job.mkdir()
    for file in PHOTOS.iterdir():
        if file.is_file():
            (job / file.name).write_bytes(file.read_bytes())
    text = (job / "job.toml").read_text(encoding="utf-8")
    own = '\n[adjustment.camera]\nx0 = "photo free"\n'
    (job / "job.toml").write_text(text + own, encoding="utf-8")
    monkeypatch.setattr("tankcal.calibration.parameters.analysis.adjust_job", None)
    assert run("parameters", job, "--out", tmp_path / "out") == 2
    assert "there are 11 sets of parameters" in capsys.readouterr().err


@pytest.mark.slow
def test_parameters_of_a_job_without_trials(capsys):
    assert run("parameters", PHOTOS, "--no-trials", "--json") == 0
    assert len(json.loads(capsys.readouterr().out)["without"]) > 10


@pytest.mark.slow
def test_influence_of_a_film_camera(tmp_path, capsys):
    (tmp_path / "cameras.toml").write_text(FILM, encoding="utf-8")
    arguments = ("--cameras", tmp_path / "cameras.toml", "--states", "fixed", "--json")
    assert run("influence", PHOTOS, *arguments) == 0
    found = json.loads(capsys.readouterr().out)
    labels = [one["label"] for one in found["runs"]]
    assert labels == ["reference", "longer, fixed"]
    sigma0 = [one["quality"]["sigma0"] for one in found["runs"]]
    assert sigma0[1] > 1.05 * sigma0[0]
    assert found["runs"][1]["volume"]["volume_m3"] == pytest.approx(1249.6, abs=0.5)


@pytest.mark.slow
def test_influence_of_film_uses_pixels_of_calibration(tmp_path, capsys):
    fine = FILM.replace("longer", "fine").replace("c_mm", "pixel_um = 10\nc_mm")
    (tmp_path / "cameras.toml").write_text(FILM + fine, encoding="utf-8")
    arguments = ("--cameras", tmp_path / "cameras.toml", "--states", "fixed", "--json")
    assert run("influence", PHOTOS, *arguments) == 0
    images = [one["images"] for one in json.loads(capsys.readouterr().out)["runs"]]
    assert len(images) == 3
    for one in images:
        assert one["largest_px"] == pytest.approx(one["largest_um"] / 10, rel=1e-12)


@pytest.mark.slow
def test_influence_prints_calibrations_against_each_other(tmp_path, capsys):
    other = FILM.replace("longer", "shorter").replace("100.3", "99.8")
    (tmp_path / "cameras.toml").write_text(FILM + other, encoding="utf-8")
    arguments = ("--cameras", tmp_path / "cameras.toml", "--states", "fixed")
    assert run("influence", PHOTOS, *arguments) == 0
    printed = capsys.readouterr().out
    assert "calibrations compared with each other" in printed
    assert "longer, fixed  shorter, fixed" in printed


def test_influence_needs_states_that_are_some():
    with pytest.raises(SystemExit) as stop:
        run("influence", PHOTOS, "--cameras", SEVEN, "--states", "held")
    assert stop.value.code == 2


def test_check_of_a_file(tmp_path, capsys):
    file = tmp_path / "differences.csv"
    rows = [f"P{i},{0.01 * (i % 3)},{0.02 * (i % 2)},{0.05 + 0.01 * (i % 4)}" for i in range(12)]
    file.write_text("\n".join(["point,dx_m,dy_m,dz_m", *rows]), encoding="utf-8")
    assert run("check", file, "--scale", "1000", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["kind"] == "product"
    assert (
        {one["scale"] for one in found["table"]["verdicts"]} == {"1000"}
        if ("verdicts" in (found["table"] or {}))
        else found["n"] == 12
    )
    assert run("check", file, "--scale", "1500") == 2
    assert "found no scale 1500" in capsys.readouterr().err


def test_json_has_codes_in_every_language(tmp_path, capsys):
    file = tmp_path / "d.csv"
    file.write_text("point,dx_m\nA,0.01\nB,-0.02\nC,0.005\n", encoding="utf-8")
    printed = []
    for language in LANGUAGES:
        assert run("check", file, "--json", "--language", language) == 0
        printed.append(capsys.readouterr().out)
    assert len(set(printed)) == 1


def test_check_of_a_record_without_check_points(record, capsys):
    assert run("check", record) == 2
    assert "no check points" in capsys.readouterr().err


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("form", ["opencv", "opencv-json", "metashape", "aicon", "colmap", "pix4d"])
def test_convert_there_and_back(form, tmp_path, capsys):
    """Property: a camera that another program can hold comes back as the same images."""
    there, back = tmp_path / f"camera.{form}", tmp_path / "cameras.toml"
    source = tmp_path / "plain.toml"
    source.write_text(
        "[cameras.lens]\nformat_px = [6000, 4000]\npixel_um = 4\nc_mm = 24\nx0_mm = 0.1\n"
        'K1 = -1e-4\nP1 = 2e-6\nconvention = "distortion_of_ideal"\n',
        encoding="utf-8",
    )
    assert main(["camera", "convert", str(source), "--to", form, "--out", str(there)]) == 0
    sizes = ["--pixel-um", "4", "--size-px", "6000", "4000", "--from", form]
    command = ["camera", "convert", str(there), "--to", "cameras.toml", "--out", str(back), *sizes]
    assert main(command) == 0
    assert "fitted" not in capsys.readouterr().err
    both = tmp_path / "both.toml"
    name = back.read_text(encoding="utf-8").split("\n", 1)[0].split(".")[1].rstrip("]")
    text = back.read_text(encoding="utf-8").replace(f"cameras.{name}]", "cameras.back]")
    both.write_text(source.read_text(encoding="utf-8") + text, encoding="utf-8")
    assert run("compare", both, "--method", "zrot", "--json") == 0
    assert json.loads(capsys.readouterr().out)[0]["figure_px"] < 1e-9


def test_convert_uses_the_given_kind_of_file(tmp_path, capsys):
    odd = tmp_path / "cameras.txt"
    shutil.copy(SEVEN, odd)
    arguments = ["camera", "convert", str(odd), "--name", "set1", "--to", "aicon"]
    assert main([*arguments, "--from", "cameras.toml"]) == 0
    assert "Ck -4.38" in capsys.readouterr().out
    arguments[2] = str(SEVEN)
    assert main([*arguments, "--from", "aicon"]) == 2
    assert "Ck: missing" in capsys.readouterr().err


@pytest.mark.slow
def test_convert_a_record_of_film(record, capsys):
    assert main(["camera", "convert", str(record), "--to", "opencv"]) == 2
    assert "UMK.pixel_um: missing; a file of kind opencv is in pixels" in capsys.readouterr().err
    assert main(["camera", "convert", str(record), "--to", "cameras.toml"]) == 0
    in_mm = tomllib.loads(capsys.readouterr().out)["cameras"]["UMK"]
    assert in_mm["format_mm"] == [180, 130]
    assert "pixel_um" not in in_mm
    arguments = ["camera", "convert", str(record), "--to", "cameras.toml", "--pixel-um", "10"]
    assert main(arguments) == 0
    camera = tomllib.loads(capsys.readouterr().out)["cameras"]["UMK"]
    (kept,) = json.loads(record.read_text(encoding="utf-8"))["adjustment"]["cameras"]
    assert camera["c_mm"] == kept["values"][0]  # every digit of what the record holds
    adjusted = tankcal.adjust_job(tankcal.load(PHOTOS, only="adjustment")).adjusted
    assert camera["c_mm"] == pytest.approx(adjusted.camera(0)[0]["c"], rel=1e-12)
    assert camera["s_K3"] > 0
    assert {key: camera[key] for key in camera if key in in_mm} == {
        key: in_mm[key] for key in in_mm if key != "format_mm"
    }


CURVED_FILM = FILM + "x0_mm = 0.1\nK1 = -1e-6\nP1 = 2e-7\nA = 1e-4\n"


@pytest.mark.parametrize("form", ["opencv", "opencv-json", "colmap", "metashape", "pix4d"])
def test_film_needs_pixels_where_the_other_form_counts_in_them(form, tmp_path, capsys):
    (tmp_path / "film.toml").write_text(CURVED_FILM, encoding="utf-8")
    command = ["camera", "convert", str(tmp_path / "film.toml"), "--to", form]
    assert main(command) == 2
    told = capsys.readouterr().err
    assert "film.toml, longer.pixel_um: missing" in told
    assert "(--pixel-um)" in told
    assert main([*command, "--pixel-um", "10"]) == 0


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", ["silva", "pessoa", "dbat", "plain"])
def test_film_in_the_forms_of_publications(form, tmp_path, capsys):
    """Second method: the same film with pixels of 5 um; what is left is told as a length."""
    (tmp_path / "film.toml").write_text(CURVED_FILM, encoding="utf-8")
    command = ["camera", "convert", str(tmp_path / "film.toml"), "--to", "cameras.toml"]
    assert main([*command, "--as", form]) == 0
    printed = capsys.readouterr()
    film = tomllib.loads(printed.out)["cameras"]["longer"]
    assert " px " not in printed.err
    assert main([*command, "--as", form, "--pixel-um", "5"]) == 0
    fine = tomllib.loads(capsys.readouterr().out)["cameras"]["longer"]
    assert film.pop("format_mm") == [180, 130]
    assert "pixel_um" not in film
    del fine["format_px"], fine["pixel_um"]
    assert film.keys() == fine.keys()
    assert "s_y0_mm" not in film  # what rounding makes of a parameter without one is none
    for key in [key for key in film if isinstance(film[key], float)]:
        assert film[key] == pytest.approx(fine[key], rel=2e-3, abs=1e-14), key


def test_film_as_aicon_and_back(tmp_path, capsys):
    """Closed form: c, x0, K and P of the balanced form about 0 are the same numbers."""
    plain = "format_mm = [180, 130]\nc_mm = 100.3\nx0_mm = 0.1\nK1 = -1e-6\nP1 = 2e-7\n"
    (tmp_path / "film.toml").write_text(
        f'[cameras.film]\n{plain}convention = "distortion_of_ideal"\n', encoding="utf-8"
    )
    out = tmp_path / "film.ior"
    command = ["camera", "convert", str(tmp_path / "film.toml"), "--to", "aicon"]
    assert main([*command, "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert "format_width 180.0\nformat_height 130.0\n" in text
    assert "pixel" not in text
    capsys.readouterr()
    assert main(["camera", "convert", str(out), "--to", "cameras.toml"]) == 0
    found = tomllib.loads(capsys.readouterr().out)["cameras"]["film"]
    assert found["format_mm"] == [180, 130]
    assert [found[key] for key in ("c_mm", "x0_mm", "K1_mm-2", "P1_mm-1")] == [
        100.3, 0.1, -1e-6, 2e-7
    ]  # fmt: skip
    assert main(["camera", "convert", str(out), "--to", "cameras.toml", "--pixel-um", "10"]) == 0
    assert "format_px = [18000, 13000]" in capsys.readouterr().out
    out.write_text(text.replace("format_height 130.0\n", ""), encoding="utf-8")
    assert main(["camera", "convert", str(out), "--to", "cameras.toml"]) == 2
    assert "expected format_width and format_height" in capsys.readouterr().err


def converted_set(capsys, *arguments):
    """Keys of the camera that a conversion of the published set 1 prints."""
    command = ["camera", "convert", str(SEVEN), "--name", "set1", "--to", "cameras.toml"]
    assert main([*command, *arguments]) == 0
    return tomllib.loads(capsys.readouterr().out)["cameras"]["set1"]


@pytest.mark.slow
def test_convert_carries_standard_deviations_into_other_forms(capsys):
    """Published sds, which the form that has them keeps; in another, that of c is nearly the same,
    for what differs is below a pixel.
    """
    given = tomllib.loads(SEVEN.read_text(encoding="utf-8"))["cameras"]["set1"]
    same = converted_set(capsys, "--as", "pessoa")
    for key in ("c_mm", "x0_mm", "K1", "K2", "P1", "A", "B"):
        printed = next(one for one in same if one in (f"s_{key}", f"s_{key.split('_')[0]}"))
        assert same[printed] == pytest.approx(sd_of(given, key), rel=1e-9)
    silva = converted_set(capsys, "--as", "silva")
    assert {key for key in silva if key.startswith("s_")} >= {"s_c_mm", "s_K1", "s_P1", "s_B"}
    assert silva["s_c_mm"] == pytest.approx(same["s_c_mm"], rel=0.02)
    assert silva["s_B"] == pytest.approx(same["s_A"], rel=0.01)  # A x of both_x is near B y


def sd_of(camera, key):
    """A standard deviation by the key of its value, in either spelling."""
    name = key.split("_")[0]
    return next(camera[one] for one in (f"s_{key}", f"s_{name}") if one in camera)


def test_convert_keeps_parameters_without_sd(tmp_path, capsys):
    (tmp_path / "a.toml").write_text(
        "[cameras.a]\nformat_px = [6000, 4000]\npixel_um = 4\nc_mm = 24\nx0_mm = 0.1\nK1 = 1e-5\n"
        's_c = 0.01\ns_x0 = 0\nconvention = "correction_added"\n',
        encoding="utf-8",
    )
    command = ["camera", "convert", str(tmp_path / "a.toml"), "--to", "cameras.toml"]
    assert main([*command, "--as", "pessoa"]) == 0
    found = tomllib.loads(capsys.readouterr().out)["cameras"]["a"]
    sds = {key: value for key, value in found.items() if key.startswith("s_")}
    assert sds == {"s_c_mm": pytest.approx(0.01, rel=1e-9), "s_x0_mm": 0}
    assert found["K1_mm-2"] == -1e-5


@pytest.mark.slow
def test_convert_a_record_with_its_correlations(record, capsys):
    """Second method: the covariance of the record through the derivatives of the library."""
    command = ["camera", "convert", str(record), "--to", "cameras.toml", "--pixel-um", "10"]
    assert main([*command, "--as", "plain"]) == 0
    found = tomllib.loads(capsys.readouterr().out)["cameras"]["UMK"]
    ((_, camera),), (covariance,) = read_framed_cameras(load_record(record), 0.01)
    known = np.nan_to_num(covariance)
    frame = (camera.size_px, camera.pixel_mm)
    after = convert_camera(
        camera.interior, camera.form, Form(), *frame, covariance=known
    ).covariance
    sds = [found[key] for key in ("s_c_mm", "s_K1", "s_K2", "s_P1")]
    assert sds == pytest.approx(np.sqrt(np.diag(after))[[0, 3, 4, 7]].tolist(), rel=1e-9)
    alone = convert_camera(
        camera.interior, camera.form, Form(), *frame, covariance=np.diag(np.diag(known))
    )
    assert sds[1] != pytest.approx(np.sqrt(alone.covariance[3, 3]), rel=0.01)


def test_convert_keeps_a_file_that_is_there(tmp_path, capsys):
    target = tmp_path / "kept.xml"
    target.write_text("mine", encoding="utf-8")
    arguments = ["camera", "convert", str(SEVEN), "--name", "set1", "--to", "metashape"]
    assert main([*arguments, "--out", str(target)]) == 2
    assert "exists" in capsys.readouterr().err
    assert target.read_text(encoding="utf-8") == "mine"
    arguments[4] = "set9"
    assert main(arguments) == 2
    assert "expected one of set1, set2" in capsys.readouterr().err


def test_targets_of_a_photograph(tmp_path, capsys):
    cv2 = pytest.importorskip("cv2", reason="no OpenCV here: pip install 'tankcal[images]'")
    from tankcal.calibration.targets import target_image

    image = np.full((300, 300), 200, dtype=np.uint8)
    image[100:205, 80:185] = target_image("DICT_5X5_100", 17, 105, 0)
    blurred = cv2.GaussianBlur(image, None, 1.0)
    cv2.imwrite(str(tmp_path / "P1.png"), blurred)
    out = tmp_path / "image_points.csv"
    assert run("read", tmp_path / "P1.png", "--out", out) == 0
    assert "1 target, 4 image points in 1 photo; refused: 0" in capsys.readouterr().out
    rows = out.read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("photo,point,column_px,line_px")
    first = rows[1].split(",")
    assert first[:2] == ["P1", "17-1"]
    assert [float(value) for value in first[2:4]] == pytest.approx([79.5, 99.5], abs=0.02)
    assert run("read", tmp_path / "P1.png", "--out", out) == 2
    assert "already exists" in capsys.readouterr().err
    cv2.imwrite(str(tmp_path / "P2.jpg"), blurred)
    assert run("read", tmp_path / "P2.jpg", "--out", out, "--replace") == 0
    assert "taken as sRGB" in capsys.readouterr().err


@pytest.mark.slow
def test_papers_name_their_source(tmp_path):
    out = tmp_path / "papers"
    assert run("compare", SEVEN, "set1", "set2", "--grid", "6x5,300,300,700", "--out", out) == 0
    found = json.loads((out / "camera.json").read_text(encoding="utf-8"))["made_from"]
    digest = hashlib.sha256(SEVEN.read_bytes()).hexdigest()
    assert found["files"] == [{"file": "cameras.toml", "sha256": digest}]
    assert digest in (out / "report.html").read_text(encoding="utf-8")


def test_check_of_a_file_as_excel_writes_it_in_brazil(tmp_path, capsys):
    file = tmp_path / "d.csv"
    file.write_text("point;dx_m\nA;0,01\nB;-0,02\nC;0,005\n", encoding="utf-8")
    assert run("check", file, "--json") == 0
    assert json.loads(capsys.readouterr().out)["n"] == 3
    assert run("check", file, "--separator", ";", "--decimal", ",", "--json") == 0
    assert json.loads(capsys.readouterr().out)["n"] == 3
