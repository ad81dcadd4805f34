"""Tanks that are one solid: the lying cylinder with its ends, and the sphere.

Both are parts of a capacity: volumes, free surfaces and derivatives at any dips. The dips of this
room count from the inside bottom, in metres; dips outside the tank raise HeightError.
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from tankcal.errors import HeightError, SolutionError
from tankcal.messages import message
from tankcal.tank.arcs import Cut, EllipseArc, Line, integrate
from tankcal.tank.gauge_tubes import GaugeTube
from tankcal.tank.heads import RADII, End, depth_of, meridian
from tankcal.tank.parts import Part

ROUNDING = 1e-9  # of the highest dip: a dip so little outside is the top or the bottom itself
FLAT = End("flat")
TUBE = ("tube_angle", "tube_offset")  # inputs of a gauge tube


@dataclass(frozen=True)
class LyingTank(Part):
    """A lying cylinder, round or elliptical, between two ends, tilted and rolled: exact.

    The zero is the lowest point of the section at dip_from_a_m, where the plumb line touches the
    bottom; in a tilted tank liquid may lie lower, so the volume at dip 0 may be above zero. With
    level c_p above the axis in that section, B the half height of the rolled section and a dip d,

        c_p = -B + d (square),   c_p = -B + d sqrt(1 + tilt^2) (plumb),   c(s) = c_p - tilt (s - p).

    The highest dip is where its line meets the top of the cylinder: 2 B, plumb 2 B sqrt(1+tilt^2).
    With a gauge tube off the axis or off the plumb, of a round tank only, c_p = depth(d) - B, its
    d times sqrt(1 + tilt^2) where it is read plumb (`GaugeTube`).
    Sections of an end are similar to that of the cylinder. An elliptical tank is computed as the
    round one of equal section area, with heights times sqrt(width height) / (2 B), which is exact;
    the radii and the spherical form of an end are those of that round tank.

    Attributes
    ----------
    width_m, height_m : float
        Inside axes of the section, square to the axis; equal when it is round.
    length_m : float
        Inside length of the cylinder, without its ends.
    end_a, end_b : End
        Each of its own kind and size.
    tilt : float
        Tan of the angle by which the axis rises from A to B (negative: falls).
    roll_rad : float
        Turn of the section about the axis; of no effect when it is round.
    dip_from_a_m : float
        Place of the dip's zero, along the axis from the start of the cylinder at A.
    dip_direction : str
        "plumb": the dip is read along the vertical; "square": square to the axis.
    tube_angle_rad : float
        Of the gauge tube off the plumb, in the plane of the section; its top leans to the right as
        seen from A. 0: plumb.
    tube_offset_m : float
        Distance at which the tube passes the axis, to the right of it as seen from A, when plumb.

    Raises
    ------
    SolutionError
        For sizes that make no tank.

    References
    ----------
    Jones 2001, Computing fluid tank volumes (untilted); the tilt by quadrature, `heads`.
    """

    width_m: float
    height_m: float
    length_m: float
    end_a: End = FLAT
    end_b: End = FLAT
    tilt: float = 0.0
    roll_rad: float = 0.0
    dip_from_a_m: float = 0.0
    dip_direction: str = "plumb"
    tube_angle_rad: float = 0.0
    tube_offset_m: float = 0.0

    def __post_init__(self):
        _above_zero("width", self.width_m)
        _above_zero("height", self.height_m)
        _above_zero("length", self.length_m)
        if self.dip_direction not in ("plumb", "square"):
            raise SolutionError(f"dip direction {self.dip_direction!r}: expected plumb or square")
        if not np.isfinite(self.tilt) or not np.isfinite(self.roll_rad):
            raise SolutionError(f"tilt {self.tilt} and roll {self.roll_rad}: expected numbers")
        self._check_round()
        depths = [(depth_of(end, self._radius_m), end) for end in (self.end_a, self.end_b)]
        inward = sum(depth for depth, end in depths if end.inward)
        if inward > self.length_m:
            raise SolutionError(
                message(
                    "ends_meet",
                    "ends that bulge {inward_m:g} m inwards meet in a cylinder of {length_m:g} m",
                    inward_m=inward,
                    length_m=self.length_m,
                )
            )
        self._check_dip()

    def _check_round(self):
        """What only a round section has: a tube off its axis, and a rolled guppy end."""
        ends = {self.end_a.kind, self.end_b.kind}
        if self._is_round:
            GaugeTube(self._radius_m, self.tube_angle_rad, self.tube_offset_m)
        elif self._has_tube or (self.roll_rad and "guppy" in ends):
            raise SolutionError(
                message(
                    "round_section_only",
                    "a section {width_m:g} m wide and {height_m:g} m high: expected a round one, "
                    "for a gauge tube off the axis or the plumb, or rolled guppy ends",
                    width_m=self.width_m,
                    height_m=self.height_m,
                )
            )

    def _check_dip(self):
        low, high = self.dip_from_a_m, self.dip_from_a_m
        if self.dip_direction == "plumb":
            high += 2 * self._half_height_m * self.tilt
        slack = ROUNDING * self.length_m
        if min(low, high) < -slack or max(low, high) > self.length_m + slack:
            raise SolutionError(
                message(
                    "dip_off_cylinder",
                    "the dip touches the bottom {low_m:g} m and leaves the top {high_m:g} m from "
                    "the start of the cylinder: expected both between 0 and {length_m:g} m",
                    low_m=low,
                    high_m=high,
                    length_m=self.length_m,
                )
            )

    @property
    def top_m(self):
        """The highest dip."""
        if self._has_tube:
            return self._tube.full_m * self._stretch
        return 2 * self._half_height_m * self._stretch

    def depth_m(self, levels_m):
        """(rows,) depths square to the axis above the lowest point of the section of each dip."""
        along = self._stretch * np.asarray(levels_m, dtype=float)
        return self._tube.depth_m(along) if self._has_tube else along

    def height_share(self, levels_m):
        """(rows,) the plumb dip of each depth as a share of the highest one, and its slope."""
        high = 2 * self._half_height_m * self._stretch**2  # of the depth at that dip
        return self.depth_m(levels_m) / high, self._stretch * self._tube.slope / high

    @cached_property
    def capacity_m3(self):
        """Volume of the full tank."""
        full = np.array([2 * self._radius_m])
        pieces = self._pieces
        return float(sum(p.sign * integrate(p.arc, full, 0.0, [Cut.segment])[0, 0] for p in pieces))

    def volume_m3(self, levels_m):
        """(rows,) volume below each dip."""
        return self._sum(levels_m, Cut.segment)

    def area_m2(self, levels_m):
        """(rows,) derivative of the volume by the dip; the free surface, when the dip is plumb."""
        return self._squeeze * self._stretch * self._tube.slope * self._sum(levels_m, Cut.chord)

    def derivatives(self, levels_m):
        """{input: (rows,)} derivative of the volume at a fixed dip by each input, all else fixed.

        diameter         width and height both; ends keep their depths (torispherical: their radii)
        length           of the cylinder; B moves away, A and the place of the dip stay
        end_depth        of both ends, each the way it bulges; flat ends have none, torispherical
                         ones of given radii are stretched along the axis
        dish_radius, knuckle_radius  of both ends, where torispherical ones were given by them
        tube_angle, tube_offset      of the gauge tube, of a round tank only
        tilt             the tangent; the dip's zero stays where it is
        dip_position     dip_from_a_m
        plate_thickness  of plates that were taken off outside measures: the diameter is less by
                         twice, each end less deep (or of less radii) by once, more if inward;
                         the length stays
        datum            height of the liquid at a given dip
        scale            of all lengths of the tank and the place of the dip, but not of the dips
        """
        integrands = [Cut.segment, Cut.chord, Cut.chord_moment]
        inputs = ("radius", "end_depth", "end_plate", *RADII)
        integrands += [partial(Cut.by, name=name) for name in inputs]
        found = [(piece, self._integrals(piece, levels_m, integrands)) for piece in self._pieces]
        volume, surface, _, by_radius, by_depth, _, by_dish, by_knuckle = sum(
            one for _, one in found
        )
        moment = sum(  # of the free surface about the place of the dip
            (piece.origin_m - self.dip_from_a_m) * one[1] + piece.way * one[2]
            for piece, one in found
        )
        surface_of_b = sum(one[1] for piece, one in found if piece.end == "b")
        by_plate = sum(piece.sign * one[5] for piece, one in found)
        levels = np.asarray(levels_m, dtype=float)
        squeeze, tilt, stretch, slope = self._squeeze, self.tilt, self._stretch, self._tube.slope
        by_stretch = tilt / stretch * slope if self.dip_direction == "plumb" else 0.0
        datum = squeeze * stretch * slope * surface
        by_squeeze = stretch * levels * surface - tilt * moment
        by_tube = self._tube.derivatives(stretch * levels)
        radius_by, squeeze_by = self._by_diameter
        by_radius = by_radius - (1 - by_tube["radius"]) * surface
        diameter = radius_by * by_radius + squeeze_by * by_squeeze
        of_tube = {name: by_tube[name] * surface for name in TUBE if self._is_round}
        return of_tube | {
            "diameter": diameter,
            "length": self._section_m2(levels, self.length_m) - squeeze * tilt * surface_of_b,
            "end_depth": by_depth,
            "dish": by_dish,
            "knuckle": by_knuckle,
            "tilt": squeeze * (by_stretch * levels * surface - moment),
            "dip_position": squeeze * tilt * surface,
            "plate_thickness": by_plate - 2 * diameter,
            "datum": datum,
            "scale": 3 * volume - levels * datum,
        }

    @cached_property
    def _pieces(self):
        """Arcs of the meridian with their place along the axis, s = origin + way x."""
        barrel = Line(0.0, self.length_m, self._radius_m, 0.0, {"radius": (1.0, 0.0)})
        pieces = [_Piece(barrel, 0.0, 1, 1, "")]
        ends = (("a", self.end_a, 0.0, -1), ("b", self.end_b, self.length_m, 1))
        for name, end, origin, out in ends:
            sign = -1 if end.inward else 1
            for arc in meridian(end, self._radius_m, np.cos(self.roll_rad)):
                pieces.append(_Piece(arc, origin, sign * out, sign, name))
        return tuple(pieces)

    def _sum(self, levels_m, integrand):
        """(rows,) integral over the whole tank; equal ends of a level one are integrated once."""
        pieces, twins = self._pieces, self.tilt == 0 and self.end_a == self.end_b
        if twins:
            pieces = [piece for piece in pieces if piece.end != "b"]
        return sum(
            (2 if twins and piece.end == "a" else 1)
            * self._integrals(piece, levels_m, [integrand])[0]
            for piece in pieces
        )

    def _integrals(self, piece, levels_m, integrands):
        """(integrands, rows) over one piece, of the round tank."""
        level = self._liquid_m(levels_m, piece.origin_m)
        slope = piece.way * self._squeeze * self.tilt
        return piece.sign * integrate(piece.arc, level, slope, integrands)

    def _section_m2(self, levels_m, s):
        """(rows,) wet part of the cylinder's section at s."""
        barrel = self._pieces[0].arc
        return Cut(barrel, s, s, self._radius_m, self._liquid_m(levels_m, s)).segment()

    def _liquid_m(self, levels_m, s):
        """(rows,) height of the liquid above the axis at s, in the round tank of equal area."""
        levels = _inside(levels_m, self.top_m)
        above_dip_zero = self.depth_m(levels) - self.tilt * (s - self.dip_from_a_m)
        return self._squeeze * above_dip_zero - self._radius_m

    @property
    def _has_tube(self):
        """Whether the dip is not that of the lowest point of the section."""
        return bool(self.tube_angle_rad or self.tube_offset_m)

    @property
    def _is_round(self):
        return self.width_m == self.height_m

    @cached_property
    def _tube(self):
        return GaugeTube(self._radius_m, self.tube_angle_rad, self.tube_offset_m)

    @cached_property
    def _radius_m(self):
        """Radius of the round tank of equal section area."""
        return np.sqrt(self.width_m * self.height_m) / 2

    @cached_property
    def _half_height_m(self):
        """Half height B of the rolled section: B^2 = (w/2)^2 sin^2 roll + (h/2)^2 cos^2 roll."""
        sin, cos = np.sin(self.roll_rad), np.cos(self.roll_rad)
        return np.hypot(self.width_m * sin, self.height_m * cos) / 2

    @property
    def _squeeze(self):
        """Heights of the round tank to heights of this one."""
        return self._radius_m / self._half_height_m

    @property
    def _by_diameter(self):
        """Derivatives of the round tank's radius and of the squeeze by width and height both."""
        sin2, cos2 = np.sin(self.roll_rad) ** 2, np.cos(self.roll_rad) ** 2
        radius = (self.width_m + self.height_m) / (8 * self._radius_m)
        half = (self.width_m * sin2 + self.height_m * cos2) / (4 * self._half_height_m)
        return radius, (radius - self._squeeze * half) / self._half_height_m

    @property
    def _stretch(self):
        """Heights square to the axis to dips."""
        return np.hypot(1.0, self.tilt) if self.dip_direction == "plumb" else 1.0


@dataclass(frozen=True)
class _Piece:
    arc: Line | EllipseArc
    origin_m: float
    way: int
    sign: int
    end: str


@dataclass(frozen=True)
class Sphere(Part):
    """A spherical tank; dips count from its lowest inside point: V = pi d^2 (3 R - d) / 3.

    Attributes
    ----------
    diameter_m : float
        Inside.

    Raises
    ------
    SolutionError
        For a diameter that is not above zero.

    References
    ----------
    API MPMS 2.2D; closed form.

    Examples
    --------
    >>> Sphere(2.0).volume_m3([1.0, 2.0]).round(4).tolist()
    [2.0944, 4.1888]
    """

    diameter_m: float

    def __post_init__(self):
        _above_zero("diameter", self.diameter_m)

    @property
    def top_m(self):
        """The highest dip."""
        return self.diameter_m

    @property
    def capacity_m3(self):
        """Volume of the full tank, pi D^3 / 6."""
        return np.pi * self.diameter_m**3 / 6

    def height_share(self, levels_m):
        """(rows,) levels as a share of the height, and its slope."""
        return np.asarray(levels_m, dtype=float) / self.diameter_m, 1 / self.diameter_m

    def volume_m3(self, levels_m):
        """(rows,) volume below each dip."""
        d = _inside(levels_m, self.top_m)
        return np.pi * d**2 * (1.5 * self.diameter_m - d) / 3

    def area_m2(self, levels_m):
        """(rows,) free surface, pi d (D - d)."""
        d = _inside(levels_m, self.top_m)
        return np.pi * d * (self.diameter_m - d)

    def derivatives(self, levels_m):
        """{input: (rows,)} derivative of the volume at a fixed dip by each input.

        diameter         the lowest point, from which dips count, goes with it
        plate_thickness  of a plate that was taken off an outside diameter: twice
        datum            height of the liquid at a given dip
        scale            of the diameter, but not of the dips
        """
        d = _inside(levels_m, self.top_m)
        by_diameter = np.pi * d**2 / 2
        return {
            "diameter": by_diameter,
            "plate_thickness": -2 * by_diameter,
            "datum": self.area_m2(levels_m),
            "scale": self.diameter_m * by_diameter,
        }


def _inside(levels_m, top_m):
    levels = np.asarray(levels_m, dtype=float)
    slack = ROUNDING * top_m
    outside = ~((levels >= -slack) & (levels <= top_m + slack))
    if np.any(outside):
        raise HeightError(
            message(
                "dip_outside_tank",
                "dip {dip_m:g} m is outside the tank (0 to {top_m:g} m)",
                dip_m=levels[outside][0],
                top_m=top_m,
            )
        )
    return levels


def _above_zero(name, length_m):
    if not 0 < length_m < np.inf:
        raise SolutionError(f"{name} {length_m:g} m: expected a length above zero")
