"""Do U of tables by liquid hold in whole jobs? Tanks filled by mass, sizes and pose unknown.

Kind of truth: simulation; true tanks have tilt, zero, radii and bottoms of their own.
"""

from dataclasses import replace

import numpy as np
import pytest
from metered_runs import fill, metered_job
from page_figures import figures_of, value_of

from tankcal.pipeline.liquid import find_nominal_wall, geometry_alone, join_body
from tankcal.pipeline.liquid.adjustment import adjust_liquid
from tankcal.tank.solids import LyingTank, Sphere
from tankcal.uncertainty import combine

JOBS = 150
GIVE_M = np.pi * 6.5 * 9.80665 * 6.5**2 / (206e9 * 0.008) * 998.2  # thin hoops of 8 mm


def lying(rng):
    width, length = 2.4 + 0.01 * rng.normal(), 9.0 + 0.03 * rng.normal()
    tank = LyingTank(width, width, length, tilt=0.008 * rng.normal(), dip_from_a_m=1.5)
    return moved(tank, 0.004 * rng.normal())


def sphere(rng):
    return moved(Sphere(10.0 + 0.02 * rng.normal()), 0.004 * rng.normal())


def moved(tank, zero):
    """Volumes below dips that are off by a constant, loaded and not, and the highest dip."""
    volumes = lambda dips: tank.volume_m3(np.clip(dips + zero, 0, tank.top_m))  # noqa: E731
    return volumes, volumes, tank.top_m - 0.02


def upright(rng):
    radii = 6.5 + 0.0145 * rng.normal() + 0.0073 * rng.normal(size=5)
    bottom = 0.3 * rng.normal()

    def empty(dips):
        wet = np.clip(np.asarray(dips)[:, None] - 1.9 * np.arange(5), 0, 1.9)
        share = np.clip(np.asarray(dips) / 0.3, 0, 1)
        return np.maximum(np.pi * (wet * radii**2).sum(axis=1) + bottom * share, 1e-6 * dips)

    def loaded(dips):
        return empty(dips) + GIVE_M * np.asarray(dips) ** 2

    return loaded, empty, 9.5


KINDS = {
    "horizontal": (lying, np.round(np.arange(0.15, 2.2, 0.2), 2).tolist(), [0.3, 0.8, 1.5, 2.1]),
    "sphere": (sphere, np.round(np.arange(0.5, 9.1, 0.5), 2).tolist(), [1.0, 3.3, 6.0, 8.8]),
    "vertical": (upright, [None, *np.round(np.arange(0.3, 3.2, 0.2), 2)], [0.3, 1.0, 2.2, 3.0]),
}


@pytest.mark.slow
@pytest.mark.parametrize(("case", "tanks"), [(0, 16), (1, 12)])
def test_many_steps_leave_the_scale_without_bias(tmp_path, case, tanks):
    """Simulation: the mean error of deliveries in tanks of many steps, dips 0.5 mm.

    Columns at the dips as read make it -n u, here -1.4 u and -3 u: n steps, u the relative u of the
    scale.
    """
    figures = figures_of(
        "docs/studies/liquid.md",
        "| vertical tanks, () steps, meter () %, and () steps, meter () %: mean error of",
    )
    steps, percent = (value_of(figure) for figure in figures[2 * case : 2 * case + 2])
    steps, meter_ppm = int(steps), 1e4 * percent
    dips = np.linspace(0.3, 9.3, steps + 1).round(5).tolist()
    meter = {"u_factor_ppm": meter_ppm, "repeatability_ppm": 100.0, "fixed_l": 0.5}
    job = metered_job(
        "vertical", tmp_path / "job", dips=dips, runs=1, registers=meter, liquid__run_ppm=0.0
    )
    rng, survey, levels = np.random.default_rng(3), find_nominal_wall(job), np.array([1.0, 9.0])
    off = []
    for _ in range(tanks):
        area = np.pi * (6.5 + 0.02 * rng.normal()) ** 2

        def loaded(dips, area=area):
            return area * np.asarray(dips) + GIVE_M * np.asarray(dips) ** 2

        filled = fill(rng, job, loaded, 9.5)
        found = adjust_liquid(geometry_alone(replace(job, liquid=filled.liquid), survey))
        volume, _, sources = join_body(found.known).rows(levels)
        u = combine([one.weighted([[-1.0, 1.0]]) for one in sources], 1).u[0]
        off.append((volume[1] - volume[0] - area * 8.0) / u)
    assert abs(np.mean(off)) < 3 / np.sqrt(len(off))


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
def test_rows_and_deliveries_hold(tmp_path, kind):
    truth, dips, rows = KINDS[kind]
    place = {"horizontal__dip_from_a_m": 1.5} if kind == "horizontal" else {}
    dips = [None if one is None else float(one) for one in dips]
    job = metered_job(kind, tmp_path / "job", dips=dips, **place)
    rng, levels = np.random.default_rng(31), np.array(rows)
    survey = find_nominal_wall(job) if kind == "vertical" else None
    weights = np.vstack([np.eye(4), [[-1, 0, 0, 1], [0, -1, 1, 0]]])
    held, off = [], []
    for _ in range(JOBS):
        loaded, empty, top = truth(rng)
        filled = fill(rng, job, loaded, top)
        found = adjust_liquid(geometry_alone(replace(job, liquid=filled.liquid), survey))
        volume, _, sources = join_body(found.known).rows(levels)
        stated = combine([one.weighted(weights) for one in sources], 6)
        miss = weights @ (volume - empty(levels))
        held.append(np.abs(miss) <= stated.expanded(0.95))
        off.append(miss / stated.u)
    share = np.mean(held, axis=0)
    print(kind, share.round(3), np.mean(off, axis=0).round(2), np.std(off, axis=0).round(2))
    assert np.all(np.abs(share - 0.95) < 3.5 * np.sqrt(0.95 * 0.05 / JOBS))
