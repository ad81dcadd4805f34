"""Tangents to a wall as its points, from the stations of an adjusted traverse.

A tangent sees the convex hull: by how much that stands outside the wall is taken off on average, as
the amplitudes of the wall tell it, and the rest is in the doubt (`geometry.girth`).
"""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.girth import tangent_excess
from tankcal.messages import message
from tankcal.pipeline.hit_wall import take_points
from tankcal.pipeline.misread_tangents import (
    refuse_limbs,
    refuse_misread,
    refuse_misread_zeniths,
)
from tankcal.pipeline.point_covariance import s_transform
from tankcal.pipeline.wall import find_wall
from tankcal.survey.poses import poses_in_network
from tankcal.survey.sighting import WALL
from tankcal.survey.tangents import touch


def find_tangent_wall(job, adjustment, progress, dof=np.inf, *, amplitudes=None):
    """The job with its tangents as points, their `Touching`, and the `Wall` that they show.

    adjustment  of the network that their set-ups belong to
    dof, amplitudes  as in `find_wall`
    """
    progress(
        message(
            "touching",
            "computing {count} tangents of the wall from {setups} set-ups",
            count=len(job.tangents),
            setups=len(set(job.tangents.setup)),
        )
    )
    poses, tools = poses_in_network(job.tangents, adjustment)
    _refuse_untied(job.tangents, poses)
    return touch_wall(job, poses, tools, progress, dof, amplitudes)


def touch_wall(job, poses, tools, progress, dof=np.inf, amplitudes=None):
    """As `find_tangent_wall`, from known `Poses`.

    tools  as in `tangents.touch`
    """
    radius = job.tank.nominal_diameter_m / 2
    known = {
        "zero_z_m": job.datum.bottom_z_m + job.datum.plate_level_m,
        "nominal_m": radius,
        "tools": tools,
    }
    refuse_misread(job.tangents, poses, radius)
    touching = touch(job.tangents, poses, **known)
    refuse_limbs(job.tangents, touching)
    refuse_misread_zeniths(job.tangents, poses, touching, known["zero_z_m"])
    sizes = amplitudes
    if sizes is None:
        sizes = find_wall(_with_points(job, touching), progress, dof).field.amplitudes
        progress = _tell_nothing  # the same steps once more
    touching = touch(job.tangents, poses, **known, excess=tangent_excess(sizes, radius))
    job = _with_points(job, touching)
    return job, touching, find_wall(job, progress, dof, amplitudes)


def _tell_nothing(text):
    pass


def _with_points(job, touching):
    used = take_points(touching.points, np.flatnonzero(~job.tangents.check))
    return replace(job, points=s_transform(used))


def _refuse_untied(tangents, poses):
    """Raise InputError for set-ups that the network does not place or turn."""
    names = [name for (name, _), tie in zip(poses.keys, poses.ties, strict=True) if tie == WALL]
    if names:
        text = message(
            "untied_tangents",
            "the network does not have the place of its station and the zero of its circle;"
            " expected directions to other stations in directions.csv",
        )
        raise InputError(
            [
                Problem("setups.csv", text, tangents.setups[name].row, "setup")
                for name in dict.fromkeys(names)
            ]
        )
