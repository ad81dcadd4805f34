"""Many points of a wall as fewer sites: means of the points in cells of its surface."""

import numpy as np
import scipy.sparse

from tankcal.geometry.field.sites import Sites
from tankcal.geometry.outlines import FULL_TURN

MOST_SITES = 1600  # of a field: its covariance is written out
CELL_M, CELL_ZETA, WIDER = 0.1, 0.1, 1.3  # first width and height of a cell, and its growth
TALLEST = 0.2  # of half a course: a mean over w of a bulge b (1 - zeta^2) is b w^2 / 12 too low


def cells_of(sites, variance_m2, nominal_m, most=MOST_SITES):
    """Weights of the means of points in cells, no more than so many.

    A cell is a piece of one ring of points. The mean over a width d shows a wave of k around the
    turn times 1 - (k d / R)^2 / 24.

    Parameters
    ----------
    sites : Sites
        Of n points.
    variance_m2 : ndarray, shape (n,)
        Of their radii, m2: a point counts as its inverse.
    nominal_m : float
        Radius of the tank, m.
    most : int
        Cells.

    Returns
    -------
    sparse array, shape (m, n)
        Rows add up to one.

    Examples
    --------
    >>> course = np.zeros(4, dtype=int)
    >>> azimuth = np.array([0.0, 1e-3, 2.0, 4.0])
    >>> sites = Sites(course, course, np.zeros(4), azimuth, course > 0)
    >>> cells_of(sites, np.ones(4), 5.0, most=3).toarray()[0]
    array([0.5, 0.5, 0. , 0. ])
    """
    wide, tall = CELL_M / nominal_m, CELL_ZETA
    turn, ring = sites.azimuth_rad % FULL_TURN, np.unique(sites.ring, return_inverse=True)[1]
    while True:
        columns, rows = int(FULL_TURN / wide) + 1, int(2 / tall) + 2
        height = np.clip(((sites.zeta + 1) / tall).astype(int), 0, rows - 1)
        cell = (ring * rows + height) * columns + (turn / wide).astype(int)
        place = np.unique(cell, return_inverse=True)[1]
        around = wide > FULL_TURN
        if place.max() < most or (around and tall > 2):  # there may be more rings than that
            break
        wide, tall = WIDER * wide, WIDER * tall if around else min(WIDER * tall, TALLEST)
    weight = 1 / variance_m2
    weight = weight / np.bincount(place, weight)[place]
    return scipy.sparse.csr_array((weight, (place, np.arange(len(place)))))


def sites_of_cells(sites, weights):
    """The `Sites` of means of points.

    Parameters
    ----------
    sites : Sites
        Of n points.
    weights : sparse array, shape (m, n)
        Of `cells_of`.

    Returns
    -------
    Sites
    """
    turn = weights @ np.exp(1j * sites.azimuth_rad)
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
