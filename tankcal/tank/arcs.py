"""Arcs of a meridian, and what a plane cuts off a solid of revolution.

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
from types import MappingProxyType

import numpy as np

from tankcal.quadrature import panels

NODES = 24  # of each panel


@dataclass(frozen=True)
class Line:
    """A straight piece of a meridian, r = radius_m + slope x; its parameter is x, m.

    Attributes
    ----------
    lift : float
        Rise of the sections' centres above the axis by metre of x, as an oblique cone has it.
    by_input : dict
        {input: derivative of (radius_m, slope) by it}.
    lift_by : dict
        {input: derivative of the lift by it}.
    """

    start: float
    stop: float
    radius_m: float
    slope: float = 0.0
    by_input: dict = field(default_factory=dict)
    lift: float = 0.0
    lift_by: dict = field(default_factory=dict)

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
    lift = 0.0
    lift_by = MappingProxyType({})

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
class Cut:
    """Sections of one arc and the liquid in them; arrays of one shape.

    Attributes
    ----------
    parameter : ndarray
        Of the arc, of which the sections are.
    x_m, radius_m : ndarray
        Place and radius of each section.
    height_m : ndarray
        Of the liquid's surface above the centre of each section.
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

    def by(self, name):
        """Derivative of S by an input of the arc, m2 per m."""
        found = self.arc.square_by(name, self.parameter) * self.wet_angle()
        lifted = self.arc.lift_by.get(name)
        return found if lifted is None else found - lifted * self.chord_moment()

    def by_wave(self, order):
        """Derivative of S by a wave cos(order a) of the radius, a from the bottom, m2 per m."""
        return 2 * self.radius_m * np.sin(order * self.wet_angle()) / order

    def _above_bottom(self):
        return np.maximum(self.radius_m + self.height_m, 0.0)

    def _below_top(self):
        return np.maximum(self.radius_m - self.height_m, 0.0)


def integrate(arc, level_m, slope, integrands, nodes=NODES):
    """Integrals over x along an arc, below the line level_m - slope x: (integrands, rows).

    Where the sections' centres rise, the line falls by as much more against them.

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
    level_m, slope = np.asarray(level_m, dtype=float), slope + arc.lift
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


def revolved(arc, start, integrands, nodes=NODES):
    """Integrals over x along an arc turned about its axis, from some place on: (integrands, rows).

    Parameters
    ----------
    arc
        Line or EllipseArc.
    start : ndarray, shape (rows,)
        Values of its parameter; before the arc's own start counts as that.
    integrands
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
    low = np.clip(np.asarray(start, dtype=float), arc.start, arc.stop)[:, None]
    share, weight = panels((0.0, 1.0), nodes)
    parameter = low + (arc.stop - low) * share
    _, _, step = arc.at(parameter)
    weight = weight * (arc.stop - low) * step
    return np.array([np.sum(weight * one(arc, parameter), axis=1) for one in integrands])
