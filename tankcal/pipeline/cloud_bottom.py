"""Bottom of an upright tank and what stands in it, in scans from inside, as parts of its job.

The bottom is a surveyed surface. Its heights share with the wall, scan by scan, registration,
scale, offset and bias by incidence, by the same unit variables: what lowers the floor widens the
wall. What stands in the tank is proposed as deadwood, and never taken off.
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

FILE = "clouds.toml"
MOST_POINTS = 400  # of a bottom, that its surface is made through
UNSEEN = 0.1  # of the plan: what lies there is told by the form of the rest alone
WET_CELLS, WET_SHARE = 2, 1e-4  # that show images; of the points inside, those under the bottom
IN_MM = 1000.0


@dataclass(frozen=True)
class CloudInside:
    """What scans from inside show beside the wall.

    Attributes
    ----------
    bottom : CloudBottom
    points : BottomPoints
        Of the bottom, as they came from the files.
    things : tuple of Thing
    """

    bottom: CloudBottom
    points: BottomPoints
    things: tuple

    @property
    def proposals(self):
        """What would be rows of deadwood, things and pits; heights in the frame of the tank."""
        return (*self.things, *self.bottom.pits)


def find_inside(job, passes, found, telling):
    """`CloudInside` of a job whose bottom is that of its clouds; None of another.

    Parameters
    ----------
    job : Job
    passes : JobPasses or ClusterPasses
        Both read all files once more.
    found : CloudWall
    telling : Telling

    Raises
    ------
    InputError
        Where no surface that meets the foot of the shell is seen.
    """
    if job.bottom.form != OF_CLOUD or not job.switches.bottom:
        return None
    telling.step(message("cloud_third_pass", "summing up what lies inside, over the plan"))
    bottom = find_cloud_bottom(passes, found, job.clouds.sides)
    telling.step(message("cloud_fourth_pass", "looking for what stands in the tank"))
    things = find_things_in_cells(passes, bottom, job.clouds.sides)
    return CloudInside(bottom, bottom_points(bottom, MOST_POINTS), things)


def with_bottom(job, inside, registration, told=()):
    """The job with the points of the bottom and what their heights share.

    Parameters
    ----------
    job : Job
    inside : CloudInside or None
        None: the job as it is.
    registration : Registration
    told : sequence of ToldCause
        Offsets that were free and that the wall has told: taken off, with what is left of their u.
    """
    if inside is None:
        return job
    points = inside.points
    place, scan = np.nonzero(points.share)
    weight, n = points.share[place, scan], len(points.xyz_m)
    free = {one.name: one for one in told if np.isinf(one.u_before)}
    values = {name: one.value for name, one in free.items()}
    level = np.tile([0.0, 0.0, 1.0], (len(place), 1))
    shared = shared_by_beams(
        points.xyz_m[place], scan, level, registration, job.clouds.tools, told_m=values
    )

    def heights(column_m):
        """(n,) what a column over all coordinates does to the height of each point."""
        return np.bincount(place, weight * column_m.reshape(-1, 3)[:, 2], n)

    xyz = np.column_stack([np.bincount(place, weight * one, n) for one in shared.xyz_m.T])
    causes = [replace(one, column_m=heights(one.column_m)) for one in shared.causes]
    for one in shared.unbound:
        if one.name in free:
            u = free[one.name].u_after
            column = u * heights(one.column_m)
            causes.append(Cause(one.name, one.what, IN_MM * u, one.unit, column))
    bottom = replace(job.bottom, xyz_m=xyz, sd_m=points.sd_m, shared=tuple(causes))
    return replace(job, bottom=bottom)


def deadwood_rows(inside, zero_m):
    """(name, bottom, top, volume, u) of all proposals as deadwood.csv takes them; nan: not known.

    Parameters
    ----------
    inside : CloudInside
    zero_m : float
        Height of the table's zero in the frame of the tank, m.
    """
    found, seen = [], {}
    for one in inside.proposals:
        name, low, high, volume, u = one.deadwood_row
        seen[name] = seen.get(name, 0) + 1
        name = name if seen[name] == 1 else f"{name} ({seen[name]})"
        found.append((name, low - zero_m, high - zero_m, volume, u))
    return found


def check_inside(job, inside):
    """Warnings of what lies inside a tank: a wet bottom, one half seen, things, a roof."""
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
    confirmed = {one.name for one in job.deadwood}
    left = [row[0] for row in deadwood_rows(inside, 0.0) if row[0] not in confirmed]
    if left:
        text = message(
            "things_proposed",
            "{count} things are seen in the tank that no row of deadwood.csv has the name of"
            " ({names}): nothing is taken off for them; expected rows that a person has confirmed",
            count=len(left),
            names=left[:12],
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
