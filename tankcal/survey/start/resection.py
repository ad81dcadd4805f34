"""Where a photo was taken from, without knowing anything about it: resection of single photos.

Three points give up to four poses (Grunert); many triples are tried, and the pose wins that more
than half of the points agree with most closely: nearly half of them may be blunders. Of n points
the error of place n // 2 + 2 counts, for the three of a triple agree with it by construction.
Source: Haralick et al. 1994, Review and analysis of solutions of the three point perspective pose
estimation problem; Rousseeuw & Leroy 1987 (least median of squares).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tankcal.geometry.rotations import apply_small_rotation

TRIPLES = 120
JUDGES = 100  # points that decide between the poses
REFINING = 400  # points that refine a pose
REFINING_STEPS = 15
FLAT = 0.02  # height over length below which three points lie on a line
FEW = 8  # points below which other poses may fit as well
TRIED = 20  # poses of few points that are refined
SAME = 0.05  # places closer than this share of the distance to the points are one and the same
RIVAL = 4.0  # another pose counts when its error is below this multiple of the best one's
NOISE = 3e-3  # error over c that says nothing: 0.3 mm at c = 100 mm, of a camera not calibrated


@dataclass(frozen=True)
class Pose:
    """A pose: xyz_m (3,), rotation (3, 3), and the image error over c that most points keep."""

    xyz_m: np.ndarray
    rotation: np.ndarray
    error: float


def resect(xyz_m, ideal, rng, count=TRIPLES):
    """The best Pose for points (n, 3) seen at ideal image points over c (n, 2), n at least 4."""
    found = find_poses(xyz_m, ideal, rng, count)
    return found[0] if found else None


def find_poses(xyz_m, ideal, rng, count=TRIPLES):
    """The best Pose for points as for `resect` and, of few points, others that fit them too."""
    n = len(xyz_m)
    triples = rng.integers(0, n, (count, 3))
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
    found = []
    for best in order[np.isfinite(errors[order])]:
        pose = refine_pose(xyz_m, ideal, Pose(centres[best], rotations[best], float(errors[best])))
        if not any(_alike(pose, other, xyz_m) for other in found):
            found.append(pose)
    found.sort(key=lambda pose: pose.error)
    return [one for one in found if one.error <= RIVAL * found[0].error + NOISE]


def _alike(one, other, xyz_m):
    away = np.median(np.linalg.norm(xyz_m - other.xyz_m, axis=1))
    return np.linalg.norm(one.xyz_m - other.xyz_m) < SAME * away


def agreed_error(errors):
    """The error (k,) that more than half of the points keep, of errors (k, n), n at least 4."""
    n = errors.shape[1]
    place = min(n, n // 2 + 2) - 1
    return np.partition(errors, place, axis=1)[:, place]


def candidates(xyz_m, ideal):
    """All poses (k, 3), (k, 3, 3) for exactly three points."""
    return three_point_poses(xyz_m[None], bearings(ideal)[None])


def bearings(ideal):
    """Unit vectors (n, 3) in the camera's frame of ideal image points over c (n, 2)."""
    rays = np.column_stack([ideal, -np.ones(len(ideal))])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def image_errors(xyz_m, ideal, centres, rotations):
    """Errors (k, n) in the image over c of points in k poses; inf behind the camera."""
    p = np.einsum("kij,knj->kni", rotations, xyz_m[None] - centres[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        found = -p[..., :2] / p[..., 2:]
        error = np.linalg.norm(found - ideal, axis=-1)
    return np.where(p[..., 2] < 0, error, np.inf)


def three_point_poses(xyz_m, rays):
    """Poses from triples of points (t, 3, 3) and unit rays (t, 3, 3): (k, 3) and (k, 3, 3)."""
    lengths = _distances(xyz_m, rays)
    which, s = lengths
    if not len(s):
        return np.zeros((0, 3)), np.zeros((0, 3, 3))
    seen = s[:, :, None] * rays[which]
    mine, theirs = _frame(seen), _frame(xyz_m[which])
    rotation = mine @ theirs.transpose(0, 2, 1)
    centre = xyz_m[which, 0] - np.einsum("kji,kj->ki", rotation, seen[:, 0])
    sound = np.isfinite(centre).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
    return centre[sound], rotation[sound]


def _distances(xyz_m, rays):
    """Distances (k, 3) from the camera to the points of a triple, and the triple's number (k,)."""
    square = [np.sum((xyz_m[:, i] - xyz_m[:, j]) ** 2, axis=1) for i, j in ((1, 2), (0, 2), (0, 1))]
    sound = (np.min(square, axis=0) > 0) & (_area(xyz_m) > FLAT * np.max(square, axis=0))
    which = np.flatnonzero(sound)
    a, b, c = (one[which] for one in square)
    rays = rays[which]
    ca, cb, cg = (np.sum(rays[:, i] * rays[:, j], axis=1) for i, j in ((1, 2), (0, 2), (0, 1)))
    d, e, f = (a - c) / b, (a + c) / b, c / b
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
        ca, cb, cg, d, b = (one[:, None] for one in (ca, cb, cg, d, b))
        u = ((d - 1) * v**2 - 2 * d * cb * v + 1 + d) / (2 * (cg - v * ca))
        first = np.sqrt(b / (1 + v**2 - 2 * v * cb))
        s = np.stack([first, u * first, v * first], axis=-1)
    good = np.all(np.isfinite(s) & (s > 0), axis=-1)
    return np.repeat(which[:, None], 4, axis=1)[good], s[good]


def _area(xyz):
    return np.linalg.norm(np.cross(xyz[:, 1] - xyz[:, 0], xyz[:, 2] - xyz[:, 0]), axis=1)


def _roots(polynomial):
    """Roots (t, 4) of polynomials of degree four (t, 5), highest power first."""
    lead = np.where(np.abs(polynomial[:, :1]) > 1e-14, polynomial[:, :1], 1e-14)
    companion = np.zeros((len(polynomial), 4, 4))
    companion[:, 0] = -polynomial[:, 1:] / lead
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    return np.linalg.eigvals(companion).astype(complex)


def _frame(triangle):
    """Orthonormal frames (k, 3, 3), one column an axis, of triangles (k, 3, 3)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x = triangle[:, 1] - triangle[:, 0]
        x = x / np.linalg.norm(x, axis=1, keepdims=True)
        z = np.cross(x, triangle[:, 2] - triangle[:, 0])
        z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def refine_pose(xyz_m, ideal, pose):
    """The Pose after Gauss-Newton steps with weights that fall off (Cauchy) beyond its error."""
    centre, rotation = pose.xyz_m, pose.rotation
    error = float(agreed_error(image_errors(xyz_m, ideal, centre[None], rotation[None]))[0])
    for _ in range(REFINING_STEPS):
        w, a = _linearised(xyz_m, ideal, centre, rotation)
        size = np.linalg.norm(w, axis=1)
        middle = max(float(np.median(size)), float(size.max()) if len(size) < FEW else 1e-12)
        root = 1 / np.sqrt(1 + (size / (2 * middle)) ** 2)
        step = np.linalg.lstsq(
            (a * root[:, None, None]).reshape(-1, 6), -(w * root[:, None]).ravel(), rcond=None
        )[0]
        candidate = centre + step[:3], apply_small_rotation(rotation[None], step[None, 3:])[0]
        found = agreed_error(image_errors(xyz_m, ideal, candidate[0][None], candidate[1][None]))[0]
        if not found < error * (1 + 1e-6):
            break
        (centre, rotation), error = candidate, float(found)
        if np.abs(step).max() < 1e-9:
            break
    return Pose(centre, rotation, error)


def _linearised(xyz_m, ideal, centre, rotation):
    """Errors (n, 2) in the image over c, and derivatives (n, 2, 6) by position and rotation."""
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
    """Points (points, 3) nearest to rays (n, 3) from centres (n, 3), weights falling off (Cauchy).

    owner  (n,) number of the point that each ray belongs to

    Returns the points, nan where the rays do not fix one, and the number of rays of each.
    """
    count = np.bincount(owner, minlength=points)
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    pull = np.einsum("nij,nj->ni", across, centres)
    parts = np.column_stack([across.reshape(-1, 9), pull])
    weight, xyz = np.ones(len(owner)), np.full((points, 3), np.nan)
    for _ in range(rounds):
        sums = [np.bincount(owner, weights=weight * one, minlength=points) for one in parts.T]
        normal, right = np.stack(sums[:9], axis=1).reshape(-1, 3, 3), np.stack(sums[9:], axis=1)
        sound = np.flatnonzero(count > 1)
        values = np.linalg.eigvalsh(normal[sound])
        sound = sound[values[:, 0] > 1e-6 * values[:, 2]]
        xyz[:] = np.nan
        xyz[sound] = np.linalg.solve(normal[sound], right[sound][:, :, None])[:, :, 0]
        line = xyz[owner] - centres
        away = np.linalg.norm(np.einsum("nij,nj->ni", across, line), axis=1)
        angle = away / np.maximum(np.linalg.norm(line, axis=1), 1e-9)
        scale = np.nanmedian(angle) if np.isfinite(angle).any() else 1.0
        weight = np.where(np.isfinite(angle), 1 / (1 + (angle / (3 * scale + 1e-9)) ** 2), 0.0)
    return xyz, count
