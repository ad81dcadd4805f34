"""Adjust a survey: one call from observations to adjusted points with their covariance."""

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
    """Least squares of all observations of a Survey.

    Returns an Adjusted. Raises SolutionError when something is not determined: a datum defect in
    words, points and parameters by name; or when the iteration does not converge.

    Parameters
    ----------
    datum : optional
        "control": whatever is known of points and photos must fix it; "inner": what is not
        fixed is chosen so that the points keep their places on the whole (free network).
    over : ndarray, shape (k,), optional
        Points that take part in the inner constraints, None: all.
    photo : optional
        Number of the photo that takes part in their place; None: points do.
    tolerance : optional
        Of the last step, see tankcal.solver.solve.
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
    """What `adjust` would give, before anything is measured: an Adjusted at the start values.

    The derivatives are taken at the start values of the Survey and no step is made, so the values
    of its observations do not matter; arguments and errors are those of `adjust`. Residuals and
    sigma0 mean nothing, covariances, redundancy numbers and minimal detectable biases do.
    """
    problem = _in_datum(survey, datum, over, photo)
    return _adjusted(survey, problem, datum, lambda: linearise(problem.model, problem.state))


def _in_datum(survey, datum, over, photo):
    """The Problem of a survey, with inner constraints where they are asked for and needed."""
    problem = assemble(survey)
    if datum == "inner":
        free = null_space(problem)
        return add_inner_constraints(problem, over, free, photo) if free.shape[1] else problem
    if any(isinstance(one, PlumbLines) for one in survey.observations):
        _refuse_defect(problem)  # a plumb line that is not quite plumb would hide one
    return problem


def _adjusted(survey, problem, datum, solved):
    """The Adjusted of a problem that `solved` solves; what cannot be solved is told in words."""
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
    chi2, dof = _scatter_of_repeats(problem)
    if dof:
        solution = replace(solution, chi2=solution.chi2 + chi2, rows=solution.rows + dof)
    return Adjusted(survey, problem, solution)


def _scatter_of_repeats(problem):
    """Chi-square of repeated readings about their means, and its degrees of freedom."""
    found = np.zeros(2)
    for one in problem.observations:
        if one.trace is not None:
            found += [one.in_use @ part for part in one.trace.repeated]
    return float(found[0]), round(found[1])


def _refuse_defect(problem):
    """Raise when the datum is missing, in words."""
    free = null_space(problem)
    if free.shape[1]:
        raise SolutionError(datum_defect_sentence(free, problem))
