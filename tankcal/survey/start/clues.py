"""Growth of a piece of a survey by all observations: photos, angles, tapes, levels.

Heights from levelling and slopes, by least absolute deviations.

Slopes become height differences with the horizontal length of their line. Iteratively reweighted
least squares minimizes the sum of absolute misfits (Schlossmacher 1973), so that a blunder is
outvoted where a height is controlled.
"""

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from tankcal.survey.observations import HeightDifferences, Vectors
from tankcal.survey.start.lateration import lay_out_networks
from tankcal.survey.start.photographs import Wall, grow_by_photos, wall_of
from tankcal.survey.start.pieces import empty, joint
from tankcal.survey.start.plan import Plan, look_up
from tankcal.survey.start.plan_frames import find_plan_positions
from tankcal.survey.start.polar import improve_plan_positions
from tankcal.survey.start.single_points import misfit_of_places, position_single_points

AS_WELL = 1e-6  # share of the extent: misfits closer than this are equal
ROUNDS = 25
NOISE_M = 1e-4  # misfits below this count as equal


@dataclass(frozen=True)
class Clues:
    """Observations in the form required by the search for start values.

    Attributes
    ----------
    survey : network.Survey
    sights : tuple of Sight
    plan : Plan
    wall : Wall or None
    rng : numpy.random.Generator
    trial : int
        Number of the attempt; each draws other samples.
    sought : dict
        Results for single points, see `single_points`.
    """

    survey: object
    sights: tuple
    plan: Plan
    wall: Wall
    rng: np.random.Generator
    trial: int = 0
    sought: dict = field(default_factory=dict, repr=False)

    @property
    def points(self):
        return len(self.survey.points)

    @property
    def silent(self):
        """True if only photos (and coordinates) were observed."""
        return not any(item.places_points for item in self.survey.observations)


def grow_piece(clues, piece, least, free=False):
    """Grow a piece by photos and by set-ups in turn until nothing is added.

    Parameters
    ----------
    clues : Clues
    piece : Piece
    least : int
        Known points required in a photo.
    free : bool
        Whether plan and heights without known values may start in a frame of their own.

    Returns
    -------
    Piece
    """
    while True:
        before = np.isfinite(piece.xyz_m).sum() + piece.oriented.sum()
        piece = _add_by_vectors(clues, piece, free)
        piece = _add_by_tapes(clues, _add_by_survey(clues, piece, free), free)
        wall = clues.wall or wall_of(piece.xyz_m)
        piece = grow_by_photos(clues.sights, piece, clues.rng, wall, least)
        if np.isfinite(piece.xyz_m).sum() + piece.oriented.sum() == before:
            # Mixed observations are slow to solve, so they come last.
            piece = _add_by_mixtures(clues, piece)
        if np.isfinite(piece.xyz_m).sum() + piece.oriented.sum() == before:
            return piece


def _add_by_vectors(clues, piece, free):
    """Add points tied to the Piece by vectors."""
    groups = [item for item in clues.survey.observations if isinstance(item, Vectors) and len(item)]
    if not groups:
        return piece
    start, end, value = (
        np.concatenate([getattr(item, name)[item.in_use] for item in groups])
        for name in ("start", "end", "value")
    )
    xyz = piece.xyz_m.copy()
    if free and len(start) and not np.isfinite(xyz).any():
        xyz[start[0]] = 0.0
    while True:
        before = np.isfinite(xyz).sum()
        for sign, base, target in ((1.0, start, end), (-1.0, end, start)):
            ahead = np.isfinite(xyz[base]) & np.isnan(xyz[target])
            row, axis = np.nonzero(ahead)
            xyz[target[row], axis] = xyz[base[row], axis] + sign * value[row, axis]
        if np.isfinite(xyz).sum() == before:
            break
    new = np.isfinite(xyz).all(axis=1) & ~piece.known
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new)


def _add_by_mixtures(clues, piece):
    """Add points determined only by a mixture of readings to known points."""
    if clues.silent or not np.isfinite(piece.xyz_m).any():
        return piece
    xyz = position_single_points(clues.survey, clues.plan, piece.xyz_m, clues.sought)
    new = np.isfinite(xyz).all(axis=1) & ~piece.known
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new)


def _add_by_survey(clues, piece, free):
    """Add points from angles, distances and levels."""
    if clues.silent:
        return piece
    xyz = _place_by_readings(clues, piece.xyz_m, free)
    new = np.isfinite(xyz) & ~np.isfinite(piece.xyz_m)
    if not new.any():
        return piece
    # Compute the new positions again from all their sights, so that blunders are outvoted.
    if np.isfinite(xyz[:, 2]).any():
        xy = improve_plan_positions(clues.plan, xyz[:, :2], xyz[:, 2], ~new[:, 0])
        first = np.where(new[:, 2], np.nan, xyz[:, 2])
        if not np.isfinite(first).any():
            # Heights without a known value start from one of the computed heights.
            first[np.flatnonzero(new[:, 2])[0]] = xyz[np.flatnonzero(new[:, 2])[0], 2]
        better = add_heights(clues.survey, clues.plan, np.column_stack([xy, first]), False)
        xyz = np.where(np.isfinite(better), better, xyz)
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new.any(axis=1))


def _place_by_readings(clues, xyz, free):
    """Coordinates (points, 3) after alternating between plan and heights."""
    # Slope distances need heights, and heights by slopes need distances.
    for _ in range(3):
        before = np.isfinite(xyz).sum()
        if free or np.isfinite(xyz[:, 0]).any():
            xy, _ = find_plan_positions(clues.plan, xyz[:, :2], xyz[:, 2], clues.rng)
            xyz = np.column_stack([xy, xyz[:, 2]])
        xyz = add_heights(clues.survey, clues.plan, xyz, free)
        if np.isfinite(xyz).sum() == before:
            break
    return xyz


def _add_by_tapes(clues, piece, free):
    """Add points tied to the Piece by spatial distances alone."""
    plan, known = clues.plan, piece.known
    straight = ~plan.flat & (plan.rise == 0) & ~(known[plan.start] & known[plan.end])
    if not straight.any() or not (free or known.any()) or len(plan.station):
        return piece
    start, end, length = plan.start[straight], plan.end[straight], plan.length[straight]
    firm = np.unique(np.concatenate([start, end]))
    firm = firm[known[firm]]
    sides = np.array(list(combinations(firm, 2)), dtype=int).reshape(-1, 2)
    # Distances between known points stiffen the network.
    between = np.linalg.norm(piece.xyz_m[sides[:, 0]] - piece.xyz_m[sides[:, 1]], axis=1)
    ties = np.concatenate([start, sides[:, 0]]), np.concatenate([end, sides[:, 1]])
    for points, places in lay_out_networks(*ties, np.concatenate([length, between]), 3, clues.rng):
        # Distances do not determine the handedness, so both mirror images are tried.
        either = [_piece_of(clues, points, places * mirror) for mirror in ([1, 1, 1], [1, 1, -1])]
        if free and not known.any():
            return piece.fill_from(either[0])
        joined = _join_mirror_image(clues, piece, either)
        if joined is not None:
            return joined
    return piece


def _join_mirror_image(clues, piece, either):
    """Join the mirror image that agrees with the readings; None if neither or both do.

    Known points in one plane leave the side of the other points undetermined.
    """
    motions = [joint(image, piece, clues.rng) for image in either]
    candidates = []
    for image, motion in zip(either, motions, strict=True):
        if motion is None:
            continue
        filled = piece.fill_from(image.moved(motion))
        new = np.flatnonzero(filled.known & ~piece.known)
        misfit = misfit_of_places(clues.survey, clues.plan, filled.xyz_m, new)
        candidates.append((misfit + motion.misfit_m, filled))
    if not candidates:
        return None
    candidates.sort(key=lambda candidate: candidate[0])
    best = candidates[0]
    if len(candidates) > 1 and candidates[1][0] - best[0] < AS_WELL * best[1].extent:
        return None
    return best[1]


def _piece_of(clues, points, places):
    """A Piece with places (k, 3) of some points."""
    piece = empty(clues.points, len(clues.sights))
    piece.xyz_m[points], piece.by_photos[points] = places, False
    return piece


# ---- heights of a piece


def add_heights(survey, plan, xyz_m, free):
    """Add all z that follow from height differences and slopes.

    Parameters
    ----------
    survey : network.Survey
    plan : Plan
    xyz_m : ndarray, shape (points, 3)
    free : bool
        Whether a network without known z may start with its first point at z = 0.

    Returns
    -------
    ndarray, shape (points, 3)
    """
    start, end, rise = _differences(survey, plan, xyz_m)
    z = xyz_m[:, 2].copy()
    if not len(start):
        return xyz_m
    n = len(z)
    # Only a connected component with a known z has a height datum.
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    has_datum = np.zeros(n, dtype=bool)
    has_datum[label[np.isfinite(z)]] = True
    tied = np.unique(np.concatenate([start, end]))
    if free and not np.isfinite(z).any():
        largest = np.bincount(label[tied]).argmax()
        z[tied[label[tied] == largest][0]] = 0.0
        has_datum[largest] = True
    unknown = tied[has_datum[label[tied]] & ~np.isfinite(z[tied])]
    if len(unknown):
        rows = has_datum[label[start]]
        z[unknown] = _balance_heights(z, unknown, start[rows], end[rows], rise[rows])
    return np.column_stack([xyz_m[:, :2], z])


def _differences(survey, plan, xyz_m):
    """Points start, end (n,), and z of end minus z of start (n,), m."""
    pair = plan.pairs(plan.low, plan.high)
    flat = look_up(*plan.lengths(xyz_m[:, 2]), pair)
    known = np.linalg.norm(xyz_m[plan.high, :2] - xyz_m[plan.low, :2], axis=1)
    # Coordinates give the length of the line more reliably than a single distance.
    flat = np.where(np.isfinite(known), known, flat)
    by_slope = flat * np.tan(plan.slope) + plan.lift + plan.bend * flat**2
    good = np.isfinite(by_slope)
    parts = [(plan.low[good], plan.high[good], by_slope[good])]
    for item in survey.observations:
        if isinstance(item, HeightDifferences):
            accepted = item.in_use
            parts.append((item.start[accepted], item.end[accepted], item.value[accepted]))
    start, end, rise = (np.concatenate(column) for column in zip(*parts, strict=True))
    return start, end, rise


def _balance_heights(z, unknown, start, end, rise):
    """Heights (k,) of unknown points with the least sum of absolute misfits."""
    place = np.full(len(z), -1)
    place[unknown] = np.arange(len(unknown))
    open_ended = (place[start] >= 0) | (place[end] >= 0)
    start, end, rise = start[open_ended], end[open_ended], rise[open_ended]
    rows = np.arange(len(start))
    up, down = place[end] >= 0, place[start] >= 0
    a = coo_array(
        (
            np.concatenate([np.ones(up.sum()), -np.ones(down.sum())]),
            (
                np.concatenate([rows[up], rows[down]]),
                np.concatenate([place[end[up]], place[start[down]]]),
            ),
        ),
        shape=(len(start), len(unknown)),
    ).tocsr()
    right = rise - np.where(up, 0.0, z[end]) + np.where(down, 0.0, z[start])
    weight = np.ones(len(start))
    for _ in range(ROUNDS):
        heavy = a.T @ diags_array(weight)
        heights = np.atleast_1d(spsolve(csr_array(heavy @ a).tocsc(), heavy @ right))
        # Weight 1 / |misfit| turns the sum of squares into the sum of absolute values.
        weight = 1 / np.maximum(np.abs(a @ heights - right), NOISE_M)
    return heights
