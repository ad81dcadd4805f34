"""One point under two names: points that lie at the same place, and names that look alike."""

import re

import numpy as np
import scipy
from scipy.special import chdtri

from tankcal.errors import Problem
from tankcal.messages import message

LEVEL = 0.001  # of the test whether two points are one
RARELY = 3  # rays or readings of the point that is doubted, at most
NEAR = 6.0  # median sds within which other points are looked for
CLOSE = 0.05  # of the extent of the survey: what lies within reach must be closer together
TRIED = 2000  # pairs, the nearest first
TOLD = 10


def normalize_name(name):
    """A name without case, spaces, marks and leading zeros; O as 0, I and l as 1."""
    plain = re.sub(r"[^0-9a-z]", "", str(name).lower().replace("o", "0"))
    return re.sub(r"(?<!\d)0+(?=\d)", "", plain.translate(str.maketrans("il", "11")))


def image_point_label(photo, point):
    """What an image point is called."""
    return message("point_in_photo", "point {point} in photo {photo}", point=point, photo=photo)


def names_alike(aside, names):
    """Problem rows for points that could not be adjusted and whose name is nearly another's.

    aside  {name: file} of those points      names  all others
    """
    known = {}
    for name in names:
        known.setdefault(normalize_name(name), name)
    return [
        Problem(file, _is_it(name, known[normalize_name(name)]))
        for name, file in aside.items()
        if known.get(normalize_name(name), name) != name
    ][:TOLD]


def _is_it(name, other):
    return message(
        "is_it",
        "point {point} could not be adjusted: is it {other}?",
        point=name,
        other=other,
    )


def same_place(adjusted):
    """Problem rows for pairs of points that are one point, as far as the adjustment can tell.

    They lie together within their sds, never occur in the same photo or from the same station, and
    one of them was rarely observed. Nothing is said of a survey whose sds are not small against it.
    """
    survey, xyz, found = adjusted.survey, adjusted.xyz_m, []
    there = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    if len(there) < 2:
        return found
    size = np.sqrt(np.einsum("nii->n", adjusted.point_covariances_m2[there]))
    reach = NEAR * max(float(np.median(size)), 1e-6)
    if reach > CLOSE * np.linalg.norm(np.ptp(xyz[there], axis=0)):
        return found
    pairs = scipy.spatial.cKDTree(xyz[there]).query_pairs(reach, output_type="ndarray")
    pairs = there[pairs]
    seen = _views(survey)
    count = np.array([len(one) for one in seen])
    pairs = np.take_along_axis(pairs, np.argsort(count[pairs], axis=1, kind="stable"), axis=1)
    pairs = pairs[count[pairs[:, 0]] <= RARELY]
    apart = np.linalg.norm(xyz[pairs[:, 0]] - xyz[pairs[:, 1]], axis=1)
    for i in np.argsort(apart, kind="stable")[:TRIED]:
        few, many = pairs[i].tolist()
        if {view for view, _ in seen[few]} & {view for view, _ in seen[many]}:
            continue
        if not _together(adjusted, xyz[few] - xyz[many], few, many):
            continue
        text = message(
            "two_names",
            "points {point} and {other} lie {apart_mm:.1f} mm apart, within their standard"
            " deviations, and no photo or station shows both: one point under two names?",
            point=survey.points[few],
            other=survey.points[many],
            apart_mm=1e3 * apart[i],
        )
        found.append(Problem("job.toml", text))
        if len(found) == TOLD:
            break
    return found


def _together(adjusted, difference, a, b):
    """Whether two points, a difference (3,) apart, lie together within their covariance."""
    q = adjusted.covariance_m2([a, b])
    q = q[:3, :3] + q[3:, 3:] - q[:3, 3:] - q[3:, :3]
    floor = 1e-12 * np.eye(3)
    return difference @ np.linalg.solve(q + floor, difference) < chdtri(3, LEVEL)


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
