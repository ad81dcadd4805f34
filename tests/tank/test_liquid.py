"""Metered steps: what they are worth beside a geometry, by an own model of plain cylinders.

Kinds of truth: a published table (liquid.md 3, a calculation of its own), limits, a second method
(dense least squares with every unknown written out), invariance.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tankcal.tank.liquid import Effect, adjust_steps, fill_of, reading_effects, reduce_steps
from tankcal.tank.liquid.adjustment import averaged

RADIUS_M, COURSES, HEIGHT_M = 6.5, 6, 1.6
AREA_M2 = np.pi * RADIUS_M**2


@dataclass
class Cylinders:
    """Six courses, the volume below the first dip an own unknown, batches between dips from 0.3 m.

    first_m3 in the first batch, from empty; rows are all dips, then the top.
    """

    scale: float = 108e-6
    dip_m: float = 0.0005
    top_dip_m: float = 2.0
    first_m3: float = 20.0
    times: float = 1.0  # of the sds of geometry
    noise: float = 1.0  # of the sds of liquid

    def __post_init__(self):
        self.dips = np.round(np.arange(0.3, self.top_dip_m + 0.01, 0.1), 9)
        self.steps = np.eye(len(self.dips)) - np.eye(len(self.dips), k=-1)

    def columns(self, levels):
        """Scale, each radius, the volume below 0.3 m."""
        above = np.asarray(levels) - 0.3
        edges = HEIGHT_M * np.arange(COURSES + 1)
        low, high = np.maximum(edges[:-1], 0.3), edges[1:]
        wet = np.clip(np.asarray(levels)[:, None] - low, 0, high - low)
        radii = 2 * np.pi * RADIUS_M * 0.0003 * wet
        scale = 2 * AREA_M2 * above[:, None] * self.scale
        return self.times * np.hstack([scale, radii, np.full((len(above), 1), 0.3)])

    @property
    def batches(self):
        return np.append(self.first_m3, np.full(len(self.dips) - 1, 0.1 * AREA_M2))

    def noise_effects(self):
        dips = AREA_M2 * self.dip_m * self.steps
        batches = np.diag(np.hypot(1e-4 * self.batches, 0.002))
        return [Effect("batches", self.noise * batches), Effect("dips", self.noise * dips)]

    def effects(self):
        geometry = self.steps @ self.columns(self.dips)
        meter = -self.noise * 300e-6 * self.batches[:, None]
        return [Effect("geometry", geometry), Effect("meter", meter)]

    def adjusted(self, misclosure=None):
        y = np.zeros(len(self.dips)) if misclosure is None else misclosure
        return adjust_steps(y, self.noise_effects(), self.effects())

    def u_m3(self, found, weights, levels):
        """(geometry only, joint) of a weighted sum of rows."""
        rows = np.atleast_2d(weights) @ self.columns(levels)
        gain = rows @ found.gain[found.place("geometry")]
        parts = [rows - gain @ found.effects[0].columns, -gain @ found.effects[1].columns]
        parts += [-gain @ one.columns for one in found.noise]
        return np.linalg.norm(rows), np.linalg.norm(np.hstack(parts))


LEVELS = np.array([0.3, 2.0, 9.6])
ROWS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 1]], dtype=float)
PUBLISHED = {  # liquid.md 3: three rows, a delivery, scale and meter in ppm
    "geometry": (Cylinders(), 0, (0.300, 0.304, 0.404, 0.222), None),
    "joint": (Cylinders(), 1, (0.030, 0.048, 0.232, 0.195), (94, 221)),
    "wide geometry": (Cylinders(400e-6), 0, (0.300, 0.351, 1.033, 0.808), None),
    "wide": (Cylinders(400e-6), 1, (0.031, 0.074, 0.421, 0.354), (174, 282)),
    "to the top": (Cylinders(400e-6, top_dip_m=9.6), 1, (0.020, 0.070, 0.353, 0.285), (142, 281)),
    "fine dips": (Cylinders(dip_m=0.0001), 1, (0.009, 0.045, 0.225, 0.184), (89, 187)),
}


@pytest.mark.parametrize("case", PUBLISHED)
def test_published_worth_of_liquid(case):
    tank, which, volumes, ppm = PUBLISHED[case]
    found = tank.adjusted()
    u = [tank.u_m3(found, weights, LEVELS)[which] for weights in ROWS]
    assert_allclose(u, volumes, atol=1e-3)
    if ppm:
        sd = found.sd[0] * tank.scale * 1e6, found.sd[found.place("meter")][0] * 300
        assert_allclose(sd, ppm, atol=1.0)


@pytest.mark.parametrize(("dip_m", "expected"), [(0.0005, 0.82), (0.0001, 1.19)])
def test_published_offset_of_radii_is_not_detectable(dip_m, expected):
    """1.5 mm in all radii, against dips between 0.3 and 2 m (the meter and the scale are known)."""
    tank = Cylinders(dip_m=dip_m)
    offset = tank.steps @ (2 * np.pi * RADIUS_M * (tank.dips - 0.3)[:, None])
    total = np.array([[-1.0, *np.zeros(len(tank.dips) - 2), 1.0]]) @ np.linalg.inv(tank.steps)
    every = [one.columns for one in (*tank.noise_effects(), *tank.effects())]
    sd = np.linalg.norm(total @ np.hstack(every))
    between = float((total @ offset)[0, 0]) * 0.0015
    assert_allclose([between, between / sd], [0.104, expected], atol=5e-3)


def written_out(tank, misclosure):
    """Geometry, meter and dips as unknowns of one dense least squares; (volumes, covariance)."""
    count, size = len(tank.dips), 8
    geometry, meter = (one.columns for one in tank.effects())
    batches, dips = (one.columns for one in tank.noise_effects())
    design = np.hstack([geometry, meter, dips / tank.dip_m])
    weights = np.concatenate(
        [1 / np.diag(batches), np.ones(size + 1), np.full(count, 1 / tank.dip_m)]
    )
    full = np.vstack([design, np.eye(size + 1 + count)]) * weights[:, None]
    seen = np.concatenate([misclosure, np.zeros(size + 1 + count)]) * weights
    unknowns, *_ = np.linalg.lstsq(full, seen, rcond=None)
    rows = np.hstack([tank.columns(LEVELS), np.zeros((3, 1 + count))])
    return rows @ unknowns, rows @ np.linalg.inv(full.T @ full) @ rows.T


def test_second_method_with_every_unknown_written_out():
    tank = Cylinders(scale=400e-6)
    misclosure = np.random.default_rng(1).normal(0, 0.1, len(tank.dips))
    found = tank.adjusted(misclosure)
    volumes, covariance = written_out(tank, misclosure)
    joint = tank.columns(LEVELS) @ found.estimate[found.place("geometry")]
    u = [tank.u_m3(found, weights, LEVELS)[1] for weights in ROWS]
    assert_allclose(joint, volumes, rtol=0, atol=1e-9)
    assert_allclose(u, np.sqrt(np.diag(ROWS @ covariance @ ROWS.T)), rtol=0, atol=1e-9)


def test_without_liquid_the_geometry_alone():
    tank = Cylinders(noise=1e8)
    found = tank.adjusted(np.full(len(tank.dips), 0.05))
    joint = tank.columns(LEVELS) @ found.estimate[found.place("geometry")]
    alone, both = np.transpose([tank.u_m3(found, weights, LEVELS) for weights in ROWS])
    assert_allclose(joint, 0.0, atol=1e-9)
    assert_allclose(both, alone, rtol=0, atol=1e-9)


def test_without_geometry_the_liquid_alone():
    """Priors of geometry and bottom without end: least squares in which both are free."""
    misclosure = np.random.default_rng(2).normal(0, 0.1, 18)
    wide, tank = Cylinders(times=1e6), Cylinders()
    found = wide.adjusted(misclosure)
    joint = wide.columns(LEVELS) @ found.estimate[found.place("geometry")]
    u = [wide.u_m3(found, weights, LEVELS)[1] for weights in ROWS[:2]]
    free = Cylinders().columns(LEVELS)[:, [1, 2, 7]]  # two radii and the bottom: all that is wet
    noise = np.hstack([one.columns for one in (*tank.noise_effects(), tank.effects()[1])])
    design = tank.steps @ tank.columns(tank.dips)[:, [1, 2, 7]]
    precision = np.linalg.inv(noise @ noise.T)
    covariance = np.linalg.inv(design.T @ precision @ design)
    best = covariance @ design.T @ precision @ misclosure
    assert_allclose(joint[:2], free[:2] @ best, rtol=0, atol=1e-9)
    assert_allclose(u, np.sqrt(np.diag(free @ covariance @ free.T))[:2], rtol=0, atol=1e-9)


def test_runs_of_no_noise_have_their_mean_square():
    """Closed form: s = 0, the usual mean square with as many degrees of freedom as numbers."""
    found = averaged(np.array([0.3, -0.4, 1.2]), np.full(3, 1e-12))
    assert_allclose(found.sd**2, (0.09 + 0.16 + 1.44) / 3, rtol=1e-3)
    assert_allclose(found.dof, 3.0, rtol=1e-2)
    assert_allclose(found.restricted_sd, found.sd, rtol=0.03)


def test_runs_that_agree_are_no_proof():
    found = averaged(np.array([0.1, -0.1]), np.full(2, 1.0))
    assert found.restricted_sd == 0
    assert 0.2 < found.sd < 1.5
    assert found.dof < 2.0


@dataclass
class Rows:
    """Metered rows as `fill_of` and `reduce_steps` ask for them."""

    run: tuple
    volume_m3: np.ndarray
    dip_m: np.ndarray
    used: np.ndarray
    meter_c: np.ndarray
    tank_c: np.ndarray
    s_dip_m: np.ndarray
    s_volume_m3: np.ndarray
    meters: dict
    expansion_per_k: float = 8e-4
    density_c: float = 15.0
    u_temperature_c: float = 0.2
    u_dip_zero_m: float = 0.0003
    u_expansion_per_k: float = 4e-5

    @property
    def meter(self):
        return ("M",) * len(self.run)


@dataclass
class Meter:
    factor: float = 1.0004
    u_factor: float = 2e-4
    repeatability: float = 1e-4
    fixed_m3: float = 0.002


def rows_of(dips, *, unused=(), runs=("a",), tank_c=None):
    """Noiseless rows of a tank of 10 m2, a metre of batches; levels by mass, temperatures vary."""
    count, volume, meter_c = len(dips), [], []
    rng = np.random.default_rng(4)
    tank = 18 + 3 * rng.random(count) if tank_c is None else tank_c
    warm = 30 + 5 * rng.random(count)
    rho = lambda t: 1 - 8e-4 * (t - 15.0)  # noqa: E731
    for i, dip in enumerate(dips):
        before = 0.0 if i == 0 or np.isnan(dips[i - 1]) else rho(tank[i - 1]) * 10 * dips[i - 1]
        mass = 0.0 if i == 0 else rho(tank[i]) * 10 * dip - before
        volume.append(mass / rho(warm[i]) / 1.0004)
        meter_c.append(warm[i])
    used = np.array([i not in unused for i in range(count)])
    nan = np.full(count, np.nan)
    sds = np.where(np.isnan(dips), 0.0, 0.0005)
    return Rows(
        tuple(runs) * count, np.array(volume), np.array(dips), used, np.array(meter_c), tank, sds,
        nan, {"M": Meter()},
    )  # fmt: skip


@pytest.mark.parametrize("unused", [(), (2,), (2, 3), (4,)])
def test_balance_of_mass(unused):
    """Closed form: without errors nothing is left, also over dips that do not count."""
    constant = np.full(5, 18.0) if unused else None  # a batch of many dips has one temperature
    rows = rows_of([np.nan, 0.5, 1.1, 1.8, 2.0], unused=unused, tank_c=constant)
    fill = fill_of(rows)
    volume = 10 * rows.dip_m[fill.dip_row]
    assert_allclose(reduce_steps(rows, fill, volume).misclosure_m3, 0.0, atol=1e-12)
    assert np.sum(fill.step >= 0) == 4 - (unused == (4,))


def test_balance_of_mass_when_emptied():
    rows = rows_of([2.0, 1.4, 0.9, 0.2])
    fill = fill_of(rows)
    assert np.all(rows.volume_m3[1:] < 0)
    volume = 10 * rows.dip_m[fill.dip_row]
    assert_allclose(reduce_steps(rows, fill, volume).misclosure_m3, 0.0, atol=1e-12)


def test_steps_of_two_runs():
    rows = rows_of([np.nan, 0.5, 1.1, 0.4, 1.2, 2.0])
    rows.run = ("a", "a", "a", "b", "b", "b")
    fill = fill_of(rows)
    assert fill.start.tolist() == [-1, 0, 2, 3]
    assert fill.end.tolist() == [0, 1, 3, 4]
    assert fill.run.tolist() == [0, 0, 1, 1]
    assert fill.from_empty.tolist() == [True, False, False, False]


def test_columns_of_the_readings_are_derivatives():
    """Differences: each cause moved by its standard deviation, the misclosure as it comes out."""
    rows = rows_of([np.nan, 0.5, 1.1, 1.8])
    fill, volume = fill_of(rows), 10 * np.array([0.5, 1.1, 1.8])
    reduced = reduce_steps(rows, fill, volume)
    effects = reading_effects(rows, fill, reduced, volume, np.full(3, 10.0))
    of = {one.kind: one.columns for one in (*effects.noise, *effects.common)}
    of |= {one.kind: one.columns.toarray() for one in effects.noise}

    def misclosure(**change):
        moved = replace(rows, **change)
        return reduce_steps(moved, fill, 10 * moved.dip_m[fill.dip_row]).misclosure_m3

    base, u = misclosure(), 0.2
    for column, place in zip(of["liquid_temperatures"].T, range(6), strict=True):
        name, row = ("meter_c", place + 1) if place < 3 else ("tank_c", place - 2)
        values = getattr(rows, name).copy()
        values[row] -= u
        assert_allclose(misclosure(**{name: values}) - base, column, rtol=0.02, atol=1e-6)
    longer = misclosure(expansion_per_k=8e-4 + 4e-5)
    assert_allclose(base - longer, of["liquid_expansion"][:, 0], rtol=0.05)
    dips = rows.dip_m.copy()
    dips[2] += 0.0005
    assert_allclose(base - misclosure(dip_m=dips), of["dip_readings"][:, 1], rtol=1e-9)
    larger = replace(rows, meters={"M": Meter(factor=1.0004 * (1 - 2e-4))})
    assert_allclose(
        reduce_steps(larger, fill, volume).misclosure_m3 - base, of["meter_factor"][:, 0], rtol=1e-9
    )
