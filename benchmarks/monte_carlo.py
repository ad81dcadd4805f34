"""Time, memory and standard errors of the Monte Carlo of a whole capacity table.

    python benchmarks/monte_carlo.py [rows] [seeds]

9 500 rows of 1 mm of a tank of eight courses: scale, temperature, offset of the dips, bottom,
deadwood, a radius for each course, form; 20 inputs, and 130, of which 110 more are of the form. The
goal: 0.2 s on one core, worth 1e6 plain draws. Worth is measured: the root mean square, over the
seeds, of what a run has wrong in u and in both ends of the interval of a row, by the standard error
that 1e6 plain draws would have there; no row above 1. Wrong is a run against one worth 5e7 draws
(`FINE`).

The last line is the shipped example as `tankcal run` simulates it, with rows of 1 mm; there the
standard errors of plain draws are those of a normal: u/sqrt(2 N), u sqrt(p q/N) over the density.
"""

import os
import resource
import sys
import time
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measured import Row, tell
from scipy.stats import norm

import tankcal
from tankcal.gum.distributions import Normal, standard
from tankcal.gum.monte_carlo import Goal, QuadraticRows, simulate
from tankcal.pipeline.simulation import simulate_table
from tankcal.text.shipped import shipped_folder

FINE = Goal(seed=99, plain_draws=50_000_000)
ENOUGH_SEEDS = 20  # of fewer a standard deviation says little
COURSES, RADIUS_M, HEIGHT_M, EXPANSION = 8, 7.1, 9.5, 1.1e-5
INPUTS, MANY = 20, 130
ORDINARY = ()  # every input normal
MIXED = ("t", "rectangular", "rectangular", "u-shaped", "triangular", "normal", "normal", "t")


def tank(rows, kinds=ORDINARY, factor=1.0, count=INPUTS):
    """The model and its inputs, the first of these kinds, the others normal.

    V = pi (r_c (1 + s) (1 + a dT))^2 (h + offset) and the rest, to second order; factor multiplies
    every standard uncertainty.
    """
    height = np.linspace(HEIGHT_M / rows, HEIGHT_M, rows)
    edges = np.linspace(0, HEIGHT_M, COURSES + 1)
    parts = np.clip(height[:, None] - edges[:-1], 0, HEIGHT_M / COURSES)
    area, around = np.pi * RADIUS_M**2, 2 * np.pi * RADIUS_M
    volume, wet = area * height, area * np.minimum(1, height / 0.1)
    slopes = np.column_stack([2 * volume, 2 * EXPANSION * volume, wet, np.ones(rows)])
    form = 0.02 * np.cos(np.arange(count - 5 - COURSES) * height[:, None])
    slopes = np.hstack([slopes, np.minimum(height / 2, 1)[:, None], around * parts, form])
    pairs = [(0, 0, 1.0, volume), (1, 1, EXPANSION**2, volume), (0, 2, 2.0, wet)]
    pairs += [(0, 1, 4 * EXPANSION, volume)]
    for course, part in enumerate(parts.T):
        pairs += [(5 + course, 5 + course, np.pi, part), (0, 5 + course, 2 * around, part)]
        pairs += [(1, 5 + course, 2 * EXPANSION * around, part)]
    hessians = np.zeros((len(pairs), count, count))
    for hessian, (i, j, value, _) in zip(hessians, pairs, strict=True):
        hessian[i, j] += value / 2
        hessian[j, i] += value / 2
    weights = np.column_stack([pair[3] for pair in pairs])
    sizes = np.ones(count)
    sizes[: 5 + COURSES] = [2e-4, 1.0, 1e-3, 0.05, 0.01] + [1e-3] * COURSES
    dof, kinds = {0: 5.0, 7: 3.0}, kinds + ("normal",) * (count - len(kinds))
    inputs = [
        Normal(u) if kind == "normal" else standard(u, kind, dof=dof.get(i, np.inf))
        for i, (u, kind) in enumerate(zip(factor * sizes, kinds, strict=True))
    ]
    return QuadraticRows(volume, slopes, hessians, weights, np.zeros(count)), inputs


def scatter(model, inputs, seeds):
    """(3, seeds, rows) errors of u, low and high, then (seeds, 2) seconds, processor and clock."""
    fine = simulate(model, inputs, goal=FINE)
    found, spent = [], []
    for seed in range(seeds):
        start = time.process_time(), time.perf_counter()
        one = simulate(model, inputs, goal=Goal(seed=seed))
        spent.append((time.process_time() - start[0], time.perf_counter() - start[1]))
        found.append((one.u, one.low, one.high))
    errors = np.array(found) - np.array([fine.u, fine.low, fine.high])
    return errors.transpose(1, 0, 2), np.array(spent)


def plain_errors(model, inputs, rows, draws=1_000_000, sample=200_000, seed=1):
    """(3, rows) standard errors of u, low and high that so many plain draws of some rows have.

    sqrt((m4/m2^2 - 1)/(4 N)) u, and sqrt(p q/N) dV_p/dp, both from a smaller sample of such draws.
    """
    part, generator = model.subset(rows), np.random.default_rng(seed)
    p = generator.random((sample, len(inputs)))
    values = part(np.column_stack([one.quantile(p[:, j]) for j, one in enumerate(inputs)]))
    squares = (values - values.mean(axis=0)) ** 2
    of_u = squares.std(axis=0) / (2 * np.sqrt(draws * squares.mean(axis=0)))
    around = np.quantile(values, [0.02, 0.03, 0.97, 0.98], axis=0)
    ends = np.sqrt(0.025 * 0.975 / draws) * (around[1::2] - around[::2]) / 0.01
    return np.vstack([of_u, ends])


def worst_ratios(errors, model, inputs, chosen):
    """(3,) largest over all rows of the rms over the seeds to the standard error of plain draws.

    The latter, by u, is computed for the chosen rows and taken linearly between them.
    """
    u = np.sqrt(model.jacobian**2 @ np.array([one.sd**2 for one in inputs]))
    plain = plain_errors(model, inputs, chosen) / u[chosen]
    every = np.arange(len(u))
    limit = np.stack([np.interp(every, chosen, one) for one in plain]) * u
    return (root_mean_square(errors) / limit).max(axis=1)


def root_mean_square(errors):
    """Over the seeds, the axis before the last."""
    return np.sqrt(np.mean(errors**2, axis=-2))


def shipped_example(seeds):
    """(3,) worst ratios of the shipped example's rows, (seeds, 2) seconds, and its rows."""
    job = tankcal.load(shipped_folder("examples") / "silva-1995")
    job = replace(job, table=replace(job.table, step_m=0.001))
    result = tankcal.run(job, simulated=False)
    parts = (job, result.wall, result.body, result.zero_m, result.table)
    fine, found, spent = simulate_table(*parts, goal=FINE).found, [], []
    for seed in range(seeds):
        start = time.process_time(), time.perf_counter()
        one = simulate_table(*parts, goal=Goal(seed=seed)).found
        spent.append((time.process_time() - start[0], time.perf_counter() - start[1]))
        found.append((one.u, one.low, one.high))
    of_end = np.sqrt(0.025 * 0.975) / norm.pdf(norm.ppf(0.025))
    plain = np.array([1 / np.sqrt(2), of_end, of_end])[:, None] / np.sqrt(1_000_000)
    inner = result.table.height_m > 0.02  # next to the empty tank no volume is normal
    errors = (np.array(found) - np.array([fine.u, fine.low, fine.high])).transpose(1, 0, 2)
    ratios = root_mean_square(errors) / result.table.u_m3 / plain
    return ratios[:, inner].max(axis=1), np.array(spent), len(inner)


def main():
    """A row for each mixture of inputs."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 9500
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    chosen = np.linspace(0, rows - 1, 20).astype(int)
    cases = (("normal", ORDINARY, 1.0, INPUTS), ("mixed, t 3 and 5 dof", MIXED, 1.0, INPUTS),
             ("normal, u x 20", ORDINARY, 20.0, INPUTS), ("normal", ORDINARY, 1.0, MANY),
             ("mixed, t 3 and 5 dof", MIXED, 1.0, MANY))  # fmt: skip
    runs = [scatter(*tank(rows, *case), seeds) for _, *case in cases]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    for (name, *case), (found, spent) in zip(cases, runs, strict=True):
        size = f"{rows} rows, {case[-1]} inputs, {seeds} seeds"
        show(name, size, worst_ratios(found, *tank(rows, *case), chosen), spent, peak)
    ratios, spent, count = shipped_example(seeds)
    show("example", f"{count} rows, {seeds} seeds", ratios, spent)


def show(name, size, ratios, spent, peak=None):
    """A row; from 20 seeds on its note has the worst ratios to errors of 1e6 plain draws."""
    of = ", ".join(f"{what} {r:.3f}" for what, r in zip(("u", "low", "high"), ratios, strict=True))
    note = f"rms error of a run to the standard error of 1e6 plain draws, the worst row: {of}"
    note = note if len(spent) >= ENOUGH_SEEDS else ""
    tell(Row(f"Monte Carlo, {name}", size, tuple(spent[:, 0]), memory_mb=peak, note=note))


if __name__ == "__main__":
    main()
