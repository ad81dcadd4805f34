"""Gauge tubes off the axis or the plumb: closed forms, the section in the plane, differences."""

import itertools

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.errors import HeightError, SolutionError
from tankcal.tank.heads import End
from tankcal.tank.solids import GaugeTube, LyingTank

PLACES = [(0.2, 0.0), (-0.2, 0.0), (0.0, 0.4), (0.15, 0.4), (0.15, -0.4), (-0.6, 0.4)]
DIPS = np.array([0.0, 0.2, 0.7, 1.1, 1.6])


def points_of(radius, angle, offset, dips):
    """(n, 2) points of the tube by a search for the wall along its own line: x right, z up."""
    along = np.array([np.sin(angle), np.cos(angle)])
    normal = np.array([np.cos(angle), -np.sin(angle)])
    outside, inside = -2 * radius, 0.0
    for _ in range(200):
        middle = (outside + inside) / 2
        if np.hypot(*(offset * normal + middle * along)) > radius:
            outside = middle
        else:
            inside = middle
    return offset * normal + np.multiply.outer(inside + dips, along)


@pytest.mark.parametrize(("angle", "offset"), PLACES)
def test_depth_by_the_points_of_the_tube_second_method(angle, offset):
    dips = np.linspace(0, 1.2, 7)
    expected = points_of(1.1, angle, offset, dips)[:, 1] + 1.1
    assert GaugeTube(1.1, angle, offset).depth_m(dips) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(("angle", "offset"), PLACES)
def test_full_at_the_dip_of_the_crown(angle, offset):
    tube = GaugeTube(1.1, angle, offset)
    assert tube.depth_m(np.array([tube.full_m])) == pytest.approx(2.2, rel=1e-14)


def test_a_rolled_tank_is_a_plumb_one_at_another_depth_closed_form():
    """Tube through the axis, rolled by a: depth = R - (R - d) cos a; half full at d = R."""
    plumb, rolled = LyingTank(2.0, 2.0, 5.0), LyingTank(2.0, 2.0, 5.0, tube_angle_rad=0.3)
    dips = np.linspace(0, 1.9, 20)
    depth = 1 - (1 - dips) * np.cos(0.3)
    assert rolled.volume_m3(dips) == pytest.approx(plumb.volume_m3(depth), rel=1e-14)
    assert rolled.volume_m3([1.0])[0] == pytest.approx(2.5 * np.pi, rel=1e-14)
    assert rolled.volume_m3([rolled.top_m])[0] == pytest.approx(5 * np.pi, rel=1e-12)


def test_a_plumb_tube_beside_the_axis_starts_above_the_lowest_point_closed_form():
    tank = LyingTank(2.0, 2.0, 5.0, tube_offset_m=0.6)
    assert tank.depth_m([0.0]) == pytest.approx(0.2)
    assert tank.top_m == pytest.approx(1.8)


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("tilt", [0.0, 0.06])
@pytest.mark.parametrize("direction", ["square", "plumb"])
@pytest.mark.parametrize(("angle", "offset"), PLACES)
def test_derivatives_by_every_input_of_a_tank_with_a_tube(angle, offset, direction, tilt):
    sizes = [0.0, 0.0, angle, offset, tilt, 1.8]
    names = ["diameter", "datum", "tube_angle", "tube_offset", "tilt", "dip_position"]
    end = End("ellipsoidal", 0.4)

    def volume(x):
        wide, up, turned, aside, leaning, place = x
        tank = LyingTank(2 + wide, 2 + wide, 5.0, end, end, leaning, 0.0, place, direction,
                         turned, aside)  # fmt: skip
        return tank.volume_m3(DIPS + 0.05 + up)

    tank = LyingTank(2.0, 2.0, 5.0, end, end, tilt, 0.0, 1.8, direction, angle, offset)
    found = tank.derivatives(DIPS + 0.05)
    analytic = np.column_stack([found[name] for name in names])
    assert_derivative(volume, sizes, analytic, step=1e-5, tolerance=1e-7)


def test_scale_of_a_tank_with_a_tube():
    """All lengths times s but the dips: s^3 V(d / s)."""
    dips = DIPS + 0.05

    def volume(x):
        s = 1 + x[0]
        tank = LyingTank(2 * s, 2 * s, 5 * s, tilt=0.03, dip_from_a_m=2 * s,
                         tube_angle_rad=0.2, tube_offset_m=0.3 * s)  # fmt: skip
        return tank.volume_m3(dips)

    tank = LyingTank(2.0, 2.0, 5.0, tilt=0.03, dip_from_a_m=2.0, tube_angle_rad=0.2,
                     tube_offset_m=0.3)  # fmt: skip
    assert_derivative(volume, [0.0], tank.derivatives(dips)["scale"][:, None])


def test_an_angle_that_was_not_seen_is_an_error_of_the_second_order(figure):
    """Dip at a quarter of the depth, 3 degrees: R (1 - cos a) / 2, here 0.69 mm of 2 m."""
    plumb, rolled = (LyingTank(2.0, 2.0, 5.0, tube_angle_rad=a) for a in (0.0, np.radians(3)))
    assert plumb.derivatives(np.array([0.5]))["tube_angle"] == 0
    missed = rolled.depth_m([0.5])[0] - 0.5
    figure("3 degrees of roll not seen, 0.5 m in 2 m, mm", f"{1000 * missed:.2f}")
    assert missed == pytest.approx(0.5 * (1 - np.cos(np.radians(3))), rel=1e-12)


@pytest.mark.parametrize(
    ("sizes", "words"),
    [
        ({"tube_offset_m": 1.0}, "expected one that crosses it"),
        ({"tube_angle_rad": 1.5}, "expected one that crosses it"),
        ({"tube_angle_rad": np.nan}, "expected one that crosses it"),
        ({"width_m": 2.2, "tube_angle_rad": 0.1}, "expected a round one"),
        (
            {"width_m": 2.2, "roll_rad": 0.1, "end_a": End("guppy", 0.5)},
            "expected a round one",
        ),
    ],
)
def test_tubes_that_cannot_be_are_refused(sizes, words):
    with pytest.raises(SolutionError, match=words):
        LyingTank(**{"width_m": 2.0, "height_m": 2.0, "length_m": 5.0} | sizes)


def test_a_dip_above_the_full_tank_is_refused():
    tank = LyingTank(2.0, 2.0, 5.0, tube_angle_rad=0.3)
    with pytest.raises(HeightError):
        tank.volume_m3([tank.top_m + 0.01])


def test_any_tube_fills_monotonically():
    """Property, over a grid of angles and offsets."""
    for angle, offset in itertools.product([-1.2, -0.4, 0.0, 0.3, 1.3], [-0.95, -0.2, 0.0, 0.9]):
        tank = LyingTank(2.0, 2.0, 3.0, End("guppy", 0.4), tube_angle_rad=angle,
                         tube_offset_m=offset, dip_direction="square", tilt=0.02,
                         dip_from_a_m=1.0)  # fmt: skip
        dips = np.linspace(0, tank.top_m, 60)
        volume = tank.volume_m3(dips)
        assert np.diff(volume).min() > -1e-12
        assert volume[-1] <= tank.capacity_m3 * (1 + 1e-12)


def test_a_tube_hardly_off_the_axis_has_the_table_of_a_plumb_one():
    """Property: no jump, in a tank that is tilted, too."""
    sizes = {"tilt": 0.05, "dip_from_a_m": 2.0}
    plumb, beside = (LyingTank(2.0, 2.0, 5.0, tube_offset_m=e, **sizes) for e in (0.0, 1e-9))
    assert beside.top_m == pytest.approx(plumb.top_m, rel=1e-12)
    dips = np.linspace(0, 2, 9)
    assert beside.volume_m3(dips) == pytest.approx(plumb.volume_m3(dips), rel=1e-12)
    assert beside.height_share(dips)[0] == pytest.approx(plumb.height_share(dips)[0], rel=1e-12)
