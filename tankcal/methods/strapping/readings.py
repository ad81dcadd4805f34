"""From the checked tables of a strapping to `Strapping`: SI units, an object for each reading."""

from tankcal.job.checks.tapes import tapes_of, tapes_read
from tankcal.job.tapes import gauged, metres, tools_of
from tankcal.survey.strapping import Strap, Strapping


def make_strapping(values, tables, registers):
    """Build `Strapping` from settings, tables and registers without problems."""
    table = tables["circumferences"]
    tapes, keys = tapes_of(registers), values["strapping"]
    return Strapping(
        straps=_straps(table, tapes),
        **tools_of(tables, tapes),
        shape_sd_m=metres(values["shell"]["shape_sd_mm"]),
        wave_m=metres(keys["wave_mm"]),
        helix_m=metres(keys["helix_mm"]),
        plate_sd_m={name: means[1] for name, means in gauged(tables["thickness"]).items()},
    )


def _straps(table, tapes):
    columns = (
        *map(table.of, ("circumference", "course", "level_m", "reading_m", "s_mm")),
        tapes_read(table, tapes),
        *map(table.of, ("temperature_c", "tension_n", "pulls", "use")),
    )
    return tuple(
        Strap(
            *(name, course, level, reading, s_mm / 1000, tape, temperature, tension),
            pulls=int(pulls or 1),
            check=use == "check",
            row=row,
        )
        for row, name, course, level, reading, s_mm, tape, temperature, tension, pulls, use in zip(
            table.rows, *columns, strict=True
        )
    )
