"""Growth of positions in plan from directions, lengths, intersections and free stations.

Observations in plan: directions by circle, horizontal lengths, slopes.

Azimuths form a circle whose zero is north. Horizontal angles with common sights at a station form
one circle with the first sight as its zero.

A point lies where two lines, a line and an arc, or two arcs from known points intersect. The
intersection with the smallest sum of misfits to all observations of the point is used. A point with
two equivalent positions waits. Controlled points come before uncontrolled ones.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tankcal.survey.observations import (
    Azimuths,
    Directions,
    Distances,
    HorizontalAngles,
    VerticalAngles,
)

STEEP = 0.2  # horizontal over slope distance below which heights reduce it poorly


@dataclass(frozen=True)
class Plan:
    """Observations in plan, as arrays of point numbers and SI values.

    Attributes
    ----------
    station, target, circle, reading : ndarray, shape (n,)
        Directions.
    north : ndarray of bool, shape (circles,)
        True where the zero of the circle is north.
    at : ndarray of int, shape (circles,)
        Station of each circle.
    start, end, length, flat, rise : ndarray, shape (d,)
        Distances, corrected for scale and offset; flat: horizontal.
    low, high, slope : ndarray, shape (v,)
        Vertical angles above the horizon, rad.
    lift : ndarray, shape (v,)
        Height of instrument minus height of target, m.
    bend : ndarray, shape (v,)
        Curvature less refraction, 1/m.
    points : int
        Number of points of the survey.
    """

    station: np.ndarray
    target: np.ndarray
    circle: np.ndarray
    reading: np.ndarray
    north: np.ndarray
    at: np.ndarray
    start: np.ndarray
    end: np.ndarray
    length: np.ndarray
    flat: np.ndarray
    rise: np.ndarray
    low: np.ndarray
    high: np.ndarray
    slope: np.ndarray
    lift: np.ndarray
    bend: np.ndarray
    points: int

    def pairs(self, start, end):
        """Number (n,) of each unordered pair of points."""
        return np.minimum(start, end) * self.points + np.maximum(start, end)

    def lengths(self, z_m, heights_first=False):
        """Sorted pairs (k,) and the horizontal length of each, where it can be determined.

        A slope distance is reduced by the vertical angle of its line, else by heights.
        `heights_first` reverses this order, as heights are controlled and a single angle is not.
        """
        pair = self.pairs(self.start, self.end)
        slopes = medians(self.pairs(self.low, self.high), np.abs(self.slope))
        flat = np.where(self.flat, self.length, np.nan)
        by_angle = self.length * np.cos(look_up(*slopes, pair))
        drop = z_m[self.end] - z_m[self.start] - self.rise
        square = self.length**2 - drop**2
        # Pythagoras loses accuracy on steep lines, where the horizontal part is small.
        by_height = np.sqrt(np.where(square > (STEEP * self.length) ** 2, square, np.nan))
        if heights_first:
            by_angle, by_height = by_height, by_angle
        reduced = np.where(self.flat, flat, np.where(np.isfinite(by_angle), by_angle, by_height))
        good = np.isfinite(reduced)
        return medians(pair[good], reduced[good])


def medians(groups, values):
    """Sorted groups (k,), and the median of the values (n,) of each."""
    # Sorted by group, then by value: the median is in the middle of each group.
    order = np.lexsort([values, groups])
    groups, values = groups[order], values[order]
    distinct, first, count = np.unique(groups, return_index=True, return_counts=True)
    return distinct, 0.5 * (values[first + (count - 1) // 2] + values[first + count // 2])


def look_up(groups, values, wanted):
    """Values (n,) of the wanted groups (n,), nan for absent groups."""
    if not len(groups):
        return np.full(len(wanted), np.nan)
    place = np.minimum(np.searchsorted(groups, wanted), len(groups) - 1)
    return np.where(groups[place] == wanted, values[place], np.nan)


def plan_of(survey):
    """The Plan of a survey, without rejected observations."""
    groups = [
        (item if item.use is None else item.taken(item.use > 0)) for item in survey.observations
    ]
    circles = _Circles(len(survey.sets))
    for item in groups:
        if isinstance(item, Directions):
            circles.add(item.start, item.end, item.set, item.value)
        elif isinstance(item, Azimuths):
            circles.add_azimuths(item)
        elif isinstance(item, HorizontalAngles):
            circles.add_angles(item)
    points = len(survey.points)
    return Plan(
        *circles.rows(), *circles.zeros(), *_distances(survey, groups), *_slopes(groups), points
    )


def _join_columns(parts, kinds):
    """Columns (n,) of each kind from tuples of columns."""
    columns = list(zip(*parts, strict=True)) if parts else [()] * len(kinds)
    return [
        np.concatenate([np.zeros(0, dtype=kind), *column]).astype(kind)
        for kind, column in zip(kinds, columns, strict=True)
    ]


def _distances(survey, groups):
    """Start, end, length, flat, rise of all distances."""
    scale = np.array([tool.scale for tool in survey.instruments] + [0.0])
    offset = np.array([tool.offset_m for tool in survey.instruments] + [0.0])
    parts = []
    for item in groups:
        if isinstance(item, Distances):
            # Invert reading = (1 + scale) true + offset.
            length = (item.value - offset[item.instrument]) / (1 + scale[item.instrument])
            flat = np.full(len(item), item.horizontal)
            parts.append((item.start, item.end, length, flat, _rise(item)))
    return _join_columns(parts, (int, int, float, bool, float))


def _slopes(groups):
    """Low, high, slope, lift, bend of all vertical angles."""
    parts = []
    for item in groups:
        if isinstance(item, VerticalAngles):
            # Zenith angles become angles above the horizon.
            slope = np.pi / 2 - item.value if item.zenith else item.value
            bend = np.full(len(item), item.bend_per_m)
            parts.append((item.start, item.end, slope, _rise(item), bend))
    return _join_columns(parts, (int, int, float, float, float))


def _rise(sights):
    """Instrument height minus target height (n,), m."""
    return np.zeros(len(sights)) if sights.rise_m is None else sights.rise_m


class _Circles:
    """Directions by circle; direction sets come first, with their own numbers."""

    def __init__(self, sets):
        self.parts, self.north = [], [False] * sets

    def add(self, station, target, circle, reading):
        self.parts.append((station, target, circle, reading))

    def add_azimuths(self, azimuths):
        stations, circle = np.unique(azimuths.start, return_inverse=True)
        self.add(azimuths.start, azimuths.end, circle + len(self.north), azimuths.value)
        self.north += [True] * len(stations)

    def add_angles(self, angles):
        """Chain the angles of a station with common sights from the first sight."""
        for station in np.unique(angles.start):
            is_at_station = angles.start == station
            links = {}
            for a, b, angle in zip(
                angles.origin[is_at_station],
                angles.end[is_at_station],
                angles.value[is_at_station],
                strict=True,
            ):
                links.setdefault(int(a), []).append((int(b), angle))
                links.setdefault(int(b), []).append((int(a), -angle))
            chained = set()
            for first in links:
                if first in chained:
                    continue
                chain = _chain_angles(first, links)
                chained |= set(chain)
                rows = np.array(list(chain)), np.array(list(chain.values()))
                count = len(chain)
                number = np.full(count, len(self.north))
                self.add(np.full(count, station), rows[0], number, rows[1])
                self.north.append(False)

    def rows(self):
        return _join_columns(self.parts, (int, int, int, float))

    def zeros(self):
        station, _, circle, _ = self.rows()
        at = np.full(len(self.north), -1)
        at[circle[::-1]] = station[::-1]
        return np.array(self.north, dtype=bool), at


def _chain_angles(first, links):
    """Readings {target: rad} from angles between targets, the first target at zero."""
    readings, queue = {first: 0.0}, [first]
    # Breadth-first: each reading is the sum of as few angles as possible.
    while queue:
        here = queue.pop(0)
        for target, angle in links[here]:
            if target not in readings:
                readings[target] = readings[here] + angle
                queue.append(target)
    return readings


MOST = 8  # sights of a point that are combined; all sights are compared with the result
IMPROVING = 4  # rounds in which all positions are recomputed
STILL_M = 1e-3  # largest change of positions at convergence
THIN = 0.02  # smallest sine of the angle between intersecting lines
APART = 0.02  # relative distance above which two positions differ
RIVAL = 2.0  # misfit ratio to the best position, below which another is equivalent
NOISE = 1e-3  # relative misfit regarded as noise


def grow_in_plan(plan, xy_m, z_m, north=True):
    """Extend positions in plan by all points that follow from known ones.

    Parameters
    ----------
    plan : Plan
    xy_m : ndarray, shape (points, 2)
        nan: unknown.
    z_m : ndarray, shape (points,)
        nan: unknown.
    north : bool
        Whether +y of the frame is the zero of azimuths.

    Returns
    -------
    ndarray, shape (points, 2)
    """
    xy, lengths = xy_m.copy(), plan.lengths(z_m)
    required = 3
    while True:
        waiting = np.isnan(xy[:, 0])
        zeros = orient_circles(plan, xy, north)
        _place_points(plan, xy, zeros, lengths, required, waiting, required > 2)
        _place_stations(plan, xy, lengths, required, waiting & np.isnan(xy[:, 0]), required > 2)
        # Three sights control a position; two are accepted only when no controlled point is left.
        if np.isnan(xy[:, 0]).sum() < waiting.sum():
            required = 3
        elif required == 3:
            required = 2
        else:
            return xy


def orient_circles(plan, xy_m, north=True):
    """Azimuths (circles,) of the circle zeros with which most known targets agree, rad; nan:
    unknown.

    Parameters
    ----------
    plan : Plan
    xy_m : ndarray, shape (points, 2)
    north : bool
        Whether +y of the frame is the zero of azimuths.
    """
    d = xy_m[plan.target] - xy_m[plan.station]
    zero = np.arctan2(d[:, 0], d[:, 1]) - plan.reading
    zeros = np.full(len(plan.north), np.nan)
    good = np.flatnonzero(np.isfinite(zero))
    good = good[np.argsort(plan.circle[good], kind="stable")]
    circles, first = np.unique(plan.circle[good], return_index=True)
    for circle, rows in zip(circles, np.split(good, first[1:])[: len(circles)], strict=True):
        zeros_of_circle = zero[rows]
        tried = zeros_of_circle[:: max(1, len(zeros_of_circle) // 50)]
        # The sum of absolute differences is a median: blunders are outvoted.
        off = np.abs(_wrap_angles(zeros_of_circle[None] - tried[:, None])).sum(axis=1)
        zeros[circle] = _wrap_angles(tried[np.argmin(off)])
    return np.where(plan.north, 0.0, zeros) if north else zeros


def _wrap_angles(angle):
    """Angles reduced to -pi to pi."""
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def improve_plan_positions(plan, xy_m, z_m, held):
    """Recompute each position in plan from the others, so that blunders are outvoted.

    Parameters
    ----------
    plan : Plan
    xy_m : ndarray, shape (points, 2)
    z_m : ndarray, shape (points,)
    held : ndarray of bool, shape (points,)
        Positions that stay.

    Returns
    -------
    ndarray, shape (points, 2)
    """
    xy, lengths = xy_m.copy(), plan.lengths(z_m, heights_first=True)
    occupied = np.zeros(len(xy), dtype=bool)
    occupied[plan.at[plan.at >= 0]] = True
    free = np.isfinite(xy[:, 0]) & ~held
    for _ in range(IMPROVING):
        zeros, before = orient_circles(plan, xy), xy.copy()
        doubtful = free & ~occupied & _disagreeing(plan, xy, zeros, lengths, free)
        _place_points(plan, xy, zeros, lengths, 3, doubtful, False)
        _place_stations(plan, xy, lengths, 3, free & occupied, False)
        if np.nanmax(np.abs(xy - before), initial=0.0) < STILL_M:
            break
    return xy


def _disagreeing(plan, xy, zeros, lengths, wanted):
    """Mask (points,) of points missed by some of their sights by more than noise."""
    owner, origin, towards = _rays(plan, xy, zeros, wanted)
    d = xy[owner] - origin
    off = np.abs(d[:, 0] * towards[:, 1] - d[:, 1] * towards[:, 0])
    # A ray that points away from the point misses it completely.
    off = np.where(np.sum(d * towards, axis=1) > 0, off, np.inf)
    bad = off > NOISE * np.linalg.norm(d, axis=1)
    of_arc, centre, radius = _arcs(plan, xy, lengths, wanted)
    wrong = np.abs(np.linalg.norm(xy[of_arc] - centre, axis=1) - radius) > NOISE * radius
    mask = np.zeros(len(xy), dtype=bool)
    mask[owner[bad]] = True
    mask[of_arc[wrong]] = True
    return mask


def _place_points(plan, xy, zeros, lengths, required, wanted, strict):
    """Compute wanted points (points,) with enough sights; updates xy in place."""
    owner, origin, towards = _rays(plan, xy, zeros, wanted)
    of_arc, centre, radius = _arcs(plan, xy, lengths, wanted)
    count = np.bincount(np.concatenate([owner, of_arc]), minlength=len(xy))
    # Sort once; the sights of each point are then a slice.
    by_owner, by_arc = np.argsort(owner, kind="stable"), np.argsort(of_arc, kind="stable")
    edges = np.arange(len(xy) + 1)
    rays_at = np.searchsorted(owner[by_owner], edges)
    arcs_at = np.searchsorted(of_arc[by_arc], edges)
    for point in np.flatnonzero(wanted & (count >= required)):
        rays = by_owner[rays_at[point] : rays_at[point + 1]]
        arcs = by_arc[arcs_at[point] : arcs_at[point + 1]]
        position = place(origin[rays], towards[rays], centre[arcs], radius[arcs], strict)
        if position is not None:
            xy[point] = position


def _rays(plan, xy, zeros, wanted):
    """Rays to wanted points: point (n,), origin (n, 2), direction (n, 2)."""
    azimuth = plan.reading + zeros[plan.circle]
    known, able = np.isfinite(xy[:, 0]), np.isfinite(azimuth)
    ahead = np.flatnonzero(able & known[plan.station] & wanted[plan.target])
    north = plan.north[plan.circle] & able
    # An azimuth is known in both directions, so it also gives a ray from target to station.
    back = np.flatnonzero(north & known[plan.target] & wanted[plan.station])
    azimuth = np.concatenate([azimuth[ahead], azimuth[back] + np.pi])
    owner = np.concatenate([plan.target[ahead], plan.station[back]])
    origin = np.concatenate([xy[plan.station[ahead]], xy[plan.target[back]]])
    return owner, origin, np.column_stack([np.sin(azimuth), np.cos(azimuth)])


def _arcs(plan, xy, lengths, wanted):
    """Arcs through wanted points: point (n,), centre (n, 2), radius (n,)."""
    low, high = np.divmod(lengths[0], plan.points)
    known = np.isfinite(xy[:, 0])
    up, down = known[low] & wanted[high], known[high] & wanted[low]
    owner = np.concatenate([high[up], low[down]])
    centre = np.concatenate([xy[low[up]], xy[high[down]]])
    return owner, centre, np.concatenate([lengths[1][up], lengths[1][down]])


def place(origin, towards, centre, radius, controlled=False):
    """Position of a point on rays and arcs.

    Parameters
    ----------
    origin, towards : ndarray, shape (n, 2)
        Origins and directions of the rays.
    centre : ndarray, shape (m, 2)
    radius : ndarray, shape (m,)
    controlled : bool
        Whether the best position must be better than all others.

    Returns
    -------
    ndarray, shape (2,), or None
    """
    rays, arcs = _few(len(origin)), _few(len(centre))
    intersections = [_crossing(origin[[i, j]], towards[[i, j]]) for i, j in combinations(rays, 2)]
    intersections += [_cut(origin[i], towards[i], centre[j], radius[j]) for i in rays for j in arcs]
    intersections += [_arc_cuts(centre[[i, j]], radius[[i, j]]) for i, j in combinations(arcs, 2)]
    intersections = np.concatenate([np.zeros((0, 2)), *intersections])
    if not len(intersections):
        return None
    d = intersections[:, None] - origin[None]
    along = np.einsum("kni,ni->kn", d, towards)
    across = np.abs(d[..., 0] * towards[:, 1] - d[..., 1] * towards[:, 0])
    away = np.linalg.norm(d, axis=-1)
    of_arcs = np.linalg.norm(intersections[:, None] - centre[None], axis=-1)
    # Behind the origin of a ray the misfit is the whole distance.
    misfit = np.where(along > 0, across, away).sum(axis=1)
    misfit = misfit + np.abs(of_arcs - radius).sum(axis=1)
    return choose_place(intersections, misfit, np.median(np.hstack([away, of_arcs])), controlled)


def choose_place(places, misfit, size, controlled=False):
    """The position with the smallest misfit, or None if another fits equally well.

    Parameters
    ----------
    places : ndarray, shape (k, 2 or more)
    misfit : ndarray, shape (k,)
    size : float
        Typical length of the sights.
    controlled : bool
        True: the best position must be clearly better than all others; False: it is enough that not
        all fit.
    """
    best = int(np.argmin(misfit))
    limit = NOISE * size + (RIVAL * misfit[best] if controlled else 0.0)
    elsewhere = np.linalg.norm(places[:, :2] - places[best, :2], axis=1) > APART * size
    return None if (elsewhere & (misfit <= limit)).any() else places[best]


def _few(count):
    """At most MOST evenly spaced indices."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(int)) if count else []


def _crossing(origin, towards):
    """Intersection of two rays (0 or 1, 2)."""
    sine = towards[0, 0] * towards[1, 1] - towards[0, 1] * towards[1, 0]
    if abs(sine) < THIN:
        return np.zeros((0, 2))
    d = origin[1] - origin[0]
    along = (d[0] * towards[1, 1] - d[1] * towards[1, 0]) / sine
    return (origin[0] + along * towards[0])[None]


def _cut(origin, towards, centre, radius):
    """Intersections of a ray and an arc (0 to 2, 2)."""
    d = origin - centre
    middle = -float(d @ towards)
    square = radius**2 - (float(d @ d) - middle**2)
    # A ray that just misses the arc, within measuring errors, touches it.
    if square < -(0.05 * radius**2):
        return np.zeros((0, 2))
    half = np.sqrt(max(square, 0.0))
    along = np.array([middle + half, middle - half])
    return origin + along[along > 0, None] * towards


def _arc_cuts(centre, radius):
    """Intersections of two arcs (0 or 2, 2)."""
    d = centre[1] - centre[0]
    base = float(np.hypot(*d))
    if base < THIN * radius.max():
        return np.zeros((0, 2))
    along = (base**2 + radius[0] ** 2 - radius[1] ** 2) / (2 * base)
    square = radius[0] ** 2 - along**2
    if square < -0.05 * radius.max() ** 2:
        return np.zeros((0, 2))
    u, side = d / base, np.sqrt(max(square, 0.0))
    across = np.array([-u[1], u[0]])
    return centre[0] + along * u + np.array([[side], [-side]]) * across


def _place_stations(plan, xy, lengths, required, wanted, strict):
    """Compute wanted stations by free stationing and resection; updates xy in place."""
    known = np.isfinite(xy[:, 0])
    rows = np.flatnonzero(known[plan.target] & wanted[plan.station] & ~plan.north[plan.circle])
    circles, count = np.unique(plan.circle[rows], return_counts=True)
    is_placed = np.zeros(len(xy), dtype=bool)
    for circle in circles[np.argsort(-count, kind="stable")]:
        station = plan.at[circle]
        rows_of_circle = rows[plan.circle[rows] == circle]
        if is_placed[station] or len(rows_of_circle) < required:
            continue
        target = plan.target[rows_of_circle]
        length = look_up(*lengths, plan.pairs(plan.station[rows_of_circle], target))
        position = free_station(xy[target], plan.reading[rows_of_circle], length, strict)
        if position is not None:
            xy[station], is_placed[station] = position, True


def free_station(targets, readings, lengths, controlled=False):
    """Position of an instrument from sights to known targets.

    Parameters
    ----------
    targets : ndarray, shape (n, 2)
    readings : ndarray, shape (n,)
        Rad, on a circle with unknown zero.
    lengths : ndarray, shape (n,)
        m; nan: not measured.
    controlled : bool
        See `choose_place`.

    Returns
    -------
    ndarray, shape (2,), or None
    """
    few = _few(len(targets))
    triples = np.array(list(combinations(few, 3)), dtype=int).reshape(-1, 3)
    poses = [_poses_from_three(targets[triples], readings[triples])]
    taped = [i for i in few if np.isfinite(lengths[i])]
    poses += [_pose_from_two(targets[[i, j]], readings[[i, j]], lengths[[i, j]])
              for i, j in combinations(taped, 2)]  # fmt: skip
    poses += [_poses_from_angle(targets[[i, j]], readings[[i, j]], lengths[i])
              for i in taped for j in few if not np.isfinite(lengths[j])]  # fmt: skip
    poses = np.concatenate(poses)
    poses = poses[np.isfinite(poses).all(axis=1)]
    if not len(poses):
        return None
    d = targets[None] - poses[:, None, :2]
    away = np.linalg.norm(d, axis=-1)
    turn = _wrap_angles(np.arctan2(d[..., 0], d[..., 1]) - readings - poses[:, 2:])
    # Angular misfits become lengths at the distance of the target, comparable with distances.
    misfit = (away * np.abs(turn)).sum(axis=1) + np.nansum(np.abs(away - lengths), axis=1)
    best = choose_place(poses, misfit, np.median(away), controlled)
    return None if best is None else best[:2]


def _poses_from_three(targets, readings):
    """Poses (k, 3) x, y, zero from directions to triples of targets.

    With a, b = cos, sin of the zero, P = x a - y b and Q = x b + y a, each direction is linear: a
    (X cos - Y sin) - b (X sin + Y cos) - P cos + Q sin = 0. A triple gives no pose if the station
    lies on the circle through its targets.

    Parameters
    ----------
    targets : ndarray, shape (t, 3, 2)
    readings : ndarray, shape (t, 3)
    """
    s, c = np.sin(readings), np.cos(readings)
    middle = targets.mean(axis=1)
    x, y = np.moveaxis(targets - middle[:, None], -1, 0)
    # Coordinates in units of the triple's size give all columns a norm of about 1.
    size = np.maximum(np.maximum(np.abs(x), np.abs(y)).max(axis=1), 1e-9)[:, None]
    rows = np.stack([(x * c - y * s) / size, -(x * s + y * c) / size, -c, s], axis=-1)
    _, singular, v = np.linalg.svd(rows)
    a, b, p, q = v[:, 3].T
    square = a * a + b * b
    is_valid = (singular[:, 2] >= 1e-4 * singular[:, 0]) & (square >= 1e-12)
    a, b, p, q, square = a[is_valid], b[is_valid], p[is_valid], q[is_valid], square[is_valid]
    xy = size[is_valid] * np.stack([p * a + q * b, q * a - p * b], axis=-1) / square[:, None]
    zero = np.arctan2(b, a)
    # The null vector has an arbitrary sign; the wrong sign puts the targets behind the telescope.
    turned = readings[is_valid] + zero[:, None]
    ahead = np.stack([np.sin(turned), np.cos(turned)], axis=-1)
    offsets = targets[is_valid] - middle[is_valid, None] - xy[:, None]
    zero[np.sum(offsets * ahead, axis=(1, 2)) < 0] += np.pi
    return np.column_stack([xy + middle[is_valid], zero])


def _pose_from_two(targets, readings, lengths):
    """Pose (0 or 1, 3) from directions and lengths to two targets."""
    local = lengths[:, None] * np.column_stack([np.sin(readings), np.cos(readings)])
    base, local_base = targets[1] - targets[0], local[1] - local[0]
    if min(np.hypot(*base), np.hypot(*local_base)) < THIN * lengths.max():
        return np.zeros((0, 3))
    zero = np.arctan2(*base) - np.arctan2(*local_base)
    ahead = lengths[:, None] * np.column_stack([np.sin(readings + zero), np.cos(readings + zero)])
    return np.array([[*(targets - ahead).mean(axis=0), zero]])


def _poses_from_angle(targets, readings, length):
    """Poses (k, 3) from directions to two targets and the length to the first."""
    angle = _wrap_angles(readings[1] - readings[0])
    d = targets[1] - targets[0]
    base = np.hypot(*d)
    if abs(np.sin(angle)) < THIN or base < THIN * length:
        return np.zeros((0, 3))
    middle, across = targets.mean(axis=0), np.array([-d[1], d[0]])
    positions = []
    # The locus of a constant angle over the base is two circles (inscribed angle theorem).
    for side in (1.0, -1.0):
        centre = middle + side * across / (2 * np.tan(angle))
        radius = base / (2 * abs(np.sin(angle)))
        positions.append(_arc_cuts(np.stack([targets[0], centre]), np.array([length, radius])))
    xy = np.concatenate(positions)
    first = np.arctan2(*(targets[0] - xy).T)
    second = np.arctan2(*(targets[1] - xy).T)
    # Only one arc of each circle has the measured angle; the other has its supplement.
    right = np.abs(_wrap_angles(second - first - angle)) < 0.05
    return np.column_stack([xy, first - readings[0]])[right]
