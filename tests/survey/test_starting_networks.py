"""Approximate values of networks by total station, theodolite, tape and level, from nothing."""

import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from networks import by_total_station, tank_points

from tankcal.errors import SolutionError
from tankcal.survey.network import Survey, adjust
from tankcal.survey.observations import (
    Azimuths,
    ControlCoordinates,
    Directions,
    Distances,
    HeightDifferences,
    HorizontalAngles,
    VerticalAngles,
)
from tankcal.survey.start.polar import free_station, place
from tankcal.survey.start_values import approximate

SD_ANGLE, SD_M = 1e-5, 1e-3
SQUARE = np.array(
    [[0.0, 0, 10], [60, 5, 11], [70, 80, 12], [-10, 70, 9], [30, 40, 13], [25, -30, 8]]
)


def unknown(survey):
    """The survey without any start value."""
    nothing = replace(
        survey, xyz_m=np.full_like(survey.xyz_m, np.nan), sets=np.full_like(survey.sets, np.nan)
    )
    if survey.photos is None:
        return nothing
    photos = survey.photos
    return replace(
        nothing,
        photos=replace(
            photos,
            xyz_m=np.full_like(photos.xyz_m, np.nan),
            rotation=np.full_like(photos.rotation, np.nan),
        ),
    )


def control(xyz, points, axes=(0, 1, 2)):
    """Control coordinates of some points."""
    point, axis = np.repeat(points, len(axes)), np.tile(axes, len(points))
    return ControlCoordinates(xyz[point, axis], np.full(len(point), SD_M), point, axis)


def network(xyz, *observations, sets=0):
    """A Survey of points without start values."""
    return Survey(
        tuple(f"P{i}" for i in range(len(xyz))),
        np.full(xyz.shape, np.nan),
        observations=observations,
        sets=np.full(sets, np.nan),
    )


def lines(pairs):
    return np.array(pairs).T


def azimuth(xyz, start, end):
    d = xyz[end] - xyz[start]
    return np.arctan2(d[:, 0], d[:, 1])


def directions(xyz, pairs, seed=0):
    """Directions, a set to each station, in the order of the stations."""
    start, end = lines(pairs)
    stations, number = np.unique(start, return_inverse=True)
    zero = np.random.default_rng(seed).uniform(-3, 3, len(stations))
    value = azimuth(xyz, start, end) - zero[number]
    return Directions(value, np.full(len(start), SD_ANGLE), start, end, set=number)


def distances(xyz, pairs, horizontal=False):
    start, end = lines(pairs)
    d = (xyz[end] - xyz[start]) * [1, 1, 0 if horizontal else 1]
    none = np.full(len(start), -1)
    return Distances(
        np.linalg.norm(d, axis=1),
        np.full(len(start), SD_M),
        start,
        end,
        instrument=none,
        horizontal=horizontal,
    )


def zeniths(xyz, pairs):
    start, end = lines(pairs)
    x, y, z = (xyz[end] - xyz[start]).T
    value = np.arctan2(np.hypot(x, y), z)
    return VerticalAngles(value, np.full(len(start), SD_ANGLE), start, end, zenith=True)


def levels(xyz, pairs):
    start, end = lines(pairs)
    return HeightDifferences(xyz[end, 2] - xyz[start, 2], np.full(len(start), SD_M), start, end)


def azimuths(xyz, pairs):
    start, end = lines(pairs)
    return Azimuths(azimuth(xyz, start, end), np.full(len(start), SD_ANGLE), start, end)


def angles(xyz, triples):
    """Horizontal angles at the first point, from the second to the third."""
    at, origin, end = lines(triples)
    value = (azimuth(xyz, at, end) - azimuth(xyz, at, origin)) % (2 * np.pi)
    return HorizontalAngles(value, np.full(len(at), SD_ANGLE), at, end, origin=origin)


def ring(count, wall, away_m):
    """Points: wall, then stations about it; and pairs: what a station sees, and its neighbours."""
    turn = np.pi / 8 + 2 * np.pi * np.arange(count) / count
    stations = np.column_stack(
        [away_m * np.sin(turn), away_m * np.cos(turn), 0.1 * np.cos(5 * turn)]
    )
    pairs, n = [], len(wall)
    for i, station in enumerate(stations):
        seen = np.flatnonzero(np.sum((station - wall) * wall * [1, 1, 0], axis=1) > 0)
        seen = [*seen, n + (i + 1) % count, n + (i - 1) % count]
        pairs += [(n + i, int(other)) for other in seen]
    return np.vstack([wall, stations]), pairs


def sides(xyz):
    return np.linalg.norm(xyz[:, None] - xyz[None], axis=-1)


# Closed form: without noise every start value is the truth.


def test_polar_points_from_two_known_stations():
    pairs = [(0, 1), (0, 2), (0, 3), (1, 0), (1, 4), (1, 5)]
    xyz = SQUARE
    survey = network(
        xyz, control(xyz, [0, 1]), directions(xyz, pairs), distances(xyz, pairs),
        zeniths(xyz, pairs), sets=2,
    )  # fmt: skip
    found = approximate(survey)
    assert found.xyz_m == pytest.approx(xyz, abs=1e-9)
    assert np.isfinite(found.sets).all()


@pytest.mark.parametrize("backwards", [False, True])
def test_traverse_between_two_known_points_without_an_azimuth(backwards):
    """The end points are known, none of the first directions is: local frame, then joined."""
    order = [0, 5, 1, 4, 2, 3]
    legs = list(pairwise(order))
    pairs = legs[1:] + [(b, a) for a, b in legs[:-1]]  # neither end is occupied
    if backwards:
        pairs = pairs[::-1]
    survey = network(
        SQUARE, control(SQUARE, [0, 3]), directions(SQUARE, pairs), distances(SQUARE, pairs),
        zeniths(SQUARE, pairs), sets=4,
    )  # fmt: skip
    assert approximate(survey).xyz_m == pytest.approx(SQUARE, abs=1e-6)


def test_forward_intersection_with_levelled_heights():
    triples = [
        (0, 1, 2),
        (0, 2, 4),
        (0, 4, 3),
        (1, 0, 2),
        (1, 2, 3),
        (1, 0, 4),
        (0, 1, 5),
        (1, 0, 5),
    ]
    survey = network(
        SQUARE, control(SQUARE, [0, 1]), angles(SQUARE, triples),
        levels(SQUARE, [(0, 2), (2, 3), (3, 4), (4, 5)]),
    )  # fmt: skip
    assert approximate(survey).xyz_m == pytest.approx(SQUARE, abs=1e-6)


def test_station_from_directions_to_three_known_points():
    pairs = [(4, 0), (4, 1), (4, 2), (4, 3)]
    survey = network(
        SQUARE[:5], control(SQUARE, [0, 1, 2, 3]), directions(SQUARE, pairs),
        zeniths(SQUARE, pairs), sets=1,
    )  # fmt: skip
    assert approximate(survey).xyz_m == pytest.approx(SQUARE[:5], abs=1e-6)


def test_free_station_on_two_known_points_then_polar():
    pairs = [(4, 0), (4, 1), (4, 2), (4, 3), (4, 5)]
    survey = network(
        SQUARE, control(SQUARE, [0, 1]), directions(SQUARE, pairs), distances(SQUARE, pairs),
        zeniths(SQUARE, pairs), sets=1,
    )  # fmt: skip
    assert approximate(survey).xyz_m == pytest.approx(SQUARE, abs=1e-6)


def test_azimuths_alone_orient_a_line_in_either_direction():
    survey = network(
        SQUARE[:4], control(SQUARE, [0]), azimuths(SQUARE, [(0, 1), (2, 1), (2, 3)]),
        distances(SQUARE, [(1, 0), (1, 2), (2, 3)]), levels(SQUARE, [(0, 1), (1, 2), (2, 3)]),
    )  # fmt: skip
    assert approximate(survey).xyz_m == pytest.approx(SQUARE[:4], abs=1e-6)


@pytest.mark.parametrize("known", [[0, 1, 2], [0, 1, 3]])
def test_trilateration_by_horizontal_distances(known):
    rest = [i for i in range(6) if i not in known]
    pairs = [(a, b) for a in rest for b in range(6) if a < b or b in known]
    survey = network(
        SQUARE, control(SQUARE, known), distances(SQUARE, pairs, horizontal=True),
        levels(SQUARE, [(known[0], i) for i in rest]),
    )  # fmt: skip
    assert approximate(survey).xyz_m == pytest.approx(SQUARE, abs=1e-6)


def test_trilateration_without_control_keeps_the_distances():
    pairs = [(a, b) for a in range(6) for b in range(a)]
    survey = network(
        SQUARE, distances(SQUARE, pairs, horizontal=True),
        levels(SQUARE, [(0, i) for i in range(1, 6)]),
    )  # fmt: skip
    found = approximate(survey).xyz_m
    assert sides(found) == pytest.approx(sides(SQUARE), abs=1e-6)


def test_spatial_distances_alone():
    """Tapes between points of the wall and of the ground; the four known are not in a plane."""
    xyz = np.vstack([SQUARE * [0.2, 0.2, 1], tank_points(5, 2) * 1.3])
    known = [0, 4, 6, 13]
    pairs = [(a, b) for a in range(len(xyz)) for b in range(a) if (a + b) % 3 or a in known]
    survey = network(xyz, control(xyz, known), distances(xyz, pairs))
    assert approximate(survey).xyz_m == pytest.approx(xyz, abs=1e-5)


def test_levelling_outvotes_a_blunder():
    pairs = [(a, b) for a in range(6) for b in range(a)]
    levelled = levels(SQUARE, pairs)
    wrong = levelled.value.copy()
    wrong[[3, 11]] += [1.0, -0.7]
    survey = network(SQUARE, control(SQUARE, [0]), replace(levelled, value=wrong))
    survey = replace(survey, xyz_m=SQUARE * np.array([1, 1, np.nan]))
    assert approximate(survey).xyz_m == pytest.approx(SQUARE, abs=1e-4)


def test_instrument_and_target_heights_and_scale_are_taken_off():
    from tankcal.survey.network import Instrument

    pairs = [(0, 1), (0, 2), (0, 3), (0, 4)]
    survey, rise = network(SQUARE[:5]), np.array([0.2, 0.3, -1.5, 1.6])
    lifted = SQUARE.copy()[[0, 1, 2, 3, 4]]
    lifted[1:, 2] -= rise
    tape = distances(lifted, pairs)
    tape = replace(tape, value=tape.value * 1.01 + 0.5, rise_m=rise, instrument=np.zeros(4, int))
    survey = replace(
        survey,
        observations=(
            control(SQUARE, [0, 1]), directions(SQUARE, pairs),
            replace(zeniths(lifted, pairs), rise_m=rise), tape,
        ),
        sets=np.full(1, np.nan),
        instruments=(Instrument("total station", 0.01, 0.5),),
    )  # fmt: skip
    assert approximate(survey).xyz_m == pytest.approx(SQUARE[:5], abs=1e-6)


# Simulation: the same answer as from good start values.


def test_free_network_starts_at_its_first_station():
    survey, truth = by_total_station()
    found = approximate(unknown(survey))
    assert sides(found.xyz_m) == pytest.approx(sides(truth.xyz_m), abs=0.02)
    ours, theirs = adjust(found, datum="inner"), adjust(survey, datum="inner")
    assert sides(ours.xyz_m) == pytest.approx(sides(theirs.xyz_m), abs=1e-8)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("known", [[0, 1], [0, 4], [0, 25], [24, 26], [3, 12, 20]])
def test_a_few_known_points_place_the_whole_network(known):
    survey, truth = by_total_station()
    survey = replace(survey, observations=(control(truth.xyz_m, known), *survey.observations))
    found = approximate(unknown(survey))
    assert found.xyz_m == pytest.approx(truth.xyz_m, abs=0.02)
    assert adjust(found).xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-8)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", [Directions, Distances])
@pytest.mark.parametrize("seed", range(3))
def test_one_reading_in_ten_is_a_blunder(kind, seed):
    """Simulation: eight stations, three or four of which see a point; blunders of half a metre up.

    Every point is where it is to 2 cm: most sights agree on it.
    """
    xyz, pairs = ring(8, tank_points(8, 3), 30.0)
    known = (control(xyz, [0, 9, 14, 25, 28]), zeniths(xyz, pairs))
    readings = [directions(xyz, pairs, seed), distances(xyz, pairs)]
    rng = np.random.default_rng(seed)
    for i, one in enumerate(readings):
        if isinstance(one, kind):
            bad = rng.choice(len(one), len(one) // 10, replace=False)
            wrong = one.value.copy()
            wrong[bad] += rng.choice([-1, 1], len(bad)) * rng.uniform(0.5, 1.5, len(bad))
            readings[i] = replace(one, value=wrong)
    found = approximate(network(xyz, *known, *readings, sets=8))
    assert found.xyz_m == pytest.approx(xyz, abs=0.02)


def test_given_places_stay_to_the_last_bit():
    """Inner constraints and fixed coordinates need them as they were given."""
    survey, truth = by_total_station()
    xyz = np.full_like(truth.xyz_m, np.nan)
    xyz[[0, 5, 24]] = truth.xyz_m[[0, 5, 24]] + [5e5, 7.5e6, 100]
    found = approximate(replace(survey, xyz_m=xyz, sets=np.full(4, np.nan)))
    assert (found.xyz_m[[0, 5, 24]] == xyz[[0, 5, 24]]).all()
    held = np.zeros(xyz.shape, dtype=bool)
    held[[0, 5]] = True
    found = approximate(replace(survey, xyz_m=xyz, fixed=held, sets=np.full(4, np.nan)))
    assert (found.xyz_m[[0, 5]] == xyz[[0, 5]]).all()
    assert found.xyz_m - [5e5, 7.5e6, 100] == pytest.approx(truth.xyz_m, abs=0.02)


@pytest.mark.slow
def test_thousands_of_wall_points_take_no_time(figure):
    """Time grows with the number of sights, not faster."""
    xyz, pairs = ring(6, tank_points(60, 25), 20.0)
    survey = network(
        xyz, control(xyz, [0, 700, 1500]), directions(xyz, pairs), zeniths(xyz, pairs),
        distances(xyz, pairs), sets=6,
    )  # fmt: skip
    start = time.process_time()
    found = approximate(survey)
    figure("start of 1506 points by polar sights, s", time.process_time() - start)
    assert found.xyz_m == pytest.approx(xyz, abs=1e-5)


# What cannot be found is told in words.


def test_a_network_in_plan_has_no_heights():
    pairs = [(0, 1), (0, 2), (0, 3), (1, 0), (1, 2), (1, 3)]
    known = control(SQUARE, [0, 1], axes=(0, 1))
    survey = network(SQUARE[:4], known, directions(SQUARE, pairs), sets=2)
    with pytest.raises(
        SolutionError, match=r"heights \(z\) of P0, P1, P2, P3 are not determined: no"
    ):
        approximate(survey)
    flat = replace(survey, xyz_m=np.tile([np.nan, np.nan, 7.0], (4, 1)))
    assert approximate(flat).xyz_m[:, :2] == pytest.approx(SQUARE[:4, :2], abs=1e-6)


def test_heights_that_hang_on_nothing():
    pairs = [(0, 1), (0, 2), (0, 3)]
    survey = network(
        SQUARE[:4], control(SQUARE, [0, 1], axes=(0, 1)), control(SQUARE, [1], axes=(2,)),
        directions(SQUARE, pairs), distances(SQUARE, pairs, horizontal=True),
        levels(SQUARE, [(0, 2), (2, 3)]), sets=1,
    )  # fmt: skip
    with pytest.raises(
        SolutionError, match=r"heights \(z\) of P0, P2, P3 .* are not connected to any point"
    ):
        approximate(survey)


def test_two_networks_that_share_nothing():
    pairs = [(0, 1), (0, 2), (3, 4), (3, 5)]
    survey = network(
        SQUARE, control(SQUARE, [0, 1]), directions(SQUARE, pairs), distances(SQUARE, pairs),
        zeniths(SQUARE, pairs), sets=2,
    )  # fmt: skip
    with pytest.raises(SolutionError, match=r"points P3, P4, P5 .* share only 0 known"):
        approximate(survey)


def test_a_point_with_one_sight_is_left_to_the_adjustment():
    """It is rejected there, by name; here it only must not stand in the way."""
    pairs = [(0, 1), (0, 2), (0, 3), (1, 0), (1, 2)]
    survey = network(
        SQUARE[:4], control(SQUARE, [0, 1]), directions(SQUARE, pairs),
        levels(SQUARE, [(0, 2)]), sets=2,
    )  # fmt: skip
    found = approximate(survey)
    assert found.xyz_m[:3] == pytest.approx(SQUARE[:3], abs=1e-6)
    assert np.isnan(adjust(found).xyz_m[3]).all()


def test_unmeasured_points_have_no_influence():
    """A point fixed at the origin of UTM, a given point without a sight, a set without one."""
    far = SQUARE + [5e5, 7.5e6, 100]
    pairs = [(0, 1), (0, 2), (0, 3), (1, 0), (1, 4), (1, 5)]
    xyz = np.vstack([far, [[0, 0, 0], [1, 2, 3]]])
    held = np.zeros(xyz.shape, dtype=bool)
    held[6] = True
    survey = network(
        xyz, control(xyz, [0, 1]), directions(xyz, pairs), distances(xyz, pairs),
        zeniths(xyz, pairs), sets=3,
    )  # fmt: skip
    start = np.full(xyz.shape, np.nan)
    start[6:] = xyz[6:]
    found = approximate(replace(survey, xyz_m=start, fixed=held))
    assert found.xyz_m == pytest.approx(xyz, abs=1e-6)
    assert (found.xyz_m[6:] == xyz[6:]).all()
    assert found.sets[2] == 0.0


# The pieces: closed forms.


def test_arcs_alone_do_not_decide_between_two_places():
    centre, radius = np.array([[0.0, 0], [10, 0]]), np.array([7.0, 7.0])
    none = np.zeros((0, 2))
    assert place(none, none, centre, radius) is None
    third = np.vstack([centre, [5, 9]]), np.append(radius, 9 - np.sqrt(24))
    assert place(none, none, *third) == pytest.approx([5, np.sqrt(24)], abs=1e-9)


def test_most_sights_outvote_a_blunder():
    point = np.array([3.0, 4])
    origin = np.array([[0.0, 0], [10, 0], [0, 10], [10, 10], [5, -5]])
    towards = (point - origin) / np.linalg.norm(point - origin, axis=1)[:, None]
    towards[2] = [0.0, -1.0]
    none = np.zeros((0, 2)), np.zeros(0)
    assert place(origin, towards, *none) == pytest.approx(point, abs=1e-9)


def test_station_on_danger_circle_is_not_started():
    """The dangerous circle: every station on it sees the targets under the same angles."""
    angle = np.deg2rad([10, 100, 200])
    targets = 10 * np.column_stack([np.sin(angle), np.cos(angle)])
    station = 10 * np.array([np.sin(5.0), np.cos(5.0)])
    reading = np.arctan2(*(targets - station).T)
    assert free_station(targets, reading, np.full(3, np.nan)) is None
    inside = np.array([1.0, 2.0])
    reading = np.arctan2(*(targets - inside).T) - 1.0
    assert free_station(targets, reading, np.full(3, np.nan)) == pytest.approx(inside, abs=1e-9)
