"""Adjustment of a network survey: from observations to adjusted points with their covariance.

Unknowns that are determined only formally, with standard deviations beyond the linear model, are
refused or named.
"""

from dataclasses import replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.solver import UndeterminedError, linearise, solve
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.datum import add_inner_constraints, datum_defect_sentence, null_space
from tankcal.survey.network.results import Adjusted
from tankcal.survey.observations import PlumbLines

WORTHLESS = 0.1  # sd over the principal distance, or over the extent of the survey
HANGING = 0.03  # see datum.UNFELT: a survey held so weakly may be held by noise alone


def adjust(survey, *, datum="control", over=None, photo=None, tolerance=1e-4, max_iterations=100):
    """Least squares adjustment of all observations of a survey.

    Parameters
    ----------
    survey : Survey
    datum : str
        "control": known points and photos must fix the datum; "inner": free network, in which the
        points keep their positions on average.
    over : ndarray of int, shape (k,), optional
        Points in the inner constraints; None: all.
    photo : int, optional
        Photo in the inner constraints in place of points.
    tolerance : float
        Of the last step, see tankcal.solver.solve.
    max_iterations : int

    Returns
    -------
    Adjusted

    Raises
    ------
    SolutionError
        If unknowns or the datum are undetermined (the message names them), or if the iteration does
        not converge.
    """
    problem = _assemble_in_datum(survey, datum, over, photo)
    return _adjust_problem(
        survey,
        problem,
        datum,
        lambda: solve(
            problem.model, problem.state, tolerance=tolerance, max_iterations=max_iterations
        ),
    )


def predict(survey, *, datum="control", over=None, photo=None):
    """Predict the result of `adjust` before the measurement.

    Derivatives are taken at the start values without a step, so observed values do not matter.
    Covariances, redundancy numbers and minimal detectable biases are valid; residuals and sigma0
    have no meaning. Arguments and errors are those of `adjust`.

    Parameters
    ----------
    survey : Survey
    datum, over, photo
        See `adjust`.

    Returns
    -------
    Adjusted
    """
    problem = _assemble_in_datum(survey, datum, over, photo)
    return _adjust_problem(survey, problem, datum, lambda: linearise(problem.model, problem.state))


def _assemble_in_datum(survey, datum, over, photo):
    """The Problem of a survey, with inner constraints where requested and needed."""
    problem = assemble(survey)
    if datum == "inner":
        free = null_space(problem)
        return add_inner_constraints(problem, over, free, photo) if free.shape[1] else problem
    if any(
        isinstance(observations_of_table, PlumbLines)
        for observations_of_table in survey.observations
    ):
        # A plumb line that is not exactly vertical would hide a datum defect from the solver.
        _refuse_defect(problem)
    return problem


def _adjust_problem(survey, problem, datum, solved):
    """The Adjusted of a Problem solved by `solved`; failures are explained in words."""
    try:
        solution = solved()
    except UndeterminedError:
        if datum != "inner":
            _refuse_defect(problem)
        raise
    except SolutionError as error:
        text = message(
            "and_hanging",
            "{error}{datum}",
            error=error.args[0],
            datum="" if datum == "inner" else weak_datum_sentence(problem),
        )
        raise SolutionError(text) from error
    if survey.photos is not None:
        refuse_worthless_cameras(survey, problem, solution)
    # Averaged readings count as if adjusted one by one: add their scatter about the means.
    chi2, dof = _scatter_of_repeats(problem)
    if dof:
        solution = replace(solution, chi2=solution.chi2 + chi2, rows=solution.rows + dof)
    return Adjusted(survey, problem, solution)


def _scatter_of_repeats(problem):
    """Chi-square of repeated readings about their means, and its degrees of freedom."""
    total = np.zeros(2)
    for observations_of_group in problem.observations:
        if observations_of_group.trace is not None:
            total += [
                observations_of_group.in_use @ part for part in observations_of_group.trace.repeated
            ]
    return float(total[0]), round(total[1])


def _refuse_defect(problem):
    """Raise SolutionError, in words, if the datum has a defect."""
    free = null_space(problem)
    if free.shape[1]:
        raise SolutionError(datum_defect_sentence(free, problem))


def refuse_worthless_cameras(survey, problem, solution):
    """Raise SolutionError if the network does not determine a principal distance c."""
    first = {}
    for photo, column in enumerate(problem.layout.interior[problem.interior_of[:, 0]].tolist()):
        first.setdefault(column, photo)
    columns = sorted(column for column in first if column >= 0)
    if not columns:
        return
    photo = [first[column] for column in columns]
    unit = np.zeros((problem.model.reduced, len(columns)))
    unit[columns, np.arange(len(columns))] = 1.0
    # With N = L L', the variance of an unknown is the squared norm of L^-1 e.
    sd = np.sqrt(np.sum(solution.cofactor.factor.whitened(unit) ** 2, axis=0))
    value = solution.unknowns.interior[problem.interior_of[photo, 0]]
    for i in np.flatnonzero(~(sd < WORTHLESS * np.abs(value)))[:1]:
        camera = survey.cameras[survey.photos.camera[photo[i]]].name
        raise SolutionError(
            message(
                "c_not_determined",
                "c of {camera} is not determined: its sd would be {sd:.2g} mm; c and the distances "
                "of the photos can hardly be told apart: fix c or give it a standard deviation, or "
                "add photos from nearer, from further away or at an angle",
                camera=camera,
                sd=sd[i],
            )
        )


def find_hardly_determined(adjusted):
    """Sentences on points with a standard deviation above a tenth of the extent of the survey.

    The extent is four times the median distance of the points from their median position, which a
    diverging point does not enlarge.
    """
    sd, xyz = np.max(adjusted.point_sd_m, axis=1), adjusted.xyz_m
    adjusted_points = xyz[np.isfinite(xyz).all(axis=1)]
    extent = 4 * np.median(
        np.linalg.norm(adjusted_points - np.median(adjusted_points, axis=0), axis=1)
    )
    return tuple(
        message(
            "hardly_determined",
            "point {point} is hardly determined (sd {sd_m:.2g} m)",
            point=adjusted.survey.points[i],
            sd_m=sd[i],
        )
        for i in np.flatnonzero(sd > WORTHLESS * extent)
    )


def weak_datum_sentence(problem):
    """Sentence on a datum that is almost undetermined, or ""."""
    free = null_space(problem, HANGING)
    return f"; {datum_defect_sentence(free, problem)}" if free.shape[1] else ""
