"""Answers of any program: read, and all that is wrong with them told at once."""

import json

import numpy as np
import pytest
from packages import answers_of, write_answers, write_template, written_package

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.job.tables import Log
from tankcal.products.intercomparison.answers import read_answers, score_folders
from tankcal.record.intercomparison import ANSWERS, SCORES
from tankcal.record.schema import to_plain


@pytest.fixture
def world(tmp_path):
    package, truth, manifest, content = written_package(tmp_path)
    folder = write_answers(tmp_path / "answers", answers_of(manifest, content, factor=1.0002))
    return {"package": package, "truth": truth, "manifest": manifest, "content": content,
            "folder": folder, "tmp": tmp_path}  # fmt: skip


def scored(world, *folders):
    return to_plain(score_folders(folders or [world["folder"]], world["truth"]))


def asked_of(manifest):
    methods = {one["method"] for one in manifest["jobs"]}
    return {one["tank"]: (one["heights_m"], methods) for one in manifest["tanks"]}


@pytest.mark.slow
def test_a_round_trip(world):
    log = Log()
    found = read_answers(world["folder"], asked_of(world["manifest"]), log)
    assert log.problems + log.warnings == []
    wanted = answers_of(world["manifest"], world["content"], factor=1.0002)
    assert found.saved.participant == wanted.participant
    for one, other in zip(found.saved.answers, wanted.answers, strict=True):
        np.testing.assert_allclose(one.volume_m3, other.volume_m3, rtol=1e-8)


def test_scores_of_known_answers(world):
    """By hand: 200 ppm of the volume with U of 500 ppm and k = 2."""
    found = scored(world)
    SCORES.migrated(json.loads(json.dumps(found)), "scores.json")
    for one in found["tables"]:
        assert one["top_error_ppm"] == pytest.approx(200.0, abs=1e-2)
        assert one["top_E_n"] == pytest.approx(0.4, abs=1e-4)
        assert one["rms_zeta"] == pytest.approx(0.8, abs=1e-4)
    whole = found["methods"][-1]
    assert (whole["method"], whole["tables"], whole["tops_within"]) == ("*", 4, 4)


def test_brazilian_spreadsheets(world):
    folder = world["folder"]
    for path in folder.glob("*.csv"):
        text = path.read_text("utf-8").replace(",", ";").replace(".", ",")
        path.write_text("\ufeff" + text, "utf-8")
    toml = folder / "participant.toml"
    toml.write_text(toml.read_text("utf-8") + '[csv]\nseparator = ";"\ndecimal = ","\n', "utf-8")
    assert scored(world)["tables"][0]["top_error_ppm"] == pytest.approx(200.0, abs=1e-2)


def test_answers_as_json(world):
    from tankcal.record.schema import to_plain

    folder = world["tmp"] / "json"
    folder.mkdir()
    saved = to_plain(answers_of(world["manifest"], world["content"], factor=1.0002))
    (folder / ANSWERS.file).write_text(json.dumps(saved), "utf-8")
    other = scored(world, folder)
    assert other["tables"][0]["top_E_n"] == pytest.approx(
        scored(world)["tables"][0]["top_E_n"], 1e-4
    )


def test_missing_U_and_heights_are_told_and_scored(world):
    path = world["folder"] / "T01_points.csv"
    lines = path.read_text("utf-8").splitlines()
    cut = [lines[0], *(",".join([*line.split(",")[:2], "", ""]) for line in lines[1:-3])]
    path.write_text("\n".join(cut) + "\n", "utf-8")
    (world["folder"] / "T02_points.csv").unlink()
    found = scored(world)
    one = next(t for t in found["tables"] if t["tank"] == "T01" and t["method"] == "points")
    assert (one["missing"], one["judged"], one["top_error_ppm"]) == (3, 0, None)
    assert [w["code"] for w in found["warnings"]] == ["ic_missing_heights"]
    points = next(m for m in found["methods"] if m["method"] == "points")
    assert (points["tables"], points["asked"]) == (1, 2)


def test_coverage_in_place_of_k(world):
    path = world["folder"] / "T01_points.csv"
    lines = path.read_text("utf-8").splitlines()
    rows = [",".join([*line.split(",")[:3], "0.95"]) for line in lines[1:]]
    path.write_text("\n".join(["height_m,volume_m3,U_m3,coverage", *rows]) + "\n", "utf-8")
    one = scored(world)["tables"][0]
    assert one["rms_zeta"] == pytest.approx(0.4 * 1.959964, abs=1e-4)


SPOILT = {
    "T01_points.csv": [
        ("height_m,", "hoogte,", "unknown column"),
        ("\n0.5,", "\n0.51,", "was not asked"),
        ("\n0.5,", "\n0.3,", "stands in row"),
        ("\n0.5,", "\nabc,", "expected a number"),
        ("volume_m3", "volume", "missing column"),
        ("\n0.5,", "\n0.5,-", "-"),
        (",2\n", ",0\n", "above 0"),
        ("\n0.5,", "\n0.5,,1,2,3,", "cell"),
    ],
    "participant.toml": [
        ("name = ", "nome = ", "unknown key"),
        ('software = "hand"', 'software = ""', "software"),
        ("date = 2026-05-05", "date = 2026-15-05", "found 2026-15-05; expected a date"),
        ("[participant]", "[participants]", "unknown section"),
        ("[participant]", '[csv]\nseparator = ";"\ndecimal = ";"\n[participant]', "decimal"),
    ],
}


@pytest.mark.slow(after=8)
@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [(file, *one) for file, some in SPOILT.items() for one in some],
)
def test_bad_answers_are_told(world, capsys, file, old, new, said):
    path = world["folder"] / file
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")
    out = world["tmp"] / "out"
    status = main(["intercomparison", "score", str(world["folder"]), "--truth",
                   str(world["truth"]), "--out", str(out), "--quiet"])  # fmt: skip
    assert status == 2
    assert said in capsys.readouterr().err
    assert not out.exists()


def test_all_problems_of_all_folders_come_at_once(world, capsys):
    other = write_answers(world["tmp"] / "other", answers_of(world["manifest"], world["content"]))
    (world["folder"] / "T09_points.csv").write_text("height_m,volume_m3\n", "utf-8")
    (other / "participant.toml").unlink()
    path = other / "T02_points.csv"
    path.write_text(path.read_text("utf-8").replace("\n0.5,", "\n0.52,"), "utf-8")
    status = main(["intercomparison", "score", str(world["folder"]), str(other), "--truth",
                   str(world["truth"]), "--quiet"])  # fmt: skip
    lines = capsys.readouterr().err.splitlines()
    assert status == 2
    assert len(lines) == 3
    assert any("answers/T09_points.csv" in one and "did you mean" in one for one in lines)
    assert any("other/participant.toml" in one for one in lines)
    assert any("other/T02_points.csv" in one for one in lines)


def test_an_empty_form_is_no_answer(world, capsys):
    folder = write_template(world["tmp"] / "forms", world["manifest"])
    status = main(["intercomparison", "score", str(folder), "--truth", str(world["truth"]),
                   "--quiet", "--language", "pt-BR"])  # fmt: skip
    lines = capsys.readouterr().err
    assert status == 2
    assert "nome do participante" in lines
    assert "name of" not in lines


def test_a_filled_form_is_scored(world):
    """As a spreadsheet user does it: the volumes alone, in the forms of `template`."""
    folder = write_template(world["tmp"] / "forms", world["manifest"])
    toml = folder / "participant.toml"
    text = toml.read_text("utf-8").replace('name = ""', 'name = "Ana"', 1)
    text = text.replace('software = ""', 'software = "Excel"').replace(
        'version = ""', 'version = "16"'
    )
    toml.write_text(text, "utf-8")
    true = world["content"]["tanks"][0]
    rows = [f"{h:g},{v:.4f},," for h, v in zip(true["heights_m"], true["volume_m3"], strict=True)]
    (folder / "T01_points.csv").write_text("\n".join(["height_m,volume_m3,U_m3,k", *rows]), "utf-8")
    found = scored(world, folder)
    assert len(found["tables"]) == 1
    assert found["tables"][0]["rms_ppm"] < 0.1


@pytest.mark.parametrize("spoil", [
    lambda one: one["answers"][0].update(tank="T77"),
    lambda one: one["answers"][0]["volume_m3"].pop(),
    lambda one: one["answers"].append(one["answers"][0]),
    lambda one: one["answers"][0]["U_m3"].__setitem__(0, -1.0),
    lambda one: one["participant"].pop("name"),
    lambda one: one.update(format="other/1"),
])  # fmt: skip
def test_bad_json_is_told(world, spoil):
    from tankcal.record.schema import to_plain

    folder = world["tmp"] / "json"
    folder.mkdir()
    saved = to_plain(answers_of(world["manifest"], world["content"]))
    spoil(saved)
    (folder / ANSWERS.file).write_text(json.dumps(saved), "utf-8")
    with pytest.raises(InputError) as caught:
        scored(world, folder)
    assert len(caught.value.problems) == 1


def test_a_table_of_a_million_rows_is_told_in_one_line(world):
    path = world["folder"] / "T01_points.csv"
    path.write_text("height_m,volume_m3\n" + "0.5,94\n" * 1000, "utf-8")
    with pytest.raises(InputError) as told:
        scored(world)
    assert [one.expected.code for one in told.value.problems] == ["ic_too_many_rows"]


def test_tables_beside_no_participant_are_read_by_the_marks_they_have(world):
    """Their own problems are told with it, and none that a comma would make of ; in them."""
    for path in world["folder"].glob("*.csv"):
        text = path.read_text("utf-8").replace(",", ";").replace(".", ",")
        path.write_text(text.replace("\n0,5;", "\n0,51;") if "T01" in path.name else text, "utf-8")
    settings = world["folder"] / "participant.toml"
    with pytest.raises(InputError) as told:
        scored(world)
    assert {one.expected.code for one in told.value.problems} == {"ic_not_asked"}
    for spoilt in ("[participant\n", None):
        settings.unlink() if spoilt is None else settings.write_text(spoilt, "utf-8")
        with pytest.raises(InputError) as told:
            scored(world)
        first, *others = told.value.problems
        assert first.file == "participant.toml"
        assert {one.expected.code for one in others} == {"ic_not_asked"}
        assert {one.file[:3] for one in others} == {"T01"}


def test_missing_heights_have_the_decimal_mark_of_the_language(world, capsys):
    path = world["folder"] / "T01_points.csv"
    lines = path.read_text("utf-8").splitlines()
    path.write_text("\n".join([lines[0], *lines[3:]]) + "\n", "utf-8")
    truth = str(world["truth"])
    main(["intercomparison", "score", str(world["folder"]), "--truth", truth, "--language",
          "pt-BR", "--quiet"])  # fmt: skip
    assert "alturas sem volume (0,3 m, 0,5 m)" in capsys.readouterr().err
