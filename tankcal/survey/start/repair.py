"""How well a piece agrees with its images, and what is done where it does not."""

from dataclasses import replace

import numpy as np

from tankcal.survey.start.photographs import grow_by_photos
from tankcal.survey.start.plan import medians
from tankcal.survey.start.resection import agreed_error, bearings, image_errors

MENDING = 2  # rounds in which photos that fit badly are found again
AT_ODDS = 0.02  # error over c of a photo, or a known point, that is not where it should be
WORSE = 5.0  # times the median error of the photos, beyond which one fits badly
SMALL_ERROR = 3e-3  # error over c that is not looked into: 0.3 mm at c = 100 mm


def repair_photos(sights, piece, held, rng, wall=None):
    """The Piece, photos that fit far worse than the others found again from what these say.

    held  (photos,) True for those that stay
    """
    for _ in range(MENDING):
        errors = photo_errors(sights, piece)
        bad = errors > max(WORSE * _middle(errors), SMALL_ERROR)
        bad &= piece.oriented & ~held
        if not bad.any():
            return piece
        less = replace(
            piece,
            xyz_m=np.where(piece.by_photos[:, None], np.nan, piece.xyz_m),
            place_m=np.where(bad[:, None], np.nan, piece.place_m),
            rotation=np.where(bad[:, None, None], np.nan, piece.rotation),
        )
        again = grow_by_photos(sights, less, rng, wall)
        if again.oriented.sum() < piece.oriented.sum():
            return piece
        piece = again
    return piece


def _middle(errors):
    return float(np.nanmedian(errors)) if np.isfinite(errors).any() else 0.0


def photo_errors(sights, piece):
    """Errors (photos,) over c that more than half of the points of each photo keep, else nan."""
    photos = zip(range(len(sights)), piece.oriented, strict=True)
    return np.array(
        [photo_error(sights[i], piece, i, most=True) if done else np.nan for i, done in photos]
    )


def contradictions(sights, piece, sure):
    """How much a Piece is at odds with its images: share of photos and of known points that are.

    sure  (points,) True for points whose places are known for certain
    """
    if not sights:
        return 0.0
    errors = photo_errors(sights, piece)
    found = [_errors(sights[i], piece, i) for i in np.flatnonzero(piece.oriented)]
    number = np.concatenate([one for one, _ in found] + [np.zeros(0, dtype=int)])
    off = np.concatenate([one for _, one in found] + [np.zeros(0)])
    mine = sure[number]
    _, middle = medians(number[mine], np.minimum(off[mine], 1e3))
    wrong = float(np.mean(middle > AT_ODDS)) if len(middle) else 0.0
    return float(np.mean(~(errors < AT_ODDS))) + wrong


def _errors(sight, piece, photo):
    """Known points (n,) that a photo sees, and their errors (n,) over c."""
    known = piece.known[sight.point]
    points, ideal = piece.xyz_m[sight.point[known]], sight.ideal[known]
    pose = piece.place_m[photo][None], piece.rotation[photo][None]
    return sight.point[known], image_errors(points, ideal, *pose)[0]


def guess_places(sights, piece):
    """The Piece with places, on a ray, of points whose rays from two photos or more do not meet."""
    photos = np.flatnonzero(piece.oriented)
    rays = np.bincount(
        np.concatenate([sights[i].point for i in photos] + [np.zeros(0, dtype=int)]),
        minlength=len(piece.xyz_m),
    )
    xyz, known = piece.xyz_m.copy(), piece.known
    for photo in photos:
        sight = sights[photo]
        seen = known[sight.point]
        left = ~seen & (rays[sight.point] > 1) & np.isnan(xyz[sight.point]).all(axis=1)
        if seen.any() and left.any():
            away = xyz[sight.point[seen]] - piece.place_m[photo]
            far = np.median(np.linalg.norm(away, axis=1))
            ray = bearings(sight.ideal[left]) @ piece.rotation[photo]
            xyz[sight.point[left]] = piece.place_m[photo] + far * ray
    return replace(piece, xyz_m=xyz)


def photo_error(sight, piece, photo, most=False):
    """Median error over c of a photo's image points that show known points; nan: no such point.

    most  the error that more than half of them keep, as resection judges
    """
    errors = _errors(sight, piece, photo)[1][None]
    if not errors.size:
        return np.nan
    return float(agreed_error(errors)[0] if most else np.median(errors))
