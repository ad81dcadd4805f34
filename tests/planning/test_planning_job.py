"""The empty job of a plan: it says what is missing; filled, it is the survey that was planned."""

import csv

import numpy as np
import pytest
from job_builder import assert_same_job
from plan_folders import (
    PLAN,
    SETTINGS,
    changed_plan,
    fill_folder,
    fill_workbook,
    with_setups,
)

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.geometry.rotations import rotation_of_angles
from tankcal.job import load
from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import greedy
from tankcal.planning.measurements import draw_measurements
from tankcal.report import planning as planning_papers
from tankcal.report.planning import empty_job

TWICE = ('name = "V1"\nkind = "vertical"\n', 'name = "V1"\nkind = "vertical"\nreadings = 2\n')


SLOW_FIXTURES = {"planned"}  # seconds each


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A prediction whose first tape is read twice, and the folder of its empty job."""
    folder = tmp_path_factory.mktemp("plan")
    prediction = predict(load_plan(changed_plan(folder, TWICE)))
    empty_job.write(prediction, folder / "job")
    return prediction, folder / "job"


@pytest.fixture
def empty(planned, tmp_path):
    """(prediction, folder of its own with the empty job)."""
    prediction, _ = planned
    empty_job.write(prediction, tmp_path / "job")
    return prediction, tmp_path / "job"


def exact(prediction):
    return draw_measurements(prediction.plan, prediction.measurements, prediction.network)


def rows_of(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def test_empty_job_reports_everything_missing(planned):
    """Every tape, every control coordinate, every setting that is known on the day only."""
    with pytest.raises(InputError) as caught:
        load(planned[1])
    told = [(one.file, one.column) for one in caught.value.problems]
    assert told.count(("distances.csv", "distance_m")) == 9
    assert {told.count(("control.csv", f"s{axis}_mm")) for axis in "xyz"} == {11}
    assert {("job.toml", "survey.date"), ("job.toml", "datum.bottom_z_m")} <= set(told)
    text = (planned[1] / "job.toml").read_text(encoding="utf-8")
    for name in SETTINGS:
        assert f'{name.partition(".")[2]} = ""' in text
        assert "FILL IN: temperature of the shell" in text


def test_empty_job_has_what_is_known(planned):
    prediction, folder = planned
    plan = prediction.plan
    targets = rows_of(folder / "targets.csv")
    assert [row["point"] for row in targets] == list(plan.targets.names)
    heights = [float(row["z_m"]) for row in targets]
    assert heights == pytest.approx(plan.targets.xyz_m[:, 2], abs=5e-5)
    assert {row["offset_mm"] for row in targets} == {"1"}
    photos = rows_of(folder / "photos.csv")
    assert [(row["photo"], row["camera"], row["x_m"]) for row in photos] == [
        (one.name, "UMK", "") for one in plan.photos
    ]
    tapes = rows_of(folder / "distances.csv")
    assert [row["from"] for row in tapes][:3] == ["V1a", "V1a", "V3a"]
    assert {(row["s_mm"], row["kind"], row["instrument"]) for row in tapes} == {
        ("1", "spatial", "tape")
    }
    assert rows_of(folder / "courses.csv")[1]["thickness_mm"] == "7.1"
    assert rows_of(folder / "image_points.csv") == []


@pytest.mark.slow
@pytest.mark.parametrize("fill", ["folder", "workbook"])
def test_the_filled_job_is_the_survey_that_was_planned(empty, fill):
    """Second method: read, adjusted and computed as a job, from readings without errors."""
    prediction, path = empty
    if fill == "folder":
        fill_folder(path, exact(prediction))
    else:
        empty_job.write(prediction, path.parent / "book", workbook=True)
        path = path.parent / "book" / "job.xlsx"
        fill_workbook(path, exact(prediction))
    result = tankcal.run(load(path), simulated=False)
    assert result.adjustment.sigma0 < 1e-6
    assert not result.adjustment.removed
    known = dict(zip(result.adjustment.names, result.adjustment.covariance_m2, strict=True))
    for one in prediction.points:
        assert one.sd_m == pytest.approx(np.sqrt(np.diag(known[one.name])), rel=1e-6)
    of_points = [one for one in result.table.sources if one.kind == "points"]
    of_plan = [one for one in prediction.table.sources if one.kind == "points"]
    top, planned = (
        np.sqrt(sum(np.sum(one.columns_m3[-1] ** 2) for one in found))
        for found in (of_points, of_plan)
    )
    # the points weigh as the amplitudes have it: here learned from a perfect cylinder
    assert top == pytest.approx(planned, rel=0.03)
    assert result.table.volume_m3 == pytest.approx(prediction.table.volume_m3, rel=1e-6)


@pytest.mark.slow
def test_both_forms_filled_in_are_the_same_job(empty):
    prediction, folder = empty
    empty_job.write(prediction, folder.parent / "book", workbook=True)
    book = folder.parent / "book" / "job.xlsx"
    fill_workbook(book, exact(prediction))
    fill_folder(folder, exact(prediction))
    assert_same_job(load(folder), load(book))


@pytest.mark.slow
def test_a_filled_job_with_errors_runs(empty, figure):
    """Simulation: the volume lies within what was predicted (four standard uncertainties)."""
    prediction, folder = empty
    drawn = draw_measurements(
        prediction.plan, prediction.measurements, prediction.network, np.random.default_rng(3)
    )
    fill_folder(folder, drawn)
    result = tankcal.run(load(folder), simulated=False)
    assert 0.9 < result.adjustment.sigma0 < 1.1  # 490 degrees of freedom: sd 0.03
    off = abs(result.table.volume_m3[-1] - prediction.table.volume_m3[-1])
    figure("volume of a filled plan less the planned one, over U", off / prediction.table.U_m3[-1])
    assert off < 2 * prediction.table.U_m3[-1]


@pytest.mark.slow
def test_a_total_station_job_filled_in(tmp_path):
    """Two sets of everything: twice as many rows, and the sds that were predicted."""
    prediction = predict(load_plan(with_setups(tmp_path)))
    empty_job.write(prediction, tmp_path / "job")
    names = {path.stem for path in (tmp_path / "job").iterdir()}
    assert {"setups", "directions", "zenith_angles", "slope_distances"} <= names
    assert not {"photos", "cameras"} & names
    sights = sum(int(row.sum()) for row in prediction.visibility.on_setup)
    directions = rows_of(tmp_path / "job" / "directions.csv")
    assert len(directions) == 2 * sights
    assert {row["set"] for row in directions} == {"1", "2"}
    assert {row["s_arcsec"] for row in directions} == {"3"}
    order = [(row["setup"], row["set"]) for row in directions]
    assert order == sorted(order)  # set after set, as they are observed
    fill_folder(tmp_path / "job", exact(prediction))
    adjustment = tankcal.adjust_job(load(tmp_path / "job"))
    known = dict(zip(adjustment.names, adjustment.covariance_m2, strict=True))
    for one in prediction.points:
        assert one.sd_m == pytest.approx(np.sqrt(np.diag(known[one.name])), rel=1e-6)


@pytest.mark.slow
def test_other_names_of_keys_and_marks_come_along(tmp_path):
    """K1 for K1_mm-2, a name with a space, fiducial marks: the job has the camera of the plan."""
    changed_plan(tmp_path, ('camera = "UMK"', 'camera = "UMK 10"'))
    (tmp_path / "cameras.toml").write_text(
        '[cameras."UMK 10"]\nformat_mm = [166, 120]\nc_mm = 100.0\nK1 = 1e-9\nconvention ='
        ' "correction_added"\naffinity = "both_y"\n[cameras."UMK 10".marks]\n1 = [-80.0, 0.5]\n'
    )
    form = empty_job.form_of(predict(load_plan(tmp_path)))
    entry = form.entries("cameras")["UMK 10"]
    assert entry["K1_mm-2"] == "1e-09"
    assert entry["marks.1"] == "-80.0; 0.5"
    empty_job.write(predict(load_plan(tmp_path)), tmp_path / "job")
    text = (tmp_path / "job" / "cameras.toml").read_text(encoding="utf-8")
    assert '[cameras."UMK 10"]' in text
    assert 'marks.1 = "-80.0; 0.5"' in text


@pytest.mark.slow
def test_a_fixed_photo_keeps_its_place(tmp_path):
    """Where the frame is that of a photograph, its planned place and angles are the start."""
    pairs = [
        ('datum = "control"', 'datum = "fixed_photo"\nfixed_photo = "R1-1.1"'),
        ("rolls_deg = [0]", "rolls_deg = [0, 90]"),
    ]
    (tmp_path / "plumb_lines.csv").write_text("from,to,s_mm\nV1a,V1b,1\nV3a,V3b,1\n")
    prediction = predict(load_plan(changed_plan(tmp_path, *pairs)))
    row = empty_job.form_of(prediction).rows("photos")[0]
    place = [float(row[f"{axis}_m"]) for axis in "xyz"]
    assert place == pytest.approx(prediction.plan.photos[0].xyz_m, abs=5e-4)
    angles = np.radians([float(row[f"{name}_deg"]) for name in ("omega", "phi", "kappa")])
    assert rotation_of_angles(*angles) == pytest.approx(
        prediction.plan.photos[0].rotation, abs=2e-4
    )


@pytest.mark.slow
def test_a_filled_job_is_never_replaced(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["plan", str(PLAN), "--quiet", "--out", str(out), "--workbook"]) == 0
    assert [one.name for one in (out / "job").iterdir()] == ["job.xlsx"]
    assert main(["plan", str(PLAN), "--quiet", "--out", str(out)]) == 0
    assert not (out / "job" / "job.xlsx").exists()  # one form
    with open(out / "job" / "distances.csv", "a", encoding="utf-8") as file:
        file.write("# read by me\n")
    capsys.readouterr()
    assert main(["plan", str(PLAN), "--quiet", "--out", str(out)]) == 2
    assert "it will not be replaced" in capsys.readouterr().err
    assert "read by me" in (out / "job" / "distances.csv").read_text(encoding="utf-8")
    assert set(planning_papers.FILES) >= {one.name for one in out.iterdir()} - {"job"}


@pytest.mark.slow
def test_the_design_of_a_search_has_papers_of_its_own(tmp_path):
    """Its empty job, filled without errors, is the survey that the search ended with."""
    prediction = predict(load_plan(PLAN))
    found = greedy(prediction.plan, add=False, steps=1, items=("tape",))
    planning_papers.write(prediction, tmp_path / "out", design=found)
    design = tmp_path / "out" / "design"
    assert {one.name for one in design.iterdir()} >= {"prediction.pdf", "field-sheets.pdf", "job"}
    (dropped,) = (one.change.name for one in found.steps)
    tapes = (design / "job" / "distances.csv").read_text(encoding="utf-8")
    assert f"\n{dropped}a," not in tapes
    assert tapes.count(",spatial,") == len(prediction.plan.ties) - 1
    assert f"{dropped}a" not in found.plan.points
    fill_folder(design / "job", exact(found.prediction))
    adjustment = tankcal.adjust_job(load(design / "job"))
    known = dict(zip(adjustment.names, adjustment.covariance_m2, strict=True))
    for one in found.prediction.points:
        if not one.undetermined:
            assert one.sd_m == pytest.approx(np.sqrt(np.diag(known[one.name])), rel=1e-6)
    with pytest.raises(InputError, match="it will not be replaced"):
        planning_papers.refuse_foreign(tmp_path / "out")
