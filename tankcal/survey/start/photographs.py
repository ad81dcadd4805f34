"""Growth of a piece by photographs: resection of photos and intersection of points, in turn."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera.model import correct_image_points
from tankcal.survey.start.resection import (
    Pose,
    bearings,
    candidates,
    find_poses,
    intersect_rays,
    refine_pose,
)

ENOUGH = 4  # points that determine the pose of a photo uniquely
SURE = 6  # points with which a pose withstands a blunder
DECIDED = 0.5  # misfit ratio to the second best pose, below which a pose is decided
WORST_ERROR = 0.02  # largest error over c of an accepted pose: 2 mm at c = 100 mm
FLAT_WALL = 0.03  # relative scatter about a circle below which points lie on a wall
RAYS = 12  # rays used of a point with more
SHARE = 0.5  # share of the most known points below which a photo waits for more


@dataclass(frozen=True)
class Sight:
    """Ideal image points over c (n, 2) of a photo, and the numbers of their points (n,)."""

    point: np.ndarray
    ideal: np.ndarray


@dataclass(frozen=True)
class Wall:
    """Vertical cylinder through the points: centre_m (2,) and radius_m."""

    centre_m: np.ndarray
    radius_m: float


def sights_of(survey):
    """Sight of each photo, without rejected image points."""
    photos, images = survey.photos, survey.image_points
    if photos is None:
        return ()
    if images is None:
        return (Sight(np.zeros(0, dtype=int), np.zeros((0, 2))),) * len(photos.names)
    accepted = np.flatnonzero(images.in_use)
    accepted = accepted[np.argsort(images.photo[accepted], kind="stable")]
    cuts = np.searchsorted(images.photo[accepted], np.arange(len(photos.names) + 1))
    sights = []
    for number, camera in enumerate(photos.camera):
        rows, setup = accepted[cuts[number] : cuts[number + 1]], survey.cameras[camera]
        ideal = correct_image_points(images.value[rows], setup.values, setup.form) / setup.values[0]
        sights.append(Sight(images.point[rows], ideal))
    return tuple(sights)


def grow_by_photos(sights, piece, rng, wall=None, least=3):
    """Grow a Piece by all photos and points that follow from it.

    Photos with most known points come first, those with six before those with four. A photo with
    three known points waits for tie points, or for the wall, to select its pose.

    Parameters
    ----------
    sights : sequence of Sight
    piece : Piece
    rng : numpy.random.Generator
    wall : Wall, optional
    least : int
        Known points required in a photo: SURE, ENOUGH or 3.

    Returns
    -------
    Piece
    """
    if not sights:
        return piece
    piece = add_points(sights, piece)
    tried = np.zeros(len(sights), dtype=int)
    for required in [number for number in (SURE, ENOUGH, 3) if number >= least]:
        while True:
            before = piece.oriented.sum()
            piece = _add_photos(sights, piece, required, rng, wall, tried)
            if piece.oriented.sum() == before:
                break
            piece = add_points(sights, piece)
            # New points may give other photos more than the required number: start again with the
            # best.
            if required < SURE:
                return grow_by_photos(sights, piece, rng, wall, least)
    return piece


def _add_photos(sights, piece, required, rng, wall, tried):
    """Add photos with at least `required` known points, and not far fewer than the others.

    Parameters
    ----------
    sights : sequence of Sight
    piece : Piece
    required : int
    rng : numpy.random.Generator
    wall : Wall or None
    tried : ndarray of int, shape (photos,)
        Known points at the last failed attempt; updated in place.
    """
    known, waiting = piece.known, np.flatnonzero(~piece.oriented)
    counts = np.array([known[sights[photo].point].sum() for photo in waiting], dtype=int)
    ready = (counts >= required) & (counts > tried[waiting])
    if not ready.any():
        return piece
    ready &= counts >= SHARE * counts[ready].max()
    place, rotation = piece.place_m.copy(), piece.rotation.copy()
    for photo, count in zip(waiting[ready], counts[ready], strict=True):
        pose = _pose(piece, sights, photo, rng, wall)
        if pose is None:
            tried[photo] = count
        else:
            place[photo], rotation[photo] = pose.xyz_m, pose.rotation
    return replace(piece, place_m=place, rotation=rotation)


def _pose(piece, sights, photo, rng, wall):
    """Pose of a photo from its known points, or None."""
    sight = sights[photo]
    known = piece.known[sight.point]
    points, ideal = piece.xyz_m[sight.point[known]], sight.ideal[known]
    if len(np.unique(sight.point[known])) < 3:
        return None
    poses = _three(points, ideal) if len(points) == 3 else find_poses(points, ideal, rng)
    poses = [pose for pose in poses if pose.error < WORST_ERROR]
    if len(points) > 3 and len(poses) < 2:
        return poses[0] if poses else None
    return _decide_pose(points, poses, piece, sights, photo, wall)


def _three(points, ideal):
    """Poses from exactly three points."""
    candidates_of_three = zip(*candidates(points, ideal), strict=True)
    return [
        refine_pose(points, ideal, Pose(*position_and_rotation, 0.0))
        for position_and_rotation in candidates_of_three
    ]


def _decide_pose(points, poses, piece, sights, photo, wall):
    """The Pose selected by tie points or the wall among poses that fit the known points, or
    None."""
    if wall is not None:
        poses = [pose for pose in poses if _facing(wall, points, pose.xyz_m)]
    if not poses:
        return None
    misses = [_miss(piece, sights, photo, pose) for pose in poses]
    order = np.argsort(misses)
    if len(poses) > 1 and not misses[order[0]] <= DECIDED * misses[order[1]]:
        return None
    # Without a tie point and without a wall there is no evidence.
    if np.isinf(misses[order[0]]) and wall is None:
        return None
    return poses[order[0]]


def _facing(wall, points, centre):
    """Whether a camera is inside the wall, or outside with every point facing it."""
    out = (points[:, :2] - wall.centre_m) / wall.radius_m
    towards = np.sum((centre[:2] - points[:, :2]) * out, axis=1)
    return bool((towards > 0).all()) or np.linalg.norm(centre[:2] - wall.centre_m) < wall.radius_m


def wall_of(xyz_m):
    """The Wall through points (n, 3), or None if they do not lie on a vertical cylinder."""
    xy = xyz_m[np.isfinite(xyz_m).all(axis=1), :2]
    if len(xy) < 8:
        return None
    middle = np.median(xy, axis=0)
    x, y = (xy - middle).T
    rows = np.column_stack([2 * x, 2 * y, np.ones_like(x)])
    if np.linalg.matrix_rank(rows) < 3:
        return None
    # Linear circle fit: x^2 + y^2 = 2 a x + 2 b y + c.
    a, b, c = np.linalg.lstsq(rows, x * x + y * y, rcond=None)[0]
    radius = float(np.sqrt(max(c + a * a + b * b, 0.0)))
    off = np.abs(np.hypot(x - a, y - b) - radius)
    if not np.median(off) < FLAT_WALL * radius or radius > 3 * np.ptp(xy, axis=0).max():
        return None
    return Wall(middle + [a, b], radius)


def _miss(piece, sights, photo, pose):
    """Median sine of the distance between rays of a pose and rays of other photos to the same
    points."""
    sight, sines = sights[photo], []
    for other_photo in np.flatnonzero(piece.oriented):
        _, i, j = np.intersect1d(sight.point, sights[other_photo].point, return_indices=True)
        if not len(i):
            continue
        rays = bearings(sight.ideal[i]) @ pose.rotation
        other_rays = bearings(sights[other_photo].ideal[j]) @ piece.rotation[other_photo]
        base = piece.place_m[other_photo] - pose.xyz_m
        # Rays to one point lie in the epipolar plane through the base.
        plane = np.cross(base / np.linalg.norm(base), other_rays)
        length = np.maximum(np.linalg.norm(plane, axis=1), 1e-6)
        sines.append(np.abs(np.sum(plane * rays, axis=1)) / length)
    return float(np.median(np.concatenate(sines))) if sines else np.inf


def add_points(sights, piece):
    """Add or improve points by intersection of the rays of oriented photos."""
    photos = np.flatnonzero(piece.oriented)
    if not len(photos):
        return piece
    owner = np.concatenate([sights[photo].point for photo in photos])
    if not len(owner):
        return piece
    photo = np.repeat(photos, [len(sights[photo].point) for photo in photos])
    ideal = np.concatenate([sights[photo].ideal for photo in photos])
    if len(owner) > RAYS * len(piece.xyz_m):
        few = _spread(owner)
        owner, photo, ideal = owner[few], photo[few], ideal[few]
    rays = np.einsum("ni,nij->nj", bearings(ideal), piece.rotation[photo])
    intersections, count = intersect_rays(piece.place_m[photo], rays, owner, len(piece.xyz_m))
    better = np.isfinite(intersections).all(axis=1) & (count > 1)
    # Points from photos are replaced by the new intersection; other points only completed.
    improved = (better & piece.by_photos)[:, None]
    missing = better[:, None] & ~np.isfinite(piece.xyz_m)
    return replace(
        piece,
        xyz_m=np.where(improved | missing, intersections, piece.xyz_m),
        by_photos=piece.by_photos,
    )


def _spread(owner):
    """Indices of at most RAYS rays of each point, evenly spread."""
    order = np.argsort(owner, kind="stable")
    count = np.bincount(owner)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    total = np.repeat(count, count)
    step = np.maximum(-(-total // RAYS), 1)
    return order[rank % step == 0]
