"""Kinds of observation: their equations and derivatives.

Assignment of a class of observations to each table of readings.

A further kind of observation requires a class with its equation and derivatives, a line here, and
the columns of its table in the contract of the job. Additional data of a row follow from the fields
of the class: `instrument`, `set`, `origin`, `horizontal`, `rise_m`, `bend_per_m`.
"""

from dataclasses import dataclass, field

from tankcal.survey.observations.base import NUISANCES, Layout, Observations, Source, State, Trace
from tankcal.survey.observations.photographs import (
    HeldOrientation,
    ImageCoordinates,
    PhotoOrientation,
    PhotoRotation,
)
from tankcal.survey.observations.sights import (
    Azimuths,
    Block,
    ControlCoordinates,
    Correlated,
    Directions,
    Distances,
    HeightDifferences,
    HorizontalAngles,
    KnownUnknowns,
    PlumbLines,
    Sights,
    SystemCoordinates,
    Vectors,
    VerticalAngles,
)

__all__ = [
    "KINDS",
    "NUISANCES",
    "Azimuths",
    "Block",
    "ControlCoordinates",
    "Correlated",
    "Directions",
    "Distances",
    "HeightDifferences",
    "HeldOrientation",
    "HorizontalAngles",
    "ImageCoordinates",
    "Kind",
    "KnownUnknowns",
    "Layout",
    "Observations",
    "PhotoOrientation",
    "PhotoRotation",
    "PlumbLines",
    "Sights",
    "Source",
    "State",
    "SystemCoordinates",
    "Trace",
    "Vectors",
    "VerticalAngles",
]


# ---- assignment of a class of observations to each table of readings


@dataclass(frozen=True)
class Kind:
    """Kind of observation in one table.

    Attributes
    ----------
    observes : type
        Class of the observations.
    options : dict
        Keyword arguments of the class.
    group : str
        Group for the test of their standard deviations, if no instrument is named.
    either_way : bool
        True: the reading is the same in both directions.
    """

    observes: type
    options: dict = field(default_factory=dict)
    group: str = ""
    either_way: bool = False

    @property
    def is_angle(self):
        """True if values that differ by a full turn are equal."""
        return self.observes.unit == "rad"

    @property
    def elements(self):
        """Names of the values of a row; ("",) for a single value."""
        return ("x", "y", "z")[: self.observes.rows] if self.observes.rows > 1 else ("",)

    @property
    def axes(self):
        """Axes of the coordinates in the equation, "xyz", including heights unless a row is
        horizontal."""
        axes = (0, 1, 2) if self.has("horizontal") else self.observes.axes
        return "".join("xyz"[axis] for axis in axes)

    def has(self, name):
        """Whether the class has a field `name`."""
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
