"""Approximate values, unasked: photos by resection, points by intersection, one from the other."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera import corrected
from tankcal.errors import SolutionError
from tankcal.network.resection import (
    Pose,
    bearings,
    candidates,
    intersected,
    refined,
    resected,
)

ENOUGH = 4  # points from which a photo's place is unambiguous
DECIDED = 0.5  # how much better than the next a pose of three points must fit the tie points
WORST_ERROR = 0.02  # median error over c of a pose that is believed: 2 mm at c = 100 mm


@dataclass(frozen=True)
class Sight:
    """Ideal image points over c (n, 2) of a photo, and the points they show (n,)."""

    point: np.ndarray
    ideal: np.ndarray


def on_tank(generatrix, generatrices, z_m, radius_m, offset_m=0.0):
    """Nominal coordinates (n, 3) of targets: generatrices counted clockwise from +y, from 1."""
    azimuth = 2 * np.pi * (np.asarray(generatrix) - 1) / generatrices
    r = radius_m + np.asarray(offset_m)
    return np.column_stack([r * np.sin(azimuth), r * np.cos(azimuth), z_m])


def approximate(survey, seed=0):
    """The Survey with start values for all photos and points that had none (nan).

    Points with coordinates (control, nominal geometry) give the photos that see at least four of
    them, these give the points that two of them see, and so on; a photo with three known points
    waits for others to decide which of its poses it is. Raises SolutionError naming what is left.
    """
    rng, photos = np.random.default_rng(seed), survey.photos
    xyz = np.array(survey.xyz_m, dtype=float)
    given = np.isfinite(xyz).all(axis=1)
    centre = np.nanmean(xyz, axis=0) if given.any() else np.zeros(3)
    xyz = xyz - centre
    place = np.array(photos.xyz_m, dtype=float) - centre
    rotation = np.array(photos.rotation, dtype=float)
    done = np.isfinite(place).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
    sights = [_sight(survey, photo) for photo in range(len(photos.names))]
    for needed in (ENOUGH + 2, ENOUGH, 3):
        progress = True
        while progress and not done.all():
            progress = False
            for photo in np.flatnonzero(~done):
                pose = _pose(xyz, sights[photo], needed, rng)
                if pose is None and needed == 3:
                    pose = _pose_by_ties(xyz, photo, sights, place, rotation, done)
                if pose is not None:
                    place[photo], rotation[photo] = pose.xyz_m, pose.rotation
                    done[photo] = progress = True
            xyz = _more_points(xyz, given, sights, place, rotation, done)
            if progress and needed == 3:
                break
    xyz = _more_points(xyz, given, sights, place, rotation, done)
    _refuse(survey, xyz, done, sights)
    return replace(
        survey,
        xyz_m=xyz + centre,
        photos=replace(photos, xyz_m=place + centre, rotation=rotation),
    )


def _sight(survey, photo):
    images = survey.image_points
    mine = images.photo == photo
    if images.use is not None:
        mine &= images.use > 0
    camera = survey.cameras[survey.photos.camera[photo]]
    ideal = corrected(images.xy_mm[mine], camera.values, camera.form) / camera.values[0]
    return Sight(images.point[mine], ideal)


def _pose(xyz, sight, needed, rng):
    """The Pose of a photo that sees at least `needed` known points, or None."""
    known = np.isfinite(xyz[sight.point]).all(axis=1)
    if known.sum() < needed:
        return None
    points, ideal = xyz[sight.point[known]], sight.ideal[known]
    if known.sum() == 3:
        return None
    pose = resected(points, ideal, rng)
    if pose is None or pose.error > WORST_ERROR:
        return None
    return pose


def _pose_by_ties(xyz, photo, sights, place, rotation, done):
    """The Pose of a photo with three known points, decided by rays that it shares with others."""
    sight = sights[photo]
    known = np.isfinite(xyz[sight.point]).all(axis=1)
    if known.sum() != 3:
        return None
    points, ideal = xyz[sight.point[known]], sight.ideal[known]
    centres, rotations = candidates(points, ideal)
    misses = [
        _miss(centre, turn, photo, sights, place, rotation, done)
        for centre, turn in zip(centres, rotations, strict=True)
    ]
    order = np.argsort(misses)
    if not len(order) or (len(order) > 1 and misses[order[0]] > DECIDED * misses[order[1]]):
        return None
    return refined(points, ideal, Pose(centres[order[0]], rotations[order[0]], 0.0))


def _miss(centre, turn, photo, sights, place, rotation, done):
    """Median sine by which rays of a pose pass those of other photos to the same points."""
    mine, found = sights[photo], []
    for other in np.flatnonzero(done):
        _, i, j = np.intersect1d(mine.point, sights[other].point, return_indices=True)
        if not len(i):
            continue
        here = bearings(mine.ideal[i]) @ turn
        there = bearings(sights[other].ideal[j]) @ rotation[other]
        base = place[other] - centre
        plane = np.cross(base / np.linalg.norm(base), there)
        length = np.maximum(np.linalg.norm(plane, axis=1), 1e-6)
        found.append(np.abs(np.sum(plane * here, axis=1)) / length)
    return float(np.median(np.concatenate(found))) if found else np.inf


def _more_points(xyz, given, sights, place, rotation, done):
    """Coordinates with what the photos that are known say about the points that were not given."""
    photos = [photo for photo in np.flatnonzero(done)]
    if not photos:
        return xyz
    owner = np.concatenate([sights[photo].point for photo in photos])
    rays = [bearings(sights[photo].ideal) @ rotation[photo] for photo in photos]
    centres = [np.tile(place[photo], (len(sights[photo].point), 1)) for photo in photos]
    found, count = intersected(np.vstack(centres), np.vstack(rays), owner, len(xyz))
    better = ~given & np.isfinite(found).all(axis=1) & (count > 1)
    return np.where(better[:, None], found, xyz)


def _refuse(survey, xyz, done, sights):
    """Raise when a photo, or a point that something observes, has no start."""
    seen = np.unique(np.concatenate([sight.point for sight in sights]))
    missing = seen[~np.isfinite(xyz[seen]).all(axis=1)]
    if done.all() and not len(missing):
        return
    told = []
    for photo in np.flatnonzero(~done):
        known = np.isfinite(xyz[sights[photo].point]).all(axis=1).sum()
        told.append(f"photo {survey.photos.names[photo]} ({known} known points)")
    told += [f"point {survey.points[point]}" for point in missing[:10]]
    raise SolutionError("no approximate values for " + ", ".join(told))
