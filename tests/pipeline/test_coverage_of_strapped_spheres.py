"""Do 95 % intervals hold the truth on strapped spheres that are no ellipsoids?

Petals, columns and dents of `generated_solids`, oblate by their weight, strapped with a taut tape
(`strapped_balls`); the truth is that of dense directions.
"""

import numpy as np
import pytest
from conftest import EXAMPLE
from draws import draws
from generated_solids import SPHERES, make_sphere
from page_figures import figures_of, ratios_agree, shares_agree
from strapped_balls import strapped_job

from tankcal.methods.great_circles.sphere import find_strapped_sphere
from tankcal.pipeline.tanks import body_of
from tankcal.tank.capacity import Capacity

FOLDER = EXAMPLE.parent / "sphere-straps"
LEAST_HELD, ROWS = 0.94, 10


def flattened(rng, family):
    """A ball of a family that its weight flattened by up to 0.15 % of its radius."""
    ball = make_sphere(rng, family)
    flat = rng.uniform(0, 1e-3) * ball.radius_m
    ball.departures.append(lambda d: -flat * (1.5 * d[..., 2] ** 2 - 0.5))
    return ball


def found_of(rng, family):
    """Errors and U of ten rows over the total."""
    ball = flattened(rng, family)
    job = strapped_job(rng, ball, FOLDER, meridians=int(rng.integers(3, 7)))
    body = body_of(job, find_strapped_sphere(job, lambda text: None))
    dips = np.append(ball.height_m * np.arange(1, ROWS) / ROWS, body.highest_m)
    truth = ball.volume_below(dips)
    volumes, areas, sources = body.rows(dips)
    table = Capacity(dips, volumes, areas, sources, 0.95)
    return (volumes - truth) / truth[-1], table.U_m3 / truth[-1]


def study(balls, figure, seed):
    """Held totals, rows and totals with columns; mean U over 1.96 rms errors of the totals."""
    rng, every = np.random.default_rng(seed), []
    for family in SPHERES:
        found = [found_of(rng, family) for _ in range(balls)]
        error, expanded = (np.array(one) for one in zip(*found, strict=True))
        held = np.abs(error) <= expanded
        every.append((error, expanded))
        figure(
            f"strapped {family}: held total, rows", f"{held[:, -1].mean():.3f} {held.mean():.3f}"
        )
    error, expanded = (np.concatenate(one) for one in zip(*every, strict=True))
    held = np.abs(error) <= expanded
    wide = expanded.mean(axis=0) / 1.96 / np.sqrt(np.mean(error**2, axis=0))
    figure(f"{len(held)} strapped spheres: held total, rows",
           f"{held[:, -1].mean():.3f} {held.mean():.3f}")  # fmt: skip
    figure("strapped spheres: mean error of the total, ppm", f"{1e6 * error[:, -1].mean():.0f}")
    figure("strapped spheres: U over 1.96 rms errors, rows", " ".join(f"{o:.2f}" for o in wide))
    with_columns = held[:, -1].reshape(len(SPHERES), balls)[SPHERES.index("columns")]
    return held[:, -1].mean(), held.mean(), with_columns.mean(), wide[-1]


@pytest.mark.slow
@pytest.mark.twentieth
def test_intervals_hold_on_strapped_spheres(figure):
    balls = 8
    *held, _, _ = study(balls, figure, 5)
    assert min(held) > LEAST_HELD - 3 * np.sqrt(0.95 * 0.05 / (balls * len(SPHERES)))


@pytest.mark.study
def test_intervals_hold_on_strapped_spheres_study(figure):
    balls = draws(10, 150)
    count = balls * len(SPHERES)
    *held, pressed, ratio = study(balls, figure, 17)
    *stated, full, stated_ratio = figures_of(
        "docs/studies/spheres.md",
        "held () of the totals and () of the rows of () spheres; U of the total is () times 1.96 "
        "rms errors",
    )
    row = figures_of(
        "docs/uncertainty.md", "| sphere, great circles (totals, rows) | (), () | () |"
    )
    assert row == (*stated, stated_ratio)
    assert shares_agree(held, stated, count, int(full))
    assert ratios_agree(ratio, stated_ratio, count, int(full))
    stated = figures_of("docs/studies/spheres.md", "Of that third alone () of the totals were held")
    assert shares_agree([pressed], stated, balls, int(full) // len(SPHERES))
    assert min(held) > LEAST_HELD - 3 * np.sqrt(0.95 * 0.05 / count)
