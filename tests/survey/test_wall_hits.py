"""Bare hits of a wall: where they are, what they share, and how control targets drift.

Truth: exact geometry of sights followed to a wall, differences, and the numbers of the field page.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse
from generated_hits import Surface, Tool, even_aims, take_hits
from job_builder import hit_parts, write_folder
from page_figures import figures_of, value_of

import tankcal
from tankcal.geometry.field.amplitudes import Amplitudes
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import Sites
from tankcal.methods.hits.warnings import drifts_of, repeats_of
from tankcal.pipeline.wall.shared_unknowns import estimate_causes
from tankcal.survey.measurements import Setup
from tankcal.survey.points import Points
from tankcal.survey.results import Cause
from tankcal.survey.wall_hits import ControlReading, Poses, RangingInstrument, WallHits, sight

STATION, ZERO = np.array([0.7, -0.4, 1.5]), 0.3
ROUND = Surface(lambda a, z: 6.5 + 0.01 * np.sin(2 * a) + 0.001 * z, (1.0, -0.5), (0.002, -0.001))
LEVELS = (0.5, 3.0, 6.5)


def hits_of(read, instrument, surface=""):
    """WallHits of readings (n, 3) from one set-up."""
    n = len(read)
    return WallHits(
        *(("I",) * n, (None,) * n, (None,) * n),
        *read.T,
        np.full(n, 1e-3),
        np.full(n, 2e-5),
        (surface,) * n,
        np.zeros(n, dtype=bool),
        {"I": Setup("I", "S", instrument.name)},
        {instrument.name: instrument},
    )


def poses(covariance=None, place=STATION, zero=ZERO, scale=0.0, offset=0.0):
    """Poses of the one set-up."""
    whole = np.zeros((6, 6)) if covariance is None else covariance
    values = np.array([scale]), np.array([offset])
    return Poses((("I", None),), place[None], np.array([zero]), ("TS",), *values, whole, ("frame",))


def test_hits_are_places_of_the_wall():
    aims = even_aims(ROUND, LEVELS, 12)
    tool = Tool(offset_m=0.004, scale=3e-5)
    read = take_hits(ROUND, STATION, aims, tool, zero=ZERO)
    known = RangingInstrument("TS", correction=1e-3, correction_m=0.002, u_offset_m=0.0)
    read[:, 2] = read[:, 2] / (1 + known.correction) - known.correction_m
    found = sight(hits_of(read, known), poses(scale=3e-5, offset=0.004))
    np.testing.assert_allclose(found.points.xyz_m, aims, atol=1e-9)
    assert found.is_inside.all()
    cosine = np.cos(found.incidence_rad)
    assert 0.7 < cosine.min() < cosine.max() < 1


def test_what_hits_share_by_differences():
    """Covariance by pose, scale and offset: each column against hits computed a little off."""
    read = take_hits(ROUND, STATION, even_aims(ROUND, LEVELS, 7), zero=ZERO)
    known = RangingInstrument("TS", u_offset_m=0.0)
    hits, step = hits_of(read, known), 1e-6

    def xyz(values):
        off = poses(None, values[:3], values[3], values[4], values[5])
        return sight(hits, off).points.xyz_m.ravel()

    at = np.array([*STATION, ZERO, 0.0, 0.0])
    steps = step * np.eye(6)
    by = np.column_stack([(xyz(at + one) - xyz(at - one)) / 2 / step for one in steps])
    rng = np.random.default_rng(1)
    root = 1e-3 * rng.normal(size=(6, 6))
    found = sight(hits, poses(root @ root.T)).points.covariance_m2.dense()
    own = sight(hits, poses()).points.covariance_m2.dense()
    np.testing.assert_allclose(found - own, by @ (root @ root.T) @ by.T, atol=1e-13)


@pytest.mark.slow
def test_own_noise_by_simulation():
    read = take_hits(ROUND, STATION, even_aims(ROUND, LEVELS, 4), zero=ZERO)
    known, rng = RangingInstrument("TS", u_offset_m=0.0), np.random.default_rng(2)
    hits = hits_of(read, known)
    noise = np.array([2e-5, 2e-5, 1e-3])
    drawn = [
        sight(hits_of(read + noise * rng.normal(size=read.shape), known), poses()).points.xyz_m
        for _ in range(2000)
    ]
    found = np.cov(np.reshape(drawn, (2000, -1)).T)
    own = sight(hits, poses()).points.covariance_m2.dense()
    assert np.abs(found - own).max() < 0.15 * own.max()


def test_the_bias_by_incidence_is_one_cause_of_each_surface():
    aims = even_aims(ROUND, LEVELS, 8)
    straight = take_hits(ROUND, STATION, aims, zero=ZERO)
    biased = take_hits(ROUND, STATION, aims, Tool(bias_m=0.001), zero=ZERO)
    known = RangingInstrument("TS", u_offset_m=0.0, u_incidence_m=0.001)
    found = sight(hits_of(straight, known, "paint"), poses()).points
    (cause,) = (one for one in found.causes if one.what == "incidence")
    assert (cause.name, cause.u, cause.unit) == ("TS paint", 1.0, "mm")
    away = sight(hits_of(biased, known, "paint"), poses()).points.xyz_m - found.xyz_m
    # off by what the wall's own slope makes of the incidence from the round one
    np.testing.assert_allclose(-cause.column_m, away.ravel(), atol=3e-5)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("outside", "strapped", "u_first", "u_last", "u_mean", "r", "u_offset"),
    [
        (False, False, 1.560, 1.560, 1.511, -0.993, 1.500),
        (False, True, 0.127, 0.580, 0.394, -0.905, 0.428),
        (True, False, 0.302, 0.302, 0.128, -0.324, 0.178),
        (True, True, 0.123, 0.302, 0.123, -0.325, 0.178),
    ],
)
def test_offset_and_radius_of_the_field_page(
    outside, strapped, u_first, u_last, u_mean, r, u_offset
):
    """Page of worked numbers, section 3: one set-up in the middle; set-ups outside, 6 m from the
    wall, whose distance from the axis is known to 0.15 mm; a strap of level 1.
    """
    *sizes, offset_mm, alone, with_strap, with_outside = map(value_of, figures_of(
        "docs/wall-hits.md",
        "(() levels of () hits, offset known to () mm) it is (), with a strap (), and with set-ups "
        "outside ()",
    ))  # fmt: skip
    stated = {(False, False): alone, (False, True): with_strap, (True, False): with_outside}
    assert r == stated.get((outside, strapped), r)
    sides, levels, count = 1 + outside, 10, 24
    assert [*sizes, offset_mm] == [levels, count, 1.5]
    n = sides * levels * count
    level = np.tile(np.repeat(np.arange(levels), count), sides)
    azimuth = np.tile(2 * np.pi * np.arange(count) / count, sides * levels)
    is_out = np.repeat([0.0, 1.0][:sides], levels * count)
    sign = 1 - 2 * is_out  # of what too long a distance does to a radius
    scale, offset = sign * (6.5e3 - 0.5e3 * is_out) * 20e-6, sign * 1.5
    columns = [scale, offset, 0.15 * is_out, 0.1 * is_out]  # place of the set-ups, plate
    if strapped:
        level, azimuth = np.append(level, 0), np.append(azimuth, np.nan)
        columns = [np.append(one, last) for one, last in zip(columns, (0, 0, 0, 0.1), strict=True)]
    noise = sum(np.outer(one, one) for one in columns)
    noise += np.diag(np.append(np.full(n, 4.0), [(0.5 / 2 / np.pi) ** 2] * strapped))
    whole = n + strapped
    sites = Sites(
        level, np.where(np.isnan(azimuth), -1, level), np.zeros(whole), azimuth,
        np.zeros(whole, dtype=bool),
    )  # fmt: skip
    flat = Amplitudes(np.full(len(COMPONENTS), 1e-30), 0 * np.eye(len(COMPONENTS)), np.ones(12))
    field = WallField(sites, np.full(whole, 6.5), 1e-6 * noise, flat, 6.5)
    radial = np.zeros((whole, 3 * n))  # readings as points whose x is the radius
    radial[np.arange(n), 3 * np.arange(n)] = 1
    moves = np.zeros((2, 3 * n))
    moves[:, ::3] = -1e-3 * np.array([columns[1][:n], columns[0][:n]])
    causes = (
        Cause("TS", "instrument_offset", 1.5, "mm", moves[0]),
        Cause("TS", "instrument_scale", 20.0, "ppm", moves[1]),
    )
    points = Points((), None, None, None, (), (), (), causes=causes)
    wall = SimpleNamespace(
        field=field,
        accepted=np.arange(n),
        read=True,
        radii_by_points=scipy.sparse.csr_array(radial),
    )
    found, _ = estimate_causes(SimpleNamespace(points=points), wall)
    assert 1000 * found.u_after == pytest.approx(u_offset, abs=6e-4)
    assert found.correlation == pytest.approx(r, abs=1e-3)
    variance = field.means.weights @ field.noise_m2 @ field.means.weights.T
    sds = 1000 * np.sqrt(np.diag(variance))
    assert [sds[0], sds[-1]] == pytest.approx([u_first, u_last], abs=6e-4)
    assert 1000 * np.sqrt(variance.mean()) == pytest.approx(u_mean, abs=6e-4)


def test_control_targets_tell_a_linear_drift():
    rng, rate = np.random.default_rng(3), 2e-9
    control = [
        ControlReading("I", name, 1.0 + rate * t + 1e-9 * rng.normal(), 1.4 - rate * t, 8.0, t)
        for t in (600.0, 0.0, 1800.0, 3600.0)
        for name in "AB"
    ]
    control.append(ControlReading("I", "C", 6.2, np.nan, np.nan, 100.0))
    repeats = repeats_of(control)
    assert [len(one.rows) for one in repeats] == [4, 4, 1]
    assert repeats[0].elapsed_s.tolist() == [0.0, 600.0, 1800.0, 3600.0]
    assert np.isnan(repeats[2].distance_m).all()
    (drift,) = drifts_of(repeats)
    assert drift.direction_rad_s == pytest.approx(rate, rel=0.02)
    assert drift.zenith_rad_s == pytest.approx(-rate, rel=1e-9)
    assert drift.hours == 1.0


def test_a_direction_that_passes_zero_is_no_drift():
    control = [
        ControlReading("I", "A", angle, 1.5, 8.0, time)
        for angle, time in ((1e-6, 0.0), (2 * np.pi - 1e-6, 60.0))
    ]
    assert repeats_of(control)[0].direction_rad[1] == pytest.approx(-2e-6, abs=1e-12)


def test_times_are_read(tmp_path):
    rows = [{"setup": "I", "direction_deg": 1.0, "zenith_deg": 90.0, "distance_m": 6.0}]
    parts = hit_parts(rows * 5)
    parts.tables["control_readings"] = [
        ["setup", "target", "distance_m", "time"],
        ["I", "A", 5.0, "2026-01-05T14:30"],
        ["I", "A", 5.0, "2026-01-05 15:00:30.5"],
    ]
    first, second = tankcal.load(write_folder(tmp_path, parts)).hits.control
    assert second.time_s - first.time_s == 1830.5
    parts.tables["control_readings"][1][3] = "2026-01-05"
    parts.tables["control_readings"][2][3] = "2026-13-05T14:30"
    with pytest.raises(tankcal.InputError) as error:
        tankcal.load(write_folder(tmp_path, parts))
    assert [(one.row, one.column) for one in error.value.problems] == [(2, "time"), (3, "time")]
