"""Approximate values, unasked: for photos, points and circles, from whatever was observed.

What is known for certain (control, fixed or weighted photos) grows first: photos by resection,
points by intersection, stations and points in plan, heights. Then come values that are only
approximate (nominal coordinates), in a frame of their own where enough is common to turn it. Last
come local frames: photos by relative orientation, set-ups from their own readings.
"""

from dataclasses import replace

import numpy as np

from tankcal.survey.start.clues import Clues, grow_piece
from tankcal.survey.start.known import certain_places, hinted_places
from tankcal.survey.start.loose_frames import join_local_frames
from tankcal.survey.start.photographs import SURE, add_points, sights_of
from tankcal.survey.start.pieces import BAD_JOINT, joint
from tankcal.survey.start.plan import plan_of
from tankcal.survey.start.plan_frames import find_plan_positions
from tankcal.survey.start.polar import orient_circles
from tankcal.survey.start.repair import contradictions, guess_places, photo_error, repair_photos
from tankcal.survey.start.single_points import sought_point
from tankcal.survey.start.unstarted import (
    LISTED,
    loose_frame_sentence,
    refuse_missing,
    unfixed_point_error,
)

TRIALS = 3  # with other samples, while the images contradict what was found
ODDS = 0.05  # share of photos and known points that may be at odds with the images
KEPT_ERROR = 0.05  # error over c of a given photo beyond which its values are found anew
MOSTLY = 0.5  # share of given photos that must agree with one another for any to be believed
KEPT_SHARE = 0.05  # of the extent: given values farther from what was found are replaced
ENOUGH = 3  # places common to two frames


def nominal_places(generatrix, generatrices, z_m, radius_m, offset_m=0.0):
    """Nominal coordinates (n, 3) of targets: generatrices counted clockwise from +y, from 1."""
    azimuth = 2 * np.pi * (np.asarray(generatrix) - 1) / generatrices
    r = radius_m + np.asarray(offset_m)
    return np.column_stack([r * np.sin(azimuth), r * np.cos(azimuth), z_m])


def approximate(survey, seed=0, wall=None):
    """The Survey with start values for all points, photos and direction sets that had none (nan).

    wall  Wall on which the points lie, in the survey's frame; it decides between the poses of a
          photo that sees three known points. None: found from the known points, where they lie so

    Given values that contradict the image points are replaced as well, unless they are fixed or
    observed. Raises SolutionError naming everything that is left, and why.
    """
    sure, hints = certain_places(survey), hinted_places(survey)
    if _complete(survey, hints.piece):
        return survey
    centre = _centre(sure, hints)
    sure, hints = sure.shifted(-centre), hints.shifted(-centre)
    if wall is not None:
        wall = replace(wall, centre_m=wall.centre_m - centre[:2])
    found = []
    for trial in range(TRIALS):
        clues = Clues(
            survey,
            sights_of(survey),
            plan_of(survey),
            wall,
            np.random.default_rng([seed, trial]),
            trial,
        )
        piece, reasons = _found(clues, sure, hints)
        known = np.isfinite(sure.piece.xyz_m).all(axis=1)
        missing = float(np.mean(~piece.oriented)) if len(piece.oriented) else 0.0
        odds = missing + contradictions(clues.sights, piece, known)
        found.append((odds, trial, piece, reasons))
        if odds < ODDS:
            break
    _, _, piece, reasons = min(found, key=lambda one: one[:2])
    return _filled(clues, piece, sure, hints, centre, reasons)


def _found(clues, sure, hints):
    """A Piece with all that could be found, and sentences about what did not join."""
    piece, reasons = sure.piece, []
    for least in (SURE, 3):  # photos that see few known points are better placed by other photos
        piece = grow_piece(clues, piece, least)
        piece = _with_hints(clues, piece, sure, hints, least)
        grown = int(piece.known.sum())
        piece, reasons = join_local_frames(clues, piece, hints.piece.place_m, least)
        if clues.survey.photos is None and piece.known.sum() == grown:
            break  # without photographs and new points the second pass is the first one
    soft = hints.piece.known & ~np.isfinite(sure.piece.xyz_m).any(axis=1)
    piece = add_points(clues.sights, replace(piece, by_photos=piece.by_photos | soft))
    piece = repair_photos(clues.sights, piece, sure.piece.oriented, clues.rng, clues.wall)
    return guess_places(clues.sights, piece), reasons


def _complete(survey, given):
    """Whether every start value is there and no photo contradicts its image points."""
    if np.isnan(survey.xyz_m).any() or np.isnan(survey.sets).any():
        return False
    if survey.photos is None:
        return True
    if not given.oriented.all():
        return False
    errors = [photo_error(sight, given, i) for i, sight in enumerate(sights_of(survey))]
    return bool(np.all(np.nan_to_num(errors) < KEPT_ERROR))


def _centre(sure, hints):
    """Middle (3,) of what is known, each axis on its own."""
    places = np.vstack([one for known in (sure, hints)
                        for one in (known.piece.xyz_m, known.piece.place_m)])  # fmt: skip
    count = np.isfinite(places).sum(axis=0)
    return np.nansum(places, axis=0) / np.maximum(count, 1)


def _with_hints(clues, piece, sure, hints, least):
    """The Piece with what approximate values add, joined by common places or taken as they are."""
    if _all_found(piece) or hints.nothing:
        return piece
    if (piece.known.sum() + piece.oriented.sum()) >= ENOUGH:
        own = grow_piece(clues, _credible(clues, hints.without(sure).piece), least)
        common = (own.known & piece.known).sum() + (own.oriented & piece.oriented).sum()
        motion = joint(own, piece, clues.rng) if common >= ENOUGH else None
        if motion is not None and motion.misfit_m < BAD_JOINT * piece.extent:
            joined = piece.filled_from(own.moved(motion))
            return grow_piece(clues, add_points(clues.sights, joined), least)
    merged = _credible(clues, piece.filled_from(hints.piece), piece.oriented)
    return grow_piece(clues, merged, least)


def _credible(clues, piece, held=False):
    """The Piece without photos whose image points contradict its points and other photos.

    held  (photos,) True for those that stay whatever their image points say

    Where most are wrong the others may only seem right: then all go.
    """
    given = piece.oriented & ~np.asarray(held)
    left = given.copy()
    while left.any():
        piece = _without(piece, given & ~left)
        trial, photos = add_points(clues.sights, piece), np.flatnonzero(left)
        errors = np.array([photo_error(clues.sights[i], trial, i) for i in photos])
        bad = errors > KEPT_ERROR
        if not bad.any():
            break
        order = np.argsort(-np.nan_to_num(errors, nan=np.inf))
        left[photos[order[: max(1, bad.sum() // 2)]]] = False
        if left.sum() < MOSTLY * given.sum():
            left[:] = False
    return _without(piece, given & ~left)


def _without(piece, photos):
    """The Piece without photos (photos,) that are True."""
    return replace(
        piece,
        place_m=np.where(photos[:, None], np.nan, piece.place_m),
        rotation=np.where(photos[:, None, None], np.nan, piece.rotation),
    )


def _all_found(piece):
    return piece.known.all() and piece.oriented.all()


def _filled(clues, piece, sure, hints, centre, reasons):
    """The Survey with the start values, given ones kept where they agree with what was found."""
    survey, given = clues.survey, hints.piece
    xyz = np.where(np.isfinite(sure.piece.xyz_m), sure.piece.xyz_m, piece.xyz_m)
    off = np.linalg.norm(given.xyz_m - xyz, axis=1)
    keep = np.isfinite(given.xyz_m) & ~(off > KEPT_SHARE * piece.extent)[:, None]
    untouched = keep | (np.isfinite(survey.xyz_m) & np.isnan(given.xyz_m))
    xyz = np.where(untouched, survey.xyz_m - centre, xyz)
    zeros = orient_circles(clues.plan, xyz[:, :2])[: len(survey.sets)]
    zeros = np.where(clues.plan.at[: len(zeros)] < 0, 0.0, zeros)  # nothing was read on these
    sets = np.where(np.isfinite(survey.sets), survey.sets, zeros)
    told = {}
    if np.isnan(xyz[:, :2]).any():
        told = _told(clues, xyz, centre)
        _, apart = find_plan_positions(clues.plan, xyz[:, :2], xyz[:, 2], clues.rng)
        reasons = reasons + [
            loose_frame_sentence(survey, local.known, np.isfinite(xyz[:, 0]))
            for local in apart
            if not (local.known & np.isnan(xyz[:, 0]))[list(told)].any()
        ]
    xyz = refuse_missing(survey, clues.sights, xyz, piece, sets, reasons, told.get)
    xyz = np.where(untouched, survey.xyz_m, xyz + centre)
    if survey.fixed is not None:
        xyz = np.where(survey.fixed & np.isfinite(survey.xyz_m), survey.xyz_m, xyz)
    return replace(survey, xyz_m=xyz, photos=_photos(survey, piece, given, centre), sets=sets)


def _told(clues, xyz_m, centre):
    """{point: why} of points in plan that are tied to known ones, and not fixed by that."""
    told = {}
    for point in np.flatnonzero(np.isnan(xyz_m[:, :2]).any(axis=1))[:LISTED]:
        found = sought_point(clues.survey, clues.plan, xyz_m, point, clues.sought)
        if found.rows:
            told[int(point)] = unfixed_point_error(clues.survey, found, point, centre)
    return told


def _photos(survey, piece, given, centre):
    """The Photos with start values; those that were given and stayed are not touched."""
    photos = survey.photos
    if photos is None:
        return None
    stayed = (piece.place_m == given.place_m).all(axis=1)
    held = np.zeros((len(stayed), 4), dtype=bool) if photos.fixed is None else photos.fixed
    place = np.where(stayed[:, None] | held[:, :3], photos.xyz_m, piece.place_m + centre)
    rotation = np.where(held[:, 3, None, None], photos.rotation, piece.rotation)
    return replace(photos, xyz_m=place, rotation=rotation)
