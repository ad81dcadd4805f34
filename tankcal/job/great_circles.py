"""From the checked great_circles.csv to `GreatCircles`, in SI."""

import numpy as np

from tankcal.job.checks.strapping import tapes_of, tapes_read
from tankcal.job.strapping import tools_of
from tankcal.survey.great_circles import GreatCircles
from tankcal.survey.strapping import Strap, Strapping


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
