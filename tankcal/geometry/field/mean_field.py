"""Wall of a tank for which only the mean radius of each course is known.

All other departures of a course (bulge, taper) have the mean 0 over its height, since the measured
radius includes their mean: f - M f, with M the mean over the course. They do not change the volume
at a joint. Between joints they contribute to the uncertainty, with the prior amplitudes of walls
(`components`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.covariances import clip_to_semidefinite
from tankcal.geometry.field.estimate import FEWEST_OF_GRID, LEVELS, gauss_heights
from tankcal.geometry.field.sites import Sites
from tankcal.quadrature import panels


@dataclass(frozen=True)
class MeanField:
    """Wall of courses with known mean radii, with the interface of `WallField`.

    Attributes
    ----------
    mean_radius_m : ndarray, shape (courses,)
        m.
    """

    mean_radius_m: np.ndarray
    stated = ()

    @cached_property
    def amplitudes(self):
        """Assumed `Amplitudes` of the wall between the joints."""
        return assumed_amplitudes()

    @cached_property
    def sites(self):
        """`Sites` of full turns at the Gauss levels of each course."""
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
        """Radius (courses, LEVELS, g) at each Gauss level of each course, m."""
        return self.outlines_at(gauss_heights())

    def outlines_at(self, zeta):
        """Return the radius (courses, k, g) at heights (k,) of each course, m."""
        shape = (len(self.mean_radius_m), len(np.atleast_1d(zeta)), FEWEST_OF_GRID)
        return np.broadcast_to(self.mean_radius_m[:, None, None], shape)

    def functionals(self, gradients_m):
        """Return `MeanFunctionals` of the wall: integrals of gradients times the radius.

        gradients_m  (courses, LEVELS, g), as for `WallField.functionals`
        """
        return MeanFunctionals(self, 2 * np.pi * np.mean(gradients_m, axis=2))

    def seen(self, departures_m):
        """Return the mean (courses, LEVELS) of departures (n,) at the sites over each course."""
        means = departures_m.reshape(-1, LEVELS) @ _level_weights()
        return np.repeat(means[:, None], LEVELS, axis=1)


class MeanFunctionals:
    """Linear functionals of a `MeanField`, one for each course and Gauss level.

    Attributes
    ----------
    weights : ndarray, shape (f, courses)
        Derivative by the mean radii.
    """

    def __init__(self, field, totals):
        self._field, self._totals = field, totals
        # A functional depends on the mean radius of its own course only.
        by_course = np.eye(len(totals))[:, None] * totals[:, :, None]
        self.weights = by_course.reshape(-1, len(totals))

    def unseen(self, index):
        """Return the covariance (f, f) due to the part of a component outside the mean."""
        component, size = COMPONENTS[index], self._field.amplitudes.variances_m2[index]
        if component.shape != "mean":  # waves along the perimeter do not change areas
            return np.zeros((self._totals.size, self._totals.size))
        # h of f - M f: (I - M) h (I - M)'.
        about_mean = np.eye(LEVELS) - _level_weights()
        levels = self._field.sites.heights_at(0, gauss_heights())
        height = about_mean @ component.height_covariance(levels, levels) @ about_mean.T
        count, flat = len(self._totals), self._totals.ravel()
        course_correlation = np.ones((count, count)) if component.common else np.eye(count)
        of_heights = np.kron(course_correlation, height)
        return clip_to_semidefinite(size * np.outer(flat, flat) * of_heights)


def _level_weights():
    """Return the Gauss weights (LEVELS,), fractions of the height of a course."""
    return panels([0.0, 1.0], LEVELS)[1]
