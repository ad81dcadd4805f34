"""Adjustment of a network survey: from observations to adjusted points with their covariance."""

from dataclasses import replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.solver import UndeterminedError, linearise, solve
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.datum import add_inner_constraints, datum_defect_sentence, null_space
from tankcal.survey.network.results import Adjusted
from tankcal.survey.network.soundness import refuse_worthless_cameras, weak_datum_sentence
from tankcal.survey.observations import PlumbLines


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
    problem = _in_datum(survey, datum, over, photo)
    return _adjusted(
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
    problem = _in_datum(survey, datum, over, photo)
    return _adjusted(survey, problem, datum, lambda: linearise(problem.model, problem.state))


def _in_datum(survey, datum, over, photo):
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


def _adjusted(survey, problem, datum, solved):
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
