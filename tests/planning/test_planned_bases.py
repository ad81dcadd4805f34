"""A stadia in a plan: inside triangulation whose scale is a bar over a station.

Truth: closed form, the job that is made of the plan, properties.
"""

import numpy as np
import openpyxl
import pytest
from messages_told import lines
from plan_folders import BAR_M, fill_folder, fill_workbook, with_stadia

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError, SolutionError
from tankcal.job import load
from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import changes_of, cost_of, what_helps, what_would_do
from tankcal.planning.measurements import draw_measurements
from tankcal.report.planning import empty_job, files
from tankcal.report.planning.pages import PlanPaper, outlook, sheets
from tankcal.report.planning.rows import bases

ARCSEC = np.pi / 180 / 3600
SLOW_FIXTURES = {"prediction"}


def planned(folder, rows="T1-1,T1-2,1,2\nT1-2,T1-1,1,2\n"):
    return load_plan(with_stadia(folder, rows))


@pytest.fixture(scope="module")
def prediction(tmp_path_factory):
    return predict(planned(tmp_path_factory.mktemp("bar")))


def by_cause(table, name):
    """(rows, ...) of what an input contributes to a table."""
    return next(one.columns_m3 for one in table.sources if one.kind == name)


@pytest.mark.slow
def test_what_is_read_of_a_bar(tmp_path):
    """Closed form: sides of the triangle of set-ups, d = (b/2) cot(beta/2), its sd."""
    plan = planned(tmp_path)
    side = 3.7 * np.sqrt(3)
    found = predict(plan)
    (readings,) = (one for one in found.measurements.readings if one.table == "distances")
    beta = 2 * np.arctan(BAR_M / 2 / side)
    sd = BAR_M / (4 * np.sin(beta / 2) ** 2) * ARCSEC / np.sqrt(2)
    assert readings.sd == pytest.approx([sd, sd], rel=1e-12)
    assert readings.horizontal.all()
    row, *others = bases(found)
    assert (row["setup"], row["to"], row["bar"], row["reading"]) == ("T1-1", "T1-2", "bar 1", 1)
    assert (row["expected_m"], row["expected_rad"]) == pytest.approx((side, beta))
    assert len(others) == 3


@pytest.mark.parametrize("fill", [fill_folder, fill_workbook])
def test_the_filled_job_is_the_triangulation_that_was_planned(prediction, tmp_path, fill):
    """Second method: read, adjusted and computed as a job, from readings without errors."""
    folder = tmp_path / "job"
    path = folder if fill is fill_folder else folder / "job.xlsx"
    empty_job.write(prediction, folder, workbook=path is not folder)
    if path is folder:
        assert (folder / "stadia.csv").read_text().count("T1-1,T1-2,bar 1") == 2
    fill(path, draw_measurements(prediction.plan, prediction.measurements, prediction.network))
    result = tankcal.run(load(path), simulated=False)
    adjustment = result.adjustment
    assert adjustment.sigma0 < 1e-6
    known = dict(zip(adjustment.names, adjustment.covariance_m2, strict=True))
    of_plan = prediction.network.adjusted
    foreseen = dict(zip(of_plan.survey.points, of_plan.point_covariances_m2, strict=True))
    assert set(known) == set(foreseen)
    for name, covariance in known.items():
        largest = np.abs(covariance).max()
        np.testing.assert_allclose(foreseen[name], covariance, rtol=0, atol=1e-6 * largest)
    scales = [by_cause(one.table, "instrument_scale") for one in (result, prediction)]
    np.testing.assert_allclose(*map(np.abs, scales), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(result.table.volume_m3, prediction.table.volume_m3, rtol=1e-7)


def test_reliability_is_of_single_readings(prediction, tmp_path, monkeypatch):
    """Second method: the filled job, with no reading averaged before the adjustment."""
    empty_job.write(prediction, tmp_path / "job")
    exact = draw_measurements(prediction.plan, prediction.measurements, prediction.network)
    fill_folder(tmp_path / "job", exact)
    monkeypatch.setattr(tankcal.survey.readings, "_labels", lambda one, kind: np.arange(len(one)))
    adjustment = tankcal.adjust_job(load(tmp_path / "job"))
    mine = [one for one in adjustment.readings if one.kind == "distance"]
    (group,) = (one for one in prediction.reliability if one.kind == "distance")
    assert (group.name, group.count, group.uncontrolled) == ("bar 1", 4, 0)
    assert len(mine) == 4
    assert group.redundancy == pytest.approx(np.mean([one.redundancy for one in mine]), abs=1e-6)
    assert group.blunder == pytest.approx(max(one.mdb for one in mine), rel=1e-6)


@pytest.mark.slow
def test_length_of_the_bar_scales_the_tank(tmp_path):
    """Closed form: a bar that is off by u / b scales areas by twice that, at any dip."""
    found = predict(planned(tmp_path))
    share = np.abs(by_cause(found.table, "instrument_scale")[-1]).sum()
    assert share / found.table.volume_m3[-1] == pytest.approx(2 * 0.03e-3 / BAR_M, rel=0.01)


@pytest.mark.slow
def test_without_a_bar_nothing_tells_the_scale(tmp_path):
    """The same plan, its stadia.csv left out; with a tape in its place the tape does."""
    with pytest.raises(SolutionError, match="the scale is not determined by any observation"):
        predict(planned(tmp_path, ""))
    text = (tmp_path / "plan.toml").read_text()
    tape = '[[tapes]]\nname = "V"\nkind = "vertical"\nazimuth_deg = 20\nlength_m = 5\n'
    (tmp_path / "plan.toml").write_text(text + tape + "low_m = 0.5\ns_mm = 1\n")
    (group,) = (one for one in predict(load_plan(tmp_path)).reliability if one.kind == "distance")
    assert group.uncontrolled == 1  # nothing controls what alone tells the scale


@pytest.mark.slow
def test_what_would_tell_the_scale(tmp_path, capsys):
    """Second method: the plan after each; a bar that is there is named first, in the language."""
    folder = with_stadia(tmp_path, "")
    found = what_would_do(load_plan(folder))
    assert {"base", "tape"} <= {one.change.item for one in found}
    assert all(one.relative_u == predict(one.change.plan).relative_u for one in found[:2])
    assert [one.relative_u for one in found] == sorted(one.relative_u for one in found)
    asked = ["plan", str(folder), "--changes", "--quiet", "--language", "es"]
    assert main(asked) == 3
    said = capsys.readouterr()
    assert "añadir base" in said.out
    assert "estadía" in said.err
    assert "Traceback" not in said.err


@pytest.mark.slow
def test_base_from_one_end_is_named(tmp_path):
    """The exchange rule, by row, in the words of the job."""
    found = predict(planned(tmp_path, "T1-1,T1-2,1,2\nT1-2,T1-1,1,\nT1-2,T1-3,1,\n"))
    (one,) = (one for one in found.warnings if one.expected.code == "base_from_one_end")
    assert (one.file, one.row, one.column) == ("stadia.csv", 4, "to")


@pytest.mark.parametrize(
    ("row", "column", "words"),
    [
        ("T1-9,T1-2,1,", "setup", "found 'T1-9'; expected a set-up of the plan"),
        ("T1-1,T9,1,", "to", "found 'T9'; expected a set-up of the plan or a point of control.csv"),
        ("T1-1,3-1,1,", "to", "found '3-1'"),
        ("T1-1,T1-1,1,", "to", "station 'T1-1' of the set-up itself"),
        ("T1-1,N,1,", "to", "a base of 0.50 m; expected 1.00 to 1061 m: the bar is 2 m long"),
        ("T1-1,W,1,", "to", "the bar over W, square to the sight from T1-1, would reach through"),
        ("T1-2,B,1,", "to", "the line from T1-2 to B is cut by the tank or an obstacle"),
        ("T1-1,T1-2,0,", "s_arcsec", "expected"),
        ("T1-1,T1-2,1,1.5", "readings", "expected a whole number"),
    ],
)
def test_bad_rows(tmp_path, row, column, words):
    folder = with_stadia(tmp_path, f"T1-1,T1-2,1,2\n{row}\n")
    (folder / "control.csv").write_text(
        "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\nN,0.3,4.1,11.6,,,\nW,8.2,0,11.6,,,\nB,-3,-3,11,,,\n"
    )
    with open(folder / "plan.toml", "a") as file:
        file.write('[[obstacles]]\nname = "column"\nkind = "cylinder"\naxis_m = [-2.5, -2.9]\n')
        file.write("radius_m = 0.2\nlow_m = 10\nhigh_m = 16\n")
    with pytest.raises(InputError) as error:
        load_plan(folder)
    (line,) = lines(error.value.problems)
    (problem,) = error.value.problems
    assert (problem.file, problem.row, problem.column) == ("stadia.csv", 3, column)
    assert words in line


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ('kind = "stadia"', 'kind = "tape"', ("stadia.csv", 2, "bar")),
        ("length_m = 2.0\n", "", ("instruments.toml", 4, "bar 1.length_m")),
        ("u_mm = 0.03\n", "", ("instruments.toml", 4, "bar 1.u_mm")),
    ],
)
def test_bar_that_is_not_described(tmp_path, old, new, place):
    folder = with_stadia(tmp_path)
    text = (folder / "instruments.toml").read_text()
    assert old in text
    (folder / "instruments.toml").write_text(text.replace(old, new))
    with pytest.raises(InputError) as error:
        load_plan(folder)
    assert [(one.file, one.row, one.column) for one in error.value.problems] == [place]


def test_bar_measures_no_directions(tmp_path):
    folder = with_stadia(tmp_path)
    text = (folder / "plan.toml").read_text()
    (folder / "plan.toml").write_text(text.replace('instrument = "TH"', 'instrument = "bar 1"'))
    with pytest.raises(InputError, match="bar 1 is a stadia; expected a total station"):
        load_plan(folder)


def test_changes_of_bases(tmp_path):
    """Property: each base left out, read again, or added between set-ups that see each other."""
    plan = planned(tmp_path)
    found = {(one.action, one.name): one for one in changes_of(plan, items=("base",))}
    assert set(found) == {
        ("drop", "T1-1-T1-2"), ("repeat", "T1-1-T1-2"), ("add", "T1-2-T1-3"), ("add", "T1-1-T1-3"),
    }  # fmt: skip
    assert cost_of(plan) == 3 * 50 + 2 * 10 + 2 * 1
    assert found["drop", "T1-1-T1-2"].cost == -22
    assert found["add", "T1-2-T1-3"].cost == 22
    assert len(found["add", "T1-2-T1-3"].plan.bases) == 4
    bare = planned(tmp_path, "")
    (tmp_path / "stadia.csv").unlink()
    added = changes_of(load_plan(tmp_path), ("add",), ("base",))
    assert bare.bars == {"bar 1": BAR_M}
    assert [one.name for one in added] == ["T1-1-T1-3", "T1-1-T1-2", "T1-2-T1-3"]
    set_ups = {one.name: one.plan for one in changes_of(plan, ("drop",), ("setup",))}
    assert [len(set_ups[name].bases) for name in ("T1-1", "T1-2", "T1-3")] == [0, 0, 2]


@pytest.mark.slow
def test_effects_of_bases(prediction):
    """Second method: the plan after the change; a base that alone tells the scale is needed."""
    effects = what_helps(prediction.plan, changes_of(prediction.plan, items=("base",)))
    for one in effects:
        if one.change.action == "drop":
            assert "the scale is not determined" in one.why
            continue
        assert one.difference < 0
        again = predict(one.change.plan)
        assert one.relative_u == pytest.approx(again.relative_u, rel=1e-3)


@pytest.mark.parametrize("language", ["en", "pt-BR", "es"])
def test_papers_of_a_base(prediction, tmp_path, language):
    paper = PlanPaper(prediction, language)
    text = " ".join(str(block.data) for block in sheets(paper))
    assert paper.words["texts"]["bases"] in text
    assert paper.words["captions"]["bases"] in text
    assert "bar 1" in text
    assert paper.words["labels"]["bases"] in str([one.data for one in outlook(paper)])
    files.write_sheets(paper, tmp_path / "sheets.xlsx")
    sheet = openpyxl.load_workbook(tmp_path / "sheets.xlsx")[
        paper.words["workbook"]["sheets"]["bases"]
    ]
    rows = [[cell.value for cell in row] for row in sheet.iter_rows()]
    assert sum(row[:2] in (["T1-1", "T1-2"], ["T1-2", "T1-1"]) for row in rows) == 4
    for one in changes_of(prediction.plan, items=("base",)):
        assert one.name in paper.describe_change(one)


@pytest.mark.slow
def test_plan_with_a_bar_by_command(tmp_path, capsys):
    folder = with_stadia(tmp_path)
    out = tmp_path / "out"
    assert main(["plan", str(folder), "--quiet", "--out", str(out), "--changes"]) == 0
    assert "1 base" in capsys.readouterr().out
    assert "add,base,T1-2-T1-3" in (out / "changes.csv").read_text()
