"""The shape of one course, from the outlines of its sections, and how it moves with them.

Between its sections the outline is a polynomial in height, r(a, z) = sum l_i(z) r_i(a), of degree
0, 1 or 2. Whatever the sections' heights, that polynomial is kept by its outlines at the Gauss
levels of the course: few, well conditioned, and the same for every course of that degree.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from tankcal.geometry.form import FORM_MODES, unit_form
from tankcal.geometry.outlines import FULL_TURN
from tankcal.quadrature import height_basis, panels, polar_products

FORM_GRID = 720  # azimuths; resolves products of an outline with the highest mode of the form
HIGHEST_DEGREE, MOST_AMPLIFICATION = 2, 2.5  # of the noise of a section, at the ends of a course


@dataclass(frozen=True)
class CourseShape:
    """One course: where it stands, and the area products of its outlines at its Gauss levels.

    Attributes
    ----------
    degree : int
        Of the polynomial in height: sections - 1, at most 2, less where it would carry the noise of
        a section more than 2.5-fold to an end of the course.
    products_m2 : ndarray, shape (q, q)
        G_ij of the inside outlines, q = degree + 1.
    girths_m : ndarray, shape (q, q)
        Derivative of -G_ij by the inset (plate, paint): mean girths.
    by_scale_m2 : ndarray, shape (q, q)
        Derivative of G_ij by a scale of the surveyed lengths.
    by_parameters : ndarray, shape (q, q, p)
        Derivative of G_ij by the parameters of the course's outlines.
    by_form_m2 : ndarray, shape (q, q, modes)
        Effect on G_ij of one sd of each mode of the form, between points, that is common to all
        courses.
    by_own_form_m2 : ndarray, shape (q, q, 2 modes)
        The same of the form of this course alone.
    barrel : ndarray, shape (q,)
        What the outlines show of a barrel of one metre (1 in the middle of the course, 0 at its
        ends).
    """

    bottom_m: float
    top_m: float
    degree: int
    products_m2: np.ndarray
    girths_m: np.ndarray
    by_scale_m2: np.ndarray
    by_parameters: np.ndarray
    by_form_m2: np.ndarray
    by_own_form_m2: np.ndarray
    barrel: np.ndarray

    @property
    def levels(self):
        """(q,) its Gauss levels, as fractions of its height."""
        return gauss_levels(self.degree)

    @property
    def height_m(self):
        """Height of the course, along the vertical."""
        return self.top_m - self.bottom_m

    def upper(self, name):
        """(f, ...) the upper triangle of one of the matrices: each product once."""
        matrix = getattr(self, name)
        return matrix[np.triu_indices(len(matrix))]


def barrel(t):
    """Unit barrel 1 - (2 t - 1)^2: one in the middle of a course, nothing at its ends.

    Parameters
    ----------
    t : array_like
        Parts of the course's height, 0 to 1.

    Returns
    -------
    ndarray or float

    Examples
    --------
    >>> barrel(0.5), barrel(1.0)
    (1.0, 0.0)
    """
    return 1.0 - (2.0 * t - 1.0) ** 2


def course_shape(bottom_m, top_m, levels_m, outlines, *, inset_m=0.0, scale=1.0):
    """One course from the outlines of its sections, as surveyed.

    Parameters
    ----------
    levels_m : ndarray, shape (k,)
        Heights of the k outlines above the bottom of the first course.
    inset_m : optional
        Plate and paint to take off the radius (0 when surveyed inside); the difference between
        radial and normal thickness is its (r'/r)^2/2 part, 5e-4 of it at the flank of a narrow dent
        of 30 mm.
    scale : optional
        Of horizontal lengths, for the shell's temperature.
    """
    levels = (np.asarray(levels_m, dtype=float) - bottom_m) / (top_m - bottom_m)
    degree = _degree(levels)
    mix = height_basis(levels, gauss_levels(degree), degree)
    knots = np.unique(np.concatenate([outline.knots_rad % FULL_TURN for outline in outlines]))
    azimuth, weight = panels(np.append(knots, knots[0] + FULL_TURN), 4)
    bases = [outline.basis(azimuth) for outline in outlines]
    radii = np.array([b @ o.parameters for b, o in zip(bases, outlines, strict=True)])
    inside = scale * (mix @ radii - inset_m)
    sums = (inside * weight).sum(axis=1)
    products, girths = polar_products(inside, weight), 0.5 * scale * (sums[:, None] + sums[None, :])
    gradients = [0.5 * scale * (inside * weight) @ basis for basis in bases]
    seen = [
        barrel(level) + (weight @ basis) @ _barrel_beyond(outline) / FULL_TURN
        for level, basis, outline in zip(levels, bases, outlines, strict=True)
    ]
    by_common, by_own = _by_form(outlines, mix, inset_m, scale)
    return CourseShape(
        bottom_m=float(bottom_m),
        top_m=float(top_m),
        degree=degree,
        products_m2=products,
        girths_m=girths,
        by_scale_m2=2 * products + inset_m * girths,  # plates do not grow with a wrong scale
        by_parameters=np.concatenate(
            [_moved(part, gradient) for part, gradient in zip(mix.T, gradients, strict=True)],
            axis=2,
        ),
        by_form_m2=by_common,
        by_own_form_m2=by_own,
        barrel=mix @ seen,
    )


def _moved(part, moment):
    """(q, q, p) change of G_ij when one outline moves.

    part (q,) of that outline in the one at each level; moment (q, p): 1/2 integral of the inside
    outline at each level times each movement.
    """
    half = part[:, None, None] * moment
    return half + half.transpose(1, 0, 2)


def _barrel_beyond(outline):
    """(p,) what an outline shows of a unit barrel, over its height at the outline's own level."""
    there, own = (barrel((1 + zeta) / 2) for zeta in (outline.zeta, outline.level_zeta))
    return outline.from_radii @ (there - own)


def _by_form(outlines, mix, inset_m, scale):
    """(q, q, modes) effect of the unseen common form, and (q, q, 2 modes) of the course's own.

    On an even grid, for high modes lie between knots.
    """
    form = outlines[0].form
    count, modes = len(mix), 2 * (FORM_MODES - 1)
    common, own = np.zeros((count, count, modes)), np.zeros((count, count, 2 * modes))
    if not (form.level_m2 or form.rising_m2):
        return common, own
    azimuth, waves = _form_grid()
    bases = [outline.basis(azimuth) for outline in outlines]
    radii = np.array([b @ o.parameters for b, o in zip(bases, outlines, strict=True)])
    inside = 0.5 * FULL_TURN / FORM_GRID * scale**2 * (mix @ radii - inset_m)
    there = inside @ waves
    sd = np.sqrt([form.common_m2, form.own_m2, form.rising_m2])
    for outline, basis, part in zip(outlines, bases, mix.T, strict=True):
        level, rising = inside @ basis @ outline.shown_form() - np.stack(
            [there, outline.level_zeta * there]
        )
        common += _moved(part, sd[0] * level)
        own += _moved(part, np.hstack([sd[1] * level, sd[2] * rising]))
    return common, own


@cache
def _form_grid():
    azimuth = np.arange(FORM_GRID) * FULL_TURN / FORM_GRID
    return azimuth, unit_form(azimuth)


def _degree(levels):
    """The highest degree that the levels carry to the ends of the course without much noise."""
    for degree in range(min(len(np.unique(levels)) - 1, HIGHEST_DEGREE), 0, -1):
        at_ends = height_basis(levels, [0.0, 1.0], degree)
        if np.linalg.norm(at_ends, axis=1).max() <= MOST_AMPLIFICATION:
            return degree
    return 0


@cache
def gauss_levels(degree):
    """The degree + 1 Gauss levels of a course, as fractions of its height."""
    return panels([0.0, 1.0], degree + 1)[0]
