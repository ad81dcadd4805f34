"""The volume of a shell of courses, from its sections, with the covariance kept to every row.

Within a course the outline is interpolated in height, r(a, z) = sum l_i(z) r_i(a), never the area,
and never across a joint. What a course is integrated through are the outlines of that polynomial at
its Gauss levels. With their area products G_ij = 1/2 integral r_i r_j da, inside,

    A(z) = sum l_i(z) l_j(z) G_ij,      V(h) = sum over courses of G_ij integral l_i l_j dz,

so every row is a weighted sum of a few products: that is the whole propagation. Heights in this
room count from the bottom of the first course, in metres.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
import scipy.linalg

from tankcal.errors import HeightError
from tankcal.messages import message
from tankcal.quadrature import height_polynomials, height_products
from tankcal.tank.courses import CourseShape, gauss_levels
from tankcal.uncertainty import factor_of


@dataclass(frozen=True)
class ShellVolume:
    """The courses of a shell, and what can be integrated over them.

    The features of a shell are the products G_ij (i <= j) of all its courses, one after another.

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
    def form_m2(self):
        """(f, modes) effect on the features of one sd of each mode of the common form."""
        return np.vstack([course.upper("by_form_m2") for course in self.courses])

    @property
    def own_form_m2(self):
        """(f, c) factor of the features' covariance by the form that each course has of its own."""
        factors = []
        for course in self.courses:
            effect = course.upper("by_own_form_m2")
            factors.append(factor_of(effect @ effect.T))
        return scipy.linalg.block_diag(*factors)

    @cached_property
    def features(self):
        """(f,) the products that every volume is a sum of, m2."""
        return np.concatenate([course.upper("products_m2") for course in self.courses])

    @cached_property
    def girth_features(self):
        """(f,) what the features lose by metre of inset, m."""
        return np.concatenate([course.upper("girths_m") for course in self.courses])

    @cached_property
    def scale_features(self):
        """(f,) derivative of the features by a scale of the surveyed lengths, m2."""
        return np.concatenate([course.upper("by_scale_m2") for course in self.courses])

    def integrated(self, heights_m, features):
        """(rows, ...) sums over the features of the volume below each height, m times their unit.

        features (f,) or (f, c): each column stands for the products G_ij of all courses.
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

    def by_scale_m3(self, heights_m):
        """(rows,) derivative of the volume below each height by a scale of surveyed lengths."""
        return self.integrated(heights_m, self.scale_features)

    def by_barrel_m2(self, heights_m):
        """(rows, courses) derivative of the volume below each height by the barrel of each course.

        A barrel of b adds b (1 - (2 t - 1)^2) to the radius at the part t of the course's height: b
        in the middle, nothing at the ends. What the outlines do not show of it, times the girth, is
        integrated: after one section in the middle -1/3 of the barrel at the top of the course,
        after two at the Gauss levels nothing there, after three nothing at any height. Independent
        barrels of u = 4 mm and one section at mid-height are 145 ppm of the volume of 8 courses of
        radius 6.5 m: 2 u / (3 R sqrt(8)).
        """
        alone = np.eye(len(self.courses))
        polynomials = [np.outer(*pair) for pair in zip(self._missed_m, alone, strict=True)]
        return self._integral(heights_m, polynomials)

    def by_common_barrel_m2(self, heights_m):
        """(rows,) derivative of the volume below each height by one barrel of all courses."""
        return self._integral(heights_m, self._missed_m)

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
        """(courses,) barrel of the mean radius; nan of a course seen at two levels or one."""
        found = []
        for course in self.courses:
            radii = np.sqrt(np.diag(course.products_m2) / np.pi)
            seen = _height_polynomials(course.degree) @ radii
            found.append(-seen[2] / 4 if course.degree == 2 else np.nan)
        return np.array(found)

    @cached_property
    def _missed_m(self):
        """For each course by the powers of t the unseen part of a unit barrel, times the girth."""
        missed = []
        for course in self.courses:
            powers = _height_polynomials(course.degree)
            unseen = np.array([0.0, 4.0, -4.0])
            unseen[: course.degree + 1] -= powers @ course.barrel
            missed.append(np.convolve(powers @ np.diag(course.girths_m), unseen))
        return missed

    def _by_height(self, features):
        """For each course the coefficients of sum l_i(t) l_j(t) features_ij by the powers of t."""
        polynomials, start = [], 0
        for course in self.courses:
            weights = _height_weights(course.degree)
            polynomials.append(weights @ features[start : start + weights.shape[1]])
            start += weights.shape[1]
        return polynomials

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
def _height_polynomials(degree):
    """(degree + 1, degree + 1) coefficients of l_i(t) of the Gauss levels, by the powers of t."""
    return height_polynomials(gauss_levels(degree), degree)


@cache
def _height_weights(degree):
    """(2 degree + 1, f) coefficients of l_i l_j, what stands below the diagonal counted there."""
    products = height_products(gauss_levels(degree), degree)
    rows, columns = np.triu_indices(products.shape[1])
    return products[:, rows, columns] * np.where(rows == columns, 1.0, 2.0)
