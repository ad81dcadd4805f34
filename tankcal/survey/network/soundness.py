"""What is determined on paper only: an sd so large that the linear model does not hold."""

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.survey.network.datum import datum_defect_sentence, null_space

WORTHLESS = 0.1  # sd over the principal distance, or over the extent of the survey
HANGING = 0.03  # see datum.UNFELT: what holds the survey so weakly, noise alone can hold


def refuse_worthless_cameras(survey, problem, solution):
    """Raise SolutionError when the network does not determine a principal distance c."""
    first = {}
    for photo, column in enumerate(problem.layout.interior[problem.interior_of[:, 0]].tolist()):
        first.setdefault(column, photo)
    columns = sorted(column for column in first if column >= 0)
    if not columns:
        return
    photo = [first[column] for column in columns]
    unit = np.zeros((problem.model.reduced, len(columns)))
    unit[columns, np.arange(len(columns))] = 1.0
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
    """Sentences on points whose sd is above a tenth of the survey's extent.

    The extent is four times the median distance of the points from their median place: a point that
    went astray does not stretch it.
    """
    sd, xyz = np.max(adjusted.point_sd_m, axis=1), adjusted.xyz_m
    there = xyz[np.isfinite(xyz).all(axis=1)]
    extent = 4 * np.median(np.linalg.norm(there - np.median(there, axis=0), axis=1))
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
    """Words on a datum that hangs on next to nothing, "" when it does not."""
    free = null_space(problem, HANGING)
    return f"; {datum_defect_sentence(free, problem)}" if free.shape[1] else ""
