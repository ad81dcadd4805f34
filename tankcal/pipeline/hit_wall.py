"""Bare hits of a wall as its points, by the poses of the set-ups that they were taken from."""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.shell import course_of
from tankcal.job.checks.hits import offset_unknown
from tankcal.messages import message
from tankcal.pipeline.cause_correlations import told_causes
from tankcal.pipeline.misread_hits import refuse_other_units
from tankcal.pipeline.misread_lines import refuse_misread_heights, refuse_misread_lines
from tankcal.pipeline.point_covariance import s_transform
from tankcal.pipeline.wall import find_wall, joints_of
from tankcal.sections import coordinates_of
from tankcal.survey import wall_points
from tankcal.survey.poses import covariance_with_points, poses_of, settled
from tankcal.survey.sighting import Beside, sight

FEWEST_AROUND = 3  # stations that show on which side of the wall they are
ROUNDS = 4  # in which the wall tells offsets or places
SETTLED_M = 1e-5  # what moves no hit by more has settled


def find_hit_wall(job, adjustment, progress, dof=np.inf, *, amplitudes=None):
    """The job with its hits as points, their `Sighting`, and the `Wall` that they show.

    What nothing but the wall tells is taken off, and the wall is found again: offsets of
    instruments, and how far set-ups stand from where they were placed, so that sections and all
    that is said of points are those of the wall in the table.

    adjustment  of the network that the set-ups belong to; None: there is none
    dof, amplitudes  as in `find_wall`
    """
    job, sighting = sight_wall(job, adjustment, progress)
    wall, sizes = find_wall(job, progress, dof, amplitudes), None
    for _ in range(ROUNDS):
        told = wall.told
        if told is None or told.largest_m < SETTLED_M:
            break
        if len(told.poses):  # they take up a part of the form that further rounds would see
            sizes = wall.field.amplitudes
        poses = settled(sighting.poses, told.poses)
        again = sight(job.hits, poses, told.offsets_m)
        offsets = {name: sighting.told_m.get(name, 0.0) + more
                   for name, more in told.offsets_m.items()}  # fmt: skip
        job, sighting = _as_points(job, replace(again, beside=sighting.beside, told_m=offsets))
        wall = find_wall(job, progress, dof, amplitudes, sizes=sizes)
    return job, replace(sighting, told=told_causes(job, wall)), wall


def sight_wall(job, adjustment, progress):
    """The job with the hits that count as its points, and the `Sighting` of all of them.

    adjustment  of the network that the set-ups belong to; None: there is none
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
    """The job with the hits that count as its points, all on one side of the wall, and then its
    targets; the sighting without the covariance of its points, which may be half a gigabyte.
    """
    sighting = _on_one_side(job, sighting)
    counted = np.flatnonzero(~job.hits.check)
    used = take_points(sighting.points, counted)
    if sighting.beside is not None:
        used = sighting.beside.after(used, sighting.by_poses[coordinates_of(counted)])
    sighting = replace(sighting, points=replace(sighting.points, covariance_m2=None))
    return replace(job, points=s_transform(used)), sighting


def _targets_beside(job, poses, adjustment):
    """`Beside` of the targets that targets.csv names; None: it names none."""
    if adjustment is None or job.measurements.targets is None:
        return None
    points = wall_points(adjustment, job.measurements, job.survey.side)
    return Beside(points, covariance_with_points(job.hits, poses, adjustment, points.names))


def take_points(points, chosen):
    """Some points (k,) of all, with their covariance and their causes."""
    if np.array_equal(chosen, np.arange(len(points.names))):  # the covariance may be large
        return points
    index = coordinates_of(chosen)

    def of(values):
        return tuple(values[i] for i in chosen)

    def columns(causes):
        return tuple(replace(one, column_m=one.column_m[index]) for one in causes)

    return replace(
        points,
        names=of(points.names),
        xyz_m=points.xyz_m[chosen],
        covariance_m2=points.covariance_m2[np.ix_(index, index)],
        section=of(points.section),
        generatrix=of(points.generatrix),
        rows=of(points.rows),
        causes=columns(points.causes),
        unbound=columns(points.unbound),
        by_inputs={name: column[index] for name, column in points.by_inputs.items()},
    )


def _refuse_side(job, sighting):
    """Raise InputError where all set-ups stand on the other side of the wall than was said."""
    if not np.any(sighting.is_inside == (job.survey.side == "inside")):
        raise _on_other_side(job)


def _refuse_stations_outside(job):
    """The same where the stations alone show it: each further from the middle of all than the wall.

    Untied set-ups that see a line of the wall each would not be placed at all. In the tank none has
    its stations so: the mean of the squared distances from their middle is at most that from the
    axis.
    """
    hits = job.hits
    used = dict.fromkeys(hits.setups[name].station for name in hits.setup)
    places = np.array([hits.stations.get(one, np.full(3, np.nan))[:2] for one in used])
    if job.survey.side != "inside" or len(places) < FEWEST_AROUND:
        return
    if np.all(np.hypot(*(places - places.mean(axis=0)).T) > job.tank.nominal_diameter_m / 2):
        raise _on_other_side(job)


def _on_other_side(job):
    text = message(
        "hits_on_other_side",
        "found {side}, but all set-ups of the hits stand {other} the tank; expected {other}",
        side=job.survey.side,
        other="inside" if job.survey.side == "outside" else "outside",
    )
    return InputError(Problem("job.toml", text, column="survey.side"))


def _on_one_side(job, sighting):
    """The sighting with the hits of the other side than `survey.side` moved through the wall.

    Outside is the inside plus plate and paint of the course, along the wall's normal.
    """
    moved = sighting.is_inside != (job.survey.side == "inside")
    if not moved.any():
        return sighting
    points = through_wall(job, sighting.points, sighting.normal, moved)
    return replace(sighting, points=points)


def through_wall(job, points, normal, moved):
    """Points of an upright wall of which some are moved to its other side.

    normal  (n, 3) of the wall, outwards
    moved   (n,) which are not on the side of the survey
    """
    joints = job.datum.bottom_z_m + joints_of(job)
    course = course_of(points.xyz_m[:, 2], joints)
    outwards = 1.0 if job.survey.side == "outside" else -1.0
    normal = (outwards * moved)[:, None] * normal
    switches = {"plate_thickness": job.switches.plate, "paint": job.switches.paint}
    sizes = {
        "plate_thickness": np.array([one.thickness_m for one in job.courses])[course],
        "paint": np.array([one.paint_m for one in job.courses])[course],
    }
    size = sum(switches[name] * one for name, one in sizes.items())
    xyz = points.xyz_m + size[:, None] * normal
    by = {name: normal.ravel() for name, one in sizes.items() if switches[name] and one.any()}
    return replace(points, xyz_m=xyz, by_inputs=by)


def _refuse_unknown_offset(job, sighting):
    """Raise InputError for an offset that nobody gave, and that neither a tape nor hits from both
    sides of the wall tell.
    """
    taped = job.strapping is not None and any(not one.check for one in job.strapping.straps)
    if taped or len(set(sighting.is_inside.tolist())) == 2:
        return
    names = [one.name for one in sighting.points.unbound if one.what == "instrument_offset"]
    if names:
        raise InputError(
            [
                Problem("instruments.toml", offset_unknown(), None, f"{name}.u_offset_mm")
                for name in names
            ]
        )
