"""Tangents to a wall as its points, from the stations of an adjusted traverse.

A tangent touches the convex hull. The mean excess of the hull over the wall follows from the
amplitudes of the wall (`geometry.girth`) and is subtracted; its uncertainty is an input of U.
The amplitudes follow from the tangents in turn, so both are iterated until they agree.
"""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.field.sites import free_design
from tankcal.geometry.girth import support_of, tangent_excess
from tankcal.geometry.outlines import FULL_TURN
from tankcal.geometry.shell import course_of
from tankcal.messages import message
from tankcal.pipeline.hit_wall import take_points
from tankcal.pipeline.misread_tangents import (
    refuse_limbs,
    refuse_misread,
    refuse_misread_zeniths,
)
from tankcal.pipeline.point_covariance import s_transform
from tankcal.pipeline.wall import find_wall
from tankcal.pipeline.wall_straps import rings_of
from tankcal.survey.poses import poses_in_network
from tankcal.survey.sighting import WALL
from tankcal.survey.tangents import Hull, halfway, round_hull, touch

ROUNDS = 6  # of wall and excess; two of them suffice unless the hull is the main part of the form
SETTLED_M, SETTLED_PART = 2e-5, 0.25  # change of the mean excess, and that over its uncertainty
ROUGHER, LEAST_ROUGH_M = 3.0, 0.010  # than the limbs show: no wall is; below that none is in doubt


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
    hull = round_hull(len(job.tangents))
    for number in range(ROUNDS + 1):
        touching = touch(job.tangents, poses, **known, hull=hull)
        placed = _with_points(job, touching)
        wall = find_wall(placed, progress, dof, amplitudes)
        before, hull = hull, _hull_of(job, touching, wall)
        if number and _is_settled(before, hull):
            return placed, touching, wall
        if number:  # a tangent that is rejected in every second pass makes them swing
            hull = halfway(before, hull)
        progress = _be_silent  # the same steps again
    if abs(_mean_change(before, hull)) > before.common_sd_m.mean():
        raise SolutionError(_not_settled(before, hull))
    return placed, touching, wall  # it swings within the uncertainty of the excess


def _is_settled(before, after):
    """Whether a pass changed the excess by little: on average, and at each tangent."""
    change_m = np.abs(after.excess_m - before.excess_m)
    of_mean = max(SETTLED_M, SETTLED_PART * before.common_sd_m.mean())
    of_each = np.maximum(SETTLED_M, np.hypot(before.common_sd_m, before.own_sd_m))
    return abs(_mean_change(before, after)) <= of_mean and bool(np.all(change_m <= of_each))


def _mean_change(before, after):
    return float(np.mean(after.excess_m - before.excess_m))


def _hull_of(job, touching, wall):
    """`Hull` of a wall at the tangents that it was found from.

    Each tangent has the excess of the estimated outline at its own azimuth; the mean of what the
    tangents do not show of the form is added.
    """
    field, joints = wall.field, wall.joints_m
    above = touching.points.xyz_m[:, 2] - job.datum.bottom_z_m
    up = np.clip(above / joints[-1], 0.0, 1.0)
    most_m = max(ROUGHER * _departure_of_limbs(field), LEAST_ROUGH_M)
    beyond = tangent_excess(field.amplitudes, field.nominal_m, up, rings_of(field), most_m)
    excess_m, slope_m = np.zeros(len(above)), np.zeros(len(above))
    place, levels = job.tangents.levels
    for number in range(len(levels)):
        mine = place == number
        height = np.median(above[mine])
        course = int(course_of(height, joints))
        low, high = joints[course : course + 2]
        outline = field.outlines_at([2 * (height - low) / (high - low) - 1])[course, 0]
        outline = _without_shift(outline)
        support = support_of(outline)
        step = FULL_TURN / len(outline)
        at = np.rint(touching.normal_rad[mine] / step).astype(int) % len(outline)
        excess_m[mine] = (support - outline)[at]
        slope_m[mine] = (np.roll(support, -1) - np.roll(support, 1))[at] / (2 * step)
    return Hull(excess_m + beyond[:, 0], beyond[:, 1], beyond[:, 2], slope_m)


def _without_shift(radii_m):
    """Radii at even azimuths less their first harmonic: about their own centre."""
    waves = np.fft.rfft(radii_m)
    waves[1] = 0.0
    return np.fft.irfft(waves, len(radii_m))


def _departure_of_limbs(field):
    """Standard deviation of the radii about the circles of their levels, m."""
    design = free_design(field.sites)[0]
    left = field.radius_m - design @ np.linalg.lstsq(design, field.radius_m, rcond=None)[0]
    return float(np.sqrt(np.sum(left**2) / max(len(left) - np.linalg.matrix_rank(design), 1)))


def _not_settled(before, after):
    return message(
        "excess_not_settled",
        "no capacity: the convex hull that the tangents touch stands {before_mm:.1f} mm outside the"
        " wall in one pass and {after_mm:.1f} mm in the next, so the tangents do not determine the"
        " form of this wall; sight more limbs (stations at other distances), strap a course"
        " (circumferences.csv), or measure points of the wall",
        before_mm=1000 * float(before.excess_m.max()),
        after_mm=1000 * float(after.excess_m.max()),
    )


def _be_silent(text):
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
