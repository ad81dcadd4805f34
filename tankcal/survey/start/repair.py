"""Agreement of a piece with its images, and repair of photos that contradict it."""

from dataclasses import replace

import numpy as np

from tankcal.survey.start.photographs import grow_by_photos
from tankcal.survey.start.plan import medians
from tankcal.survey.start.resection import agreed_error, bearings, image_errors

MENDING = 2  # rounds in which poorly fitting photos are recomputed
AT_ODDS = 0.02  # error over c above which a photo or a known point is wrong
WORSE = 5.0  # ratio to the median error of the photos, above which a photo fits poorly
SMALL_ERROR = 3e-3  # error over c that is always accepted: 0.3 mm at c = 100 mm


def repair_photos(sights, piece, held, rng, wall=None):
    """Recompute photos that fit far worse than the others.

    Parameters
    ----------
    sights : sequence of Sight
    piece : Piece
    held : ndarray of bool, shape (photos,)
        Photos that stay.
    rng : numpy.random.Generator
    wall : Wall, optional

    Returns
    -------
    Piece
    """
    for _ in range(MENDING):
        errors = photo_errors(sights, piece)
        bad = errors > max(
            WORSE * (float(np.nanmedian(errors)) if np.isfinite(errors).any() else 0.0), SMALL_ERROR
        )
        bad &= piece.oriented & ~held
        if not bad.any():
            return piece
        # Points from photos may be spoilt by the bad ones, so they are recomputed as well.
        less = replace(
            piece,
            xyz_m=np.where(piece.by_photos[:, None], np.nan, piece.xyz_m),
            place_m=np.where(bad[:, None], np.nan, piece.place_m),
            rotation=np.where(bad[:, None, None], np.nan, piece.rotation),
        )
        again = grow_by_photos(sights, less, rng, wall)
        # A repair that loses photos is not one.
        if again.oriented.sum() < piece.oriented.sum():
            return piece
        piece = again
    return piece


def photo_errors(sights, piece):
    """Errors (photos,) over c met by more than half of the points of each photo; nan: not
    oriented."""
    photos = zip(range(len(sights)), piece.oriented, strict=True)
    return np.array(
        [
            photo_error(sights[i], piece, i, most=True) if is_oriented else np.nan
            for i, is_oriented in photos
        ]
    )


def contradictions(sights, piece, sure):
    """Share of photos, plus share of known points, that contradict the images.

    Parameters
    ----------
    sights : sequence of Sight
    piece : Piece
    sure : ndarray of bool, shape (points,)
        Points with certain positions.
    """
    if not sights:
        return 0.0
    errors = photo_errors(sights, piece)
    errors_of_photos = [_errors(sights[i], piece, i) for i in np.flatnonzero(piece.oriented)]
    number = np.concatenate([part for part, _ in errors_of_photos] + [np.zeros(0, dtype=int)])
    off = np.concatenate([part for _, part in errors_of_photos] + [np.zeros(0)])
    is_sure = sure[number]
    _, middle = medians(number[is_sure], np.minimum(off[is_sure], 1e3))
    wrong = float(np.mean(middle > AT_ODDS)) if len(middle) else 0.0
    return float(np.mean(~(errors < AT_ODDS))) + wrong


def _errors(sight, piece, photo):
    """Known points (n,) in a photo, and their errors (n,) over c."""
    known = piece.known[sight.point]
    points, ideal = piece.xyz_m[sight.point[known]], sight.ideal[known]
    pose = piece.place_m[photo][None], piece.rotation[photo][None]
    return sight.point[known], image_errors(points, ideal, *pose)[0]


def guess_places(sights, piece):
    """Place points on a ray if their rays from two or more photos do not intersect."""
    photos = np.flatnonzero(piece.oriented)
    rays = np.bincount(
        np.concatenate([sights[i].point for i in photos] + [np.zeros(0, dtype=int)]),
        minlength=len(piece.xyz_m),
    )
    xyz, known = piece.xyz_m.copy(), piece.known
    for photo in photos:
        sight = sights[photo]
        is_known = known[sight.point]
        unplaced = ~is_known & (rays[sight.point] > 1) & np.isnan(xyz[sight.point]).all(axis=1)
        if is_known.any() and unplaced.any():
            away = xyz[sight.point[is_known]] - piece.place_m[photo]
            # The median distance of the known points in the photo is the best guess of the depth.
            far = np.median(np.linalg.norm(away, axis=1))
            ray = bearings(sight.ideal[unplaced]) @ piece.rotation[photo]
            xyz[sight.point[unplaced]] = piece.place_m[photo] + far * ray
    return replace(piece, xyz_m=xyz)


def photo_error(sight, piece, photo, most=False):
    """Median error over c of a photo's known points; nan: no such point.

    Parameters
    ----------
    sight : Sight
    piece : Piece
    photo : int
    most : bool
        True: the error met by more than half of the points, as in resection.
    """
    errors = _errors(sight, piece, photo)[1][None]
    if not errors.size:
        return np.nan
    return float(agreed_error(errors)[0] if most else np.median(errors))
