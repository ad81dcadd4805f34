"""Heads of upright tanks beyond their edge: cones, dishes, ellipsoids and torispheres.

A head is a solid of revolution about a plumb axis; x counts from the plane of its edge to its tip,
at x = h. The volume beyond a level plane at x, and its derivative by a dimension s at fixed x, are

    V(x) = pi integral from x to h of r^2 dx,    dV/ds = pi integral of d(r^2)/ds dx,

in closed form, or by Gaussian quadrature along the arcs of the meridian, which is exact to
rounding. For an outline that is not a circle, the head over a circle of equal area is stretched to
the outline along each radius: areas and volumes depend only on the area of the plan.
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
    """Head over a plan; see `tip_of`.

    Attributes
    ----------
    form : str
        One of FORMS.
    end : End
        Dimensions of the head.
    plan_m2 : float
        Area of the edge.
    depth_m : float
        Depth from the edge to the tip, above 0.
    """

    form: str
    end: End
    plan_m2: float
    depth_m: float

    def beyond_m3(self, x_m):
        """Return the volume (rows,) beyond each x, 0 to depth_m.

        A cone contains A s^3 / (3 h^2), s = h - x.
        """
        s, h, plan = self.depth_m - x_m, self.depth_m, self.plan_m2
        if self.form == "cone":
            return plan * s**3 / (3 * h**2)
        if self.form == "dish":
            return np.pi * s**2 * (self._sphere_m - s / 3)
        if self.form == "ellipsoidal":
            return plan * s**2 * (1 / h - s / (3 * h**2))
        return self._integrate_revolution(x_m, _square)

    def area_m2(self, x_m):
        """Return the area (rows,) of the cut at each x."""
        s, h = self.depth_m - x_m, self.depth_m
        if self.form == "cone":
            return self.plan_m2 * (s / h) ** 2
        if self.form == "dish":
            return np.pi * s * (2 * self._sphere_m - s)
        if self.form == "ellipsoidal":
            return self.plan_m2 * s * (2 * h - s) / h**2
        return self._cut_m2(x_m)

    def derivatives(self, x_m):
        """Return {input: derivative (rows,) of `beyond_m3` at fixed x}, m3 per SI unit.

        Other given dimensions are fixed. "scale" stretches the plan. "depth" moves the tip away
        from the edge, and stretches a torispherical head of given radii. "dish" and "knuckle" are
        present if given.
        """
        s, h, plan = self.depth_m - x_m, self.depth_m, self.plan_m2
        if self.form == "cone":
            # At a fixed x, s = h - x grows with h: both terms of the derivative appear.
            by_depth = plan * (s**2 / h**2 - 2 * s**3 / (3 * h**3))
            return {"scale": 2 * self.beyond_m3(x_m), "depth": by_depth}
        if self.form == "dish":
            sphere = self._sphere_m
            # The radius of the sphere, (R^2 / h + h) / 2, changes by 1 - sphere / h.
            by_depth = np.pi * s * (2 * sphere - s) + np.pi * s**2 * (1 - sphere / h)
            return {"scale": plan / h * s**2, "depth": by_depth}
        if self.form == "ellipsoidal":
            by_depth = plan * s * (2 / h - s / h**2 - s / h**2 + 2 * s**2 / (3 * h**3))
            return {"scale": 2 * self.beyond_m3(x_m), "depth": by_depth}
        # The arcs are differentiated by the radius; the scale multiplies the radius.
        names = {"radius": "scale", "end_depth": "depth"} | dict(zip(RADII, RADII, strict=True))
        available = {name for arc in self._arcs for name in arc.by_input}
        derivatives = {
            input_name: self._integrate_revolution(x_m, partial(_square_by, name=name))
            for name, input_name in names.items()
            if name in available
        }
        return derivatives | {"scale": self._radius_m * derivatives["scale"]}

    @property
    def sizes_m(self):
        """{input: dimension} of the given dimensions, without the plan."""
        end = self.end
        radii = dict(zip(RADII, (end.dish_radius_m, end.knuckle_radius_m), strict=True))
        return {"depth": end.depth_m, **{name: size for name, size in radii.items() if size}}

    @property
    def _radius_m(self):
        """Radius of the circle of equal area."""
        return np.sqrt(self.plan_m2 / np.pi)

    @property
    def _sphere_m(self):
        """Radius of the sphere of a dish."""
        return (self.plan_m2 / np.pi / self.depth_m + self.depth_m) / 2

    @cached_property
    def _arcs(self):
        return meridian(self.end, self._radius_m)

    def _integrate_revolution(self, x_m, integrand):
        """Return integrals over the head beyond x, shape of x_m."""
        rows = np.atleast_1d(np.asarray(x_m, dtype=float))
        parts = [revolved(arc, _parameter(arc, rows), [integrand])[0] for arc in self._arcs]
        return sum(parts).reshape(np.shape(x_m))

    def _cut_m2(self, x_m):
        """Return the area of the cut at each x, of the knuckle or of the dish."""
        areas = [np.pi * arc.at(_parameter(arc, x_m))[1] ** 2 for arc in self._arcs]
        joint = self._arcs[0].at(self._arcs[0].stop)[0]
        # The knuckle extends from the edge to the joint, the dish from there to the tip.
        return np.where(x_m < joint, *areas)


def tip_of(form, plan_m2, depth_m=0.0, dish_radius_m=None, knuckle_radius_m=None):
    """Return a head of an upright tank from its depth.

    A torispherical head requires two of its three dimensions.

    Parameters
    ----------
    form : str
        "cone", "dish", "ellipsoidal" or "torispherical".
    plan_m2 : float
        Area of the edge.
    depth_m : float, optional
        Depth from the edge to the tip, m; 0 if radii determine it.
    dish_radius_m, knuckle_radius_m : float, optional

    Returns
    -------
    Tip

    Raises
    ------
    SolutionError
        For impossible dimensions of such a head.

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
    computed_depth = depth_of(end, np.sqrt(plan_m2 / np.pi))
    return Tip(form, end, float(plan_m2), float(depth_m) or computed_depth)


def _square(arc, u):
    """Return pi r^2 of an arc."""
    return np.pi * arc.at(u)[1] ** 2


def _square_by(arc, u, name):
    """Return the derivative of pi r^2 of an arc by an input."""
    return np.pi * arc.square_by(name, u)


def _parameter(arc: EllipseArc, x_m):
    """Return the angle of an arc at x, limited to the arc."""
    sin = np.clip((x_m - arc.centre_m) / arc.along_m, -1.0, 1.0)
    return np.clip(np.arcsin(sin), arc.start, arc.stop)
