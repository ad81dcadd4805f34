"""How positions in plan grow from known ones: polar, intersection, arcs, free stationing, traverse.

A point is where two lines, a line and an arc, or two arcs from known points meet; of all such
places the one with the smallest sum of misfits to everything that is known of the point wins. A
point that could as well stand elsewhere waits. What is controlled comes before what is not.
"""

from itertools import combinations

import numpy as np

from tankcal.survey.start.plan import look_up

MOST = 8  # sights of a point or station that are combined; all of them judge
IMPROVING = 4  # rounds in which all positions are found again
STILL_M = 1e-3  # movement of all positions below which they stay
THIN = 0.02  # sine of the angle at which lines must meet at least
APART = 0.02  # places of a point farther apart than this share of its sights are two
RIVAL = 2.0  # a second place counts when its misfit is below this multiple of the best one's
NOISE = 1e-3  # misfit that says nothing, as a share of the sights


def grow_in_plan(plan, xy_m, z_m, north=True):
    """Positions (points, 2) in plan with all that follow from the known ones.

    xy_m   (points, 2) nan where not known      z_m  (points,) nan where not known
    north  whether the frame's +y is the zero of azimuths
    """
    xy, lengths = xy_m.copy(), plan.lengths(z_m)
    needed = 3
    while True:
        waiting = np.isnan(xy[:, 0])
        zeros = orient_circles(plan, xy, north)
        _place_points(plan, xy, zeros, lengths, needed, waiting, needed > 2)
        _place_stations(plan, xy, lengths, needed, waiting & np.isnan(xy[:, 0]), needed > 2)
        if np.isnan(xy[:, 0]).sum() < waiting.sum():
            needed = 3
        elif needed == 3:
            needed = 2
        else:
            return xy


def orient_circles(plan, xy_m, north=True):
    """Azimuths (circles,) of the zeros: the one that most known targets agree with, or nan."""
    d = xy_m[plan.target] - xy_m[plan.station]
    zero = np.arctan2(d[:, 0], d[:, 1]) - plan.reading
    zeros = np.full(len(plan.north), np.nan)
    good = np.flatnonzero(np.isfinite(zero))
    good = good[np.argsort(plan.circle[good], kind="stable")]
    circles, first = np.unique(plan.circle[good], return_index=True)
    for circle, rows in zip(circles, np.split(good, first[1:])[: len(circles)], strict=True):
        mine = zero[rows]
        tried = mine[:: max(1, len(mine) // 50)]
        off = np.abs(_wrapped(mine[None] - tried[:, None])).sum(axis=1)
        zeros[circle] = _wrapped(tried[np.argmin(off)])
    return np.where(plan.north, 0.0, zeros) if north else zeros


def _wrapped(angle):
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def improved_in_plan(plan, xy_m, z_m, held, north=True):
    """Positions (points, 2) in plan, each found again from the others: blunders are outvoted.

    held  (points,) True for positions that stay
    """
    xy, lengths = xy_m.copy(), plan.lengths(z_m, heights_first=True)
    occupied = np.zeros(len(xy), dtype=bool)
    occupied[plan.at[plan.at >= 0]] = True
    free = np.isfinite(xy[:, 0]) & ~held
    for _ in range(IMPROVING):
        zeros, before = orient_circles(plan, xy, north), xy.copy()
        doubtful = free & ~occupied & _disagreeing(plan, xy, zeros, lengths, free)
        _place_points(plan, xy, zeros, lengths, 3, doubtful, False)
        _place_stations(plan, xy, lengths, 3, free & occupied, False)
        if np.nanmax(np.abs(xy - before), initial=0.0) < STILL_M:
            break
    return xy


def _disagreeing(plan, xy, zeros, lengths, wanted):
    """(points,) True for points that some of their sights miss by more than noise."""
    owner, origin, towards = _rays(plan, xy, zeros, wanted)
    d = xy[owner] - origin
    off = np.abs(d[:, 0] * towards[:, 1] - d[:, 1] * towards[:, 0])
    off = np.where(np.sum(d * towards, axis=1) > 0, off, np.inf)
    bad = off > NOISE * np.linalg.norm(d, axis=1)
    of_arc, centre, radius = _arcs(plan, xy, lengths, wanted)
    wrong = np.abs(np.linalg.norm(xy[of_arc] - centre, axis=1) - radius) > NOISE * radius
    found = np.zeros(len(xy), dtype=bool)
    found[owner[bad]] = True
    found[of_arc[wrong]] = True
    return found


def _place_points(plan, xy, zeros, lengths, needed, wanted, strict):
    """Write the places of points (points,) that are wanted and have as many sights as needed."""
    owner, origin, towards = _rays(plan, xy, zeros, wanted)
    of_arc, centre, radius = _arcs(plan, xy, lengths, wanted)
    count = np.bincount(np.concatenate([owner, of_arc]), minlength=len(xy))
    by_owner, by_arc = np.argsort(owner, kind="stable"), np.argsort(of_arc, kind="stable")
    edges = np.arange(len(xy) + 1)
    rays_at = np.searchsorted(owner[by_owner], edges)
    arcs_at = np.searchsorted(of_arc[by_arc], edges)
    for point in np.flatnonzero(wanted & (count >= needed)):
        rays = by_owner[rays_at[point] : rays_at[point + 1]]
        arcs = by_arc[arcs_at[point] : arcs_at[point + 1]]
        found = place(origin[rays], towards[rays], centre[arcs], radius[arcs], strict)
        if found is not None:
            xy[point] = found


def _rays(plan, xy, zeros, wanted):
    """Rays to points that are wanted: point (n,), origin (n, 2), direction (n, 2)."""
    azimuth = plan.reading + zeros[plan.circle]
    known, able = np.isfinite(xy[:, 0]), np.isfinite(azimuth)
    ahead = np.flatnonzero(able & known[plan.station] & wanted[plan.target])
    north = plan.north[plan.circle] & able
    back = np.flatnonzero(north & known[plan.target] & wanted[plan.station])
    azimuth = np.concatenate([azimuth[ahead], azimuth[back] + np.pi])
    owner = np.concatenate([plan.target[ahead], plan.station[back]])
    origin = np.concatenate([xy[plan.station[ahead]], xy[plan.target[back]]])
    return owner, origin, np.column_stack([np.sin(azimuth), np.cos(azimuth)])


def _arcs(plan, xy, lengths, wanted):
    """Arcs on which points that are wanted lie: point (n,), centre (n, 2), radius (n,)."""
    low, high = np.divmod(lengths[0], plan.points)
    known = np.isfinite(xy[:, 0])
    up, down = known[low] & wanted[high], known[high] & wanted[low]
    owner = np.concatenate([high[up], low[down]])
    centre = np.concatenate([xy[low[up]], xy[high[down]]])
    return owner, centre, np.concatenate([lengths[1][up], lengths[1][down]])


def place(origin, towards, centre, radius, controlled=False):
    """Where a point stands (2,) that lies on rays (n, 2), (n, 2) and arcs (m, 2), (m,), or None."""
    rays, arcs = _few(len(origin)), _few(len(centre))
    found = [_crossing(origin[[i, j]], towards[[i, j]]) for i, j in combinations(rays, 2)]
    found += [_cut(origin[i], towards[i], centre[j], radius[j]) for i in rays for j in arcs]
    found += [_arc_cuts(centre[[i, j]], radius[[i, j]]) for i, j in combinations(arcs, 2)]
    found = np.concatenate([np.zeros((0, 2)), *found])
    if not len(found):
        return None
    d = found[:, None] - origin[None]
    along = np.einsum("kni,ni->kn", d, towards)
    across = np.abs(d[..., 0] * towards[:, 1] - d[..., 1] * towards[:, 0])
    away = np.linalg.norm(d, axis=-1)
    of_arcs = np.linalg.norm(found[:, None] - centre[None], axis=-1)
    misfit = np.where(along > 0, across, away).sum(axis=1)
    misfit = misfit + np.abs(of_arcs - radius).sum(axis=1)
    return choose_place(found, misfit, np.median(np.hstack([away, of_arcs])), controlled)


def choose_place(places, misfit, size, controlled=False):
    """The place with the smallest misfit, or None when another one fits as well.

    places (k, 2 or more), misfit (k,), size of the sights; where `controlled` the best must stand
    out, else it is enough that they do not all fit
    """
    best = int(np.argmin(misfit))
    limit = NOISE * size + (RIVAL * misfit[best] if controlled else 0.0)
    elsewhere = np.linalg.norm(places[:, :2] - places[best, :2], axis=1) > APART * size
    return None if (elsewhere & (misfit <= limit)).any() else places[best]


def _few(count):
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(int)) if count else []


def _crossing(origin, towards):
    """Where two rays cross (0 or 1, 2)."""
    sine = towards[0, 0] * towards[1, 1] - towards[0, 1] * towards[1, 0]
    if abs(sine) < THIN:
        return np.zeros((0, 2))
    d = origin[1] - origin[0]
    along = (d[0] * towards[1, 1] - d[1] * towards[1, 0]) / sine
    return (origin[0] + along * towards[0])[None]


def _cut(origin, towards, centre, radius):
    """Where a ray cuts an arc (0 to 2, 2)."""
    d = origin - centre
    middle = -float(d @ towards)
    square = radius**2 - (float(d @ d) - middle**2)
    if square < -(0.05 * radius**2):
        return np.zeros((0, 2))
    half = np.sqrt(max(square, 0.0))
    along = np.array([middle + half, middle - half])
    return origin + along[along > 0, None] * towards


def _arc_cuts(centre, radius):
    """Where two arcs cut (0 or 2, 2)."""
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


def _place_stations(plan, xy, lengths, needed, wanted, strict):
    """Write the places of stations that are wanted: free stationing, resection."""
    known = np.isfinite(xy[:, 0])
    rows = np.flatnonzero(known[plan.target] & wanted[plan.station] & ~plan.north[plan.circle])
    circles, count = np.unique(plan.circle[rows], return_counts=True)
    done = np.zeros(len(xy), dtype=bool)
    for circle in circles[np.argsort(-count, kind="stable")]:
        station = plan.at[circle]
        mine = rows[plan.circle[rows] == circle]
        if done[station] or len(mine) < needed:
            continue
        target = plan.target[mine]
        length = look_up(*lengths, plan.pairs(plan.station[mine], target))
        found = free_station(xy[target], plan.reading[mine], length, strict)
        if found is not None:
            xy[station], done[station] = found, True


def free_station(targets, readings, lengths, controlled=False):
    """Where an instrument stands (2,) that sees known targets (n, 2), or None.

    readings  (n,) rad on a circle with unknown zero      lengths  (n,) m, nan where not measured
    """
    few = _few(len(targets))
    triples = np.array(list(combinations(few, 3)), dtype=int).reshape(-1, 3)
    poses = [_poses_from_three(targets[triples], readings[triples])]
    taped = [i for i in few if np.isfinite(lengths[i])]
    poses += [_from_two(targets[[i, j]], readings[[i, j]], lengths[[i, j]])
              for i, j in combinations(taped, 2)]  # fmt: skip
    poses += [_from_angle(targets[[i, j]], readings[[i, j]], lengths[i])
              for i in taped for j in few if not np.isfinite(lengths[j])]  # fmt: skip
    poses = np.concatenate(poses)
    poses = poses[np.isfinite(poses).all(axis=1)]
    if not len(poses):
        return None
    d = targets[None] - poses[:, None, :2]
    away = np.linalg.norm(d, axis=-1)
    turn = _wrapped(np.arctan2(d[..., 0], d[..., 1]) - readings - poses[:, 2:])
    misfit = (away * np.abs(turn)).sum(axis=1) + np.nansum(np.abs(away - lengths), axis=1)
    found = choose_place(poses, misfit, np.median(away), controlled)
    return None if found is None else found[:2]


def _poses_from_three(targets, readings):
    """Poses (k, 3) x, y, zero from directions (t, 3) to the triples of targets (t, 3, 2).

    With a, b = cos, sin of the zero, P = x a - y b and Q = x b + y a each direction is linear:
    a (X cos - Y sin) - b (X sin + Y cos) - P cos + Q sin = 0. A triple gives no pose where the
    station lies on a circle with its targets.
    """
    s, c = np.sin(readings), np.cos(readings)
    middle = targets.mean(axis=1)
    x, y = np.moveaxis(targets - middle[:, None], -1, 0)
    # coordinates in units of the triple's size, so that all columns have a size of about 1
    size = np.maximum(np.maximum(np.abs(x), np.abs(y)).max(axis=1), 1e-9)[:, None]
    rows = np.stack([(x * c - y * s) / size, -(x * s + y * c) / size, -c, s], axis=-1)
    _, singular, v = np.linalg.svd(rows)
    a, b, p, q = v[:, 3].T
    square = a * a + b * b
    kept = (singular[:, 2] >= 1e-4 * singular[:, 0]) & (square >= 1e-12)
    a, b, p, q, square = a[kept], b[kept], p[kept], q[kept], square[kept]
    xy = size[kept] * np.stack([p * a + q * b, q * a - p * b], axis=-1) / square[:, None]
    zero = np.arctan2(b, a)
    # a and b may both have the wrong sign: then the targets are behind the telescope
    turned = readings[kept] + zero[:, None]
    ahead = np.stack([np.sin(turned), np.cos(turned)], axis=-1)
    offsets = targets[kept] - middle[kept, None] - xy[:, None]
    zero[np.sum(offsets * ahead, axis=(1, 2)) < 0] += np.pi
    return np.column_stack([xy + middle[kept], zero])


def _from_two(targets, readings, lengths):
    """Pose (0 or 1, 3) from directions and lengths to two targets."""
    local = lengths[:, None] * np.column_stack([np.sin(readings), np.cos(readings)])
    there, here = targets[1] - targets[0], local[1] - local[0]
    if min(np.hypot(*there), np.hypot(*here)) < THIN * lengths.max():
        return np.zeros((0, 3))
    zero = np.arctan2(*there) - np.arctan2(*here)
    ahead = lengths[:, None] * np.column_stack([np.sin(readings + zero), np.cos(readings + zero)])
    return np.array([[*(targets - ahead).mean(axis=0), zero]])


def _from_angle(targets, readings, length):
    """Poses (k, 3) from directions to two targets and the length to the first."""
    angle = _wrapped(readings[1] - readings[0])
    d = targets[1] - targets[0]
    base = np.hypot(*d)
    if abs(np.sin(angle)) < THIN or base < THIN * length:
        return np.zeros((0, 3))
    middle, across = targets.mean(axis=0), np.array([-d[1], d[0]])
    found = []
    for side in (1.0, -1.0):  # the station sees the base under the angle from two circles
        centre = middle + side * across / (2 * np.tan(angle))
        radius = base / (2 * abs(np.sin(angle)))
        found.append(_arc_cuts(np.stack([targets[0], centre]), np.array([length, radius])))
    xy = np.concatenate(found)
    first = np.arctan2(*(targets[0] - xy).T)
    second = np.arctan2(*(targets[1] - xy).T)
    right = np.abs(_wrapped(second - first - angle)) < 0.05
    return np.column_stack([xy, first - readings[0]])[right]
