"""Local frames of photos that nothing known reaches, and how they join what is known."""

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
    """The Piece with local frames of what is left, and sentences about those that do not join.

    places  (photos, 3) projection centres that were given, nan where none was
    """
    given = piece
    if not np.isfinite(piece.xyz_m[:, 0]).any() or not np.isfinite(piece.xyz_m[:, 2]).any():
        piece = grow_piece(clues, piece, least, free=not piece.oriented.any())
    tried, loose, reasons = piece.oriented.copy(), [], []
    while not tried.all():
        own, why = blind_piece(clues.sights, ~tried, clues.points, clues.rng, clues.trial)
        if own is None:
            reasons.append(why)
            break
        piece, loose = _attached(clues, piece, [*loose, own], least)
        tried |= own.oriented | piece.oriented
    if loose and not (piece.oriented.any() or (piece.known & ~_held(clues.survey)).any()):
        own = max(loose, key=lambda one: one.oriented.sum())
        motion = align_piece(clues.survey, own, piece.xyz_m, places)
        piece = grow_piece(clues, piece.filled_from(own.moved(motion)), least)
        piece, loose = _attached(clues, piece, [one for one in loose if one is not own], least)
    reasons += [_apart(clues.survey, own, piece) for own in loose]
    piece = _to_scale(clues, piece, given, places)
    return grow_piece(clues, piece, least, free=not np.isfinite(piece.xyz_m[:, 0]).any()), reasons


def _attached(clues, piece, loose, least):
    """The Piece with all loose ones that share enough with it or one another, and the others."""
    loose = [_stretched(clues, one) for one in loose]
    while True:
        for own in loose:
            joined = _joined(clues, own, piece)
            if joined is not None:
                piece = grow_piece(clues, joined, least)
                loose = [one for one in loose if one is not own]
                break
        else:
            pairs = ((a, b, _joined(clues, a, b)) for a, b in combinations(loose, 2))
            first, second, joined = next((one for one in pairs if one[2]), (None,) * 3)
            if joined is None:
                return piece, loose
            joined = grow_by_photos(clues.sights, joined, clues.rng, least=least)
            rest = [one for one in loose if one is not first and one is not second]
            loose = [*rest, _stretched(clues, joined)]


def _joined(clues, own, onto):
    """The Piece `onto` with what another one adds, or None when too little is common."""
    motion = joint(own, onto, clues.rng)
    if motion is None or motion.misfit_m > BAD_JOINT * max(own.extent * motion.scale, 1e-9):
        return None
    return onto.filled_from(own.moved(motion))


def _to_scale(clues, piece, given, places):
    """The Piece stretched about the only photo that was given whole, to what else is known.

    given   Piece of what was known at first         places  see `join_local_frames`

    Single coordinates of other photos and of points say how large it is: by relative orientation
    alone its base has the length one.
    """
    one, plan = given.oriented, clues.plan
    taped = piece.known[plan.start] & piece.known[plan.end] & ~plan.flat
    if one.sum() != 1 or given.known.any() or taped.any() or piece.oriented.sum() < 2:
        return piece
    bare = replace(
        piece,
        xyz_m=np.full_like(piece.xyz_m, np.nan),
        by_photos=np.ones_like(piece.by_photos),
    )
    bare, hinge = add_points(clues.sights, bare), given.place_m[one][0]
    told = np.vstack([given.xyz_m, np.where(np.isfinite(given.place_m), given.place_m, places)])
    away, wanted = np.vstack([bare.xyz_m, bare.place_m]) - hinge, told - hinge
    both = np.isfinite(away) & np.isfinite(wanted)
    square = float(np.sum(away[both] ** 2))
    scale = float(np.sum(away[both] * wanted[both])) / square if square > 0 else 0.0
    if not scale > 0:
        return piece
    return given.filled_from(bare.moved(Motion(np.eye(3), hinge * (1 - scale), scale, 0.0)))


def _held(survey):
    return np.isfinite(certain_places(survey).piece.xyz_m).any(axis=1)


def _stretched(clues, piece):
    """The Piece with the scale that distances give it."""
    plan, known = clues.plan, piece.known
    use = known[plan.start] & known[plan.end] & ~plan.flat
    computed = np.linalg.norm(piece.xyz_m[plan.end[use]] - piece.xyz_m[plan.start[use]], axis=1)
    good = computed > 0
    if not good.any():
        return piece
    scale = float(np.median(plan.length[use][good] / computed[good]))
    return replace(piece, xyz_m=scale * piece.xyz_m, place_m=scale * piece.place_m)


def _apart(survey, own, piece):
    names = [survey.photos.names[i] for i in np.flatnonzero(own.oriented & ~piece.oriented)]
    common, some = int((own.known & piece.known).sum()), ", ".join(names[:10])
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
