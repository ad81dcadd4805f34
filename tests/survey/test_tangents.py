"""Tangents: worked numbers of the support function, where they touch, what moves them, the hull.

Truth: worked numbers (closed form), differences, exact geometry.
"""

from dataclasses import replace

import numpy as np
import pytest
from generated_hits import Surface
from generated_tangents import ring_of_stations, take_tangents
from scipy.spatial import ConvexHull

from tankcal.geometry.field.amplitudes import Amplitudes
from tankcal.geometry.field.components import COMPONENTS, OVALITY_MODES
from tankcal.geometry.girth import Ring, _support_at, tangent_excess
from tankcal.survey.measurements import Setup
from tankcal.survey.tangents import (
    Tangents,
    circle_of_sights,
    fit_support,
    normals_of,
    support_columns,
    touch,
)
from tankcal.survey.wall_hits import NETWORK, Poses

RHO, XC, YC, P2, Q2 = 10.012, 0.020, -0.010, -0.005526366, 0.002336510
SIGHTS = {  # azimuth of the station: of its sights to the left and the right limb, degrees
    0: (146.14644897, 213.70986358),
    45: (191.10624045, 258.71944368),
    90: (236.14686724, 303.80594828),
    135: (281.19852479, 348.88575354),
    180: (326.23108908, 33.87966076),
    225: (11.27153015, 78.82438826),
    270: (56.29578040, 123.78437257),
    315: (101.24381727, 168.75027096),
}
DIGITS_M = 15 * np.radians(5e-9)  # what the last digit of these azimuths is on a tangent


def worked():
    """Stations (16, 2), azimuths of the sights (16,), whether at the right limb (16,)."""
    station = np.repeat(np.radians(list(SIGHTS)), 2)
    azimuth = np.radians(np.ravel(list(SIGHTS.values())))
    place = 18 * np.column_stack([np.sin(station), np.cos(station)])
    return place, azimuth, np.tile([False, True], 8)


def test_worked_numbers_give_all_five_back():
    """Worked numbers: azimuths to 1e-8 degree; 1e-9 m."""
    station, azimuth, right = worked()
    f, normal = normals_of(azimuth, right)
    curve = fit_support(f, np.sum(station * normal, axis=1), 2)
    found = [curve.radius_m, curve.x_m, curve.y_m, curve.p_m[0], curve.q_m[0]]
    np.testing.assert_allclose(found, [RHO, XC, YC, P2, Q2], rtol=0, atol=1e-9)
    assert curve.perimeter_m == pytest.approx(62.907251, abs=6e-7)
    assert curve.area_m2 == pytest.approx(314.913530, abs=6e-7)
    assert np.pi * curve.radius_m**2 == pytest.approx(314.913700, abs=6e-7)


def test_worked_azimuths_are_those_of_the_curve():
    """Second method: each azimuth from the curve by root finding, to the digits printed."""
    station, azimuth, right = worked()
    f, normal = normals_of(azimuth, right)
    columns = support_columns(f, 2)
    p = columns @ [RHO, XC, YC, P2, Q2]
    np.testing.assert_allclose(np.sum(station * normal, axis=1), p, rtol=0, atol=2 * DIGITS_M)


def test_perimeter_and_area_are_those_of_the_envelope():
    """Second method: the envelope of the tangents drawn as a polygon."""
    f = np.linspace(0, 2 * np.pi, 20001)[:-1]
    curve = fit_support(f, 5 + 0.02 * np.cos(2 * f - 1) + 0.01 * np.sin(3 * f) + 0.3 * np.sin(f), 4)
    p = curve.support_m(f)
    along = np.gradient(np.append(p[-1:], np.append(p, p[:1])), f[1])[1:-1]
    x, y = p * np.sin(f) + along * np.cos(f), p * np.cos(f) - along * np.sin(f)
    dx, dy = np.roll(x, -1) - x, np.roll(y, -1) - y
    assert np.sum(np.hypot(dx, dy)) == pytest.approx(curve.perimeter_m, rel=1e-7)
    assert abs(np.sum(x * dy - y * dx)) / 2 == pytest.approx(curve.area_m2, rel=1e-7)


def test_the_limbs_are_told_by_the_sights():
    station, azimuth, right = worked()
    curve, seen, left = circle_of_sights(station, azimuth, 10.0)
    assert np.all(seen == right)
    assert np.hypot(curve.x_m - XC, curve.y_m - YC) < 1e-3
    assert np.abs(left).max() < 0.010
    azimuth[3] += 0.05  # one that misses by 0.7 m moves it by less than a millimetre
    moved = circle_of_sights(station, azimuth, 10.0)[0]
    assert np.hypot(moved.x_m - curve.x_m, moved.y_m - curve.y_m) < 0.01


def known(count=6):
    """`Poses` of stations round a tank, and a `Tangents` of a leaning circle from them."""
    stations, zeros = ring_of_stations(count, 13.0), 0.4 + np.arange(count)
    surface = Surface(lambda a, z: 6.5 + 0 * (a + z), (0.2, -0.1), (0.001, 0.002))
    read = [
        (f"I{i + 1}", *row)
        for i in range(count)
        for row in take_tangents(surface, stations[i], (1.0, 6.0), 6.5, zero=zeros[i], steps=2000)
    ]
    setup, level, side, direction, zenith = zip(*read, strict=True)
    n = len(read)
    tangents = Tangents(
        *(setup, (None,) * n, ("1",) * n, np.array(level), np.array(side) == "right"),
        *(np.array(direction), np.array(zenith), np.full(n, 1e-5), np.zeros(n, dtype=bool)),
        {f"I{i + 1}": Setup(f"I{i + 1}", f"S{i + 1}", "TS", 0.0) for i in range(count)},
    )
    poses = Poses(
        *(tuple((f"I{i + 1}", None) for i in range(count)), stations, zeros),
        *((), np.zeros(0), np.zeros(0), np.zeros((4 * count, 4 * count)), (NETWORK,) * count),
    )
    return tangents, poses


def touched(tangents, poses):
    return touch(tangents, poses, zero_z_m=0.0, nominal_m=6.5)


@pytest.mark.slow
def test_tangents_touch_the_wall():
    """Exact geometry: a leaning circle; heights to a centimetre, for the wall leans."""
    tangents, poses = known()
    xyz = touched(tangents, poses).points.xyz_m
    away = xyz[:, :2] - (0.2, -0.1) - xyz[:, 2:] * (0.001, 0.002)
    np.testing.assert_allclose(np.hypot(*away.T), 6.5, rtol=0, atol=5e-6)
    np.testing.assert_allclose(xyz[:, 2], tangents.level_m, atol=0.01)


@pytest.mark.slow
def test_what_a_pose_moves():
    """Differences: the covariance by one unknown of a pose is the square of what it does."""
    tangents, poses = known()
    start = touched(tangents, poses)
    f = start.normal_rad
    normal = np.column_stack([np.sin(f), np.cos(f)])
    for unknown in range(4):
        covariance = np.zeros_like(poses.covariance)
        covariance[unknown, unknown] = 1.0
        given = touched(
            tangents, replace(poses, covariance=covariance)
        ).points.covariance_m2.dense()
        given = given - start.points.covariance_m2.dense()
        step, moved = 1e-5, []
        for sign in (1, -1):
            xyz, zero = poses.xyz_m.copy(), poses.orientation_rad.copy()
            if unknown < 3:
                xyz[0, unknown] += sign * step
            else:
                zero[0] += sign * step
            other = touched(tangents, replace(poses, xyz_m=xyz, orientation_rad=zero))
            moved.append(other.points.xyz_m)
        change = (moved[0] - moved[1]) / 2 / step
        radial = np.sum(change[:, :2] * normal, axis=1)  # along the sight nothing is observed
        by = np.pad(normal, ((0, 0), (0, 1)))
        told = np.einsum("ni,nimj,mj->nm", by, given.reshape(len(f), 3, len(f), 3), by)
        np.testing.assert_allclose(
            told, np.outer(radial, radial), atol=2e-3 * (radial**2).max() + 1e-9
        )


@pytest.mark.slow
def test_without_a_zenith_angle_the_sight_is_at_its_level():
    tangents, poses = known()
    blank = replace(tangents, zenith_rad=np.full(len(tangents), np.nan))
    np.testing.assert_allclose(touched(blank, poses).points.xyz_m[:, 2], tangents.level_m)


def amplitudes_of(**sizes_m):
    """Amplitudes that are known, by the names of components with _ for a blank."""
    variances = np.full(len(COMPONENTS), 1e-18)
    for name, size in sizes_m.items():
        variances[[one.name for one in COMPONENTS].index(name.replace("_", " "))] = size**2
    return Amplitudes(variances, np.zeros((len(variances),) * 2), np.ones(len(variances)))


@pytest.mark.slow
def test_excess_of_convex_walls_is_that_of_the_perimeter():
    """Closed form: mean of p - R is sum k^2 c_k^2 / (4 R) where the wall is convex."""
    share = OVALITY_MODES**-3.0 / np.sum(OVALITY_MODES**-3.0)
    size = 3e-4
    expected = np.sum(OVALITY_MODES**2 * share) * size**2 / (2 * 6.5)
    ((mean, common, own),) = tangent_excess(amplitudes_of(common_ovality=size), 6.5, [0.5])
    assert mean == pytest.approx(expected, abs=4 * common / 8)
    assert own > 0
    assert tangent_excess(amplitudes_of(), 6.5, [0.5])[0, 0] < 1e-12


@pytest.mark.slow
def test_excess_of_settlement_grows_with_the_square_of_the_height():
    """Closed form: mean of p - R is sum k^2 c_k^2 / (4 R), c_k in proportion to the height."""
    size, modes = 3e-4, np.arange(2.0, 13.0)
    share = 1 / (1 + (modes / 6) ** 4)
    up = np.array([0.0, 0.3, 0.6, 1.0])
    expected = 3 * up**2 * np.average(modes**2, weights=share) * size**2 / (2 * 6.5)
    mean, common, _ = tangent_excess(amplitudes_of(settlement=size), 6.5, up).T
    np.testing.assert_allclose(mean, expected, atol=4 * common[-1] / 8)
    np.testing.assert_allclose(mean, mean[-1] * up**2, atol=1e-3 * mean[-1])


@pytest.mark.slow
def test_rings_bound_what_is_expected_beyond_them():
    """A property: the likeliest outline of many exact radii has all of the excess."""
    turn = 2 * np.pi * np.arange(96) / 96
    radius = 6.5 + 0.004 * np.cos(3 * turn - 0.4)
    rings = [Ring(turn, radius, 1e-12 * np.eye(96), up) for up in (0.2, 0.8)]
    known = amplitudes_of(common_ovality=4e-3)
    beyond = tangent_excess(known, 6.5, [0.5], rings)[0, 0]
    assert beyond < 0.02 * tangent_excess(known, 6.5, [0.5])[0, 0]


@pytest.mark.slow
def test_no_wall_is_drawn_rougher_than_the_limbs_allow():
    """A bound: amplitudes of 300 mm with limbs that show 3 mm give the excess of 3 mm."""
    rough, bounded = amplitudes_of(common_ovality=0.3), amplitudes_of(common_ovality=3e-3)
    found = tangent_excess(rough, 6.5, [0.5], most_m=3e-3)
    assert found == pytest.approx(tangent_excess(bounded, 6.5, [0.5]), rel=1e-9)


@pytest.mark.slow
def test_excess_over_valleys_is_less_than_that_of_convex_walls():
    """A property: the hull bridges valleys, so the quadratic formula is too much of them."""
    found = [
        tangent_excess(amplitudes_of(common_seams=s), 6.5, [0.5])[0, 0] / s**2 for s in (5e-4, 8e-3)
    ]
    assert found[1] < found[0]


@pytest.mark.slow
def test_mean_support_is_the_perimeter_of_the_hull():
    """Second method: Cauchy's formula against the hull of the same outline as a polygon."""
    rng, count = np.random.default_rng(4), 16384
    turn = 2 * np.pi * np.arange(count) / count
    radius = 6.5 + sum(
        2e-3 * rng.normal() * np.cos(k * turn - rng.uniform(0, 6)) / (1 + k / 10)
        for k in range(2, 100)
    )
    hull = ConvexHull(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))
    support = _support_at(np.arange(0, count, 4), radius)
    assert hull.area - 2 * np.pi * radius.mean() > 5e-3  # m: it bridges valleys
    assert 2 * np.pi * support.mean() == pytest.approx(hull.area, abs=2e-5)
