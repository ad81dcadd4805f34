"""A scanned lying cylinder or sphere: diameter and tilt from its points, without dents."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.cylinders import FittedCylinder, lying_cylinder
from tankcal.geometry.primitives import fit_sphere
from tankcal.messages import message
from tankcal.pipeline.cross_checks import refuse_misfit
from tankcal.pipeline.survey_warnings import noise_is_estimated, origin_of
from tankcal.sections import covariance_of
from tankcal.tank.body import Factor, survey_factors

FAR = 5.0  # robust standard deviations: a point further off is not of the wall
MOST_ROUNDS = 30
SCALE_OF_MEDIAN = 1.4826  # standard deviation over median absolute deviation, normal noise


@dataclass(frozen=True)
class Scan:
    """What the points of a wall say of a solid.

    names        of the inputs that they give: "diameter", and "tilt" of a lying cylinder
    values       (len(names),) of the surface as surveyed
    factors      what the points leave uncertain about them (`body.Factor`)
    accepted     (m,) indices of the points that were used
    residuals_m  (n,) of all points, outwards positive; noise_m their standard deviation
    fit          the sphere or cylinder; reach_m of the used points along the cylinder's axis
    """

    names: tuple[str, ...]
    values: np.ndarray
    factors: tuple[Factor, ...]
    accepted: np.ndarray
    residuals_m: np.ndarray
    noise_m: float
    fit: object
    reach_m: tuple[float, float] = (-np.inf, np.inf)

    def is_within(self, places_m):
        """(n,) whether places lie within the wall, and between the ends of what was surveyed."""
        along = _along(self.fit, places_m)
        low, high = self.reach_m
        return (_offsets(self.fit, places_m) < 0) & (along > low) & (along < high)


def fit_scan(job, dof=np.inf):
    """`Scan` of the points of a lying cylinder or a sphere; points far off are left out.

    Rounds of fit and test: a point over 5 robust standard deviations off is not used, until
    nothing changes. Without snooping every point is used. dof: degrees of freedom of the points'
    covariance, where it was given. A full covariance is the fit's weight and its propagation.
    Raises InputError when the points make no such solid.
    """
    chosen = np.ones(len(job.points.names), dtype=bool)
    for _ in range(MOST_ROUNDS):
        fit, names, values, cofactor, residuals = _told(job, job.points.xyz_m, chosen)
        now = _near(residuals, chosen) if job.snooping else chosen
        if np.array_equal(now, chosen):
            break
        chosen = now
    factor = 1.0
    if noise_is_estimated(job):
        factor, dof = fit.variance_factor, float(fit.dof)
    causes = job.points.causes
    effects = [_effect(job, chosen, cause.column_m) for cause in causes]
    used = residuals[chosen]
    noise = float(np.sqrt(used @ used / max(fit.dof, 1)))
    refuse_misfit(job.points, noise, float(values[0]))
    return Scan(
        names,
        values,
        survey_factors(cofactor * factor, dof, causes, effects),
        np.flatnonzero(chosen),
        residuals,
        noise,
        fit,
        _reach(fit, job.points.xyz_m[chosen]),
    )


def _offsets(fit, xyz_m):
    """(n,) distance of points to a fitted sphere or cylinder, outwards positive."""
    if isinstance(fit, FittedCylinder):
        return np.hypot(*((xyz_m - fit.point_m) @ fit.tangents.T).T) - fit.radius_m
    return np.linalg.norm(xyz_m - fit.centre_m, axis=1) - fit.radius_m


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


def _effect(job, chosen, column_m):
    """Change of the values when all points move by a column: half the difference of two fits."""
    moved = column_m.reshape(-1, 3)
    there, back = (
        np.array(_told(job, job.points.xyz_m + way * moved, chosen)[2]) for way in (1, -1)
    )
    return (there - back) / 2


def _told(job, xyz_m, chosen):
    try:
        return _fitted(job, xyz_m, chosen)
    except SolutionError as error:
        problem = Problem(
            origin_of(job.points),
            message("no_wall", "no wall was found in the points: {error}", error=error.args[0]),
        )
        raise InputError(problem) from error


def _near(residuals, chosen):
    spread = SCALE_OF_MEDIAN * np.median(np.abs(residuals[chosen]))
    return np.abs(residuals) <= FAR * max(spread, 1e-6)


def _covariance(points, chosen):
    """Of the chosen points: (3m,) variances, or (3m, 3m) and positive definite."""
    if points.covariance_m2 is not None:
        return covariance_of(np.flatnonzero(chosen), points.covariance_m2)
    if points.sd_m is None:
        return np.ones(3 * chosen.sum())
    return points.sd_m[chosen].ravel() ** 2


def _fitted(job, xyz, chosen):
    """Fit, names, values, their cofactor matrix, and the residuals of all points."""
    own = _covariance(job.points, chosen)
    if job.sphere is not None:
        ball = fit_sphere(xyz[chosen], own)
        cofactor = 4 * ball.cofactor_m2[3:, 3:]
        return ball, ("diameter",), [2 * ball.radius_m], cofactor, _offsets(ball, xyz)
    lying = lying_cylinder(xyz[chosen], own, job.horizontal.azimuth_rad)
    fit = lying.cylinder
    values = [lying.diameter_m, lying.tilt]
    return fit, ("diameter", "tilt"), values, lying.cofactor, _offsets(fit, xyz)
