"""The shape of one course: its outlines at the Gauss levels of its height.

Between the Gauss levels t_i the area of the horizontal cut is the polynomial through the areas
there, A(t) = sum l_i(t) A_i, and the volume below a height its integral: of a course whose radius
is a cubic in height both are exact.
"""

from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np

from tankcal.geometry.field.estimate import gauss_heights
from tankcal.geometry.outlines import FULL_TURN


@dataclass(frozen=True)
class CourseShape:
    """One course: where it stands, and its outlines at its Gauss levels.

    Attributes
    ----------
    bottom_m, top_m : float
        Heights above the bottom of the first course, m.
    outlines_m : ndarray, shape (LEVELS, g)
        Inside radii at even azimuths from north on, at the table's temperature, m.
    inset_m : float
        Plate and paint that were taken off the surveyed radius, m.
    scale : float
        Of the surveyed lengths, by temperature: outlines = scale (surveyed - inset).
    missed : dict of {str: ndarray, shape (LEVELS,)}
        {input: what the estimate lacks of the radius at each level, of a departure of one metre}:
        "barrel" is 1 in the middle of a course and 0 at its ends, "taper" -1 at its bottom and 1
        at its top.
    """

    bottom_m: float
    top_m: float
    outlines_m: np.ndarray
    inset_m: float = 0.0
    scale: float = 1.0
    missed: dict = field(default_factory=dict)

    @property
    def height_m(self):
        """Height of the course, along the vertical."""
        return self.top_m - self.bottom_m

    @cached_property
    def areas_m2(self):
        """(LEVELS,) A_i = 1/2 integral of r_i^2 over the full turn."""
        return np.pi * np.mean(self.outlines_m**2, axis=1)

    @cached_property
    def girths_m(self):
        """(LEVELS,) derivative of -A_i by the inset."""
        return FULL_TURN * self.scale * np.mean(self.outlines_m, axis=1)

    @property
    def by_scale_m2(self):
        """(LEVELS,) derivative of A_i by a scale of the surveyed lengths: plates do not grow."""
        return 2 * self.areas_m2 + self.inset_m * self.girths_m

    @property
    def gradients_m(self):
        """(LEVELS, g) derivative of A_i by the surveyed radius, for each radian of azimuth."""
        return self.scale * self.outlines_m


def barrel(zeta):
    """Unit barrel 1 - zeta^2: one in the middle of a course, nothing at its ends.

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
    """Unit taper: -1 at the bottom of a course, +1 at its top, zeta itself."""
    return np.asarray(zeta, dtype=float)


DEPARTURES = {"barrel": barrel, "taper": taper}


@cache
def gauss_levels():
    """(LEVELS,) the Gauss levels of a course, as fractions of its height."""
    return (1 + gauss_heights()) / 2
