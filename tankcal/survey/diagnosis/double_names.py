"""Points with two names: points at the same place, and names that look alike."""

import re

import numpy as np
import scipy
from scipy.special import chdtri

from tankcal.errors import Problem
from tankcal.messages import message

LEVEL = 0.001  # significance level of the test whether two points coincide
RARELY = 3  # largest number of rays or readings of the suspected point
NEAR = 6.0  # search radius in median standard deviations
CLOSE = 0.05  # largest search radius as a share of the extent of the survey
TRIED = 2000  # pairs tested, the nearest first
TOLD = 10


def normalize_name(name):
    """Reduce a name to lower case without spaces, marks and leading zeros; O as 0, I and l as 1."""
    plain = re.sub(r"[^0-9a-z]", "", str(name).lower().replace("o", "0"))
    return re.sub(r"(?<!\d)0+(?=\d)", "", plain.translate(str.maketrans("il", "11")))


def image_point_label(photo, point):
    """Label of an image point in messages."""
    return message("point_in_photo", "point {point} in photo {photo}", point=point, photo=photo)


def names_alike(aside, names):
    """Problem rows for points that were not adjusted and whose name resembles another.

    Parameters
    ----------
    aside : dict
        {name: file} of these points.
    names : sequence of str
        Names of the adjusted points.
    """
    known = {}
    for name in names:
        known.setdefault(normalize_name(name), name)
    return [
        Problem(
            file,
            message(
                "is_it",
                "point {point} could not be adjusted: is it {other}?",
                point=name,
                other=known[normalize_name(name)],
            ),
        )
        for name, file in aside.items()
        if known.get(normalize_name(name), name) != name
    ][:TOLD]


def same_place(adjusted):
    """Problem rows for pairs of points that coincide within their standard deviations.

    The points never occur in the same photo or from the same station, and one of them was rarely
    observed. A survey with standard deviations that are large relative to its extent is not tested.
    """
    survey, xyz, problems = adjusted.survey, adjusted.xyz_m, []
    adjusted_points = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    if len(adjusted_points) < 2:
        return problems
    size = np.sqrt(np.einsum("nii->n", adjusted.point_covariances_m2[adjusted_points]))
    reach = NEAR * max(float(np.median(size)), 1e-6)
    if reach > CLOSE * np.linalg.norm(np.ptp(xyz[adjusted_points], axis=0)):
        return problems
    pairs = scipy.spatial.cKDTree(xyz[adjusted_points]).query_pairs(reach, output_type="ndarray")
    pairs = adjusted_points[pairs]
    views = _views(survey)
    count = np.array([len(views_of_point) for views_of_point in views])
    # Order each pair so that the less observed point comes first.
    pairs = np.take_along_axis(pairs, np.argsort(count[pairs], axis=1, kind="stable"), axis=1)
    pairs = pairs[count[pairs[:, 0]] <= RARELY]
    apart = np.linalg.norm(xyz[pairs[:, 0]] - xyz[pairs[:, 1]], axis=1)
    for i in np.argsort(apart, kind="stable")[:TRIED]:
        few, many = pairs[i].tolist()
        # A photo or station that shows both proves that they differ.
        if {view for view, _ in views[few]} & {view for view, _ in views[many]}:
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
        problems.append(Problem("job.toml", text))
        if len(problems) == TOLD:
            break
    return problems


def _together(adjusted, difference, a, b):
    """Whether two points coincide within their covariance (chi-square test, 3 degrees of freedom).

    Parameters
    ----------
    adjusted : network.Adjusted
    difference : ndarray, shape (3,)
    a, b : int
        Numbers of the points.
    """
    q = adjusted.covariance_m2([a, b])
    # Covariance of the difference, including the correlation of the points.
    q = q[:3, :3] + q[3:, 3:] - q[:3, 3:] - q[3:, :3]
    floor = 1e-12 * np.eye(3)
    return difference @ np.linalg.solve(q + floor, difference) < chdtri(3, LEVEL)


def _views(survey):
    """For each point, the (view, number) pairs that show it: photos, and stations with their
    table."""
    views = [[] for _ in survey.points]
    images = survey.image_points
    if images is not None:
        for point, photo in zip(images.point.tolist(), images.photo.tolist(), strict=True):
            views[point].append((("photo", photo), 0))
    for number, table in enumerate(survey.observations):
        if not hasattr(table, "start"):
            continue
        ends = [getattr(table, name).tolist() for name in ("end", "origin") if name in table.ties]
        for end in ends:
            for point, start in zip(end, table.start.tolist(), strict=True):
                views[point].append((("station", start), number))
                views[start].append((("station", start), number))
    return views
