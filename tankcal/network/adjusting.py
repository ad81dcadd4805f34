"""Adjust a survey: one call from observations to adjusted points with their covariance."""

from tankcal.errors import SolutionError
from tankcal.gauss_markov import UndeterminedError, solve
from tankcal.network.assembly import assemble
from tankcal.network.datum import held, in_words, unobserved
from tankcal.network.results import Adjusted
from tankcal.network.soundness import hanging_datum, refuse_worthless_cameras
from tankcal.observations import PlumbLines


def adjust(survey, *, datum="control", over=None, photo=None, tolerance=1e-4, max_iterations=100):
    """Least squares of all observations of a Survey.

    datum      "control": whatever is known of points and photos must fix it; "inner": what is not
               fixed is chosen so that the points keep their places on the whole (free network)
    over       (k,) points that take part in the inner constraints, None: all
    photo      number of the photo that takes part in their place; None: points do
    tolerance  of the last step, see tankcal.gauss_markov.solve

    Returns an Adjusted. Raises SolutionError when something is not determined: a datum defect in
    words, points and parameters by name; or when the iteration does not converge.
    """
    problem = assemble(survey)
    if datum == "inner":
        free = unobserved(problem)
        if free.shape[1]:
            problem = held(problem, over, free, photo)
    elif any(isinstance(one, PlumbLines) for one in survey.observations):
        _refuse_defect(problem)  # a plumb line that is not quite plumb would hide one
    try:
        solution = solve(
            problem.model, problem.state, tolerance=tolerance, max_iterations=max_iterations
        )
    except UndeterminedError:
        if datum != "inner":
            _refuse_defect(problem)
        raise
    except SolutionError as error:
        raise SolutionError(f"{error}{hanging_datum(problem)}") from error
    if survey.photos is not None:
        refuse_worthless_cameras(survey, problem, solution)
    return Adjusted(survey, problem, solution)


def _refuse_defect(problem):
    """Raise when the datum is missing, in words."""
    free = unobserved(problem)
    if free.shape[1]:
        raise SolutionError(in_words(free, problem))
