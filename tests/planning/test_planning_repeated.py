"""Repeated readings of a plan one by one: what controls them, and what a blunder in one does."""

from dataclasses import replace

import numpy as np
import pytest
from plan_folders import changed_plan, fill_folder, with_setups

import tankcal.survey.readings
from tankcal.job import load
from tankcal.pipeline.table import compute_table
from tankcal.pipeline.wall.finding import find_wall
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.planning import load_plan, predict
from tankcal.planning.measurements import draw_measurements
from tankcal.report.planning import empty_job
from tankcal.survey import adjust_survey, wall_points

LINES = "from,to,s_mm,readings,instrument\n3-1,3-5,2,2,tape\n3-5,3-1,1,3,tape\n9-1,9-5,2,,tape\n"


def each_apart(monkeypatch):
    """Readings of one value are not averaged any more: the network has each of them."""
    monkeypatch.setattr(tankcal.survey.readings, "_labels", lambda one, kind: np.arange(len(one)))


def with_sets(folder, sets):
    """Six set-ups that nothing controls at the targets which one of them alone sights."""
    with_setups(folder)
    text = (folder / "plan.toml").read_text()
    (folder / "plan.toml").write_text(text.replace("sets = 2", f"sets = {sets}"))
    return predict(load_plan(folder))


def filled(prediction, folder):
    """The measurements of the job made from a plan, with the values that it computes."""
    empty_job.write(prediction, folder)
    fill_folder(
        folder, draw_measurements(prediction.plan, prediction.measurements, prediction.network)
    )
    return load(folder).measurements


def assert_told(prediction, adjustment, *kinds):
    """The reliability of a plan is that of the adjusted readings, one by one."""
    for group in (one for one in prediction.reliability if one.kind in kinds):
        mine = [one for one in adjustment.readings if one.kind == group.kind]
        assert group.count == len(mine)
        assert group.uncontrolled == sum(np.isinf(one.mdb) for one in mine)
        mean = np.mean([one.redundancy for one in mine])
        assert group.redundancy == pytest.approx(mean, abs=1e-6)
        largest = max(one.mdb for one in mine if np.isfinite(one.mdb))
        assert group.blunder == pytest.approx(largest, rel=1e-6)


@pytest.mark.slow
def test_sets_control_one_another(tmp_path, figure):
    """Second method: the filled job, where each set has its own readings and orientation."""
    alone, twice = (with_sets(tmp_path, sets) for sets in (1, 2))
    one, two = (
        next(g for g in found.reliability if g.kind == "direction") for found in (alone, twice)
    )
    assert one.uncontrolled > 0
    assert two.uncontrolled == 0
    assert not [one for one in twice.warnings if one.expected.code == "plan_uncontrolled"]
    figure("mean redundancy of a direction in one of two sets", two.redundancy)
    assert_told(twice, adjust_survey(filled(twice, tmp_path / "job")), "direction")


@pytest.mark.slow
@pytest.mark.parametrize("sets", [2, 3])
def test_every_reading_of_a_total_station(tmp_path, monkeypatch, sets):
    """Second method: the filled job, with no reading averaged before the adjustment."""
    found = with_sets(tmp_path, sets)
    kinds = ("direction", "vertical angle", "distance")
    assert {*kinds} <= {one.kind for one in found.reliability}
    each_apart(monkeypatch)
    assert_told(found, adjust_survey(filled(found, tmp_path / "job")), *kinds)


@pytest.mark.slow
def test_lines_that_are_taped_again(tmp_path, monkeypatch):
    """Second method; the readings of one line differ in their sds, and go either way."""
    changed_plan(tmp_path, ('name = "V1"\n', 'name = "V1"\nreadings = 2\n'))
    (tmp_path / "distances.csv").write_text(LINES)
    found = predict(load_plan(tmp_path))
    (group,) = (one for one in found.reliability if one.kind == "distance")
    assert group.count == 9 + 6
    each_apart(monkeypatch)
    assert_told(found, adjust_survey(filled(found, tmp_path / "job")), "distance")


@pytest.mark.slow
def test_images_that_are_read_again(tmp_path):
    """Closed form: the mean's redundancy r, 1 - (1 - r)/4 of each of four."""
    found = predict(
        load_plan(changed_plan(tmp_path, ("stations = 11", "readings = 4\nstations = 11")))
    )
    (images,) = (one for one in found.reliability if one.kind == "image coordinate")
    (means,) = (one for one in found.network.adjusted.residuals if one.kind == "image coordinate")
    assert images.count == 4 * means.redundancy.size
    single = 1 - (1 - means.redundancy) / 4
    assert images.redundancy == pytest.approx(single.mean(), rel=1e-9)
    sizes = 2 * means.mdb * np.sqrt(means.redundancy / single)
    assert images.blunder == pytest.approx(sizes.max(), rel=1e-9)


@pytest.mark.slow
def test_effect_of_blunder_in_one_set(tmp_path, figure):
    """Second method: the worst direction of one set misread by a hundredth of its undetectable
    blunder, which leaves the outlines as they are, and the filled job adjusted."""
    found = with_sets(tmp_path, 2)
    (group,) = (one for one in found.reliability if one.kind == "direction")
    sound = filled(found, tmp_path / "job")
    sound = replace(sound, settings=replace(sound.settings, snooping=False, explain=False))
    directions = (one for one in adjust_survey(sound).readings if one.kind == "direction")
    size = next(one.mdb for one in directions if one.ids == group.volume_of)
    moved = volume_of(found.plan, spoilt(sound, group.volume_of, size / 100))
    change = 100 * (moved - volume_of(found.plan, sound))
    figure("undetectable blunder of a direction in one set, effect (m3)", group.volume_m3)
    assert abs(change) == pytest.approx(group.volume_m3, rel=1e-4)


def spoilt(measurements, ids, size):
    """The measurements with the first reading of a direction off by `size`, rad."""
    readings = []
    for one in measurements.readings:
        if one.table == "directions":
            at = [*zip(one.setup, one.end, strict=True)].index(ids)
            one = replace(one, value=one.value + size * (np.arange(len(one.value)) == at))
        readings.append(one)
    return replace(measurements, readings=tuple(readings))


def volume_of(plan, measurements):
    adjustment = adjust_survey(measurements)
    points = s_transform(wall_points(adjustment, measurements, "outside"))
    job = replace(plan.job, points=points, measurements=None)
    return compute_table(
        job, find_wall(job, lambda text: None, amplitudes=plan.amplitudes)
    ).table.volume_m3[-1]
