"""Points of a wall from sights: selection, and the side of the wall that they are on."""

from dataclasses import replace

import numpy as np

from tankcal.geometry.shell import course_of
from tankcal.pipeline.wall.finding import joints_of
from tankcal.sections import coordinates_of


def take_points(points, chosen):
    """Return selected points (k,), with their covariance and their causes."""
    if np.array_equal(chosen, np.arange(len(points.names))):  # the covariance may be large
        return points
    index = coordinates_of(chosen)

    def select(values):
        return tuple(values[i] for i in chosen)

    def select_columns(causes):
        return tuple(replace(cause, column_m=cause.column_m[index]) for cause in causes)

    return replace(
        points,
        names=select(points.names),
        xyz_m=points.xyz_m[chosen],
        covariance_m2=points.covariance_m2[np.ix_(index, index)],
        section=select(points.section),
        generatrix=select(points.generatrix),
        rows=select(points.rows),
        causes=select_columns(points.causes),
        unbound=select_columns(points.unbound),
        by_inputs={name: column[index] for name, column in points.by_inputs.items()},
    )


def through_wall(job, points, normal, is_moved):
    """Move points of a vertical wall to its other side.

    Parameters
    ----------
    job : Job
    points : Points
    normal : ndarray, shape (n, 3)
        Normals of the wall, outwards.
    is_moved : ndarray of bool, shape (n,)
        Points that are not on the side of the survey.

    Returns
    -------
    Points
        With the derivatives by plate thickness and paint.
    """
    joints = job.datum.bottom_z_m + joints_of(job)
    course = course_of(points.xyz_m[:, 2], joints)
    outwards = 1.0 if job.survey.side == "outside" else -1.0
    normal = (outwards * is_moved)[:, None] * normal
    switches = {"plate_thickness": job.switches.plate, "paint": job.switches.paint}
    sizes = {
        "plate_thickness": np.array([part.thickness_m for part in job.courses])[course],
        "paint": np.array([part.paint_m for part in job.courses])[course],
    }
    size = sum(switches[name] * thickness for name, thickness in sizes.items())
    xyz = points.xyz_m + size[:, None] * normal
    derivatives = {
        name: normal.ravel()
        for name, thickness in sizes.items()
        if switches[name] and thickness.any()
    }
    return replace(points, xyz_m=xyz, by_inputs=derivatives)
