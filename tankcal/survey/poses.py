"""Where the set-ups of wall hits stood: by the adjusted network, as the frame itself, or unknown.

Hits have no redundancy for a network: it is adjusted without them, and hands over its stations, the
zeros of its circles, and scale and offset of its instruments with their whole covariance. A single
set-up is the frame. Where each has a station of its own and none shares a target, the wall alone
ties them: their places and the zeros of their circles are unknowns of the wall.
"""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.sighting import FRAME, NETWORK, WALL, Poses
from tankcal.survey.untied import place_untied


def poses_of(hits, adjustment=None, *, nominal_m, is_inside):
    """`Poses` of the set-ups of hits.

    Parameters
    ----------
    hits : WallHits
    adjustment : Adjustment, optional
        Of the network that their set-ups belong to; None: there is none.
    nominal_m : float
        Radius of the tank, m.
    is_inside : bool
        Whether the set-ups are said to stand in the tank.

    Raises
    ------
    InputError
        For a set-up without a place that other sets of it tell.
    """
    tools = tuple(dict.fromkeys(hits.instrument))
    known = [hits.instruments[name] for name in tools]
    prior = np.array([[one.u_scale, np.nan_to_num(one.u_offset_m)] for one in known]).ravel() ** 2
    poses = _unplaced(hits, tools, prior)
    if adjustment is not None:
        poses = _in_network(hits, poses, adjustment)
    untied = np.array([i for i, tie in enumerate(poses.ties) if tie == WALL], dtype=int)
    if len(untied):
        _refuse_sets(hits, poses, untied)
        poses = place_untied(hits, poses, untied, nominal_m=nominal_m, is_inside=is_inside)
    return poses


def poses_in_network(tangents, adjustment):
    """`Poses` of the set-ups of tangents, with all instruments of the network, and the standard
    deviations (scale, offset m) that these had beforehand; nan: free.

    A set-up that the network does not have is tied by "wall": nothing knows where it stood.
    """
    known = adjustment.adjusted.survey.instruments
    names = tuple(one.name for one in known)
    poses = _unplaced(tangents, names, np.zeros(2 * len(names)))
    poses = replace(poses, ties=(WALL,) * len(poses.keys))
    return _in_network(tangents, poses, adjustment), tuple(
        (one.scale_sd, one.offset_sd_m) for one in known
    )


def _unplaced(hits, tools, prior):
    """Poses at the heights of their stations; the only set-up is the frame."""
    keys = tuple(dict.fromkeys(zip(hits.setup, hits.set, strict=True)))
    names = list(dict.fromkeys(name for name, _ in keys))
    count, xyz = 4 * len(keys), np.zeros((len(keys), 3))
    covariance = np.zeros((count + len(prior), count + len(prior)))
    covariance[count:, count:] = np.diag(prior)
    for place, (name, _) in enumerate(keys):
        setup = hits.setups[name]
        at = np.nan_to_num(hits.stations.get(setup.station, np.zeros(3)))
        xyz[place] = at + [0, 0, setup.height_m]
    tie = FRAME if len(names) == 1 else WALL
    return Poses(
        keys=keys,
        xyz_m=xyz,
        orientation_rad=np.zeros(len(keys)),
        instruments=tools,
        scale=np.zeros(len(tools)),
        offset_m=np.zeros(len(tools)),
        covariance=covariance,
        ties=(tie,) * len(keys),
    )


def _in_network(hits, poses, adjustment):
    """The poses with those of set-ups that the network has, and what it says of instruments."""
    adjusted = adjustment.adjusted
    tied, place, circle, mine, where = _numbers(hits, poses, adjustment)
    p, t = len(poses.keys), len(tied)
    covariance = poses.covariance.copy()
    covariance[np.ix_(where, where)] = adjustment.cov_scale * adjusted.joint_covariance(
        place, orientation_rad=circle, scale=mine, offset_m=mine
    )
    xyz, zero = poses.xyz_m.copy(), poses.orientation_rad.copy()
    heights = np.array([hits.setups[poses.keys[i][0]].height_m for i in tied])
    xyz[tied] = adjusted.xyz_m[place] + heights[:, None] * [0, 0, 1]
    zero[tied] = adjusted.nuisance("orientation_rad")[circle]
    scale, offset = poses.scale.copy(), poses.offset_m.copy()
    for at, number in zip((where[4 * t : 4 * t + len(mine)] - 4 * p) // 2, mine, strict=True):
        scale[at], offset[at] = (adjusted.nuisance(of)[number] for of in ("scale", "offset_m"))
    ties = [NETWORK if i in tied else WALL for i in range(p)]
    return Poses(poses.keys, xyz, zero, poses.instruments, scale, offset, covariance, tuple(ties))


def settled(poses, change):
    """The poses with those that the wall alone ties where it has them.

    change  (k,) of x, y (m) and orientation (rad) of each of these, one after another
    """
    if not np.any(change):
        return poses
    free = [i for i, tie in enumerate(poses.ties) if tie == WALL]
    moved, xyz, zero = np.reshape(change, (-1, 3)), poses.xyz_m.copy(), poses.orientation_rad.copy()
    xyz[free, :2] += moved[:, :2]
    zero[free] += moved[:, 2]
    return replace(poses, xyz_m=xyz, orientation_rad=zero)


def covariance_with_points(hits, poses, adjustment, names):
    """(u, 3 k) covariance of all that `Poses.covariance` is of with the coordinates of points of
    the same network, by their names.
    """
    _, place, circle, mine, where = _numbers(hits, poses, adjustment)
    numbers = dict(zip(adjustment.names, adjustment.there, strict=True))
    beside = [numbers[one] for one in names]
    whole = adjustment.cov_scale * adjustment.adjusted.joint_covariance(
        [*beside, *place], orientation_rad=circle, scale=mine, offset_m=mine
    )
    found = np.zeros((len(poses.covariance), 3 * len(beside)))
    found[where] = whole[3 * len(beside) :, : 3 * len(beside)]
    return found


def _numbers(hits, poses, adjustment):
    """What a network has of poses: which of them, numbers of their stations, of their circles and
    of instruments there, and where all of these unknowns stand among those of `Poses`.
    """
    survey = adjustment.adjusted.survey
    points = dict(zip(adjustment.names, adjustment.there, strict=True))
    circles = {name: number for number, name in enumerate(survey.set_names)}
    first = {}
    for (name, _), number in circles.items():
        first.setdefault(name, number)
    stations = {name: hits.setups[name].station for name, _ in poses.keys}
    tied = [
        i for i, (name, _) in enumerate(poses.keys) if stations[name] in points and name in first
    ]
    place = [points[stations[poses.keys[i][0]]] for i in tied]
    circle = [circles.get(poses.keys[i], first[poses.keys[i][0]]) for i in tied]
    ranged = {one.name: number for number, one in enumerate(survey.instruments)}
    tools = [i for i, name in enumerate(poses.instruments) if name in ranged]
    mine = [ranged[poses.instruments[i]] for i in tools]
    at = np.array(tied, dtype=int)
    tool = 4 * len(poses.keys) + 2 * np.array(tools, dtype=int)
    stations = (4 * at[:, None] + np.arange(3)).ravel()
    return at, place, circle, mine, np.concatenate([stations, 4 * at + 3, tool, tool + 1])


def _refuse_sets(hits, poses, untied):
    """Raise InputError where an untied set-up has two sets: one zero of its circle is enough."""
    names = [poses.keys[one][0] for one in untied]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        expected = message(
            "untied_in_sets",
            "the set-up shares no target with others, and its hits are in several sets; expected"
            " one, or readings of targets in directions.csv",
        )
        raise InputError(
            [Problem("setups.csv", expected, hits.setups[name].row, "setup") for name in twice]
        )
