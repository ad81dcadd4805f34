"""What a meter would show while a tank of the plan's sizes is filled: steps that close.

The reduction is that of the job, turned round: against its own geometry no step has a misclosure.
Where the runs are to show the run effect, they differ by what is expected of it.
"""

from dataclasses import replace

import numpy as np

from tankcal.pipeline.liquid_adjustment import adjust_liquid
from tankcal.pipeline.liquid_alone import geometry_beside
from tankcal.pipeline.liquid_geometry import load_geometry
from tankcal.tank.liquid import fill_of, reduce_steps
from tankcal.tank.liquid.reduction import load_densities


def with_nominal_batches(job, survey, expected_run=None):
    """The job with the volumes that a meter shows of its own geometry.

    Parameters
    ----------
    job : Job
        Whose runs have volumes of about the right size.
    survey : Wall, StrappedWall, NominalWall or None
        What its readings say of the tank.
    expected_run : float, optional
        Relative standard deviation of the run effect, where the runs are to show it.
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
    """The job with the batch of each step multiplied by a share; a step has one batch here."""
    volume = job.liquid.volume_m3.copy()
    volume[fill.dip_row[fill.end]] *= share
    return replace(job, liquid=replace(job.liquid, volume_m3=volume))


def _expected_runs(job, survey, sd):
    """(runs,) effects whose differences are those that are expected of an sd.

    The differences that the runs show, d ~ N(0, theta + s), are each of their standard deviation
    (`tank.liquid.run_effect`); all runs together, which move as the meter does, by nothing.
    """
    without = replace(job, liquid=replace(job.liquid, run_sd=0.0))
    found = adjust_liquid(geometry_beside(without, survey))
    by_run = found.readings.run_m3
    told, turn = np.linalg.eigh(by_run.T @ found.adjusted.weight @ by_run)
    shows = told > 1e-9 * told[-1]
    differences = np.where(shows, np.sqrt(sd**2 + 1 / np.where(shows, told, 1.0)), 0.0)
    differences[0] = 0.0
    return turn @ differences
