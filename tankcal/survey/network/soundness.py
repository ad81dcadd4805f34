"""Unknowns that are determined only formally: standard deviations beyond the linear model."""

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.survey.network.datum import datum_defect_sentence, null_space

WORTHLESS = 0.1  # sd over the principal distance, or over the extent of the survey
HANGING = 0.03  # see datum.UNFELT: a survey held so weakly may be held by noise alone


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
