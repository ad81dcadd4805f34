"""What is seen from where: closed forms, one thing in the way at a time."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import EXAMPLE
from plan_folders import changed_plan

from tankcal.geometry.rotations import rotation_of_view
from tankcal.planning import load_plan, predict
from tankcal.planning.model import Box, Limits, Pillar, Shell
from tankcal.planning.places import find_hidden, find_in_frame, find_in_sight, find_visible

EYE = np.array([0.0, 0.0, 2.0])


@pytest.fixture(scope="module")
def plan():
    return load_plan(EXAMPLE.parent / "plan-silva")


def points(*xyz):
    return np.array(xyz, dtype=float)


def test_box_hides_targets_behind_it():
    """Closed form: the box from x = 4 to 5 stands in the way of rays that pass below z = 3."""
    box = Box(np.array([4.0, -1.0, 0.0]), np.array([5.0, 1.0, 3.0]))
    seen = points([10, 0, 2], [10, 0, 4.49], [10, 0, 4.51], [3.9, 0, 2], [10, 2.51, 2], [4.5, 0, 2])
    # from (0, 0, 2) a ray to z at x = 10 passes x = 4 at 2 + 0.4 (z - 2): 3 for z = 4.5
    assert find_hidden(box, EYE, seen).tolist() == [True, True, False, False, False, True]


def test_box_next_to_an_axis_parallel_ray_hides_nothing():
    """Closed form: rays that run along the axes of the frame, with two sides of length zero."""
    box = Box(np.array([4.0, 0.5, 0.0]), np.array([5.0, 1.0, 3.0]))
    assert find_hidden(box, EYE, points([10, 0, 2], [10, 0.75 * 2, 2])).tolist() == [False, True]


def test_a_cylinder_hides_within_its_radius_and_height():
    """Closed form: a post of 0.5 m at x = 5; a ray passes it at the distance 5 y / hypot(10, y)."""
    post = Pillar(np.array([5.0, 0.0]), 0.5, 0.0, 3.0)
    grazing = 10 * 0.5 / np.sqrt(25 - 0.25)  # tangent: sin = 0.5 / 5
    seen = points([10, 0.99 * grazing, 2], [10, 1.01 * grazing, 2], [10, 0, 4.3], [4, 0, 2])
    assert find_hidden(post, EYE, seen).tolist() == [True, False, False, False]
    above = points([0, 0, 10])  # straight up, from within its circle
    assert find_hidden(Pillar(np.zeros(2), 1.0, 4.0, 5.0), EYE, above).tolist() == [True]
    assert find_hidden(Pillar(np.zeros(2), 1.0, -5.0, 1.0), EYE, above).tolist() == [False]


def test_the_own_wall_hides_the_far_side(plan):
    """Closed form: from a distance d of the axis of a tank of radius R the azimuths within
    acos(R/d) are seen; a limit of incidence takes some more."""
    shell = Shell(np.zeros(2), 5.0, 0.0, 10.0, is_outside=True)
    azimuth = np.radians(np.arange(0.5, 180.0))
    normals = np.column_stack([np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)])
    place = np.array([0.0, 20.0, 5.0])
    wall = 5.0 * normals + [0, 0, 5.0]
    bare = replace(plan, shell=shell, obstacles=(), limits=Limits(np.radians(90)))
    assert find_in_sight(bare, place, wall, normals).sum() == int(
        np.degrees(np.arccos(5 / 20)) + 0.5
    )
    near = 4.99 * normals + [0, 0, 5.0]  # not on the wall, but behind it: no normal is known
    assert not find_in_sight(bare, place, near, np.full_like(near, np.nan)).any()
    outside = 5.1 * normals + [0, 0, 5.0]
    known = find_in_sight(bare, place, outside, np.full_like(near, np.nan))
    edge = np.degrees(np.arccos(5 / 20) + np.arccos(5 / 5.1))  # over the wall's horizon
    assert known.sum() == pytest.approx(edge, abs=1)
    # at 60 deg: 20 sin(a - i) = 5 sin(i) by the law of sines, a = i - asin(5 sin(i) / 20)
    limited = replace(bare, limits=Limits(np.radians(60)))
    widest = 60 - np.degrees(np.arcsin(5 * np.sin(np.radians(60)) / 20))
    assert find_in_sight(limited, place, wall, normals).sum() == int(widest + 0.5)


def test_inside_a_tank_the_wall_hides_nothing(plan):
    shell = Shell(np.zeros(2), 5.0, 0.0, 10.0, is_outside=False)
    azimuth = np.radians(np.arange(0, 360, 10))
    inwards = -np.column_stack([np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)])
    inside = replace(plan, shell=shell, obstacles=(), limits=Limits(np.radians(90)))
    assert find_in_sight(inside, np.array([1.0, 1, 5]), -5.0 * inwards + [0, 0, 5], inwards).all()


def test_the_frame_with_its_distortion(plan):
    """Closed form: half a format of 83 mm and c = 100 mm reach 8.3 m aside at 10 m; a radial
    distortion that moves the edge in by more than the point's distance brings it in."""
    setup = plan.job.measurements.cameras[0]
    photo = replace(plan.photos[0], xyz_m=np.zeros(3), rotation=rotation_of_view(0.0, 0.0, 0.0))
    seen = points([8.29, 10, 0], [8.31, 10, 0], [0, 10, 5.99], [0, 10, 6.01], [0, -10, 0])
    image, inside = find_in_frame(setup, photo, seen)
    assert inside.tolist() == [True, False, True, False, False]
    assert image[0] == pytest.approx([82.9, 0.0], abs=1e-9)
    values = setup.camera.values.copy()
    values[3] = 1e-6  # K1, added to the measured coordinate: 0.57 mm at 83 mm
    bent = replace(setup, camera=replace(setup.camera, values=values))
    assert find_in_frame(bent, photo, seen)[1].tolist() == [True, True, True, True, False]
    rolled = replace(photo, rotation=rotation_of_view(0.0, 0.0, np.pi / 2))
    assert find_in_frame(setup, rolled, seen)[1].tolist() == [False, False, True, True, False]


def test_an_obstacle_takes_rays_and_nothing_else(plan):
    """Property: with a wall before one station that station sees less, the others the same."""
    free = find_visible(plan)
    here = plan.photos[0].xyz_m
    towards = np.append(plan.shell.axis_m, here[2]) - here
    middle = here + 0.2 * towards
    wide = Box(middle - [3, 3, 3], middle + [3, 3, 3])
    hidden = find_visible(replace(plan, obstacles=(wide,)))
    assert hidden.on_photo[0].sum() < 0.2 * free.on_photo[0].sum()
    assert not (hidden.on_photo & ~free.on_photo).any()
    opposite = 5
    assert (hidden.on_photo[opposite] == free.on_photo[opposite]).all()


@pytest.mark.slow
def test_exposures_from_one_place_are_one_ray(tmp_path):
    """Property: rolled exposures add no ray; what one station alone sees is left out, and told."""
    rolled = ("rolls_deg = [0]", "rolls_deg = [0, 90]")
    found = predict(load_plan(changed_plan(tmp_path, ("stations = 11", "stations = 7"), rolled)))
    seen, plan = found.visibility, found.plan
    assert len(plan.photos) == 14
    names = np.array([one.station for one in plan.photos])
    stations = [seen.on_photo[names == name].any(axis=0) for name in plan.stations]
    assert seen.rays.tolist() == np.sum(stations, axis=0).tolist()
    lonely = {name for name, rays in zip(seen.points, seen.rays, strict=True) if rays == 1}
    twice = seen.on_photo.sum(axis=0) == 2
    assert lonely & {name for name, is_twice in zip(seen.points, twice, strict=True) if is_twice}
    assert lonely <= {one.name for one in found.undetermined}
