"""Set-ups that are tied to nothing but the wall: where they stood, well enough to start from.

Each sees a part of the wall, a generatrix at least. From its own hits it has the axis of the tank
at some distance and direction; its azimuth round the tank is that of its station, or even in the
order of the hits. Then all untied poses are fitted together to a leaning surface with a radius of
its own at each level, and with the waves of settlement, which grow in proportion to the height,

    |hit - axis(z)| = R_level + (z - foot) / height * sum of (a_k cos kf + b_k sin kf),
    axis(z) = (x, y) + (mx, my) z,

f the azimuth about the axis; what nothing determines stays where it is. The wall itself then has
the poses as unknowns.

A shell that leans tells in which order they stand round it: the other way round they see it lean to
as many sides. So an order that was only assumed is that of the better fit, clockwise or not, and
stations that fit much worse than mirrored, or than two of them exchanged, are refused.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.circles import taubin_circle
from tankcal.geometry.field.components import SETTLEMENT_MODES
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message
from tankcal.survey.sighting import certified_m, rays

LEVEL_GAP_M = 0.15  # between heights that are fitted with radii of their own
NARROW_RAD = 0.1  # directions of a set-up that sees a line of the wall, and looks along its normal
START_SDS = (0.3, 0.3, 0.1)  # away from the axis, across, m, and turn, rad: of a pose at first
START_OF_LINE = (0.3, 1e-3, 1e-3)  # of one that sees a line
EVEN_RAD = 0.3  # sd of an azimuth round the tank that is only assumed to be even, and of its turn
AXIS_SDS = (0.3, 0.3, 0.02, 0.02)  # m, and m/m of its lean
SETTLEMENT_SD_M = 0.02  # of the waves of each mode of settlement at the top
WALL_SD_M, FAR_SDS = 0.005, 3.0  # of a hit from that surface; further ones weigh less
ROUNDS, CENTRE_ROUNDS = 60, 20
MIRRORED, EXCHANGED = 1.15, 1.3  # times the rms of that order (sound ones: 1.02, 1.13): refused
MOST_EXCHANGED = 12  # set-ups that are tried with any two exchanged


def place_untied(hits, poses, untied, *, nominal_m, is_inside):
    """The `Poses` with those of untied set-ups placed.

    Parameters
    ----------
    hits : WallHits
    poses : Poses
        z of all; x, y and orientation of those that are tied.
    untied : ndarray of int
        Which of them are not.
    nominal_m : float
        Radius of the tank, m.
    is_inside : bool
        Whether the set-ups are said to stand in the tank; those that see the wall all around do,
        and where there are any, no others.

    Returns
    -------
    Poses

    Raises
    ------
    InputError
        For stations that stand in another order round the tank.
    """
    pose = poses.place_of(hits)
    own = certified_m(hits)[:, None] * rays(hits.direction_rad, hits.zenith_rad)[0]
    tied = ~np.isin(pose, untied)
    axis = _axis(hits, poses, own, pose, tied, untied)
    around = np.array([sees_all_around(own[pose == one]) for one in untied])
    centres = [
        _centre(own[pose == one], nominal_m, seen if around.any() else is_inside)
        for one, seen in zip(untied, around, strict=True)
    ]
    given = _azimuths(hits, poses, untied, axis)

    def placed(azimuth):
        xyz, zero = poses.xyz_m.copy(), poses.orientation_rad.copy()
        for one, at, centre in zip(untied, azimuth, centres, strict=True):
            xyz[one, :2] = axis + np.hypot(*centre) * np.array([np.sin(at), np.cos(at)])
            zero[one] = at + np.pi - np.arctan2(*centre)
        start = replace(poses, xyz_m=xyz, orientation_rad=zero)
        return _fitted(start, own, pose, untied, axis, is_even=np.isnan(given))

    even = FULL_TURN * np.arange(len(untied)) / len(untied)
    found, misfit = placed(np.where(np.isnan(given), even, given))
    if tied.any() or len(untied) < 3:
        return found
    if np.isnan(given).all():
        other, more = placed(-even)
        return other if more < misfit else found
    if not np.isnan(given).any():
        _refuse_order(hits, [poses.keys[one][0] for one in untied], given, placed, misfit)
    return found


def _azimuths(hits, poses, untied, axis):
    """(untied,) of the stations from the axis; nan: not known."""
    found = np.full(len(untied), np.nan)
    for number, one in enumerate(untied):
        station = hits.stations.get(hits.setups[poses.keys[one][0]].station)
        away = None if station is None else station[:2] - axis
        if away is not None and np.all(np.isfinite(away)) and np.hypot(*away) > 0:
            found[number] = np.arctan2(*away)
    return found


def _refuse_order(hits, names, azimuth, placed, misfit_m):
    """Raise InputError where stations fit much better mirrored, or with two of them exchanged."""
    mirrored = placed(-azimuth)[1]
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
        rms = placed(exchanged)[1]
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


def sees_all_around(own):
    """Are the sights of a set-up to (n, 3) places from it nowhere half a turn apart?"""
    turn = np.sort(np.arctan2(own[:, 0], own[:, 1]))
    return np.max(np.diff(turn, append=turn[0] + FULL_TURN)) < np.pi


def _turned(own, zero):
    sin, cos = np.sin(zero), np.cos(zero)
    x, y = own[:, 0], own[:, 1]
    return np.column_stack([x * cos + y * sin, -x * sin + y * cos])


def _axis(hits, poses, own, pose, tied, untied):
    """(2,) of the tank in the frame: by tied hits, else amid the stations, else its origin."""
    if tied.any():
        places = _turned(own[tied], poses.orientation_rad[pose[tied]])
        places += poses.xyz_m[pose[tied], :2]
        middle = places.mean(axis=0)
        return middle + taubin_circle(places - middle)[:2]
    stations = [hits.stations.get(hits.setups[poses.keys[one][0]].station) for one in untied]
    known = [one[:2] for one in stations if one is not None and np.all(np.isfinite(one[:2]))]
    return np.mean(known, axis=0) if len(known) == len(untied) else np.zeros(2)


def _centre(own, nominal_m, is_inside):
    """(2,) of the tank as one set-up sees it, of the nominal radius."""
    places = own[:, :2]
    ray = places.mean(axis=0)
    size = np.hypot(*ray)
    if is_inside:
        return taubin_circle(places - ray)[:2] + ray if len(places) > 4 else ray * 0
    nearest = np.hypot(*places.T).min()
    start = ray / size * (nearest + nominal_m)
    centre = start.copy()
    for _ in range(CENTRE_ROUNDS):
        away = places - centre
        distance = np.hypot(*away.T)
        by = -away / distance[:, None]
        weight = np.diag([1e-4 * len(places)] * 2)
        change = np.linalg.solve(
            by.T @ by + weight, by.T @ (nominal_m - distance) + weight @ (start - centre)
        )
        centre = centre + change
        if np.hypot(*change) < 1e-9:
            break
    return centre


def _fitted(poses, own, pose, untied, axis, *, is_even):
    """The poses after least squares on the leaning surface of the heading, and the rms of the hits
    about it, none more than FAR_SDS of a wall's, m.

    is_even  (untied,) whether the azimuth of a set-up round the tank was only assumed
    """
    z = poses.xyz_m[pose, 2] + own[:, 2]
    middle = z.mean()
    order = np.argsort(z, kind="stable")
    level = np.empty(len(z), dtype=int)
    level[order] = np.cumsum(np.diff(z[order], prepend=z[order[0]]) > LEVEL_GAP_M)
    place = {one: i for i, one in enumerate(untied)}
    free, levels = 3 * len(untied), level.max() + 1
    settled = np.full(2 * len(SETTLEMENT_MODES), SETTLEMENT_SD_M)
    prior = np.diag(np.concatenate([np.ones(free), AXIS_SDS, settled]) ** -2.0)
    for one, i in place.items():
        prior[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = _start(
            poses.xyz_m[one, :2] - axis, own[pose == one], is_even=is_even[i]
        )
    shift, lean, waves = np.zeros(2), np.zeros(2), np.zeros(2 * len(SETTLEMENT_MODES))
    xyz, zero = poses.xyz_m.copy(), poses.orientation_rad.copy()
    up = (z - z.min()) / max(np.ptp(z), LEVEL_GAP_M)
    first, known = free + 4, free + 4 + len(waves)
    moved = np.zeros(known)
    for _ in range(ROUNDS):
        turned = _turned(own, zero[pose])
        away = xyz[pose, :2] + turned - axis - shift - np.outer(z - middle, lean)
        distance = np.hypot(*away.T)
        normal = away / distance[:, None]
        by = np.zeros((len(z), known + levels))
        for one, i in place.items():
            mine = pose == one
            by[mine, 3 * i : 3 * i + 2] = normal[mine]
            across = np.column_stack([turned[mine, 1], -turned[mine, 0]])
            by[mine, 3 * i + 2] = np.sum(normal[mine] * across, axis=1)
        by[:, free : free + 2] = -normal
        by[:, free + 2 : first] = -normal * (z - middle)[:, None]
        f = np.multiply.outer(np.arctan2(*away.T), SETTLEMENT_MODES)
        by[:, first:known] = -up[:, None] * np.hstack([np.cos(f), np.sin(f)])
        by[np.arange(len(z)), known + level] = -1.0
        round_m = distance + by[:, first:known] @ waves
        radii = np.array([np.median(round_m[level == one]) for one in range(levels)])
        off = round_m - radii[level]
        spread = max(WALL_SD_M, 1.4826 * float(np.median(np.abs(off))))
        weight = np.minimum(1.0, FAR_SDS * spread / np.maximum(np.abs(off), 1e-12)) / spread**2
        normals = by.T @ (weight[:, None] * by)
        normals[:known, :known] += prior
        right = -by.T @ (weight * off)
        right[:known] -= prior @ moved
        change = np.linalg.solve(normals, right)
        for one, i in place.items():
            xyz[one, :2] += change[3 * i : 3 * i + 2]
            zero[one] += change[3 * i + 2]
        shift += change[free : free + 2]
        lean += change[free + 2 : first]
        waves += change[first:known]
        moved += change[:known]
        if np.abs(change[:known]).max() < 1e-7:
            break
    misfit = np.sqrt(np.mean(np.minimum(np.abs(off), FAR_SDS * WALL_SD_M) ** 2))
    return replace(poses, xyz_m=xyz, orientation_rad=zero), float(misfit)


def _start(away, own, *, is_even):
    """(3, 3) weight of x, y and turn of a pose, which stands there from the axis, as it is known
    at first: a set-up whose sights are a line of the wall looks along its normal.
    """
    middle = np.arctan2(*own[:, :2].mean(axis=0))
    turn = np.arctan2(own[:, 0], own[:, 1]) - middle
    wide = np.ptp(turn - FULL_TURN * np.round(turn / FULL_TURN))
    distance = np.hypot(*away)
    sds = START_SDS if wide > NARROW_RAD else START_OF_LINE
    if is_even and wide > NARROW_RAD:
        sds = (START_SDS[0], EVEN_RAD * distance, EVEN_RAD)
    x, y = away / distance
    axes = np.array([[x, -y, 0], [y, x, 0], [0, 0, 1]])
    return axes @ np.diag(np.array(sds) ** -2.0) @ axes.T
