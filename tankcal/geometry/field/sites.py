"""Sites of the measurements of a wall, and the design of the parameters without prior.

Many points of a wall are reduced to fewer sites, the means of the points in cells.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.geometry.field.components import Heights, weld_columns
from tankcal.units import FULL_TURN

SAME_AZIMUTH_RAD = 1e-12  # azimuths with a smaller difference are equal up to rounding
MOST_SITES = 1600  # largest number of sites of a field, whose covariance is a dense matrix
CELL_M, CELL_ZETA, WIDER = 0.1, 0.1, 1.3  # first width and height of a cell, and growth factor
# Height limit in halves of a course: a mean over w of a bulge b (1 - zeta^2) is b w^2 / 12 too low.
TALLEST = 0.2


@dataclass(frozen=True)
class Sites:
    """Sites of the measurements of a wall.

    Attributes
    ----------
    course : ndarray of int, shape (n,)
        Course, from 0 on; each course has sites.
    ring : ndarray of int, shape (n,)
        Number of the ring. Sites of a ring belong to one course and share a centre; below 0: no
        centre.
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    azimuth_rad : ndarray, shape (n,)
        Azimuth; nan for the mean of a full turn (tape measurement), which has no ring.
    leans : ndarray of bool, shape (n,)
        Whether the ring is not level, so that its centre moves with the height.
    welds_rad : tuple of ndarray
        Azimuths of the vertical welds of each course; (): unknown.
    shared : ndarray, shape (n, s), optional
        Derivative of the radii by unknowns shared by courses, such as the constant of a plumb line.
    points : tuple of ndarray, shape (p,), optional
        Course and azimuth of the original points if the sites are means of points.
    spans : ndarray, shape (courses, 2), optional
        Bottom and top of each course, as fractions of the height of the shell; None: courses of
        equal height.
    smoothed : bool
        Whether the readings show the wall smoother than it is; see `components.log_covariance`.
    bulge_scale : float
        Prior amplitudes of bulges, drawn-in joints and tapers of this wall, relative to
        `components.COMPONENTS`.
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
        """Return the chosen sites; courses without chosen sites are omitted."""
        remaining, course = np.unique(self.course[chosen], return_inverse=True)
        return Sites(
            course=course,
            ring=self.ring[chosen],
            zeta=self.zeta[chosen],
            azimuth_rad=self.azimuth_rad[chosen],
            leans=self.leans[chosen],
            welds_rad=tuple(self.welds_of(number) for number in remaining)
            if self.welds_rad
            else (),
            shared=None if self.shared is None else self.shared[chosen],
            points=None if self.points is None else _select_courses(*self.points, remaining),
            spans=self.course_spans[remaining],
            smoothed=self.smoothed,
            bulge_scale=self.bulge_scale,
        )

    @property
    def course_spans(self):
        """Bottom and top (courses, 2) of each course, as fractions of the height of the shell."""
        if self.spans is not None:
            return self.spans
        return spans_of(np.arange(self.course.max() + 2.0))

    @property
    def heights(self):
        """`Heights` of the sites."""
        return self.heights_at(self.course, self.zeta)

    def heights_at(self, course, zeta):
        """Return `Heights` at zeta (n,) in courses: a number, or (n,) of each place."""
        return Heights.within(self.course_spans[course], zeta)

    @property
    def seen(self):
        """Course and azimuth of the original points, or of the sites if they are no means."""
        return self.points or (self.course, self.azimuth_rad)

    def welds_of(self, course):
        """Return the azimuths of the vertical welds of a course."""
        return self.welds_rad[course] if self.welds_rad else np.zeros(0)

    def welds_at(self, nominal_m):
        """Return, for each course, derivatives (k, w) of its radii by the peaks of its welds."""
        return [
            weld_columns(self.azimuth_rad[members], self.welds_of(course), nominal_m)
            for course, members in enumerate(self.members)
        ]

    @property
    def members(self):
        """Indices of the sites of each course."""
        return [np.flatnonzero(self.course == c) for c in range(self.course.max() + 1)]

    def free_columns(self, members):
        """Return derivatives (k, p) of radii of a course by its parameters without prior.

        The order is: radius, then for each ring x and y of its centre, and of its lean.
        """
        azimuth, ring = self.azimuth_rad[members], self.ring[members]
        # The mean of a full turn (nan) does not depend on the centre of the section.
        turn = np.nan_to_num(np.column_stack([np.sin(azimuth), np.cos(azimuth)]))
        columns = [np.ones((len(members), 1))]
        for number in np.unique(ring[ring >= 0]):
            in_ring = turn * (ring == number)[:, None]
            # The centre of the ring; a leaning ring also has a shift of the centre per half course.
            columns.append(in_ring)
            if np.any(self.leans[members] & (ring == number)):
                columns.append(in_ring * self.zeta[members, None])
        return np.hstack(columns)


def spans_of(joints_m):
    """Return bottom and top (courses, 2) of courses as fractions of the height of the shell.

    joints_m (courses + 1,) are the heights of the joints, m.

    Examples
    --------
    >>> spans_of(np.array([0.0, 2.0, 4.0, 5.0])).tolist()
    [[0.0, 0.4], [0.4, 0.8], [0.8, 1.0]]
    """
    parts = (joints_m - joints_m[0]) / (joints_m[-1] - joints_m[0])
    return np.column_stack([parts[:-1], parts[1:]])


def free_design(sites):
    """Return the design (n, p) of the parameters without prior, and the columns of the radii.

    The parameters are in the order of the courses, as in `Sites.free_columns`; then follow the
    shared unknowns.
    """
    blocks = [(members, sites.free_columns(members)) for members in sites.members]
    starts = np.cumsum([0, *(block.shape[1] for _, block in blocks)])
    design = np.zeros((len(sites), starts[-1]))
    for start, (members, block) in zip(starts, blocks, strict=False):
        # The parameters of a course affect only its own readings: the design is block diagonal.
        design[members, start : start + block.shape[1]] = block
    if sites.shared is not None:
        design = np.hstack([design, sites.shared])
    return design, starts[:-1]


def distinct_azimuths(azimuth_rad):
    """Return the index (n,) of each azimuth among the distinct azimuths, and these azimuths."""
    turns = np.round((np.asarray(azimuth_rad) % FULL_TURN) / SAME_AZIMUTH_RAD)
    distinct, place = np.unique(turns, return_inverse=True)
    return place, distinct * SAME_AZIMUTH_RAD


def _select_courses(course, azimuth_rad, remaining):
    """Return course, renumbered among the remaining courses, and azimuth of their points."""
    in_courses = np.isin(course, remaining)
    return np.searchsorted(remaining, course[in_courses]), azimuth_rad[in_courses]


def cells_of(sites, variance_m2, nominal_m, most=MOST_SITES):
    """Return the weights of the means of points in at most `most` cells.

    A cell is a section of a ring of points. The mean over a width d attenuates a wave of k periods
    around the turn by 1 - (k d / R)^2 / 24.

    Parameters
    ----------
    sites : Sites
        n points.
    variance_m2 : ndarray, shape (n,)
        Variances of the radii, m2; the weight of a point is the inverse.
    nominal_m : float
        Radius of the tank, m.
    most : int
        Largest number of cells.

    Returns
    -------
    sparse array, shape (m, n)
        The elements of each row sum to one.

    Examples
    --------
    >>> course = np.zeros(4, dtype=int)
    >>> azimuth = np.array([0.0, 1e-3, 2.0, 4.0])
    >>> sites = Sites(course, course, np.zeros(4), azimuth, course > 0)
    >>> cells_of(sites, np.ones(4), 5.0, most=3).toarray()[0]
    array([0.5, 0.5, 0. , 0. ])
    """
    width, height_step = CELL_M / nominal_m, CELL_ZETA
    turn, ring = sites.azimuth_rad % FULL_TURN, np.unique(sites.ring, return_inverse=True)[1]
    while True:
        columns, rows = int(FULL_TURN / width) + 1, int(2 / height_step) + 2
        height = np.clip(((sites.zeta + 1) / height_step).astype(int), 0, rows - 1)
        cell = (ring * rows + height) * columns + (turn / width).astype(int)
        place = np.unique(cell, return_inverse=True)[1]
        full_turn = width > FULL_TURN
        if place.max() < most or (
            full_turn and height_step > 2
        ):  # no further reduction: one cell a ring
            break
        # First widen the cells to a full turn; only then may they exceed the height limit.
        width, height_step = (
            WIDER * width,
            WIDER * height_step if full_turn else min(WIDER * height_step, TALLEST),
        )
    weight = 1 / variance_m2
    weight = weight / np.bincount(place, weight)[place]
    return scipy.sparse.csr_array((weight, (place, np.arange(len(place)))))


def sites_of_cells(sites, weights):
    """Return the `Sites` of means of points.

    Parameters
    ----------
    sites : Sites
        n points.
    weights : sparse array, shape (m, n)
        Result of `cells_of`.

    Returns
    -------
    Sites
        m sites.
    """
    turn = weights @ np.exp(1j * sites.azimuth_rad)
    # All points of a cell have one course and ring: those of its first point.
    first = weights.indices[weights.indptr[:-1]]
    return Sites(
        course=sites.course[first],
        ring=sites.ring[first],
        zeta=weights @ sites.zeta,
        azimuth_rad=np.angle(turn) % FULL_TURN,
        leans=sites.leans[first],
        welds_rad=sites.welds_rad,
        points=(sites.course, sites.azimuth_rad),
        spans=sites.spans,
        smoothed=sites.smoothed,
    )
