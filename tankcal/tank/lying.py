"""Lying tanks: pieces along an axis, a liquid whose surface cuts them, and a cylinder of rings.

The volumes and free surfaces of arcs (`heads`), at the position s along the axis, are below a
surface at

    c(s) = c_p - tilt (s - p),   c_p = -r + d stretch,   d the dip, r the radius at its zero p,

above the axis. Lengths are those of a round tank; a tank of other section is scaled to it in
height.

Lying cylinder of rings
-----------------------

The rings are coaxial. The tilt m is above zero if B is higher. For a plumb dip h that touches the
bottom of the ring at s = p, of radius R_p, with cos the cosine of the tilt, the liquid has the
depth

    depth(s) = (p - s) m + h / cos + R_i - R_p,   0 <= depth <= 2 R_i,

perpendicular to the axis in ring i. The quadrature has breaks at joints and where the surface meets
the bottom or the top of a ring (`heads.integrate`).
"""

from dataclasses import dataclass
from functools import cached_property
from operator import methodcaller

import numpy as np

from tankcal.errors import HeightError, SolutionError
from tankcal.messages import message
from tankcal.tank.heads import (
    CHORD,
    CHORD_MOMENT,
    RADII,
    SEGMENT,
    Cut,
    EllipseArc,
    End,
    Line,
    depth_of,
    integrate,
    meridian,
)
from tankcal.tank.parts import Solid

ROUNDING = 1e-9  # relative to the highest dip: a smaller excess is rounding
FLAT = End("flat")
WAVES = tuple(range(2, 13))  # orders of departures from a circle in the derivatives of rows


@dataclass(frozen=True)
class Piece:
    """Arc of the meridian at its position along the axis, s = origin + way x.

    Attributes
    ----------
    arc : Line or EllipseArc
    origin_m : float
    way, sign : int
        Direction of x along the axis; sign -1 for a volume that an end takes from the tank.
    end : str
        "a" or "b"; "" for the cylinder.
    ring : int
        Ring of the cylinder, from A on; for an end, the ring that carries it.
    """

    arc: Line | EllipseArc
    origin_m: float
    way: int
    sign: int
    end: str
    ring: int = 0


class LyingSolid(Solid):
    """Lying tank as the sum of `Piece`s.

    Subclasses define `tilt`, `dip_from_a_m`, `dip_direction`, `top_m`, `_pieces`, and `_radius_m`,
    the radius at the zero of the dips.
    """

    _squeeze = 1.0  # ratio of heights of the round tank to heights of this tank
    _has_twins = False  # whether both ends have equal volumes at any dip

    @cached_property
    def capacity_m3(self):
        """Volume of the full tank, m3."""
        full = np.array([2 * max(piece.arc.at(piece.arc.start)[1] for piece in self._pieces)])
        volumes = (piece.sign * integrate(piece.arc, full, 0.0, [SEGMENT])[0, 0]
                 for piece in self._pieces)  # fmt: skip
        return float(sum(volumes))

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each dip."""
        return self._sum(levels_m, SEGMENT)

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of the volume by the dip; plumb: the free surface."""
        # Chain rule: dip to depth, depth to the height in the round tank, height to volume.
        return self._squeeze * self._depth_slope * self._sum(levels_m, CHORD)

    def depth_m(self, levels_m):
        """Return depths (rows,), perpendicular to the axis, in the section of the dip."""
        return self._stretch * np.asarray(levels_m, dtype=float)

    def _sum(self, levels_m, integrand):
        """Return the integral (rows,) over the whole tank.

        Equal ends of a level tank are integrated once.
        """
        pieces, twins = self._pieces, self._has_twins
        if twins:
            pieces = [piece for piece in pieces if piece.end != "b"]
        return sum(
            (2 if twins and piece.end == "a" else 1)
            * self._integrals(piece, levels_m, [integrand])[0]
            for piece in pieces
        )

    def _integrals(self, piece, levels_m, integrands):
        """Return integrals (integrands, rows) over a piece of the round tank."""
        level = self._liquid_m(levels_m, piece.origin_m)
        slope = piece.way * self._squeeze * self.tilt
        return piece.sign * integrate(piece.arc, level, slope, integrands)

    def _moment(self, piece, surface, surface_moment):
        """Return the moment of the free surface of a piece about the position of the dip."""
        return (piece.origin_m - self.dip_from_a_m) * surface + piece.way * surface_moment

    def _section_m2(self, levels_m, s, ring=0):
        """Return the wet area (rows,) of the section of a ring of the cylinder at s."""
        arc = self._pieces[ring].arc
        return Cut(arc, s, s, arc.radius_m, self._liquid_m(levels_m, s)).segment()

    def _liquid_m(self, levels_m, s):
        """Return the height (rows,) of the liquid above the axis at s, in the round tank."""
        levels = levels_inside(levels_m, self._highest_m)
        # The surface is level, so relative to the tilted axis it falls by the tilt per metre.
        above_dip_zero = self.depth_m(levels) - self.tilt * (s - self.dip_from_a_m)
        return self._squeeze * above_dip_zero - self._radius_m

    @property
    def _highest_m(self):
        """Highest valid dip."""
        return self.top_m

    @property
    def _depth_slope(self):
        """Derivative of the depth by the dip."""
        return self._stretch

    @property
    def _stretch(self):
        """Ratio of heights perpendicular to the axis to dips."""
        return np.hypot(1.0, self.tilt) if self.dip_direction == "plumb" else 1.0


def pieces_of_ends(ends, length_m, last_ring=0, upward=1.0):
    """Yield the `Piece`s of the ends.

    Parameters
    ----------
    ends : pair of (End, float)
        End, and radius of the cylinder there, of A and of B.
    length_m : float
        Length of the cylinder.
    last_ring : int, optional
        Ring that carries end B.
    upward : float, optional
        As for `heads.meridian`.
    """
    places = ("a", 0.0, -1, 0), ("b", length_m, 1, last_ring)
    for (end, radius), (name, origin, outwards, ring) in zip(ends, places, strict=True):
        sign = -1 if end.inward else 1
        for arc in meridian(end, radius, upward):
            yield Piece(arc, origin, sign * outwards, sign, name, ring)


def refuse_meeting_ends(ends, length_m):
    """Raise SolutionError for inward ends that meet; arguments as for `pieces_of_ends`."""
    depths = [(depth_of(*item), item[0]) for item in ends]
    inward = sum(depth for depth, end in depths if end.inward)
    if inward > length_m:
        raise SolutionError(
            message(
                "ends_meet",
                "ends that bulge {inward_m:g} m inwards meet in a cylinder of {length_m:g} m",
                inward_m=inward,
                length_m=length_m,
            )
        )


def check_directions(dip_direction, tilt, roll_rad=0.0):
    """Raise SolutionError for an unknown direction of the dip, or angles that are not finite.

    Parameters
    ----------
    dip_direction : str
        "plumb" or "square".
    tilt : float
        Tangent of the tilt.
    roll_rad : float, optional
    """
    if dip_direction not in ("plumb", "square"):
        raise SolutionError(f"dip direction {dip_direction!r}: expected plumb or square")
    if not np.isfinite(tilt) or not np.isfinite(roll_rad):
        raise SolutionError(f"tilt {tilt} and roll {roll_rad}: expected numbers")


def check_dip(dip_from_a_m, dip_direction, shift_m, length_m):
    """Raise SolutionError for a dip outside the cylinder.

    Parameters
    ----------
    dip_from_a_m : float
        Position of the zero of the dip along the cylinder.
    dip_direction : str
        "plumb" or "square".
    shift_m : float
        Additional distance from A of a plumb dip at the top.
    length_m : float
        Length of the cylinder.
    """
    low, high = dip_from_a_m, dip_from_a_m
    if dip_direction == "plumb":
        high += shift_m
    slack = ROUNDING * length_m
    # The tolerance permits a dip exactly at an end of the cylinder.
    if min(low, high) < -slack or max(low, high) > length_m + slack:
        raise SolutionError(
            message(
                "dip_off_cylinder",
                "the dip touches the bottom {low_m:g} m and leaves the top {high_m:g} m from "
                "the start of the cylinder: expected both between 0 and {length_m:g} m",
                low_m=low,
                high_m=high,
                length_m=length_m,
            )
        )


def levels_inside(levels_m, top_m):
    """Return the levels as an array; raise HeightError for a level outside the tank."""
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


def require_length(name, length_m):
    """Raise SolutionError for a length that is not above zero."""
    if not 0 < length_m < np.inf:
        raise SolutionError(f"{name} {length_m:g} m: expected a length above zero")


@dataclass(frozen=True)
class RingedTank(LyingSolid):
    """Lying, tilted cylinder of coaxial rings between two ends.

    The zero is the bottom of the ring at dip_from_a_m, where the plumb line touches it. In a tilted
    tank or a wider ring, liquid may be below the zero, so the volume at dip 0 may be above zero.
    There may also be room above the highest dip, where the plumb line meets the top.

    Attributes
    ----------
    radii_m, lengths_m : tuple of float
        Inside radius and length of each ring from end A to end B.
    end_a, end_b : End
        Ends on the first and on the last ring.
    tilt : float
        Tangent of the angle by which the axis rises from A to B (negative: falls).
    dip_from_a_m : float
        Position of the zero of the dip, along the axis from the start of the cylinder at A.
    dip_direction : str
        "plumb": the dip is read along the vertical; "square": perpendicular to the axis.

    Raises
    ------
    SolutionError
        For impossible dimensions.

    References
    ----------
    Jones 2001, Computing fluid tank volumes (one ring, untilted).

    Examples
    --------
    >>> tank = RingedTank((1.2, 1.192, 1.2), (3.0, 3.0, 3.0), tilt=0.010, dip_from_a_m=1.5)
    >>> (1000 * tank.volume_m3([0.0, 1.2, 2.4])).round(3).tolist()
    [2.274, 19622.296, 40420.54]
    """

    radii_m: tuple[float, ...]
    lengths_m: tuple[float, ...]
    end_a: End = FLAT
    end_b: End = FLAT
    tilt: float = 0.0
    dip_from_a_m: float = 0.0
    dip_direction: str = "plumb"

    def __post_init__(self):
        if not self.radii_m or len(self.radii_m) != len(self.lengths_m):
            raise SolutionError(
                f"{len(self.radii_m)} radii of {len(self.lengths_m)} lengths: expected one ring or"
                " more, each with both"
            )
        for radius, length in zip(self.radii_m, self.lengths_m, strict=True):
            require_length("radius", radius)
            require_length("length", length)
        check_directions(self.dip_direction, self.tilt)
        refuse_meeting_ends(self._ends, self.length_m)
        shift = (self._radius_m + self._radius_at_top_m) * self.tilt
        check_dip(self.dip_from_a_m, self.dip_direction, shift, self.length_m)

    @cached_property
    def joints_m(self):
        """Positions (rings + 1,) of the joints along the axis."""
        return np.concatenate([[0.0], np.cumsum(self.lengths_m)])

    @property
    def length_m(self):
        """Length of the cylinder."""
        return float(self.joints_m[-1])

    @property
    def width_m(self):
        """Mean inside diameter along the cylinder."""
        return 2 * float(np.average(self.radii_m, weights=self.lengths_m))

    @property
    def height_m(self):
        """Mean inside diameter: each ring is round."""
        return self.width_m

    @property
    def top_m(self):
        """Highest dip, where its line meets the top."""
        return (self._radius_m + self._radius_at_top_m) * self._stretch

    @property
    def zero_ring(self):
        """Index of the ring at the zero of the dip."""
        return self._ring_at(self.dip_from_a_m)

    @property
    def left_m3(self):
        """Remaining room when the liquid reaches the highest dip."""
        return self.capacity_m3 - float(self.volume_m3([self.top_m])[0])

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) or (rows, k) of the volume at a fixed dip}.

        ring_radii       (rows, rings) each ring separately; the ring of the dip also moves the zero
        dip_radius       radius of the wall only where the dip touches it
        ring_waves       (rows, rings x WAVES) wave cos(k a) of a ring, a from its bottom, the waves
                         of a ring together; the ring of the dip also moves the zero
        ring_lengths     (rows, rings) each ring separately; the rings beyond move, A and the dip do
                         not
        ring_axes        (rows, rings) height of the axis of each ring above the common axis
        end_depth, dish, knuckle, tilt, dip_position, datum, scale
                         as for `solids.LyingTank`
        plate_thickness  thickness subtracted from outside measurements: reduces all radii and the
                         depths of the ends, but not the lengths
        paint            thickness subtracted from the radii alone
        """
        integrands = [SEGMENT, CHORD, CHORD_MOMENT]
        inputs = ("radius", "end_depth", "end_plate", *RADII)
        integrands += [methodcaller("by", name) for name in inputs]
        cylinder = [*integrands, *(methodcaller("by_wave", order) for order in WAVES)]
        integrals = [
            (piece, self._integrals(piece, levels_m, integrands if piece.end else cylinder))
            for piece in self._pieces
        ]
        rings = len(self.radii_m)
        volume, surface, by_depth, by_dish, by_knuckle = (
            sum(values[i] for _, values in integrals) for i in (0, 1, 4, 6, 7)
        )
        by_plate = sum(piece.sign * values[5] for piece, values in integrals)
        moment = sum(self._moment(piece, values[1], values[2]) for piece, values in integrals)
        by_ring = np.zeros((2, len(surface), rings))  # surface, and by the radius
        for piece, values in integrals:
            by_ring[:, :, piece.ring] += values[[1, 3]]
        # The waves exist only in the cylinder, not in the ends.
        waves = np.stack([values[8:].T for piece, values in integrals if not piece.end], axis=1)
        is_dip_ring = np.eye(rings)[self.zero_ring]
        zero = -surface[:, None] * is_dip_ring  # of what moves the bottom of the dip's ring
        by_radii = by_ring[1] + zero
        # A rise of the ring of the dip lowers the liquid everywhere: the zero moves with it.
        datum = self._stretch * surface
        by_stretch = self.tilt / self._stretch if self.dip_direction == "plumb" else 0.0
        levels = np.asarray(levels_m, dtype=float)
        surface_of_b = sum(values[1] * (piece.end == "b") for piece, values in integrals)
        return {
            "ring_radii": by_radii,
            "dip_radius": -surface,
            "ring_waves": (waves + zero[:, :, None]).reshape(len(surface), -1),
            "ring_lengths": self._length_derivatives(levels, by_ring[0], surface_of_b),
            "ring_axes": -by_ring[0] - zero,
            "end_depth": by_depth,
            "dish": by_dish,
            "knuckle": by_knuckle,
            "tilt": by_stretch * levels * surface - moment,
            "dip_position": self.tilt * surface,
            "plate_thickness": by_plate - by_radii.sum(axis=1),
            "paint": -by_radii.sum(axis=1),
            "datum": datum,
            "scale": 3 * volume - levels * datum,
        }

    def _length_derivatives(self, levels, surface, of_end_b):
        """Return derivatives (rows, rings) by the length of each ring.

        surface (rows, rings) includes the ends; of_end_b (rows,) is the surface of end B alone
        """
        rings = surface.shape[1]
        later_surface = np.cumsum(surface[:, ::-1], axis=1)[:, ::-1] - surface  # sum of later rings
        later_surface[:, -1] = of_end_b
        sections = [self._section_m2(levels, self.joints_m[i + 1], i) for i in range(rings)]
        return np.column_stack(sections) - self.tilt * later_surface

    @cached_property
    def _pieces(self):
        by_input = {"radius": (1.0, 0.0)}
        cylinder = (
            Piece(Line(start, stop, radius, 0.0, by_input), 0.0, 1, 1, "", ring)
            for ring, (start, stop, radius) in enumerate(
                zip(self.joints_m[:-1], self.joints_m[1:], self.radii_m, strict=True)
            )
        )
        return *cylinder, *pieces_of_ends(self._ends, self.length_m, len(self.radii_m) - 1)

    @property
    def _ends(self):
        return (self.end_a, self.radii_m[0]), (self.end_b, self.radii_m[-1])

    @property
    def _radius_m(self):
        return self.radii_m[self.zero_ring]

    @property
    def _radius_at_top_m(self):
        """Radius of the ring whose top the line of the dip meets."""
        # A plumb line in a tilted tank is farther from A at the top than at the bottom.
        shift = 2 * self._radius_m * self.tilt if self.dip_direction == "plumb" else 0.0
        return self.radii_m[self._ring_at(self.dip_from_a_m + shift)]

    @property
    def _highest_m(self):
        """Highest valid dip: that of the full tank, or the top if higher.

        A pipe above the top may read dips above the top.
        """
        depths = [depth_of(*item) for item in self._ends]
        low, high = -depths[0] - self.dip_from_a_m, self.length_m + depths[1] - self.dip_from_a_m
        # Highest point of the inside above the axis at the dip: a full tank reaches it.
        highest_point = max(self.radii_m) + abs(self.tilt) * max(-low, high)
        return max(self.top_m, (highest_point + self._radius_m) / self._stretch)

    def _ring_at(self, s):
        """Return the index of the ring at the position s."""
        ring = int(np.searchsorted(self.joints_m, s, side="right")) - 1
        return min(max(ring, 0), len(self.radii_m) - 1)
