"""Heads of upright tanks beyond their edge: cones, dishes, ellipsoids and torispheres.

A head is a solid of revolution about a plumb axis; x counts from the plane of its edge to its tip,
at x = h. What lies beyond a level plane at x and its derivatives by a size s, x held, are

    V(x) = pi integral from x to h of r^2 dx,    dV/ds = pi integral of d(r^2)/ds dx,

in closed form, or by Gauss along the arcs of the meridian, which is exact to rounding there.
Over an outline that is no circle the head is that over a circle of the same area, drawn out to the
outline along each radius: areas and volumes depend on the plan's area alone.
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.arcs import EllipseArc, revolved
from tankcal.tank.heads import RADII, End, depth_of, meridian

FORMS = {
    "cone": "conical",
    "dish": "spherical",
    "ellipsoidal": "ellipsoidal",
    "torispherical": "torispherical",
}


@dataclass(frozen=True)
class Tip:
    """A head over a plan; make one with `tip_of`.

    Attributes
    ----------
    form : str
        One of FORMS.
    end : End
        Its sizes.
    plan_m2 : float
        Area of its edge.
    depth_m : float
        From the edge to the tip, above 0.
    """

    form: str
    end: End
    plan_m2: float
    depth_m: float

    def beyond_m3(self, x_m):
        """(rows,) volume beyond each x, 0 to depth_m: a cone holds A s^3 / (3 h^2), s = h - x."""
        s, h, plan = self.depth_m - x_m, self.depth_m, self.plan_m2
        if self.form == "cone":
            return plan * s**3 / (3 * h**2)
        if self.form == "dish":
            return np.pi * s**2 * (self._sphere_m - s / 3)
        if self.form == "ellipsoidal":
            return plan * s**2 * (1 / h - s / (3 * h**2))
        return self._revolved(x_m, _square)

    def area_m2(self, x_m):
        """(rows,) area of the cut at each x."""
        s, h = self.depth_m - x_m, self.depth_m
        if self.form == "cone":
            return self.plan_m2 * (s / h) ** 2
        if self.form == "dish":
            return np.pi * s * (2 * self._sphere_m - s)
        if self.form == "ellipsoidal":
            return self.plan_m2 * s * (2 * h - s) / h**2
        return self._cut_m2(x_m)

    def derivatives(self, x_m):
        """{input: (rows,)} of `beyond_m3` at fixed x, m3 per SI unit, other given sizes held.

        "scale" stretches the plan; "depth" moves the tip away from the edge, and stretches a
        torispherical head of given radii; "dish", "knuckle" where they were given.
        """
        s, h, plan = self.depth_m - x_m, self.depth_m, self.plan_m2
        if self.form == "cone":
            by_depth = plan * (s**2 / h**2 - 2 * s**3 / (3 * h**3))
            return {"scale": 2 * self.beyond_m3(x_m), "depth": by_depth}
        if self.form == "dish":
            sphere = self._sphere_m
            by_depth = np.pi * s * (2 * sphere - s) + np.pi * s**2 * (1 - sphere / h)
            return {"scale": plan / h * s**2, "depth": by_depth}
        if self.form == "ellipsoidal":
            by_depth = plan * s * (2 / h - s / h**2 - s / h**2 + 2 * s**2 / (3 * h**3))
            return {"scale": 2 * self.beyond_m3(x_m), "depth": by_depth}
        names = {"radius": "scale", "end_depth": "depth"} | dict(zip(RADII, RADII, strict=True))
        known = {name for arc in self._arcs for name in arc.by_input}
        found = {
            said: self._revolved(x_m, partial(_square_by, name=name))
            for name, said in names.items()
            if name in known
        }
        return found | {"scale": self._radius_m * found["scale"]}

    @property
    def sizes_m(self):
        """{input: size} of those that it is given by, but for the plan."""
        end = self.end
        given = dict(zip(RADII, (end.dish_radius_m, end.knuckle_radius_m), strict=True))
        return {"depth": end.depth_m, **{name: one for name, one in given.items() if one}}

    @property
    def _radius_m(self):
        return np.sqrt(self.plan_m2 / np.pi)

    @property
    def _sphere_m(self):
        return (self.plan_m2 / np.pi / self.depth_m + self.depth_m) / 2

    @cached_property
    def _arcs(self):
        return meridian(self.end, self._radius_m)

    def _revolved(self, x_m, integrand):
        rows = np.atleast_1d(np.asarray(x_m, dtype=float))
        parts = [revolved(arc, _parameter(arc, rows), [integrand])[0] for arc in self._arcs]
        return sum(parts).reshape(np.shape(x_m))

    def _cut_m2(self, x_m):
        of_arcs = [np.pi * arc.at(_parameter(arc, x_m))[1] ** 2 for arc in self._arcs]
        joint = self._arcs[0].at(self._arcs[0].stop)[0]
        return np.where(x_m < joint, *of_arcs)


def tip_of(form, plan_m2, depth_m=0.0, dish_radius_m=None, knuckle_radius_m=None):
    """A head of an upright tank, by its depth; a torispherical one by two of its three sizes.

    Parameters
    ----------
    form : str
        "cone", "dish", "ellipsoidal" or "torispherical".
    plan_m2 : float
        Area of its edge.
    depth_m : float, optional
        From the edge to the tip, m; 0 where radii give it.
    dish_radius_m, knuckle_radius_m : float, optional

    Returns
    -------
    Tip

    Raises
    ------
    SolutionError
        For sizes that make no such head.

    Examples
    --------
    A cone as deep as its edge is wide, over 3 m2:

    >>> float(tip_of("cone", 3.0, 2.0).beyond_m3(0.0))
    2.0
    """
    if form == "dish" and depth_m > np.sqrt(plan_m2 / np.pi):
        raise SolutionError(
            message(
                "dish_too_deep",
                "a dish {depth_m:g} m deep is more than half a sphere",
                depth_m=depth_m,
            )
        )
    end = End(FORMS[form], float(depth_m), dish_radius_m, knuckle_radius_m)
    follows = depth_of(end, np.sqrt(plan_m2 / np.pi))
    return Tip(form, end, float(plan_m2), float(depth_m) or follows)


def _square(arc, u):
    return np.pi * arc.at(u)[1] ** 2


def _square_by(arc, u, name):
    return np.pi * arc.square_by(name, u)


def _parameter(arc: EllipseArc, x_m):
    """Angle of an arc at x, within the arc."""
    sin = np.clip((x_m - arc.centre_m) / arc.along_m, -1.0, 1.0)
    return np.clip(np.arcsin(sin), arc.start, arc.stop)
