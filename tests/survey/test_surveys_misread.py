"""Whole files misread: the adjustment tries again as if one common mistake had been made."""

from dataclasses import replace

import numpy as np
import pytest
from surveyed import by_instruments, by_photographs, changed, known, table, told

from tankcal.errors import SolutionError
from tankcal.survey import adjust_survey
from tankcal.survey.diagnosis.misread_files import MOST_FAILURES, likely_mistake
from tankcal.survey.measurements import AdjustmentSettings, Instrument, Measurements

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def photos():
    return by_photographs(photos=6)[0]


@pytest.fixture(scope="module")
def stations():
    return by_instruments()[0]


def on_four_sides(columns=(0, 1, 2)):
    """Control on four sides of the tank, its coordinates in the order of columns."""
    _, truth = by_photographs()
    names = ["P1", "P16", "P31", "P46", "P24", "P39"]
    return known(names, truth.xyz_m[[int(name[1:]) for name in names]][:, columns], 0.002)


def test_all_control_swapped(photos):
    """On four sides of the tank: swapped, it is the tank in a mirror."""
    text = told(replace(photos, control=on_four_sides([1, 0, 2])))
    assert "control.csv: all coordinates fit if x and y are swapped" in text


def test_all_distances_in_feet(stations):
    table = stations.readings[2]
    text = told(changed(stations, "slope_distances", value=table.value / 0.3048))
    assert "slope_distances.csv: the distances fit if they are in feet" in text


@pytest.mark.parametrize(
    ("factor", "what"), [(1 / 0.9, "gon read as degrees"), (0.9, "degrees read")]
)
def test_a_whole_file_in_the_other_unit(stations, factor, what):
    table = stations.readings[1]
    text = told(changed(stations, "zenith_angles", value=table.value * factor))
    assert f"zenith_angles.csv: the angles fit if they are {what}" in text


def test_all_angles_in_the_other_unit(stations):
    both = stations
    for name in ("directions", "zenith_angles"):
        table = next(one for one in stations.readings if one.table == name)
        both = changed(both, name, value=table.value / 0.9)
    assert "all angles together fit if they are gon read as degrees" in told(both)


def test_all_photos_mirrored(photos):
    """A mirrored tank: whether images or control are to blame, nobody can tell; both are named."""
    images = replace(photos.image_points, xy_mm=photos.image_points.xy_mm * [1, -1])
    text = told(replace(photos, image_points=images, control=on_four_sides()))
    assert "image_points.csv: its image points fit if the image is mirrored" in text


@pytest.mark.study
def test_targets_tell_a_mirrored_tank():
    """Generatrices numbered the other way round: the adjusted points are their mirror image."""
    photos = by_photographs()[0]
    targets = photos.targets
    other = tuple(str((13 - int(name)) % 12 + 1) for name in targets.generatrix)
    text = told(replace(photos, targets=replace(targets, generatrix=other)))
    assert "targets.csv, generatrix: the adjusted points are a mirror image" in text


def test_a_circle_read_anticlockwise(stations):
    """The same as a mirrored tank: control or the circle, both are named."""
    table = next(one for one in stations.readings if one.table == "directions")
    with pytest.raises(SolutionError, match="do not fit together") as told_:
        adjust_survey(changed(stations, "directions", value=-table.value))
    assert "directions.csv: the angles fit if the circle was read anti" in (str(told_.value))


def test_two_control_points_exchanged(stations):
    control = stations.control
    xyz = control.xyz_m[[1, 0, 2]]
    text = told(replace(stations, control=replace(control, xyz_m=xyz)))
    a, b = control.point[:2]
    assert f"control.csv, row 3, point: everything fits if {a} and {b} are exchanged" in text


def test_a_further_system_with_x_and_y_swapped(stations):
    """Simulation: the wall's points, turned by a right angle, as a system of its own."""
    truth = by_instruments()[1].xyz_m
    number = list(range(0, 24, 3))  # at several heights: in a plane, a mirror is a turn
    names = [f"P{i}" for i in number]
    there = truth[number] @ np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]) + [50, 20, 3]
    own = stations.control
    for columns, swapped in (([0, 1, 2], False), ([1, 0, 2], True)):
        both = replace(
            own,
            point=(*own.point, *names),
            xyz_m=np.vstack([own.xyz_m, there[:, columns]]),
            sd_m=np.vstack([own.sd_m, np.full((8, 3), 0.001)]),
            system=(*own.system, *["plant"] * 8),
            check=np.zeros(len(own.point) + 8, dtype=bool),
            rows=tuple(range(2, len(own.point) + 10)),
        )
        text = told(replace(stations, control=both))
        wanted = "control.csv: all coordinates of system plant fit if x and y are swapped"
        assert (wanted in text) == swapped


@pytest.mark.study
def test_one_camera_of_two_mirrored(photos):
    """The images of one camera upside down: the camera is named."""
    second = replace(photos.cameras[0], camera=replace(photos.cameras[0].camera, name="other"))
    of = {one.name: "other" if i % 2 else "camera" for i, one in enumerate(photos.photos)}
    pictures = tuple(replace(one, camera=of[one.name]) for one in photos.photos)
    images = photos.image_points
    flip = np.array([of[name] == "other" for name in images.photo])[:, None]
    mirrored = replace(images, xy_mm=np.where(flip, images.xy_mm * [1, -1], images.xy_mm))
    both = replace(
        photos, cameras=(photos.cameras[0], second), photos=pictures, image_points=mirrored
    )
    assert "its image points fit if the image is mirrored" in told(both)


def test_distances_that_define_the_scale_keep_their_unit():
    """Sds ten times too small in a free network: a thousandth fits better, and means nothing."""
    rng = np.random.default_rng(4)
    xy = rng.uniform(0, 50, (7, 2))
    names = [f"N{i}" for i in range(7)]
    pairs = [(i, j) for i in range(7) for j in range(i)]
    start, end = ([names[pair[k]] for pair in pairs] for k in (0, 1))
    length = np.array([np.linalg.norm(xy[i] - xy[j]) for i, j in pairs])
    tapes = table(
        "distances", length + rng.normal(0, 0.05, len(pairs)), 0.005, start, end,
        horizontal=np.ones(len(pairs), dtype=bool), instrument=("tape",) * len(pairs),
    )  # fmt: skip
    control = known(names, np.pad(xy, ((0, 0), (0, 1))), np.nan)
    free = Measurements(
        settings=AdjustmentSettings(datum="inner", snooping=False), control=control,
        instruments=(Instrument("tape", "tape"),), readings=(tapes,),
    )  # fmt: skip
    text = told(free)
    assert "the global test fails: sigma0 = " in text
    assert "millimetres" not in text
    assert "feet" not in text


@pytest.mark.parametrize(
    ("factor", "what"), [(1 / 0.9, "gon read as degrees"), (0.9, "degrees read")]
)
def test_the_circles_of_one_set_up_in_the_other_unit(stations, factor, what):
    """Of both kinds of its angles: the set-up is named, and the row where it begins."""
    name, misread = stations.readings[0].setup[0], stations
    for kind in ("directions", "zenith_angles"):
        table = next(one for one in stations.readings if one.table == kind)
        mine = np.array([one == name for one in table.setup])
        misread = changed(misread, kind, value=table.value * np.where(mine, factor, 1.0))
    assert f"the angles of set-up {name} fit if they are {what}" in told(misread)


@pytest.mark.parametrize("datum", ["minimal", "control"])
def test_circles_are_told_before_coordinates_that_hold_nothing(stations, datum):
    """A mirror of all circles and a swap of axes explain the same, to the last digit."""
    table = next(one for one in stations.readings if one.table == "directions")
    mirrored = changed(stations, "directions", value=-table.value)
    mirrored = replace(mirrored, settings=replace(stations.settings, datum=datum))
    text = told(mirrored)
    circle, swap = (text.find(one) for one in ("read anticlockwise", "if x and y are swapped"))
    assert circle >= 0
    if datum == "minimal" and swap >= 0:
        assert circle < swap


def test_search_ends_after_a_number_of_failures(stations):
    """Found by mutated inputs: trials that fail, each for another reason, took 35 s."""
    calls = []

    def fail(measurements):
        calls.append(measurements)
        raise SolutionError(f"reason {len(calls)}")

    control = known([f"P{i}" for i in range(7)], np.arange(21.0).reshape(7, 3), 0.002)
    survey = replace(stations, control=control)
    assert likely_mistake(survey, np.inf, fail) == []
    assert len(calls) == MOST_FAILURES
