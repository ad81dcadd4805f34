"""`tankcal read-table`: what it says, what it writes, and that the job gives the table again."""

import json

import numpy as np
import pytest
from former_tables import SimulatedTank, table_of
from numpy.testing import assert_allclose
from test_solid_geometry import lying

import tankcal
from tankcal.cli import main
from tankcal.products.recalibration.read_table import read_table

pytestmark = pytest.mark.slow  # seconds of fits

PLATES = np.array([0.010, 0.008, 0.006])
HEIGHTS = np.array([1.9, 2.0, 1.8])
LYING = [
    551, 1504, 2708, 4100, 5639, 7299, 9055, 10889, 12785, 14727, 16702, 18695,
    20695, 22687, 24660, 26600, 28493, 30323, 32074, 33727, 35258, 36640, 37831, 38766,
]  # fmt: skip


def tank(**more):
    return SimulatedTank(6.0 - PLATES, HEIGHTS, PLATES, **more)


def write_table(path, former):
    rows = zip(former.height_m, former.volume_m3, strict=True)
    lines = [f"{dip:.2f},{volume:.3f}" for dip, volume in rows]
    path.write_text("\n".join(["height_m,volume_m3", *lines]))


def write_courses(path, heights=HEIGHTS):
    rows = zip(heights, PLATES, strict=True)
    lines = [f"{k},{height},{1000 * plate:g}" for k, (height, plate) in enumerate(rows, 1)]
    path.write_text("\n".join(["course,height_m,thickness_mm", *lines]))


@pytest.fixture
def folder(tmp_path):
    write_table(tmp_path / "old.csv", table_of(tank(density_kg_m3=800.0)))
    write_courses(tmp_path / "courses.csv")
    return tmp_path


def run(folder, *arguments, old="old.csv", courses="courses.csv"):
    return main(["read-table", str(folder / old), "--courses", str(folder / courses), *arguments])


def _rows_of_run(folder):
    table = tankcal.run(tankcal.load(folder)).capacity
    return np.array(table.height_m), np.array(table.volume_m3)


def test_what_is_said(folder, capsys):
    assert run(folder) == 0
    said = capsys.readouterr().out
    assert "computed with the head of" in said
    assert "zero: the bottom of the first course" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    "made",
    [
        {"density_kg_m3": 800.0},
        {"density_kg_m3": 0.0, "zero_m": -0.02, "cone_m": 0.05},
        {"density_kg_m3": 900.0, "zero_m": 0.013, "deadwood": ((2.3, 2.9, -0.15),)},
    ],
)
def test_the_job_gives_the_table_again(tmp_path, made):
    """Invariance: read, run: each row within its rounding and what the reading leaves."""
    former = table_of(tank(**made))
    write_table(tmp_path / "old.csv", former)
    write_courses(tmp_path / "courses.csv")
    assert run(tmp_path, "--out", str(tmp_path / "job")) == 0
    dips, again = _rows_of_run(tmp_path / "job")
    volumes = np.interp(former.height_m, dips, again)
    used = former.height_m <= dips[-1] + 1e-9
    assert_allclose(volumes[used], former.volume_m3[used], rtol=0, atol=0.6e-3)


@pytest.mark.slow
def test_the_job_of_another_density(folder, tmp_path):
    """Second method: the same tank with another liquid, by numerical integration."""
    run(folder, "--out", str(tmp_path / "job"))
    settings = tmp_path / "job" / "job.toml"
    lines = settings.read_text().splitlines()
    lines = ["liquid_density_kg_m3 = 650.0" if "liquid_density" in one else one for one in lines]
    settings.write_text("\n".join(lines))
    dips, volumes = _rows_of_run(tmp_path / "job")
    assert_allclose(volumes, tank(density_kg_m3=650.0).volume_m3(dips), rtol=0, atol=2e-3)


@pytest.mark.slow
def test_a_record_gives_its_own_radii(folder, tmp_path, capsys):
    run(folder, "--out", str(tmp_path / "job"))
    main(["run", str(tmp_path / "job"), "--quiet"])
    record = tmp_path / "job" / "results" / "record.json"
    read = read_table(record)
    assert_allclose(read.geometry.radii_m, 6.0 - PLATES, rtol=0, atol=2e-5)
    assert read.job.covariance_m2.shape == (3, 3)
    assert main(["read-table", str(record), "--out", str(tmp_path / "again")]) == 0
    assert 'source = "record"' in (tmp_path / "again" / "job.toml").read_text()
    assert tankcal.load(tmp_path / "again").radii is not None


def test_a_lying_tank(tmp_path, capsys):
    """Published: recalibration.md, section 3."""
    lines = [f"{(k + 1) / 10:.1f},{volume}" for k, volume in enumerate(LYING)]
    (tmp_path / "lying.csv").write_text("\n".join(["dip_m,volume_L", *lines]))
    out = str(tmp_path / "job")
    assert (
        main(["read-table", str(tmp_path / "lying.csv"), "--kind", "horizontal", "--out", out]) == 0
    )
    said = capsys.readouterr().out
    assert "2.499967" in said
    assert "8.00018" in said
    assert tankcal.load(out).tank.kind == "horizontal"


@pytest.mark.slow
def test_a_tilt_that_is_not_found_is_said_to_be_none(tmp_path, capsys):
    """By slices, level: the fit ends at a tilt of 7e-10 whose u is infinite."""
    dips = np.arange(0, 201, 2) / 100
    lines = [f"{d:.2f},{1000 * v:.0f}" for d, v in zip(dips, lying(dips, 2.0, 6.0), strict=True)]
    (tmp_path / "lying.csv").write_text("\n".join(["dip_m,volume_L", *lines]))
    assert main(["read-table", str(tmp_path / "lying.csv"), "--kind", "horizontal"]) == 0
    said = capsys.readouterr().out
    assert "tilt as additional unknown: no tilt improves the fit; up to 0.8 mm/m" in said
    assert "lowers chi2" not in said


@pytest.mark.slow
def test_a_leaning_tank_that_is_dipped_near_its_low_end(tmp_path):
    """By slices: 8 mm/m over 9 m; the lowest liquid lies below the bottom at half the length."""
    dips = np.arange(0, 261, 2) / 100
    volumes = lying(dips, 2.6, 9.0, tilt=0.008, place=1.5)
    lines = [f"{dip:.2f},{1000 * v:.0f}" for dip, v in zip(dips, volumes, strict=True)]
    (tmp_path / "lying.csv").write_text("\n".join(["dip_m,volume_L", *lines]))
    said = '[former]\nfile = "lying.csv"\nkind = "horizontal"\ndip_from_a_m = 1.5\n'
    (tmp_path / "former.toml").write_text(said)
    fit = read_table(tmp_path / "former.toml").geometry.best
    assert fit.variance_factor == 1
    for name, truth in (("diameter", 2.6), ("length", 9.0), ("zero", 0.0), ("tilt", 0.008)):
        value, u = fit[name]
        assert abs(value - truth) < 3 * u


@pytest.mark.parametrize("kind", ["sphere", "horizontal"])
def test_a_table_of_another_kind_of_tank_is_refused(folder, capsys, kind):
    """An upright tank's rows: no sphere and no lying tank has them."""
    assert run(folder, "--kind", kind, "--out", str(folder / "job")) == 3
    said = capsys.readouterr().err
    assert ("no tank of this kind" if kind == "sphere" else "depart by ") in said
    assert not (folder / "job").exists()


@pytest.mark.parametrize("bottom", ["50", "5.69"])
def test_a_bottom_above_the_rows_is_refused(folder, capsys, bottom):
    assert run(folder, "--bottom", bottom) == 2
    assert "--bottom: " in capsys.readouterr().err


def test_the_job_asks_for_the_language_of_the_run(folder, capsys):
    out = folder / "job"
    assert run(folder, "--out", str(out), "--language", "pt-BR") == 0
    assert tankcal.load(out).table.language == "pt-BR"


@pytest.mark.parametrize("language", ["pt-BR", "es"])
def test_the_job_says_nothing_in_english(language, tmp_path):
    thing = ((2.5, 3.1, -0.2),)
    write_table(tmp_path / "old.csv", table_of(tank(density_kg_m3=800.0, deadwood=thing)))
    write_courses(tmp_path / "courses.csv")
    assert run(tmp_path, "--out", str(tmp_path / "job"), "--language", language) == 0
    said = (tmp_path / "job" / "job.toml").read_text(encoding="utf-8")
    assert f'note = "{"lido" if language == "pt-BR" else "leído"} de old.csv"' in said
    assert "\nobjeto-1,2.4998,3.1000," in (tmp_path / "job" / "deadwood.csv").read_text(
        encoding="utf-8"
    )
    tankcal.load(tmp_path / "job")


def test_u_of_the_former_table_is_that_of_all_radii(folder):
    """Closed form: U/V of 0.2 %, k = 2, is 0.05 % of the radius."""
    toml = folder / "former.toml"
    toml.write_text("[former]\nU_percent = 0.2\nk = 2\nreference_temperature_c = 15\n")
    text = read_table(folder / "old.csv", folder / "courses.csv", toml).job.texts["job.toml"]
    assert "u_common_mm = 2.996" in text
    assert "reference_temperature_c = 15" in text


def test_a_folder_of_somebody_else_stays(folder, capsys):
    (folder / "job").mkdir()
    (folder / "job" / "mine.txt").write_text("mine")
    assert run(folder, "--out", str(folder / "job")) == 2
    assert "mine.txt" in capsys.readouterr().err
    assert [path.name for path in (folder / "job").iterdir()] == ["mine.txt"]


def _spoil(folder, name, text):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("courses.csv", "course,height_m,thickness_mm\n", "no rows"),
        ("courses.csv", "course,height_m,thickness_mm\n1,1.9,10\n", "the courses reach 1.9 m"),
        ("courses.csv", "course,height_m,thickness_mm\n1,1.9,0.010\n", "is it in metres"),
        ("courses.csv", "course,height_m,thickness_mm\n1,1.9,10\n2,,8\n3,1.8,6\n", "or of none"),
        ("courses.csv", "course,height_m\n1,1.9\n", "thickness_mm: missing column"),
        ("courses.csv", bytes(range(256)), "courses.csv"),
        ("old.csv", bytes(range(256)) * 9, "old.csv"),
        ("old.csv", "", "old.csv: empty"),
        ("old.csv", "height_m,volume_m3\n0,0\n1,113\n", "2 rows"),
        ("old.csv", "height_m,volume_m3\n0,0\n1,113\n2,226\n3,339\n", "expected 8 or more"),
        ("old.csv", "height_m,volume_m3\n0,0\n1,113\n2,90\n3,339\n4,452\n", "errors (1)"),
        ("old.csv", "ullage_m,volume_m3\n3,0\n2,113\n1,226\n0,339\n", "table of ullages"),
    ],
)
def test_bad_input_is_told_in_a_line(folder, capsys, name, content, said):
    _spoil(folder, name, content)
    assert run(folder, "--out", str(folder / "job")) == 2
    assert said in capsys.readouterr().err
    assert not (folder / "job").exists()


def test_without_courses(folder, capsys):
    assert main(["read-table", str(folder / "old.csv")]) == 2
    assert "--courses" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["horizontal", "sphere"])
def test_a_solid_that_cannot_be_read_asks_for_no_courses(kind, tmp_path, capsys):
    (tmp_path / "old.csv").write_text("height_cm,volume_l\n0,0\n50,1000\n100,900\n150,5000\n")
    assert main(["read-table", str(tmp_path / "old.csv"), "--kind", kind]) == 2
    complaint = capsys.readouterr().err
    assert "old.csv" in complaint
    assert "--courses" not in complaint


@pytest.mark.parametrize("low", [None, 0, 2, 3])
def test_seams_of_courses_that_do_not_fit_are_told(low, tmp_path, capsys):
    """Simulated: five courses of 2.4 m; two neighbours are declared as 1.9 and 2.9 m."""
    heights, plates = np.full(5, 2.4), np.array([0.012, 0.010, 0.008, 0.007, 0.006])
    truth = SimulatedTank(6.5 - plates, heights, plates, density_kg_m3=900.0)
    write_table(tmp_path / "old.csv", table_of(truth, step_m=0.1))
    if low is not None:
        heights[low : low + 2] = 1.9, 2.9
    rows = [f"{k},{h},{1000 * t:g}" for k, (h, t) in enumerate(zip(heights, plates, strict=True))]
    (tmp_path / "courses.csv").write_text("\n".join(["course,height_m,thickness_mm", *rows]))
    assert run(tmp_path) == 0
    said = capsys.readouterr()
    assert ("do not fit the table: with seams at 2.40, 4.80, 7.20, 9.60 m" in said.err) == (
        low is not None
    )
    assert ("no deadwood detected" in said.out) == (low is None)


def test_courses_that_are_not_reached_are_left_out(folder):
    rows = (folder / "old.csv").read_text().splitlines()
    (folder / "old.csv").write_text("\n".join(rows[:380]))
    read = read_table(folder / "old.csv", folder / "courses.csv")
    assert read.names == ("1", "2")
    assert any(one.code == "read_not_reached" for one in read.warnings)


def test_a_record_that_is_none(folder, capsys):
    _spoil(folder, "record.json", json.dumps({"format": "tankcal-record/2"}))
    assert run(folder, old="record.json") == 2
    assert "record.json" in capsys.readouterr().err
