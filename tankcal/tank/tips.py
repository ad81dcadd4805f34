"""Heads of upright tanks beyond their edge, at the bottom or on top of the courses.

The forms are cones, dishes, ellipsoids and torispheres.

A head is a solid of revolution about a plumb axis; x counts from the plane of its edge to its tip,
at x = h. The volume beyond a level plane at x, and its derivative by a dimension s at fixed x, are

    V(x) = pi integral from x to h of r^2 dx,    dV/ds = pi integral of d(r^2)/ds dx,

in closed form, or by Gaussian quadrature along the arcs of the meridian, which is exact to
rounding. For an outline that is not a circle, the head over a circle of equal area is stretched to
the outline along each radius: areas and volumes depend only on the area of the plan.

Shell with a head on top
------------------------

The edge of the head is the top of the last course, and its plan is the area there. The uncertainty
of that area thus also affects the head: the volume of the head is a linear function of the features
of the shell. Liquid above the shell does not change the volume of the shell.
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from tankcal.errors import HeightError, SolutionError
from tankcal.messages import message
from tankcal.tank.body import ShellPart
from tankcal.tank.heads import RADII, EllipseArc, End, depth_of, meridian, revolved
from tankcal.tank.parts import Part, as_levels

FORMS = {
    "cone": "conical",
    "dish": "spherical",
    "ellipsoidal": "ellipsoidal",
    "torispherical": "torispherical",
}
ROUNDING = 1e-12  # relative excess of a level above the tip due to rounding
MOVED_BY_HEIGHT = ("shell_temperature", "expansion")  # inputs that stretch heights


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


@dataclass(frozen=True)
class HeadedShell(Part):
    """Shell of courses and its head as a single part, both at the temperature of the table.

    Attributes
    ----------
    shell : ShellPart
    tip : Tip
        Head over the area of the last course at its top, with dimensions stretched like heights.
    """

    shell: ShellPart
    tip: Tip

    @property
    def base_m(self):
        """Level of the edge of the head."""
        return self.shell.volume.height_m

    @property
    def highest_m(self):
        """Level of the tip of the head."""
        return self.base_m + self.tip.depth_m

    @property
    def breakpoints_m(self):
        """Bottoms of the courses, and the edge of the head."""
        return (*self.shell.breakpoints_m, self.base_m)

    def volume_m3(self, levels_m):
        """Return the volume (rows,) of shell and head below each level."""
        shell_levels, x = self._split(levels_m)
        return self.shell.volume_m3(shell_levels) + self.tip.beyond_m3(0.0) - self.tip.beyond_m3(x)

    def area_m2(self, levels_m):
        """Return the inside area (rows,) at each level; at the edge, the area of the head."""
        shell_levels, x = self._split(levels_m)
        in_head = as_levels(levels_m) >= self.base_m
        return np.where(in_head, self.tip.area_m2(x), self.shell.area_m2(shell_levels))

    def derivatives(self, levels_m):
        """Return {input: (rows,)} of the shell, of the plan of the head, and of its dimensions.

        "top_depth" raises the tip over its edge. "dish" and "knuckle" are the radii of a
        torispherical head, if given. A higher course raises the whole head.
        """
        shell_levels, x = self._split(levels_m)
        in_head, cut_m2 = as_levels(levels_m) >= self.base_m, self.tip.area_m2(x)
        derivatives = self.shell.derivatives(shell_levels)
        plan, by_tip = self.tip.plan_m2, self._tip_derivatives(x)
        # The plan grows with the square of its scale.
        by_plan = by_tip.pop("scale") / (2 * plan)
        for name, by_input in self._plan_by().items():
            if name in derivatives:
                derivatives[name] = derivatives[name] + by_plan * by_input
        # Raising the head adds a cylinder over the plan, and removes the cut at the level.
        by_lift = np.where(in_head, plan - cut_m2, 0.0)
        if "datum" in derivatives:
            derivatives["datum"] = np.where(in_head, cut_m2, derivatives["datum"])
        if "course_heights" in derivatives:
            derivatives["course_heights"] = derivatives["course_heights"] + by_lift[:, None]
        if self.shell.stretch != 1.0:
            # A stretch of heights changes the dimensions of the head, and the level of its edge.
            by_heights = sum(
                self.tip.sizes_m[name] * derivative for name, derivative in by_tip.items()
            )
            by_stretch = (by_heights + by_lift * self.base_m) / self.shell.stretch
            for name in MOVED_BY_HEIGHT:
                if name in derivatives:
                    derivatives[name] = derivatives[name] + self._thermal_growth(name) * by_stretch
        derivatives |= {
            "top_depth" if name == "depth" else name: derivative
            for name, derivative in by_tip.items()
        }
        return derivatives

    def sources(self, levels_m):
        """Return the sources of the survey, for the shell and the plan of the head."""
        factors = self.shell.factors
        if not factors:
            return ()
        shell_levels, x = self._split(levels_m)
        by_plan = self._tip_derivatives(x)["scale"] / (2 * self.tip.plan_m2)
        weights = self.shell.volume.top_weights
        return tuple(
            factor.source(source.columns_m3 + by_plan[:, None] * (weights @ factor.columns))
            for factor, source in zip(factors, self.shell.sources(shell_levels), strict=True)
        )

    def _split(self, levels_m):
        """Return (levels in the shell, x in the head); raise HeightError above the tip."""
        levels = as_levels(levels_m)
        above = levels > self.highest_m * (1 + ROUNDING)
        if np.any(above):
            raise HeightError(
                message(
                    "level_above_head",
                    "level {level_m:g} m is above the head on the shell ({top_m:g} m)",
                    level_m=levels[above][0],
                    top_m=self.highest_m,
                )
            )
        x = np.clip(levels - self.base_m, 0.0, self.tip.depth_m)
        return np.minimum(levels, self.base_m), x

    def _tip_derivatives(self, x):
        """Return {input of the tip: derivative (rows,) of the volume of the head below x}."""
        complete, remaining = self.tip.derivatives(np.zeros(1)), self.tip.derivatives(x)
        return {name: complete[name] - remaining[name] for name in complete}

    def _plan_by(self):
        """Return {input: derivative of the plan of the head, m2 per SI unit}."""
        shell, volume = self.shell, self.shell.volume
        courses = volume.courses
        weights, scale = volume.top_weights, 2 * self.tip.plan_m2 / shell.scale
        girth = float(weights @ volume.girth_features)
        by_readings = {
            name: float(weights @ derivative) for name, derivative in shell.read_with.items()
        }
        departures = {
            name: sum(
                float(course_weights @ (course.girths_m * course.missed[name]))
                for course_weights, course in zip(
                    np.split(weights, len(courses)), courses, strict=True
                )
            )
            for name in volume.departures
        }
        derivatives = {
            "scale": float(weights @ volume.scale_features),
            "offset": girth,
            "tilt": self.tip.plan_m2 * shell.tilt / (1 + shell.tilt**2),
            "plate_thickness": -girth * shell.subtracts,
            "paint": -girth * shell.subtracts,
            **{name: self._thermal_growth(name) * scale for name in MOVED_BY_HEIGHT},
            **departures,
        }
        derivatives = {
            name: derivative
            for name, derivative in derivatives.items()
            if name in ("scale", "offset", "tilt", *shell.bearing, *departures)
        }
        for name, derivative in by_readings.items():
            derivatives[name] = derivatives.get(name, 0.0) + derivative
        return derivatives

    def _thermal_growth(self, name):
        """Return the growth of lengths by the temperature of the shell, or by its coefficient."""
        shell = self.shell
        if name == "shell_temperature":
            return -shell.expansion_per_k
        return (shell.scale - 1) / shell.expansion_per_k
