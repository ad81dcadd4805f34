"""A scanned lying cylinder or sphere: the shape that its points have, and the wall about it."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.cylinders import FittedCylinder, lying_cylinder
from tankcal.geometry.primitives import fit_sphere
from tankcal.messages import message
from tankcal.pipeline.cross_checks import refuse_misfit
from tankcal.pipeline.overruled_points import decisions_of, refuse_kept
from tankcal.pipeline.scanned_wall import SCALE_OF_MEDIAN, Fitted, agreeing, offsets, scanned_wall
from tankcal.pipeline.survey_warnings import origin_of
from tankcal.sections import covariance_of
from tankcal.tank.factors import Factor
from tankcal.tank.surveyed_form import SurveyedForm

FAR = 5.0  # standard deviations: a point further off is not of the wall
MOST_ROUNDS = 30
KEPT_PART = 0.03  # of the radius: farther off no point can be kept
NEVER_PART, NEVER_M = 0.02, 0.01  # of the radius, and more: no point further off is of the wall


@dataclass(frozen=True)
class Scan:
    """What the points of a wall say of a solid.

    names        of the inputs that they give: "diameter", and "tilt" of a lying cylinder
    values       (len(names),) of the surface as surveyed
    factors      what the points leave uncertain about them (`body.Factor`)
    form         how the wall departs from that solid, with what is uncertain of its volumes
    accepted     (m,) indices of the points that were used
    residuals_m  (n,) of all points, outwards positive; noise_m their standard deviation
    fit          the sphere or cylinder; reach_m of the used points along the cylinder's axis
    foot_m       distance of the nearest used point from where the dip meets the bottom of a
                 cylinder
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
        """(n,) whether places lie within the wall, and between the ends of what was surveyed."""
        along = _along(self.fit, places_m)
        low, high = self.reach_m
        return (offsets(self.fit, places_m) < 0) & (along > low) & (along < high)


def fit_scan(job, dof=np.inf):
    """`Scan` of the points of a lying cylinder or a sphere; points far off are left out.

    Rounds of fit and test leave out points over 5 robust standard deviations off, until nothing
    changes. Of what is within 2 % of the radius and 10 mm of that shape, all points are then held
    against the wall that the others show (`scanned_wall.agreeing`), so a dent stays in. Without
    snooping every point is used. dof: degrees of freedom of the points' covariance, where it was
    given. A full covariance is the fit's weight and its propagation. Points that somebody decided
    to keep stay, and those to leave out take no part. Raises InputError when the points make no
    such solid.
    """
    decided = decisions_of(job)
    chosen, kept = decided >= 0, decided > 0
    for _ in range(MOST_ROUNDS):
        fit, names, values, by_shape, residuals = _told(job, chosen)
        now = (_near(residuals, chosen) | kept) & (decided >= 0) if job.snooping else chosen
        if np.array_equal(now, chosen):
            break
        chosen = now
    _refuse_scatter(job, fit, values, residuals[chosen])  # before neighbours make up their own wall
    if job.snooping:
        may_be = chosen | (np.abs(residuals) <= NEVER_PART * fit.radius_m + NEVER_M)
        may_be &= decided >= 0
        own = partial(_covariance, job.points)
        chosen = agreeing(job, fit, may_be, own, FAR, kept)
        fit, names, values, by_shape, residuals = _told(job, chosen)
    refuse_kept(job, residuals, KEPT_PART * fit.radius_m)
    index = np.flatnonzero(chosen)
    noise = _refuse_scatter(job, fit, values, residuals[chosen])
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
        _reach(fit, job.points.xyz_m[chosen]),
        wall.foot_m,
    )


def _refuse_scatter(job, fit, values, used):
    """Standard deviation of the used points about the shape; refused where it is no wall's."""
    noise = float(np.sqrt(used @ used / max(fit.dof, 1)))
    refuse_misfit(job.points, noise, float(values[0]))
    return noise


def _along(fit, xyz_m):
    """(n,) places along the axis of a cylinder, m; 0 for a sphere."""
    if isinstance(fit, FittedCylinder):
        return (xyz_m - fit.point_m) @ fit.direction
    return np.zeros(len(xyz_m))


def _reach(fit, xyz_m):
    """Least and greatest place along a cylinder; without end for a sphere."""
    if not isinstance(fit, FittedCylinder):
        return -np.inf, np.inf
    along = _along(fit, xyz_m)
    return float(along.min()), float(along.max())


def _told(job, chosen):
    try:
        return _fitted(job, chosen)
    except SolutionError as error:
        problem = Problem(
            origin_of(job.points),
            message("no_wall", "no wall was found in the points: {error}", error=error.args[0]),
        )
        raise InputError(problem) from error


def _near(residuals, chosen):
    spread = SCALE_OF_MEDIAN * np.median(np.abs(residuals[chosen]))
    return np.abs(residuals) <= FAR * max(spread, 1e-6)


def _covariance(points, index):
    """Of points (m,): (3m,) variances, or (3m, 3m) and positive definite."""
    if points.covariance_m2 is not None:
        return covariance_of(index, points.covariance_m2)
    if points.sd_m is None:
        return np.ones(3 * len(index))
    return points.sd_m[index].ravel() ** 2


def _fitted(job, chosen):
    """Fit, names, values, their derivative by its unknowns, and the residuals of all points."""
    own, xyz = _covariance(job.points, np.flatnonzero(chosen)), job.points.xyz_m
    if job.sphere is not None:
        ball = fit_sphere(xyz[chosen], own)
        by_shape = np.array([[0.0, 0.0, 0.0, 2.0]])
        return ball, ("diameter",), [2 * ball.radius_m], by_shape, offsets(ball, xyz)
    lying = lying_cylinder(xyz[chosen], own, job.horizontal.azimuth_rad)
    fit, values = lying.cylinder, [lying.diameter_m, lying.tilt]
    return fit, ("diameter", "tilt"), values, lying.by_cylinder, offsets(fit, xyz)
