"""Which observations each table of readings holds: the one place where a table meets its class.

A further kind of observation is a class with its equation and derivatives, a line here, and the
columns of its table in the contract of the job. What its rows carry besides both ends follows from
the fields of the class: `instrument`, `set`, `origin`, `horizontal`, `rise_m`, `bend_per_m`.
"""

from dataclasses import dataclass, field

from tankcal.survey.observations.coordinates import HeightDifferences, PlumbLines, Vectors
from tankcal.survey.observations.sights import (
    Azimuths,
    Directions,
    Distances,
    HorizontalAngles,
    VerticalAngles,
)


@dataclass(frozen=True)
class Kind:
    """What the rows of one table are.

    Attributes
    ----------
    observes : type
        Class of the observations.
    options : dict
        That it is made with.
    group : str
        Under which their sds are judged together, where no instrument is named.
    either_way : bool
        True: read from one end to the other or back is the same.
    """

    observes: type
    options: dict = field(default_factory=dict)
    group: str = ""
    either_way: bool = False

    @property
    def is_angle(self):
        """True where a full turn is no difference."""
        return self.observes.unit == "rad"

    @property
    def elements(self):
        """Names of the values of a row; ("",) of a single one."""
        return ("x", "y", "z")[: self.observes.rows] if self.observes.rows > 1 else ("",)

    @property
    def axes(self):
        """Axes of the points' coordinates that enter, "xyz"; heights, unless a row is in plan."""
        axes = (0, 1, 2) if self.has("horizontal") else self.observes.axes
        return "".join("xyz"[axis] for axis in axes)

    def has(self, name):
        """Whether its observations have a field `name`."""
        return name in self.observes.__dataclass_fields__


KINDS = {
    "distances": Kind(Distances, either_way=True),
    "slope_distances": Kind(Distances, group="slope distances"),
    "directions": Kind(Directions),
    "zenith_angles": Kind(VerticalAngles, {"zenith": True}, "zenith angles"),
    "azimuths": Kind(Azimuths),
    "horizontal_angles": Kind(HorizontalAngles),
    "vertical_angles": Kind(VerticalAngles),
    "height_differences": Kind(HeightDifferences),
    "plumb_lines": Kind(PlumbLines),
    "vectors": Kind(Vectors),
}
