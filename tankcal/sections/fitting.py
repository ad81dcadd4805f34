"""The circle through the points of one section, and their outline.

Points of a course that do not lie level make no section: their circle and outline are those at
their mean height, fitted with a taper and a lean.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.geometry.circles import (
    Circle,
    fit_circle,
    own_columns,
    radial_covariance,
    taubin_circle,
)
from tankcal.geometry.form import Sample
from tankcal.geometry.outlines import (
    Outline,
    evenly_spread,
    interpolate_outline,
    polar,
    radii_by_coordinates,
    smooth_outline,
)
from tankcal.sections.grouping import Group


@dataclass(frozen=True)
class Section:
    """Points of a group, their circle, and their outline.

    Attributes
    ----------
    group : Group
    circle : Circle
        Least-squares circle.
    outline : Outline
        At group.height_m.
    radii_by_points : sparse array, shape (n, 3n)
        Derivative of the outline's n measured radii by x, y, z of the points.
    """

    group: Group
    circle: Circle
    outline: Outline
    radii_by_points: scipy.sparse.csr_array


def slide(xyz_m, slope, z_m):
    """Points slid parallel to the axis to height z, and the derivative.

    A horizontal cut of a leaning shell is what is wanted, so the tilt is contained and never
    corrected again. The slope itself is taken as exact: its error has opposite signs on opposite
    sides of the tank, so the area hardly changes with it.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
    slope : array_like, shape (2,)
        Of the axis: metres in x and y for a metre of height.
    z_m : float
        Height of the cut, m.

    Returns
    -------
    xy_m : ndarray, shape (n, 2)
    by_xyz : sparse array, shape (2n, 3n)
        d(xy) / d(xyz).

    Examples
    --------
    >>> xy, by_xyz = slide([[1.0, 0.0, 3.0]], (0.01, 0.0), 1.0)
    >>> xy.tolist(), by_xyz.toarray()[0].tolist()
    ([[0.98, 0.0]], [1.0, 0.0, -0.01])
    """
    n = len(xyz_m)
    rows = np.repeat(np.arange(2 * n), 2)
    columns = np.add.outer(3 * np.arange(n), [0, 2, 1, 2]).ravel()
    values = np.tile([1.0, -slope[0], 1.0, -slope[1]], n)
    by_xyz = scipy.sparse.csr_array((values, (rows, columns)), shape=(2 * n, 3 * n))
    return _slid(xyz_m, slope, z_m), by_xyz


def _slid(xyz_m, slope, z_m):
    xyz_m = np.asarray(xyz_m, dtype=float)
    return xyz_m[:, :2] - (xyz_m[:, 2:] - z_m) * np.asarray(slope)


def _by_own(slope):
    """(2, 3) derivative of x and y of a point that is slid by its own x, y, z."""
    return np.column_stack([np.eye(2), -np.asarray(slope, dtype=float)])


def _in_plan(xyz_m, covariance_m2, slope, z_m):
    """Points (n, 2) slid to height z, and their covariance, of each point where it was so given."""
    if np.ndim(covariance_m2) == 3:
        by_own = _by_own(slope)
        return _slid(xyz_m, slope, z_m), by_own @ covariance_m2 @ by_own.T
    xy, by_xyz = slide(xyz_m, slope, z_m)
    return xy, by_xyz @ covariance_m2 @ by_xyz.T


def sample_of(group, xyz_m, covariance_m2, slope, z_m):
    """Radii of a group of points about the centre of their circle, for the field of the wall.

    Radius and centre are free there, so an approximate centre will do.

    Parameters
    ----------
    group, xyz_m, covariance_m2, slope, z_m
        As in `fit_section`.

    Returns
    -------
    form.Sample
    """
    xy, covariance_xy = _in_plan(xyz_m, covariance_m2, slope, z_m)
    middle = xy.mean(axis=0)
    centre = taubin_circle(xy - middle)[:2] + middle
    noise = radial_covariance(xy, centre, covariance_xy)
    azimuth, radius = polar(xy, *centre)
    return Sample(azimuth, radius, noise, _zeta(group, xyz_m, z_m), centre)


def fit_section(group, xyz_m, covariance_m2, slope, z_m, form_m2):
    """Circle and outline of the points of one group.

    The outline of level points is interpolated where they are evenly spread, else smoothed, as that
    of points that are not level (group.degree above 0).

    Parameters
    ----------
    group : Group
    xyz_m : (n, 3) array
        The members of the group, in metres.
    covariance_m2 : (3n, 3n) array or sparse matrix, or (n, 3, 3) array
        In the order x1 y1 z1 x2 ...; or that of each point, where they are independent.
    slope : (2,) array
        Of the axis: metres in x and y for a metre of height.
    z_m : float
        Height of the cut (group.height_m) in the frame of the points.
    form_m2 : float
        Amplitude of the shell's form: mode k >= 2 of the outline has the variance form_m2 k^-3.

    Returns
    -------
    Section

    Raises
    ------
    SolutionError
        For fewer than 3 points, or points on a line.

    Examples
    --------
    Twelve points, 1 mm each, on a circle of 6.5 m radius: u of the radius is 1 mm / sqrt(12).

    >>> azimuth = np.arange(12) * np.pi / 6
    >>> xyz = 6.5 * np.column_stack([np.sin(azimuth), np.cos(azimuth), np.zeros(12)])
    >>> group = Group("1", 0, 1.0, np.arange(12))
    >>> section = fit_section(group, xyz, 1e-6 * np.eye(36), (0.0, 0.0), 0.0, 0.0)
    >>> round(section.circle.radius_m, 9)
    6.5
    >>> round(float(np.sqrt(section.circle.cofactor_m2[2, 2])) * 1000, 4)
    0.2887
    """
    xy, covariance_xy = _in_plan(xyz_m, covariance_m2, slope, z_m)
    circle = fit_circle(xy, covariance_xy)
    centre = circle.x_m, circle.y_m
    here, zeta = float(group.zeta(group.height_m)), _zeta(group, xyz_m, z_m)
    if group.degree == 0 and evenly_spread(polar(xy, *centre)[0]):
        outline = interpolate_outline(xy, *centre, form_m2)
    else:
        noise = radial_covariance(xy, centre, covariance_xy)
        away = zeta - here
        outline = smooth_outline(xy, *centre, noise, form_m2, away, group.degree)
    by_points = own_columns(radii_by_coordinates(outline, xy) @ _by_own(slope))
    return Section(group, circle, outline, by_points)


def _zeta(group, xyz_m, z_m):
    return group.zeta(np.asarray(xyz_m)[:, 2] - z_m + group.height_m)
