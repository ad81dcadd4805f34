"""Bottom of a vertical tank and objects in it, from scans taken inside the tank.

The bottom is a surveyed surface. For each scan, its heights share registration, scale, offset and
incidence bias with the wall, by the same unit variables. An error that lowers the bottom therefore
widens the wall. Objects in the tank are proposed as deadwood and never deducted automatically.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.clouds.inside import BottomPoints, CloudBottom, bottom_points, find_cloud_bottom
from tankcal.clouds.inside import find_things as find_things_in_cells
from tankcal.errors import Problem
from tankcal.job.contract.bottom import OF_CLOUD
from tankcal.messages import message
from tankcal.survey.beams import shared_by_beams
from tankcal.survey.results import Cause
from tankcal.units import MM_PER_M

FILE = "clouds.toml"
MOST_POINTS = 400  # largest number of points that define the surface of the bottom
UNSEEN = 0.1  # largest share of the plan in which the surface is only interpolated, no warning
# A bottom is wet from so many cells with mirror images, or from such a share of the points inside
# the tank that lie under the bottom.
WET_CELLS, WET_SHARE = 2, 1e-4


@dataclass(frozen=True)
class CloudInside:
    """Bottom and objects that scans from inside show.

    Attributes
    ----------
    bottom : CloudBottom
    points : BottomPoints
        Points of the bottom, as computed from the files.
    things : tuple of Thing
        Objects in the tank.
    """

    bottom: CloudBottom
    points: BottomPoints
    things: tuple

    @property
    def proposals(self):
        """Proposed rows of deadwood, objects and pits; heights in the frame of the tank."""
        return (*self.things, *self.bottom.pits)


def find_inside(job, passes, cloud_wall, telling):
    """Find the bottom and the objects in a tank whose bottom is surveyed by point clouds.

    Parameters
    ----------
    job : Job
    passes : JobPasses or ClusterPasses
        Passes over the files; all files are read twice more.
    cloud_wall : CloudWall
        Wall of the clouds.
    telling : Telling
        Receives the progress.

    Returns
    -------
    CloudInside or None
        None if the bottom of the job is not surveyed by clouds.

    Raises
    ------
    InputError
        If the clouds show no surface that meets the foot of the shell.
    """
    if job.bottom.form != OF_CLOUD or not job.switches.bottom:
        return None
    telling.step(message("cloud_third_pass", "summing up what lies inside, over the plan"))
    bottom = find_cloud_bottom(passes, cloud_wall, job.clouds.sides)
    telling.step(message("cloud_fourth_pass", "looking for what stands in the tank"))
    things = find_things_in_cells(passes, bottom, job.clouds.sides)
    return CloudInside(bottom, bottom_points(bottom, MOST_POINTS), things)


def with_bottom(job, inside, registration, estimates=()):
    """Return the job with the points of its bottom and the causes that their heights share.

    Parameters
    ----------
    job : Job
    inside : CloudInside or None
        None: the job is returned unchanged.
    registration : Registration
    estimates : sequence of EstimatedCause
        Offsets without a prior that the wall estimated: they are corrected, and their remaining
        standard uncertainty is kept.

    Returns
    -------
    Job
    """
    if inside is None:
        return job
    points = inside.points
    # A point of the bottom is a weighted mean over scans: one row for each scan that contributes to
    # it.
    point, scan = np.nonzero(points.share)
    weight, n = points.share[point, scan], len(points.xyz_m)
    estimated = {cause.name: cause for cause in estimates if np.isinf(cause.u_before)}
    values = {name: cause.value for name, cause in estimated.items()}
    vertical = np.tile([0.0, 0.0, 1.0], (len(point), 1))
    shared = shared_by_beams(
        points.xyz_m[point], scan, vertical, registration, job.clouds.tools, estimated_m=values
    )

    def heights(column_m):
        """Effect on the height of each point, shape (n,), of a column over all coordinates."""
        return np.bincount(point, weight * column_m.reshape(-1, 3)[:, 2], n)

    xyz = np.column_stack(
        [np.bincount(point, weight * coordinate, n) for coordinate in shared.xyz_m.T]
    )
    causes = [replace(cause, column_m=heights(cause.column_m)) for cause in shared.causes]
    # An estimated offset gets the standard uncertainty after the adjustment as its prior.
    for cause in shared.unbound:
        if cause.name in estimated:
            u = estimated[cause.name].u_after
            column = u * heights(cause.column_m)
            causes.append(Cause(cause.name, cause.what, MM_PER_M * u, cause.unit, column))
    bottom = replace(job.bottom, xyz_m=xyz, sd_m=points.sd_m, shared=tuple(causes))
    return replace(job, bottom=bottom)


def deadwood_rows(inside, zero_m):
    """Return all proposals as rows of deadwood.csv.

    Parameters
    ----------
    inside : CloudInside
    zero_m : float
        Height of the table's zero in the frame of the tank, m.

    Returns
    -------
    list of tuple
        (name, bottom, top, volume, u): heights in m above the zero, volumes in m3; nan: not known.
        Repeated names are numbered.
    """
    rows, counts = [], {}
    for proposal in inside.proposals:
        name, low, high, volume, u = proposal.deadwood_row
        counts[name] = counts.get(name, 0) + 1
        name = name if counts[name] == 1 else f"{name} ({counts[name]})"
        rows.append((name, low - zero_m, high - zero_m, volume, u))
    return rows


def check_inside(job, inside):
    """Yield warnings of a wet bottom, a bottom partly hidden, unconfirmed objects and a roof."""
    if inside is None:
        return
    bottom = inside.bottom
    wet = np.count_nonzero(bottom.mirror & bottom.in_plan)
    if wet >= WET_CELLS or bottom.mirrored > WET_SHARE * bottom.cells.inside:
        text = message(
            "bottom_mirrors",
            "{count} points lie under the bottom as in a mirror: it is wet, and its surface may be"
            " that of the liquid; expected a dry bottom",
            count=bottom.mirrored,
        )
        yield Problem(FILE, text)
    if bottom.seen_share < 1 - UNSEEN:
        text = message(
            "bottom_half_seen",
            "{share:.0f} % of the plan show the bottom: what lies elsewhere is told by the form of"
            " the rest alone",
            share=100 * bottom.seen_share,
        )
        yield Problem(FILE, text)
    confirmed = {part.name for part in job.deadwood}
    unconfirmed = [row[0] for row in deadwood_rows(inside, 0.0) if row[0] not in confirmed]
    if unconfirmed:
        text = message(
            "things_proposed",
            "{count} things are seen in the tank that no row of deadwood.csv has the name of"
            " ({names}): nothing is taken off for them; expected rows that a person has confirmed",
            count=len(unconfirmed),
            names=unconfirmed[:12],
        )
        yield Problem("deadwood.csv", text)
    if bottom.roof is not None:
        text = message(
            "roof_seen",
            "a roof is seen over {share:.0f} % of the plan, between {low_m:.2f} m and {high_m:.2f}"
            " m: it is no part of the table, which ends with the shell",
            share=100 * bottom.roof.share,
            low_m=bottom.roof.low_m,
            high_m=bottom.roof.high_m,
        )
        yield Problem(FILE, text)
