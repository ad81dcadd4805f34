"""Where a wall was measured, and what of its readings no prior binds."""

from dataclasses import dataclass

import numpy as np

from tankcal.geometry.field.components import Heights, weld_columns
from tankcal.geometry.outlines import FULL_TURN

SAME_AZIMUTH_RAD = 1e-12


@dataclass(frozen=True)
class Sites:
    """Where a wall was measured.

    Attributes
    ----------
    course : ndarray of int, shape (n,)
        From 0 on, each of them with sites.
    ring : ndarray of int, shape (n,)
        Sites that have a centre of their own, all of one course; below 0: they have none.
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    azimuth_rad : ndarray, shape (n,)
        nan: the mean of a whole turn, as a tape measures it; it has no ring, either.
    leans : ndarray of bool, shape (n,)
        Whether the ring is not level, and its centre moves with the height.
    welds_rad : tuple of ndarray
        Azimuths of the vertical welds of each course; (): not known.
    shared : ndarray, shape (n, s), optional
        Derivative of the radii by unknowns that courses share: the constant of a plumb line.
    points : tuple of ndarray, shape (p,), optional
        Course and azimuth of the points that the sites are means of.
    spans : ndarray, shape (courses, 2), optional
        Bottom and top of each course, as parts of the height of the shell; None: all courses are of
        one height.
    smoothed : bool
        Whether the readings show the wall smoother than it is; see `components.log_covariance`.
    bulge_scale : float
        Sizes of bulges and tapers of this wall before the survey, over those of
        `components.COMPONENTS`. Joints are not scaled: a weld shrinks by the plate, not by R.
    """

    course: np.ndarray
    ring: np.ndarray
    zeta: np.ndarray
    azimuth_rad: np.ndarray
    leans: np.ndarray
    welds_rad: tuple = ()
    shared: np.ndarray | None = None
    points: tuple | None = None
    spans: np.ndarray | None = None
    smoothed: bool = False
    bulge_scale: float = 1.0

    def __len__(self):
        return len(self.course)

    def take(self, chosen):
        """Those of the sites that are chosen; courses that lose all of theirs are left out."""
        seen, course = np.unique(self.course[chosen], return_inverse=True)
        return Sites(
            course=course,
            ring=self.ring[chosen],
            zeta=self.zeta[chosen],
            azimuth_rad=self.azimuth_rad[chosen],
            leans=self.leans[chosen],
            welds_rad=tuple(self.welds_of(one) for one in seen) if self.welds_rad else (),
            shared=None if self.shared is None else self.shared[chosen],
            points=None if self.points is None else _of_courses(*self.points, seen),
            spans=self.course_spans[seen],
            smoothed=self.smoothed,
            bulge_scale=self.bulge_scale,
        )

    @property
    def course_spans(self):
        """(courses, 2) bottom and top of each course, as parts of the height of the shell."""
        if self.spans is not None:
            return self.spans
        return spans_of(np.arange(self.course.max() + 2.0))

    @property
    def heights(self):
        """`Heights` of the sites."""
        return self.heights_at(self.course, self.zeta)

    def heights_at(self, course, zeta):
        """`Heights` at places of courses: a number or (n,) of each."""
        return Heights.within(self.course_spans[course], zeta)

    @property
    def seen(self):
        """Course and azimuth of the points themselves, where the sites are means of some."""
        return self.points or (self.course, self.azimuth_rad)

    def welds_of(self, course):
        """Azimuths of the vertical welds of a course."""
        return self.welds_rad[course] if self.welds_rad else np.zeros(0)

    def welds_at(self, nominal_m):
        """For each course (k, w) what a peak of one at each of its welds makes of its radii."""
        return [
            weld_columns(self.azimuth_rad[members], self.welds_of(course), nominal_m)
            for course, members in enumerate(self.members)
        ]

    @property
    def members(self):
        """For each course the indices of its sites."""
        return [np.flatnonzero(self.course == c) for c in range(self.course.max() + 1)]

    def free_columns(self, members):
        """(k, p) derivative of the radii of some sites of a course by what no prior binds.

        Its radius first, then x and y of the centre of each ring, and of its lean.
        """
        azimuth, ring = self.azimuth_rad[members], self.ring[members]
        turn = np.nan_to_num(np.column_stack([np.sin(azimuth), np.cos(azimuth)]))
        columns = [np.ones((len(members), 1))]
        for one in np.unique(ring[ring >= 0]):
            there = turn * (ring == one)[:, None]
            columns.append(there)
            if np.any(self.leans[members] & (ring == one)):
                columns.append(there * self.zeta[members, None])
        return np.hstack(columns)


def spans_of(joints_m):
    """(courses, 2) bottom and top of courses between joints, as parts of the height of the shell.

    Examples
    --------
    >>> spans_of(np.array([0.0, 2.0, 4.0, 5.0])).tolist()
    [[0.0, 0.4], [0.4, 0.8], [0.8, 1.0]]
    """
    parts = (joints_m - joints_m[0]) / (joints_m[-1] - joints_m[0])
    return np.column_stack([parts[:-1], parts[1:]])


def free_design(sites):
    """(n, p) derivative of the radii by what no prior binds, and the columns of the radii.

    Course by course as in `Sites.free_columns`, then what they share.
    """
    blocks = [(members, sites.free_columns(members)) for members in sites.members]
    starts = np.cumsum([0, *(block.shape[1] for _, block in blocks)])
    design = np.zeros((len(sites), starts[-1]))
    for start, (members, block) in zip(starts, blocks, strict=False):
        design[members, start : start + block.shape[1]] = block
    if sites.shared is not None:
        design = np.hstack([design, sites.shared])
    return design, starts[:-1]


def distinct_azimuths(azimuth_rad):
    """(n,) place of each azimuth among the distinct ones, and these."""
    turns = np.round((np.asarray(azimuth_rad) % FULL_TURN) / SAME_AZIMUTH_RAD)
    found, place = np.unique(turns, return_inverse=True)
    return place, found * SAME_AZIMUTH_RAD


def _of_courses(course, azimuth_rad, seen):
    """Course, by its place among those that are seen, and azimuth of the points in these."""
    here = np.isin(course, seen)
    return np.searchsorted(seen, course[here]), azimuth_rad[here]
