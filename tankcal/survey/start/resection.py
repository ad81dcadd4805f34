"""Space resection of single photos without approximate values.

Three points give up to four poses (Grunert). Many triples are tried, and the pose with which more
than half of the points agree best is used, so nearly half of the points may be blunders. Of n
points, the error at position n // 2 + 2 counts, as the three points of the triple fit by
construction. Source: Haralick et al. 1994, Review and analysis of solutions of the three point
perspective pose estimation problem; Rousseeuw & Leroy 1987 (least median of squares).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tankcal.adjust import gauss_newton
from tankcal.geometry.rotations import apply_small_rotation

TRIPLES = 120  # samples of three points
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
class Pose:
    """A pose: xyz_m (3,), rotation (3, 3), and the image error over c met by most points."""

    xyz_m: np.ndarray
    rotation: np.ndarray
    error: float


def resect(xyz_m, ideal, rng, count=TRIPLES):
    """Best Pose of a photo.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        n at least 4.
    ideal : ndarray, shape (n, 2)
        Ideal image points over c.
    rng : numpy.random.Generator
    count : int
        Number of samples.

    Returns
    -------
    Pose or None
    """
    poses = find_poses(xyz_m, ideal, rng, count)
    return poses[0] if poses else None


def find_poses(xyz_m, ideal, rng, count=TRIPLES):
    """Best Pose of a photo and, for few points, other poses that fit.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
    ideal : ndarray, shape (n, 2)
        Ideal image points over c.
    rng : numpy.random.Generator
    count : int
        Number of samples.

    Returns
    -------
    list of Pose
        The best first.
    """
    n = len(xyz_m)
    triples = rng.integers(0, n, (count, 3))
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
    roots = _roots(polynomial)
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


def _roots(polynomial):
    """Roots (t, 4) of polynomials of degree four (t, 5), highest power first."""
    lead = np.where(np.abs(polynomial[:, :1]) > 1e-14, polynomial[:, :1], 1e-14)
    # Eigenvalues of the companion matrix: all polynomials in one call.
    companion = np.zeros((len(polynomial), 4, 4))
    companion[:, 0] = -polynomial[:, 1:] / lead
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    return np.linalg.eigvals(companion).astype(complex)


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


def intersect_rays(centres, directions, owner, points, rounds=12):
    """Points nearest to rays, with Cauchy weights.

    Parameters
    ----------
    centres, directions : ndarray, shape (n, 3)
    owner : ndarray of int, shape (n,)
        Number of the point of each ray.
    points : int
        Number of points.
    rounds : int
        Iterations of the weights.

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
    for _ in range(rounds):
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
