"""Gauss-Legendre quadrature, and the area and volume integrals based on it.

A rule of n nodes is exact for polynomials of degree 2n - 1.

Sources: Carneiro 1993 (areas of tank sections by Gaussian quadrature); Davis & Rabinowitz 1984,
Methods of Numerical Integration, 2.7.
"""

import numpy as np


def panels(breaks, nodes):
    """Nodes and weights of a composite Gauss-Legendre rule.

    Parameters
    ----------
    breaks : array_like, shape (k,)
        Ends of the k - 1 intervals, ascending, in any unit.
    nodes : int
        Number of nodes in each interval; polynomials of degree 2 nodes - 1 are integrated exactly.

    Returns
    -------
    nodes, weights : ndarray, shape ((k - 1) nodes,)
        In the unit of the breaks.

    Examples
    --------
    The integral of x^3 from 0 to 2, in two intervals:

    >>> x, w = panels([0.0, 1.0, 2.0], 2)
    >>> round(float(w @ x**3), 12)
    4.0
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    breaks = np.asarray(breaks, dtype=float)
    # Map the rule from [-1, 1] to each interval: x -> middle + half x, w -> half w.
    middle, half = (breaks[1:] + breaks[:-1]) / 2, np.diff(breaks) / 2
    return (middle[:, None] + half[:, None] * x).ravel(), (half[:, None] * w).ravel()


def polar_products(radii_m, weights_rad):
    """Area products G_ij = 1/2 integral r_i r_j dtheta of outlines in polar coordinates.

    Parameters
    ----------
    radii_m : array_like, shape (k, q)
        Radii of k outlines at q nodes, each about its own centre, m.
    weights_rad : array_like, shape (q,)
        Weights of the nodes, with the sum 2 pi.

    Returns
    -------
    ndarray, shape (k, k)
        G, m2.

    Notes
    -----
    G_ii is the area of outline i. An interpolated outline r = sum l_i r_i has the area l' G l.

    Examples
    --------
    A circle of 2 m radius, in four panels of azimuth:

    >>> azimuth, weights = panels(np.linspace(0.0, 2 * np.pi, 5), 3)
    >>> area = polar_products(np.full(len(azimuth), 2.0), weights)
    >>> round(float(area[0, 0] / np.pi), 12)
    4.0
    """
    radii_m = np.atleast_2d(radii_m)
    # The area element in polar coordinates is r^2 dtheta / 2.
    return 0.5 * (radii_m * weights_rad) @ radii_m.T


def height_basis(levels, z, degree):
    """Basis functions l_i(z) of the least-squares polynomial through values at k levels.

    Parameters
    ----------
    levels : array_like, shape (k,)
        Heights of the values, m.
    z : array_like, shape (n,)
        Heights at which the functions are evaluated, m.
    degree : int
        Degree of the polynomial, at most k - 1.

    Returns
    -------
    ndarray, shape (n, k)
        l_i(z), without a unit.

    Notes
    -----
    The polynomial is sum l_i(z) value_i. For the degree k - 1 it passes through all values
    (Lagrange).

    Examples
    --------
    Halfway between two levels, both have the weight one half:

    >>> height_basis([1.0, 3.0], [2.0], 1).round(12)
    array([[0.5, 0.5]])
    """
    levels, z = np.asarray(levels, dtype=float), np.asarray(z, dtype=float)
    # Heights are scaled to [-1, 1], which keeps the Vandermonde matrix well-conditioned.
    middle = levels.mean()
    half = np.ptp(levels) / 2 or 1.0
    powers = np.vander((levels - middle) / half, degree + 1, increasing=True)
    return np.vander((z - middle) / half, degree + 1, increasing=True) @ np.linalg.pinv(powers)


def height_polynomials(levels, degree):
    """Coefficients c_mi of the basis functions l_i(t) = sum c_mi t^m of `height_basis`.

    Parameters
    ----------
    levels : array_like, shape (k,)
        Heights of the values, as fractions t of the height of a course.
    degree : int
        Degree of the polynomial, at most k - 1.

    Returns
    -------
    ndarray, shape (degree + 1, k)
        c_mi, without a unit.

    Examples
    --------
    Values at the bottom and at the top of a course give l_0 = 1 - t and l_1 = t:

    >>> height_polynomials([0.0, 1.0], 1).round(12) + 0.0
    array([[ 1.,  0.],
           [-1.,  1.]])
    """
    # A polynomial is determined by its values at degree + 1 points; here they span the course.
    t = np.linspace(0.0, 1.0, degree + 1)
    return np.linalg.solve(np.vander(t, increasing=True), height_basis(levels, t, degree))
