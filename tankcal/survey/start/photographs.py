"""How a piece grows by photographs: photos by resection, points by intersection, in turn."""

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

ENOUGH = 4  # points from which a photo's place is unambiguous
SURE = 6  # points from which it withstands a blunder
DECIDED = 0.5  # how much better than the next a pose of three points must fit the tie points
WORST_ERROR = 0.02  # error over c of a pose that is believed: 2 mm at c = 100 mm
FLAT_WALL = 0.03  # scatter about a circle, over its radius, below which points lie on a wall
RAYS = 12  # of a point that are used of more
SHARE = 0.5  # photos with fewer than this share of the most known points wait for more


@dataclass(frozen=True)
class Sight:
    """Ideal image points over c (n, 2) of a photo, and the points they show (n,)."""

    point: np.ndarray
    ideal: np.ndarray


@dataclass(frozen=True)
class Wall:
    """A standing cylinder on which the points lie: centre_m (2,) and radius_m."""

    centre_m: np.ndarray
    radius_m: float


def sights_of(survey):
    """The Sight of each photo, image points that are set aside left out."""
    photos, images = survey.photos, survey.image_points
    if photos is None:
        return ()
    if images is None:
        return (Sight(np.zeros(0, dtype=int), np.zeros((0, 2))),) * len(photos.names)
    used = np.flatnonzero(images.in_use)
    used = used[np.argsort(images.photo[used], kind="stable")]
    cuts = np.searchsorted(images.photo[used], np.arange(len(photos.names) + 1))
    found = []
    for number, camera in enumerate(photos.camera):
        mine, setup = used[cuts[number] : cuts[number + 1]], survey.cameras[camera]
        ideal = correct_image_points(images.value[mine], setup.values, setup.form) / setup.values[0]
        found.append(Sight(images.point[mine], ideal))
    return tuple(found)


def grow_by_photos(sights, piece, rng, wall=None, least=3):
    """The Piece with all photos and points that its points and photos give.

    least  known points that a photo must see: SURE, ENOUGH or 3

    Photos that see most known points come first, those with six before those with four; a photo
    with three waits for tie points, or the wall, to decide which of its poses it is.
    """
    if not sights:
        return piece
    piece = add_points(sights, piece)
    tried = np.zeros(len(sights), dtype=int)
    for needed in [number for number in (SURE, ENOUGH, 3) if number >= least]:
        while True:
            before = piece.oriented.sum()
            piece = _with_photos(sights, piece, needed, rng, wall, tried)
            if piece.oriented.sum() == before:
                break
            piece = add_points(sights, piece)
            if needed < SURE:  # those that it brought may suffice for more of the better ones
                return grow_by_photos(sights, piece, rng, wall, least)
    return piece


def _with_photos(sights, piece, needed, rng, wall, tried):
    """The Piece with photos that see at least `needed` known points and no far fewer than others.

    tried  (photos,) known points at the last attempt in vain, updated here
    """
    known, waiting = piece.known, np.flatnonzero(~piece.oriented)
    counts = np.array([known[sights[photo].point].sum() for photo in waiting], dtype=int)
    ready = (counts >= needed) & (counts > tried[waiting])
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
    """The Pose of a photo from the known points that it sees, or None."""
    sight = sights[photo]
    known = piece.known[sight.point]
    points, ideal = piece.xyz_m[sight.point[known]], sight.ideal[known]
    if len(np.unique(sight.point[known])) < 3:
        return None
    found = _three(points, ideal) if len(points) == 3 else find_poses(points, ideal, rng)
    found = [pose for pose in found if pose.error < WORST_ERROR]
    if len(points) > 3 and len(found) < 2:
        return found[0] if found else None
    return _decided(points, found, piece, sights, photo, wall)


def _three(points, ideal):
    """The Poses for exactly three points."""
    both = zip(*candidates(points, ideal), strict=True)
    return [refine_pose(points, ideal, Pose(*one, 0.0)) for one in both]


def _decided(points, found, piece, sights, photo, wall):
    """The Pose, of those that fit the known points, that tie points or the wall decide on."""
    if wall is not None:
        found = [pose for pose in found if _facing(wall, points, pose.xyz_m)]
    if not found:
        return None
    misses = [_miss(piece, sights, photo, pose) for pose in found]
    order = np.argsort(misses)
    if len(found) > 1 and not misses[order[0]] <= DECIDED * misses[order[1]]:
        return None
    if np.isinf(misses[order[0]]) and wall is None:
        return None
    return found[order[0]]


def _facing(wall, points, centre):
    """Whether a camera is outside, every point facing it, or inside the wall."""
    out = (points[:, :2] - wall.centre_m) / wall.radius_m
    towards = np.sum((centre[:2] - points[:, :2]) * out, axis=1)
    return bool((towards > 0).all()) or np.linalg.norm(centre[:2] - wall.centre_m) < wall.radius_m


def wall_of(xyz_m):
    """The Wall through points (n, 3), or None when they do not lie on a standing cylinder."""
    xy = xyz_m[np.isfinite(xyz_m).all(axis=1), :2]
    if len(xy) < 8:
        return None
    middle = np.median(xy, axis=0)
    x, y = (xy - middle).T
    rows = np.column_stack([2 * x, 2 * y, np.ones_like(x)])
    if np.linalg.matrix_rank(rows) < 3:
        return None
    a, b, c = np.linalg.lstsq(rows, x * x + y * y, rcond=None)[0]
    radius = float(np.sqrt(max(c + a * a + b * b, 0.0)))
    off = np.abs(np.hypot(x - a, y - b) - radius)
    if not np.median(off) < FLAT_WALL * radius or radius > 3 * np.ptp(xy, axis=0).max():
        return None
    return Wall(middle + [a, b], radius)


def _miss(piece, sights, photo, pose):
    """Median sine by which rays of a pose pass those of other photos to the same points."""
    mine, found = sights[photo], []
    for other in np.flatnonzero(piece.oriented):
        _, i, j = np.intersect1d(mine.point, sights[other].point, return_indices=True)
        if not len(i):
            continue
        here = bearings(mine.ideal[i]) @ pose.rotation
        there = bearings(sights[other].ideal[j]) @ piece.rotation[other]
        base = piece.place_m[other] - pose.xyz_m
        plane = np.cross(base / np.linalg.norm(base), there)
        length = np.maximum(np.linalg.norm(plane, axis=1), 1e-6)
        found.append(np.abs(np.sum(plane * here, axis=1)) / length)
    return float(np.median(np.concatenate(found))) if found else np.inf


def add_points(sights, piece):
    """The Piece with what its photos say about points that are not known, or only by photos."""
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
    found, count = intersect_rays(piece.place_m[photo], rays, owner, len(piece.xyz_m))
    better = np.isfinite(found).all(axis=1) & (count > 1)
    improved = (better & piece.by_photos)[:, None]
    missing = better[:, None] & ~np.isfinite(piece.xyz_m)
    return replace(
        piece,
        xyz_m=np.where(improved | missing, found, piece.xyz_m),
        by_photos=piece.by_photos,
    )


def _spread(owner):
    """Indices of at most RAYS rays of each point, spread over its rays."""
    order = np.argsort(owner, kind="stable")
    count = np.bincount(owner)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    total = np.repeat(count, count)
    step = np.maximum(-(-total // RAYS), 1)
    return order[rank % step == 0]
