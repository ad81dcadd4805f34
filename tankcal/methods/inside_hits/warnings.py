"""Warnings of wall hits inside horizontal tanks and spheres."""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import list_some, message
from tankcal.methods.hits.warnings import check_control, check_incidence
from tankcal.methods.inside_hits.solid import is_accepted
from tankcal.pipeline.checks.survey import limits_of_method
from tankcal.units import FULL_TURN

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
