"""Sites of the measurements of a wall: design without prior, and covariances of the components.

Many points of a wall are reduced to fewer sites, the means of the points in cells. The covariance
of seams between sites is a product c(a - a') h(zeta, zeta'). All other covariances are sums of
products of columns: a few waves around the tank, or the mean radius, times polynomials in the
height.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.geometry.field.components import (
    COMPONENTS,
    Heights,
    seam_correlations,
    wave_columns,
    weld_columns,
)
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


def clip_to_semidefinite(covariance):
    """Return the nearest positive semidefinite matrix, as differences may be indefinite."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


class Covariances:
    """Covariances of the components, of unit variance, between sites.

    Parameters
    ----------
    sites : Sites
        n sites.
    nominal_m : float
        Radius of the tank, m.

    Attributes
    ----------
    place : ndarray of int, shape (n,)
        Index of the azimuth of each site among the distinct azimuths.
    azimuths_rad : ndarray, shape (a,)
        Distinct azimuths.
    """

    def __init__(self, sites, nominal_m):
        self.sites, self.nominal_m = sites, nominal_m
        self.place, self.azimuths_rad = distinct_azimuths(sites.azimuth_rad)
        self._in_order = len(self.azimuths_rad) == len(sites)
        if self._in_order:  # all azimuths are distinct: keep the order of the sites
            self.azimuths_rad = self.azimuths_rad[self.place]
            self.place = np.arange(len(sites))

    @cached_property
    def members(self):
        """Return the indices of the sites of each course."""
        return self.sites.members

    def columns_at_sites(self, columns, members=slice(None)):
        """Return columns (k, a) of the distinct azimuths, rearranged for some sites."""
        if self._in_order:
            return columns[:, members]
        return columns[:, self.place[members]]

    @cached_property
    def runs(self):
        """Return `members`, with slices for courses whose sites are consecutive."""
        return [
            slice(int(indices[0]), int(indices[-1]) + 1)
            if len(indices) and np.all(np.diff(indices) == 1)
            else indices
            for indices in self.members
        ]

    def total(self, variances_m2):
        """Return the covariance (n, n) of the sum of all components, m2.

        Parameters
        ----------
        variances_m2 : ndarray, shape (components,)

        Returns
        -------
        ndarray, shape (n, n)
        """
        everywhere = slice(None)
        # First the common components, over all sites; then the own components, in the blocks of
        # courses.
        covariance = self._seams(everywhere) * self._up(True, variances_m2, everywhere)
        common = [i for i in self._columns if COMPONENTS[i].common]
        columns = [np.sqrt(variances_m2[i]) * self._columns[i] for i in common]
        if self.sites.welds_rad:
            columns += [
                np.sqrt(variances_m2[i]) * peaks_of_component
                for i, peaks_of_component in self.peaks.items()
            ]
        _add_products(covariance, np.hstack(columns))
        for members in self.runs:
            block = self._seams(members) * self._up(False, variances_m2, members)
            own_columns = [
                np.sqrt(variances_m2[i]) * columns[members]
                for i, columns in self._columns.items()
                if i not in common
            ]
            _add_products(block, np.hstack(own_columns))
            block_index = (
                (members, members) if isinstance(members, slice) else np.ix_(members, members)
            )
            covariance[block_index] += block
        return covariance

    def spread(self, weights, index):
        """Return the covariance (f, f) of functionals (f, n) of the sites due to a component."""
        return sum(left @ right.T for left, right in self._halves(weights, index))

    def spread_alone(self, weights, index):
        """Return the variances (f,) of functionals (f, n) due to a component."""
        halves = self._halves(weights, index)
        return sum(np.einsum("fk,fk->f", left, right) for left, right in halves)

    def _halves(self, weights, index):
        """Yield pairs (f, k) whose products sum to the covariance due to a component."""
        component = COMPONENTS[index]
        common = component.common or index in self.peaks
        for members in [slice(None)] if common else self.runs:
            part = weights[:, members]
            if component.shape == "seam":
                seams = self._seams(members)
                seams = seams if component.is_level else seams * self._height(index, members)
                yield part @ seams, part
            else:
                columns = self.peaks if index in self.peaks else self._columns
                by_columns = part @ columns[index][members]
                yield by_columns, by_columns

    @cached_property
    def peaks(self):
        """Return {component: derivative (n, k) of the sites by the peaks of welds}.

        A common component has a single peak height for all welds (k = 1), otherwise each weld has
        its own.
        """
        by_weld = scipy.linalg.block_diag(*self.sites.welds_at(self.nominal_m))
        by_weld = by_weld[np.argsort(np.concatenate(self.members), kind="stable")]
        return {
            index: by_weld.sum(axis=1, keepdims=True) if component.common else by_weld
            for index, component in enumerate(COMPONENTS)
            if component.shape == "weld"
        }

    @cached_property
    def _columns(self):
        """Return {component: columns (n, k) A with A A' = covariance}, for mean radii and waves."""
        waves, heights = wave_columns(self.sites.azimuth_rad), self.sites.heights
        return {
            index: component.columns(waves, heights)
            for index, component in enumerate(COMPONENTS)
            if component.shape in ("mean", "oval", "settled")
        }

    def _up(self, common, variances_m2, members):
        """Return the sum of variance times h of seams; a number if all are level."""
        return sum(
            variances_m2[i] * self._height(i, members)
            for i, component in enumerate(COMPONENTS)
            if (component.shape, component.common) == ("seam", common)
        )

    def _height(self, index, members):
        """Return h of a component between some sites; a number for a level component."""
        component = COMPONENTS[index]
        if component.is_level:
            return 1.0
        heights = self.sites.heights[members]
        return component.height_covariance(heights, heights)

    def _seams(self, members):
        """Return c of seams between some sites."""
        if self._in_order and isinstance(members, slice):
            return self._seam_correlations[members, members]
        place = self.place[members]
        return self._seam_correlations[place[:, None], place]

    @cached_property
    def _seam_correlations(self):
        """Return c of seams between the distinct azimuths."""
        return seam_correlations(self.azimuths_rad, self.azimuths_rad, self.nominal_m)


def _add_products(matrix, columns):
    """Add columns @ columns.T to a symmetric matrix in place."""
    # BLAS expects column order: the transpose of a C-ordered symmetric matrix, without a copy.
    scipy.linalg.blas.dgemm(
        1.0, columns, columns, beta=1.0, c=matrix.T, trans_b=True, overwrite_c=True
    )
