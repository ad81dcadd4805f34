"""Strapped sphere: checks of its tables and settings as a whole, and `GreatCircles` in SI."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.job.checking import tell
from tankcal.job.checks.extent import has_wall_points, is_supplemented
from tankcal.job.checks.tapes import (
    check_girths,
    check_readings,
    check_tape_temperature,
    refuse_inside,
    tapes_of,
    tapes_read,
    tell_without_effect,
)
from tankcal.job.tapes import strapping_equipment
from tankcal.messages import message
from tankcal.survey.strapping import MOST_STRAPS, Strap, Strapping, too_many_straps

MOST_APART = 0.05  # largest relative difference of great circles of one sphere


def check_great_circles(values, tables, registers, raw, log, *, is_given):
    """Check circles, obstructions and tape comparisons; parameters as for `Method.check`.

    is_given : bool
        Whether the job has rows of great circles.
    """
    table = tables["great_circles"]
    if not is_given:
        tell_without_effect(tables, log)
        if values is not None:
            _refuse_settings(values, raw, log)
        return
    if len(table.rows) > MOST_STRAPS:
        log.problem(table.file, too_many_straps(len(table.rows)))
        return
    tapes = tapes_of(registers)
    _check_circles(table, log)
    # The columns have the names of circumferences; a great circle is taped in one pull.
    columns = {"circumference": table.columns["circle"], "pulls": None}
    straps = replace(table, columns=table.columns | columns)
    check_readings(straps, tables, registers, raw, log)
    if has_wall_points(tables):
        expected = message(
            "circles_beside_points",
            "given together with points or a survey of them; expected only one of them: the form"
            " comes from either",
        )
        log.problem(table.file, expected)
    if is_supplemented(tables):
        expected = message(
            "liquid_beside_circles", "given together with great_circles.csv; expected only one"
        )
        log.problem(tables["liquid"].file, expected)
    if all(use == "check" for use in table.of("use")):
        log.problem(
            table.file,
            message(
                "all_circles_checks", "every row is a check; expected one at least that counts"
            ),
        )
    if values is not None:
        _check_settings(values, table, tapes, raw, log)


def _check_circles(table, log):
    """Require an azimuth for meridians only, and repeats of the same circle."""
    places = {}
    columns = map(table.of, ("circle", "kind", "azimuth_deg"))
    for row, name, kind, azimuth in zip(table.rows, *columns, strict=True):
        if kind == "meridian" and azimuth is None and not log.has(table.file, row, "azimuth_deg"):
            expected = message(
                "meridian_without_azimuth",
                "blank; expected the azimuth of the plane of the meridian",
            )
            log.problem(table.file, expected, row, "azimuth_deg")
        if kind == "equator" and azimuth is not None:
            expected = message(
                "equator_with_azimuth",
                "found {azimuth:g}; expected a blank: the equator has no azimuth",
                azimuth=azimuth,
            )
            log.problem(table.file, expected, row, "azimuth_deg")
        if name is None or kind is None:
            continue
        first = places.setdefault(name, ((kind, azimuth), row))
        if first[0] != (kind, azimuth):
            expected = message(
                "circle_elsewhere",
                "circle {name!r} is another one in row {row}; expected repeats of one circle, or"
                " another name",
                name=name,
                row=first[1],
            )
            log.problem(table.file, expected, row, "circle")


def _refuse_settings(values, raw, log):
    """Refuse settings of strapped spheres if the sphere was not strapped."""
    for key in ("ovality_mm", "form_mm"):
        if values["sphere"][key] is not None:
            expected = message(
                "only_with_circles", "without effect: the job has no great circles by tape"
            )
            tell(log.problem, raw, "sphere", key, expected)


def _check_settings(values, table, tapes, raw, log):
    if values["sphere"]["diameter_m"] is not None:
        expected = message(
            "size_beside_circles",
            "given together with {file}; expected only one of them: the size comes from the"
            " circles",
            file=table.file,
        )
        tell(log.problem, raw, "sphere", "diameter_m", expected)
    check_tape_temperature(table, tapes, raw, log)
    refuse_inside(values, raw, log)
    check_girths(table, values["tank"]["nominal_diameter_m"], MOST_APART, log)


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
    return GreatCircles(Strapping(tuple(straps), **strapping_equipment(tables, tapes)), azimuths)
