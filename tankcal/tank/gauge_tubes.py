"""Gauge tube in the round section of a lying tank: depth of the liquid from the dip along the tube.

The tube is not plumb if the tank was rolled about its axis on its saddles, and it may pass the axis
at a distance. Seen from end A, with x to the right and z up, the tube leans to the right by the
angle a and passes e to the right of the axis. At the distance t from its middle, the tube has the
position

    (x, z) = e (cos a, -sin a) + t (sin a, cos a),

and touches the wall of radius R at t = -w, w = sqrt(R^2 - e^2). With the dip d = t + w, the height
of the liquid above the lowest point of the section, equal to a plumb dip, is

    depth(d) = R + (d - w) cos a - e sin a.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message

STEEPEST = np.radians(80)  # largest angle off the plumb


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
