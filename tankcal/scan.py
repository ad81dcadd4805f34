"""A scanned lying cylinder or sphere: diameter and tilt from its points, without dents."""

from dataclasses import dataclass

import numpy as np

from tankcal.cylinders import lying_cylinder
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.primitives import fit_sphere
from tankcal.uncertainty import factor_of

FAR = 5.0  # robust standard deviations: a point further off is not of the wall
MOST_ROUNDS = 30
SCALE_OF_MEDIAN = 1.4826  # standard deviation over median absolute deviation, normal noise


@dataclass(frozen=True)
class Scan:
    """What the points of a wall say of a solid.

    names        of the inputs that they give: "diameter", and "tilt" of a lying cylinder
    values       (len(names),) of the surface as surveyed
    factor       (len(names), c) factor of their covariance; dof of the points' noise
    accepted     (m,) indices of the points that were used
    residuals_m  (n,) of all points, outwards positive; noise_m their standard deviation
    """

    names: tuple[str, ...]
    values: np.ndarray
    factor: np.ndarray
    dof: float
    accepted: np.ndarray
    residuals_m: np.ndarray
    noise_m: float


def scanned(job):
    """`Scan` of the points of a lying cylinder or a sphere; points far off are left out.

    Rounds of fit and test: a point over 5 robust standard deviations off is not used, until
    nothing changes. Without snooping every point is used.
    Raises InputError when the points make no such solid.
    """
    points = job.points
    variances = np.ones(points.xyz_m.size) if points.sd_m is None else points.sd_m.ravel() ** 2
    if points.covariance_m2 is not None:
        variances = points.covariance_m2.diagonal()
    given = points.sd_m is not None or points.covariance_m2 is not None
    scaled = not given or job.scale == "a_posteriori"
    chosen = np.ones(len(points.names), dtype=bool)
    for _ in range(MOST_ROUNDS):
        try:
            fit, names, values, cofactor, residuals = _fitted(job, variances, chosen)
        except SolutionError as error:
            raise InputError(Problem("points.csv", f"the points make no wall: {error}")) from error
        now = _near(residuals, chosen) if job.snooping else chosen
        if np.array_equal(now, chosen):
            break
        chosen = now
    variance_factor = fit.variance_factor if scaled else 1.0
    used = residuals[chosen]
    return Scan(
        names,
        values,
        factor_of(cofactor * variance_factor),
        float(fit.dof) if scaled else np.inf,
        np.flatnonzero(chosen),
        residuals,
        float(np.sqrt(used @ used / max(fit.dof, 1))),
    )


def _near(residuals, chosen):
    spread = SCALE_OF_MEDIAN * np.median(np.abs(residuals[chosen]))
    return np.abs(residuals) <= FAR * max(spread, 1e-6)


def _fitted(job, variances, chosen):
    """Fit, names, values, their cofactor matrix, and the residuals of all points."""
    xyz = job.points.xyz_m
    own = variances.reshape(-1, 3)[chosen].ravel()
    if job.sphere is not None:
        ball = fit_sphere(xyz[chosen], own)
        residuals = np.linalg.norm(xyz - ball.centre_m, axis=1) - ball.radius_m
        return ball, ("diameter",), [2 * ball.radius_m], 4 * ball.cofactor_m2[3:, 3:], residuals
    lying = lying_cylinder(xyz[chosen], own, job.horizontal.azimuth_rad)
    fit = lying.cylinder
    across = (xyz - fit.point_m) @ fit.tangents.T
    residuals = np.hypot(*across.T) - fit.radius_m
    values = [lying.diameter_m, lying.tilt]
    return fit, ("diameter", "tilt"), values, lying.cofactor, residuals
