"""Shape of a course: its outlines at the Gauss levels of its height.

Between the Gauss levels t_i, the area of the horizontal cut is the polynomial through the areas at
these levels, A(t) = sum l_i(t) A_i. The volume below a height is the integral of A. Both are exact
for a course whose radius is a cubic in height.
"""

from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np

from tankcal.geometry.field.estimate import gauss_heights
from tankcal.units import FULL_TURN


@dataclass(frozen=True)
class CourseShape:
    """Course: its heights, and its outlines at its Gauss levels.

    Attributes
    ----------
    bottom_m, top_m : float
        Heights above the bottom of the first course, m.
    outlines_m : ndarray, shape (LEVELS, g)
        Inside radii at evenly spaced azimuths from north on, at the temperature of the table, m.
    inset_m : float
        Plate and paint subtracted from the surveyed radius, m.
    scale : float
        Temperature factor on the surveyed lengths: outlines = scale (surveyed - inset).
    missed : dict of {str: ndarray, shape (LEVELS,)}
        {input: error of the estimated radius at each level for a departure of one metre}. "barrel"
        is 1 in the middle of a course and 0 at its ends, "taper" is -1 at its bottom and 1 at its
        top.
    """

    bottom_m: float
    top_m: float
    outlines_m: np.ndarray
    inset_m: float = 0.0
    scale: float = 1.0
    missed: dict = field(default_factory=dict)

    @property
    def height_m(self):
        """Height of the course along the vertical."""
        return self.top_m - self.bottom_m

    @cached_property
    def areas_m2(self):
        """Areas (LEVELS,) A_i = 1/2 integral of r_i^2 over the full turn."""
        return np.pi * np.mean(self.outlines_m**2, axis=1)

    @cached_property
    def girths_m(self):
        """Derivative (LEVELS,) of -A_i by the inset."""
        # A = 1/2 integral of (s (r - inset))^2: the derivative is -s times the girth.
        return FULL_TURN * self.scale * np.mean(self.outlines_m, axis=1)

    @property
    def by_scale_m2(self):
        """Derivative (LEVELS,) of A_i by a scale of the surveyed lengths, without the inset."""
        return 2 * self.areas_m2 + self.inset_m * self.girths_m

    @property
    def gradients_m(self):
        """Derivative (LEVELS, g) of A_i by the surveyed radius, per radian of azimuth."""
        return self.scale * self.outlines_m


def barrel(zeta):
    """Return the unit barrel 1 - zeta^2: 1 in the middle of a course, 0 at its ends.

    Parameters
    ----------
    zeta : array_like, shape (n,)
        Heights within the course, -1 to 1.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> barrel(np.array([-1.0, 0.0]))
    array([0., 1.])
    """
    return 1.0 - np.square(zeta)


def taper(zeta):
    """Return the unit taper: -1 at the bottom of a course, +1 at its top, equal to zeta."""
    return np.asarray(zeta, dtype=float)


DEPARTURES = {"barrel": barrel, "taper": taper}


@cache
def gauss_levels():
    """Return the Gauss levels (LEVELS,) of a course, as fractions of its height."""
    return (1 + gauss_heights()) / 2
