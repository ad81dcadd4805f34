"""Poses of the set-ups of wall hits: from the adjusted network, as the frame, or unknown.

Wall hits give a network no redundancy, so the network is adjusted without them. It supplies its
stations, the zeros of its circles, and scale and offset of its instruments with their full
covariance. A single set-up defines the frame. Set-ups on separate stations without common targets
are tied by the wall only: their positions and circle zeros are unknowns of the wall.

Approximate poses of set-ups that are tied by the wall only.

Each set-up sees a part of the wall, at least a generatrix. Its own hits give distance and direction
of the tank axis. Its azimuth round the tank is that of its station, or evenly spaced in the order
of the hits. All untied poses are then adjusted together to a leaning surface with one radius per
level, and with waves of settlement that grow in proportion to the height,

    |hit - axis(z)| = R_level + (z - foot) / height * sum of (a_k cos kf + b_k sin kf),
    axis(z) = (x, y) + (mx, my) z,

where f is the azimuth about the axis. Undetermined parameters keep their start values. The wall
adjustment estimates the poses as unknowns.

The lean of the shell determines the order of the set-ups: in the reverse order they would see
opposite leans. For an assumed order, the direction with the better fit is used. Stations are
refused if they fit much worse than mirrored, or than with two of them exchanged.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN, gauss_newton
from tankcal.errors import InputError, Problem
from tankcal.geometry.circles import taubin_circle
from tankcal.geometry.field.components import SETTLEMENT_FALL, SETTLEMENT_MODES
from tankcal.messages import message
from tankcal.survey.wall_hits import FRAME, NETWORK, WALL, Poses, certified_m, rays
from tankcal.units import FULL_TURN


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


# ---- set-ups that are tied by the wall only

LEVEL_GAP_M = 0.15  # gap of heights that separates levels with radii of their own
NARROW_RAD = 0.1  # range of directions of a set-up that sees a line of the wall, along its normal
START_SDS = (0.3, 0.3, 0.1)  # prior sds of a pose: radial and tangential (m), rotation (rad)
START_OF_LINE = (0.3, 1e-3, 1e-3)  # prior sds of a pose that sees a line of the wall
# highest wave of settlement about set-ups of assumed azimuth; sd (m) that excludes higher waves
HIGHEST_OF_EVEN, HELD_M = 6.0, 1e-6
EVEN_RAD = 0.3  # sd of an assumed, even azimuth round the tank, and of its rotation
AXIS_SDS = (0.3, 0.3, 0.02, 0.02)  # prior sds of the axis (m) and of its lean (m/m)
SETTLEMENT_SD_M = 0.02  # prior sd of a long wave of settlement at the top
# sd of a hit from the surface; residuals, in sds, from which weights fall
WALL_SD_M, FAR_SDS = 0.005, 3.0
ROUNDS, CENTRE_ROUNDS = 60, 20
# ratio of rms to that of the other order (valid stations: 1.02, 1.13): refused
MIRRORED, EXCHANGED = 1.15, 1.3
MOST_EXCHANGED = 12  # set-ups up to which all exchanges of two are tried


def place_untied(hits, poses, untied, *, nominal_m, is_inside):
    """Place the untied set-ups.

    Parameters
    ----------
    hits : WallHits
    poses : Poses
        z of all poses; x, y and orientation of the tied poses.
    untied : ndarray of int
        Indices of the untied poses.
    nominal_m : float
        Radius of the tank, m.
    is_inside : bool
        Whether the set-ups are declared to be inside the tank. Set-ups that see the wall all around
        are inside; where there are any, the others are outside.

    Returns
    -------
    Poses

    Raises
    ------
    InputError
        If the stations contradict the order of the set-ups round the tank.
    """
    pose = poses.place_of(hits)
    sights = certified_m(hits)[:, None] * rays(hits.direction_rad, hits.zenith_rad)[0]
    tied = ~np.isin(pose, untied)
    axis = _axis(hits, poses, sights, pose, tied, untied)
    around = np.array([sees_all_around(sights[pose == number]) for number in untied])
    centres = [
        _centre(sights[pose == number], nominal_m, is_around if around.any() else is_inside)
        for number, is_around in zip(untied, around, strict=True)
    ]
    known_azimuths = _azimuths(hits, poses, untied, axis)

    def place_at(azimuth):
        xyz, zero = poses.xyz_m.copy(), poses.orientation_rad.copy()
        for number, at, centre in zip(untied, azimuth, centres, strict=True):
            # The set-up looks at the axis: the azimuth back to the axis fixes its circle zero.
            xyz[number, :2] = axis + np.hypot(*centre) * np.array([np.sin(at), np.cos(at)])
            zero[number] = at + np.pi - np.arctan2(*centre)
        start = replace(poses, xyz_m=xyz, orientation_rad=zero)
        return _fit_surface(start, sights, pose, untied, axis, is_even=np.isnan(known_azimuths))

    even = FULL_TURN * np.arange(len(untied)) / len(untied)
    result, misfit = place_at(np.where(np.isnan(known_azimuths), even, known_azimuths))
    # Tied poses, or fewer than three set-ups, leave no order to be tested.
    if tied.any() or len(untied) < 3:
        return result
    if np.isnan(known_azimuths).all():
        reversed_poses, more = place_at(-even)
        return reversed_poses if more < misfit else result
    if not np.isnan(known_azimuths).any():
        _refuse_order(
            hits, [poses.keys[number][0] for number in untied], known_azimuths, place_at, misfit
        )
    return result


def _azimuths(hits, poses, untied, axis):
    """Azimuths (untied,) of the stations from the axis, rad; nan: unknown."""
    azimuths = np.full(len(untied), np.nan)
    for number, pose_number in enumerate(untied):
        station = hits.stations.get(hits.setups[poses.keys[pose_number][0]].station)
        away = None if station is None else station[:2] - axis
        if away is not None and np.all(np.isfinite(away)) and np.hypot(*away) > 0:
            azimuths[number] = np.arctan2(*away)
    return azimuths


def _refuse_order(hits, names, azimuth, place_at, misfit_m):
    """Raise InputError if stations fit much better mirrored, or with two of them exchanged."""
    mirrored = place_at(-azimuth)[1]
    if misfit_m > MIRRORED * mirrored:
        text = message(
            "stations_mirrored",
            "the hits fit a tank with stations the other way round it (rms {other_mm:.1f} mm for"
            " {rms_mm:.1f} mm): are x and y exchanged, or has one the other sign?",
            other_mm=1000 * mirrored,
            rms_mm=1000 * misfit_m,
        )
        raise InputError(Problem("control.csv", text, column="x_m"))
    if len(names) > MOST_EXCHANGED:
        return
    for one, other in combinations(range(len(names)), 2):
        exchanged = azimuth.copy()
        exchanged[[one, other]] = azimuth[[other, one]]
        rms = place_at(exchanged)[1]
        if misfit_m > EXCHANGED * rms:
            text = message(
                "stations_exchanged",
                "the hits fit a tank with the stations of {one!r} and {other!r} exchanged (rms"
                " {other_mm:.1f} mm for {rms_mm:.1f} mm)",
                one=names[one],
                other=names[other],
                other_mm=1000 * rms,
                rms_mm=1000 * misfit_m,
            )
            row = hits.setups[names[one]].row
            raise InputError(Problem("setups.csv", text, row, "station"))


def sees_all_around(sights):
    """Whether no gap between the directions of sights (n, 3) reaches half a turn."""
    turn = np.sort(np.arctan2(sights[:, 0], sights[:, 1]))
    return np.max(np.diff(turn, append=turn[0] + FULL_TURN)) < np.pi


def _rotate_sights(sights, zero):
    """Horizontal components (n, 2) of sights after rotation by the circle zeros."""
    sin, cos = np.sin(zero), np.cos(zero)
    x, y = sights[:, 0], sights[:, 1]
    return np.column_stack([x * cos + y * sin, -x * sin + y * cos])


def _axis(hits, poses, sights, pose, tied, untied):
    """Position (2,) of the axis: from tied hits, else the mean of the stations, else the origin."""
    if tied.any():
        places = _rotate_sights(sights[tied], poses.orientation_rad[pose[tied]])
        places += poses.xyz_m[pose[tied], :2]
        middle = places.mean(axis=0)
        return middle + taubin_circle(places - middle)[:2]
    stations = [hits.stations.get(hits.setups[poses.keys[item][0]].station) for item in untied]
    complete = [item[:2] for item in stations if item is not None and np.all(np.isfinite(item[:2]))]
    return np.mean(complete, axis=0) if len(complete) == len(untied) else np.zeros(2)


def _centre(sights, nominal_m, is_inside):
    """Position (2,) of the axis relative to one set-up, for the nominal radius."""
    places = sights[:, :2]
    ray = places.mean(axis=0)
    size = np.hypot(*ray)
    if is_inside:
        return taubin_circle(places - ray)[:2] + ray if len(places) > 4 else ray * 0
    nearest = np.hypot(*places.T).min()
    # From outside, the nearest hit lies at the distance of the axis minus the radius.
    start = ray / size * (nearest + nominal_m)
    # A weak prior fixes the direction that a narrow arc leaves undetermined.
    weight = np.diag([1e-4 * len(places)] * 2)

    def step_at(centre, _):
        away = places - centre
        distance = np.hypot(*away.T)
        jacobian = -away / distance[:, None]
        return np.linalg.solve(
            jacobian.T @ jacobian + weight,
            jacobian.T @ (nominal_m - distance) + weight @ (start - centre),
        )

    return gauss_newton(
        step_at,
        start,
        move=np.add,
        is_small=lambda step: np.hypot(*step) < 1e-9,
        most_steps=CENTRE_ROUNDS,
    )


def _fit_surface(poses, sights, pose, untied, axis, *, is_even):
    """Adjust the untied poses to the leaning surface of the module docstring.

    Parameters
    ----------
    poses : Poses
    sights : ndarray, shape (n, 3)
        Hits relative to their set-ups, circle zeros at 0.
    pose : ndarray of int, shape (n,)
        Index of the pose of each hit.
    untied : ndarray of int
    axis : ndarray, shape (2,)
    is_even : ndarray of bool, shape (untied,)
        Whether the azimuth of a set-up round the tank was assumed.

    Returns
    -------
    poses : Poses
    rms : float
        Root mean square of the hits about the surface, each limited to FAR_SDS of a wall, m.
    """
    z = poses.xyz_m[pose, 2] + sights[:, 2]
    order = np.argsort(z, kind="stable")
    level = np.empty(len(z), dtype=int)
    # A gap larger than LEVEL_GAP_M starts a new level.
    level[order] = np.cumsum(np.diff(z[order], prepend=z[order[0]]) > LEVEL_GAP_M)
    levels, free, waves = level.max() + 1, 3 * len(untied), 2 * len(SETTLEMENT_MODES)
    # Unknowns: changes of x, y and rotation of each pose, shift and lean of the axis, waves of
    # settlement. The radii of the levels follow from them.
    lean_from, waves_from, unknowns = free + 2, free + 4, free + 4 + waves
    above, share_of_height = z - z.mean(), (z - z.min()) / max(np.ptp(z), LEVEL_GAP_M)
    # Priors keep undetermined parameters at their start values without constraining the others.
    wave_sds = SETTLEMENT_SD_M * np.sqrt(np.tile(SETTLEMENT_FALL, 2))
    if is_even.any():  # short waves would absorb the error of an assumed azimuth
        wave_sds[np.tile(SETTLEMENT_MODES > HIGHEST_OF_EVEN, 2)] = HELD_M
    sds = np.concatenate([np.ones(free), AXIS_SDS, wave_sds])
    prior = np.diag(sds**-2.0)
    for i, number in enumerate(untied):
        prior[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = _prior_weight(
            poses.xyz_m[number, :2] - axis, sights[pose == number], is_even=is_even[i]
        )

    def poses_at(x):
        changes = x[:free].reshape(-1, 3)
        xyz, zero = poses.xyz_m.copy(), poses.orientation_rad.copy()
        xyz[untied, :2] += changes[:, :2]
        zero[untied] += changes[:, 2]
        return xyz, zero

    def linearise(x):
        """Return the distances (n,) of the hits from the surface, and their derivatives."""
        xyz, zero = poses_at(x)
        turned = _rotate_sights(sights, zero[pose])
        away = xyz[pose, :2] + turned - axis - x[free:lean_from]
        away -= np.outer(above, x[lean_from:waves_from])
        distance = np.hypot(*away.T)
        normal = away / distance[:, None]
        jacobian = np.zeros((len(z), unknowns + levels))
        for i, number in enumerate(untied):
            is_of_pose = pose == number
            jacobian[is_of_pose, 3 * i : 3 * i + 2] = normal[is_of_pose]
            # A rotation of the circle moves a hit perpendicular to its sight.
            across = np.column_stack([turned[is_of_pose, 1], -turned[is_of_pose, 0]])
            jacobian[is_of_pose, 3 * i + 2] = np.sum(normal[is_of_pose] * across, axis=1)
        jacobian[:, free:lean_from] = -normal
        jacobian[:, lean_from:waves_from] = -normal * above[:, None]
        f = np.multiply.outer(np.arctan2(*away.T), SETTLEMENT_MODES)
        by_waves = -share_of_height[:, None] * np.hstack([np.cos(f), np.sin(f)])
        jacobian[:, waves_from:unknowns] = by_waves
        jacobian[np.arange(len(z)), unknowns + level] = -1.0
        # Settlement moves the shell horizontally in proportion to the height, so it is removed
        # before the radii of the levels are taken.
        round_m = distance + by_waves @ x[waves_from:]
        radii = np.array([np.median(round_m[level == number]) for number in range(levels)])
        return round_m - radii[level], jacobian

    def step_at(x, _):
        off, jacobian = linearise(x)
        # Scale from the median absolute deviation, at least that of a wall.
        spread = max(WALL_SD_M, SD_OVER_MEDIAN * float(np.median(np.abs(off))))
        weight = np.minimum(1.0, FAR_SDS * spread / np.maximum(np.abs(off), 1e-12)) / spread**2
        normals = jacobian.T @ (weight[:, None] * jacobian)
        normals[:unknowns, :unknowns] += prior
        right = -jacobian.T @ (weight * off)
        # The prior refers to the start values, hence to x = 0.
        right[:unknowns] -= prior @ x
        return np.linalg.solve(normals, right)[:unknowns]

    x = gauss_newton(
        step_at,
        np.zeros(unknowns),
        move=np.add,
        is_small=lambda step: np.abs(step).max() < 1e-7,
        most_steps=ROUNDS,
    )
    xyz, zero = poses_at(x)
    off = linearise(x)[0]
    misfit = np.sqrt(np.mean(np.minimum(np.abs(off), FAR_SDS * WALL_SD_M) ** 2))
    return replace(poses, xyz_m=xyz, orientation_rad=zero), float(misfit)


def _prior_weight(away, sights, *, is_even):
    """Prior weight matrix (3, 3) of the x, y and rotation of a set-up.

    A set-up whose sights form a line of the wall looks along its normal.

    Parameters
    ----------
    away : ndarray, shape (2,)
        Position of the set-up relative to the axis.
    sights : ndarray, shape (n, 3)
    is_even : bool
        Whether the azimuth of the set-up round the tank was assumed.
    """
    middle = np.arctan2(*sights[:, :2].mean(axis=0))
    turn = np.arctan2(sights[:, 0], sights[:, 1]) - middle
    wide = np.ptp(turn - FULL_TURN * np.round(turn / FULL_TURN))
    distance = np.hypot(*away)
    sds = START_SDS if wide > NARROW_RAD else START_OF_LINE
    if is_even and wide > NARROW_RAD:
        sds = (START_SDS[0], EVEN_RAD * distance, EVEN_RAD)
    # Rotate the weights from radial and tangential to x and y.
    x, y = away / distance
    axes = np.array([[x, -y, 0], [y, x, 0], [0, 0, 1]])
    return axes @ np.diag(np.array(sds) ** -2.0) @ axes.T
