"""Estimates of the offsets and scales that the readings of a wall share, and their correlation
with the mean radius.

A cause z with prior standard deviation 1 moves the readings y by c z. V is the full covariance of
the readings, which includes the cause. P is the precision after elimination of the parameters
without a prior. A is the derivative of the mean radius by the readings. Then

    z = c' P y,   variance 1 - c' P c,   covariance with the radius -A c.

A cause without a prior is one of the unknowns of the field.

A single set-up in the middle of a tank cannot separate the offset from the radius: their
correlation is -1.

Source: Koch 1999, section 3.2.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.geometry.field.blunders import restricted_precision
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.estimate import LEVELS
from tankcal.geometry.field.sites import free_design
from tankcal.quadrature import panels
from tankcal.sections import coordinates_of

IN_SI = {"mm": 1e-3, "ppm": 1e-6}


@dataclass(frozen=True)
class ToldCause:
    """A cause that readings share, before and after the adjustment of the wall.

    Lengths are in m; a scale is relative.

    Attributes
    ----------
    name, what : str
        Name of the instrument, and "instrument_offset" or "instrument_scale".
    u_before : float
        Standard uncertainty before the adjustment; inf: no prior information.
    value : float
        Estimate, beyond the correction already applied.
    u_after : float
        Standard uncertainty after the adjustment.
    correlation : float
        Correlation with the mean radius of the tank.
    """

    name: str
    what: str
    u_before: float
    value: float
    u_after: float
    correlation: float


def told_causes(job, wall):
    """Return a `ToldCause` for each instrument offset and scale that the points of a wall share.

    Parameters
    ----------
    job : Job
    wall : Wall

    Returns
    -------
    tuple of ToldCause
        Causes with a prior first, then causes without a prior.
    """
    kinds = ("instrument_offset", "instrument_scale")
    bound = [cause for cause in job.points.causes if cause.what in kinds]
    unbound = [cause for cause in job.points.unbound if cause.what in kinds]
    if not bound and not unbound:
        return ()
    # The mean radius of all courses is a linear function of the readings: weight of the levels
    # times the weights of the readings at each level.
    field, weight = wall.field, _mean_radius_weights(wall.field)
    along = weight @ field.means.weights
    precision = None
    estimates, noise = [], noise_of_wall(wall)
    u_radius = np.sqrt(along @ noise @ along + _unseen_variance(field, weight))
    # P eliminates the radii of the courses; subtracting the mean first only limits rounding.
    deviations = field.radius_m - field.radius_m.mean()
    coordinates = coordinates_of(wall.accepted)
    for cause in bound:
        if precision is None:
            # The field holds its own noise; replace it by the noise of the readings of this wall.
            covariance_m2 = field.covariance_m2 + noise - field.noise_m2
            precision = restricted_precision(covariance_m2, free_design(field.sites)[0])
        u = cause.u * IN_SI[cause.unit]
        # Effect of distances too long by one u.
        column = -(wall.radii_by_points @ cause.column_m[coordinates])
        # Posterior variance of the cause; rounding must not make it zero or negative.
        variance = max(1 - column @ precision @ column, 1e-12)
        shift, u_after = u * (column @ precision @ deviations), u * np.sqrt(variance)
        # The covariance with the radius is -A c.
        correlation = -(along @ column) / np.sqrt(variance) / u_radius
        estimates.append(
            ToldCause(
                cause.name,
                cause.what,
                u,
                float(shift),
                float(u_after),
                _limit_correlation(correlation),
            )
        )
    if unbound and field.sites.shared is not None:  # unbound causes are the first shared unknowns
        values, shared_covariance = field.shared
        covariance_with_radius = weight @ field.means.with_free[:, -len(values) :]
        for number, cause in enumerate(unbound):
            u_after = float(np.sqrt(shared_covariance[number, number]))
            correlation = -covariance_with_radius[number] / u_after / u_radius
            value = -float(values[number])
            estimates.append(
                ToldCause(
                    cause.name, cause.what, np.inf, value, u_after, _limit_correlation(correlation)
                )
            )
    return tuple(estimates)


def _limit_correlation(correlation):
    """Correlation limited to [-1, 1] against rounding."""
    return float(np.clip(correlation, -1, 1))


def noise_of_wall(wall):
    """Return the covariance of the noise of the readings of a wall, shape (n, n), m2.

    A field of points alone has only the covariance of each section; the wall has the full
    covariance.
    """
    return wall.points_m2 if wall.read is None else wall.field.noise_m2


def _mean_radius_weights(field):
    """Derivative (f,) of the mean radius of all courses by the radii at each course and level."""
    courses = len(field.outlines_m)
    return np.tile(panels([0.0, 1.0], LEVELS)[1], courses) / courses


def _unseen_variance(field, weight):
    """Variance of the mean radius due to the parts of the wall without readings, m2."""
    return sum(weight @ field.means.unseen(i) @ weight for i in range(len(COMPONENTS)))
