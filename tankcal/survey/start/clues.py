"""How a piece of a survey grows by everything that was observed: photos, angles, tapes, levels."""

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from tankcal.survey.observations import Vectors
from tankcal.survey.start.heights import add_heights
from tankcal.survey.start.lateration import lay_out_networks
from tankcal.survey.start.photographs import Wall, grow_by_photos, wall_of
from tankcal.survey.start.pieces import empty, joint
from tankcal.survey.start.plan import Plan
from tankcal.survey.start.plan_frames import find_plan_positions
from tankcal.survey.start.polar import improved_in_plan
from tankcal.survey.start.single_points import misfit_of_places, position_single_points

AS_WELL = 1e-6  # of the extent: misfits this near to one another decide nothing


@dataclass(frozen=True)
class Clues:
    """Everything that was observed, as the search for start values needs it.

    trial   number of the attempt: other samples are drawn in another one
    sought  what was found of single points already, see network.positioning
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
        """True when nothing but photos (and coordinates) was observed."""
        return not any(one.places_points for one in self.survey.observations)


def grow_piece(clues, piece, least, free=False):
    """The Piece with all that follows from it, by photos and by set-ups, in turn.

    least  known points that a photo must see
    free   whether plan and heights may start in a frame of their own when nothing of them is known
    """
    while True:
        before = np.isfinite(piece.xyz_m).sum() + piece.oriented.sum()
        piece = _by_vectors(clues, piece, free)
        piece = _by_tapes(clues, _surveyed(clues, piece, free), free)
        wall = clues.wall or wall_of(piece.xyz_m)
        piece = grow_by_photos(clues.sights, piece, clues.rng, wall, least)
        if np.isfinite(piece.xyz_m).sum() + piece.oriented.sum() == before:
            piece = _by_mixtures(clues, piece)
        if np.isfinite(piece.xyz_m).sum() + piece.oriented.sum() == before:
            return piece


def _by_vectors(clues, piece, free):
    """The Piece with points that hang on it by vectors, one after the other."""
    groups = [one for one in clues.survey.observations if isinstance(one, Vectors) and len(one)]
    if not groups:
        return piece
    start, end, value = (
        np.concatenate([getattr(one, name)[one.in_use] for one in groups])
        for name in ("start", "end", "value")
    )
    xyz = piece.xyz_m.copy()
    if free and len(start) and not np.isfinite(xyz).any():
        xyz[start[0]] = 0.0
    while True:
        before = np.isfinite(xyz).sum()
        for sign, here, there in ((1.0, start, end), (-1.0, end, start)):
            ahead = np.isfinite(xyz[here]) & np.isnan(xyz[there])
            row, axis = np.nonzero(ahead)
            xyz[there[row], axis] = xyz[here[row], axis] + sign * value[row, axis]
        if np.isfinite(xyz).sum() == before:
            break
    new = np.isfinite(xyz).all(axis=1) & ~piece.known
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new)


def _by_mixtures(clues, piece):
    """The Piece with points that only a mixture of readings to known ones fixes."""
    if clues.silent or not np.isfinite(piece.xyz_m).any():
        return piece
    xyz = position_single_points(clues.survey, clues.plan, piece.xyz_m, clues.sought)
    new = np.isfinite(xyz).all(axis=1) & ~piece.known
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new)


def _surveyed(clues, piece, free):
    """The Piece with what angles, distances and levels say."""
    if clues.silent:
        return piece
    xyz = _by_readings(clues, piece.xyz_m, free)
    new = np.isfinite(xyz) & ~np.isfinite(piece.xyz_m)
    if not new.any():
        return piece
    if np.isfinite(xyz[:, 2]).any():  # once more, with blunders outvoted
        xy = improved_in_plan(clues.plan, xyz[:, :2], xyz[:, 2], ~new[:, 0])
        first = np.where(new[:, 2], np.nan, xyz[:, 2])
        if not np.isfinite(first).any():
            first[np.flatnonzero(new[:, 2])[0]] = xyz[np.flatnonzero(new[:, 2])[0], 2]
        better = add_heights(clues.survey, clues.plan, np.column_stack([xy, first]), False)
        xyz = np.where(np.isfinite(better), better, xyz)
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new.any(axis=1))


def _by_readings(clues, xyz, free):
    """Coordinates (points, 3) with all that plan and heights give, in turn."""
    for _ in range(3):
        before = np.isfinite(xyz).sum()
        if free or np.isfinite(xyz[:, 0]).any():
            xy, _ = find_plan_positions(clues.plan, xyz[:, :2], xyz[:, 2], clues.rng)
            xyz = np.column_stack([xy, xyz[:, 2]])
        xyz = add_heights(clues.survey, clues.plan, xyz, free)
        if np.isfinite(xyz).sum() == before:
            break
    return xyz


def _by_tapes(clues, piece, free):
    """The Piece with points that hang on it by spatial distances alone."""
    plan, known = clues.plan, piece.known
    straight = ~plan.flat & (plan.rise == 0) & ~(known[plan.start] & known[plan.end])
    if not straight.any() or not (free or known.any()) or len(plan.station):
        return piece
    start, end, length = plan.start[straight], plan.end[straight], plan.length[straight]
    firm = np.unique(np.concatenate([start, end]))
    firm = firm[known[firm]]
    sides = np.array(list(combinations(firm, 2)), dtype=int).reshape(-1, 2)
    between = np.linalg.norm(piece.xyz_m[sides[:, 0]] - piece.xyz_m[sides[:, 1]], axis=1)
    ties = np.concatenate([start, sides[:, 0]]), np.concatenate([end, sides[:, 1]])
    for points, places in lay_out_networks(*ties, np.concatenate([length, between]), 3, clues.rng):
        either = [_told(clues, points, places * mirror) for mirror in ([1, 1, 1], [1, 1, -1])]
        if free and not known.any():
            return piece.filled_from(either[0])
        joined = _joined(clues, piece, either)
        if joined is not None:
            return joined
    return piece


def _joined(clues, piece, either):
    """The Piece with one of two mirror images, the one that all readings speak for.

    None where neither can be joined, or both fit as well: known points in one plane leave open on
    which side of it the others lie.
    """
    motions = [joint(own, piece, clues.rng) for own in either]
    found = []
    for own, motion in zip(either, motions, strict=True):
        if motion is None:
            continue
        filled = piece.filled_from(own.moved(motion))
        new = np.flatnonzero(filled.known & ~piece.known)
        misfit = misfit_of_places(clues.survey, clues.plan, filled.xyz_m, new)
        found.append((misfit + motion.misfit_m, filled))
    if not found:
        return None
    found.sort(key=lambda one: one[0])
    best = found[0]
    if len(found) > 1 and found[1][0] - best[0] < AS_WELL * best[1].extent:
        return None
    return best[1]


def _told(clues, points, places):
    piece = empty(clues.points, len(clues.sights))
    piece.xyz_m[points], piece.by_photos[points] = places, False
    return piece
