"""`tankcal inspect` of jobs and records, what it refuses, and rules of one's own."""

import json
from pathlib import Path

import pytest
from conftest import EXAMPLE
from job_builder import write_job

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.job.tables import Log
from tankcal.products.inspection.inspecting import Asked, inspect_files
from tankcal.products.inspection.rules import find_rule, parse_rule
from tankcal.record import record_of, save
from tankcal.record.inspection import CHECKS
from tankcal.record.schema import to_plain
from tankcal.terminal import read_record_language

LEVELLED = EXAMPLE.parent / "inspection"
OF_WALL = CHECKS[:5]
HOUSE = """[rule]
name = "House"
source = "drawing 12"
verified = true
[plumbness]
part_of_height = 0.002
[roundness]
above_mm = 60
"""


@pytest.fixture(scope="module")
def kept(example_result, tmp_path_factory):
    """The record of the example, in a folder of results."""
    folder = tmp_path_factory.mktemp("results")
    save(record_of(example_result), folder / "record.json")
    return folder


def numbers(found):
    return [(one.code, one.value, one.U, one.verdict) for one in found.checks]


def refused(capsys, *arguments):
    """Lines of a refusal; nothing is printed of an inspection."""
    assert main(["inspect", *map(str, arguments), "--quiet"]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in error
    return error.splitlines()


@pytest.mark.slow
def test_a_record_is_inspected_as_its_job(kept):
    """Second way: the job computed anew, and what the record kept of it."""
    job, record = (inspect_files(Asked(one)) for one in (EXAMPLE, kept))
    assert numbers(job) == [
        (code, pytest.approx(value), pytest.approx(U), verdict)
        for code, value, U, verdict in numbers(record)
    ]
    assert (job.tank.source, record.tank.source) == ("job", "record")
    assert job.tank.sha256 is None
    assert len(record.tank.sha256) == 64
    assert [one.code for one in job.checks] == [*OF_WALL, "peaking", "banding"]
    assert all(one.U is not None for one in job.checks if one.value is not None)
    assert job.tank.methods == ["points"]
    assert not job.rule.verified


@pytest.mark.slow
def test_an_older_record_says_why_it_cannot_be_inspected(kept, tmp_path, capsys):
    record = json.loads((kept / "record.json").read_text(encoding="utf-8"))
    del record["wall_shape"]
    save(record, tmp_path / "record.json")
    (line,) = refused(capsys, tmp_path / "record.json")
    assert "did not keep the shape of its wall" in line
    found = inspect_files(
        Asked(tmp_path, settlement=LEVELLED / "settlement.csv", yield_pa=250e6)
    )  # what was levelled needs no wall
    assert {one.verdict for one in found.checks if one.code in OF_WALL} == {"not_determined"}
    assert len(found.settlements) == 3
    assert found.as_built
    assert any(one.code == "inspect_older_record_alone" for one in found.warnings)


@pytest.mark.slow
def test_levellings_beside_a_job_are_taken(tmp_path):
    folder = write_job(tmp_path / "job", settings={"inspection.yield_mpa": 250.0})
    for name in ("settlement.csv", "edge_profiles.csv"):
        (folder / name).write_bytes((LEVELLED / name).read_bytes())
    found = inspect_files(Asked(folder))
    codes = [one.code for one in found.checks]
    assert [*codes[:5], *codes[-2:]] == [*OF_WALL, "edge_settlement", "bottom_bulge"]
    (change,) = [one for one in found.checks if one.code == "settlement_all" and " - " in one.epoch]
    assert change.limit.value == pytest.approx(4.58, abs=0.01)  # 11 L^2 Y / (2 E H), Y of the job
    assert change.verdict == "guard_band"


@pytest.mark.slow
def test_a_rule_of_the_job_and_one_of_the_house(tmp_path):
    folder = write_job(tmp_path / "job", settings={"inspection.rule": "house.toml"})
    (folder / "house.toml").write_text(HOUSE, encoding="utf-8")
    found = inspect_files(Asked(folder))
    limits = {one.code: one.limit and one.limit.value for one in found.checks}
    assert limits["plumbness_axis"] == pytest.approx(19.0)
    assert (limits["roundness_low"], limits["roundness_high"]) == (60.0, None)
    assert found.rule.name == "House"
    assert found.rule.verified
    asked = inspect_files(Asked(folder, rule="api_650"))  # what is asked for counts first
    assert asked.rule.file == "api_650.toml"


def test_a_rule_that_is_not_there_is_named():
    log = Log()
    assert find_rule("houses/missing.toml", log) is None
    (problem,) = log.problems
    assert "houses/missing.toml" in str(problem)


def test_every_problem_of_a_rule_is_told_at_once():
    log = Log()
    text = '[rule]\nname = "x"\n[plumbnes]\n[roundness]\nabove_mm = -3\nby_diameter = [[1]]\n'
    assert parse_rule("house.toml", text.encode(), log) is None
    told = "\n".join(map(str, log.problems))
    for one in ("rule.source", "[plumbnes]", "did you mean plumbness", "roundness.above_mm",
                "roundness.by_diameter"):  # fmt: skip
        assert one in told


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["examples/liquid-lying"], "expected an upright one"),
        (["examples/silva-1995", "--rule", "api_563"], "did you mean api_653"),
        (["examples/silva-1995", "--rule", "none.toml"], "no such file"),
        (["examples/silva-1995", "--settlement", "none.csv"], "none.csv"),
        (["nowhere"], "nowhere"),
    ],
)
def test_what_cannot_be_inspected_is_told_in_one_line(capsys, arguments, told, monkeypatch):
    monkeypatch.chdir(EXAMPLE.parents[1])
    (line,) = refused(capsys, *arguments)
    assert told in line


def test_a_wall_of_straps_is_not_determined():
    """Property: what was not surveyed never passes."""
    found = inspect_files(Asked(EXAMPLE.parent / "strapping"))
    assert {one.verdict for one in found.checks} == {"not_determined"}
    assert found.tank.methods == ["straps"]
    assert not found.levels


@pytest.mark.slow
def test_mean_radii_as_nominal_take_off_what_all_share():
    """Closed form: departures from the mean of a level have the mean zero."""
    found = inspect_files(Asked(EXAMPLE, nominal="mean"))
    assert found.tank.nominal_source == "mean"
    radii = [one.mean_radius_m for one in found.levels]
    assert found.tank.nominal_diameter_m == pytest.approx(2 * sum(radii) / len(radii))
    for level in found.levels:
        assert sum(level.departure_mm) / len(level.departure_mm) == pytest.approx(0, abs=1e-6)
    low = next(one for one in found.checks if one.code == "roundness_low")
    assert low.limit.value == 19.0  # that of the nominal diameter


def test_foreign_folders_are_left_alone(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    lines = refused(capsys, EXAMPLE, "--out", tmp_path)
    assert lines
    assert [one.name for one in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_json_is_what_is_saved(capsys, kept):
    assert main(["inspect", str(kept), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    expected = to_plain(inspect_files(Asked(kept)))
    assert {key: found[key] for key in expected} == json.loads(json.dumps(expected))


def test_a_line_for_each_check(capsys, kept):
    assert main(["inspect", str(kept), "--quiet", "--language", "es"]) == 0
    out = capsys.readouterr().out.replace("\N{NO-BREAK SPACE}", " ").splitlines()
    assert len(out) == 2 + 7  # the rule, that it was not read, the checks
    assert "Verticalidad, eje: +29,1 mm, U 14,3 mm, límite ≤ 95 mm" in out[2]


@pytest.mark.slow
def test_it_speaks_the_language_of_its_job_or_record(tmp_path, capsys):
    job = write_job(tmp_path / "job", settings={"table.language": "es"})
    assert main(["inspect", str(job), "--quiet", "--out", str(tmp_path / "out")]) == 0
    assert main(["inspect", str(job), "--quiet", "--language", "pt-BR"]) == 0
    out = capsys.readouterr().out
    assert "Verticalidad, eje" in out
    assert "Verticalidade, eixo" in out
    (tmp_path / "record.json").write_text('{"job": {"table": {"language": "pt-BR"}}}')
    assert (
        read_record_language(tmp_path) == read_record_language(tmp_path / "record.json") == "pt-BR"
    )
    for text in ("{", "[1]", '{"job": 1}', "[" * 100_000):
        (tmp_path / "record.json").write_text(text)
        assert read_record_language(tmp_path) is None
    assert read_record_language(tmp_path / "none") is None


@pytest.mark.parametrize("strength", ["250e6", "36000", "-1", "nan"])
def test_a_yield_stress_in_another_unit_is_refused(capsys, strength):
    """Pascals would make every limit of settlement wide enough; the job has the same bound."""
    with pytest.raises(SystemExit) as end:
        main(["inspect", str(EXAMPLE), f"--yield-mpa={strength}"])
    assert end.value.code == 2
    assert "--yield-mpa" in capsys.readouterr().err


def test_settlement_is_refused_whole(tmp_path):
    """Every problem of both tables, before a survey is computed."""
    for name, text in (("a.csv", "point,elevation_m\nP1,x\n"), ("b.csv", "radius_m\n1\n")):
        Path(tmp_path, name).write_text(text)
    with pytest.raises(InputError) as refusal:
        inspect_files(Asked(EXAMPLE, settlement=tmp_path / "a.csv", edges=tmp_path / "b.csv"))
    files = {one.file for one in refusal.value.problems}
    assert files == {"a.csv", "b.csv"}


def test_record_whose_levels_do_not_fit_is_refused(example_record, tmp_path):
    """Found by mutated inputs: a height of a level that no other part of the record has."""
    record = json.loads(example_record.read_text(encoding="utf-8"))
    record["wall_shape"]["levels"][-1]["height_m"] += 0.125
    for level in record["wall_shape"]["levels"][1:]:
        level["is_low"] = True
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(InputError, match="does not have the content of a record"):
        inspect_files(Asked(path))
