"""Local frames of photos that no known position reaches, and their connection."""

from dataclasses import replace
from itertools import combinations

import numpy as np

from tankcal.messages import message
from tankcal.survey.start.alignment import align_piece
from tankcal.survey.start.clues import grow_piece
from tankcal.survey.start.known import certain_places
from tankcal.survey.start.pairs import blind_piece
from tankcal.survey.start.photographs import add_points, grow_by_photos
from tankcal.survey.start.pieces import BAD_JOINT, Motion, joint


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
        piece, loose = _attached(clues, piece, [*loose, local], least)
        tried |= local.oriented | piece.oriented
    if loose and not (piece.oriented.any() or (piece.known & ~_held(clues.survey)).any()):
        local = max(loose, key=lambda frame: frame.oriented.sum())
        # Without a place in common, align the largest frame to single known coordinates.
        motion = align_piece(clues.survey, local, piece.xyz_m, places)
        piece = grow_piece(clues, piece.fill_from(local.moved(motion)), least)
        piece, loose = _attached(
            clues, piece, [frame for frame in loose if frame is not local], least
        )
    reasons += [_apart(clues.survey, local, piece) for local in loose]
    piece = _scaled_about_photo(clues, piece, original, places)
    return grow_piece(clues, piece, least, free=not np.isfinite(piece.xyz_m[:, 0]).any()), reasons


def _attached(clues, piece, loose, least):
    """Join all frames that share enough with the Piece or with each other; return it and the
    others."""
    loose = [_stretched(clues, frame) for frame in loose]
    while True:
        for local in loose:
            joined = _joined(clues, local, piece)
            if joined is not None:
                piece = grow_piece(clues, joined, least)
                loose = [frame for frame in loose if frame is not local]
                break
        else:
            pairs = ((a, b, _joined(clues, a, b)) for a, b in combinations(loose, 2))
            first, second, joined = next((frame for frame in pairs if frame[2]), (None,) * 3)
            if joined is None:
                return piece, loose
            joined = grow_by_photos(clues.sights, joined, clues.rng, least=least)
            rest = [frame for frame in loose if frame is not first and frame is not second]
            loose = [*rest, _stretched(clues, joined)]


def _joined(clues, local, onto):
    """The Piece `onto` extended by another one, or None if too little is common."""
    motion = joint(local, onto, clues.rng)
    if motion is None or motion.misfit_m > BAD_JOINT * max(local.extent * motion.scale, 1e-9):
        return None
    return onto.fill_from(local.moved(motion))


def _scaled_about_photo(clues, piece, original, places):
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


def _held(survey):
    """Mask (points,) of points with certain coordinates."""
    return np.isfinite(certain_places(survey).piece.xyz_m).any(axis=1)


def _stretched(clues, piece):
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


def _apart(survey, local, piece):
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
