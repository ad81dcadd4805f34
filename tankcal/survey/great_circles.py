"""Great circles of a sphere measured by tape: the equator, and meridians from pole to pole."""

from dataclasses import dataclass

import numpy as np

from tankcal.survey.strapping import Strapping

KINDS = ("equator", "meridian")


@dataclass(frozen=True)
class GreatCircles:
    """Strapping of a sphere.

    Attributes
    ----------
    strapping : Strapping
        Readings and tapes. The name of a `Strap` is a circle, its course the kind of circle.
    azimuth_rad : dict
        {circle: azimuth of the plane of a meridian, clockwise from +y, rad; nan: equator}.
    """

    strapping: Strapping
    azimuth_rad: dict

    def azimuths(self, straps):
        """Azimuths (n,) of the circles of the straps, rad; nan: the equator."""
        return np.array([self.azimuth_rad[strap.name] for strap in straps], dtype=float)
