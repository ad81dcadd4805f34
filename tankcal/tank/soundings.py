"""A bottom's surface through surveyed points, by kriging, and what is uncertain about it.

Heights are a trend 1, x, y, rho, rho^2 (a plate that leans, a cone, a dish), plus a form whose
covariance falls linearly with the distance, - b |p - q|, plus waves finer than the points; b and
the waves by restricted maximum likelihood. Triangles between the points, the other way, cut off a
cone (compared in tests/tank/test_soundings.py).
Sources: Matheron 1973 (intrinsic random functions); Cressie 1993, Statistics for Spatial Data, 3.4;
Patterson & Thompson 1971.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtr

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.terrain import Surface, surface
from tankcal.uncertainty import factor_of

MESH, COVARIANCE_MESH = (48, 144), (16, 48)  # rings, azimuths
FEWEST_POINTS, MOST_POINTS = 12, 500
BEYOND_WALL = 0.01  # of the radius: a point further out is not of this bottom
BANDS = 24  # of wet area, at whose edges the covariance is computed
TREND = 5  # functions
WORST_CONDITION = 1e3  # of the trend in units of the mean radius
LEAST_WAVES_M2 = 1e-8  # a tenth of a millimetre


@dataclass(frozen=True)
class SurveyedSurface:
    """A bottom predicted from surveyed points.

    surface          at the vertices of a polar mesh
    edges_m          (e,) ascending levels, the last above all of the surface
    noise_m3         (e, c) factor of the covariance of the volumes below the edges, by the points'
                     noise; form_m3 by the form between them, and what it hides below a level
    noise_dof, form_dof  their degrees of freedom
    form_m2_per_m    b: variance of a height difference is 2 b distance
    waves_sd_m       of waves finer than the points; with the noise when this is not given
    w                (n,) of each point: how far it lies off what the others predict, over its sd
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
    """The bottom through surveyed points, smoothed by what they can tell.

    xyz_m  (n, 3) x, y in the survey's frame, z above the bottom of the first course
    sd_m   (n,) or a number: standard deviations of z; None: noise and waves are estimated as one
    slope  (dx/dz, dy/dz) of the shell's axis
    Raises SolutionError for under 12 or over 500 points, a point outside the wall, and points that
    do not spread over the plan.
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
    plan = xyz[:, :2] - (footprint.x_m, footprint.y_m) - np.outer(xyz[:, 2], slope)
    _refuse_outside(footprint, plan)
    noise = np.zeros(n) if sd_m is None else np.broadcast_to(np.square(sd_m), (n,))
    kriging = _kriging(plan / size, xyz[:, 2], noise)
    found, predictor = _predicted(footprint, MESH, kriging, size, xyz[:, 2])
    edges = _edges(found)
    shown = found.wet_weights(edges) @ predictor
    waves = kriging.waves_m2 * shown @ shown.T
    form, hidden = _form(footprint, kriging, size, xyz[:, 2], edges)
    given = sd_m is not None
    return SurveyedSurface(
        surface=found,
        edges_m=edges,
        noise_m3=factor_of((shown * noise) @ shown.T if given else waves),
        form_m3=np.column_stack([factor_of(form + waves if given else form), hidden]),
        noise_dof=np.inf if given else float(n - TREND),
        form_dof=float(n - TREND),
        form_m2_per_m=float(kriging.form_m2 / size),
        waves_sd_m=float(np.sqrt(kriging.waves_m2)),
        w=kriging.left_out(xyz[:, 2]),
        by_points_m2=-shown,
    )


def _predicted(footprint, mesh, kriging, size, heights):
    """The surface over a mesh, and (v, n) the weights of the points' heights in it."""
    plan, faces = footprint.mesh(*mesh)
    predictor = kriging.predictor(plan / size)
    return surface(plan, faces, predictor @ heights), predictor


def _form(footprint, kriging, size, heights, edges):
    """(e, e) covariance of the volumes below the edges by the form, and (e,) what it hides.

    The covariance is that of wet @ (predicted - true). Both reproduce a constant, so the
    generalised covariance - distance can stand for one. Below a level there is more room on a
    rough surface than on the smooth one: E(L - z)+ > (L - E z)+; above the whole surface there is
    none.
    """
    found, predictor = _predicted(footprint, COVARIANCE_MESH, kriging, size, heights)
    grid, points = footprint.mesh(*COVARIANCE_MESH)[0] / size, kriging.points
    wet, to_points, between = (
        found.wet_weights(edges),
        _distances(grid, points),
        _distances(points, points),
    )
    shown = wet @ predictor
    crossed = wet @ to_points @ shown.T
    true = wet @ _distances(grid, grid) @ wet.T
    both = crossed + crossed.T - true - shown @ between @ shown.T
    own = 2 * np.sum(predictor * to_points, axis=1)
    own -= np.sum(predictor @ between * predictor, axis=1)
    sd = np.sqrt(np.maximum(kriging.form_m2 * own, 0) + kriging.waves_m2)
    off = np.abs(edges[:, None] - found.heights_m) / sd
    more = sd * (np.exp(-(off**2) / 2) / np.sqrt(2 * np.pi) - off * ndtr(-off))
    hidden = more @ found.wet_weights(found.highest_m)[0]
    hidden[-1] = 0.0
    return kriging.form_m2 * (both + both.T) / 2, hidden


def _refuse_outside(footprint, plan):
    azimuth, distance = np.arctan2(*plan.T), np.hypot(*plan.T)
    beyond = distance / footprint.radius_at(azimuth) - 1
    worst = int(np.argmax(beyond))
    if not beyond[worst] <= BEYOND_WALL:
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


def _edges(found):
    """Levels, closer where the tank begins to fill, that have (k / BANDS)^2 of the plan below."""
    order = np.argsort(found.heights_m[found.faces].mean(axis=1))
    filled = np.cumsum(found.areas_m2[order])
    wanted = filled[-1] * (np.arange(1, BANDS) / BANDS) ** 2
    middle = found.heights_m[found.faces].mean(axis=1)[order]
    return np.unique(np.append(np.interp(wanted, filled, middle), found.highest_m))


@dataclass(frozen=True)
class _Kriging:
    """Heights at points (n, 2) with form variance form_m2 and waves, in units of the mean radius.

    covariance  (n, n) of the heights, but for the trend
    contrasts   (n, n - TREND) combinations of heights that the trend does not touch
    """

    points: np.ndarray
    form_m2: float
    waves_m2: float
    covariance: np.ndarray
    contrasts: np.ndarray

    def predictor(self, grid):
        """(v, n) weights of the points' heights in the height at each vertex."""
        trend = _trend(self.points)
        system = np.block([[self.covariance, trend], [trend.T, np.zeros((TREND, TREND))]])
        right = np.hstack([-self.form_m2 * _distances(grid, self.points), _trend(grid)])
        return np.linalg.solve(system, right.T)[: len(trend)].T

    def left_out(self, heights):
        """(n,) each height less its prediction from all others, over its standard deviation."""
        inner = self.contrasts.T @ self.covariance @ self.contrasts
        weights = self.contrasts @ np.linalg.solve(inner, self.contrasts.T)
        return weights @ heights / np.sqrt(np.diag(weights))


def _kriging(points, heights, noise):
    """Form and waves by restricted maximum likelihood; raises SolutionError for a poor spread."""
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
    form = -contrasts.T @ _distances(points, points) @ contrasts
    measured = contrasts.T @ (noise[:, None] * contrasts)
    seen = contrasts.T @ heights

    def misfit(logs):
        """Doubled negative log-likelihood, but for a constant, and its gradient."""
        amplitude, waves = np.exp(logs)
        inner = amplitude * form + measured + (LEAST_WAVES_M2 + waves) * np.eye(len(seen))
        inverse = np.linalg.inv(inner)
        solved = inverse @ seen
        by_amplitude = np.sum(inverse * form) - solved @ form @ solved
        by_waves = np.trace(inverse) - solved @ solved
        value = np.linalg.slogdet(inner)[1] + seen @ solved
        return value, np.array([amplitude * by_amplitude, waves * by_waves])

    size = np.log(np.mean(seen**2) + LEAST_WAVES_M2)
    bounds = [(size - 20, size + 10), (np.log(LEAST_WAVES_M2) - 5, size + 5)]
    found = [
        scipy.optimize.minimize(
            misfit,
            [size, size + start],
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"ftol": 1e-14, "gtol": 1e-8},
        )
        for start in (-5, -1)
    ]
    amplitude, waves = np.exp(min(found, key=lambda one: one.fun).x)
    waves += LEAST_WAVES_M2
    covariance = np.diag(noise + waves) - amplitude * _distances(points, points)
    return _Kriging(points, float(amplitude), float(waves), covariance, contrasts)


def _distances(some, others):
    """Between each of some points and each of others; rows are the first."""
    return scipy.spatial.distance.cdist(some, others)


def _trend(points):
    rho = np.hypot(*points.T)
    return np.column_stack([np.ones(len(points)), points, rho, rho**2])
