"""Local frames in plan without known points, also from distances only.

Positions from distances only: shortest paths complete the distance matrix, scaling solves it.

Classical scaling of the matrix of shortest paths gives a start for damped Gauss-Newton on the
measured distances. Source: Torgerson 1952; Shang et al. 2003 (MDS-MAP).

A traverse between two known points has no known direction; a network without control has no known
point. Each starts with a station at the origin and its first direction towards +y and grows. It is
then rotated and shifted onto the known positions, and scaled if it contains no measured length.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, shortest_path

from tankcal.adjust import Damping, gauss_newton
from tankcal.survey.start.polar import grow_in_plan, look_up, orient_circles

MOST = 400  # points of a network of distances
TRIES = 12
STEPS = 80
UNFOLDING = 10
MISFIT = 0.01  # relative misfit that most distances must meet
LOOSE = 1e-5  # relative singular value of a motion that no distance determines
FLAT = 1e-2  # relative thickness below which neighbours lie on a line or in a plane


def lay_out_networks(low, high, length, dims, rng):
    """Yield points (k,) and places (k, dims) of each rigid network of distances.

    The places have a frame of their own and may be mirrored. Points whose neighbours lie on a line
    (in a plane) could be reflected and are omitted.

    Parameters
    ----------
    low, high : ndarray of int, shape (n,)
        Points of each distance.
    length : ndarray, shape (n,)
        Distances, m.
    dims : int
        2 or 3.
    rng : numpy.random.Generator
    """
    points, ends = np.unique(np.concatenate([low, high]), return_inverse=True)
    a, b = ends[: len(low)], ends[len(low) :]
    graph = coo_array((length, (a, b)), shape=(len(points),) * 2)
    count, label = connected_components(graph, directed=False)
    for network in range(count):
        nodes = np.flatnonzero(label == network)
        if not dims < len(nodes) <= MOST:
            continue
        nodes = _well_tied(nodes, a, b, dims)
        rows = np.isin(a, nodes) & np.isin(b, nodes)
        if len(nodes) <= dims:
            continue
        place = np.full(len(points), -1)
        place[nodes] = np.arange(len(nodes))
        places = _place_network(place[a[rows]], place[b[rows]], length[rows], len(nodes), dims, rng)
        if places is not None:
            firm = _firm(places, place[a[rows]], place[b[rows]], dims)
            yield points[nodes[firm]], places[firm]


def _well_tied(nodes, a, b, dims):
    """Nodes with at least `dims` distances to one another."""
    while True:
        inside = np.isin(a, nodes) & np.isin(b, nodes)
        count = np.bincount(np.concatenate([a[inside], b[inside]]), minlength=nodes.max() + 1)
        remaining = nodes[count[nodes] >= dims]
        # Removing a node may weaken its neighbours, so repeat.
        if len(remaining) == len(nodes) or not len(remaining):
            return remaining
        nodes = remaining


def _place_network(a, b, length, n, dims, rng):
    """Places (n, dims) that fit the distances, or None."""
    graph = coo_array((length, (a, b)), shape=(n, n)).tocsr()
    ways = shortest_path(graph, directed=False)
    if not np.isfinite(ways).all():
        return None
    middle = np.eye(n) - 1 / n
    # Double centring turns squared distances into scalar products; their eigenvectors are the
    # places.
    values, vectors = np.linalg.eigh(-0.5 * middle @ ways**2 @ middle)
    start = vectors[:, -dims:] * np.sqrt(np.maximum(values[-dims:], 0.0))
    for trial in range(TRIES):
        shake = 0.0 if not trial else 0.3 * np.median(length)
        xyz = _fit_places(start + shake * rng.normal(size=start.shape), a, b, length)
        xyz = _unfold(xyz, a, b, length)
        off = np.abs(np.linalg.norm(xyz[a] - xyz[b], axis=1) - length)
        # 80 % of the distances must fit: blunders may remain.
        keep = np.sort(off / length)[min(len(off) - 1, int(0.8 * len(off)))]
        if keep < MISFIT:
            return xyz if _rigid(xyz, a, b) else None
    return None


def _unfold(xyz, a, b, length):
    """Move points on the wrong side to the position that fits their neighbours."""
    for _ in range(UNFOLDING):
        off = np.abs(np.linalg.norm(xyz[a] - xyz[b], axis=1) - length) / length
        worst = np.array([np.median(off[(a == i) | (b == i)]) for i in range(len(xyz))])
        node = int(np.argmax(worst))
        if worst[node] < MISFIT:
            break
        near = np.concatenate([b[a == node], a[b == node]])
        away = np.concatenate([length[a == node], length[b == node]])
        middle = xyz[near].mean(axis=0)
        # Differences of the circle equations are linear in the position.
        rows = 2 * (xyz[near] - middle)
        right = np.sum((xyz[near] - middle) ** 2, axis=1) - away**2
        moved = xyz.copy()
        moved[node] = middle + np.linalg.lstsq(rows, right - right.mean(), rcond=None)[0]
        moved = _fit_places(moved, a, b, length)
        new = np.abs(np.linalg.norm(moved[a] - moved[b], axis=1) - length) / length
        if not new.sum() < off.sum():
            break
        xyz = moved
    return xyz


def _distances(xyz, a, b):
    """Distances (n,) between places, above zero for the derivatives."""
    return np.maximum(np.linalg.norm(xyz[a] - xyz[b], axis=1), 1e-12)


def _distance_derivatives(xyz, a, b):
    """Derivatives (n, points dims) of distances, and the distances (n,)."""
    d, s = xyz[a] - xyz[b], _distances(xyz, a, b)
    jac = np.zeros((len(a), *xyz.shape))
    rows = np.arange(len(a))
    jac[rows, a] = d / s[:, None]
    jac[rows, b] = -d / s[:, None]
    return jac.reshape(len(a), -1), s


def _fit_places(xyz, a, b, length):
    """Places after damped Gauss-Newton steps with Cauchy weights beyond the median misfit."""

    def scale_of(off):
        return max(3 * float(np.median(np.abs(off))), 1e-9 * float(length.max()))

    def step_at(xyz, damping):
        jac, distance = _distance_derivatives(xyz, a, b)
        off = distance - length
        weight = 1 / (1 + (off / scale_of(off)) ** 2)
        normal = (jac * weight[:, None]).T @ jac
        gradient = jac.T @ (weight * off)
        return -np.linalg.solve(normal + damping * np.eye(len(normal)), gradient)

    def is_better(candidate, xyz):
        off, new = (_distances(places, a, b) - length for places in (xyz, candidate))
        # Both costs refer to one scale; otherwise a larger scale would seem to reduce the cost.
        scale = scale_of(off)
        old_cost, new_cost = (float(np.sum(np.log1p((v / scale) ** 2))) for v in (off, new))
        return new_cost < old_cost

    return gauss_newton(
        step_at,
        xyz,
        move=lambda xyz, step: xyz + step.reshape(xyz.shape),
        is_better=is_better,
        is_small=lambda step: np.abs(step).max() < 1e-9 * length.max(),
        most_steps=STEPS,
        damping=Damping(relax=5.0, most=1e6),
    )


def _rigid(xyz, a, b):
    """Whether the distances determine the shape of the network."""
    n, dims = xyz.shape
    singular = np.linalg.svd(_distance_derivatives(xyz, a, b)[0], compute_uv=False)
    # All coordinates except the rigid motions, dims (dims + 1) / 2.
    rank = n * dims - dims * (dims + 1) // 2
    return len(singular) >= rank and singular[rank - 1] > LOOSE * singular[0]


def _firm(xyz, a, b, dims):
    """Mask (n,) of points that cannot be reflected at the line or plane of their neighbours."""
    n = len(xyz)
    firm = np.ones(n, dtype=bool)
    if n <= dims + 1:
        return firm  # reflecting a triangle or a tetrahedron only mirrors it
    for node in range(n):
        near = np.concatenate([b[a == node], a[b == node]])
        spread = np.linalg.svd(xyz[near] - xyz[near].mean(axis=0), compute_uv=False)
        firm[node] = len(spread) >= dims and spread[dims - 1] > FLAT * spread[0]
    return firm


PLAN_FRAME_MISFIT = 0.05  # relative misfit of a joint over the distance of its points
PAIRS = 60  # pairs of common points tried


@dataclass(frozen=True)
class Local:
    """A local frame: xy_m (points, 2); whether it has a scale, a north direction, and may be
    mirrored."""

    xy_m: np.ndarray
    scaled: bool
    north: bool
    mirrored: bool = False

    @property
    def known(self):
        """Mask (points,), True where the position is known."""
        return np.isfinite(self.xy_m[:, 0])


def find_plan_positions(plan, xy_m, z_m, rng):
    """Compute positions in plan, and the local frames that could not be joined to them.

    Parameters
    ----------
    plan : Plan
    xy_m : ndarray, shape (points, 2)
        nan: unknown; without a known point the largest local frame is used.
    z_m : ndarray, shape (points,)
        nan: unknown.
    rng : numpy.random.Generator

    Returns
    -------
    xy_m : ndarray, shape (points, 2)
    locals : list of Local
    """
    main = Local(xy_m, True, True)
    while True:
        if main.known.any():
            # Lengths would contradict a frame with an arbitrary scale.
            plain = plan if main.scaled else _remove_lengths(plan)
            main = replace(main, xy_m=grow_in_plan(plain, main.xy_m, z_m, main.north))
        pieces = _locals(plan, main, z_m, rng)
        if not main.known.any() and pieces:
            pieces.sort(key=_size)
            main = pieces.pop()
            main = replace(main, mirrored=False)
            continue
        unjoined, before = [], main.known.sum()
        for piece in _merge_frames(pieces):
            joined = _join(piece, main)
            if joined is None:
                unjoined.append(piece)
            else:
                main = joined
        if main.known.sum() == before:
            return main.xy_m, unjoined


def _remove_lengths(plan):
    """The Plan without distances."""
    none = slice(0, 0)
    return replace(
        plan, start=plan.start[none], end=plan.end[none], length=plan.length[none],
        flat=plan.flat[none], rise=plan.rise[none],
    )  # fmt: skip


def _locals(plan, main, z_m, rng):
    """Local frames of points unknown in the main frame."""
    lengths = plan.lengths(z_m)
    zeros = orient_circles(plan, main.xy_m, main.north)
    waiting = np.isnan(zeros) | ~main.known[np.maximum(plan.at, 0)]
    is_used, frames = np.zeros(len(plan.north), dtype=bool), []
    for circle, first, second, base in _seeds(plan, lengths, waiting & (plan.at >= 0)):
        if is_used[circle]:
            continue
        local = _grown(plan, z_m, plan.at[circle], second, base)
        is_oriented = np.isfinite(orient_circles(plan, local.xy_m, False)) & local.known[plan.at]
        is_used |= is_oriented
        # A frame of two points adds nothing to others.
        if local.known.sum() > 2 or not frames:
            frames.append(local)
        del first
    return frames + _frames_of_distances(plan, main, lengths, rng)


def _seeds(plan, lengths, waiting):
    """Yield circle, station, target and length (nan: none) of starts, most lengths first.

    Without a length, the target must observe the station.
    """
    length = look_up(*lengths, plan.pairs(plan.station, plan.target))
    sights = set(zip(plan.station.tolist(), plan.target.tolist(), strict=True))
    # The small constant prefers circles with more directions among equal numbers of lengths.
    taped = np.bincount(plan.circle, weights=np.isfinite(length) + 1e-3, minlength=len(plan.north))
    for circle in np.argsort(-taped, kind="stable"):
        if not waiting[circle]:
            continue
        rows = np.flatnonzero(plan.circle == circle)
        with_length = rows[np.isfinite(length[rows])]
        if len(with_length):
            row = with_length[0]
            yield circle, plan.station[row], plan.target[row], float(length[row])
            continue
        back = [row for row in rows if (plan.target[row], plan.station[row]) in sights]
        if back:
            yield circle, plan.station[back[0]], plan.target[back[0]], np.nan


def _grown(plan, z_m, first, second, base):
    """Grow a Local from two points, one at the origin, the other towards +y."""
    xy = np.full((plan.points, 2), np.nan)
    xy[first], xy[second] = 0.0, (0.0, 1.0 if np.isnan(base) else base)
    if np.isnan(base):
        xy = grow_in_plan(_remove_lengths(plan), xy, z_m, north=False)
        pair, length = plan.lengths(z_m)
        low, high = np.divmod(pair, plan.points)
        ratio = length / np.linalg.norm(xy[low] - xy[high], axis=1)
        if not np.isfinite(ratio).any():
            return _north_up(plan, Local(xy, False, False))
        # Measured lengths give the scale afterwards; the median is robust.
        xy = xy * np.nanmedian(ratio)
    xy = grow_in_plan(plan, xy, z_m, north=False)
    return _north_up(plan, Local(xy, True, False))


def _north_up(plan, local):
    """Rotate a Local so that its azimuths count from +y, if it has azimuths."""
    zeros = orient_circles(plan, local.xy_m, False)[plan.north]
    zeros = zeros[np.isfinite(zeros)]
    if not len(zeros):
        return local
    turn = np.median(np.angle(np.exp(1j * (zeros - zeros[0])))) + zeros[0]
    return replace(local, xy_m=local.xy_m @ _turning(-turn).T, north=True)


def _turning(angle):
    """Matrix (2, 2) that adds an angle to azimuths."""
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[c, s], [-s, c]])


def _frames_of_distances(plan, main, lengths, rng):
    """Local frames of points connected by distances, including distances to known points."""
    low, high = np.divmod(lengths[0], plan.points)
    open_ended = ~(main.known[low] & main.known[high])
    if not open_ended.any() or np.isin(low, plan.station).any():
        return []
    tied = np.unique(np.concatenate([low[open_ended], high[open_ended]]))
    firm = tied[main.known[tied]]
    sides = np.array(list(combinations(firm, 2)), dtype=int).reshape(-1, 2)
    between = np.linalg.norm(main.xy_m[sides[:, 0]] - main.xy_m[sides[:, 1]], axis=1)
    start = np.concatenate([low[open_ended], sides[:, 0]])
    end = np.concatenate([high[open_ended], sides[:, 1]])
    length = np.concatenate([lengths[1][open_ended], between])
    frames = []
    for points, places in lay_out_networks(start, end, length, 2, rng):
        xy = np.full((plan.points, 2), np.nan)
        xy[points] = places
        frames.append(Local(xy, True, False, mirrored=True))
    return frames


def _size(piece):
    """Sort key: scaled frames first, then by number of points."""
    return piece.scaled, piece.known.sum()


def _merge_frames(pieces):
    """Local frames joined with each other where possible, the largest first."""
    pieces = sorted(pieces, key=_size, reverse=True)
    merged = []
    while pieces:
        main, rest = pieces[0], pieces[1:]
        grown = True
        while grown:
            grown, unjoined = False, []
            for piece in rest:
                joined = None if main.mirrored else _join(piece, main)
                main, grown = (main, grown) if joined is None else (joined, True)
                unjoined += [piece] if joined is None else []
            rest = unjoined
        merged.append(main)
        pieces = rest
    return merged


def _join(piece, onto):
    """The Local `onto` extended by another one, or None if too little is common."""
    stiff = piece.scaled and onto.scaled
    common = np.flatnonzero(piece.known & onto.known)
    north = piece.north and onto.north
    # Common points needed: one fixes the shift, a second the rotation or scale, a third the
    # handedness.
    enough = 1 if north and stiff else 3 if piece.mirrored else 2
    if len(common) < enough:
        return None
    best, moved = np.inf, None
    for mirror in (1.0, -1.0) if piece.mirrored else (1.0,):
        xy = piece.xy_m * [mirror, 1.0]
        for a, turn, scale in _motions(xy[common], onto.xy_m[common], stiff, north):
            candidate = scale * (xy - xy[common[a]]) @ turn.T + onto.xy_m[common[a]]
            misfit = np.abs(candidate[common] - onto.xy_m[common]).sum()
            if misfit < best:
                best, moved = misfit, candidate
    size = np.linalg.norm(np.ptp(onto.xy_m[common], axis=0))
    if moved is None or (len(common) > 1 and best > 2 * PLAN_FRAME_MISFIT * size * len(common)):
        return None
    return replace(
        onto,
        xy_m=np.where(onto.known[:, None], onto.xy_m, moved),
        north=onto.north or piece.north,
    )


def _motions(here, there, stiff, north):
    """Yield point, rotation (2, 2) and scale of motions from single points, or from pairs."""
    if north and stiff:
        yield from ((a, np.eye(2), 1.0) for a in range(len(here)))
        return
    pairs = list(combinations(range(len(here)), 2))
    for a, b in pairs[:: max(1, len(pairs) // PAIRS)]:
        d, e = here[b] - here[a], there[b] - there[a]
        if min(np.hypot(*d), np.hypot(*e)) > 0:
            turn = np.eye(2) if north else _turning(np.arctan2(*e) - np.arctan2(*d))
            yield a, turn, 1.0 if stiff else np.hypot(*e) / np.hypot(*d)
