"""Horizontal tanks and spheres from hits of their inside, and warnings about them.

Horizontal cylinder or sphere from hits of its wall, sighted from set-ups inside.

The hits become points with a full covariance (`survey.sighting.sight`): noise of distances and
angles, positions of the set-ups, and the errors that the hits of an instrument share. The bias by
incidence acts along the sight and depends on the angle to the normal of the solid, which is not
known before the fit. Therefore the hits are sighted again after each fit, until the fit settles:

    points -> fit with equal weights -> normals -> C(incidence) -> fit -> normals -> ...

The expectation of the bias is 0, so that only the covariance of the points changes, and with it the
fitted solid. The first fit has equal weights because hits on ends and fittings are gross errors:
through the common causes of a full covariance they would displace the fit of all other hits. The
hits that it shows to be off the wall do not become points.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.primitives import FittedCylinder
from tankcal.messages import list_some, message
from tankcal.methods.hits.warnings import check_control, check_incidence
from tankcal.methods.inside_hits.readings import offset_undeclared, untied_setup
from tankcal.pipeline.checks import limits_of_method
from tankcal.pipeline.overruling import decisions_of
from tankcal.pipeline.scanned_solids import NEVER_M, NEVER_PART, fit_scan, offsets
from tankcal.pipeline.wall.finding import take_points
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.survey.poses import poses_in_network, poses_of
from tankcal.survey.wall_hits import WALL, sight
from tankcal.units import FULL_TURN

ROUNDS = 6  # largest number of fits; two or three suffice
SETTLED_M = 1e-5  # largest change of the distance of a hit from the solid in the last round
LEAST_M = 1e-9  # smallest distance from axis or centre that defines a normal


def find_hit_solid(job, adjustment, progress, dof=np.inf):
    """Find the solid of a job by the hits of its wall.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Adjustment of the network of the set-ups; None: no network.
    progress : callable
        Called with a message as a step begins.
    dof : float, optional
        Degrees of freedom of the covariance of the network.

    Returns
    -------
    job : Job
        The job with its adjusted hits as points.
    sighting : Sighting
        Of all hits, without covariance.
    scan : Scan

    Raises
    ------
    InputError
        If a set-up is tied by the wall alone or lies outside the solid, if an offset is unknown, or
        if the hits do not form the solid.
    """
    hits = job.surveys["inside_hits"]
    progress(
        message(
            "sighting_inside",
            "computing {count} hits of the wall from {setups} set-ups inside",
            count=len(hits),
            setups=len(set(hits.setup)),
        )
    )
    poses = _tied_poses(hits, adjustment)
    sighting = sight(hits, poses, incidence=perpendicular)
    _refuse_unknown_offset(sighting)
    fit, used_hits = _first_fit(job, sighting, np.flatnonzero(~hits.check))
    for _ in range(ROUNDS):
        sighting = sight(hits, poses, incidence=partial(incidence_on, fit))
        job_of_points = replace(job, points=s_transform(take_points(sighting.points, used_hits)))
        scan = fit_scan(job_of_points, dof)
        change_m = scan.residuals_m - offsets(fit, job_of_points.points.xyz_m)
        fit = scan.fit
        if np.max(np.abs(change_m)) < SETTLED_M:
            break
    _refuse_outside(hits, poses, scan)
    # The covariance may take half a gigabyte; the points of the job contain its adjusted part.
    points = replace(sighting.points, covariance_m2=None)
    return job_of_points, replace(sighting, points=points, by_poses=None), scan


def is_accepted(job, scan, sighting):
    """Mask (n,) of the hits that the fit accepted.

    Parameters
    ----------
    job : Job
        Job with the hits on the wall as points.
    scan : Scan
        Solid fitted to these points.
    sighting : Sighting
        Of all n hits.
    """
    accepted = {job.points.names[place] for place in scan.accepted}
    return np.array([name in accepted for name in sighting.points.names], dtype=bool)


def perpendicular(xyz, station, ray):
    """Incidence of sights before any fit: all perpendicular; as `sighting.incidence_in_plan`."""
    count = len(xyz)
    return np.ones(count), np.ones(count, dtype=bool), ray


def incidence_on(fit, xyz, station, ray):
    """Incidence of sights on a fitted solid.

    Parameters
    ----------
    fit : FittedCylinder or FittedSphere
    xyz, station, ray : ndarray, shape (n, 3)
        Hits (m), positions of the instruments (m) and unit vectors of the sights.

    Returns
    -------
    cosine : ndarray, shape (n,)
    inside : ndarray of bool, shape (n,)
        Whether the instrument is within the solid.
    normal : ndarray, shape (n, 3)
        Outward unit normals.
    """
    normal = normals_of(fit, xyz)
    cosine = np.clip(np.abs(np.sum(ray * normal, axis=1)), 0.0, 1.0)
    return cosine, offsets(fit, station) < 0, normal


def normals_of(fit, xyz):
    """Outward unit normals (n, 3) of a fitted cylinder or sphere at positions (n, 3), m."""
    if isinstance(fit, FittedCylinder):
        # The part of the position that is perpendicular to the axis.
        away = (xyz - fit.point_m) @ fit.tangents.T @ fit.tangents
    else:
        away = xyz - fit.centre_m
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), LEAST_M)


def _tied_poses(hits, adjustment):
    """`Poses` of the set-ups; InputError if the wall alone ties a set-up to the others."""
    names = list(dict.fromkeys(hits.setup))
    untied = names[1:]  # without a network, one set-up is the frame
    if adjustment is not None:
        known = poses_in_network(hits, adjustment)[0]
        untied = [name for (name, _), tie in zip(known.keys, known.ties, strict=True)
                  if tie == WALL]  # fmt: skip
    if untied:
        row = hits.setups[untied[0]].row
        raise InputError(Problem("setups.csv", untied_setup(untied[0]), row, "setup"))
    # The radius and the side only place set-ups tied by the wall, of which there are none.
    return poses_of(hits, adjustment, nominal_m=np.nan, is_inside=True)


def _first_fit(job, sighting, adjusted):
    """Fit the solid to all adjusted hits with equal weights.

    Parameters
    ----------
    job : Job
    sighting : Sighting
    adjusted : ndarray of int, shape (m,)
        Indices of the hits that are not only compared.

    Returns
    -------
    fit : FittedCylinder or FittedSphere
    used_hits : ndarray of int, shape (k,)
        Indices of the hits on the wall, and of the hits with a manual decision.
    """
    points = take_points(sighting.points, adjusted)
    job = replace(job, points=replace(points, covariance_m2=None, causes=(), unbound=()))
    fit = fit_scan(job).fit
    # The bound of `fit_scan` for a point of the wall: a deep dent, but no fitting.
    is_near = np.abs(offsets(fit, points.xyz_m)) <= NEVER_PART * fit.radius_m + NEVER_M
    return fit, adjusted[is_near | (decisions_of(job) != 0)]


def _refuse_unknown_offset(sighting):
    """Raise InputError for an offset that is neither declared nor determined by a network."""
    unbound = sighting.points.unbound
    names = [cause.name for cause in unbound if cause.what == "instrument_offset"]
    if names:
        raise InputError(
            [
                Problem("instruments.toml", offset_undeclared(), None, f"{name}.u_offset_mm")
                for name in names
            ]
        )


def _refuse_outside(hits, poses, scan):
    """Raise InputError for set-ups that do not lie within the solid."""
    beyond_m = offsets(scan.fit, poses.xyz_m)
    problems = {}
    for (name, _), beyond in zip(poses.keys, beyond_m, strict=True):
        if beyond >= 0:
            expected = message(
                "inside_setup_beyond",
                "found {name!r}, which is {beyond_m:.3f} m outside the wall that the hits show;"
                " expected a set-up inside: check its station and its height",
                name=name,
                beyond_m=beyond,
            )
            problems[name] = Problem("setups.csv", expected, hits.setups[name].row, "setup")
    if problems:
        raise InputError([*problems.values()])


SHOWN = 8  # largest number of rows in a message


def check_hits_inside(job, scan, sighting):
    """Return the warnings of the hits of a solid.

    Parameters
    ----------
    job : Job
        Job with its adjusted hits as points.
    scan : Scan
    sighting : Sighting

    Returns
    -------
    tuple of Problem
    """
    hits = job.surveys["inside_hits"]
    limits = limits_of_method("tankcal.methods.inside_hits")
    return (
        *check_control(hits),
        *check_incidence(sighting),
        *_check_off_wall(job, hits, sighting),
        *_check_rejected(job, hits, scan, sighting, limits),
        *(_check_cylinder(job, hits, scan, limits) if job.horizontal is not None else ()),
    )


def _check_off_wall(job, hits, sighting):
    """Warn of hits so far from the solid that they did not become points."""
    of_wall = set(job.points.names)
    is_off = np.array([name not in of_wall for name in sighting.points.names]) & ~hits.check
    if is_off.any():
        places = np.flatnonzero(is_off)
        text = message(
            "inside_hits_off",
            "{count} hits are not on the fitted solid and were rejected (rows {rows}): are they on"
            " the ends or on fittings?",
            count=len(places),
            rows=list_some([str(hits.rows[place]) for place in places], SHOWN),
        )
        yield Problem(hits.file, text, hits.rows[places[0]])


def _check_rejected(job, hits, scan, sighting, limits):
    """Warn of set-ups with many rejected hits: on ends, fittings, or by another set-up's zero."""
    setups, is_used = np.array(hits.setup), is_accepted(job, scan, sighting)
    for name in dict.fromkeys(hits.setup):
        is_here = (setups == name) & ~hits.check
        rejected, count = int(np.sum(is_here & ~is_used)), int(np.sum(is_here))
        if rejected > limits["most_rejected_share"] * count:
            text = message(
                "inside_hits_rejected",
                "{rejected} of {count} hits from set-up {name!r} are not on the fitted solid and"
                " were rejected: are they on the ends or on fittings, or is a column in another"
                " unit?",
                rejected=rejected,
                count=count,
                name=name,
            )
            yield Problem("setups.csv", text, hits.setups[name].row, "setup")


def _check_cylinder(job, hits, scan, limits):
    """Warn of a part of a cylinder, along or round its axis, without accepted hits."""
    fit = scan.fit
    relative = job.points.xyz_m[scan.accepted] - fit.point_m
    along = np.ptp(relative @ fit.direction)
    share = along / job.horizontal.length_m
    if share < limits["least_length_share"]:
        text = message(
            "inside_hits_short",
            "the hits cover {percent:.0f} % of the length of the cylinder; expected"
            " {least:.0f} % or more: the remaining wall is assumed to continue the part with hits",
            percent=100 * share,
            least=100 * limits["least_length_share"],
        )
        yield Problem(hits.file, text)
    # The largest difference of neighbouring angles, with the first repeated after a full turn.
    angle = np.sort(np.arctan2(*(relative @ fit.tangents.T).T))
    empty_deg = np.degrees(np.max(np.diff(angle, append=angle[0] + FULL_TURN)))
    if empty_deg > limits["most_empty_deg"]:
        text = message(
            "inside_hits_sector",
            "a sector of {empty:.0f} degrees about the axis has no hits; expected at most"
            " {most:.0f} degrees: the wall there is assumed to continue the part with hits",
            empty=empty_deg,
            most=limits["most_empty_deg"],
        )
        yield Problem(hits.file, text)
