"""Simulated calibrations by liquid of an upright tank: a true tank is filled, levels are read.

Nothing is drawn through the linear model: a tank of six courses has radii, a bottom, a meter and
runs of its own; batches raise the level to where the true volumes have it, and dips are read there.

    truth = fill_tanks(rng, 500)
    held(truth, Calibrator())        the share of jobs whose intervals hold what is true
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.tank.liquid import Effect, adjust_steps, estimate_run_effect
from tankcal.uncertainty import Source, combine, coverage_factor

RADIUS_M, COURSES, HEIGHT_M = 6.5, 6, 1.6
AREA_M2 = np.pi * RADIUS_M**2
EDGES_M = HEIGHT_M * np.arange(COURSES + 1)
FIRST_M3, STEP_M = 0.3 * AREA_M2, 0.1
ROWS_M = np.array([0.3, 0.9, 1.5, 2.0, 4.0, 7.0, 9.6])
PAIRS = ((0, 3), (1, 4), (3, 6), (5, 6))  # deliveries between these rows


@dataclass
class Survey:
    """Standard uncertainties; those of a true tank are drawn with them."""

    scale: float = 108e-6
    radius_m: float = 0.0003
    bottom_m3: float = 0.3
    meter: float = 300e-6
    run: float = 300e-6
    repeatability: float = 1e-4
    fixed_m3: float = 0.002
    dip_m: float = 0.0005
    runs: int = 3
    steps: int = 18

    @cached_property
    def batches(self):
        """(runs steps,) indicated."""
        one = np.append(FIRST_M3, np.full(self.steps - 1, STEP_M * AREA_M2))
        return np.tile(one, self.runs)

    @cached_property
    def run_of(self):
        """(runs steps,) number of its run."""
        return np.repeat(np.arange(self.runs), self.steps)

    @cached_property
    def differences(self):
        """(n, n) increments of dips, each run from empty."""
        one = np.eye(self.steps) - np.eye(self.steps, k=-1)
        return np.kron(np.eye(self.runs), one)


def volumes(levels_m, radii_m, bottom_m3):
    """(jobs, n) true volumes below levels (jobs, n), of radii (jobs, courses)."""
    wet = np.clip(levels_m[..., None] - EDGES_M[:-1], 0, HEIGHT_M)
    return bottom_m3[:, None] + np.pi * np.sum(radii_m[:, None, :] ** 2 * wet, axis=-1)


def levels(volume_m3, radii_m, bottom_m3):
    """(jobs, n) levels of true volumes."""
    areas = np.pi * radii_m**2
    full = bottom_m3[:, None] + np.cumsum(np.pad(areas, ((0, 0), (1, 0))) * HEIGHT_M, axis=1)
    course = np.sum(volume_m3[..., None] > full[:, None, 1:-1], axis=-1)
    low = np.take_along_axis(full, course, axis=1)
    over = (volume_m3 - low) / np.take_along_axis(areas, course, axis=1)
    return EDGES_M[course] + over


@dataclass
class Truth:
    """True volumes of ROWS_M and dips as read, of some jobs."""

    survey: Survey
    rows_m3: np.ndarray
    dips_m: np.ndarray


def fill_tanks(rng, jobs, survey=None):
    """`Truth` of jobs: true tanks, filled and read."""
    survey = survey or Survey()
    scale = survey.scale * rng.normal(size=(jobs, 1))
    radii = RADIUS_M * (1 + scale) + survey.radius_m * rng.normal(size=(jobs, COURSES))
    bottom = survey.bottom_m3 * rng.normal(size=jobs)
    factor = 1 + survey.meter * rng.normal(size=(jobs, 1))
    runs = survey.run * rng.normal(size=(jobs, survey.runs))
    sd = np.hypot(survey.repeatability * survey.batches, survey.fixed_m3)
    noise = sd * rng.normal(size=(jobs, len(sd)))
    went_in = factor * (1 + runs[:, survey.run_of]) * survey.batches + noise
    inside = np.cumsum(went_in.reshape(jobs, survey.runs, -1), axis=2).reshape(jobs, -1)
    true = levels(inside, radii, bottom)
    dips = true + survey.dip_m * rng.normal(size=true.shape)
    rows = volumes(np.tile(ROWS_M, (jobs, 1)), radii, bottom)
    return Truth(survey, rows, dips)


class Calibrator:
    """Adjusts simulated jobs: the nominal tank, linear in its causes.

    independent  increments weighed as if no dip served two of them
    run          None: found from the runs; else the sd that is taken
    """

    def __init__(self, survey=None, *, independent=False, run=None):
        self.survey, self.run = survey or Survey(), run
        mine = self.survey
        dips = np.cumsum(np.append(0.3, np.full(mine.steps - 1, STEP_M)))
        over = mine.differences
        self.columns = self.geometry(ROWS_M)
        self.effects = [
            Effect("geometry", over @ self.geometry(np.tile(dips, mine.runs))),
            Effect("meter", -mine.meter * mine.batches[:, None]),
        ]
        of_dips = AREA_M2 * mine.dip_m * over
        if independent:
            of_dips = np.diag(np.linalg.norm(of_dips, axis=1))
        batches = np.hypot(mine.repeatability * mine.batches, mine.fixed_m3)
        self.noise = [Effect("batches", np.diag(batches)), Effect("dips", of_dips)]
        self.by_run = -mine.batches[:, None] * (mine.run_of[:, None] == np.arange(mine.runs))
        self.without = adjust_steps(np.zeros(len(over)), self.noise, self.effects)

    def geometry(self, at_m):
        """(rows, 8) scale, radii and bottom, by one u of each."""
        mine = self.survey
        wet = np.clip(np.asarray(at_m)[:, None] - EDGES_M[:-1], 0, HEIGHT_M)
        radii = 2 * np.pi * RADIUS_M * mine.radius_m * wet
        scale = 2 * AREA_M2 * mine.scale * np.asarray(at_m)[:, None]
        return np.hstack([scale, radii, np.full((len(wet), 1), mine.bottom_m3)])

    def misclosures(self, dips_m):
        """(n,) metered less nominal increments, of the dips of one job."""
        return self.survey.batches - self.survey.differences @ (AREA_M2 * dips_m)

    def calibrate(self, dips_m):
        """(volumes of ROWS_M, sources) of one job."""
        y, effects = self.misclosures(dips_m), list(self.effects)
        found = self.run
        if found is None:
            found = estimate_run_effect(self.without.weight, y, self.by_run)
        if found is not None and found.sd > 0:
            effects.append(Effect("runs", found.sd * self.by_run))
        adjusted = adjust_steps(y, self.noise, effects)
        gain = self.columns @ adjusted.gain[adjusted.place("geometry")]
        own = [Source("geometry", self.columns - gain @ self.effects[0].columns)]
        own += [Source(one.kind, -gain @ one.columns) for one in (*self.noise, self.effects[1])]
        if len(effects) > 2:
            own.append(Source("runs", -gain @ effects[2].columns, found.dof))
        return AREA_M2 * ROWS_M + gain @ y, own


def held(truth, calibrator, probability=0.95):
    """(rows + deliveries,) share of jobs whose intervals hold the true volumes."""
    pairs = np.zeros((len(PAIRS), len(ROWS_M)))
    for line, (low, high) in zip(pairs, PAIRS, strict=True):
        line[low], line[high] = -1.0, 1.0
    weights = np.vstack([np.eye(len(ROWS_M)), pairs])
    off, u, dof = [], [], []
    for true, dips in zip(truth.rows_m3, truth.dips_m, strict=True):
        volume, sources = calibrator.calibrate(dips)
        stated = combine([one.weighted(weights) for one in sources], len(weights))
        off.append(weights @ (volume - true))
        u.append(stated.u)
        dof.append(stated.effective_dof)
    k = coverage_factor(probability, np.array(dof))
    return np.mean(np.abs(off) <= k * np.array(u), axis=0)
