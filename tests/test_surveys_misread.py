"""Whole files misread: the adjustment tries again as if one common mistake had been made."""

from dataclasses import replace

import pytest
from surveyed import by_instruments, by_photographs, changed, known, told


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
    assert "control.csv: all coordinates fit once x and y are swapped" in text


def test_all_distances_in_feet(stations):
    table = stations.readings[2]
    text = told(changed(stations, "slope_distances", value=table.value / 0.3048))
    assert "slope_distances.csv: the distances fit once they are taken for feet" in text


@pytest.mark.parametrize(
    ("factor", "what"), [(1 / 0.9, "gon read as degrees"), (0.9, "degrees read")]
)
def test_a_whole_file_in_the_other_unit(stations, factor, what):
    table = stations.readings[1]
    text = told(changed(stations, "zenith_angles", value=table.value * factor))
    assert f"zenith_angles.csv: the angles fit once they are taken for {what}" in text


def test_all_angles_in_the_other_unit(stations):
    both = stations
    for name in ("directions", "zenith_angles"):
        table = next(one for one in stations.readings if one.table == name)
        both = changed(both, name, value=table.value / 0.9)
    assert "all angles together fit once they are taken for gon read as degrees" in told(both)


def test_all_photos_mirrored(photos):
    """A mirrored tank: whether images or control are to blame, nobody can tell; both are named."""
    images = replace(photos.image_points, xy_mm=photos.image_points.xy_mm * [1, -1])
    text = told(replace(photos, image_points=images, control=on_four_sides()))
    assert "image_points.csv: its image points fit once the image is mirrored" in text


def test_targets_tell_a_mirrored_tank():
    """Generatrices numbered the other way round: the adjusted points are their mirror image."""
    photos = by_photographs()[0]
    targets = photos.targets
    other = tuple(str((13 - int(name)) % 12 + 1) for name in targets.generatrix)
    text = told(replace(photos, targets=replace(targets, generatrix=other)))
    assert "targets.csv, generatrix: the adjusted points are a mirror image" in text
