"""A plan of the bare wall made many times: walls drawn, read, computed; do they err as predicted?

Every run draws a wall of the components that are assumed of walls, in sizes as unsure as the
readings leave them, and what the plan's readings of it are: from its outline, each off by its own,
and all of an instrument by its scale, offset, collimation or tension together. The job is computed
as any other: it learns the sizes from its readings and looks for blunders. What the plan declares
beside the survey (plates, temperature, the zero) is not drawn, nor counted in the u that is
compared.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import TankcalError
from tankcal.geometry.field.components import COMPONENTS, ROUND_SHAPES
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.table import compute_table
from tankcal.planning.simulations import SIMULATING, refuse_failed
from tankcal.planning.wall.nominal_readings import levels_read, with_readings
from tankcal.planning.wall.prediction import WallPrediction
from tankcal.planning.wall.reading_errors import Errors, with_network_errors
from tankcal.planning.wall.tank_walls import DrawnWall
from tankcal.uncertainty import combine


@dataclass(frozen=True)
class SimulatedWall:
    """What many simulated surveys of a plan of the bare wall gave.

    runs         those that had a solution      failed  messages of the others
    errors_m3    (runs,) volume of the full tank less the true one
    U_m3         (runs,) its U by the survey, as each job states it
    predicted_u_m3, predicted_U_m3  the same as the plan foretells it
    within       (runs,) share of the rows of the table within U of the true volume
    set_aside    (runs,) readings that the search for blunders took out
    seed         of the draws                   blunders     share of readings that were off
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
        """Rms error of the full tank's volume over its predicted u."""
        return float(np.sqrt(np.mean(self.errors_m3**2)) / self.predicted_u_m3)

    @property
    def volume_ratio_sd(self):
        """How well so many surveys tell that: by the scatter of the squared errors, whose tails are
        longer than those of normal errors where the sizes of the wall are unsure.
        """
        squares = self.errors_m3**2
        return float(
            self.volume_ratio * np.std(squares) / np.mean(squares) / 2 / np.sqrt(self.runs)
        )

    @property
    def U_ratios(self):
        """Lowest tenth, median and highest tenth of the U of surveys over the predicted one."""
        return tuple(np.quantile(self.U_m3 / self.predicted_U_m3, [0.1, 0.5, 0.9]).tolist())

    @property
    def covered(self):
        """Share of the full tanks whose true volume is within the U of their job."""
        return float(np.mean(np.abs(self.errors_m3) <= self.U_m3))


def simulate_walls(prediction: WallPrediction, runs=500, seed=1, blunders=0.0, progress=None):
    """Simulate the surveys of a prediction of a bare wall.

    Parameters
    ----------
    prediction : WallPrediction
    runs, seed : int, optional
        Number of surveys, and seed of their walls and errors.
    blunders : float, optional
        Share of readings that are off by `simulations.BLUNDER_SDS` of their standard deviations.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    SimulatedWall

    Raises
    ------
    SolutionError
        When fewer than two of the surveys have a solution.
    """
    rng, failed, found = np.random.default_rng(seed), [], []
    for run in range(1, runs + 1):
        if progress:
            progress(SIMULATING, run, runs)
        wall, job = _drawn(prediction, rng, blunders)
        try:
            found.append(compare_survey(prediction, wall, job))
        except TankcalError as error:
            failed.append(error.texts[0])
    refuse_failed(failed, runs)
    errors, expanded, within, aside = (np.array(one) for one in zip(*found, strict=True))
    table = prediction.table
    known = by_survey(prediction.plan.job, table)
    return SimulatedWall(
        seed=seed,
        blunders=blunders,
        runs=len(found),
        failed=tuple(failed),
        errors_m3=errors,
        U_m3=expanded,
        predicted_u_m3=float(known.u[-1]),
        predicted_U_m3=float(known.expanded(table.probability)[-1]),
        within=within,
        set_aside=aside,
    )


def _drawn(prediction, rng, blunders):
    """A `DrawnWall`, and the Job of a survey of it."""
    job, errors = prediction.plan.job, Errors(rng, blunders)
    sizes = _drawn_sizes(job, prediction.tabled.wall.field.amplitudes, rng)
    wall = DrawnWall(job, sizes, levels_read(job), rng)
    if job.measurements is not None:
        job = replace(job, measurements=with_network_errors(job.measurements, errors))
    return wall, with_readings(job, wall, errors)


def _drawn_sizes(job, known, rng):
    """(components,) variances as unsure as `Amplitudes` are; round the wall as large as the job
    says of its shape, where it does.
    """
    sizes = np.exp(rng.multivariate_normal(np.log(known.likely_m2), known.log_covariance))
    shape_m = None if job.strapping is None else job.strapping.shape_sd_m
    if shape_m is not None:
        shapes = np.array([one.shape for one in COMPONENTS])
        drawn = np.sum(sizes[np.isin(shapes, ROUND_SHAPES)])
        sizes[shapes != "mean"] *= shape_m**2 / drawn
    return sizes


def compare_survey(prediction, wall, job):
    """Error and U of the full tank, share of rows within theirs, readings that were rejected.

    wall  what was read (`tank_walls.DrawnWall`, or another that says what it holds)
    job   Job with these readings
    """
    found = find_survey(job, lambda text: None)
    table = compute_table(found.job, found.survey).table
    dips = prediction.table.height_m
    true = prediction.table.volume_m3 + wall.more_m3(dips)
    errors = np.interp(dips, table.height_m, table.volume_m3) - true
    expanded = by_survey(job, table).expanded(table.probability)
    expanded = np.interp(dips, table.height_m, expanded)
    within = np.mean(np.abs(errors) <= expanded)
    return errors[-1], expanded[-1], within, _set_aside(found)


def by_survey(job, table):
    """`Combined` rows of a table by what the survey alone leaves uncertain."""
    declared = {one.name for one in job.inputs}
    sources = [one for one in table.sources if one.kind not in declared]
    return combine(sources, len(table.height_m))


def _set_aside(found):
    """How many readings of a `Surveyed` were taken out."""
    survey = found.survey
    read = survey if isinstance(survey, ReadWall) else survey.read
    count = 0 if found.adjustment is None else len(found.adjustment.removed)
    if read is not None:
        count += int(np.sum(~read.tested.accepted))
    if not isinstance(survey, ReadWall):
        count += len(found.job.points.names) - len(survey.accepted)
    return count
