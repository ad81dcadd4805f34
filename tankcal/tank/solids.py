"""Tanks that are a single solid: lying cylinder with its ends, sphere, upright ellipsoid.

Both are parts of a capacity table, with volumes, free surfaces and derivatives at any dips. Dips
count from the inside bottom, in metres; dips outside the tank raise HeightError.

Gauge tube of a lying tank
--------------------------

The tube is not plumb if the tank was rolled about its axis on its saddles, and it may pass the axis
at a distance. Seen from end A, with x to the right and z up, the tube leans to the right by the
angle a and passes e to the right of the axis. At the distance t from its middle, the tube has the
position

    (x, z) = e (cos a, -sin a) + t (sin a, cos a),

and touches the wall of radius R at t = -w, w = sqrt(R^2 - e^2). With the dip d = t + w, the height
of the liquid above the lowest point of the section, equal to a plumb dip, is

    depth(d) = R + (d - w) cos a - e sin a.

Form of a surveyed wall about a solid: its height, and its volume at every level.

A wall is not exactly a cylinder or sphere. T is the height of the solid, and V are its volumes. H
is the height of the surveyed wall, from the bottom at the dip to the top. The volumes of the wall
are

    W(d) = V(d T / H) (1 + share + g(t) (1 + cos t)^1.5),   d = H (1 - cos t) / 2,

where g is a spline through levels equally spaced in t. W is full where the wall is full, and
equally smooth.

Spheres as built and loaded: the upright ellipsoid, and a sphere under pressure.

Dips count from the lowest inside point, in metres; dips outside the tank raise HeightError.
"""

from dataclasses import dataclass
from functools import cached_property
from operator import methodcaller

import numpy as np
import scipy

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.heads import CHORD, CHORD_MOMENT, RADII, SEGMENT, End, Line
from tankcal.tank.lying import (
    LyingSolid,
    Piece,
    check_dip,
    check_directions,
    levels_inside,
    pieces_of_ends,
    refuse_meeting_ends,
    require_length,
)
from tankcal.tank.parts import Solid
from tankcal.units import STANDARD_GRAVITY

FLAT = End("flat")
TUBE = ("tube_angle", "tube_offset")  # inputs of a gauge tube
STEEPEST = np.radians(80)  # largest angle off the plumb
NODES = 49  # number of levels from empty to full
MOST_BEND = 0.14  # bound of |g|: at the bottom (1 + cos t)^1.5 is 2.8, and a groove may be large
LEAST_TURN = 1e-4  # distance in t from the ends, where the derivative is indeterminate


@dataclass(frozen=True)
class LyingTank(LyingSolid):
    """Lying cylinder, round or elliptical, between two ends, tilted and rolled: exact.

    The zero is the lowest point of the section at dip_from_a_m, where the plumb line touches the
    bottom. In a tilted tank, liquid may be below the zero, so the volume at dip 0 may be above
    zero. With the level c_p above the axis in that section, B the half height of the rolled section
    and a dip d,

        c_p = -B + d (square),   c_p = -B + d sqrt(1 + tilt^2) (plumb),   c(s) = c_p - tilt (s - p).

    At the highest dip, its line meets the top of the cylinder: 2 B, plumb 2 B sqrt(1+tilt^2). For a
    gauge tube off the axis or off the plumb (round tanks only), c_p = depth(d) - B, with d times
    sqrt(1 + tilt^2) for a plumb reading (`GaugeTube`). The sections of an end are similar to that
    of the cylinder. An elliptical tank is computed as the round tank of equal section area, with
    heights times sqrt(width height) / (2 B), which is exact; the radii and the spherical form of an
    end refer to that round tank.

    Attributes
    ----------
    width_m, height_m : float
        Inside axes of the section, perpendicular to the axis; equal for a round tank.
    length_m : float
        Inside length of the cylinder, without its ends.
    end_a, end_b : End
        Ends, of independent kind and size.
    tilt : float
        Tangent of the angle by which the axis rises from A to B (negative: falls).
    roll_rad : float
        Rotation of the section about the axis; without effect for a round tank.
    dip_from_a_m : float
        Position of the zero of the dip, along the axis from the start of the cylinder at A.
    dip_direction : str
        "plumb": the dip is read along the vertical; "square": perpendicular to the axis.
    tube_angle_rad : float
        Angle of the gauge tube off the plumb, in the plane of the section; its top leans to the
        right as seen from A. 0: plumb.
    tube_offset_m : float
        Distance of the tube from the axis, to the right of it as seen from A if the tube is plumb.

    Raises
    ------
    SolutionError
        For impossible dimensions.

    References
    ----------
    Jones 2001, Computing fluid tank volumes (untilted); the tilt by quadrature, `lying`.
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
        require_length("width", self.width_m)
        require_length("height", self.height_m)
        require_length("length", self.length_m)
        check_directions(self.dip_direction, self.tilt, self.roll_rad)
        self._check_round()
        refuse_meeting_ends(self._ends, self.length_m)
        shift = 2 * self._half_height_m * self.tilt
        check_dip(self.dip_from_a_m, self.dip_direction, shift, self.length_m)

    def _check_round(self):
        """Raise SolutionError for features that require a round section.

        They are a gauge tube off the axis or the plumb, and a rolled guppy end.
        """
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

    @property
    def top_m(self):
        """Highest dip, m."""
        if self._has_tube:
            return self._tube.full_m * self._stretch
        return 2 * self._half_height_m * self._stretch

    def depth_m(self, levels_m):
        """Return depths (rows,) perpendicular to the axis above the lowest point of the section."""
        dips_square = super().depth_m(levels_m)
        return self._tube.depth_m(dips_square) if self._has_tube else dips_square

    def height_share(self, levels_m):
        """Return the plumb dip (rows,) of each depth over the highest dip, and its derivative."""
        high = 2 * self._half_height_m * self._stretch**2  # scale from depths to fractions
        return self.depth_m(levels_m) / high, self._depth_slope / high

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volume at a fixed dip}, with all else fixed.

        diameter         width and height together; ends keep their depths (torispherical: their
                         radii)
        length           length of the cylinder; B moves, A and the position of the dip do not
        end_depth        depth of both ends in the direction of their bulge; flat ends have none,
                         torispherical ends of given radii are stretched along the axis
        dish, knuckle    radii of both ends, for torispherical ends of given radii
        tube_angle, tube_offset  position of the gauge tube, of a round tank only
        tilt             tangent of the tilt; the zero of the dip is fixed
        dip_position     dip_from_a_m
        plate_thickness  thickness subtracted from outside measurements: reduces the diameter by
                         twice the thickness, and the depth (or the radii) of each end by the
                         thickness; the depth of an inward end increases; the length is fixed
        datum            height of the liquid at a given dip
        scale            scale of all lengths of the tank and of the position of the dip, but not of
                         the dips
        """
        integrands = [SEGMENT, CHORD, CHORD_MOMENT]
        inputs = ("radius", "end_depth", "end_plate", *RADII)
        integrands += [methodcaller("by", name) for name in inputs]
        integrals = [
            (piece, self._integrals(piece, levels_m, integrands)) for piece in self._pieces
        ]
        volume, surface, _, by_radius, by_depth, _, by_dish, by_knuckle = sum(
            values for _, values in integrals
        )
        moment = sum(self._moment(piece, values[1], values[2]) for piece, values in integrals)
        surface_of_b = sum(values[1] for piece, values in integrals if piece.end == "b")
        by_plate = sum(piece.sign * values[5] for piece, values in integrals)
        levels = np.asarray(levels_m, dtype=float)
        squeeze, tilt, stretch, slope = self._squeeze, self.tilt, self._stretch, self._tube.slope
        by_stretch = tilt / stretch * slope if self.dip_direction == "plumb" else 0.0
        datum = squeeze * self._depth_slope * surface
        by_squeeze = stretch * levels * surface - tilt * moment
        by_tube = self._tube.derivatives(stretch * levels)
        radius_by, squeeze_by = self._diameter_derivatives
        # A larger radius lowers the bottom, where dips begin: the surface falls relative to the
        # axis.
        by_radius = by_radius - (1 - by_tube["radius"]) * surface
        diameter = radius_by * by_radius + squeeze_by * by_squeeze
        # Chain rule: the volume changes by the free surface times the change of the depth.
        by_tube_inputs = {name: by_tube[name] * surface for name in TUBE if self._is_round}
        return by_tube_inputs | {
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
        barrel = Line(0.0, self.length_m, self._radius_m, 0.0, {"radius": (1.0, 0.0)})
        ends = pieces_of_ends(self._ends, self.length_m, upward=np.cos(self.roll_rad))
        return Piece(barrel, 0.0, 1, 1, ""), *ends

    @property
    def _ends(self):
        return (self.end_a, self._radius_m), (self.end_b, self._radius_m)

    @property
    def _has_twins(self):
        return self.tilt == 0 and self.end_a == self.end_b

    @property
    def _has_tube(self):
        """Whether the gauge tube is off the axis or off the plumb."""
        return bool(self.tube_angle_rad or self.tube_offset_m)

    @property
    def _is_round(self):
        return self.width_m == self.height_m

    @property
    def _depth_slope(self):
        return self._stretch * self._tube.slope

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
        # Support function of the ellipse in the vertical direction.
        sin, cos = np.sin(self.roll_rad), np.cos(self.roll_rad)
        return np.hypot(self.width_m * sin, self.height_m * cos) / 2

    @property
    def _squeeze(self):
        """Ratio of heights of the round tank to heights of this tank."""
        return self._radius_m / self._half_height_m

    @property
    def _diameter_derivatives(self):
        """Derivatives of the radius of the round tank and of the squeeze by width and height."""
        sin2, cos2 = np.sin(self.roll_rad) ** 2, np.cos(self.roll_rad) ** 2
        # Derivative of sqrt(w h) / 2 for equal changes of w and h.
        radius = (self.width_m + self.height_m) / (8 * self._radius_m)
        half = (self.width_m * sin2 + self.height_m * cos2) / (4 * self._half_height_m)
        return radius, (radius - self._squeeze * half) / self._half_height_m


@dataclass(frozen=True)
class Sphere(Solid):
    """Spherical tank; dips count from its lowest inside point: V = pi d^2 (3 R - d) / 3.

    Attributes
    ----------
    diameter_m : float
        Inside diameter.

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
        require_length("diameter", self.diameter_m)

    @property
    def top_m(self):
        """Highest dip, m."""
        return self.diameter_m

    @property
    def capacity_m3(self):
        """Volume of the full tank, pi D^3 / 6."""
        return np.pi * self.diameter_m**3 / 6

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each dip."""
        d = levels_inside(levels_m, self.top_m)
        return np.pi * d**2 * (1.5 * self.diameter_m - d) / 3

    def area_m2(self, levels_m):
        """Return the free surface (rows,), pi d (D - d)."""
        d = levels_inside(levels_m, self.top_m)
        return np.pi * d * (self.diameter_m - d)

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volume at a fixed dip}.

        diameter         inside diameter; the lowest point, the zero of the dips, moves with it
        plate_thickness  thickness subtracted twice from an outside diameter
        datum            height of the liquid at a given dip
        scale            scale of the diameter, but not of the dips
        """
        d = levels_inside(levels_m, self.top_m)
        by_diameter = np.pi * d**2 / 2
        return {
            "diameter": by_diameter,
            "plate_thickness": -2 * by_diameter,
            "datum": self.area_m2(levels_m),
            "scale": self.diameter_m * by_diameter,
        }


@dataclass(frozen=True)
class GaugeTube:
    """Straight tube across a round section.

    Attributes
    ----------
    radius_m : float
        Radius of the section.
    angle_rad : float
        Angle off the plumb, in the plane of the section; the top leans to the right as seen from A.
    offset_m : float
        Distance from the axis, to the right of it as seen from A if the tube is plumb.

    Raises
    ------
    SolutionError
        For a tube that does not cross the section, or that is nearly horizontal.

    Examples
    --------
    Through the axis, 60 degrees off the plumb: dip 0 is half a radius above the lowest point.

    >>> tube = GaugeTube(1.0, np.radians(60), 0.0)
    >>> tube.depth_m(np.array([0.0, 1.0])).round(9).tolist(), round(float(tube.full_m), 9)
    ([0.5, 1.0], 3.0)
    """

    radius_m: float
    angle_rad: float
    offset_m: float

    def __post_init__(self):
        if not (abs(self.offset_m) < self.radius_m and abs(self.angle_rad) <= STEEPEST):
            raise SolutionError(
                message(
                    "tube_off_tank",
                    "a gauge tube {offset_m:g} m from the axis, {angle_deg:g} degrees off the "
                    "plumb, in a tank of radius {radius_m:g} m: expected one that crosses it",
                    offset_m=self.offset_m,
                    angle_deg=np.degrees(self.angle_rad),
                    radius_m=self.radius_m,
                )
            )

    @property
    def foot_m(self):
        """Distance w from the end of the tube at the wall to its middle."""
        return np.sqrt(self.radius_m**2 - self.offset_m**2) if self.offset_m else self.radius_m

    @property
    def full_m(self):
        """Dip of the full section; above the wall, the tube continues in its nozzle."""
        # Solve depth(d) = 2 R for the dip d.
        rise = self.offset_m * np.sin(self.angle_rad)
        return self.foot_m + (self.radius_m + rise) / np.cos(self.angle_rad)

    @property
    def slope(self):
        """Derivative of the depth by the dip."""
        return np.cos(self.angle_rad)

    def depth_m(self, dips_m):
        """Return depths (rows,) above the lowest point of the section."""
        return self.radius_m + self._heights_over_axis(dips_m)

    def derivatives(self, dips_m):
        """Return {input: derivative of the depth at a fixed dip}.

        The inputs are "radius", "tube_angle" and "tube_offset".
        """
        sin, cos = np.sin(self.angle_rad), np.cos(self.angle_rad)
        return {
            # w = sqrt(R^2 - e^2) has the derivatives R / w by the radius and -e / w by the offset.
            "radius": 1 - self.radius_m / self.foot_m * cos,
            "tube_angle": -(dips_m - self.foot_m) * sin - self.offset_m * cos,
            "tube_offset": self.offset_m / self.foot_m * cos - sin,
        }

    def _heights_over_axis(self, dips_m):
        """Return heights (rows,) of the liquid above the axis."""
        sin, cos = np.sin(self.angle_rad), np.cos(self.angle_rad)
        return (dips_m - self.foot_m) * cos - self.offset_m * sin


# ---- form of a surveyed wall about a solid: its height, and its volume at every level


def node_turns():
    """Return t (NODES,) of the levels of a form."""
    return np.linspace(0.0, np.pi, NODES)


def node_levels(height_m):
    """Return the levels (NODES,) of a solid of a given height."""
    return height_m * (1 - np.cos(node_turns())) / 2


@dataclass(frozen=True)
class SurveyedForm:
    """Form of a wall about the solid fitted to it.

    Attributes
    ----------
    stretch : float
        Ratio of the height of the wall to that of the solid.
    share : float
        Relative excess of the volume of the full wall over that of the solid.
    bend : ndarray, shape (NODES,)
        g at the nodes.
    factors : tuple of body.Factor
        Uncertainty of the volumes at the nodes after the survey, m3.
    """

    stretch: float
    share: float
    bend: np.ndarray
    factors: tuple

    @classmethod
    def of_volumes(cls, volume_m3, area_m2, height_m, added_m3, added_height_m, factors):
        """Return the form of a wall with given additional volumes and additional height.

        Parameters
        ----------
        volume_m3, area_m2 : ndarray, shape (NODES,)
            Volumes and areas of the solid at its nodes.
        height_m : float
            Height of the solid.
        added_m3 : ndarray, shape (NODES,)
            Additional volumes due to the departures of the wall, at equal dips.
        added_height_m : float
            Additional height due to the departures.
        factors : tuple of body.Factor
        """
        stretch = 1 + added_height_m / height_m
        rise_m = node_levels(height_m) * (stretch - 1)
        # The nodes of the wall are higher by `risen`: add the volume between to compare at equal
        # shares.
        additional_m3 = added_m3 + area_m2 * rise_m
        share = additional_m3[-1] / volume_m3[-1]
        size = volume_m3 * (1 + np.cos(node_turns())) ** 1.5
        bend = np.zeros(NODES)
        bend[1:-1] = (additional_m3 - share * volume_m3)[1:-1] / size[1:-1]
        bend = np.clip(bend, -MOST_BEND, MOST_BEND)
        # g is 0 / 0 at the ends: continue with the neighbouring values.
        bend[0], bend[-1] = bend[1], bend[-2]
        return cls(float(stretch), float(share), bend, factors)

    def factor(self, level_share):
        """Return W over V (rows,) at levels given as fractions of the height."""
        turn = _turn(level_share)
        return 1 + self.share + self._bend(turn) * (1 + np.cos(turn)) ** 1.5

    def factor_slope(self, level_share):
        """Return the derivative (rows,) of `factor` by the fraction of the height."""
        turn = np.clip(_turn(level_share), LEAST_TURN, np.pi - LEAST_TURN)
        fall, rise = (1 + np.cos(turn)) ** 0.5, np.sin(turn)
        by_turn = self._bend(turn, 1) * fall**3 - 1.5 * self._bend(turn) * fall * rise
        # share = (1 - cos t) / 2, so dt/dshare = 2 / sin t.
        return 2 * by_turn / rise

    def at(self, level_share):
        """Return the weights (rows, NODES) of values at the nodes for values at levels."""
        return scipy.interpolate.CubicSpline(node_turns(), np.eye(NODES))(_turn(level_share))

    @cached_property
    def _bend(self):
        return scipy.interpolate.CubicSpline(
            node_turns(), self.bend, bc_type=((1, 0.0), "not-a-knot")
        )


def _turn(level_share):
    """Return t of fractions of the height."""
    return np.arccos(1 - 2 * np.clip(level_share, 0.0, 1.0))


ROUNDS = 60  # iterations of the highest dip; each reduces the error by the strain, about 1e-4


@dataclass(frozen=True)
class Ellipsoid(Solid):
    """Ellipsoid with a vertical axis: V = pi a b d^2 (3 c - d) / (3 c^2).

    Attributes
    ----------
    a_m, b_m : float
        Horizontal semi-axes, inside.
    c_m : float
        Vertical semi-axis.

    Raises
    ------
    SolutionError
        For a semi-axis that is not above zero.

    Examples
    --------
    >>> Ellipsoid(1.0, 1.0, 1.0).volume_m3([1.0, 2.0]).round(4).tolist()
    [2.0944, 4.1888]
    """

    a_m: float
    b_m: float
    c_m: float

    def __post_init__(self):
        for name in ("a", "b", "c"):
            require_length(f"semi-axis {name}", getattr(self, f"{name}_m"))

    @property
    def top_m(self):
        """Highest dip, m."""
        return 2 * self.c_m

    @property
    def diameter_m(self):
        """Diameter of the sphere of equal volume, m."""
        return float(2 * np.cbrt(self.a_m * self.b_m * self.c_m))

    @property
    def capacity_m3(self):
        """Volume of the full tank, 4 pi a b c / 3."""
        return 4 / 3 * np.pi * self.a_m * self.b_m * self.c_m

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each dip."""
        d = levels_inside(levels_m, self.top_m)
        return np.pi * self.a_m * self.b_m / self.c_m**2 * d**2 * (3 * self.c_m - d) / 3

    def area_m2(self, levels_m):
        """Return the free surface (rows,), pi a b d (2 c - d) / c^2."""
        d = levels_inside(levels_m, self.top_m)
        return np.pi * self.a_m * self.b_m / self.c_m**2 * d * (2 * self.c_m - d)

    def by_axes(self, levels_m):
        """Return the derivative (rows, 3) of the volume at a fixed dip by a, b and c, m2."""
        d, c = levels_inside(levels_m, self.top_m), self.c_m
        volume = self.volume_m3(d)
        # Derivative of (3 c - d) / c^2 by c, at a fixed dip d.
        by_c = np.pi * self.a_m * self.b_m * d**2 * (2 * d / (3 * c) - 1) / c**2
        return np.column_stack([volume / self.a_m, volume / self.b_m, by_c])

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volume at a fixed dip}.

        diameter         all three semi-axes, by half of the diameter
        plate_thickness  thickness subtracted from outside measurements: reduces all three semi-axes
        datum            height of the liquid at a given dip
        scale            scale of the axes, but not of the dips
        """
        d = levels_inside(levels_m, self.top_m)
        by_radius, area = self.by_axes(d).sum(axis=1), self.area_m2(d)
        return {
            "diameter": by_radius / 2,
            "plate_thickness": -by_radius,
            "datum": area,
            # V = t^3 W(d / t) for a scale t: dV/dt = 3 V - d A at t = 1.
            "scale": 3 * self.volume_m3(d) - d * area,
        }


@dataclass(frozen=True)
class Pressure:
    """Loads of a sphere, for the table and during the survey; all 0: no load.

    Attributes
    ----------
    gas_pa : float
        Gauge pressure above the liquid.
    density_kg_m3 : float
        Density of the liquid below the dip.
    survey_gas_pa, survey_density_kg_m3, survey_level_m : float
        Gauge pressure, density and level of the liquid during the survey.
    """

    gas_pa: float = 0.0
    density_kg_m3: float = 0.0
    survey_gas_pa: float = 0.0
    survey_density_kg_m3: float = 0.0
    survey_level_m: float = 0.0

    @property
    def is_there(self):
        """Whether the sphere is loaded during the survey or for the table."""
        surveyed = self.survey_density_kg_m3 * self.survey_level_m
        return any((self.gas_pa, self.density_kg_m3, self.survey_gas_pa, surveyed))


@dataclass(frozen=True)
class Membrane:
    """Thin wall of a sphere.

    Attributes
    ----------
    thickness_m, e_pa : float
        Thickness of the plates, and Young's modulus.
    poisson : float
        Poisson's ratio.
    """

    thickness_m: float
    e_pa: float
    poisson: float = 0.3


@dataclass(frozen=True)
class PressedSphere(Solid):
    """Sphere, or nearly a sphere, widened by pressure from the survey to the dip of the table.

        dr / r = p r (1 - nu) / (2 E t),      p = gas + rho g h^2 / (4 r), less that of the survey

    rho g h^2 / (4 r) is the mean pressure of a liquid of depth h over the whole wall. By Betti's
    theorem, it gives the change of the whole volume according to membrane theory, for a sphere
    whose support does not move under uniform widening (at its equator). For the volume below a dip,
    it is an approximation.

    Attributes
    ----------
    solid : Solid
        Sphere or ellipsoid as surveyed, inside.
    membrane : Membrane
    pressure : Pressure

    Examples
    --------
    >>> from tankcal.tank.solids import Sphere
    >>> loaded = PressedSphere(Sphere(20.0), Membrane(0.02, 206e9), Pressure(gas_pa=5e5))
    >>> round(float(loaded.strain(0.0)[0]), 7), round(loaded.capacity_m3 / 4188.790205 - 1, 5)
    (0.0004248, 0.00127)
    """

    solid: Solid
    membrane: Membrane
    pressure: Pressure

    def __post_init__(self):
        require_length("thickness", self.membrane.thickness_m)
        if not self.strain(2 * self._radius_m)[0] < 0.1:
            raise SolutionError(
                message(
                    "sphere_too_soft",
                    "the pressure widens the sphere by {percent:.3g} %: check thickness, modulus"
                    " and pressures",
                    percent=100 * float(self.strain(2 * self._radius_m)[0]),
                )
            )

    @property
    def diameter_m(self):
        """Diameter of the surveyed sphere of equal volume, m."""
        return self.solid.diameter_m

    @property
    def _radius_m(self):
        return self.solid.diameter_m / 2

    @property
    def _compliance(self):
        """Strain per pascal."""
        wall = self.membrane
        return self._radius_m * (1 - wall.poisson) / (2 * wall.e_pa * wall.thickness_m)

    def strain(self, levels_m):
        """Return the change dr / r (rows,) since the survey, with the liquid at each dip."""
        return self._compliance * (self._gas_pa + self._heads_pa(levels_m))

    @property
    def _gas_pa(self):
        return self.pressure.gas_pa - self.pressure.survey_gas_pa

    def _heads_pa(self, levels_m):
        """Return mean pressures (rows,) of the liquid on the wall, less that of the survey."""
        loads, levels = self.pressure, np.atleast_1d(np.asarray(levels_m, dtype=float))
        mass = (
            loads.density_kg_m3 * levels**2 - loads.survey_density_kg_m3 * loads.survey_level_m**2
        )
        return STANDARD_GRAVITY * mass / (4 * self._radius_m)

    @cached_property
    def top_m(self):
        """Highest dip, m: that of the sphere widened by the full liquid."""
        top = self.solid.top_m
        for _ in range(ROUNDS):
            # Fixed point: the dip of the full tank loads the wall, which raises the dip.
            top = self.solid.top_m * (1 + float(self.strain(top)[0]))
        return top

    @property
    def capacity_m3(self):
        """Volume of the full tank, m3."""
        return float(self.volume_m3(np.array([self.top_m]))[0])

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each dip."""
        wider, dips = self._unload(levels_m)
        # Similar spheres: lengths times t give volumes times t^3 at dips divided by t.
        return wider**3 * self.solid.volume_m3(dips)

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of the volume by the dip, including its load."""
        wider, dips = self._unload(levels_m)
        return wider**2 * self.solid.area_m2(dips) + self._strain_derivatives(
            wider, dips
        ) * self._slope(levels_m)

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volume at a fixed dip}.

        The inputs are those of the surveyed solid, and youngs_modulus, pressure (of the table),
        survey_pressure, liquid_density, survey_density, survey_level. A thicker plate is also
        stiffer.
        """
        wider, dips = self._unload(levels_m)
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        loads, by_strain, strain = self.pressure, self._strain_derivatives(wider, dips), wider - 1
        head = self._compliance * STANDARD_GRAVITY / (4 * self._radius_m)  # strain per kg/m
        # The strain due to gas is proportional to r; the strain due to a head does not depend on r.
        by_radius = self._compliance * self._gas_pa / self._radius_m
        derivatives = {
            name: wider**3 * derivative for name, derivative in self.solid.derivatives(dips).items()
        }
        radius_by = {"diameter": 0.5, "plate_thickness": -1.0, "scale": self._radius_m}
        for name, derivative in radius_by.items():
            derivatives[name] = derivatives[name] + by_strain * by_radius * derivative
        derivatives["plate_thickness"] = (
            derivatives["plate_thickness"] - by_strain * strain / self.membrane.thickness_m
        )
        derivatives["datum"] = self.area_m2(levels)
        return derivatives | {
            "youngs_modulus": -by_strain * strain / self.membrane.e_pa,
            "pressure": by_strain * self._compliance,
            "survey_pressure": -by_strain * self._compliance,
            "liquid_density": by_strain * head * levels**2,
            "survey_density": -by_strain * head * loads.survey_level_m**2,
            "survey_level": -by_strain
            * head
            * 2
            * loads.survey_density_kg_m3
            * loads.survey_level_m,
        }

    def _unload(self, levels_m):
        """Return relative lengths (rows,) of the loaded sphere, and dips of the surveyed sphere."""
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        levels_inside(levels, self.top_m)
        wider = 1 + self.strain(levels)
        return wider, np.minimum(levels / wider, self.solid.top_m)

    def _strain_derivatives(self, wider, dips):
        """Return the derivative (rows,) of the volume at a fixed dip by the strain."""
        return wider**2 * self.solid.derivatives(dips)["scale"]

    def _slope(self, levels_m):
        """Return the derivative (rows,) of the strain by the dip."""
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        per_pa = self._compliance * STANDARD_GRAVITY / (2 * self._radius_m)
        return per_pa * self.pressure.density_kg_m3 * levels
