"""Meridians of the ends of lying tanks and the heads of upright tanks, from their dimensions.

Volume that a plane cuts off a solid of revolution
--------------------------------------------------

A solid is described by its meridian, the radius r(x) along the axis, composed of arcs: straight
lines and sections of ellipses. The liquid surface cuts the section at x in a chord at the height
c(x) above the axis. The surface is a plane, so c is linear in x. With cos t = -c / r,

    S = r^2 t + c sqrt(r^2 - c^2),    dS/dc = 2 sqrt(r^2 - c^2),    dS/d(r^2) = t

is the wet area of the section; volumes and their derivatives are integrals of these along x. Each
arc is divided exactly where the surface meets the meridian and where it is parallel to the
meridian. The integrands have square roots at these points, which the substitution u = low + (high -
low) sin^2 v removes. Sources: Jones 2001, Computing fluid tank volumes; Davis & Rabinowitz 1984,
2.12 (singularities).
"""

from dataclasses import dataclass, field, replace
from operator import methodcaller
from types import MappingProxyType

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.quadrature import panels

KINDS = ("flat", "conical", "ellipsoidal", "torispherical", "spherical", "guppy")
RADII = ("dish", "knuckle")  # possible dimensions of a torispherical end, beside the depth
STANDARDS = {  # torispherical: radii of dish and knuckle over the diameter of the cylinder
    "asme": (1.0, 0.06),
    "din_28011": (1.0, 0.1),
    "din_28013": (0.8, 0.154),
}
NODES = 24  # Gauss nodes of each panel


@dataclass(frozen=True)
class End:
    """End of a lying tank, relative to its tangent line (the edge of the cylinder).

    Two of the three dimensions of a torispherical end are given, the third is computed.

    Attributes
    ----------
    kind : str
        "flat", "conical", "ellipsoidal", "torispherical", "spherical" or "guppy".
    depth_m : float
        Inside depth from the tangent line to the tip; 0 for a torispherical end of given radii, and
        for a flat end.
    dish_radius_m, knuckle_radius_m : float or None
        Inside radii of a torispherical end.
    inward : bool
        Whether the end bulges into the tank (bulkheads of road tankers).
    """

    kind: str = "flat"
    depth_m: float = 0.0
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    inward: bool = False


def standard_end(end, standard, diameter_m):
    """Return a torispherical end with the radii of a standard form.

    An end of given depth gets only the knuckle radius of the standard.

    Parameters
    ----------
    end : End
        End without radii, with or without a measured depth.
    standard : str
        Key of STANDARDS.
    diameter_m : float

    Returns
    -------
    End

    Examples
    --------
    >>> end = standard_end(End("torispherical"), "din_28011", 2.0)
    >>> end.dish_radius_m, end.knuckle_radius_m
    (2.0, 0.2)
    """
    dish, knuckle = (share * diameter_m for share in STANDARDS[standard])
    return replace(end, dish_radius_m=None if end.depth_m else dish, knuckle_radius_m=knuckle)


def meridian(end, radius_m, upward=1.0):
    """Return the arcs of an end, with x from its tangent line to its tip.

    Conical: r = R (1 - x/h). Ellipsoidal: r = R sqrt(1 - (x/h)^2). Spherical: the sphere of radius
    (R^2 + h^2) / (2 h) through the edge. Torispherical: a knuckle of radius k, tangent to the
    cylinder, and a dish of radius f, tangent to the knuckle, of depth h = f - sqrt((f - k)^2 - (R -
    k)^2). Guppy: a cone whose tip is on the line of the crown, so that the centres of its sections
    rise by R x / h, times `upward` (the cosine of a roll).

    Each arc contains its derivatives by "radius" and "end_depth" (with all other given dimensions
    fixed; for a torispherical end of given radii, "end_depth" stretches it along the axis), by the
    given RADII, and by "end_plate" (which reduces the given dimensions of h, f and k; R is fixed).

    Parameters
    ----------
    end : End
    radius_m : float
        Radius R of the cylinder.
    upward : float, optional

    Returns
    -------
    tuple of Line or EllipseArc

    Raises
    ------
    SolutionError
        With the numbers, for dimensions that are impossible for such an end.
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
    cone = Line(0.0, h, radius_m, -radius_m / h, _inputs(by_radius, by_depth))
    if end.kind == "conical":
        return (cone,)
    by_lift = _inputs(upward / h, -upward * radius_m / h**2)
    return (replace(cone, lift=upward * (radius_m / h), lift_by=by_lift),)


def depth_of(end, radius_m):
    """Return the depth of an end from its tangent line to its tip.

    Parameters
    ----------
    end : End
    radius_m : float
        Radius of the cylinder.

    Returns
    -------
    float
        Depth, m, never negative.

    Examples
    --------
    >>> round(depth_of(End("torispherical", dish_radius_m=2.0, knuckle_radius_m=0.2), 1.0), 4)
    0.3875
    """
    return max((float(arc.at(arc.stop)[0]) for arc in meridian(end, radius_m)), default=0.0)


def _inputs(by_radius, by_depth):
    """Return {input: derivative of the parameters of an arc}."""
    return {"radius": by_radius, "end_depth": by_depth, "end_plate": -by_depth}


def _spherical(h, radius_m):
    """Return the arc of a spherical end of depth h."""
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
    # Parameter of the edge; the half-angle form is accurate for shallow ends.
    edge = np.pi / 2 - 2 * np.arctan2(h, radius_m)
    return (EllipseArc(edge, np.pi / 2, h - ball, 0.0, ball, ball, _inputs(by_radius, by_depth)),)


def torispherical_radii(radius_m, depth_m=0.0, dish_radius_m=None, knuckle_radius_m=None):
    """Return the radii of dish and knuckle of a torispherical end, from two of three dimensions.

        k = (2 f h - R^2 - h^2) / (2 (f - R)),    f = (R^2 + h^2 - 2 R k) / (2 (h - k))

    Parameters
    ----------
    radius_m : float
        Radius of the cylinder.
    depth_m : float, optional
        Depth; 0: not given.
    dish_radius_m, knuckle_radius_m : float, optional

    Returns
    -------
    tuple of two float
        Dish, knuckle, m; the radii are not checked for consistency if both are given.

    Raises
    ------
    SolutionError
        If the number of given dimensions is not two, or no third dimension fits.

    Notes
    -----
    Both formulas are h = f - sqrt((f - k)^2 - (R - k)^2), solved for k and for f.

    Examples
    --------
    >>> dish, knuckle = torispherical_radii(1.0, 2 - 2.6**0.5, dish_radius_m=2.0)
    >>> round(knuckle, 9)
    0.2
    """
    r, h, f, k = radius_m, depth_m, dish_radius_m, knuckle_radius_m
    if (f is None) + (k is None) + (not h) != 1:
        raise SolutionError(
            message(
                "torispherical_sizes_count",
                "a torispherical end needs two of three sizes: the radius of its dish, that of its "
                "knuckle, its depth",
            )
        )
    if not h:
        return f, k
    # Least depth: a dish without knuckle, or the depth of the knuckle alone.
    least = (f - np.sqrt(max(f**2 - r**2, 0.0))) if k is None else k
    if not least < h < r or (f is not None and not r < f < np.inf) or (k is not None and not k > 0):
        raise SolutionError(
            message(
                "torispherical_depth_impossible",
                "a torispherical end {depth_m:g} m deep on a radius of {radius_m:g} m, given with "
                "a radius of {given_m:g} m: expected more than {low_m:g} m and less than the radius"
                " of the cylinder",
                depth_m=h,
                radius_m=r,
                given_m=f if k is None else k,
                low_m=least,
            )
        )
    if k is None:
        return f, (2 * f * h - r**2 - h**2) / (2 * (f - r))
    return (r**2 + h**2 - 2 * r * k) / (2 * (h - k)), k


def _torispherical(end, radius_m):
    """Return the arcs of a torispherical end: knuckle and dish."""
    dish, knuckle = torispherical_radii(
        radius_m, end.depth_m, end.dish_radius_m, end.knuckle_radius_m
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
    # The knuckle centre is `inner` from the axis, the dish centre `reach` behind the tangent line;
    # both arcs meet on the line through their centres.
    inner = radius_m - knuckle
    reach = np.sqrt((dish - radius_m) * (dish + radius_m - 2 * knuckle))
    joint = np.arctan2(reach, inner)
    of_knuckle, of_dish = _torispherical_inputs(end, radius_m, dish, knuckle)
    return (
        EllipseArc(0.0, joint, 0.0, inner, knuckle, knuckle, of_knuckle),
        EllipseArc(joint, np.pi / 2, -reach, 0.0, dish, dish, of_dish),
    )


def _torispherical_inputs(end, radius_m, dish, knuckle):
    """Return {input: derivatives} of the knuckle and of the dish, by the given dimensions."""
    inner = radius_m - knuckle
    reach = np.sqrt((dish - radius_m) * (dish + radius_m - 2 * knuckle))
    h = dish - reach
    partial_derivatives = {  # derivatives by R, f and k, with the other two fixed
        "radius": np.array([[0.0, 1, 0, 0], [inner / reach, 0, 0, 0]]),
        "dish": np.array([[0.0, 0, 0, 0], [(knuckle - dish) / reach, 0, 1, 1]]),
        "knuckle": np.array([[0.0, -1, 1, 1], [(dish - radius_m) / reach, 0, 0, 0]]),
    }
    if not end.depth_m:
        stretch = np.array([[0.0, 0, knuckle / h, 0], [-reach / h, 0, dish / h, 0]])
        derivatives, given_names = partial_derivatives | {"end_depth": stretch}, RADII
    else:
        by_depth = {  # derivatives of h by R, f and k
            "radius": inner / reach,
            "dish": 1 - (dish - knuckle) / reach,
            "knuckle": (dish - radius_m) / reach,
        }
        computed = RADII[end.dish_radius_m is not None]
        slope = by_depth[computed]
        derivatives = {  # the computed radius changes so that the depth is constant
            name: derivative - by_depth[name] / slope * partial_derivatives[computed]
            for name, derivative in partial_derivatives.items()
            if name != computed
        }
        derivatives["end_depth"] = partial_derivatives[computed] / slope
        given_names = [name for name in derivatives if name != "radius"]
    derivatives["end_plate"] = -sum(derivatives[name] for name in given_names)
    return tuple(
        {name: derivative[arc] for name, derivative in derivatives.items()} for arc in (0, 1)
    )


@dataclass(frozen=True)
class Line:
    """Straight section of a meridian, r = radius_m + slope x; its parameter is x, m.

    Attributes
    ----------
    lift : float
        Rise of the centres of the sections above the axis per metre of x, as for an oblique cone.
    by_input : dict
        {input: derivative of (radius_m, slope)}.
    lift_by : dict
        {input: derivative of the lift}.
    """

    start: float
    stop: float
    radius_m: float
    slope: float = 0.0
    by_input: dict = field(default_factory=dict)
    lift: float = 0.0
    lift_by: dict = field(default_factory=dict)

    def at(self, x):
        """Return x, r(x), and dx by the parameter."""
        return x, self.radius_m + self.slope * x, 1.0

    def square_by(self, name, x):
        """Return the derivative of r(x)^2 by an input, m2 per unit of the input."""
        at_zero, by_slope = self.by_input.get(name, (0.0, 0.0))
        return 2 * (self.radius_m + self.slope * x) * (at_zero + by_slope * x)

    def breaks(self, level_m, slope):
        """Return x (rows, 2) where the line level_m - slope x meets r(x) and -r(x)."""
        columns = []
        for side in (1, -1):
            steepness = side * self.slope + slope
            parallel = abs(steepness) * self.stop <= 1e-18 * self.radius_m
            difference = level_m - side * self.radius_m
            # A parallel line has no intersection within the arc: return the start, which adds no
            # break.
            columns.append(
                np.full_like(difference, self.start) if parallel else difference / steepness
            )
        return np.column_stack(columns)


@dataclass(frozen=True)
class EllipseArc:
    """Section of an ellipse; its parameter is the angle u, 0 at the largest radius.

    x = centre_m + along_m sin u, r = offset_m + across_m cos u, from start to stop, rad

    Attributes
    ----------
    by_input : dict
        {input: derivative of (centre_m, offset_m, along_m, across_m)}.
    """

    start: float
    stop: float
    centre_m: float
    offset_m: float
    along_m: float
    across_m: float
    by_input: dict = field(default_factory=dict)
    lift = 0.0
    lift_by = MappingProxyType({})

    @property
    def is_quarter(self):
        """Whether the arc is a quarter of an ellipse about the origin."""
        return (self.start, self.stop, self.centre_m, self.offset_m) == (0.0, np.pi / 2, 0.0, 0.0)

    def at(self, u):
        """Return x, r, and dx/du."""
        sin, cos = np.sin(u), np.cos(u)
        return self.centre_m + self.along_m * sin, self._radius(cos), self.along_m * cos

    def square_by(self, name, u):
        """Return the derivative of r(x)^2 at a fixed x by an input, m2 per unit of the input."""
        by_centre, by_offset, by_along, by_across = self.by_input.get(name, (0.0, 0.0, 0.0, 0.0))
        sin, cos = np.sin(u), np.cos(u)
        # At fixed x, u changes by -(dcentre + sin u dalong) / (along cos u), and r by -across sin u
        # du.
        by_position = (self.offset_m / cos + self.across_m) * self.across_m / self.along_m * sin
        return 2 * by_position * (by_centre + sin * by_along) + 2 * self._radius(cos) * (
            by_offset + cos * by_across
        )

    def breaks(self, level_m, slope):
        """Return u (rows, 6) where the line level_m - slope x meets or parallels r and -r."""
        columns = []
        for side in (1, -1):
            rise = side * slope * self.along_m
            # rise sin u + across cos u = over is a cosine about the angle where the line is
            # parallel.
            parallel = np.arctan2(rise, self.across_m)
            difference = side * (level_m - slope * self.centre_m) - self.offset_m
            half_angle = np.arccos(np.clip(difference / np.hypot(rise, self.across_m), -1.0, 1.0))
            columns += [parallel - half_angle, parallel + 0.0 * half_angle, parallel + half_angle]
        return np.column_stack(columns)

    def _radius(self, cos):
        return self.offset_m + self.across_m * cos


@dataclass(frozen=True)
class Cut:
    """Sections of an arc and the liquid in them; arrays of equal shape.

    Attributes
    ----------
    parameter : ndarray
        Parameter of the arc at each section.
    x_m, radius_m : ndarray
        Position and radius of each section.
    height_m : ndarray
        Height of the liquid surface above the centre of each section.
    """

    arc: Line | EllipseArc
    parameter: np.ndarray
    x_m: np.ndarray
    radius_m: np.ndarray
    height_m: np.ndarray

    def segment(self):
        """Return the wet area S of each section, m2."""
        height = np.clip(self.height_m, -self.radius_m, self.radius_m)
        return self.radius_m**2 * self.wet_angle() + height * self.chord() / 2

    def chord(self):
        """Return the width of the free surface in each section, m."""
        # (r + c)(r - c) avoids the cancellation of r^2 - c^2 near the bottom and the top.
        return 2 * np.sqrt(self._above_bottom() * self._below_top())

    def chord_moment(self):
        """Return the width of the free surface times x, m2."""
        return self.x_m * self.chord()

    def wet_angle(self):
        """Return half the angle of the wet arc of each section at the axis, 0 to pi."""
        # Half-angle formula: accurate for nearly empty and nearly full sections.
        return 2 * np.arctan2(np.sqrt(self._above_bottom()), np.sqrt(self._below_top()))

    def by(self, name):
        """Return the derivative of S by an input of the arc, m2 per m."""
        by_radius = self.arc.square_by(name, self.parameter) * self.wet_angle()
        by_lift = self.arc.lift_by.get(name)
        return by_radius if by_lift is None else by_radius - by_lift * self.chord_moment()

    def by_wave(self, order):
        """Return the derivative of S by a wave cos(order a) of the radius, m2 per m."""
        return 2 * self.radius_m * np.sin(order * self.wet_angle()) / order

    def _above_bottom(self):
        return np.maximum(self.radius_m + self.height_m, 0.0)

    def _below_top(self):
        return np.maximum(self.radius_m - self.height_m, 0.0)


@dataclass(frozen=True)
class Cap:
    """Half of an ellipsoid below a surface parallel to its axis; integrals over x as in `Cut`.

    With d = R + c the depth of the liquid, the volume is that of half a cap, pi a d^2 (3 R - d) /
    (6 R), and the free surface is half an ellipse of semi-axes a q and R q, q^2 = 1 - (c / R)^2.

    Attributes
    ----------
    arc : EllipseArc
        Quarter of an ellipse about the origin.
    level_m : ndarray, shape (rows,)
        Height of the liquid surface above the axis.
    """

    arc: "EllipseArc"
    level_m: np.ndarray

    def segment(self):
        """Return the volume of the liquid, m3."""
        return np.pi / 6 * self.arc.along_m * self._depth**2 * (3 - self._depth / self._radius)

    def chord(self):
        """Return the area of the free surface, m2."""
        return np.pi / 2 * self.arc.along_m * self._radius * self._surface_square

    def chord_moment(self):
        """Return the integral of x over the free surface, m3."""
        return 2 / 3 * self.arc.along_m**2 * self._radius * self._surface_square**1.5

    def by(self, name):
        """Return the derivative of the volume by an input of the arc, at a fixed level."""
        _, _, by_along, by_across = self.arc.by_input.get(name, np.zeros(4))
        share = self._depth / self._radius
        by_radius = np.pi / 6 * self.arc.along_m * self._depth * (6 - share * (3 - share))
        return self.segment() / self.arc.along_m * by_along + by_radius * by_across

    @property
    def _radius(self):
        return self.arc.across_m

    @property
    def _depth(self):
        return np.clip(self._radius + self.level_m, 0.0, 2 * self._radius)

    @property
    def _surface_square(self):
        """Square q^2 of the ratio of the semi-axes of the free surface to those of the arc."""
        share = self._depth / self._radius
        return share * (2 - share)


SEGMENT, CHORD, CHORD_MOMENT = map(methodcaller, ("segment", "chord", "chord_moment"))


def integrate(arc, level_m, slope, integrands, nodes=NODES):
    """Return integrals (integrands, rows) over x along an arc, below the line level_m - slope x.

    If the centres of the sections rise, the line falls more steeply relative to them. Half an
    ellipsoid below a level surface has a closed form (`Cap`).

    Parameters
    ----------
    arc : Line or EllipseArc
    level_m : ndarray, shape (rows,)
        Height of the liquid above the axis at x = 0, m.
    slope : float
        Fall of that height per metre of x.
    integrands : sequence of callable
        Functions of a `Cut` or `Cap`, such as SEGMENT.
    nodes : int, optional
        Gauss nodes of each panel.

    Returns
    -------
    ndarray, shape (integrands, rows)
    """
    level_m, slope = np.asarray(level_m, dtype=float), slope + arc.lift
    if slope == 0 and isinstance(arc, EllipseArc) and arc.is_quarter:
        return np.array([integrand(Cap(arc, level_m)) for integrand in integrands])
    row, parameter, weight = _wet_nodes(arc, level_m, slope, nodes)
    x, radius, step = arc.at(parameter)
    sections = Cut(arc, parameter, x, radius, level_m[row, None] - slope * x)
    sums = [np.einsum("pn,pn->p", step * weight, integrand(sections)) for integrand in integrands]
    # Several panels belong to a row: add their sums.
    return np.array(
        [np.bincount(row, sums_of_panels, minlength=len(level_m)) for sums_of_panels in sums]
    )


def _wet_nodes(arc, level_m, slope, nodes):
    """Return row (p,), parameters (p, nodes) and weights (p, nodes) of the panels with liquid."""
    inner = np.clip(arc.breaks(level_m, slope), arc.start, arc.stop)
    ends = np.broadcast_to([arc.start, arc.stop], (len(level_m), 2))
    breaks = np.sort(np.hstack([inner, ends]), axis=1)
    begin, length = breaks[:, :-1], np.diff(breaks, axis=1)
    x, radius, _ = arc.at(begin + length / 2)
    # A panel is either dry throughout or wet throughout: its middle decides.
    wet = (length > 0) & (level_m[:, None] - slope * x > -radius)
    row = np.nonzero(wet)[0]
    begin, length = begin[wet][:, None], length[wet][:, None]
    if slope == 0 and isinstance(arc, Line) and arc.slope == 0:
        # A cylinder parallel to the surface has constant sections: the midpoint rule is exact.
        return row, begin + length / 2, length
    # Substitution u = low + long sin^2 v, du = long sin(2 v) dv, removes the square roots at both
    # ends.
    angle, share = panels((0.0, np.pi / 2), nodes)
    return row, begin + length * np.sin(angle) ** 2, length * (np.sin(2 * angle) * share)


def revolved(arc, start, integrands):
    """Return integrals (integrands, rows) over x along an arc of revolution.

    Parameters
    ----------
    arc : Line or EllipseArc
    start : ndarray, shape (rows,)
        Parameters at which the integrals start, limited to the range of the arc.
    integrands : sequence of callable
        Functions of (arc, parameter).

    Returns
    -------
    ndarray, shape (integrands, rows)

    Examples
    --------
    Half a sphere of radius 1, pi r^2 as the integrand:

    >>> half = EllipseArc(0.0, np.pi / 2, 0.0, 0.0, 1.0, 1.0)
    >>> square = lambda arc, u: np.pi * arc.at(u)[1] ** 2
    >>> revolved(half, np.zeros(1), [square]).round(6).tolist()
    [[2.094395]]
    """
    begin = np.clip(np.asarray(start, dtype=float), arc.start, arc.stop)[:, None]
    share, weight = panels((0.0, 1.0), NODES)
    parameter = begin + (arc.stop - begin) * share
    _, _, step = arc.at(parameter)
    weight = weight * (arc.stop - begin) * step
    return np.array(
        [np.sum(weight * integrand(arc, parameter), axis=1) for integrand in integrands]
    )
