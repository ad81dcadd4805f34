"""Common base of lying tanks: pieces along an axis, and a liquid whose surface cuts them.

The volumes and free surfaces of `arcs`, at the position s along the axis, are below a surface at

    c(s) = c_p - tilt (s - p),   c_p = -r + d stretch,   d the dip, r the radius at its zero p,

above the axis. Lengths are those of a round tank; a tank of other section is scaled to it in
height.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.errors import HeightError, SolutionError
from tankcal.messages import message
from tankcal.tank.arcs import Cut, EllipseArc, Line, integrate
from tankcal.tank.heads import depth_of, meridian
from tankcal.tank.parts import Solid

ROUNDING = 1e-9  # relative to the highest dip: a smaller excess is rounding


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
        volumes = (piece.sign * integrate(piece.arc, full, 0.0, [Cut.segment])[0, 0]
                 for piece in self._pieces)  # fmt: skip
        return float(sum(volumes))

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each dip."""
        return self._sum(levels_m, Cut.segment)

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of the volume by the dip; plumb: the free surface."""
        # Chain rule: dip to depth, depth to the height in the round tank, height to volume.
        return self._squeeze * self._depth_slope * self._sum(levels_m, Cut.chord)

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
