"""From the checked great_circles.csv to `GreatCircles`, in SI."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.checks.tapes import tapes_of, tapes_read
from tankcal.job.tapes import tools_of
from tankcal.survey.strapping import Strap, Strapping


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


def estimate_diameter_m(table):
    """Outside diameter of the sphere from the median of all readings, m; None without readings."""
    readings = table.numbers("reading_m")
    return np.nanmedian(readings) / np.pi if np.any(readings > 0) else None


def make_great_circles(tables, registers):
    """Build `GreatCircles` from tables and registers without problems."""
    table = tables["great_circles"]
    tapes = tapes_of(registers)
    columns = (
        *map(table.of, ("circle", "kind", "azimuth_deg", "reading_m", "s_mm")),
        tapes_read(table, tapes),
        *map(table.of, ("temperature_c", "tension_n", "use")),
    )
    straps, azimuths = [], {}
    for row, name, kind, azimuth, reading, s_mm, tape, temperature, tension, use in zip(
        table.rows, *columns, strict=True
    ):
        azimuths[name] = np.nan if azimuth is None else float(np.radians(azimuth))
        straps.append(
            Strap(
                *(name, kind, 0.0, reading, s_mm / 1000, tape, temperature, tension),
                check=use == "check",
                row=row,
            )
        )
    return GreatCircles(Strapping(tuple(straps), **tools_of(tables, tapes)), azimuths)
