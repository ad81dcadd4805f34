"""Simulate the surveys of a plan and compare the scatter of the results with the prediction.

Every run draws the readings of the whole survey from their standard deviations. It adjusts them,
rejects outliers, fits the wall and integrates it. Other inputs (plates, temperature, the zero) are
not drawn: the volumes scatter by the survey only.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError, TankcalError
from tankcal.messages import message
from tankcal.pipeline.table import compute_table
from tankcal.pipeline.wall.finding import find_wall
from tankcal.pipeline.wall.point_covariance import s_transform
from tankcal.planning.measurements import draw_blunders, draw_measurements
from tankcal.planning.prediction import Prediction
from tankcal.survey import adjust_survey, wall_points

OF_SURVEY = ("points", "instrument_scale", "instrument_offset")
SIMULATING = message("plan_simulating", "simulating surveys")


@dataclass(frozen=True)
class SimulatedSurveys:
    """Results of many simulated surveys of a plan.

    Attributes
    ----------
    runs : int
        Number of surveys with a solution.
    failed : sequence
        Messages of the surveys without a solution.
    scatter_m : ndarray, shape (points, 3)
        Standard deviations of the coordinates of points adjusted in every run.
    predicted_m : ndarray, shape (points, 3)
        Predicted standard deviations.
    names : tuple of str
        Names of these points.
    volumes_m3 : ndarray, shape (runs,)
        Volumes of the full tank.
    predicted_volume_m3 : float
        Predicted standard deviation of the volume by the survey.
    set_aside : ndarray, shape (runs,)
        Numbers of rejected values.
    seed : int
        Seed of the draws.
    blunders : float
        Share of readings with a blunder.
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
        """Rms scatter of all coordinates over their rms predicted standard deviation."""
        return float(np.sqrt(np.mean(self.scatter_m**2) / np.mean(self.predicted_m**2)))

    @property
    def volume_ratio(self):
        """Scatter of the volume of the full tank over its predicted standard deviation."""
        return float(self.volumes_m3.std(ddof=1) / self.predicted_volume_m3)

    @property
    def volume_ratio_sd(self):
        """Standard deviation 1/sqrt(2 (n - 1)) of volume_ratio for n surveys."""
        return float(1 / np.sqrt(2 * (self.runs - 1)))


def simulate(prediction: Prediction, runs=500, seed=1, blunders=0.0, progress=None):
    """Simulate the surveys of a prediction.

    Parameters
    ----------
    prediction : Prediction
    runs, seed : int, optional
        Number of surveys, and seed of their errors.
    blunders : float, optional
        Share of readings with an error of `measurements.BLUNDER_SDS` standard deviations.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    Simulated

    Raises
    ------
    SolutionError
        If fewer than two surveys have a solution.
    """
    rng, failed = np.random.default_rng(seed), []
    adjusted, volumes, aside = [], [], []
    for run in range(1, runs + 1):
        if progress:
            progress(SIMULATING, run, runs)
        drawn = draw_measurements(prediction.plan, prediction.measurements, prediction.network, rng)
        try:
            adjustment, volume = _adjust_drawn(prediction.plan, _add_blunders(drawn, blunders, rng))
        except TankcalError as error:
            failed.append(error.texts[0])
            continue
        adjusted.append(dict(zip(adjustment.names, adjustment.xyz_m, strict=True)))
        volumes.append(volume)
        aside.append(len(adjustment.removed))
    refuse_failed(failed, runs)
    names = tuple(name for name in adjusted[0] if all(name in result for result in adjusted))
    xyz = np.array([[result[name] for name in names] for result in adjusted])
    sds = {point.name: point.sd_m for point in prediction.points}
    parts = [
        source.columns_m3[-1] for source in prediction.table.sources if source.kind in OF_SURVEY
    ]
    return SimulatedSurveys(
        seed=seed,
        blunders=blunders,
        runs=len(adjusted),
        failed=tuple(failed),
        names=names,
        scatter_m=xyz.std(axis=0, ddof=1),
        predicted_m=np.array([sds[name] for name in names]),
        volumes_m3=np.array(volumes),
        predicted_volume_m3=float(np.linalg.norm(np.concatenate(parts))),
        set_aside=np.array(aside),
    )


def refuse_failed(failed, runs):
    """Raise SolutionError if fewer than two surveys have a solution.

    failed: messages of the surveys without a solution.
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


def _adjust_drawn(plan, measurements):
    """Return the Adjustment of drawn measurements, and the volume of the full tank."""
    quiet = replace(measurements.settings, explain=False)
    measurements = replace(measurements, settings=quiet)
    adjustment = adjust_survey(measurements)
    points = wall_points(adjustment, measurements, plan.job.survey.side)
    job = replace(plan.job, points=s_transform(points), measurements=None)
    wall = find_wall(job, lambda text: None, adjustment.dof, plan.amplitudes)
    body = compute_table(job, wall).body
    return adjustment, float(body.volume_m3(np.array([body.highest_m]))[0])


def _add_blunders(measurements, share, rng):
    """Return measurements with blunders in a share of the readings; in x or y of image points."""
    if not share:
        return measurements
    images = measurements.image_points
    if images is not None:
        along = np.eye(2)[rng.integers(2, size=len(images.point))]
        off = draw_blunders(rng, share, len(along))[:, None] * along * images.sd_mm
        images = replace(images, xy_mm=images.xy_mm + off)
    readings = tuple(
        replace(
            reading,
            value=reading.value + draw_blunders(rng, share, len(reading.end)) * reading.sd,
        )
        for reading in measurements.readings
    )
    return replace(measurements, image_points=images, readings=readings)
