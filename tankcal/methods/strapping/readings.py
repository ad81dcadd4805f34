"""From the checked tables of a strapping to `Strapping`: SI units, an object for each reading."""

from dataclasses import replace

import numpy as np

from tankcal.job.checks.tapes import tapes_of, tapes_read
from tankcal.job.tapes import gauged, metres, tools_of
from tankcal.survey.strapping import Strap, Strapping, reduce_straps

CLOSE_M, ROUNDS = 1e-12, 20  # convergence limit and largest number of iterations


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


# ---- readings by tape of a known wall: the reduction of the job, inverted


def observe_straps(job, wall, errors):
    """Return tape readings whose reduction gives the perimeters of the wall, by iteration."""
    strapping, diameter = job.strapping, job.tank.nominal_diameter_m
    shell_c = job.survey.shell_temperature_c
    girth = np.array([wall.girth_m(strap.course, strap.level_m) for strap in strapping.straps])
    reduced = reduce_straps(strapping, shell_c, diameter)
    # Errors are added to the reduced perimeters, in which the standard deviations are defined.
    girth += errors.draw([strap.sd_m for strap in reduced])
    girth += [
        sum(errors.draw_cause(e.kind, e.name) * e.by_m for e in strap.effects) for strap in reduced
    ]
    # The reduction (temperature, tension, friction) depends on the reading: invert by iteration.
    for _ in range(ROUNDS):
        reduced = reduce_straps(strapping, shell_c, diameter)
        short = girth - [strap.circumference_m for strap in reduced]
        straps = zip(strapping.straps, short, strict=True)
        strapping = replace(
            strapping,
            straps=tuple(
                replace(strap, reading_m=strap.reading_m + float(by)) for strap, by in straps
            ),
        )
        if np.abs(short).max() < CLOSE_M:
            break
    return strapping
