"""A traverse round a tank whose scale is a stadia's: its plan, its job, what is refused.

Truth: the empty job filled in; the same distances by a ranger of that scale; closed form.
"""

import numpy as np
import openpyxl
import pytest
from messages_told import lines
from wall_plan_folders import BAR_M, TANGENTS, fill, plan_of, with_bar

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.planning import load_plan, predict, what_helps
from tankcal.planning.improvements import changes_of, cost_of
from tankcal.planning.wall.prediction import predict_wall_table
from tankcal.report.planning import empty_job
from tankcal.report.planning.rows import field_tables_of_wall
from tankcal.report.planning.wall_paper import WallPaper, wall_sheets

SIDE_M = 2 * 12.5 * np.sin(np.pi / 8)  # of the ring
ARCSEC = np.pi / 180 / 3600
DAY = {"date": '"2026-07-01"', "shell_temperature_c": 20.0, "bottom_z_m": 0.0}
SLOW_FIXTURES = {"prediction"}


@pytest.fixture(scope="module")
def prediction(tmp_path_factory):
    return predict(load_plan(with_bar(tmp_path_factory.mktemp("bar"))))


def test_the_empty_job_filled_in_is_the_plan(prediction, tmp_path):
    """Second method: U of the job with the plan's amplitudes, in every row."""
    plan = prediction.plan
    empty_job.write_wall(prediction, tmp_path / "job")
    assert not (tmp_path / "job" / "slope_distances.csv").read_text().count("\n1,")
    fill(tmp_path / "job", plan.job, DAY)
    found = predict_wall_table(tankcal.load(tmp_path / "job"), plan.amplitudes).computed_table.table
    np.testing.assert_allclose(found.U_m3, prediction.table.U_m3, rtol=1e-8)
    np.testing.assert_allclose(found.volume_m3, prediction.table.volume_m3, rtol=1e-9)


def test_rows_of_the_workbook(prediction, tmp_path):
    """Two angles from each of eight stations, without a value, in the language's own sheet."""
    empty_job.write_wall(prediction, tmp_path / "job", workbook=True)
    assert [one.name for one in (tmp_path / "job").iterdir()] == ["job.xlsx"]
    sheet = openpyxl.load_workbook(tmp_path / "job" / "job.xlsx")["stadia"]
    rows = [[cell.value for cell in row][1:3] for row in sheet.iter_rows()]
    assert sum(row in (["1", "S2"], ["2", "S1"]) for row in rows) == 2


def test_a_ranger_of_that_scale_is_as_good(prediction, tmp_path):
    """Second method: distances with sd d^2 / b times that of the angle, u_scale = u_mm / length."""
    sd_m = (SIDE_M**2 + BAR_M**2 / 4) / BAR_M * ARCSEC
    folder = plan_of(tmp_path, TANGENTS, ("s_mm = 0.5", f"s_mm = {float(1000 * sd_m)}"))
    text = (folder / "instruments.toml").read_text()
    (folder / "instruments.toml").write_text(text.replace("ppm = 5.0", "ppm = 25"))
    found = predict(load_plan(folder))
    np.testing.assert_allclose(found.table.U_m3, prediction.table.U_m3, rtol=1e-4)
    scales = [
        next(np.abs(one.columns_m3[-1]).sum() for one in each.table.sources if one.kind == name)
        for each in (found, prediction)
        for name in ("instrument_scale",)
    ]
    assert scales[1] == pytest.approx(scales[0], rel=1e-6)
    volume = prediction.table.volume_m3[-1]
    assert scales[1] / volume == pytest.approx(2 * 0.05e-3 / BAR_M, rel=0.02)  # closed form


def test_sheets_of_the_crew(prediction):
    tables = field_tables_of_wall(prediction.plan)
    rows, _ = tables["bases"]
    assert len(rows) == 16
    assert {round(row["expected_m"], 3) for row in rows} == {round(SIDE_M, 3)}
    angle = 2 * np.arctan(BAR_M / 2 / SIDE_M)
    assert rows[0]["expected_rad"] == pytest.approx(angle, rel=1e-4)
    assert "distance" not in {one.key for one in tables["traverse"][1]}
    for language in ("en", "pt-BR", "es"):
        paper = WallPaper(prediction, language)
        assert paper.words["texts"]["bases"] in str([one.data for one in wall_sheets(paper)])


def effects_of_bars(plan):
    return what_helps(plan, changes_of(plan, items=("bar", "ranging")))


@pytest.mark.slow
def test_changes_of_a_bar(tmp_path):
    """A bar beside distances never widens U, and each of the two can be left out."""
    plan = load_plan(with_bar(tmp_path / "bar", ("s_arcsec = 2", "s_mm = 0.5\ns_arcsec = 2")))
    assert cost_of(plan) == 8 * 40 + 160 * 0.5
    effects = {(one.change.action, one.change.item): one for one in effects_of_bars(plan)}
    assert effects["drop", "bar"].difference > 0
    assert effects["drop", "ranging"].difference > 0
    assert effects["drop", "bar"].change.name == "bar 1"
    alone = effects["drop", "bar"].change.plan
    added = {(one.change.action, one.change.item): one for one in effects_of_bars(alone)}
    assert added["add", "bar"].difference < 0
    assert ("drop", "ranging") not in added


BAD = [  # what is changed in the plan, in instruments.toml; where it is told
    (("s_bar_arcsec = 1", "# none"), ("", ""), ("plan.toml", "traverse.s_mm")),
    (
        ("s_bar_arcsec = 1", 's_mm = 1\nbar = "bar 1"'),
        ("", ""),
        ("plan.toml", "traverse.s_bar_arcsec"),
    ),
    (("s_bar_arcsec = 1", "s_bar_arcsec = 0"), ("", ""), ("plan.toml", "traverse.s_bar_arcsec")),
    (("s_bar_arcsec = 1", 's_bar_arcsec = 1\nbar = "B"'), ("", ""), ("plan.toml", "traverse")),
    (("", ""), ('kind = "stadia"', 'kind = "bar"'), ("plan.toml", "traverse")),
    (("", ""), ("length_m = 2.0\n", ""), ("instruments.toml", "bar 1.length_m")),
    (("", ""), ("u_mm = 0.05", ""), ("instruments.toml", "bar 1.u_mm")),
]


@pytest.mark.slow(after=3)
@pytest.mark.parametrize(("in_plan", "in_register", "place"), BAD)
def test_bad_bar_is_one_line(tmp_path, in_plan, in_register, place, capsys):
    folder = with_bar(tmp_path)
    for name, (old, new) in (("plan.toml", in_plan), ("instruments.toml", in_register)):
        text = (folder / name).read_text()
        (folder / name).write_text(text.replace(old, new) if old else text)
    with pytest.raises(InputError) as error:
        load_plan(folder)
    told = lines(error.value.problems)
    assert [(one.file, one.column) for one in error.value.problems] == [place], told
    assert main(["plan", str(folder), "--quiet"]) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.slow
def test_numbers_in_names_of_changes(tmp_path):
    """A station of the traverse is called by its radius, in the marks of the language."""
    plan = load_plan(plan_of(tmp_path, TANGENTS, ("radius_m = 12.5", "radius_m = 12.75")))
    found = next(one for one in changes_of(plan, ("add",), ("station",)))
    assert "." in found.name
    prediction = predict(plan)
    papers = {one: WallPaper(prediction, one).describe_change(found) for one in ("en", "pt-BR")}
    assert found.name in papers["en"]
    assert found.name.replace(".", ",") in papers["pt-BR"]
