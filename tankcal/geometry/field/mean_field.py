"""The wall of a tank of which the mean radius of each course is known, and nothing else.

What a course does besides (bulge, taper) has the mean 0 over its height, for it is in the radius
already: f - M f, M the mean over the course. So it moves no volume at a joint; between joints it is
in the doubt, as large as walls are (`components`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.covariances import without_rounding
from tankcal.geometry.field.estimate import FEWEST_OF_GRID, LEVELS, gauss_heights
from tankcal.geometry.field.sites import Sites
from tankcal.quadrature import panels


@dataclass(frozen=True)
class MeanField:
    """A wall of courses with known mean radii, with what a `WallField` has of it.

    Attributes
    ----------
    mean_radius_m : ndarray, shape (courses,)
    """

    mean_radius_m: np.ndarray
    stated = ()

    @cached_property
    def amplitudes(self):
        """`Amplitudes` of the wall between the joints: assumed."""
        return assumed_amplitudes()

    @cached_property
    def sites(self):
        """`Sites` of the Gauss levels of each course, of whole turns."""
        courses = len(self.mean_radius_m)
        n = courses * LEVELS
        return Sites(
            course=np.repeat(np.arange(courses), LEVELS),
            ring=np.full(n, -1),
            zeta=np.tile(gauss_heights(), courses),
            azimuth_rad=np.full(n, np.nan),
            leans=np.zeros(n, dtype=bool),
        )

    @cached_property
    def outlines_m(self):
        """(courses, LEVELS, g) the radius at each Gauss level of each course."""
        return self.outlines_at(gauss_heights())

    def outlines_at(self, zeta):
        """(courses, k, g) the radius at heights (k,) of each course."""
        shape = (len(self.mean_radius_m), len(np.atleast_1d(zeta)), FEWEST_OF_GRID)
        return np.broadcast_to(self.mean_radius_m[:, None, None], shape)

    def functionals(self, gradients_m):
        """`MeanFunctionals` of the wall: each the integral of a gradient times its radius.

        gradients_m  (courses, LEVELS, g), as of `WallField.functionals`
        """
        return MeanFunctionals(self, 2 * np.pi * np.mean(gradients_m, axis=2))

    def seen(self, departures_m):
        """(courses, LEVELS) mean of departures (n,) at the sites over each course."""
        means = departures_m.reshape(-1, LEVELS) @ _shares()
        return np.repeat(means[:, None], LEVELS, axis=1)


class MeanFunctionals:
    """Linear functionals of such a wall, one for each course and Gauss level.

    Attributes
    ----------
    weights : ndarray, shape (f, courses)
        Derivative by the mean radii.
    """

    def __init__(self, field, totals):
        self._field, self._totals = field, totals
        own = np.eye(len(totals))[:, None] * totals[:, :, None]
        self.weights = own.reshape(-1, len(totals))

    def unseen(self, index):
        """(f, f) covariance of the functionals by what the mean does not say of one component."""
        one, size = COMPONENTS[index], self._field.amplitudes.variances_m2[index]
        if one.shape != "mean":  # round the wall: it has no part in areas
            return np.zeros((self._totals.size, self._totals.size))
        about_mean = np.eye(LEVELS) - _shares()
        levels = self._field.sites.heights_at(0, gauss_heights())
        height = about_mean @ one.height_covariance(levels, levels) @ about_mean.T
        count, flat = len(self._totals), self._totals.ravel()
        same = np.ones((count, count)) if one.common else np.eye(count)
        return without_rounding(size * np.outer(flat, flat) * np.kron(same, height))


def _shares():
    """(LEVELS,) of a course's height that each Gauss level stands for."""
    return panels([0.0, 1.0], LEVELS)[1]
