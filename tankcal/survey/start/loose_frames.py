"""Local frames of photos that no known position reaches, and their connection.

A frame that shares no place with the rest is aligned to partial knowledge by a similarity
transformation. Three coordinates of one point, a height of another, plumb lines, levelled
differences, azimuths or single elements of a photo are too few for a similarity by points, but
enough for a start. Damped least squares estimates the seven parameters from 24 starts, the
rotations of a cube. Undetermined parameters keep their start values.
"""

from dataclasses import replace
from itertools import combinations, permutations, product

import numpy as np

from tankcal.adjust import Damping, gauss_newton
from tankcal.geometry.rotations import apply_small_rotation
from tankcal.messages import message
from tankcal.survey.observations import HeightDifferences
from tankcal.survey.start.clues import grow_piece
from tankcal.survey.start.photographs import add_points, grow_by_photos
from tankcal.survey.start.pieces import BAD_JOINT, Motion, certain_places, joint
from tankcal.survey.start.relative import blind_piece

STEPS = 30  # of the alignment from one start
FAR = 5.0  # largest step of the logarithm of the scale


def join_local_frames(clues, piece, places, least):
    """Add local frames of the remaining photos to a Piece.

    Parameters
    ----------
    clues : Clues
    piece : Piece
    places : ndarray, shape (photos, 3)
        Given projection centres; nan: unknown.
    least : int
        Known points required in a photo.

    Returns
    -------
    piece : Piece
    reasons : list of str
        Sentences about frames that do not join.
    """
    original = piece
    if not np.isfinite(piece.xyz_m[:, 0]).any() or not np.isfinite(piece.xyz_m[:, 2]).any():
        piece = grow_piece(clues, piece, least, free=not piece.oriented.any())
    tried, loose, reasons = piece.oriented.copy(), [], []
    while not tried.all():
        local, why = blind_piece(clues.sights, ~tried, clues.points, clues.rng, clues.trial)
        if local is None:
            reasons.append(why)
            break
        piece, loose = _attach_frames(clues, piece, [*loose, local], least)
        tried |= local.oriented | piece.oriented
    if loose and not (
        piece.oriented.any()
        or (piece.known & ~np.isfinite(certain_places(clues.survey).piece.xyz_m).any(axis=1)).any()
    ):
        local = max(loose, key=lambda frame: frame.oriented.sum())
        # Without a place in common, align the largest frame to single known coordinates.
        motion = align_piece(clues.survey, local, piece.xyz_m, places)
        piece = grow_piece(clues, piece.fill_from(local.moved(motion)), least)
        piece, loose = _attach_frames(
            clues, piece, [frame for frame in loose if frame is not local], least
        )
    reasons += [_unjoined_sentence(clues.survey, local, piece) for local in loose]
    piece = _scale_about_photo(clues, piece, original, places)
    return grow_piece(clues, piece, least, free=not np.isfinite(piece.xyz_m[:, 0]).any()), reasons


def _attach_frames(clues, piece, loose, least):
    """Join all frames that share enough with the Piece or with each other; return it and the
    others."""
    loose = [_scale_by_distances(clues, frame) for frame in loose]
    while True:
        for local in loose:
            joined = _join(clues, local, piece)
            if joined is not None:
                piece = grow_piece(clues, joined, least)
                loose = [frame for frame in loose if frame is not local]
                break
        else:
            pairs = ((a, b, _join(clues, a, b)) for a, b in combinations(loose, 2))
            first, second, joined = next((frame for frame in pairs if frame[2]), (None,) * 3)
            if joined is None:
                return piece, loose
            joined = grow_by_photos(clues.sights, joined, clues.rng, least=least)
            rest = [frame for frame in loose if frame is not first and frame is not second]
            loose = [*rest, _scale_by_distances(clues, joined)]


def _join(clues, local, onto):
    """The Piece `onto` extended by another one, or None if too little is common."""
    motion = joint(local, onto, clues.rng)
    if motion is None or motion.misfit_m > BAD_JOINT * max(local.extent * motion.scale, 1e-9):
        return None
    return onto.fill_from(local.moved(motion))


def _scale_about_photo(clues, piece, original, places):
    """Scale a Piece about its only completely given photo.

    Relative orientation alone sets the base to 1. Single coordinates of other photos and of points
    determine the scale.

    Parameters
    ----------
    clues : Clues
    piece : Piece
    given : Piece
        Positions known at the start.
    places : ndarray, shape (photos, 3)
        See `join_local_frames`.
    """
    is_given, plan = original.oriented, clues.plan
    taped = piece.known[plan.start] & piece.known[plan.end] & ~plan.flat
    if is_given.sum() != 1 or original.known.any() or taped.any() or piece.oriented.sum() < 2:
        return piece
    bare = replace(
        piece,
        xyz_m=np.full_like(piece.xyz_m, np.nan),
        by_photos=np.ones_like(piece.by_photos),
    )
    bare, hinge = add_points(clues.sights, bare), original.place_m[is_given][0]
    targets = np.vstack(
        [original.xyz_m, np.where(np.isfinite(original.place_m), original.place_m, places)]
    )
    away, target_offsets = np.vstack([bare.xyz_m, bare.place_m]) - hinge, targets - hinge
    common = np.isfinite(away) & np.isfinite(target_offsets)
    square = float(np.sum(away[common] ** 2))
    # Least squares scale of the offsets from the given photo.
    scale = float(np.sum(away[common] * target_offsets[common])) / square if square > 0 else 0.0
    if not scale > 0:
        return piece
    return original.fill_from(bare.moved(Motion(np.eye(3), hinge * (1 - scale), scale, 0.0)))


def _scale_by_distances(clues, piece):
    """The Piece scaled by measured distances."""
    plan, known = clues.plan, piece.known
    use = known[plan.start] & known[plan.end] & ~plan.flat
    computed = np.linalg.norm(piece.xyz_m[plan.end[use]] - piece.xyz_m[plan.start[use]], axis=1)
    good = computed > 0
    if not good.any():
        return piece
    # The median ratio is robust against blunders.
    scale = float(np.median(plan.length[use][good] / computed[good]))
    return replace(piece, xyz_m=scale * piece.xyz_m, place_m=scale * piece.place_m)


def _unjoined_sentence(survey, local, piece):
    """Sentence about photos of a frame that does not join."""
    names = [survey.photos.names[i] for i in np.flatnonzero(local.oriented & ~piece.oriented)]
    common, some = int((local.known & piece.known).sum()), ", ".join(names[:10])
    if common > 3:
        why = message(
            "shared_do_not_fit",
            "but the {common} points that they share with the rest do not fit",
            common=common,
        )
        return message(
            "photos_apart", "photos {some} are connected to each other, {why}", some=some, why=why
        )
    return message(
        "photos_loose",
        "photos {some} are connected to each other, but share only {common} known points "
        "with the rest: 3 that do not lie on a line are needed, and more to choose between "
        "possible positions",
        some=some,
        common=common,
    )


def align_piece(survey, piece, known, place_m):
    """Fit a piece to known coordinates and observed verticals and azimuths.

    Parameters
    ----------
    survey : network.Survey
    piece : Piece
    known : ndarray, shape (points, 3)
        Known coordinates; nan: unknown.
    place_m : ndarray, shape (photos, 3)
        Projection centres; nan: unknown.

    Returns
    -------
    Motion
    """
    places = np.vstack([piece.xyz_m, piece.place_m])
    count = np.isfinite(places).sum(axis=0)
    middle = np.nansum(places, axis=0) / np.maximum(count, 1)
    clues = _FrameClues(survey, piece, known, place_m)
    at_rest = Motion(np.eye(3), np.zeros(3), 1.0, 0.0)
    if not len(clues.misfits(at_rest)):
        return at_rest
    best = None
    for rotation in _cube():
        motion = _fit_from(clues, rotation, clues.middle - rotation @ middle)
        # The margin keeps the first of equal solutions, whatever the rounding.
        if best is None or motion.misfit_m < best.misfit_m * (1 - 1e-6):
            best = motion
    return best


def _cube():
    """Yield the 24 rotations (3, 3) that map a cube onto itself, the identity first."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            rotation = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(rotation) > 0:
                yield rotation


class _FrameClues:
    """Known data of the frame, as misfits in metres of a transformed piece."""

    def __init__(self, survey, piece, known_m, place_m):
        points = piece.known[:, None] & np.isfinite(known_m)
        photos = piece.oriented[:, None] & np.isfinite(place_m)
        self.places = np.vstack([piece.xyz_m, piece.place_m])
        self.known_m = np.vstack([known_m, place_m])
        self.size = max(piece.extent, 1e-9)
        self.which = np.nonzero(np.vstack([points, photos]))
        self.others = [item.taken(
        item.in_use & piece.known[item.start] & piece.known[item.end]
    ) for item in survey.observations
                       if item.knows_frame]  # fmt: skip
        target = np.where(np.vstack([points, photos]), self.known_m, np.nan)
        counts = np.isfinite(target).sum(axis=0)
        levelled = any(isinstance(item, HeightDifferences) and len(item) for item in self.others)
        self.metres = levelled or np.isfinite(target).any(axis=1).sum() > 1
        self.middle = np.where(counts, np.nansum(target, axis=0) / np.maximum(counts, 1), 0.0)

    def misfits(self, motion):
        """Misfits (n,) in metres of the transformed piece."""
        xyz = motion.of(self.places)
        parts = [(xyz - self.known_m)[self.which]]
        for item in self.others:
            parts += item.off_frame(xyz[item.end] - xyz[item.start])
        return np.concatenate(parts)


def _fit_from(clues, rotation, shift_m):
    """Fit a Motion by damped least squares from one start."""
    tiny, size = 1e-6, clues.size

    def step_at(motion, damping):
        misfits = clues.misfits(motion)
        # Seven parameters: numerical derivatives are accurate enough for a start value.
        jac = np.empty((len(misfits), 7))
        for k in range(7):
            moved = _move(motion, tiny * np.eye(7)[k], size)
            jac[:, k] = (clues.misfits(moved) - misfits) / tiny
        # Without a length, plumb lines would fit best at scale zero, so the scale is held.
        if not clues.metres:
            jac[:, 6] = 0.0
        normal = jac.T @ jac
        ridge = damping * np.eye(7) * max(float(normal.diagonal().max()), 1e-30)
        return -np.linalg.solve(normal + ridge, jac.T @ misfits)

    def square(motion):
        misfits = clues.misfits(motion)
        return misfits @ misfits

    motion = gauss_newton(
        step_at,
        Motion(rotation, shift_m, 1.0, 0.0),
        move=lambda motion, step: _move(motion, step, size),
        is_better=lambda candidate, motion: square(candidate) < square(motion),
        is_small=lambda step: np.abs(step).max() < 1e-10,
        most_steps=STEPS,
        damping=Damping(relax=10.0),
    )
    return replace(motion, misfit_m=float(np.sqrt(square(motion))))


def _move(motion, step, size):
    """Motion after a step (7,): rotation, shift over `size`, logarithm of the scale."""
    return Motion(
        apply_small_rotation(motion.rotation[None], step[None, :3])[0],
        motion.shift_m + size * step[3:6],
        motion.scale * np.exp(np.clip(step[6], -FAR, FAR)),
        motion.misfit_m,
    )
