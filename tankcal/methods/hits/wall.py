"""Bare hits of a wall as its points, by the poses of the set-ups that observed them."""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.methods.hits.checks import offset_unknown
from tankcal.methods.hits.misread import (
    refuse_misread_heights,
    refuse_misread_lines,
    refuse_other_units,
)
from tankcal.pipeline.wall.cause_correlations import told_causes
from tankcal.pipeline.wall.finding import find_wall
from tankcal.pipeline.wall.point_covariance import s_transform
from tankcal.pipeline.wall.sighted_points import take_points, through_wall
from tankcal.sections import coordinates_of
from tankcal.survey import wall_points
from tankcal.survey.poses import covariance_with_points, poses_of, settle_poses
from tankcal.survey.sighting import Beside, sight

FEWEST_AROUND = 3  # smallest number of stations that show their side of the wall
ROUNDS = 4  # largest number of iterations for offsets and places of set-ups
SETTLED_M = 1e-5  # largest movement of a hit in the last iteration
# Movement of a hit after the last iteration that refuses the table. Stations known to 0.1 m leave
# less than 0.1 mm, wrong ones 30 to 130 mm.
UNSETTLED_M = 0.01


def find_hit_wall(job, adjustment, progress, dof=np.inf, *, amplitudes=None):
    """Find the wall of a job by its hits.

    Quantities that only the wall determines are corrected, and the wall is computed again: offsets
    of instruments, and places of set-ups. Sections and points then refer to the wall of the table.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Adjustment of the network of the set-ups; None: no network.
    progress : callable
    dof, amplitudes
        As in `find_wall`.

    Returns
    -------
    job : Job
        The job with its hits as points.
    sighting : Sighting
    wall : Wall

    Raises
    ------
    SolutionError
        If the places of set-ups do not settle.
    """
    job, sighting = sight_wall(job, adjustment, progress)
    wall, sizes = find_wall(job, progress, dof, amplitudes), None
    for number in range(ROUNDS + 1):
        estimates = wall.told
        is_last = number == ROUNDS
        if estimates is None or estimates.largest_m < (UNSETTLED_M if is_last else SETTLED_M):
            break
        if is_last:
            raise SolutionError(_not_settled(estimates.largest_m))
        if len(estimates.poses):
            # Poses absorb a part of the form, which later rounds no longer see: keep its size.
            sizes = wall.field.amplitudes
        poses = settle_poses(sighting.poses, estimates.poses)
        sighted = sight(job.hits, poses, estimates.offsets_m)
        offsets = {name: sighting.told_m.get(name, 0.0) + correction
                   for name, correction in estimates.offsets_m.items()}  # fmt: skip
        job, sighting = _as_points(job, replace(sighted, beside=sighting.beside, told_m=offsets))
        wall = find_wall(job, progress, dof, amplitudes, sizes=sizes)
    return job, replace(sighting, told=told_causes(job, wall)), wall


def _not_settled(moved_m):
    """Message that the places of set-ups do not settle."""
    return message(
        "setups_not_settled",
        "no capacity: the places of the set-ups do not settle, the last pass still moved hits by"
        " {moved_mm:.0f} mm, so the hits do not determine where the set-ups stood; give x_m and"
        " y_m of their stations to 0.3 m in control.csv, tie the set-ups by common targets, or"
        " strap a course (circumferences.csv)",
        moved_mm=1000 * moved_m,
    )


def sight_wall(job, adjustment, progress):
    """Compute the hits of the wall as points.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Adjustment of the network of the set-ups; None: no network.
    progress : callable

    Returns
    -------
    job : Job
        The job with the hits used as its points.
    sighting : Sighting
        Of all hits.
    """
    progress(
        message(
            "sighting",
            "computing {count} hits of the wall from {setups} set-ups",
            count=len(job.hits),
            setups=len(set(job.hits.setup)),
        )
    )
    refuse_other_units(job.hits)
    refuse_misread_lines(job.hits)
    _refuse_stations_outside(job)
    poses = poses_of(
        job.hits,
        adjustment,
        nominal_m=job.tank.nominal_diameter_m / 2,
        is_inside=job.survey.side == "inside",
    )
    sighting = sight(job.hits, poses)
    refuse_misread_heights(job, sighting)
    sighting = replace(sighting, beside=_targets_beside(job, poses, adjustment))
    _refuse_side(job, sighting)
    _refuse_unknown_offset(job, sighting)
    return _as_points(job, sighting)


def _as_points(job, sighting):
    """Return the job with the hits used as its points, followed by its targets.

    All points are on one side of the wall. The sighting is returned without the covariance of its
    points, which may take half a gigabyte.
    """
    sighting = _move_to_one_side(job, sighting)
    used_hits = np.flatnonzero(~job.hits.check)
    points = take_points(sighting.points, used_hits)
    if sighting.beside is not None:
        points = sighting.beside.after(points, sighting.by_poses[coordinates_of(used_hits)])
    sighting = replace(sighting, points=replace(sighting.points, covariance_m2=None))
    return replace(job, points=s_transform(points)), sighting


def _targets_beside(job, poses, adjustment):
    """`Beside` of the targets in targets.csv; None if it names no target."""
    if adjustment is None or job.measurements.targets is None:
        return None
    points = wall_points(adjustment, job.measurements, job.survey.side)
    return Beside(points, covariance_with_points(job.hits, poses, adjustment, points.names))


def _refuse_side(job, sighting):
    """Raise InputError if all set-ups lie on the other side of the wall than declared."""
    if not np.any(sighting.is_inside == (job.survey.side == "inside")):
        raise _wrong_side_error(job)


def _refuse_stations_outside(job):
    """Raise InputError if the stations alone show that they lie outside the tank.

    Set-ups without ties that each see a line of the wall would not be placed. Stations inside the
    tank cannot all be further from their centre than the radius: the mean squared distance from
    their centre is at most the mean squared distance from the axis.
    """
    hits = job.hits
    stations = dict.fromkeys(hits.setups[name].station for name in hits.setup)
    places = np.array([hits.stations.get(station, np.full(3, np.nan))[:2] for station in stations])
    if job.survey.side != "inside" or len(places) < FEWEST_AROUND:
        return
    if np.all(np.hypot(*(places - places.mean(axis=0)).T) > job.tank.nominal_diameter_m / 2):
        raise _wrong_side_error(job)


def _wrong_side_error(job):
    """InputError for set-ups on the other side of the wall."""
    text = message(
        "hits_on_other_side",
        "found {side}, but all set-ups of the hits stand {other} the tank; expected {other}",
        side=job.survey.side,
        other="inside" if job.survey.side == "outside" else "outside",
    )
    return InputError(Problem("job.toml", text, column="survey.side"))


def _move_to_one_side(job, sighting):
    """Return the sighting with the hits of the other side moved through the wall.

    The outside is the inside plus plate and paint of the course, along the normal of the wall.
    """
    is_moved = sighting.is_inside != (job.survey.side == "inside")
    if not is_moved.any():
        return sighting
    points = through_wall(job, sighting.points, sighting.normal, is_moved)
    return replace(sighting, points=points)


def _refuse_unknown_offset(job, sighting):
    """Raise InputError for an undeclared offset without any control.

    A tape, or hits from both sides of the wall, determine an offset.
    """
    is_strapped = job.strapping is not None and any(
        not strap.check for strap in job.strapping.straps
    )
    if is_strapped or len(set(sighting.is_inside.tolist())) == 2:
        return
    names = [cause.name for cause in sighting.points.unbound if cause.what == "instrument_offset"]
    if names:
        raise InputError(
            [
                Problem("instruments.toml", offset_unknown(), None, f"{name}.u_offset_mm")
                for name in names
            ]
        )
