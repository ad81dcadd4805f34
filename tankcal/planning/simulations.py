"""A plan made many times: readings drawn, adjusted, turned into a table; does the scatter agree?

Every run draws the readings of the whole survey from their standard deviations, adjusts it with
its search for blunders, fits the wall and integrates it. What the plan declares beside the survey
(plates, temperature, the zero) is not drawn: the volumes scatter by the survey alone.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError, TankcalError
from tankcal.messages import message
from tankcal.pipeline.point_covariance import s_transform
from tankcal.pipeline.table import compute_table
from tankcal.pipeline.wall import find_wall
from tankcal.planning.measurements import draw_measurements
from tankcal.planning.prediction import Prediction
from tankcal.survey import adjust_survey, wall_points

OF_SURVEY = ("points", "instrument_scale", "instrument_offset")
SIMULATING = message("plan_simulating", "simulating surveys")
BLUNDER_SDS = 20.0  # size of a blunder, in standard deviations of its reading


@dataclass(frozen=True)
class Simulated:
    """What many simulated surveys of a plan gave.

    runs         those that had a solution      failed  messages of the others
    scatter_m    (points, 3) sd of the coordinates, of the points that were adjusted in every run
    predicted_m  (points, 3) as predicted       names   of these points
    volumes_m3   (runs,) of the full tank       predicted_volume_m3  its predicted sd by the survey
    set_aside    (runs,) values that the search for blunders took out
    seed         of the draws                   blunders     share of readings that were off
    """

    seed: int
    blunders: float
    runs: int
    failed: tuple
    names: tuple
    scatter_m: np.ndarray
    predicted_m: np.ndarray
    volumes_m3: np.ndarray
    predicted_volume_m3: float
    set_aside: np.ndarray

    @property
    def ratio(self):
        """Rms scatter over rms predicted sd, of all coordinates."""
        return float(np.sqrt(np.mean(self.scatter_m**2) / np.mean(self.predicted_m**2)))

    @property
    def volume_ratio(self):
        """Scatter of the full tank's volume over what is predicted."""
        return float(self.volumes_m3.std(ddof=1) / self.predicted_volume_m3)

    @property
    def volume_ratio_sd(self):
        """How well so many surveys tell that: the sd 1/sqrt(2 (n - 1)) of a ratio of sds."""
        return float(1 / np.sqrt(2 * (self.runs - 1)))


def simulate(prediction: Prediction, runs=500, seed=1, blunders=0.0, progress=None):
    """Simulate the surveys of a prediction.

    Parameters
    ----------
    prediction : Prediction
    runs, seed : int, optional
        Number of surveys, and seed of their errors.
    blunders : float, optional
        Share of readings that are off by BLUNDER_SDS of their standard deviations.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    Simulated

    Raises
    ------
    SolutionError
        When fewer than two of the surveys have a solution.
    """
    rng, failed = np.random.default_rng(seed), []
    found, volumes, aside = [], [], []
    for run in range(1, runs + 1):
        if progress:
            progress(SIMULATING, run, runs)
        drawn = draw_measurements(
            prediction.plan, prediction.measurements, prediction.predicted, rng
        )
        try:
            adjustment, volume = _made(prediction.plan, _spoilt(drawn, blunders, rng))
        except TankcalError as error:
            failed.append(error.texts[0])
            continue
        found.append(dict(zip(adjustment.names, adjustment.xyz_m, strict=True)))
        volumes.append(volume)
        aside.append(len(adjustment.removed))
    refuse_failed(failed, runs)
    names = tuple(name for name in found[0] if all(name in one for one in found))
    xyz = np.array([[one[name] for name in names] for one in found])
    sds = {one.name: one.sd_m for one in prediction.points}
    return Simulated(
        seed=seed,
        blunders=blunders,
        runs=len(found),
        failed=tuple(failed),
        names=names,
        scatter_m=xyz.std(axis=0, ddof=1),
        predicted_m=np.array([sds[name] for name in names]),
        volumes_m3=np.array(volumes),
        predicted_volume_m3=_by_survey(prediction.table),
        set_aside=np.array(aside),
    )


def refuse_failed(failed, runs):
    """Raise SolutionError where fewer than two of the surveys have a solution.

    failed  messages of those that have none
    """
    if runs - len(failed) < 2:
        raise SolutionError(
            message(
                "plan_simulations_failed",
                "{failed} of {runs} simulated surveys have no solution: {first}",
                failed=len(failed),
                runs=runs,
                first=failed[0],
            )
        )


def _made(plan, measurements):
    """The Adjustment of drawn measurements, and the volume of the full tank."""
    quiet = replace(measurements.settings, explain=False)
    measurements = replace(measurements, settings=quiet)
    adjustment = adjust_survey(measurements)
    points = wall_points(adjustment, measurements, plan.job.survey.side)
    job = replace(plan.job, points=s_transform(points), measurements=None)
    wall = find_wall(job, lambda text: None, adjustment.dof, plan.amplitudes)
    body = compute_table(job, wall).body
    return adjustment, float(body.volume_m3(np.array([body.highest_m]))[0])


def _spoilt(measurements, share, rng):
    """Measurements with a share of readings off by BLUNDER_SDS, image points along x or y."""
    if not share:
        return measurements
    images = measurements.image_points
    if images is not None:
        along = np.eye(2)[rng.integers(2, size=len(images.point))]
        off = blunders_in_sds(rng, share, len(along))[:, None] * along * images.sd_mm
        images = replace(images, xy_mm=images.xy_mm + off)
    readings = tuple(
        replace(one, value=one.value + blunders_in_sds(rng, share, len(one.end)) * one.sd)
        for one in measurements.readings
    )
    return replace(measurements, image_points=images, readings=readings)


def blunders_in_sds(rng, share, count):
    """(count,) errors in standard deviations: 0, or for a share of them a blunder."""
    sign = np.where(rng.random(count) < 0.5, -1.0, 1.0)
    return BLUNDER_SDS * sign * (rng.random(count) < share)


def _by_survey(table):
    """Standard uncertainty of the top row by what the survey leaves uncertain."""
    parts = [one.columns_m3[-1] for one in table.sources if one.kind in OF_SURVEY]
    return float(np.linalg.norm(np.concatenate(parts)))
