"""Reduction of many points of a wall to fewer sites: means of the points in cells."""

import numpy as np
import scipy.sparse

from tankcal.geometry.field.sites import Sites
from tankcal.units import FULL_TURN

MOST_SITES = 1600  # largest number of sites of a field, whose covariance is a dense matrix
CELL_M, CELL_ZETA, WIDER = 0.1, 0.1, 1.3  # first width and height of a cell, and growth factor
# Height limit in halves of a course: a mean over w of a bulge b (1 - zeta^2) is b w^2 / 12 too low.
TALLEST = 0.2


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
