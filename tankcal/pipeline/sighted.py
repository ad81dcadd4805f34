"""Bare hits of a wall as its points, by the poses of the set-ups that they were taken from."""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.told_causes import told_causes
from tankcal.pipeline.wall import s_transform
from tankcal.sections import coordinates_of
from tankcal.survey.poses import poses_of
from tankcal.survey.sighting import sight


def sight_wall(job, adjustment, progress, told_m=None):
    """The job with the hits that count as its points, and the `Sighting` of all of them.

    adjustment  of the network that the set-ups belong to; None: there is none
    told_m      {instrument: offset that the wall told of it}, m
    """
    progress(
        message(
            "sighting",
            "computing {count} hits of the wall from {setups} set-ups",
            count=len(job.hits),
            setups=len(set(job.hits.setup)),
        )
    )
    poses = poses_of(
        job.hits,
        adjustment,
        nominal_m=job.tank.nominal_diameter_m / 2,
        is_inside=job.survey.side == "inside",
    )
    sighting = sight(job.hits, poses, told_m)
    _refuse_side(job, sighting)
    used = take_points(sighting.points, np.flatnonzero(~job.hits.check))
    return replace(job, points=s_transform(used)), sighting


def told_offsets(job, wall):
    """{instrument: m} of offsets that nothing told but the wall."""
    if not any(one.what == "instrument_offset" for one in job.points.unbound):
        return {}
    return {
        one.name: one.value
        for one in told_causes(job, wall)
        if one.what == "instrument_offset" and np.isinf(one.u_before)
    }


def take_points(points, chosen):
    """Some points (k,) of all, with their covariance and their causes."""
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
    )


def _refuse_side(job, sighting):
    """Raise InputError where set-ups stand on the other side of the wall than was said."""
    other = "inside" if job.survey.side == "outside" else "outside"
    wrong = sighting.is_inside != (job.survey.side == "inside")
    if not wrong.any():
        return
    setups = tuple(dict.fromkeys(np.array(job.hits.setup)[wrong].tolist()))
    if wrong.all():
        text = message(
            "hits_on_other_side",
            "found {side}, but all set-ups of the hits stand {other} the tank; expected {other}",
            side=job.survey.side,
            other=other,
        )
    else:
        text = message(
            "hits_on_both_sides",
            "found {side}, but the set-ups {setups} stand {other} the tank; expected hits from one"
            " side: tankcal does not join both sides yet",
            side=job.survey.side,
            other=other,
            setups=list(setups),
        )
    raise InputError(Problem("job.toml", text, column="survey.side"))
