"""What a wall says of the offsets and scales that its readings share: how it tells them apart.

A cause z of the prior standard deviation 1 moves the readings y by c z. With V their whole
covariance, the cause's own part in it, P the precision without what no prior binds, and A the
derivative of a mean radius by the readings,

    z = c' P y,   variance 1 - c' P c,   covariance with the radius -A c.

One that nothing binds is among the unknowns of the field.

One set-up in the middle of a tank cannot tell the offset from the radius: their correlation is -1.

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
    """A cause that readings share, before and after the wall; lengths in m, a scale relative.

    Attributes
    ----------
    name, what : str
        "TS", "instrument_offset" or "instrument_scale".
    u_before : float
        inf: nothing was known of it.
    value : float
        By how much more than was taken off it comes out.
    u_after : float
    correlation : float
        With the mean radius of the tank.
    """

    name: str
    what: str
    u_before: float
    value: float
    u_after: float
    correlation: float


def told_causes(job, wall):
    """`ToldCause` of each offset and scale of instruments that the points of a wall share.

    Parameters
    ----------
    job : Job
    wall : Wall
    """
    kinds = ("instrument_offset", "instrument_scale")
    bound = [one for one in job.points.causes if one.what in kinds]
    unbound = [one for one in job.points.unbound if one.what in kinds]
    if not bound and not unbound:
        return ()
    field, weight = wall.field, _of_mean_radius(wall.field)
    along = weight @ field.means.weights
    precision = None
    found, noise = [], noise_of_wall(wall)
    u_radius = np.sqrt(along @ noise @ along + _unseen(field, weight))
    left = field.radius_m - field.radius_m.mean()
    index = coordinates_of(wall.accepted)
    for one in bound:
        if precision is None:
            whole = field.covariance_m2 + noise - field.noise_m2
            precision = restricted_precision(whole, free_design(field.sites)[0])
        u = one.u * IN_SI[one.unit]
        column = -(wall.radii_by_points @ one.column_m[index])  # of readings too long by one u
        variance = max(1 - column @ precision @ column, 1e-12)
        shift, u_after = u * (column @ precision @ left), u * np.sqrt(variance)
        shared = -(along @ column) / np.sqrt(variance) / u_radius
        found.append(ToldCause(one.name, one.what, u, float(shift), float(u_after), _bound(shared)))
    if unbound and field.sites.shared is not None:  # they are the first of what is shared
        values, covariance = field.shared
        with_radius = weight @ field.means.with_free[:, -len(values) :]
        for place, one in enumerate(unbound):
            u_after = float(np.sqrt(covariance[place, place]))
            shared = -with_radius[place] / u_after / u_radius
            value = -float(values[place])
            found.append(ToldCause(one.name, one.what, np.inf, value, u_after, _bound(shared)))
    return tuple(found)


def _bound(correlation):
    return float(np.clip(correlation, -1, 1))


def noise_of_wall(wall):
    """(n, n) covariance of the readings; a field of points alone has it section by section."""
    return wall.points_m2 if wall.read is None else wall.field.noise_m2


def _of_mean_radius(field):
    """(f,) derivative of the mean radius of all courses by those of each course and level."""
    courses = len(field.outlines_m)
    return np.tile(panels([0.0, 1.0], LEVELS)[1], courses) / courses


def _unseen(field, weight):
    """Variance of that by what the readings did not see of the wall."""
    return sum(weight @ field.means.unseen(i) @ weight for i in range(len(COMPONENTS)))
