"""The wall told apart from clutter, the axis and the tilt: simulation with known truth."""

import numpy as np
import pytest

from tankcal.errors import SolutionError
from tankcal.geometry.shell import course_of, find_shell

JOINTS = np.linspace(2.0, 11.5, 6)


def wall(rng, n=600, tilt=(0.0, 0.0), noise=0.003, dent=0.0, centre=(30.0, 20.0)):
    azimuth, z = rng.uniform(0, 2 * np.pi, n), rng.uniform(2.0, 11.5, n)
    radius = 6.5 + rng.normal(0, noise, n)
    radius -= dent * np.exp(-(((azimuth - 1.0) / 0.12) ** 2))  # runs up the whole wall
    x = centre[0] + tilt[0] * (z - 2.0) + radius * np.sin(azimuth)
    y = centre[1] + tilt[1] * (z - 2.0) + radius * np.cos(azimuth)
    return np.column_stack([x, y, z])


def clutter(rng, n=60):
    """A stair 0.4 m off the wall, a pipe 0.1 m off it, the roof, and a far station."""
    azimuth = np.concatenate([rng.uniform(1.5, 2.5, n // 2), rng.normal(4.0, 0.005, n - n // 2)])
    radius = np.concatenate([np.full(n // 2, 6.9), np.full(n - n // 2, 6.6)])
    z = np.concatenate([2 + 9 * (azimuth[: n // 2] - 1.5), rng.uniform(2, 11, n - n // 2)])
    near = np.column_stack([30 + radius * np.sin(azimuth), 20 + radius * np.cos(azimuth), z])
    return np.vstack([near, [[33.0, 21.0, 12.4], [30.0, 20.0, 12.9], [60.0, 60.0, 1.4]]])


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.002, -0.001), (0.03, 0.0)])
def test_clutter_is_separated_and_tilt_found(tilt):
    rng = np.random.default_rng(7)
    good = wall(rng, tilt=tilt)
    bad = clutter(rng) + np.outer(np.zeros(63), [0, 0, 0])
    bad[:, :2] += np.outer(bad[:, 2] - 2.0, tilt)
    shell = find_shell(np.vstack([good, bad]), JOINTS, 6.5)
    assert np.all(shell.reason[600:] != "")
    assert np.sum(shell.reason[:600] != "") <= 6  # 0.1 % of sound points is what snooping costs
    assert set(shell.reason[-3:]) == {"above_shell", "below_shell"}
    assert np.array(shell.slope) == pytest.approx(tilt, abs=5 * shell.tilt_sd)
    assert shell.tilt == pytest.approx(np.hypot(*tilt), abs=5 * shell.tilt_sd)
    assert shell.noise_m == pytest.approx(0.003, rel=0.1)


@pytest.mark.slow
def test_a_vertical_dent_is_form_and_not_clutter():
    rng = np.random.default_rng(8)
    shell = find_shell(wall(rng, dent=0.035), JOINTS, 6.5)
    assert np.sum(shell.reason != "") <= 4


def test_a_small_tank_may_depart_by_more_than_a_hundredth():
    """An ellipse of 60 mm that grows up the shell, R 4 m; a point 150 mm off is none of it."""
    rng = np.random.default_rng(3)
    azimuth, z = (
        np.tile(np.arange(24) * np.pi / 12, 6),
        np.repeat([1.6, 3.2, 4.6, 6.2, 7.6, 9.2], 24),
    )
    radius = 4.0 + 0.06 * z / 9.2 * np.cos(2 * azimuth) + 0.001 * rng.normal(size=len(z))
    radius[77] -= 0.15
    xyz = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z])
    shell = find_shell(xyz, np.array([1.0, 4.0, 7.0, 10.0]), 4.0)
    assert [*np.flatnonzero(shell.reason != "")] == [77]


@pytest.mark.slow
def test_a_single_blunder_is_found_by_its_normalised_residual():
    xyz = wall(np.random.default_rng(9))
    radius = np.hypot(*(xyz[17, :2] - (30, 20)))
    xyz[17, :2] = np.array([30, 20]) + (xyz[17, :2] - (30, 20)) * (1 + 0.025 / radius)
    shell = find_shell(xyz, JOINTS, 6.5)
    assert shell.reason[17] == "snooping"
    assert shell.w[17] > 3.29
    assert shell.residual_m[17] == pytest.approx(0.025, abs=0.012)
    assert find_shell(xyz, JOINTS, 6.5, snooping=False).reason[17] == ""


@pytest.mark.slow
def test_a_repeated_place_counts_once():
    xyz = wall(np.random.default_rng(10), n=200)
    shell = find_shell(np.vstack([xyz, xyz[3]]), JOINTS, 6.5)
    assert shell.reason[-1] == "same_place"
    assert shell.reason[3] == ""


@pytest.mark.slow
def test_perfect_points_are_all_accepted():
    shell = find_shell(wall(np.random.default_rng(11), noise=0.0), JOINTS, 6.5)
    assert np.all(shell.reason == "")
    assert shell.tilt < 1e-9


@pytest.mark.slow
def test_the_frame_changes_nothing():
    """Shifted to UTM coordinates and turned by 90 deg: the same points, the same tilt."""
    rng = np.random.default_rng(12)
    xyz = np.vstack([wall(rng, tilt=(0.004, 0.001)), clutter(rng)])
    here = find_shell(xyz, JOINTS, 6.5)
    turned = np.column_stack([xyz[:, 1] + 5e5, -xyz[:, 0] + 7.5e6, xyz[:, 2]])
    there = find_shell(turned, JOINTS, 6.5)
    assert np.array_equal(here.reason, there.reason)
    assert there.tilt == pytest.approx(here.tilt, rel=1e-6)
    turn = (there.tilt_azimuth_rad - here.tilt_azimuth_rad) % (2 * np.pi)
    assert turn == pytest.approx(np.pi / 2, abs=1e-6)


@pytest.mark.parametrize(
    ("xyz", "message"),
    [
        (np.random.default_rng(1).uniform(0, 100, (200, 3)) * [1, 1, 0.1], "no circle within"),
        (np.zeros((3, 3)) + [0, 0, 5], "too few"),
    ],
)
def test_no_wall_is_said(xyz, message):
    with pytest.raises(SolutionError, match=message):
        find_shell(xyz, JOINTS, 6.5)


def test_heights_belong_to_courses():
    assert list(course_of([1.99, 2.0, 3.89, 3.91, 11.5, 11.51], JOINTS)) == [0, 0, 0, 1, 4, 4]


@pytest.mark.slow
def test_one_level_of_points_leaves_the_shell_upright():
    """The z noise of a single ring would be a tilt of any size."""
    rng = np.random.default_rng(13)
    xyz = wall(rng, n=24)
    xyz[:, 2] = 5.0 + rng.normal(0, 0.001, 24)
    shell = find_shell(xyz, JOINTS, 6.5)
    assert not shell.tilt_known
    assert shell.tilt < 1e-6


@pytest.mark.slow
def test_points_of_large_declared_sd_are_not_blunders():
    """15 % of the points have, rightly, five times the sd of the others."""
    rng = np.random.default_rng(14)
    xyz = wall(rng, noise=0.0)
    sd = np.where(rng.uniform(size=600) < 0.15, 0.010, 0.002)
    xyz[:, :2] += rng.normal(size=(600, 2)) * sd[:, None]
    rejected = find_shell(xyz, JOINTS, 6.5, sd_m=sd).reason != ""
    assert rejected.sum() <= 6
    assert np.sum(find_shell(xyz, JOINTS, 6.5).reason != "") > 20  # what the sds are for


@pytest.mark.slow
def test_spiral_stair_leaves_wall_points_accepted():
    """20 steps over a third of the turn, 20 to 60 mm off a wall of 15 mm ovality."""
    rng = np.random.default_rng(15)
    xyz = wall(rng, n=400, noise=0.002)
    out = (xyz[:, :2] - (30, 20)) / np.hypot(*(xyz[:, :2] - (30, 20)).T)[:, None]
    azimuth = np.arctan2(out[:, 0], out[:, 1])
    xyz[:, :2] += out * (0.015 * np.cos(2 * azimuth))[:, None]
    turn, z = np.linspace(1.0, 3.0, 20), np.linspace(2.5, 11, 20)
    radius = 6.5 + 0.015 * np.cos(2 * turn) + rng.uniform(0.020, 0.060, 20)
    steps = np.column_stack([30 + radius * np.sin(turn), 20 + radius * np.cos(turn), z])
    shell = find_shell(np.vstack([xyz, steps]), JOINTS, 6.5)
    assert np.sum(shell.reason[:400] != "") <= 3
    assert np.sum(shell.reason[400:] != "") >= 18


def two_rings(apart_m, seed, bars=0):
    """Two rings of 24 points in each of five courses, and ends of level bars, sd 1 mm."""
    rng, pieces = np.random.default_rng(seed), []
    for bottom in JOINTS[:-1]:
        for part, count in ((0.25, 24), (0.75, 24), (0.9, bars)):
            azimuth = 0.01 + 2 * np.pi * np.arange(count) / max(count, 1)
            radius = 6.5 + 2 * apart_m * (part - 0.5) + rng.normal(0, 0.001, count)
            z = np.full(count, bottom + part * np.diff(JOINTS)[0])
            pieces.append(np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z]))
    return np.vstack(pieces)


@pytest.mark.slow
@pytest.mark.parametrize("bars", [0, 2])
def test_rings_of_one_course_may_differ_in_radius(bars):
    """Property: no more sound points go where the rings are 20 mm apart than where they are not.

    0.1 % of 240 is what the test costs; with one radius a course every second point went.
    """
    for seed in range(2):
        even = find_shell(two_rings(0.0, seed, bars), JOINTS, 6.5)
        assert np.sum(even.reason != "") <= 1
        for apart in (0.006, 0.020):
            found = find_shell(two_rings(apart, seed, bars), JOINTS, 6.5)
            assert np.sum(found.reason != "") <= 2
            assert found.noise_m == pytest.approx(0.001, rel=0.15)


def three_rings(wider_m, seed):
    """Three rings of 24 points in each course, the middle one wider, sd 1 mm."""
    rng, pieces = np.random.default_rng(seed), []
    azimuth = 2 * np.pi * np.arange(24) / 24
    for bottom in JOINTS[:-1]:
        for part, wider in ((0.1, 0.0), (0.5, wider_m), (0.9, 0.0)):
            radius = 6.5 + wider + rng.normal(0, 0.001, 24)
            z = np.full(24, bottom + part * np.diff(JOINTS)[0])
            pieces.append(np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z]))
    return np.vstack(pieces)


@pytest.mark.slow
def test_a_barrel_of_three_rings_keeps_its_points():
    """The ring at mid height is 6 mm wider than its neighbours: no taper, and no blunder."""
    even, barrel = (find_shell(three_rings(wider, 1), JOINTS, 6.5) for wider in (0.0, 0.006))
    assert np.sum(barrel.reason != "") <= np.sum(even.reason != "") + 1
    assert barrel.noise_m == pytest.approx(0.001, rel=0.15)


@pytest.mark.slow
def test_nozzle_and_stair_are_rejected_with_unequal_rings():
    """Six treads at heights of their own, 20 to 45 mm off, and the rim of a nozzle 30 mm off."""
    azimuth = np.linspace(1.0, 1.8, 6)
    treads = 6.5 + np.linspace(0.020, 0.045, 6)
    stair = np.column_stack(
        [treads * np.sin(azimuth), treads * np.cos(azimuth), 2.8 + 1.2 * (azimuth - 1.0)]
    )
    turn = 2 * np.pi * np.arange(6) / 6
    about = 4.0 + 0.15 / 6.5 * np.cos(turn)
    rim = np.column_stack([6.53 * np.sin(about), 6.53 * np.cos(about), 8.5 + 0.15 * np.sin(turn)])
    wall_points = two_rings(0.012, 0)
    found = find_shell(np.vstack([wall_points, stair, rim]), JOINTS, 6.5)
    assert np.all(found.reason[-12:] == "snooping")
    assert np.sum(found.reason[:-12] != "") <= 2


@pytest.mark.slow
def test_what_was_decided_beforehand():
    """Property: a kept point stays and is still tested, one left out is none of the search's."""
    xyz = wall(np.random.default_rng(3))
    away = np.array([36.46, 20.0, 5.0])  # 40 mm inside
    every = np.vstack([xyz, away])
    decided = np.zeros(len(every), dtype=int)
    alone = find_shell(every, JOINTS, 6.5)
    assert alone.reason[-1] == "snooping"
    decided[-1] = 1
    kept = find_shell(every, JOINTS, 6.5, decided=decided)
    assert kept.reason[-1] == ""
    assert kept.on_wall[-1]
    assert abs(kept.w[-1]) > 3.29
    assert np.array_equal(kept.reason[:-1], alone.reason[:-1])
    decided[-1] = -1
    left, without = find_shell(every, JOINTS, 6.5, decided=decided), find_shell(xyz, JOINTS, 6.5)
    assert left.reason[-1] == "overruled"
    assert np.array_equal(left.reason[:-1], without.reason)
    assert left.axis_m == pytest.approx(without.axis_m, abs=1e-9)
    assert left.residual_m[:-1] == pytest.approx(without.residual_m, abs=1e-7)


@pytest.mark.slow
def test_nothing_decided_is_the_search_alone():
    xyz = wall(np.random.default_rng(4))
    nothing = np.zeros(len(xyz), dtype=int)
    found = [find_shell(xyz, JOINTS, 6.5, decided=one) for one in (None, nothing)]
    assert np.array_equal(found[0].residual_m, found[1].residual_m)
