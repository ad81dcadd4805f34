"""Great circles of a sphere by tape: the equator, and meridians from pole to pole."""

from dataclasses import dataclass

import numpy as np

from tankcal.survey.strapping import Strapping

KINDS = ("equator", "meridian")


@dataclass(frozen=True)
class GreatCircles:
    """What was strapped of a sphere, and with what.

    Attributes
    ----------
    strapping : Strapping
        Readings and tapes; the circumference of a `Strap` is a circle, its course the kind.
    azimuth_rad : dict
        {name of a circle: azimuth of the plane of a meridian, clockwise from +y; nan: equator}.
    """

    strapping: Strapping
    azimuth_rad: dict

    def azimuths(self, straps):
        """(n,) azimuths of the circles that straps are on, rad; nan: the equator."""
        return np.array([self.azimuth_rad[one.name] for one in straps], dtype=float)
