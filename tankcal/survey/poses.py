"""Poses of the set-ups of wall hits: from the adjusted network, as the frame, or unknown.

Wall hits give a network no redundancy, so the network is adjusted without them. It supplies its
stations, the zeros of its circles, and scale and offset of its instruments with their full
covariance. A single set-up defines the frame. Set-ups on separate stations without common targets
are tied by the wall only: their positions and circle zeros are unknowns of the wall.
"""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.sighting import FRAME, NETWORK, WALL, Poses
from tankcal.survey.untied import place_untied


def poses_of(hits, adjustment=None, *, nominal_m, is_inside):
    """Determine the poses of the set-ups of wall hits.

    Parameters
    ----------
    hits : WallHits
    adjustment : Adjustment, optional
        Adjusted network of the set-ups; None: no network.
    nominal_m : float
        Radius of the tank, m.
    is_inside : bool
        Whether the set-ups are declared to be inside the tank.

    Returns
    -------
    Poses

    Raises
    ------
    InputError
        If a set-up tied by the wall only has several sets of directions.
    """
    tools = tuple(dict.fromkeys(hits.instrument))
    known = [hits.instruments[name] for name in tools]
    prior = (
        np.array([[tool.u_scale, np.nan_to_num(tool.u_offset_m)] for tool in known]).ravel() ** 2
    )
    poses = _poses_at_stations(hits, tools, prior)
    if adjustment is not None:
        poses = _take_network_poses(hits, poses, adjustment)
    untied = np.array([i for i, tie in enumerate(poses.ties) if tie == WALL], dtype=int)
    if len(untied):
        _refuse_sets(hits, poses, untied)
        poses = place_untied(hits, poses, untied, nominal_m=nominal_m, is_inside=is_inside)
    return poses


def poses_in_network(tangents, adjustment):
    """Determine the poses of the set-ups of tangents from a network.

    A set-up outside the network has the tie "wall": its position is unknown.

    Parameters
    ----------
    tangents : Tangents
    adjustment : Adjustment

    Returns
    -------
    poses : Poses
        With all instruments of the network.
    sds : tuple of (float, float)
        A priori standard deviations (scale, offset m) of the instruments; nan: free.
    """
    known = adjustment.adjusted.survey.instruments
    names = tuple(tool.name for tool in known)
    poses = _poses_at_stations(tangents, names, np.zeros(2 * len(names)))
    poses = replace(poses, ties=(WALL,) * len(poses.keys))
    return _take_network_poses(tangents, poses, adjustment), tuple(
        (tool.scale_sd, tool.offset_sd_m) for tool in known
    )


def _poses_at_stations(hits, tools, prior):
    """Poses at the heights of their stations; a single set-up defines the frame."""
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


def _take_network_poses(hits, poses, adjustment):
    """Return the poses with values from the network where it contains their set-ups."""
    adjusted = adjustment.adjusted
    tied, place, circle, tool_numbers, where = _numbers(hits, poses, adjustment)
    p, t = len(poses.keys), len(tied)
    covariance = poses.covariance.copy()
    # Copy the joint block as a whole: it keeps the correlations of stations, circles and
    # instruments.
    covariance[np.ix_(where, where)] = adjustment.cov_scale * adjusted.joint_covariance(
        place, orientation_rad=circle, scale=tool_numbers, offset_m=tool_numbers
    )
    xyz, zero = poses.xyz_m.copy(), poses.orientation_rad.copy()
    heights = np.array([hits.setups[poses.keys[i][0]].height_m for i in tied])
    xyz[tied] = adjusted.xyz_m[place] + heights[:, None] * [0, 0, 1]
    zero[tied] = adjusted.nuisance("orientation_rad")[circle]
    scale, offset = poses.scale.copy(), poses.offset_m.copy()
    # `where` lists scale and offset of each instrument in turn, after the 4 p unknowns of poses.
    for at, number in zip(
        (where[4 * t : 4 * t + len(tool_numbers)] - 4 * p) // 2, tool_numbers, strict=True
    ):
        scale[at], offset[at] = (
            adjusted.nuisance(parameter)[number] for parameter in ("scale", "offset_m")
        )
    ties = [NETWORK if i in tied else WALL for i in range(p)]
    return Poses(poses.keys, xyz, zero, poses.instruments, scale, offset, covariance, tuple(ties))


def settle_poses(poses, change):
    """Return the poses with the positions that the wall determined.

    Parameters
    ----------
    poses : Poses
    change : ndarray, shape (3 u,)
        x, y (m) and orientation (rad) of each of the u poses tied by the wall.
    """
    if not np.any(change):
        return poses
    free = [i for i, tie in enumerate(poses.ties) if tie == WALL]
    moved, xyz, zero = np.reshape(change, (-1, 3)), poses.xyz_m.copy(), poses.orientation_rad.copy()
    xyz[free, :2] += moved[:, :2]
    zero[free] += moved[:, 2]
    return replace(poses, xyz_m=xyz, orientation_rad=zero)


def covariance_with_points(hits, poses, adjustment, names):
    """Cross covariance of poses and instruments with points of the same network.

    Parameters
    ----------
    hits : WallHits
    poses : Poses
    adjustment : Adjustment
    names : sequence of str, length k

    Returns
    -------
    ndarray, shape (u, 3 k)
        u as in `Poses.covariance`.
    """
    _, place, circle, tool_numbers, where = _numbers(hits, poses, adjustment)
    numbers = dict(zip(adjustment.names, adjustment.there, strict=True))
    beside = [numbers[name] for name in names]
    joint = adjustment.cov_scale * adjustment.adjusted.joint_covariance(
        [*beside, *place], orientation_rad=circle, scale=tool_numbers, offset_m=tool_numbers
    )
    cross = np.zeros((len(poses.covariance), 3 * len(beside)))
    cross[where] = joint[3 * len(beside) :, : 3 * len(beside)]
    return cross


def _numbers(hits, poses, adjustment):
    """Match poses with the unknowns of a network.

    Returns
    -------
    tuple
        Numbers of the tied poses, of their stations, circles and instruments in the network, and
        the indices of all these unknowns in `Poses.covariance`.
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
    # A set without directions in the network takes the first circle of its set-up.
    circle = [circles.get(poses.keys[i], first[poses.keys[i][0]]) for i in tied]
    ranged = {instrument.name: number for number, instrument in enumerate(survey.instruments)}
    tools = [i for i, name in enumerate(poses.instruments) if name in ranged]
    tool_numbers = [ranged[poses.instruments[i]] for i in tools]
    pose_numbers = np.array(tied, dtype=int)
    tool = 4 * len(poses.keys) + 2 * np.array(tools, dtype=int)
    stations = (4 * pose_numbers[:, None] + np.arange(3)).ravel()
    return (
        pose_numbers,
        place,
        circle,
        tool_numbers,
        np.concatenate([stations, 4 * pose_numbers + 3, tool, tool + 1]),
    )


def _refuse_sets(hits, poses, untied):
    """Raise InputError if an untied set-up has two sets, since the wall determines one circle
    zero."""
    names = [poses.keys[number][0] for number in untied]
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
