"""One point under two names: points that lie at the same place, and names that look alike."""

import re

import numpy as np
import scipy.spatial
import scipy.stats

from tankcal.errors import Problem

LEVEL = 0.001  # of the test whether two points are one
RARELY = 3  # rays or readings of the point that is doubted, at most
NEAR = 6.0  # median sds within which other points are looked for
TOLD = 10


def alike(name):
    """A name without case, spaces, marks and leading zeros; O as 0, I and l as 1."""
    plain = re.sub(r"[^0-9a-z]", "", str(name).lower().replace("o", "0"))
    return re.sub(r"(?<!\d)0+(?=\d)", "", plain.translate(str.maketrans("il", "11")))


def names_alike(aside, names):
    """Problem rows for points that could not be adjusted and whose name is nearly another's.

    aside  {name: file} of those points      names  all others
    """
    known = {}
    for name in names:
        known.setdefault(alike(name), name)
    return [
        Problem(file, f"point {name} could not be adjusted: is it {known[alike(name)]}?")
        for name, file in aside.items()
        if known.get(alike(name), name) != name
    ][:TOLD]


def same_place(adjusted):
    """Problem rows for pairs of points that are one point, as far as the adjustment can tell.

    They lie together within their sds, never occur in the same photo or from the same station, and
    one of them was rarely observed.
    """
    survey = adjusted.survey
    there = np.flatnonzero(np.isfinite(adjusted.xyz_m).all(axis=1))
    if len(there) < 2:
        return []
    xyz = adjusted.xyz_m[there]
    size = np.sqrt(np.einsum("nii->n", adjusted.point_covariances_m2[there]))
    near = scipy.spatial.cKDTree(xyz).query_pairs(NEAR * max(float(np.median(size)), 1e-6))
    found = []
    if not near:
        return found
    seen = _views(survey)
    for i, j in sorted(near):
        pair = there[i], there[j]
        few, many = sorted(pair, key=lambda point: len(seen[point]))
        together = {view for view, _ in seen[few]} & {view for view, _ in seen[many]}
        if len(seen[few]) > RARELY or together or not _together(adjusted, few, many):
            continue
        away = 1e3 * np.linalg.norm(adjusted.xyz_m[few] - adjusted.xyz_m[many])
        text = (
            f"points {survey.points[few]} and {survey.points[many]} lie {away:.1f} mm apart, "
            "within their standard deviations, and no photo or station shows both: one point "
            "under two names?"
        )
        found.append(Problem("job.toml", text))
    return found[:TOLD]


def _together(adjusted, a, b):
    """Whether two points lie together within their covariance."""
    difference = adjusted.xyz_m[a] - adjusted.xyz_m[b]
    q = adjusted.covariance_m2([a, b])
    q = q[:3, :3] + q[3:, 3:] - q[:3, 3:] - q[3:, :3]
    floor = 1e-12 * np.eye(3)
    return difference @ np.linalg.solve(q + floor, difference) < scipy.stats.chi2.isf(LEVEL, 3)


def _views(survey):
    """For each point the (view, number) that show it: photos, and stations with their table."""
    seen = [[] for _ in survey.points]
    images = survey.image_points
    if images is not None:
        for point, photo in zip(images.point.tolist(), images.photo.tolist(), strict=True):
            seen[point].append((("photo", photo), 0))
    for number, one in enumerate(survey.observations):
        if not hasattr(one, "start"):
            continue
        ends = [getattr(one, name).tolist() for name in ("end", "origin") if name in one.ties]
        for end in ends:
            for point, start in zip(end, one.start.tolist(), strict=True):
                seen[point].append((("station", start), number))
                seen[start].append((("station", start), number))
    return seen
