"""Scanned horizontal cylinder or sphere: the fitted shape and the wall about it."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.cylinders import FittedCylinder, lying_cylinder
from tankcal.geometry.primitives import fit_sphere
from tankcal.messages import message
from tankcal.pipeline.checks.cross_checks import refuse_misfit
from tankcal.pipeline.checks.survey import origin_of
from tankcal.pipeline.overruling.points import decisions_of, refuse_kept
from tankcal.pipeline.solids.scanned_wall import Fitted, agreeing, offsets, scanned_wall
from tankcal.sections import covariance_of
from tankcal.tank.budgets import Factor
from tankcal.tank.solids import SurveyedForm

FAR = 5.0  # standard deviations from the wall above which a point is rejected
MOST_ROUNDS = 30
KEPT_PART = 0.03  # largest distance of a kept point from the shape, as a share of the radius
# Largest distance of a wall point from the shape: a share of the radius, plus a length.
NEVER_PART, NEVER_M = 0.02, 0.01


@dataclass(frozen=True)
class Scan:
    """Solid fitted to the points of a wall.

    Attributes
    ----------
    names : tuple of str
        Inputs that the points determine: "diameter", and "tilt" for a horizontal cylinder.
    values : ndarray, shape (names,)
        Values of the surface as surveyed.
    factors : tuple of Factor
        Uncertainty of the values from the points (`body.Factor`).
    form : SurveyedForm
        Deviation of the wall from the solid, with the uncertainty of its volumes.
    accepted : ndarray of int, shape (m,)
        Indices of the accepted points.
    residuals_m : ndarray, shape (n,)
        Residuals of all points, outwards positive, m.
    noise_m : float
        Standard deviation of the residuals, m.
    fit : sphere or cylinder
    reach_m : (float, float)
        Range of the accepted points along the axis of a cylinder, m.
    foot_m : float or None
        Distance of the nearest accepted point from the bottom at the dip of a cylinder, m.
    """

    names: tuple[str, ...]
    values: np.ndarray
    factors: tuple[Factor, ...]
    form: SurveyedForm
    accepted: np.ndarray
    residuals_m: np.ndarray
    noise_m: float
    fit: object
    reach_m: tuple[float, float] = (-np.inf, np.inf)
    foot_m: float | None = None
    surveyed_as = "scan"

    def is_within(self, places_m):
        """Whether positions (n, 3) lie inside the wall and between the ends of the survey."""
        along = _along(self.fit, places_m)
        low, high = self.reach_m
        return (offsets(self.fit, places_m) < 0) & (along > low) & (along < high)


def fit_scan(job, dof=np.inf):
    """`Scan` of the points of a horizontal cylinder or a sphere.

    Repeated fits reject points over 5 robust standard deviations off, until the selection is
    stable. All points within 2 % of the radius plus 10 mm of that shape are then compared with the
    wall that the other points show (`scanned_wall.agreeing`). Points in a dent thus remain. Without
    snooping all points are used. A full covariance serves as weight and for propagation. Points
    kept by decision stay, and excluded points take no part.

    Parameters
    ----------
    job : Job
    dof : float
        Degrees of freedom of the covariance of the points, if supplied.

    Returns
    -------
    Scan

    Raises
    ------
    InputError
        If the points do not form such a solid.
    """
    decided = decisions_of(job)
    is_used, is_kept = decided >= 0, decided > 0
    for _ in range(MOST_ROUNDS):
        fit, names, values, by_shape, residuals = _fit_or_refuse(job, is_used)
        is_near = (
            (_near(residuals, is_used) | is_kept) & (decided >= 0) if job.snooping else is_used
        )
        if np.array_equal(is_near, is_used):
            break
        is_used = is_near
    # Before points in groups can define a wall of their own.
    _refuse_scatter(job, fit, values, residuals[is_used])
    if job.snooping:
        is_candidate = is_used | (np.abs(residuals) <= NEVER_PART * fit.radius_m + NEVER_M)
        is_candidate &= decided >= 0
        covariance_of_points = partial(_covariance, job.points)
        is_used = agreeing(job, fit, is_candidate, covariance_of_points, FAR, is_kept)
        fit, names, values, by_shape, residuals = _fit_or_refuse(job, is_used)
    refuse_kept(job, residuals, KEPT_PART * fit.radius_m)
    index = np.flatnonzero(is_used)
    noise = _refuse_scatter(job, fit, values, residuals[is_used])
    fitted = Fitted(fit, names, values, by_shape)
    wall = scanned_wall(job, fitted, index, _covariance(job.points, index), dof)
    return Scan(
        names,
        wall.values,
        wall.factors,
        wall.form,
        index,
        residuals,
        noise,
        fit,
        _reach(fit, job.points.xyz_m[is_used]),
        wall.foot_m,
    )


def _refuse_scatter(job, fit, values, residuals):
    """Standard deviation of the accepted points about the shape, m; InputError if excessive."""
    noise = float(np.sqrt(residuals @ residuals / max(fit.dof, 1)))
    refuse_misfit(job.points, noise, float(values[0]))
    return noise


def _along(fit, xyz_m):
    """Positions (n,) along the axis of a cylinder, m; 0 for a sphere."""
    if isinstance(fit, FittedCylinder):
        return (xyz_m - fit.point_m) @ fit.direction
    return np.zeros(len(xyz_m))


def _reach(fit, xyz_m):
    """Smallest and largest position along a cylinder, m; infinite for a sphere."""
    if not isinstance(fit, FittedCylinder):
        return -np.inf, np.inf
    along = _along(fit, xyz_m)
    return float(along.min()), float(along.max())


def _fit_or_refuse(job, is_used):
    """`_fitted`, with InputError in place of SolutionError."""
    try:
        return _fitted(job, is_used)
    except SolutionError as error:
        problem = Problem(
            origin_of(job.points),
            message("no_wall", "no wall was found in the points: {error}", error=error.args[0]),
        )
        raise InputError(problem) from error


def _near(residuals, is_used):
    """Mask of the points within `FAR` robust standard deviations of the shape."""
    robust_sd = SD_OVER_MEDIAN * np.median(np.abs(residuals[is_used]))
    return np.abs(residuals) <= FAR * max(robust_sd, 1e-6)


def _covariance(points, index):
    """Covariance of points (m,): variances (3m,) or a positive definite matrix (3m, 3m)."""
    if points.covariance_m2 is not None:
        return covariance_of(index, points.covariance_m2)
    if points.sd_m is None:
        return np.ones(3 * len(index))
    return points.sd_m[index].ravel() ** 2


def _fitted(job, is_used):
    """Fit, names, values, their derivatives by the unknowns, and residuals of all points."""
    covariance, xyz = _covariance(job.points, np.flatnonzero(is_used)), job.points.xyz_m
    if job.sphere is not None:
        ball = fit_sphere(xyz[is_used], covariance)
        by_shape = np.array([[0.0, 0.0, 0.0, 2.0]])
        return ball, ("diameter",), [2 * ball.radius_m], by_shape, offsets(ball, xyz)
    lying = lying_cylinder(xyz[is_used], covariance, job.horizontal.azimuth_rad)
    fit, values = lying.cylinder, [lying.diameter_m, lying.tilt]
    return fit, ("diameter", "tilt"), values, lying.by_cylinder, offsets(fit, xyz)
