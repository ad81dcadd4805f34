"""Nominal meter readings: volumes that a meter shows while a tank of nominal size is filled.

The reduction of the job is inverted: with its own geometry, no step has a misclosure. If the runs
are to estimate the run effect, they differ by its expected size.
"""

from dataclasses import replace

import numpy as np

from tankcal.pipeline.liquid_adjustment import adjust_liquid
from tankcal.pipeline.liquid_alone import geometry_beside
from tankcal.pipeline.liquid_geometry import load_geometry
from tankcal.tank.liquid import fill_of, reduce_steps
from tankcal.tank.liquid.reduction import load_densities


def with_nominal_batches(job, survey, expected_run=None):
    """Return the job with the metered volumes that follow from its own geometry.

    Parameters
    ----------
    job : Job
        Job whose runs have volumes of approximately the right size.
    survey : Wall, StrappedWall, NominalWall or None
        Wall by its readings.
    expected_run : float, optional
        Relative standard deviation of the run effect, if the runs are to estimate it.
    """
    metering, fill = job.liquid, fill_of(job.liquid)
    rows = fill.dip_row
    densities = np.append(metering.density_kg_m3, load_densities(metering, fill))
    dips, shell = metering.dip_m[rows], metering.shell_c[rows]
    loaded = load_geometry(geometry_beside(job, survey), densities, dips, shell)
    reduced = reduce_steps(metering, fill, loaded.volume_m3, loaded.growth)
    shown = (reduced.geometry_m3 - reduced.by_tank_temperature_m3) / reduced.metered_m3
    job = _metered(job, fill, shown)
    if expected_run is None or metering.run_sd is not None:
        return job
    return _metered(job, fill, 1 - _expected_runs(job, survey, expected_run)[fill.run])


def _metered(job, fill, share):
    """Return the job with the batch of each step multiplied by a share.

    Here a step has one batch.
    """
    volume = job.liquid.volume_m3.copy()
    volume[fill.dip_row[fill.end]] *= share
    return replace(job, liquid=replace(job.liquid, volume_m3=volume))


def _expected_runs(job, survey, sd):
    """Run effects (runs,) whose differences have the size expected for a standard deviation sd.

    The observed differences d ~ N(0, theta + s) each have the size of their standard deviation
    (`tank.liquid.run_effect`). The common effect of all runs, which acts like the meter, is 0.
    """
    without = replace(job, liquid=replace(job.liquid, run_sd=0.0))
    result = adjust_liquid(geometry_beside(without, survey))
    by_run = result.readings.run_m3
    eigen, turn = np.linalg.eigh(by_run.T @ result.adjusted.weight @ by_run)
    shows = eigen > 1e-9 * eigen[-1]
    differences = np.where(shows, np.sqrt(sd**2 + 1 / np.where(shows, eigen, 1.0)), 0.0)
    differences[0] = 0.0
    return turn @ differences
