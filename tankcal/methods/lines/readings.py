"""From the checked tables of reference lines to `ReferenceLines`, in SI."""

import numpy as np

from tankcal.methods.lines.checks import at_reference, plummets_of, plummets_used
from tankcal.survey.reference_line import Line, Offset, Plummet, ReferenceLines
from tankcal.units import ARCSEC


def make_lines(tables, registers):
    """Build `ReferenceLines` from tables and registers without problems."""
    lines, plummets = tables["lines"], plummets_of(registers)
    used = plummets_used(lines, plummets)
    return ReferenceLines(
        lines=_lines(lines, used),
        offsets=_offsets(tables["offsets"]),
        plummets={name: _plummet(name, plummets[name]) for name in dict.fromkeys(used)},
    )


def _lines(table, used):
    azimuth = np.radians(table.numbers("azimuth_deg"))
    # Lines without azimuths are assumed to be evenly spaced.
    if np.all(np.isnan(azimuth)):
        azimuth = 2 * np.pi * np.arange(len(azimuth)) / len(azimuth)
    columns = zip(table.of("line"), azimuth, used, table.of("side"), table.rows, strict=True)
    return {
        name: Line(name, float(angle), plummet, side == "inside", row)
        for name, angle, plummet, side, row in columns
    }


def _offsets(table):
    names = ("line", "course", "level_m", "offset_mm", "s_mm", "face", "use")
    columns = zip(*map(table.of, names), at_reference(table), table.rows, strict=True)
    return tuple(
        Offset(
            *(line, course, level, offset / 1000, sd / 1000, int(face or 1)),
            reference=bool(reference),
            check=use == "check",
            row=row,
        )
        for line, course, level, offset, sd, face, use, reference, row in columns
    )


def _plummet(name, given):
    arcsec = given["u_collimation_arcsec"]
    return Plummet(
        name,
        correction=given["correction"] or 0.0,
        u_scale=(given["u_scale_ppm"] or 0.0) / 1e6,
        u_collimation_rad=None if arcsec is None else arcsec * ARCSEC,
        certificate=given["certificate"] or "",
    )
