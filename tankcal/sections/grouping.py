"""Points of a shell grouped into sections: by their heights, or by the names that they carry."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.form import free_columns, harmonics

RING_GAP, RING_SPREAD = 0.10, 0.15  # of the course height: between rings, within one ring
HIGHEST_DEGREE, MOST_AMPLIFICATION = 2, 6.0  # of the sd of a mean radius, at an end of a course


@dataclass(frozen=True)
class Group:
    """Points that make one section, or the one course that they stand on all over its height.

    Attributes
    ----------
    name : str
    course : int
        Index of the course, from the bottom up.
    height_m : float
        Mean height of the points above the bottom, m.
    members : ndarray of int, shape (n,)
        Indices of the points.
    span_m : tuple of float, or None
        Bottom and top of the course, m; None when they are not known.
    degree : int
        Of the polynomial in height that the points are fitted by; 0 when they are level.
    """

    name: str
    course: int
    height_m: float
    members: np.ndarray
    span_m: tuple[float, float] | None = None
    degree: int = 0

    def zeta(self, height_m):
        """Heights within the course: -1 at its bottom, +1 at its top; 0 when it is not known."""
        if self.span_m is None:
            return 0.0 * np.asarray(height_m)
        bottom, top = self.span_m
        return (2 * np.asarray(height_m) - bottom - top) / (top - bottom)


def group_by_height(height_m, azimuth_rad, course, joints_m):
    """Sections of points without a section number: rings where they lie level, else one a course.

    Points of a course form rings when each cluster of heights (apart by a tenth of the course,
    level within 15 % of it) has 5 points or more and no gap of a third of a turn.

    Parameters
    ----------
    height_m : ndarray, shape (n,)
        Above the bottom, m.
    azimuth_rad : ndarray, shape (n,)
        About the axis, rad.
    course : ndarray of int, shape (n,)
        Index of the course of each point.
    joints_m : array_like, shape (courses + 1,)
        Heights of the joints above the bottom, m.

    Returns
    -------
    list of Group
        Named "1", "2", or "2.1", "2.2" for rings, from the bottom up.

    Examples
    --------
    Two rings of eight points in one course:

    >>> azimuth = np.tile(np.arange(8) * np.pi / 4, 2)
    >>> height = np.repeat([0.5, 1.5], 8)
    >>> found = group_by_height(height, azimuth, np.zeros(16, dtype=int), [0.0, 2.0])
    >>> [(one.name, one.height_m) for one in found]
    [('1.1', 0.5), ('1.2', 1.5)]
    """
    groups = []
    for index in range(len(joints_m) - 1):
        members = np.flatnonzero(course == index)
        if len(members) == 0:
            continue
        span = (float(joints_m[index]), float(joints_m[index + 1]))
        tall = span[1] - span[0]
        rings = _rings(height_m[members], tall)
        name = str(index + 1)
        if len(rings) > 1 and all(
            _is_ring(height_m[members[ring]], azimuth_rad[members[ring]], tall) for ring in rings
        ):
            for number, ring in enumerate(rings, start=1):
                chosen = members[ring]
                height = float(height_m[chosen].mean())
                groups.append(Group(f"{name}.{number}", index, height, chosen, span))
        else:
            height = float(height_m[members].mean())
            groups.append(Group(name, index, height, members, span))
    return _with_degrees(groups, height_m, azimuth_rad)


def group_by_name(names, height_m, course_of, azimuth_rad=None, joints_m=None):
    """Sections of points that carry a section name; their mean height decides the course.

    Parameters
    ----------
    names : sequence of str, length n
    height_m : ndarray, shape (n,)
        Above the bottom, m.
    course_of : callable
        course_of(height_m) -> index of the course.
    azimuth_rad : ndarray, shape (n,), optional
    joints_m : array_like, shape (courses + 1,), optional
        Azimuths (rad) and joints (m) tell whether a section whose points are not level carries a
        fit in height; without them every section counts as level.

    Returns
    -------
    list of Group
        From the bottom up.

    Examples
    --------
    >>> found = group_by_name(["b", "a", "b"], np.array([2.0, 1.0, 2.2]), lambda height: 0)
    >>> [(one.name, one.members.tolist()) for one in found]
    [('a', [1]), ('b', [0, 2])]
    """
    groups = []
    for name in dict.fromkeys(names):
        members = np.array([i for i, other in enumerate(names) if other == name])
        height = float(height_m[members].mean())
        course = int(course_of(height))
        span = None if joints_m is None else tuple(map(float, joints_m[course : course + 2]))
        groups.append(Group(name, course, height, members, span))
    groups.sort(key=lambda group: group.height_m)
    return groups if joints_m is None else _with_degrees(groups, height_m, azimuth_rad)


def _with_degrees(groups, height_m, azimuth_rad):
    """The groups, with the degree in height of those that have a course for themselves."""
    courses = [group.course for group in groups]
    return [
        replace(group, degree=_degree(group, height_m[group.members], azimuth_rad[group.members]))
        if courses.count(group.course) == 1
        else group
        for group in groups
    ]


def _degree(group, height_m, azimuth_rad):
    """Degree of the polynomial in height that points determine: 0, 1 or 2.

    The highest by which the mean radius at either end of the course has at most 6 times the sd of
    the mean radius of all points, whatever low harmonics the section has (points along a spiral
    tell nothing of a taper), with two points or more for each of these unknowns. Level points
    (within 15 % of the course) have degree 0.
    """
    bottom, top = group.span_m
    if np.ptp(height_m) <= RING_SPREAD * (top - bottom):
        return 0
    n = len(height_m)
    waves = harmonics(azimuth_rad, max(min(n // 8, 6), 1))[:, 3:]
    ends = np.array([-1.0, 1.0])
    for degree in range(HIGHEST_DEGREE, 0, -1):
        free = free_columns(azimuth_rad, group.zeta(height_m), degree)
        design = np.hstack([free, waves])
        if n < 2 * design.shape[1] or np.linalg.matrix_rank(design) < design.shape[1]:
            continue
        at_ends = np.zeros((2, design.shape[1]))
        at_ends[:, : free.shape[1]] = free_columns(np.zeros(2), ends, degree)
        at_ends[:, [1, 2, 4, 5]] = 0.0  # the mean has no wave
        variance = np.sum(at_ends * np.linalg.solve(design.T @ design, at_ends.T).T, axis=1)
        if np.sqrt(n * variance.max()) <= MOST_AMPLIFICATION:
            return degree
    return 0


def _rings(height_m, tall_m):
    order = np.argsort(height_m, kind="stable")
    cuts = np.flatnonzero(np.diff(height_m[order]) > RING_GAP * tall_m) + 1
    return np.split(order, cuts)


def _is_ring(height_m, azimuth_rad, tall_m):
    ordered = np.sort(azimuth_rad)
    gaps = np.diff(ordered, append=ordered[0] + 2 * np.pi)
    level = np.ptp(height_m) <= RING_SPREAD * tall_m
    return level and len(ordered) >= 5 and gaps.max() < 2 * np.pi / 3
