"""The volume of a shell of courses, from its outlines, with the covariance kept to every row.

What a course is integrated through are its outlines at its Gauss levels. With their areas A_i,

    A(t) = sum l_i(t) A_i,      V(h) = sum over courses of A_i integral l_i dz,

so every row is a weighted sum of a few areas: that is the whole propagation. Nothing is
interpolated across a joint. Heights in this room count from the bottom of the first course, m.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise

import numpy as np

from tankcal.errors import HeightError
from tankcal.geometry.field.estimate import LEVELS
from tankcal.messages import message
from tankcal.quadrature import height_polynomials, panels
from tankcal.tank.courses import CourseShape, gauss_levels


@dataclass(frozen=True)
class ShellVolume:
    """The courses of a shell, and what can be integrated over them.

    The features of a shell are the areas at the Gauss levels of all its courses, one after another.

    Attributes
    ----------
    courses : tuple of CourseShape
        From the bottom up.
    """

    courses: tuple[CourseShape, ...]

    @property
    def height_m(self):
        """Height of the shell, along the vertical."""
        return self.courses[-1].top_m

    @property
    def joint_steps_m2(self):
        """(courses - 1,) area just below each joint less the area just above it."""
        polynomials = self._by_height(self.features)
        return np.array([below.sum() - above[0] for below, above in pairwise(polynomials)])

    @property
    def departures(self):
        """Names of the departures of its courses that were declared: "barrel", "taper"."""
        return tuple(self.courses[0].missed)

    @cached_property
    def features(self):
        """(f,) the areas that every volume is a sum of, m2."""
        return np.concatenate([course.areas_m2 for course in self.courses])

    @property
    def top_weights(self):
        """(f,) derivative of the area at the top by the features."""
        weights = np.zeros(len(self.features))
        weights[-LEVELS:] = _height_polynomials().sum(axis=0)
        return weights

    @cached_property
    def girth_features(self):
        """(f,) what the features lose by metre of inset, m."""
        return np.concatenate([course.girths_m for course in self.courses])

    @cached_property
    def scale_features(self):
        """(f,) derivative of the features by a scale of the surveyed lengths, m2."""
        return np.concatenate([course.by_scale_m2 for course in self.courses])

    def integrated(self, heights_m, features):
        """(rows, ...) sums over the features of the volume below each height, m times their unit.

        features (f,) or (f, c): each column stands for the areas of all courses.
        Raises HeightError for a height outside the shell.
        """
        features = np.asarray(features, dtype=float)
        return self._integral(heights_m, self._by_height(features))

    def weights_m(self, heights_m):
        """(rows, f) derivative of the volume below each height by the features, m.

        Raises HeightError for a height outside the shell.
        """
        return self.integrated(heights_m, np.eye(len(self.features)))

    def volume_m3(self, heights_m):
        """(rows,) volume between the bottom and each height."""
        return self.integrated(heights_m, self.features)

    def area_m2(self, heights_m):
        """(rows,) inside area of the horizontal cut at each height; the upper course at a joint."""
        heights = self._inside(heights_m)
        area = np.empty(len(heights))
        polynomials = self._by_height(self.features)
        for course, rows, polynomial in zip(
            self.courses, self._rows(heights), polynomials, strict=True
        ):
            t = (heights[rows] - course.bottom_m) / course.height_m
            area[rows] = np.polynomial.polynomial.polyval(t, polynomial)
        return area

    def inset_m2(self, heights_m):
        """(rows,) loss of volume below each height by metre of plate or paint: the wetted wall."""
        return self.integrated(heights_m, self.girth_features)

    def by_missed_m2(self, heights_m, name, *, each=False):
        """Derivative of the volume below each height by a departure that was not declared.

        name  "barrel" or "taper": the estimate lacks `CourseShape.missed` of it
        each  False: (rows,) by one departure of all courses; True: (rows, courses) by that of each

        After one ring in the middle of each course nobody knows of a barrel: b zeta^2 is lacking,
        and -1/3 of b in the volume of a course.
        """
        missed = [course.girths_m * course.missed[name] for course in self.courses]
        if not each:
            return self.integrated(heights_m, np.concatenate(missed))
        own = np.zeros((len(self.features), len(missed)))
        for index, one in enumerate(missed):
            own[index * LEVELS : (index + 1) * LEVELS, index] = one
        return self.integrated(heights_m, own)

    def by_course_heights_m2(self, heights_m):
        """(rows, courses) derivative of the volume below each height by the height of each course.

        A higher course lifts every joint above it, which gives the area below the joint in place of
        the one above. The outlines stay where they were surveyed.
        """
        heights = self._inside(heights_m)
        passed = np.searchsorted([course.bottom_m for course in self.courses[1:]], heights)
        steps = np.concatenate([[0.0], np.cumsum(self.joint_steps_m2)])
        return np.tril(steps[:, None] - steps)[passed]

    @property
    def barrels_m(self):
        """(courses,) barrel of the mean radius: that of its parabola of least squares in height."""
        zeta, weights = panels([-1.0, 1.0], LEVELS)
        parabola = 1.5 * zeta**2 - 0.5
        radii = [np.sqrt(course.areas_m2 / np.pi) for course in self.courses]
        return np.array([-1.5 * 2.5 * np.sum(weights * parabola * one) for one in radii])

    def _by_height(self, features):
        """For each course the coefficients of sum l_i(t) features_i by the powers of t."""
        return [
            _height_polynomials() @ features[start : start + LEVELS]
            for start in range(0, len(features), LEVELS)
        ]

    def _integral(self, heights_m, polynomials):
        """(rows, ...) integral below each height of a polynomial in t of each course.

        Rows cost only what they see: the polynomial of their own course, and a sum of those below.
        """
        heights = self._inside(heights_m)
        of_courses = self._rows(heights)
        powers = np.ones((1 + max(map(len, polynomials)), len(heights)))
        for course, rows in zip(self.courses, of_courses, strict=True):
            powers[1, rows] = (heights[rows] - course.bottom_m) / course.height_m
        for power in range(2, len(powers)):
            np.multiply(powers[power - 1], powers[1], out=powers[power])
        result = np.empty((len(heights), *polynomials[0].shape[1:]))
        below = np.zeros(polynomials[0].shape[1:])
        for course, rows, polynomial in zip(self.courses, of_courses, polynomials, strict=True):
            divisors = np.arange(1, len(polynomial) + 1).reshape(-1, *[1] * below.ndim)
            primitive = np.concatenate([below[None], course.height_m * polynomial / divisors])
            result[rows] = powers[: len(primitive), rows].T @ primitive
            below = primitive.sum(axis=0)
        return result

    def _rows(self, heights):
        """The rows that end in each course, the upper one at a joint: slices where they ascend."""
        joints = [course.bottom_m for course in self.courses[1:]]
        if np.all(heights[1:] >= heights[:-1]):
            ends = [0, *np.searchsorted(heights, joints), len(heights)]
            return [slice(start, end) for start, end in pairwise(ends)]
        place = np.searchsorted(joints, heights, side="right")
        return [place == index for index in range(len(self.courses))]

    def _inside(self, heights_m):
        heights = np.atleast_1d(np.asarray(heights_m, dtype=float))
        outside = ~((heights >= 0) & (heights <= self.height_m * (1 + 1e-12)))
        if np.any(outside):
            raise HeightError(
                message(
                    "height_outside_shell",
                    "height {height_m:g} m is outside the shell (0 to {top_m:g} m)",
                    height_m=heights[outside][0],
                    top_m=self.height_m,
                )
            )
        return heights


@cache
def _height_polynomials():
    """(LEVELS, LEVELS) coefficients of l_i(t) of the Gauss levels, by the powers of t."""
    return height_polynomials(gauss_levels(), LEVELS - 1)
