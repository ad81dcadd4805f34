"""Which of two surfaces is the wall where a screen hides a part of it.

Truth: an oval, leaning wall that is no model of the package; the points of the hidden part lie on
the screen.
"""

import numpy as np
import pytest

from tankcal.clouds.wall.start import find_surface
from tankcal.errors import InputError

TURN = 2 * np.pi


def screened(radius_m, side, share, off_m, heights=(0.0, 1.0), seed=1, count=40_000, dense=1.0):
    """Points (n, 3) of a wall with a screen before a share of its turn, and which are of the wall.

    The screen may get `dense` times as many points as the wall; it is nearer to the scanner.
    """
    rng = np.random.default_rng(seed)
    height = 1.2 * radius_m
    azimuth, z = rng.uniform(0, TURN, count), rng.uniform(0, height, count)
    low, high = np.multiply(heights, height)
    hidden = ((azimuth - rng.uniform(0, TURN)) % TURN < share * TURN) & (z > low) & (z < high)
    kept = hidden | (rng.uniform(size=count) < 1 / dense)
    azimuth, z, hidden = azimuth[kept], z[kept], hidden[kept]
    inwards = 1 if side == "inside" else -1
    form = 0.001 * radius_m * np.cos(2 * azimuth + 1) + 0.005 * np.cos(5 * azimuth) * z / height
    r = radius_m + np.where(hidden, -inwards * off_m, form) + rng.normal(0, 0.002, len(z))
    x, y = r * np.sin(azimuth) + 0.002 * z, r * np.cos(azimuth) - 0.001 * z
    return np.column_stack([x, y, z]), ~hidden


def found_surface(xyz, radius_m, side):
    outwards = np.full(len(xyz), 1 if side == "inside" else -1)
    sizes = {"kind": "vertical", "ends_m": (0.0, 1.2 * radius_m), "radius_m": radius_m}
    return find_surface(xyz, outwards=outwards, **sizes)[0]


def share_near(surface, xyz):
    return np.mean(np.abs(surface.places(xyz)[2]) < 0.08)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("side", ["inside", "outside"])
@pytest.mark.parametrize(
    ("radius_m", "share", "off_m", "heights", "dense"),
    [
        (3.0, 0.3, 0.2, (0.0, 1.0), 1.0),
        (4.0, 0.4, 0.6, (0.0, 1.0), 2.0),
        (8.0, 0.1, 0.6, (0.0, 1.0), 3.0),
        (8.0, 0.4, 0.6, (0.0, 1.0), 2.0),
        (12.0, 0.25, 0.6, (0.0, 1.0), 4.0),
        (12.0, 0.7, 0.6, (0.0, 0.5), 2.0),
        (21.0, 0.4, 0.45, (0.0, 0.7), 2.0),
        (30.0, 0.3, 1.5, (0.4, 1.0), 2.0),
        (30.0, 0.45, 0.8, (0.0, 1.0), 1.0),
    ],
)
def test_wall_behind_a_screen_is_found(side, radius_m, share, off_m, heights, dense):
    xyz, of_wall = screened(radius_m, side, share, off_m, heights, dense=dense)
    surface = found_surface(xyz, radius_m, side)
    assert surface.radius_m == pytest.approx(radius_m, rel=1e-3)
    assert share_near(surface, xyz[of_wall]) > 0.99
    assert share_near(surface, xyz[~of_wall]) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("side", ["inside", "outside"])
@pytest.mark.parametrize(
    ("radius_m", "share", "off_m"), [(4.0, 0.75, 0.6), (8.0, 0.6, 0.6), (12.0, 0.7, 0.6)]
)
def test_wall_that_is_mostly_hidden_is_refused(side, radius_m, share, off_m):
    xyz, _ = screened(radius_m, side, share, off_m)
    with pytest.raises(InputError) as refused:
        found_surface(xyz, radius_m, side)
    assert refused.value.problems[0].expected.code in (
        "cloud_wall_hidden",
        "cloud_of_other_radius",
    )


@pytest.mark.slow
def test_wall_without_a_screen_is_that_of_the_first_fit():
    """Property: nothing changes where no surface lies behind the first one."""
    xyz, _ = screened(6.0, "inside", 0.0, 0.6)
    first = find_surface(xyz, kind="vertical", ends_m=(0.0, 7.2), radius_m=6.0)[0]
    assert found_surface(xyz, 6.0, "inside").radius_m == first.radius_m


@pytest.mark.slow
def test_radius_beyond_three_percent_is_refused():
    xyz, _ = screened(6.0, "inside", 0.0, 0.6)
    with pytest.raises(InputError) as refused:
        found_surface(xyz, 6.0 / 1.04, "inside")
    assert refused.value.problems[0].expected.code == "cloud_of_other_radius"
