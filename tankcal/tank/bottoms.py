"""Bottom of a vertical tank: its surface over the plan, and the volume below a plane.

Surface of the bottom of a tank over the plan of the shell, and the volume above it.

Plan coordinates are those of the survey, shifted along the axis of the shell to the bottom of the
first course. This shear preserves volumes and makes a leaning shell upright. Heights count from
there, in metres; azimuths clockwise from +y.

Volume between the bottom of a vertical tank and the plane of the bottom of its first course.

Each part gives the volume on the bottom below a level, less the area times level that the shell
counts above that plane (level 0),

    V(L) = integral over the plan of (L - z)+ - L+,

so it is positive below the plane, and negative where the bottom is above the plane. A level L = z
counts as wet. Between the plane and the edge of the bottom, the wall may differ from the outline of
the plan. This difference is neglected, as the product of two small heights.

Surveyed bottom
---------------

Heights are a trend 1, x, y, rho, rho^2 (a leaning plate, a cone, a dish), plus a form whose
covariance decreases linearly with the distance, - b |p - q|, plus waves finer than the points. b
and the waves are estimated by restricted maximum likelihood. The alternative, triangles between the
points, cuts off a part of a cone (compared in tests/tank/test_soundings.py). Sources: Matheron 1973
(intrinsic random functions); Cressie 1993, Statistics for Spatial Data, 3.4; Patterson & Thompson
1971.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtr

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels
from tankcal.tank.tips import FORMS as TIPS
from tankcal.tank.tips import Tip, tip_of
from tankcal.uncertainty import Source, factor_of, type_of
from tankcal.units import FULL_TURN


@dataclass(frozen=True)
class Footprint:
    """Inside outline of the first course at its bottom.

    Attributes
    ----------
    x_m, y_m : float
        Centre, on the axis of the shell, m.
    radius_m : ndarray, shape (n,)
        Radii about the centre, at n evenly spaced azimuths from +y on, m.

    Examples
    --------
    >>> round(Footprint(0.0, 0.0, np.full(36, 2.0)).area_m2, 3)
    12.566
    """

    x_m: float
    y_m: float
    radius_m: np.ndarray

    @property
    def area_m2(self):
        """Area 1/2 integral of r^2: a mean over even azimuths, best for a smooth closed outline."""
        return float(np.pi * np.mean(self.radius_m**2))

    def radius_at(self, azimuth_rad):
        """Return the radius (len(azimuth),), linear between the azimuths."""
        azimuths = np.arange(len(self.radius_m)) * FULL_TURN / len(self.radius_m)
        return np.interp(azimuth_rad, azimuths, self.radius_m, period=FULL_TURN)

    def mesh(self, rings, azimuths):
        """Return plan coordinates (v, 2) about the centre and triangles (t, 3) of a polar mesh.

        The sides are straight, so the radii are scaled to the area of the footprint.
        """
        azimuth = np.arange(azimuths) * FULL_TURN / azimuths
        radius = self.radius_at(azimuth)
        sides = 0.5 * np.sin(FULL_TURN / azimuths) * radius @ np.roll(radius, 1)
        radius = radius * np.sqrt(self.area_m2 / sides)
        outline = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth)])
        parts = np.arange(1, rings + 1)[:, None, None] / rings
        plan = np.vstack([np.zeros((1, 2)), (parts * outline).reshape(-1, 2)])
        index, next_index = np.arange(azimuths), np.roll(np.arange(azimuths), -1)
        faces = [np.column_stack([np.zeros(azimuths, dtype=int), 1 + index, 1 + next_index])]
        for inner in 1 + azimuths * np.arange(rings - 1):
            outer = inner + azimuths
            faces.append(np.column_stack([inner + index, outer + index, outer + next_index]))
            faces.append(np.column_stack([inner + index, outer + next_index, inner + next_index]))
        return plan, np.vstack(faces)


@dataclass(frozen=True)
class Surface:
    """Surface of triangles over a plan, linear in each triangle; see `surface`.

    heights_m  (v,) heights of the vertices
    faces      (t, 3) corners of each triangle, the lowest first
    areas_m2   (t,) plan areas
    """

    heights_m: np.ndarray
    faces: np.ndarray
    areas_m2: np.ndarray

    @property
    def lowest_m(self):
        """Height of the lowest point."""
        return float(self.heights_m.min())

    @property
    def highest_m(self):
        """Height of the highest point."""
        return float(self.heights_m.max())

    def below(self, levels_m, fields):
        """Return integrals (rows, c) of fields over the plan up to levels of the surface.

        A place counts if the surface there is at or below the level. The integral is exact.

        fields  (v, c) values at the vertices, linear in each triangle
        """
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        fields = np.asarray(fields, dtype=float)
        by_top = np.argsort(self.heights_m[self.faces[:, 2]])
        tops = self.heights_m[self.faces[by_top, 2]]
        cumulative = (self.areas_m2[:, None] * fields[self.faces].mean(axis=1))[by_top]
        cumulative = np.vstack([np.zeros((1, fields.shape[1])), np.cumsum(cumulative, axis=0)])
        # Triangles completely below a level by a cumulative sum, triangles cut by the level one by
        # one.
        result = cumulative[np.searchsorted(tops, levels, side="right")]
        rows, faces, weights = self._cut(levels)
        for column, field in zip(result.T, fields.T, strict=True):
            part = np.einsum("pc,pc->p", weights, field[self.faces[faces]])
            column += np.bincount(rows, part, minlength=len(levels))
        return result

    def volume_and_area(self, levels_m):
        """Return the integral (rows,) of (level - z)+ over the plan, and the wet plan area."""
        area, moment = self.below(
            levels_m, np.column_stack([np.ones_like(self.heights_m), self.heights_m])
        ).T
        return np.atleast_1d(levels_m) * area - moment, area

    def wet_weights(self, levels_m):
        """Return derivatives (rows, v) of `volume_and_area` by lower vertices, m2."""
        levels, count = np.atleast_1d(levels_m), len(self.heights_m)
        rows, faces = np.nonzero(self.heights_m[self.faces[:, 2]] <= levels[:, None])
        whole_weights = np.broadcast_to(self.areas_m2[faces, None] / 3, (len(faces), 3))
        cut_rows, cut_faces, cut_weights = self._cut(levels)
        rows, faces = np.append(rows, cut_rows), np.append(faces, cut_faces)
        place = (rows[:, None] * count + self.faces[faces]).ravel()
        weights = np.vstack([whole_weights, cut_weights]).ravel()
        return np.bincount(place, weights, len(levels) * count).reshape(len(levels), count)

    def _cut(self, levels):
        """Return rows, faces and weights (pairs, 3) of the corners, for triangles cut by a level.

        The wet part is a corner of the triangle, or the whole less its dry corner. A corner
        triangle with the fractions p and q of two edges has the relative area p q and the means 1 -
        (p + q) / 3, p / 3, q / 3.
        """
        order = np.argsort(levels)
        low, middle, high = self.heights_m[self.faces].T
        first = np.searchsorted(levels[order], low, side="right")
        count = np.searchsorted(levels[order], high, side="left") - first
        count = np.maximum(count, 0)
        faces = np.repeat(np.arange(len(count)), count)
        # All pairs of a triangle and a level between its lowest and highest corner.
        offset = np.arange(len(faces)) - np.repeat(np.cumsum(count) - count, count)
        rows = order[first[faces] + offset]
        level, low, middle, high = levels[rows], low[faces], middle[faces], high[faces]
        wet = level <= middle  # only the lowest corner is wet
        p = np.where(wet, level - low, high - level) / (high - low)
        q = np.where(wet, level - low, high - level)
        q = q / np.where(wet, middle - low, high - middle)
        corner = p * q
        apex = corner * (1 - (p + q) / 3)
        far_corner, near_corner = corner * p / 3, corner * q / 3
        weights = np.where(
            wet[:, None],
            np.column_stack([apex, near_corner, far_corner]),
            1 / 3 - np.column_stack([far_corner, near_corner, apex]),
        )
        return rows, faces, weights * self.areas_m2[faces, None]


def surface(plan_m, faces, heights_m):
    """Return the `Surface` over a mesh.

    Parameters
    ----------
    plan_m : ndarray, shape (v, 2)
        Plan coordinates of the vertices, m.
    faces : ndarray of int, shape (t, 3)
    heights_m : array_like, shape (v,)
        Heights of the vertices, m.
    """
    heights = np.asarray(heights_m, dtype=float)
    a, b, c = np.moveaxis(plan_m[faces], 1, 0)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    order = np.argsort(heights[faces], axis=1, kind="stable")
    return Surface(heights, np.take_along_axis(faces, order, axis=1), np.abs(ux * vy - uy * vx) / 2)


MESH, COVARIANCE_MESH = (48, 144), (16, 48)  # rings and azimuths of the meshes
FEWEST_POINTS, MOST_POINTS = 12, 500  # least and largest number of surveyed points
BEYOND_WALL = 0.01  # points beyond the wall by more than 1 % of the radius are refused
BANDS = 24  # bands of wet area, at whose limits the covariance is computed
TREND = 5  # number of functions of the trend
WORST_CONDITION = 1e3  # largest condition number of the trend, in units of the mean radius
LEAST_WAVES_M2 = 1e-8  # lower bound of the variance of waves: a tenth of a millimetre
FORMS = ("flat", *TIPS)
LEAN_AZIMUTHS = 720  # number of triangles of a leaning plate


@dataclass(frozen=True)
class SurveyedSurface:
    """Bottom predicted from surveyed points.

    surface          surface over a polar mesh
    edges_m          (e,) ascending levels, the last above the whole surface
    noise_m3         (e, c) factor of the covariance of the volumes below the edges due to the noise
    form_m3          factor due to the form between the points, and to the volume it hides
    noise_dof, form_dof  degrees of freedom of the noise and of the form
    form_m2_per_m    b: variance of a height difference is 2 b distance
    waves_sd_m       standard deviation of waves finer than the points; including the noise if no
                     standard deviation is given
    w                (n,) difference of each point from the prediction by all others, over its sd
    by_points_m2     (e, n) derivative of the volumes below the edges by the heights of the points
    """

    surface: Surface
    edges_m: np.ndarray
    noise_m3: np.ndarray
    form_m3: np.ndarray
    noise_dof: float
    form_dof: float
    form_m2_per_m: float
    waves_sd_m: float
    w: np.ndarray
    by_points_m2: np.ndarray


def surveyed_surface(footprint, xyz_m, sd_m=None, slope=(0.0, 0.0)):
    """Return the bottom through surveyed points, smoothed according to their noise.

    Parameters
    ----------
    footprint : Footprint
        Outline of the first course at its bottom.
    xyz_m : ndarray, shape (n, 3)
        x, y in the frame of the survey, z above the bottom of the first course.
    sd_m : ndarray, shape (n,), or float, optional
        Standard deviations of z; None: noise and waves are estimated jointly.
    slope : array_like, shape (2,), optional
        (dx/dz, dy/dz) of the axis of the shell.

    Returns
    -------
    SurveyedSurface

    Raises
    ------
    SolutionError
        For fewer than 12 or more than 500 points, a point outside the wall, and points that are not
        spread over the plan.
    """
    xyz = np.asarray(xyz_m, dtype=float)
    n = len(xyz)
    if not FEWEST_POINTS <= n <= MOST_POINTS:
        raise SolutionError(
            message(
                "bottom_points_count",
                "{count} surveyed points of the bottom; expected {fewest} to {most}",
                count=n,
                fewest=FEWEST_POINTS,
                most=MOST_POINTS,
            )
        )
    if not np.all(np.isfinite(xyz)):
        raise SolutionError(
            message("bottom_point_not_finite", "a surveyed point of the bottom is not finite")
        )
    size = np.sqrt(footprint.area_m2 / np.pi)
    # Shift the points along the axis to the plane of the plan.
    plan = xyz[:, :2] - (footprint.x_m, footprint.y_m) - np.outer(xyz[:, 2], slope)
    _refuse_outside(footprint, plan)
    noise = np.zeros(n) if sd_m is None else np.broadcast_to(np.square(sd_m), (n,))
    kriging = _fit_kriging(plan / size, xyz[:, 2], noise)
    predicted, predictor = _predict_surface(footprint, MESH, kriging, size, xyz[:, 2])
    edges = _edges(predicted)
    # The volumes are linear in the heights of the mesh, which are linear in the points.
    by_points = predicted.wet_weights(edges) @ predictor
    waves = kriging.waves_m2 * by_points @ by_points.T
    form, hidden = _form(footprint, kriging, size, xyz[:, 2], edges)
    has_sd = sd_m is not None
    return SurveyedSurface(
        surface=predicted,
        edges_m=edges,
        noise_m3=factor_of((by_points * noise) @ by_points.T if has_sd else waves),
        form_m3=np.column_stack([factor_of(form + waves if has_sd else form), hidden]),
        noise_dof=np.inf if has_sd else float(n - TREND),
        form_dof=float(n - TREND),
        form_m2_per_m=float(kriging.form_m2 / size),
        waves_sd_m=float(np.sqrt(kriging.waves_m2)),
        w=kriging.left_out(xyz[:, 2]),
        by_points_m2=-by_points,
    )


def _predict_surface(footprint, mesh, kriging, size, heights):
    """Return the surface over a mesh, and the weights (v, n) of the heights of the points."""
    plan, faces = footprint.mesh(*mesh)
    predictor = kriging.predictor(plan / size)
    return surface(plan, faces, predictor @ heights), predictor


def _form(footprint, kriging, size, heights, edges):
    """Return the covariance (e, e) of the volumes below edges due to the form, and its bias (e,).

    The covariance is that of wet @ (predicted - true). Both surfaces reproduce a constant, so the
    generalised covariance - distance may replace a covariance. Below a level, a rough surface
    leaves more room than a smooth surface: E(L - z)+ > (L - E z)+. Above the whole surface, the
    difference is zero.
    """
    predicted, predictor = _predict_surface(footprint, COVARIANCE_MESH, kriging, size, heights)
    grid, points = footprint.mesh(*COVARIANCE_MESH)[0] / size, kriging.points
    wet, to_points, among_points = (
        predicted.wet_weights(edges),
        _distances(grid, points),
        _distances(points, points),
    )
    by_points = wet @ predictor
    cross_covariance = wet @ to_points @ by_points.T
    true_covariance = wet @ _distances(grid, grid) @ wet.T
    combined = (
        cross_covariance
        + cross_covariance.T
        - true_covariance
        - by_points @ among_points @ by_points.T
    )
    variance = 2 * np.sum(predictor * to_points, axis=1)
    variance -= np.sum(predictor @ among_points * predictor, axis=1)
    # Prediction error of the height at each vertex.
    sd = np.sqrt(np.maximum(kriging.form_m2 * variance, 0) + kriging.waves_m2)
    difference = np.abs(edges[:, None] - predicted.heights_m) / sd
    # E(L - z)+ - (L - E z)+ for a normal z: sd (phi(d) - d Phi(-d)).
    excess = sd * (
        np.exp(-(difference**2) / 2) / np.sqrt(2 * np.pi) - difference * ndtr(-difference)
    )
    hidden = excess @ predicted.wet_weights(predicted.highest_m)[0]
    hidden[-1] = 0.0
    return kriging.form_m2 * (combined + combined.T) / 2, hidden


def _refuse_outside(footprint, plan):
    """Raise SolutionError for a point outside the wall."""
    azimuth, distance = np.arctan2(*plan.T), np.hypot(*plan.T)
    excess = distance / footprint.radius_at(azimuth) - 1
    worst = int(np.argmax(excess))
    if not excess[worst] <= BEYOND_WALL:
        raise SolutionError(
            message(
                "bottom_point_off_wall",
                "point {point} of the bottom is {distance_m:.3f} m from the axis, "
                "outside the wall ({wall_m:.3f} m)",
                point=worst + 1,
                distance_m=distance[worst],
                wall_m=footprint.radius_at(azimuth[worst]),
            )
        )


def _edges(surface_of_points):
    """Return levels with (k / BANDS)^2 of the plan below them, closer near the bottom."""
    order = np.argsort(surface_of_points.heights_m[surface_of_points.faces].mean(axis=1))
    filled = np.cumsum(surface_of_points.areas_m2[order])
    target_areas = filled[-1] * (np.arange(1, BANDS) / BANDS) ** 2
    middle = surface_of_points.heights_m[surface_of_points.faces].mean(axis=1)[order]
    return np.unique(
        np.append(np.interp(target_areas, filled, middle), surface_of_points.highest_m)
    )


@dataclass(frozen=True)
class _Kriging:
    """Heights at points (n, 2) with variances of form and waves, in units of the mean radius.

    covariance  (n, n) of the heights, without the trend
    contrasts   (n, n - TREND) combinations of heights independent of the trend
    """

    points: np.ndarray
    form_m2: float
    waves_m2: float
    covariance: np.ndarray
    contrasts: np.ndarray

    def predictor(self, grid):
        """Return weights (v, n) of the heights of the points in the height at each vertex."""
        trend = _trend(self.points)
        # Universal kriging: Lagrange multipliers enforce unbiasedness for the trend.
        system = np.block([[self.covariance, trend], [trend.T, np.zeros((TREND, TREND))]])
        right_side = np.hstack([-self.form_m2 * _distances(grid, self.points), _trend(grid)])
        return np.linalg.solve(system, right_side.T)[: len(trend)].T

    def left_out(self, heights):
        """Return differences (n,) of heights from predictions by all others, over their sds."""
        inner = self.contrasts.T @ self.covariance @ self.contrasts
        weights = self.contrasts @ np.linalg.solve(inner, self.contrasts.T)
        return weights @ heights / np.sqrt(np.diag(weights))


def _fit_kriging(points, heights, noise):
    """Fit form and waves by REML; raise SolutionError for a poor spread of the points."""
    trend = _trend(points)
    if np.linalg.cond(trend) > WORST_CONDITION:
        raise SolutionError(
            message(
                "bottom_points_unspread",
                "the points of the bottom do not spread over its plan: expected some in "
                "the middle, some at the wall, some between, all around",
            )
        )
    contrasts = np.linalg.qr(trend, mode="complete")[0][:, TREND:]
    # Contrasts eliminate the trend: the generalised covariance becomes positive definite.
    form = -contrasts.T @ _distances(points, points) @ contrasts
    measured = contrasts.T @ (noise[:, None] * contrasts)
    observed = contrasts.T @ heights

    def misfit(logs):
        """Return minus twice the log-likelihood, up to a constant, and its gradient."""
        amplitude, waves = np.exp(logs)
        inner = amplitude * form + measured + (LEAST_WAVES_M2 + waves) * np.eye(len(observed))
        inverse = np.linalg.inv(inner)
        solved = inverse @ observed
        by_amplitude = np.sum(inverse * form) - solved @ form @ solved
        by_waves = np.trace(inverse) - solved @ solved
        value = np.linalg.slogdet(inner)[1] + observed @ solved
        return value, np.array([amplitude * by_amplitude, waves * by_waves])

    size = np.log(np.mean(observed**2) + LEAST_WAVES_M2)
    bounds = [(size - 20, size + 10), (np.log(LEAST_WAVES_M2) - 5, size + 5)]
    # Two starts guard against a local maximum.
    results = [
        scipy.optimize.minimize(
            misfit,
            [size, size + log_ratio],
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"ftol": 1e-14, "gtol": 1e-8},
        )
        for log_ratio in (-5, -1)
    ]
    amplitude, waves = np.exp(min(results, key=lambda result: result.fun).x)
    waves += LEAST_WAVES_M2
    covariance = np.diag(noise + waves) - amplitude * _distances(points, points)
    return _Kriging(points, float(amplitude), float(waves), covariance, contrasts)


def _distances(points, other_points):
    """Return the distances between points (rows) and other points (columns)."""
    return scipy.spatial.distance.cdist(points, other_points)


def _trend(points):
    """Return the functions (n, TREND) of the trend at points."""
    rho = np.hypot(*points.T)
    return np.column_stack([np.ones(len(points)), points, rho, rho**2])


@dataclass(frozen=True)
class ShapedBottom(Part):
    """Level plate, or head with a level edge at level 0, dished down or up; see `shaped_bottom`.

    Attributes
    ----------
    form : str
        One of FORMS.
    centre_m : float
        Level of the centre: positive for a bottom that bulges up, negative for one that bulges
        down.
    plan_m2 : float
        Inside area of the first course at its bottom.
    tip : Tip or None
        The head; None for a level plate.
    """

    form: str
    centre_m: float
    plan_m2: float
    tip: Tip | None = None
    kind = "bottom"

    @property
    def lowest_m(self):
        """Level of the empty tank."""
        return min(self.centre_m, 0.0)

    @property
    def breakpoints_m(self):
        """Level of the empty tank."""
        return (self.lowest_m,)

    def volume_m3(self, levels_m):
        """Return the volume (rows,) of the head below its edge, or minus that above it."""
        levels = as_levels(levels_m)
        return self._tip_contribution(levels, self.tip.beyond_m3) if self.tip else 0.0 * levels

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level."""
        return self._wet_m2(levels_m) - self.plan_m2 * (as_levels(levels_m) >= 0)

    def derivatives(self, levels_m):
        """Return {input: (rows,)} by "datum" (level), "bottom", "scale" and sizes, m3 per SI unit.

        "bottom" raises the whole bottom: minus its wet plan area. "scale" stretches the plan.
        "bottom_depth" moves the centre away from the edge. "dish_radius" and "knuckle_radius" are
        the dimensions of a torispherical head, if given.
        """
        levels = as_levels(levels_m)
        derivatives = {
            "datum": self.area_m2(levels),
            "bottom": -self._wet_m2(levels),
            "scale": 0.0 * levels,
        }
        if self.tip is None:
            return derivatives
        for name in self.tip.derivatives(0.0):
            input_name = "bottom_depth" if name == "depth" else name
            derivatives[input_name] = self._tip_contribution(
                levels, lambda x, name=name: self.tip.derivatives(x)[name]
            )
        return derivatives

    def _tip_contribution(self, levels, content_beyond):
        """Return the contribution of the head at levels, from its content beyond a plane."""
        # Bulging down: content beyond the level. Bulging up: minus the volume that the head
        # occupies.
        if self.centre_m <= 0:
            return content_beyond(np.clip(-levels, 0, self.tip.depth_m))
        return content_beyond(np.clip(levels, 0, self.tip.depth_m)) - content_beyond(0.0)

    def _wet_m2(self, levels_m):
        """Return the wet plan area (rows,) of the bottom."""
        levels = as_levels(levels_m)
        if self.tip is None:
            return self.plan_m2 * (levels >= 0)
        depth = self.tip.depth_m
        if self.centre_m < 0:
            return self.tip.area_m2(np.clip(-levels, 0, depth))
        return (self.plan_m2 - self.tip.area_m2(np.clip(levels, 0, depth))) * (levels >= 0)


def shaped_bottom(form, plan_m2, centre_m=0.0, dish_radius_m=None, knuckle_radius_m=None):
    """Return a flat bottom, or a head; a centre at level 0 makes it flat.

    Parameters
    ----------
    form : str
        One of FORMS.
    plan_m2 : float
        Inside area of the first course at its bottom.
    centre_m : float, optional
        Level of the centre: positive for a bottom that bulges up, negative for one that bulges
        down. 0 for a torispherical bottom of given radii, which bulges down.
    dish_radius_m, knuckle_radius_m : float, optional
        Radii of a torispherical bottom: one of them in addition to the centre, or both.

    Returns
    -------
    ShapedBottom

    Raises
    ------
    SolutionError
        For an unknown form, an impossible area, a flat bottom with a centre off the plane, and
        dimensions that are impossible for such a head (a dish deeper than a hemisphere).

    Examples
    --------
    A cone of 0.3 m below an area of 100 m2 contains a third of its prism:

    >>> round(float(shaped_bottom("cone", 100.0, -0.3).volume_m3([0.0])[0]), 9)
    10.0
    """
    if form not in FORMS:
        raise SolutionError(f'bottom "{form}"; expected one of {", ".join(FORMS)}')
    if not (np.isfinite(plan_m2) and plan_m2 > 0 and np.isfinite(centre_m)):
        raise SolutionError(
            message(
                "bottom_impossible",
                "bottom of {plan_m2:g} m2 with its centre at {centre_m:g} m; expected an "
                "area above 0 and a finite height",
                plan_m2=plan_m2,
                centre_m=centre_m,
            )
        )
    if form == "flat" and centre_m != 0:
        raise SolutionError(
            message(
                "flat_bottom_centre",
                "a flat bottom with its centre at {centre_m:g} m; expected 0",
                centre_m=centre_m,
            )
        )
    radii = (dish_radius_m, knuckle_radius_m)
    if centre_m == 0 and None in radii:
        return ShapedBottom("flat", 0.0, float(plan_m2))
    tip = tip_of(form, plan_m2, abs(centre_m), *radii)
    centre = float(centre_m) if centre_m else -tip.depth_m
    return ShapedBottom(form, centre, float(plan_m2), tip)


@dataclass(frozen=True)
class SurfaceBottom(Part):
    """Bottom given as a surface of triangles: a leaning plate, or surveyed points.

    Attributes
    ----------
    surface : Surface
        Surface over the plan (`terrain.Surface`).
    survey : SurveyedSurface or None
        `SurveyedSurface`; None for a plate of a given slope.
    shared : tuple of factors.Factor
        Common errors of the heights of the points: columns (n, c), m.
    has_own_height : bool
        Whether `shared` contains the complete uncertainty of the height of the bottom.
    """

    surface: Surface
    survey: SurveyedSurface | None = None
    shared: tuple = ()
    has_own_height: bool = False
    kind = "bottom"

    @property
    def lowest_m(self):
        """Level of the empty tank."""
        return self.surface.lowest_m

    @property
    def breakpoints_m(self):
        """Level of the empty tank."""
        return (self.lowest_m,)

    def volume_m3(self, levels_m):
        """Return the volume (rows,), exact for the surface of triangles."""
        volume, _ = self.surface.volume_and_area(as_levels(levels_m))
        return volume - self._plan_m2 * np.maximum(as_levels(levels_m), 0)

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level."""
        _, wet = self.surface.volume_and_area(as_levels(levels_m))
        return wet - self._plan_m2 * (as_levels(levels_m) >= 0)

    def derivatives(self, levels_m):
        """Return {input: (rows,)} by "datum" (level), "bottom" and "scale", m3 per SI unit.

        "bottom" raises the whole bottom: minus its wet plan area. "scale" stretches the plan; a
        leaning plate keeps its slope, surveyed points keep their heights.
        """
        levels = as_levels(levels_m)
        volume, wet = self.surface.volume_and_area(levels)
        # The plan area grows with the square of the scale; the heights are constant.
        by_scale = 2 * (volume - self._plan_m2 * np.maximum(levels, 0))
        if self.survey is None:
            by_scale += volume - levels * wet  # minus the integral of z over the wet plan
        return {
            "datum": wet - self._plan_m2 * (levels >= 0),
            "bottom": -wet,
            "scale": by_scale,
        }

    def sources(self, levels_m):
        """Return sources for the noise of the points and the form between them; none for a plate.

        The covariance is exact at the limits of 24 bands of wet area. Within a band, it grows in
        proportion to the wet area.
        """
        if self.survey is None:
            return ()
        edges = np.append(self.surface.lowest_m, self.survey.edges_m)
        _, at_edges = self.surface.volume_and_area(edges)
        at_edges[0] = 0.0
        _, wet = self.surface.volume_and_area(as_levels(levels_m))
        # Interpolation weights of the bands: the column of a band grows from 0 to 1 over its wet
        # area.
        share = np.column_stack([np.interp(wet, at_edges, unit) for unit in np.eye(len(edges))[1:]])
        by_points = share @ self.survey.by_points_m2
        return (
            Source(
                "bottom_points",
                share @ self.survey.noise_m3,
                self.survey.noise_dof,
                type=type_of(self.survey.noise_dof),
            ),
            Source(
                "bottom_form",
                share @ self.survey.form_m3,
                self.survey.form_dof,
                type=type_of(self.survey.form_dof),
            ),
            *(factor.source(by_points @ factor.columns) for factor in self.shared),
        )

    @property
    def _plan_m2(self):
        return self.surface.areas_m2.sum()


def leaning_bottom(footprint, slope):
    """Return a plate perpendicular to the axis of the shell, through level 0 at the axis.

    The plate is shifted along the axis to the plane of level 0. Its point at the distance x down
    the lean has the height z = - m x / (1 + m^2).

    Parameters
    ----------
    footprint : Footprint
        Outline of the first course at its bottom.
    slope : array_like, shape (2,)
        (dx/dz, dy/dz) of the axis.

    Returns
    -------
    SurfaceBottom
    """
    slope = np.asarray(slope, dtype=float)
    plan, faces = footprint.mesh(1, LEAN_AZIMUTHS)
    return SurfaceBottom(surface(plan, faces, -plan @ slope / (1 + slope @ slope)))


def surveyed_bottom(footprint, xyz_m, sd_m=None, slope=(0.0, 0.0), shared=None):
    """Return the bottom through surveyed points, smoothed according to their noise.

    Parameters
    ----------
    footprint : Footprint
        Outline of the first course at its bottom.
    xyz_m : ndarray, shape (n, 3)
        x, y in the frame of the survey, z above the bottom of the first course.
    sd_m : ndarray, shape (n,), or float, optional
        Standard deviations of z; None: noise and waves are estimated jointly.
    slope : array_like, shape (2,), optional
        (dx/dz, dy/dz) of the axis of the shell.
    shared : sequence of factors.Factor, optional
        Common errors of the heights, for each point; None: unknown.

    Returns
    -------
    SurfaceBottom

    Raises
    ------
    SolutionError
        As for `surveyed_surface`.
    """
    survey = surveyed_surface(footprint, xyz_m, sd_m, slope)
    return SurfaceBottom(survey.surface, survey, tuple(shared or ()), shared is not None)
