"""A lying cylinder of rings, each of its own radius: exact.

The rings are coaxial. With tilt m (B higher: above zero), a plumb dip h that touches the bottom of
the ring at s = p, of radius R_p, and cos the cosine of the tilt, the liquid stands

    depth(s) = (p - s) m + h / cos + R_i - R_p,   0 <= depth <= 2 R_i,

square to the axis in ring i. The quadrature breaks at joints and where the surface meets the bottom
or the top of a ring (`arcs.integrate`).
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from tankcal.errors import SolutionError
from tankcal.tank.arcs import Cut, Line
from tankcal.tank.heads import RADII, End, depth_of
from tankcal.tank.lying import (
    LyingSolid,
    Piece,
    check_dip,
    check_directions,
    pieces_of_ends,
    refuse_meeting_ends,
    require_length,
)

FLAT = End("flat")
WAVES = tuple(range(2, 13))  # orders of departures from a circle that move rows one by one


@dataclass(frozen=True)
class RingedTank(LyingSolid):
    """A lying cylinder of coaxial rings between two ends, tilted.

    The zero is the bottom of the ring at dip_from_a_m, where the plumb line touches it. Liquid may
    lie lower, in a tilted tank or in a wider ring, so the volume at dip 0 may be above zero; and
    there may be room above the highest dip, where the plumb line meets the top.

    Attributes
    ----------
    radii_m, lengths_m : tuple of float
        Inside, of each ring from end A to end B.
    end_a, end_b : End
        On the first and on the last ring.
    tilt : float
        Tan of the angle by which the axis rises from A to B (negative: falls).
    dip_from_a_m : float
        Place of the dip's zero, along the axis from the start of the cylinder at A.
    dip_direction : str
        "plumb": the dip is read along the vertical; "square": square to the axis.

    Raises
    ------
    SolutionError
        For sizes that make no tank.

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
        """(rings + 1,) places of the joints along the axis."""
        return np.concatenate([[0.0], np.cumsum(self.lengths_m)])

    @property
    def length_m(self):
        """Of the cylinder."""
        return float(self.joints_m[-1])

    @property
    def width_m(self):
        """Mean inside diameter along the cylinder."""
        return 2 * float(np.average(self.radii_m, weights=self.lengths_m))

    @property
    def height_m(self):
        """The same: each ring is round."""
        return self.width_m

    @property
    def top_m(self):
        """The highest dip: where its line meets the top."""
        return (self._radius_m + self._radius_at_top_m) * self._stretch

    @property
    def zero_ring(self):
        """Index of the ring that the dip touches."""
        return self._ring_at(self.dip_from_a_m)

    @property
    def left_m3(self):
        """Room that is left when the liquid reaches the highest dip."""
        return self.capacity_m3 - float(self.volume_m3([self.top_m])[0])

    def derivatives(self, levels_m):
        """{input: (rows,) or (rows, k)} derivative of the volume at a fixed dip, all else fixed.

        ring_radii       (rows, rings) each its own; the ring of the dip takes the zero along
        dip_radius       of the wall where the dip touches it alone
        ring_waves       (rows, rings x WAVES) wave cos(k a) of a ring, a from its bottom, the waves
                         of a ring together; the ring of the dip takes the zero along
        ring_lengths     (rows, rings) each its own; what lies beyond moves away, A and the dip stay
        ring_axes        (rows, rings) how far the axis of each stands above the common one
        end_depth, dish, knuckle, tilt, dip_position, datum, scale
                         as of `solids.LyingTank`
        plate_thickness  of plates that were taken off outside measures: all radii are less by it,
                         each end less deep; the lengths stay
        paint            the same of the radii alone
        """
        integrands = [Cut.segment, Cut.chord, Cut.chord_moment]
        inputs = ("radius", "end_depth", "end_plate", *RADII)
        integrands += [partial(Cut.by, name=name) for name in inputs]
        cylinder = [*integrands, *(partial(Cut.by_wave, order=order) for order in WAVES)]
        found = [
            (piece, self._integrals(piece, levels_m, integrands if piece.end else cylinder))
            for piece in self._pieces
        ]
        rings = len(self.radii_m)
        volume, surface, by_depth, by_dish, by_knuckle = (
            sum(one[i] for _, one in found) for i in (0, 1, 4, 6, 7)
        )
        by_plate = sum(piece.sign * one[5] for piece, one in found)
        moment = sum(self._moment(piece, one[1], one[2]) for piece, one in found)
        of_ring = np.zeros((2, len(surface), rings))  # surface, and by the radius
        for piece, one in found:
            of_ring[:, :, piece.ring] += one[[1, 3]]
        waves = np.stack([one[8:].T for piece, one in found if not piece.end], axis=1)
        own = np.eye(rings)[self.zero_ring]
        zero = -surface[:, None] * own  # of what moves the bottom of the dip's ring
        by_radii = of_ring[1] + zero
        datum = self._stretch * surface
        by_stretch = self.tilt / self._stretch if self.dip_direction == "plumb" else 0.0
        levels = np.asarray(levels_m, dtype=float)
        of_end_b = sum(one[1] * (piece.end == "b") for piece, one in found)
        return {
            "ring_radii": by_radii,
            "dip_radius": -surface,
            "ring_waves": (waves + zero[:, :, None]).reshape(len(surface), -1),
            "ring_lengths": self._by_lengths(levels, of_ring[0], of_end_b),
            "ring_axes": -of_ring[0] - zero,
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

    def _by_lengths(self, levels, surface, of_end_b):
        """(rows, rings) by the length of each ring.

        surface (rows, rings) with the ends; of_end_b (rows,) that of end B alone
        """
        rings = surface.shape[1]
        beyond = np.cumsum(surface[:, ::-1], axis=1)[:, ::-1] - surface  # of the rings after each
        beyond[:, -1] = of_end_b
        sections = [self._section_m2(levels, self.joints_m[i + 1], i) for i in range(rings)]
        return np.column_stack(sections) - self.tilt * beyond

    @cached_property
    def _pieces(self):
        by = {"radius": (1.0, 0.0)}
        cylinder = (
            Piece(Line(start, stop, radius, 0.0, by), 0.0, 1, 1, "", ring)
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
        """Of the ring whose top the line of the dip meets."""
        shift = 2 * self._radius_m * self.tilt if self.dip_direction == "plumb" else 0.0
        return self.radii_m[self._ring_at(self.dip_from_a_m + shift)]

    @property
    def _highest_m(self):
        """A dip at which nothing is left, or the highest one: a pipe above the top may read it."""
        depths = [depth_of(*one) for one in self._ends]
        low, high = -depths[0] - self.dip_from_a_m, self.length_m + depths[1] - self.dip_from_a_m
        over = max(self.radii_m) + abs(self.tilt) * max(-low, high)
        return max(self.top_m, (over + self._radius_m) / self._stretch)

    def _ring_at(self, s):
        ring = int(np.searchsorted(self.joints_m, s, side="right")) - 1
        return min(max(ring, 0), len(self.radii_m) - 1)
