"""Simulate the surveys of a plan and compare the scatter of the results with the prediction.

Every run draws the readings of the whole survey from their standard deviations. It adjusts them,
rejects outliers, fits the wall and integrates it. Other inputs (plates, temperature, the zero) are
not drawn: the volumes scatter by the survey only.

Surveys of a bare wall
----------------------

Every run draws a wall from the assumed components of walls, with sizes as uncertain as the readings
leave them. It then draws the planned readings: each has its own error, and readings of an
instrument share its scale, offset, collimation or tension. The job estimates the sizes and rejects
outliers like any other job. Other inputs (plates, temperature, the zero) are neither drawn nor
included in the compared u.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError, TankcalError
from tankcal.geometry.field.components import COMPONENTS, ROUND_SHAPES
from tankcal.messages import message
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.table import compute_table
from tankcal.pipeline.wall.finding import find_wall
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.planning.measurements import draw_blunders, draw_measurements
from tankcal.planning.prediction import Prediction
from tankcal.planning.wall.nominal_readings import (
    DrawnWall,
    Errors,
    add_network_errors,
    levels_of_readings,
    set_readings,
)
from tankcal.planning.wall.prediction import WallPrediction
from tankcal.survey import adjust_survey, wall_points
from tankcal.uncertainty import combine

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


@dataclass(frozen=True)
class SimulatedWall:
    """Results of many simulated surveys of a planned bare wall.

    Attributes
    ----------
    runs : int
        Number of surveys with a solution.
    failed : sequence
        Messages of the surveys without a solution.
    errors_m3 : ndarray, shape (runs,)
        Volume of the full tank minus its true volume.
    U_m3 : ndarray, shape (runs,)
        U by the survey as each job states it.
    predicted_u_m3, predicted_U_m3 : float
        Predicted u and U by the survey.
    within : ndarray, shape (runs,)
        Share of the rows of the table within U of the true volume.
    set_aside : ndarray, shape (runs,)
        Numbers of rejected readings.
    seed : int
        Seed of the draws.
    blunders : float
        Share of readings with a blunder.
    """

    seed: int
    blunders: float
    runs: int
    failed: tuple
    errors_m3: np.ndarray
    U_m3: np.ndarray
    predicted_u_m3: float
    predicted_U_m3: float
    within: np.ndarray
    set_aside: np.ndarray

    @property
    def volume_ratio(self):
        """Rms error of the volume of the full tank over its predicted u."""
        return float(np.sqrt(np.mean(self.errors_m3**2)) / self.predicted_u_m3)

    @property
    def volume_ratio_sd(self):
        """Standard deviation of volume_ratio, from the scatter of the squared errors.

        The squared errors have longer tails than those of normal errors if the sizes of the wall
        are uncertain.
        """
        squares = self.errors_m3**2
        return float(
            self.volume_ratio * np.std(squares) / np.mean(squares) / 2 / np.sqrt(self.runs)
        )

    @property
    def U_ratios(self):
        """Lowest decile, median and highest decile of the U of the surveys over the predicted U."""
        return tuple(np.quantile(self.U_m3 / self.predicted_U_m3, [0.1, 0.5, 0.9]).tolist())

    @property
    def covered(self):
        """Share of the surveys whose U covers the true volume of the full tank."""
        return float(np.mean(np.abs(self.errors_m3) <= self.U_m3))


def simulate_walls(prediction: WallPrediction, runs=500, seed=1, blunders=0.0, progress=None):
    """Simulate the surveys of a prediction of a bare wall.

    Parameters
    ----------
    prediction : WallPrediction
    runs, seed : int, optional
        Number of surveys, and seed of their walls and errors.
    blunders : float, optional
        Share of readings with an error of `measurements.BLUNDER_SDS` standard deviations.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    SimulatedWall

    Raises
    ------
    SolutionError
        If fewer than two surveys have a solution.
    """
    rng, failed, results = np.random.default_rng(seed), [], []
    for run in range(1, runs + 1):
        if progress:
            progress(SIMULATING, run, runs)
        wall, job = _draw_survey(prediction, rng, blunders)
        try:
            results.append(compare_survey(prediction, wall, job))
        except TankcalError as error:
            failed.append(error.texts[0])
    refuse_failed(failed, runs)
    errors, expanded, within, aside = (np.array(values) for values in zip(*results, strict=True))
    table = prediction.table
    known = combine_survey(prediction.plan.job, table)
    return SimulatedWall(
        seed=seed,
        blunders=blunders,
        runs=len(results),
        failed=tuple(failed),
        errors_m3=errors,
        U_m3=expanded,
        predicted_u_m3=float(known.u[-1]),
        predicted_U_m3=float(known.expanded(table.probability)[-1]),
        within=within,
        set_aside=aside,
    )


def _draw_survey(prediction, rng, blunders):
    """Return a `DrawnWall`, and the Job of a survey of it."""
    job, errors = prediction.plan.job, Errors(rng, blunders)
    sizes = _draw_sizes(job, prediction.result.wall.field.amplitudes, rng)
    wall = DrawnWall(job, sizes, levels_of_readings(job), rng)
    if job.has_network:
        job = replace(job, measurements=add_network_errors(job.measurements, errors))
    return wall, set_readings(job, wall, errors)


def _draw_sizes(job, known, rng):
    """Variances (components,) drawn with the uncertainty of the `Amplitudes`.

    A shape declared in the job determines the size of the ovality.
    """
    # Sizes are positive and known to a factor: their logarithms are normal.
    sizes = np.exp(rng.multivariate_normal(np.log(known.likely_m2), known.log_covariance))
    shape_m = None if job.strapping is None else job.strapping.shape_sd_m
    if shape_m is not None:
        shapes = np.array([component.shape for component in COMPONENTS])
        drawn = np.sum(sizes[np.isin(shapes, ROUND_SHAPES)])
        sizes[shapes != "mean"] *= shape_m**2 / drawn
    return sizes


def compare_survey(prediction, wall, job):
    """Compare the table of a simulated survey with the true volumes of its wall.

    Parameters
    ----------
    prediction : WallPrediction
    wall : DrawnWall
        Simulated wall, or another wall with a known volume.
    job : Job
        Job with the readings of the wall.

    Returns
    -------
    error_m3, U_m3 : float
        Error and U by the survey of the full tank, m3.
    within : float
        Share of the rows within U of the true volume.
    rejected : int
        Number of rejected readings.
    """
    surveyed = find_survey(job, lambda text: None)
    table = compute_table(surveyed.job, surveyed.survey).table
    dips = prediction.table.height_m
    true = prediction.table.volume_m3 + wall.more_m3(dips)
    errors = np.interp(dips, table.height_m, table.volume_m3) - true
    expanded = combine_survey(job, table).expanded(table.probability)
    expanded = np.interp(dips, table.height_m, expanded)
    within = np.mean(np.abs(errors) <= expanded)
    return errors[-1], expanded[-1], within, _count_rejected(surveyed)


def combine_survey(job, table):
    """Return Combined rows of a table, with the uncertainty of the survey only."""
    declared = {quantity.name for quantity in job.inputs}
    sources = [source for source in table.sources if source.kind not in declared]
    return combine(sources, len(table.height_m))


def _count_rejected(surveyed):
    """Number of rejected readings of a `Surveyed`."""
    survey = surveyed.survey
    read = survey if isinstance(survey, ReadWall) else survey.read
    count = 0 if surveyed.adjustment is None else len(surveyed.adjustment.removed)
    if read is not None:
        count += int(np.sum(~read.tested.accepted))
    if not isinstance(survey, ReadWall):
        count += len(surveyed.job.points.names) - len(survey.accepted)
    return count
