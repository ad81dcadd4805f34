"""The volume of a shell of courses, from its sections, with the covariance kept to every row.

Within a course the outline is interpolated in height, r(a, z) = sum l_i(z) r_i(a), never the area,
and never across a joint. With area products G_ij = 1/2 integral r_i r_j da of the inside outlines,

    A(z) = sum l_i(z) l_j(z) G_ij,      V(h) = sum over courses of G_ij integral l_i l_j dz,

so every row is a weighted sum of a few products: that is the whole propagation. Heights in this
room count from the bottom of the first course, in metres.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError
from tankcal.outlines import FORM_MODES, FULL_TURN
from tankcal.quadrature import height_basis, height_products, panels, polar_products

FORM_GRID = 720  # azimuths; resolves products of an outline with the highest mode of the form
HIGHEST_DEGREE, MOST_AMPLIFICATION = 2, 2.5  # of the noise of a section, at the ends of a course


@dataclass(frozen=True)
class CourseShape:
    """One course: where it stands, the heights of its k sections, and its area products.

    degree        of the polynomial in height: sections - 1, at most 2, less where it would carry
                  the noise of a section more than 2.5-fold to an end of the course
    products_m2   (k, k) G_ij of the inside outlines
    girths_m      (k, k) derivative of -G_ij by the inset (plate, paint): mean girths
    by_scale_m2   (k, k) derivative of G_ij by a scale of the surveyed lengths
    by_parameters (k, k, p) derivative of G_ij by the parameters of the course's outlines
    by_form_m2    (k, k, modes) effect on G_ij of one sd of each mode of the form between points
    """

    bottom_m: float
    top_m: float
    levels_m: np.ndarray
    degree: int
    products_m2: np.ndarray
    girths_m: np.ndarray
    by_scale_m2: np.ndarray
    by_parameters: np.ndarray
    by_form_m2: np.ndarray


@dataclass(frozen=True)
class ShellVolume:
    """The courses of a shell, from the bottom up, and what can be integrated over them.

    The features of a shell are the products G_ij (i <= j) of all its courses, one after another.
    """

    courses: tuple[CourseShape, ...]

    @property
    def height_m(self):
        """Height of the shell, along the vertical."""
        return self.courses[-1].top_m

    @property
    def form_m2(self):
        """(f, modes) effect on the features of one sd of each mode of the form between points."""
        return np.vstack([_upper(course.by_form_m2) for course in self.courses])

    @property
    def features(self):
        """(f,) the products that every volume is a sum of, m2."""
        return np.concatenate([_upper(course.products_m2) for course in self.courses])

    def weights_m(self, heights_m):
        """(rows, f) derivative of the volume below each height by the features, m.

        Raises HeightError for a height outside the shell.
        """
        heights = self._inside(heights_m)
        blocks = []
        for course in self.courses:
            tops = np.clip(heights, course.bottom_m, course.top_m)
            blocks.append(
                _folded(height_products(course.levels_m, course.bottom_m, tops, course.degree))
            )
        return np.hstack(blocks)

    def volume_m3(self, heights_m):
        """(rows,) volume between the bottom and each height."""
        return self.weights_m(heights_m) @ self.features

    def area_m2(self, heights_m):
        """(rows,) inside area of the horizontal cut at each height; the upper course at a joint."""
        heights = self._inside(heights_m)
        joints = [course.bottom_m for course in self.courses[1:]]
        area = np.empty(len(heights))
        for index, course in enumerate(self.courses):
            here = np.searchsorted(joints, heights, side="right") == index
            basis = height_basis(course.levels_m, heights[here], course.degree)
            area[here] = np.einsum("ti,ij,tj->t", basis, course.products_m2, basis)
        return area

    def inset_m2(self, heights_m):
        """(rows,) loss of volume below each height by metre of plate or paint: the wetted wall."""
        girths = np.concatenate([_upper(course.girths_m) for course in self.courses])
        return self.weights_m(heights_m) @ girths

    def by_scale_m3(self, heights_m):
        """(rows,) derivative of the volume below each height by a scale of surveyed lengths."""
        by_scale = np.concatenate([_upper(course.by_scale_m2) for course in self.courses])
        return self.weights_m(heights_m) @ by_scale

    def _inside(self, heights_m):
        heights = np.atleast_1d(np.asarray(heights_m, dtype=float))
        outside = ~((heights >= 0) & (heights <= self.height_m * (1 + 1e-12)))
        if np.any(outside):
            raise HeightError(
                f"height {heights[outside][0]:g} m is outside the shell (0 to {self.height_m:g} m)"
            )
        return heights


def course_shape(bottom_m, top_m, levels_m, outlines, *, inset_m=0.0, scale=1.0):
    """One course from the outlines of its sections, as surveyed.

    inset_m  plate and paint to take off the radius (0 when surveyed inside); the difference between
             radial and normal thickness is its (r'/r)^2/2 part, 5e-4 of it at the
             flank of a narrow dent of 30 mm
    scale    of horizontal lengths, for the shell's temperature
    """
    levels = np.asarray(levels_m, dtype=float)
    knots = np.unique(np.concatenate([outline.knots_rad % FULL_TURN for outline in outlines]))
    azimuth, weight = panels(np.append(knots, knots[0] + FULL_TURN), 4)
    bases = [outline.basis(azimuth) for outline in outlines]
    radii = np.array([b @ o.parameters for b, o in zip(bases, outlines, strict=True)])
    inside = scale * (radii - inset_m)
    sums = (inside * weight).sum(axis=1)
    products, girths = polar_products(inside, weight), 0.5 * scale * (sums[:, None] + sums[None, :])
    count = len(outlines)
    starts = np.cumsum([0] + [len(outline.parameters) for outline in outlines])
    by_parameters = np.zeros((count, count, starts[-1]))
    for i in range(count):
        gradient = 0.5 * scale * (inside * weight) @ bases[i]  # row j: dG_ij by parameters of i
        for j in range(count):
            by_parameters[i, j, starts[i] : starts[i + 1]] += gradient[j]
            by_parameters[j, i, starts[i] : starts[i + 1]] += gradient[j]
    return CourseShape(
        bottom_m=float(bottom_m),
        top_m=float(top_m),
        levels_m=levels,
        degree=_degree(levels, bottom_m, top_m),
        products_m2=products,
        girths_m=girths,
        by_scale_m2=2 * products + inset_m * girths,  # plates do not grow with a wrong scale
        by_parameters=by_parameters,
        by_form_m2=_by_form(outlines, inset_m, scale),
    )


def _by_form(outlines, inset_m, scale):
    """(k, k, modes) effect of the unseen form; an even grid, for high modes lie between knots."""
    if not any(outline.form_m2 for outline in outlines):
        return np.zeros((len(outlines), len(outlines), 2 * (FORM_MODES - 1)))
    azimuth = np.arange(FORM_GRID) * FULL_TURN / FORM_GRID
    inside = np.array([scale * (outline.radius_m(azimuth) - inset_m) for outline in outlines])
    unseen = scale * np.array([outline.unseen_form_m(azimuth) for outline in outlines])
    moved = 0.5 * FULL_TURN / FORM_GRID * np.einsum("iqm,jq->ijm", unseen, inside, optimize=True)
    return moved + moved.transpose(1, 0, 2)


def feature_jacobian(course):
    """(f, p) derivative of the features of one course by the parameters of its outlines."""
    return _upper(course.by_parameters)


def _degree(levels, bottom, top):
    """The highest degree that the levels carry to the ends of the course without much noise."""
    for degree in range(min(len(np.unique(levels)) - 1, HIGHEST_DEGREE), 0, -1):
        at_ends = height_basis(levels, [bottom, top], degree)
        if np.linalg.norm(at_ends, axis=1).max() <= MOST_AMPLIFICATION:
            return degree
    return 0


def _upper(matrix):
    return matrix[np.triu_indices(len(matrix))]


def _folded(products):
    """(rows, f) weights of the upper triangle: what stands below the diagonal is counted there."""
    rows, columns = np.triu_indices(products.shape[1])
    return products[:, rows, columns] * np.where(rows == columns, 1.0, 2.0)
