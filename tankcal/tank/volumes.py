"""Volume of a shell of courses from its outlines, with the full covariance of the rows.

The volume of a course is integrated from its outlines at its Gauss levels. With their areas A_i,

    A(t) = sum l_i(t) A_i,      V(h) = sum over courses of A_i integral l_i dz,

so each row is a weighted sum of a few areas, which also propagates their covariance. No
interpolation crosses a joint. Heights count from the bottom of the first course, m.

Shape of a course
-----------------

Between the Gauss levels t_i, the area of the horizontal cut is the polynomial through the areas at
these levels, A(t) = sum l_i(t) A_i. The volume below a height is the integral of A. Both are exact
for a course whose radius is a cubic in height.
"""

from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
import scipy

from tankcal.errors import HeightError, SolutionError
from tankcal.geometry.field.estimate import LEVELS, gauss_heights
from tankcal.messages import message
from tankcal.quadrature import height_polynomials, panels
from tankcal.tank.parts import Part, as_levels
from tankcal.uncertainty import Source
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


@dataclass(frozen=True)
class ShellVolume:
    """Courses of a shell, and integrals over them.

    The features of a shell are the areas at the Gauss levels of all its courses, in order.

    Attributes
    ----------
    courses : tuple of CourseShape
        Courses from the bottom up.
    """

    courses: tuple[CourseShape, ...]

    @property
    def height_m(self):
        """Height of the shell along the vertical."""
        return self.courses[-1].top_m

    @property
    def joints_m(self):
        """Bottoms (courses - 1,) of all courses except the first."""
        return np.array([course.bottom_m for course in self.courses[1:]])

    @property
    def joint_steps_m2(self):
        """Area just below each joint less the area just above it, shape (courses - 1,)."""
        polynomials = self._course_polynomials(self.features)
        return np.array([below.sum() - above[0] for below, above in pairwise(polynomials)])

    @property
    def departures(self):
        """Names of the declared departures of the courses: "barrel", "taper"."""
        return tuple(self.courses[0].missed)

    @cached_property
    def features(self):
        """Areas (f,) of which every volume is a weighted sum, m2."""
        return np.concatenate([course.areas_m2 for course in self.courses])

    @property
    def top_weights(self):
        """Derivative (f,) of the area at the top by the features."""
        weights = np.zeros(len(self.features))
        # At t = 1 all powers are one: the weight of a level is the sum of its coefficients.
        weights[-LEVELS:] = _height_polynomials().sum(axis=0)
        return weights

    @cached_property
    def girth_features(self):
        """Loss (f,) of the features per metre of inset, m."""
        return np.concatenate([course.girths_m for course in self.courses])

    @cached_property
    def scale_features(self):
        """Derivative (f,) of the features by a scale of the surveyed lengths, m2."""
        return np.concatenate([course.by_scale_m2 for course in self.courses])

    def integrated(self, heights_m, features):
        """Return weighted sums of features for the volume below each height.

        Parameters
        ----------
        heights_m : array_like, shape (rows,)
        features : array_like, shape (f,) or (f, c)
            Each column replaces the areas of all courses.

        Returns
        -------
        ndarray, shape (rows,) or (rows, c)
            m times the unit of the features; the rows of a column are contiguous.

        Raises
        ------
        HeightError
            For a height outside the shell.

        Notes
        -----
        A row requires only the polynomial of its own course, and a running sum of the courses
        below.
        """
        heights = self._inside(heights_m)
        columns = np.asarray(features, dtype=float).reshape(len(features), -1)
        result = np.empty((columns.shape[1], len(heights)))
        below = np.zeros(columns.shape[1])
        divisors = np.arange(1.0, LEVELS + 1)[:, None]
        for course, rows, polynomial in self._rows_by_course(heights, columns):
            # Primitive of sum a_k t^k: height times a_k / (k + 1), above the sum of the courses
            # below.
            primitive = np.concatenate([below[None], course.height_m * polynomial / divisors])
            t = (heights[rows] - course.bottom_m) / course.height_m
            result[:, rows] = primitive.T @ _powers(t)
            below = primitive.sum(axis=0)
        return result.T if np.ndim(features) == 2 else result[0]

    def weights_m(self, heights_m):
        """Return derivatives (rows, f) of the volume below each height by the features, m.

        Raises HeightError for a height outside the shell.
        """
        return self.integrated(heights_m, np.eye(len(self.features)))

    def volume_m3(self, heights_m):
        """Return the volume (rows,) between the bottom and each height."""
        return self.integrated(heights_m, self.features)

    def area_m2(self, heights_m):
        """Return the inside area (rows,) at each height; at a joint, of the upper course."""
        heights = self._inside(heights_m)
        area = np.empty(len(heights))
        for course, rows, polynomial in self._rows_by_course(heights, self.features):
            t = (heights[rows] - course.bottom_m) / course.height_m
            area[rows] = np.polynomial.polynomial.polyval(t, polynomial)
        return area

    def inset_m2(self, heights_m):
        """Return the loss (rows,) of volume per metre of plate or paint: the wetted wall."""
        return self.integrated(heights_m, self.girth_features)

    def by_missed_m2(self, heights_m, name, *, each=False):
        """Return the derivative of the volume below each height by an undeclared departure.

        Parameters
        ----------
        heights_m : array_like, shape (rows,)
        name : str
            "barrel" or "taper"; the estimate lacks `CourseShape.missed` of it.
        each : bool, optional
            False: (rows,) by a common departure of all courses; True: (rows, courses) by that of
            each course.

        Notes
        -----
        A single ring in the middle of each course does not determine a barrel: b zeta^2 is missing
        in the radius, and -1/3 of b in the volume of a course.
        """
        missed = self.missed_features(name)
        if not each:
            return self.integrated(heights_m, missed)
        by_course = np.kron(np.eye(len(self.courses)), np.ones((LEVELS, 1)))
        return self.integrated(heights_m, by_course * missed[:, None])

    def missed_features(self, name):
        """Return derivatives (f,) of the features by an undeclared departure of all courses."""
        return np.concatenate([course.girths_m * course.missed[name] for course in self.courses])

    def by_course_heights_m2(self, heights_m):
        """Return derivatives (rows, courses) of the volume below each height by the course heights.

        A higher course raises every joint above it, which replaces the area above the joint by the
        area below it. The outlines stay at their surveyed heights.
        """
        joints_below = np.searchsorted(self.joints_m, self._inside(heights_m))
        # A course raises all joints above it that are below the height.
        steps = np.concatenate([[0.0], np.cumsum(self.joint_steps_m2)])
        return np.take(np.tril(steps[:, None] - steps).T, joints_below, axis=1).T

    @property
    def barrels_m(self):
        """Barrel (courses,) of the mean radius: that of its least-squares parabola in height."""
        zeta, weights = panels([-1.0, 1.0], LEVELS)
        parabola = 1.5 * zeta**2 - 0.5
        radii = [np.sqrt(course.areas_m2 / np.pi) for course in self.courses]
        return np.array([-1.5 * 2.5 * np.sum(weights * parabola * radius) for radius in radii])

    def _course_polynomials(self, features):
        """Return, for each course, coefficients of sum l_i(t) features_i by powers of t."""
        return [
            _height_polynomials() @ features[start : start + LEVELS]
            for start in range(0, len(features), LEVELS)
        ]

    def _rows_by_course(self, heights, features):
        """Return (course, its rows, polynomial) for each course.

        The rows are those whose height is in the course, at a joint in the upper course; a slice if
        all heights ascend.
        """
        if np.all(heights[1:] >= heights[:-1]):
            ends = [0, *np.searchsorted(heights, self.joints_m), len(heights)]
            rows = [slice(start, end) for start, end in pairwise(ends)]
        else:
            place = np.searchsorted(self.joints_m, heights, side="right")
            rows = [place == index for index in range(len(self.courses))]
        return zip(self.courses, rows, self._course_polynomials(features), strict=True)

    def _inside(self, heights_m):
        """Return heights (rows,) as an array; raise HeightError outside the shell."""
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


def _powers(t):
    """Return powers (LEVELS + 1, rows) of t from the 0th on."""
    powers = np.empty((LEVELS + 1, len(t)))
    powers[0], powers[1] = 1.0, t
    for power in range(2, LEVELS + 1):
        np.multiply(powers[power - 1], t, out=powers[power])
    return powers


@cache
def _height_polynomials():
    """Return coefficients (LEVELS, LEVELS) of l_i(t) of the Gauss levels, by powers of t."""
    return height_polynomials(gauss_levels(), LEVELS - 1)


# ---- lowest zone of a tank measured with liquid, and the contribution of other parts above it


@dataclass(frozen=True)
class MeasuredBottom(Part):
    """Lowest zone of a tank, measured with liquid; it replaces all parts in that zone.

    All other parts count only above `highest_m` (`PartAbove`). The measured volumes already contain
    shell, deadwood and head of that zone, and their uncertainty replaces that of these parts.

    levels_m    (n,) ascending
    volumes_m3  (n,) capacity below each level
    errors_m3   (n, n) factor of their covariance
    curve       (rows,) -> volume, monotone and smooth through the volumes
    """

    levels_m: np.ndarray
    volumes_m3: np.ndarray
    errors_m3: np.ndarray
    curve: "scipy.interpolate.PchipInterpolator"
    kind, moves_with_zero = "bottom", True

    @property
    def lowest_m(self):
        """Lowest measured level, or the highest level at which the tank is empty."""
        empty = self.levels_m[self.volumes_m3 == 0]
        return float(empty[-1] if len(empty) else self.levels_m[0])

    @property
    def highest_m(self):
        """Level above which the other parts count."""
        return float(self.levels_m[-1])

    @property
    def breakpoints_m(self):
        """Lower and upper limit of the zone."""
        return (self.lowest_m, self.highest_m)

    def volume_m3(self, levels_m):
        """Return the measured capacity (rows,), constant above `highest_m`.

        Interpolation between dips is by monotone cubics (Fritsch & Carlson 1980). Raises
        HeightError below the lowest dip, unless the tank is empty there.
        """
        return self.curve(self._limit_levels(levels_m))

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level; 0 from `highest_m` up."""
        inside = (as_levels(levels_m) >= self.levels_m[0]) & (as_levels(levels_m) < self.highest_m)
        return np.where(inside, self.curve(self._limit_levels(levels_m), 1), 0.0)

    def derivatives(self, levels_m):
        """Return no derivatives: volumes refer to dips, wherever the zero of the table is."""
        return {}

    def sources(self, levels_m):
        """Return the errors of the measured volumes, and of the curve between dips.

        Errors are linear between dips. The half-width of the curve is its distance from straight
        lines, with a rectangular distribution. Above `highest_m`, all rows share the error of the
        last volume.
        """
        levels = self._limit_levels(levels_m)
        errors = [np.interp(levels, self.levels_m, column) for column in self.errors_m3.T]
        # Distance of the curve from straight lines between the measured volumes.
        bend = self.curve(levels) - np.interp(levels, self.levels_m, self.volumes_m3)
        return (
            Source("bottom_liquid", np.column_stack(errors)),
            Source("bottom_curve", bend[:, None] / np.sqrt(3), distribution="rectangular"),
        )

    def _limit_levels(self, levels_m):
        """Return the levels limited to the zone."""
        levels, lowest = as_levels(levels_m), self.levels_m[0]
        if self.volumes_m3[0] > 0 and not np.all(levels >= lowest):
            raise HeightError(
                message(
                    "level_below_measured",
                    "level {level_m:g} m is below the lowest level measured by liquid "
                    "({lowest_m:g} m, {volume_m3:g} m3)",
                    level_m=levels.min(),
                    lowest_m=lowest,
                    volume_m3=self.volumes_m3[0],
                )
            )
        return np.clip(levels, lowest, self.highest_m)


def measured_bottom(levels_m, volumes_m3, u_m3=None):
    """Return a bottom measured with liquid.

    Where u increases from one dip to the next, the increase is the independent error of the added
    volume. Where u does not increase, both dips have a common error. The uncertainty of a delivery
    within the zone is thus that of the metered volume.

    Parameters
    ----------
    levels_m : array_like, shape (n,)
        Ascending dips, two or more, m.
    volumes_m3 : array_like, shape (n,)
        Cumulative volume below each dip, m3.
    u_m3 : array_like, shape (n,), optional
        Standard uncertainty of each volume, m3; None: exact.

    Returns
    -------
    MeasuredBottom

    Raises
    ------
    SolutionError
        With the number of the row, if levels do not rise, volumes fall, or a volume or uncertainty
        is negative.

    Examples
    --------
    >>> bottom = measured_bottom([0.0, 0.1, 0.2], [0.0, 5.0, 10.0], [0.0, 0.03, 0.05])
    >>> float(bottom.volume_m3([0.1])[0])
    5.0
    >>> bottom.errors_m3.round(3).tolist()
    [[0.0, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.03, 0.04]]
    """
    levels, volumes = np.asarray(levels_m, dtype=float), np.asarray(volumes_m3, dtype=float)
    u = np.zeros(len(levels)) if u_m3 is None else np.asarray(u_m3, dtype=float)
    if len(levels) < 2:
        raise SolutionError(
            message(
                "too_few_measured_volumes",
                "{count} volumes measured by liquid; expected two or more",
                count=len(levels),
            )
        )
    finite = np.isfinite(levels) & np.isfinite(volumes) & np.isfinite(u)
    is_ascending = np.append(True, (np.diff(levels) > 0) & (np.diff(volumes) >= 0))
    wrong = np.flatnonzero(~(finite & is_ascending & (volumes >= 0) & (u >= 0)))
    if len(wrong):
        row = wrong[0]
        raise SolutionError(
            message(
                "measured_volume_wrong",
                "volume {number} measured by liquid: level {level_m:g} m, {volume_m3:g} m3, u "
                "{u_m3:g} m3; expected rising levels, volumes that do not fall, none negative",
                number=row + 1,
                level_m=levels[row],
                volume_m3=volumes[row],
                u_m3=u[row],
            )
        )
    errors = np.zeros((len(u), len(u)))
    for row in range(len(u)):
        previous_u = u[row - 1] if row else 0.0
        common = min(1.0, u[row] / previous_u) if previous_u > 0 else 0.0
        # Row of the Cholesky factor: the common part of the previous row, plus an independent part.
        errors[row] = common * errors[row - 1]
        errors[row, row] = np.sqrt(max(u[row] ** 2 - (common * previous_u) ** 2, 0.0))
    return MeasuredBottom(
        levels, volumes, errors, scipy.interpolate.PchipInterpolator(levels, volumes)
    )


@dataclass(frozen=True)
class PartAbove(Part):
    """Another part of the tank above a level: P(L) - P(level) for L above the level, else 0.

    Its derivatives and sources are reduced likewise, so that errors of the replaced zone cancel.

    Attributes
    ----------
    part : Part
        Original part.
    level_m : float
        Level above which the part counts, m.
    """

    part: Part
    level_m: float

    @property
    def kind(self):
        """Kind of the part."""
        return self.part.kind

    @property
    def moves_with_zero(self):
        """As for the part."""
        return self.part.moves_with_zero

    @property
    def breakpoints_m(self):
        """Breakpoints of the part."""
        return self.part.breakpoints_m

    def volume_m3(self, levels_m):
        """Return the contribution (rows,) above the level."""
        volume = self.part.volume_m3(self._and_own(levels_m))
        # The last element is the volume at `level_m`, appended by `_and_own`.
        return volume[:-1] - volume[-1]

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level."""
        levels = as_levels(levels_m)
        area = self.part.area_m2(np.maximum(levels, self.level_m))
        return np.where(levels >= self.level_m, area, 0.0)

    def derivatives(self, levels_m):
        """Return {input: (rows,)} of the part, less the derivative at `level_m`."""
        levels = self._and_own(levels_m)
        derivatives_of_part = self.part.derivatives(levels)
        return {name: column[:-1] - column[-1] for name, column in derivatives_of_part.items()}

    def sources(self, levels_m):
        """Return the sources of the part, less their columns at `level_m`."""
        return tuple(
            replace(source, columns_m3=source.columns_m3[:-1] - source.columns_m3[-1])
            for source in self.part.sources(self._and_own(levels_m))
        )

    def area_by(self, derivatives, levels_m):
        """Return `area_m2`, which differs from "datum", since the level moves with the zero."""
        return self.area_m2(levels_m)

    def moved_m3(self, levels_m, step_m, lowest_m, highest_m):
        """Return the volume of the part, less that at `level_m`, which moves with the zero.

        Parameters
        ----------
        levels_m, step_m, lowest_m, highest_m
            As for `Part.moved_m3`.

        Returns
        -------
        ndarray, shape (rows,)
        """
        if self.moves_with_zero:
            return self.volume_m3(levels_m)
        # The lower limit moves with the zero as well, so both ends are moved.
        upper = np.maximum(levels_m, self.level_m)
        lower = np.full(len(levels_m), self.level_m)
        above, below = (
            self.part.moved_m3(ends, step_m, lowest_m, highest_m) for ends in (upper, lower)
        )
        return above - below

    def _and_own(self, levels_m):
        """Return the levels, at least `level_m`, followed by `level_m`."""
        return np.append(np.maximum(as_levels(levels_m), self.level_m), self.level_m)
