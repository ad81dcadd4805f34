"""Local frames in plan without known points, and their connection to known positions.

A traverse between two known points has no known direction; a network without control has no known
point. Each starts with a station at the origin and its first direction towards +y and grows. It is
then rotated and shifted onto the known positions, and scaled if it contains no measured length.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tankcal.survey.start.lateration import lay_out_networks
from tankcal.survey.start.plan import look_up
from tankcal.survey.start.polar import grow_in_plan, orient_circles

MISFIT = 0.05  # relative misfit of a joint over the distance of its points
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
    if moved is None or (len(common) > 1 and best > 2 * MISFIT * size * len(common)):
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
