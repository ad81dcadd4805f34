"""Whole files misread: the adjustment tries again as if one common mistake had been made."""

from dataclasses import replace

import pytest
from surveyed import by_instruments, by_photographs, changed, known, told


@pytest.fixture(scope="module")
def photos():
    return by_photographs()[0]


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


def test_all_distances_in_feet(photos):
    text = told(changed(photos, "distances", value=photos.readings[0].value / 0.3048))
    assert "feet" in text


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
    """Control in one plane allows the tank in a mirror: the targets tell; else the images do."""
    images = replace(photos.image_points, xy_mm=photos.image_points.xy_mm * [1, -1])
    turned = replace(photos, image_points=images)
    text = told(turned)
    assert "mirror" in text
    text = told(replace(turned, control=on_four_sides()))
    assert "image_points.csv: its image points fit once the image is mirrored" in text
