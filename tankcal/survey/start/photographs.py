"""Growth of a piece by photographs: resection of photos and intersection of points, in turn.

Space resection of single photos without approximate values.

Three points give up to four poses (Grunert). Many triples are tried, and the pose with which more
than half of the points agree best is used, so nearly half of the points may be blunders. Of n
points, the error at position n // 2 + 2 counts, as the three points of the triple fit by
construction. Source: Haralick et al. 1994, Review and analysis of solutions of the three point
perspective pose estimation problem; Rousseeuw & Leroy 1987 (least median of squares).
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tankcal.adjust import gauss_newton
from tankcal.camera.model import correct_image_points
from tankcal.geometry.rotations import apply_small_rotation

ENOUGH = 4  # points that determine the pose of a photo uniquely
SURE = 6  # points with which a pose withstands a blunder
DECIDED = 0.5  # misfit ratio to the second best pose, below which a pose is decided
WORST_ERROR = 0.02  # largest error over c of an accepted pose: 2 mm at c = 100 mm
FLAT_WALL = 0.03  # relative scatter about a circle below which points lie on a wall
RAYS = 12  # rays used of a point with more
SHARE = 0.5  # share of the most known points below which a photo waits for more
TRIPLES = 120  # samples of three points
RAY_ROUNDS = 12  # iterations of the weights of rays
JUDGES = 100  # points used to compare poses
REFINING = 400  # points used to refine a pose
REFINING_STEPS = 15
FLAT = 0.02  # height over length below which three points lie on a line
FEW = 8  # points below which several poses may fit
TRIED = 20  # poses of few points that are refined
SAME = 0.05  # relative distance below which two positions are equal
RIVAL = 4.0  # error ratio to the best pose, below which another pose is returned
NOISE = 3e-3  # error over c regarded as noise: 0.3 mm at c = 100 mm, camera not calibrated


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


# ---- space resection of single photos without approximate values


@dataclass(frozen=True)
class Pose:
    """A pose: xyz_m (3,), rotation (3, 3), and the image error over c met by most points."""

    xyz_m: np.ndarray
    rotation: np.ndarray
    error: float


def resect(xyz_m, ideal, rng):
    """Best Pose of a photo.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        n at least 4.
    ideal : ndarray, shape (n, 2)
        Ideal image points over c.
    rng : numpy.random.Generator

    Returns
    -------
    Pose or None
    """
    poses = find_poses(xyz_m, ideal, rng)
    return poses[0] if poses else None


def find_poses(xyz_m, ideal, rng):
    """Best Pose of a photo and, for few points, other poses that fit.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
    ideal : ndarray, shape (n, 2)
        Ideal image points over c.
    rng : numpy.random.Generator

    Returns
    -------
    list of Pose
        The best first.
    """
    n = len(xyz_m)
    triples = rng.integers(0, n, (TRIPLES, 3))
    # A sample with a repeated point has no solution.
    triples = triples[(np.diff(np.sort(triples, axis=1), axis=1) > 0).all(axis=1)]
    if n < FEW:
        triples = np.array(list(combinations(range(n), 3)))
    centres, rotations = three_point_poses(xyz_m[triples], bearings(ideal)[triples])
    if not len(centres):
        return []
    judges = rng.choice(n, JUDGES, replace=False) if n > JUDGES else slice(None)
    errors = agreed_error(image_errors(xyz_m[judges], ideal[judges], centres, rotations))
    many = rng.choice(n, REFINING, replace=False) if n > REFINING else slice(None)
    xyz_m, ideal = xyz_m[many], ideal[many]
    order = np.argsort(errors)[: 1 if n >= FEW else TRIED]
    poses = []
    for best in order[np.isfinite(errors[order])]:
        pose = refine_pose(xyz_m, ideal, Pose(centres[best], rotations[best], float(errors[best])))
        if not any(_are_alike(pose, pose_before, xyz_m) for pose_before in poses):
            poses.append(pose)
    poses.sort(key=lambda pose: pose.error)
    return [item for item in poses if item.error <= RIVAL * poses[0].error + NOISE]


def _are_alike(first, second, xyz_m):
    """Whether two poses have the same position, relative to the distance of the points."""
    away = np.median(np.linalg.norm(xyz_m - second.xyz_m, axis=1))
    return np.linalg.norm(first.xyz_m - second.xyz_m) < SAME * away


def agreed_error(errors):
    """Error (k,) met by more than half of the points, of errors (k, n), n at least 4."""
    n = errors.shape[1]
    place = min(n, n // 2 + 2) - 1
    return np.partition(errors, place, axis=1)[:, place]


def candidates(xyz_m, ideal):
    """All poses (k, 3), (k, 3, 3) of exactly three points."""
    return three_point_poses(xyz_m[None], bearings(ideal)[None])


def bearings(ideal):
    """Unit vectors (n, 3) in the camera frame of ideal image points over c (n, 2)."""
    rays = np.column_stack([ideal, -np.ones(len(ideal))])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def image_errors(xyz_m, ideal, centres, rotations):
    """Image errors (k, n) over c of points in k poses; inf behind the camera."""
    p = np.einsum("kij,knj->kni", rotations, xyz_m[None] - centres[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        projected = -p[..., :2] / p[..., 2:]
        error = np.linalg.norm(projected - ideal, axis=-1)
    return np.where(p[..., 2] < 0, error, np.inf)


def three_point_poses(xyz_m, rays):
    """Poses from triples of points.

    Parameters
    ----------
    xyz_m : ndarray, shape (t, 3, 3)
    rays : ndarray, shape (t, 3, 3)
        Unit vectors in the camera frame.

    Returns
    -------
    centre : ndarray, shape (k, 3)
    rotation : ndarray, shape (k, 3, 3)
    """
    lengths = _distances(xyz_m, rays)
    which, s = lengths
    if not len(s):
        return np.zeros((0, 3)), np.zeros((0, 3, 3))
    camera_points = s[:, :, None] * rays[which]
    camera_frame, object_frame = _frame(camera_points), _frame(xyz_m[which])
    # The same triangle in both frames gives the rotation.
    rotation = camera_frame @ object_frame.transpose(0, 2, 1)
    centre = xyz_m[which, 0] - np.einsum("kji,kj->ki", rotation, camera_points[:, 0])
    sound = np.isfinite(centre).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
    return centre[sound], rotation[sound]


def _distances(xyz_m, rays):
    """Distances (k, 3) from the camera to the points of a triple, and the number of the triple
    (k,)."""
    square = [np.sum((xyz_m[:, i] - xyz_m[:, j]) ** 2, axis=1) for i, j in ((1, 2), (0, 2), (0, 1))]
    sound = (np.min(square, axis=0) > 0) & (_area(xyz_m) > FLAT * np.max(square, axis=0))
    which = np.flatnonzero(sound)
    a, b, c = (item[which] for item in square)
    rays = rays[which]
    ca, cb, cg = (np.sum(rays[:, i] * rays[:, j], axis=1) for i, j in ((1, 2), (0, 2), (0, 1)))
    d, e, f = (a - c) / b, (a + c) / b, c / b
    # Grunert's quartic in v = s3 / s1, coefficients from Haralick et al. 1994.
    polynomial = np.stack(
        [
            (d - 1) ** 2 - 4 * f * ca**2,
            4 * (d * (1 - d) * cb - (1 - e) * ca * cg + 2 * f * ca**2 * cb),
            2 * (d**2 - 1 + 2 * d**2 * cb**2 + 2 * (b - c) / b * ca**2)
            + 4 * (-2 * e * ca * cb * cg + (b - a) / b * cg**2),
            4 * (-d * (1 + d) * cb + 2 * a / b * cg**2 * cb - (1 - e) * ca * cg),
            (1 + d) ** 2 - 4 * a / b * cg**2,
        ],
        axis=1,
    )
    # Roots (t, 4) of polynomials of degree four (t, 5), highest power first.
    lead = np.where(np.abs(polynomial[:, :1]) > 1e-14, polynomial[:, :1], 1e-14)
    # Eigenvalues of the companion matrix: all polynomials in one call.
    companion = np.zeros((len(polynomial), 4, 4))
    companion[:, 0] = -polynomial[:, 1:] / lead
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    roots = np.linalg.eigvals(companion).astype(complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = np.where(np.abs(roots.imag) < 1e-3 * np.abs(roots.real), roots.real, np.nan)
        ca, cb, cg, d, b = (item[:, None] for item in (ca, cb, cg, d, b))
        # u = s2 / s1 follows linearly from v.
        u = ((d - 1) * v**2 - 2 * d * cb * v + 1 + d) / (2 * (cg - v * ca))
        first = np.sqrt(b / (1 + v**2 - 2 * v * cb))
        s = np.stack([first, u * first, v * first], axis=-1)
    good = np.all(np.isfinite(s) & (s > 0), axis=-1)
    return np.repeat(which[:, None], 4, axis=1)[good], s[good]


def _area(xyz):
    """Twice the area (t,) of triangles."""
    return np.linalg.norm(np.cross(xyz[:, 1] - xyz[:, 0], xyz[:, 2] - xyz[:, 0]), axis=1)


def _frame(triangle):
    """Orthonormal frames (k, 3, 3), axes as columns, of triangles (k, 3, 3)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x = triangle[:, 1] - triangle[:, 0]
        x = x / np.linalg.norm(x, axis=1, keepdims=True)
        z = np.cross(x, triangle[:, 2] - triangle[:, 0])
        z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def refine_pose(xyz_m, ideal, pose):
    """Refine a Pose by Gauss-Newton with Cauchy weights beyond its error."""

    def pose_at(centre, rotation):
        errors = image_errors(xyz_m, ideal, centre[None], rotation[None])
        return Pose(centre, rotation, float(agreed_error(errors)[0]))

    def step_at(pose, _):
        w, a = _linearise(xyz_m, ideal, pose.xyz_m, pose.rotation)
        size = np.linalg.norm(w, axis=1)
        # Few points have no reliable median, so the largest error sets the scale.
        middle = max(float(np.median(size)), float(size.max()) if len(size) < FEW else 1e-12)
        root = 1 / np.sqrt(1 + (size / (2 * middle)) ** 2)
        return np.linalg.lstsq(
            (a * root[:, None, None]).reshape(-1, 6), -(w * root[:, None]).ravel(), rcond=None
        )[0]

    return gauss_newton(
        step_at,
        pose_at(pose.xyz_m, pose.rotation),
        move=lambda pose, step: pose_at(
            pose.xyz_m + step[:3], apply_small_rotation(pose.rotation[None], step[None, 3:])[0]
        ),
        # The margin is rounding: the agreed error need not fall at the minimum of the squares.
        is_better=lambda candidate, pose: candidate.error < pose.error * (1 + 1e-6),
        is_small=lambda step: np.abs(step).max() < 1e-9,
        most_steps=REFINING_STEPS,
    )


def _linearise(xyz_m, ideal, centre, rotation):
    """Image errors (n, 2) over c, and derivatives (n, 2, 6) by position and rotation."""
    d = xyz_m - centre
    u, v, w = (d @ rotation.T).T
    x, y = -u / w, -v / w
    a = np.empty((len(d), 2, 6))
    for row, value in ((0, x), (1, y)):
        a[:, row, :3] = (rotation[row] + value[:, None] * rotation[2]) / w[:, None]
    a[:, 0, 3:] = np.stack([x * y, -(1 + x * x), -y], axis=1)
    a[:, 1, 3:] = np.stack([1 + y * y, -x * y, x], axis=1)
    return np.column_stack([x, y]) - ideal, a


def intersect_rays(centres, directions, owner, points):
    """Points nearest to rays, with Cauchy weights.

    Parameters
    ----------
    centres, directions : ndarray, shape (n, 3)
    owner : ndarray of int, shape (n,)
        Number of the point of each ray.
    points : int
        Number of points.

    Returns
    -------
    xyz : ndarray, shape (points, 3)
        nan where the rays do not determine a point.
    count : ndarray of int, shape (points,)
        Number of rays.
    """
    count = np.bincount(owner, minlength=points)
    # I - d d' projects perpendicular to the ray; the sum of squared distances is quadratic in the
    # point.
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    pull = np.einsum("nij,nj->ni", across, centres)
    parts = np.column_stack([across.reshape(-1, 9), pull])
    weight, xyz = np.ones(len(owner)), np.full((points, 3), np.nan)
    for _ in range(RAY_ROUNDS):
        sums = [np.bincount(owner, weights=weight * part, minlength=points) for part in parts.T]
        normal, right = np.stack(sums[:9], axis=1).reshape(-1, 3, 3), np.stack(sums[9:], axis=1)
        sound = np.flatnonzero(count > 1)
        values = np.linalg.eigvalsh(normal[sound])
        # Nearly parallel rays give a singular normal matrix.
        sound = sound[values[:, 0] > 1e-6 * values[:, 2]]
        xyz[:] = np.nan
        xyz[sound] = np.linalg.solve(normal[sound], right[sound][:, :, None])[:, :, 0]
        line = xyz[owner] - centres
        away = np.linalg.norm(np.einsum("nij,nj->ni", across, line), axis=1)
        angle = away / np.maximum(np.linalg.norm(line, axis=1), 1e-9)
        scale = np.nanmedian(angle) if np.isfinite(angle).any() else 1.0
        weight = np.where(np.isfinite(angle), 1 / (1 + (angle / (3 * scale + 1e-9)) ** 2), 0.0)
    return xyz, count
