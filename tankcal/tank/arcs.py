"""Arcs of a meridian, and the volume that a plane cuts off a solid of revolution.

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

from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from tankcal.quadrature import panels

NODES = 24  # Gauss nodes of each panel


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


def integrate(arc, level_m, slope, integrands, nodes=NODES):
    """Return integrals (integrands, rows) over x along an arc, below the line level_m - slope x.

    If the centres of the sections rise, the line falls more steeply relative to them.

    Parameters
    ----------
    arc : Line or EllipseArc
    level_m : ndarray, shape (rows,)
        Height of the liquid above the axis at x = 0, m.
    slope : float
        Fall of that height per metre of x.
    integrands : sequence of callable
        Functions of a `Cut`, such as Cut.segment.
    nodes : int, optional
        Gauss nodes of each panel.

    Returns
    -------
    ndarray, shape (integrands, rows)
    """
    level_m, slope = np.asarray(level_m, dtype=float), slope + arc.lift
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


def revolved(arc, start, integrands, nodes=NODES):
    """Return integrals (integrands, rows) over x along an arc of revolution.

    Parameters
    ----------
    arc : Line or EllipseArc
    start : ndarray, shape (rows,)
        Parameters at which the integrals start, limited to the range of the arc.
    integrands : sequence of callable
        Functions of (arc, parameter).
    nodes : int, optional
        Gauss nodes.

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
    share, weight = panels((0.0, 1.0), nodes)
    parameter = begin + (arc.stop - begin) * share
    _, _, step = arc.at(parameter)
    weight = weight * (arc.stop - begin) * step
    return np.array(
        [np.sum(weight * integrand(arc, parameter), axis=1) for integrand in integrands]
    )
