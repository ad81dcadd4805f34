"""Ends of lying tanks, and what a plane cuts off a solid of revolution.

A solid is described by its meridian, radius r(x) along the axis, made of arcs: straight lines and
pieces of ellipses. The liquid's surface cuts the section at x in a chord at height c(x), counted
from the axis, a straight line in x because the surface is a plane. With cos t = -c / r,

    S = r^2 t + c sqrt(r^2 - c^2),    dS/dc = 2 sqrt(r^2 - c^2),    dS/d(r^2) = t

is the wet part of the section, and volumes and their derivatives are integrals of these along x.
Each arc is broken exactly where the surface meets the meridian and where it runs parallel to it;
there the integrands have square roots, which u = low + (high - low) sin^2 v takes away.
Sources: Jones 2001, Computing fluid tank volumes; Davis & Rabinowitz 1984, 2.12 (singularities).
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.quadrature import panels

NODES = 24  # of each panel
KINDS = ("flat", "conical", "ellipsoidal", "torispherical", "spherical")


@dataclass(frozen=True)
class Line:
    """A straight piece of a meridian, r = radius_m + slope x; its parameter is x, m.

    Attributes
    ----------
    by_input : dict
        {input: derivative of (radius_m, slope) by it}.
    """

    start: float
    stop: float
    radius_m: float
    slope: float = 0.0
    by_input: dict = field(default_factory=dict)

    def at(self, x):
        """x, r(x), and dx by the parameter."""
        return x, self.radius_m + self.slope * x, 1.0

    def square_by(self, name, x):
        """Derivative of r(x)^2 by an input, m2 per unit of the input."""
        at_zero, by_slope = self.by_input.get(name, (0.0, 0.0))
        return 2 * (self.radius_m + self.slope * x) * (at_zero + by_slope * x)

    def breaks(self, level_m, slope):
        """(rows, 2) x where the line level_m - slope x meets r(x) and -r(x)."""
        columns = []
        for side in (1, -1):
            steepness = side * self.slope + slope
            parallel = abs(steepness) * self.stop <= 1e-18 * self.radius_m
            over = level_m - side * self.radius_m
            columns.append(np.full_like(over, self.start) if parallel else over / steepness)
        return np.column_stack(columns)


@dataclass(frozen=True)
class EllipseArc:
    """A piece of an ellipse; its parameter is the angle u, 0 where the radius is greatest.

    x = centre_m + along_m sin u, r = offset_m + across_m cos u, from start to stop, rad

    Attributes
    ----------
    by_input : dict
        {input: derivative of (centre_m, offset_m, along_m, across_m) by it}.
    """

    start: float
    stop: float
    centre_m: float
    offset_m: float
    along_m: float
    across_m: float
    by_input: dict = field(default_factory=dict)

    def at(self, u):
        """x, r, and dx/du."""
        sin, cos = np.sin(u), np.cos(u)
        return self.centre_m + self.along_m * sin, self._radius(cos), self.along_m * cos

    def square_by(self, name, u):
        """Derivative of r(x)^2 at a fixed x by an input, m2 per unit of the input."""
        centre, offset, along, across = self.by_input.get(name, (0.0, 0.0, 0.0, 0.0))
        sin, cos = np.sin(u), np.cos(u)
        lean = (self.offset_m / cos + self.across_m) * self.across_m / self.along_m * sin
        return 2 * lean * (centre + sin * along) + 2 * self._radius(cos) * (offset + cos * across)

    def breaks(self, level_m, slope):
        """(rows, 6) u where the line level_m - slope x meets r and -r, or runs parallel to them."""
        columns = []
        for side in (1, -1):
            rise = side * slope * self.along_m
            parallel = np.arctan2(rise, self.across_m)
            over = side * (level_m - slope * self.centre_m) - self.offset_m
            away = np.arccos(np.clip(over / np.hypot(rise, self.across_m), -1.0, 1.0))
            columns += [parallel - away, parallel + 0.0 * away, parallel + away]
        return np.column_stack(columns)

    def _radius(self, cos):
        return self.offset_m + self.across_m * cos


@dataclass(frozen=True)
class End:
    """An end of a lying tank, as seen from its own tangent line (the edge of the cylinder).

    Attributes
    ----------
    kind : str
        "flat", "conical", "ellipsoidal", "torispherical" or "spherical".
    depth_m : float
        From the tangent line to the tip, inside; of a torispherical end it follows from its radii,
        and a flat end has none.
    dish_radius_m, knuckle_radius_m : float or None
        Of a torispherical end, inside.
    inward : bool
        The end bulges into the tank (bulkheads of road tankers).
    """

    kind: str = "flat"
    depth_m: float = 0.0
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    inward: bool = False


def meridian(end, radius_m):
    """Arcs of an end, x from its tangent line to its tip; radius_m of the cylinder.

    Conical r = R (1 - x/h); ellipsoidal r = R sqrt(1 - (x/h)^2); spherical: the sphere of radius
    (R^2 + h^2) / (2 h) through the edge; torispherical: a knuckle of radius k, tangent to the
    cylinder, and a dish of radius f, tangent to the knuckle, of depth
    h = f - sqrt((f - k)^2 - (R - k)^2).

    Each arc knows its derivatives by "radius" and "end_depth" (the other stays; of a torispherical
    end its two radii stay with "radius", and "end_depth" stretches it along the axis) and
    "end_plate" (h, or f and k, are less by it; R stays).

    Raises
    ------
    SolutionError
        With the numbers, for sizes that make no such end.
    """
    if end.kind not in KINDS:
        raise SolutionError(f"no end is called {end.kind!r}: expected one of {', '.join(KINDS)}")
    if end.kind == "torispherical":
        return _torispherical(end, radius_m)
    if end.kind == "flat":
        if end.depth_m:
            raise SolutionError(
                message(
                    "flat_end_depth",
                    "a flat end has no depth, but {depth_m:g} m was given",
                    depth_m=end.depth_m,
                )
            )
        return ()
    h = end.depth_m
    if not 0 < h < np.inf:
        raise SolutionError(f"a {end.kind} end of depth {h:g} m: expected a depth above zero")
    if end.kind == "spherical":
        return _spherical(h, radius_m)
    if end.kind == "ellipsoidal":
        by_radius, by_depth = np.array([0.0, 0, 0, 1]), np.array([0.0, 0, 1, 0])
        return (EllipseArc(0.0, np.pi / 2, 0.0, 0.0, h, radius_m, _inputs(by_radius, by_depth)),)
    by_radius, by_depth = np.array([1.0, -1 / h]), np.array([0.0, radius_m / h**2])
    return (Line(0.0, h, radius_m, -radius_m / h, _inputs(by_radius, by_depth)),)


def depth_of(end, radius_m):
    """Depth of an end from its tangent line to its tip.

    Parameters
    ----------
    end : End
    radius_m : float
        Of the cylinder.

    Returns
    -------
    float
        In m, never negative.

    Examples
    --------
    >>> round(depth_of(End("torispherical", dish_radius_m=2.0, knuckle_radius_m=0.2), 1.0), 4)
    0.3875
    """
    return max((float(arc.at(arc.stop)[0]) for arc in meridian(end, radius_m)), default=0.0)


def _inputs(by_radius, by_depth):
    return {"radius": by_radius, "end_depth": by_depth, "end_plate": -by_depth}


def _spherical(h, radius_m):
    if h > radius_m * (1 + 1e-12):
        raise SolutionError(
            message(
                "spherical_end_too_deep",
                "a spherical end {depth_m:g} m deep on a radius of {radius_m:g} m: "
                "expected at most the radius (a hemisphere)",
                depth_m=h,
                radius_m=radius_m,
            )
        )
    ball = (radius_m**2 + h**2) / (2 * h)
    by_radius = radius_m / h * np.array([-1.0, 0, 1, 1])
    by_depth = np.array([ball / h, 0, 1 - ball / h, 1 - ball / h])
    edge = np.pi / 2 - 2 * np.arctan2(h, radius_m)  # of the ball, above its greatest radius
    return (EllipseArc(edge, np.pi / 2, h - ball, 0.0, ball, ball, _inputs(by_radius, by_depth)),)


def _torispherical(end, radius_m):
    dish, knuckle = end.dish_radius_m, end.knuckle_radius_m
    if dish is None or knuckle is None:
        raise SolutionError(
            message(
                "torispherical_radii_missing",
                "a torispherical end needs the radii of its dish and its knuckle",
            )
        )
    if not 0 < knuckle <= radius_m < dish < np.inf:
        raise SolutionError(
            message(
                "torispherical_radii_impossible",
                "a torispherical end with a knuckle of {knuckle_m:g} m and a dish of {dish_m:g} m "
                "on a radius of {radius_m:g} m: expected 0 < knuckle <= radius < dish (an end "
                "without knuckle, or a hemisphere, is a spherical one)",
                knuckle_m=knuckle,
                dish_m=dish,
                radius_m=radius_m,
            )
        )
    inner = radius_m - knuckle
    reach = np.sqrt((dish - radius_m) * (dish + radius_m - 2 * knuckle))
    h = dish - reach
    joint = np.arctan2(reach, inner)
    of_knuckle = {
        "radius": np.array([0.0, 1, 0, 0]),
        "end_depth": np.array([0.0, 0, knuckle / h, 0]),
        "end_plate": np.array([0.0, 1, -1, -1]),
    }
    of_dish = {
        "radius": np.array([inner / reach, 0, 0, 0]),
        "end_depth": np.array([-reach / h, 0, dish / h, 0]),
        "end_plate": np.array([inner / reach, 0, -1, -1]),
    }
    return (
        EllipseArc(0.0, joint, 0.0, inner, knuckle, knuckle, of_knuckle),
        EllipseArc(joint, np.pi / 2, -reach, 0.0, dish, dish, of_dish),
    )


@dataclass(frozen=True)
class Cut:
    """Sections of one arc and the liquid in them; arrays of one shape.

    Attributes
    ----------
    parameter : ndarray
        Of the arc, of which the sections are.
    x_m, radius_m : ndarray
        Place and radius of each section.
    height_m : ndarray
        Of the liquid's surface above the axis.
    """

    arc: Line | EllipseArc
    parameter: np.ndarray
    x_m: np.ndarray
    radius_m: np.ndarray
    height_m: np.ndarray

    def segment(self):
        """Wet part S of each section, m2."""
        height = np.clip(self.height_m, -self.radius_m, self.radius_m)
        return self.radius_m**2 * self.wet_angle() + height * self.chord() / 2

    def chord(self):
        """Width of the free surface in each section, m."""
        return 2 * np.sqrt(self._above_bottom() * self._below_top())

    def chord_moment(self):
        """Width of the free surface times x, m2."""
        return self.x_m * self.chord()

    def wet_angle(self):
        """Half the angle that the wet arc of each section spans at the axis, 0 to pi."""
        return 2 * np.arctan2(np.sqrt(self._above_bottom()), np.sqrt(self._below_top()))

    def by_radius(self):
        """Derivative of S by the input "radius", m2 per m."""
        return self.arc.square_by("radius", self.parameter) * self.wet_angle()

    def by_end_depth(self):
        """Derivative of S by the input "end_depth", m2 per m."""
        return self.arc.square_by("end_depth", self.parameter) * self.wet_angle()

    def by_end_plate(self):
        """Derivative of S by the input "end_plate", m2 per m."""
        return self.arc.square_by("end_plate", self.parameter) * self.wet_angle()

    def by_wave(self, order):
        """Derivative of S by a wave cos(order a) of the radius, a from the bottom, m2 per m."""
        return 2 * self.radius_m * np.sin(order * self.wet_angle()) / order

    def _above_bottom(self):
        return np.maximum(self.radius_m + self.height_m, 0.0)

    def _below_top(self):
        return np.maximum(self.radius_m - self.height_m, 0.0)


def integrate(arc, level_m, slope, integrands, nodes=NODES):
    """Integrals over x along an arc, below the line level_m - slope x: (integrands, rows).

    Parameters
    ----------
    arc
        Line or EllipseArc.
    level_m : ndarray, shape (rows,)
        Height of the liquid above the axis at x = 0.
    slope
        Fall of that height per metre of x, any number.
    integrands
        Functions of a `Cut`, such as Cut.segment.
    """
    level_m = np.asarray(level_m, dtype=float)
    row, parameter, weight = _wet_nodes(arc, level_m, slope, nodes)
    x, radius, step = arc.at(parameter)
    cut = Cut(arc, parameter, x, radius, level_m[row, None] - slope * x)
    sums = [np.einsum("pn,pn->p", step * weight, integrand(cut)) for integrand in integrands]
    return np.array([np.bincount(row, one, minlength=len(level_m)) for one in sums])


def _wet_nodes(arc, level_m, slope, nodes):
    """Row, parameters and weights of the panels that are not dry: (p,), (p, nodes), (p, nodes)."""
    inner = np.clip(arc.breaks(level_m, slope), arc.start, arc.stop)
    ends = np.broadcast_to([arc.start, arc.stop], (len(level_m), 2))
    breaks = np.sort(np.hstack([inner, ends]), axis=1)
    low, long = breaks[:, :-1], np.diff(breaks, axis=1)
    x, radius, _ = arc.at(low + long / 2)
    wet = (long > 0) & (level_m[:, None] - slope * x > -radius)
    row = np.nonzero(wet)[0]
    low, long = low[wet][:, None], long[wet][:, None]
    if slope == 0 and isinstance(arc, Line) and arc.slope == 0:
        return row, low + long / 2, long
    angle, share = panels((0.0, np.pi / 2), nodes)
    return row, low + long * np.sin(angle) ** 2, long * (np.sin(2 * angle) * share)
