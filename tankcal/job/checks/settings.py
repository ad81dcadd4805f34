"""Checks of related settings: heights of the datum, liquid of the survey, densities, table rows.

Checks of standard deviations of readings that are too small: in metres, or in degrees.

A value finer than any reading causes a warning, because error-free readings may test a formula. A
value that is possible only in another unit is a problem.
"""

import math
from itertools import pairwise

import numpy as np

from tankcal.job.checking import (
    RELATIVE_DENSITY,
    has_rows,
    is_not_given,
    loads_the_shell,
    missing_beside,
    tell,
)
from tankcal.job.checks.extent import has_wall_points
from tankcal.job.contract.bottom import rise_of_bottom
from tankcal.job.plausibility import DENSITIES_KG_M3
from tankcal.messages import message
from tankcal.methods.base import methods
from tankcal.units import INCH_M

# Rows of the capacity table: step, fine zones, number of rows.

MAX_TABLE_ROWS = 25_000  # a tank of 20 m in millimetres has a certificate of 90 pages
COARSE_STEP_M = 0.5  # largest plausible step
INCH_STEPS_M = {"ft-in-8": INCH_M / 8, "ft-in-16": INCH_M / 16}
LEAST = {"s_mm": 0.02, "s_arcsec": 0.02}  # smallest sd of a scale or circle
SURE = {"s_mm": 0.002, "s_arcsec": 0.002}  # smaller values are in metres or degrees


def check_steps(table, extent, raw, log):
    """Check the step of the table and of its fine zones.

    Parameters
    ----------
    table : dict
        {key: value} of the section.
    extent : Extent
        Size of the tank, possibly unknown.
    raw : RawJob
        Job as read.
    log : Log
        Receives problems and warnings.
    """
    step = INCH_STEPS_M.get(table["height_unit"], table["step_m"])
    _check_presence(table, raw, log)
    if step is not None:
        _check_step(step, table, extent.height_m, raw, log)
    _check_zones(table["fine_zones"] or (), extent, raw, log)
    fine, zones = table["fine_step_m"], table["fine_zones"] or ()
    ratio = 0.0 if None in (fine, step) else step / fine
    if ratio and (ratio < 1.5 or abs(ratio - round(ratio)) > 1e-6):
        expected = message(
            "fine_step_no_part",
            "found {fine:g}; expected the step of the table, {step:g} m, divided by a whole number",
            fine=fine,
            step=step,
        )
        tell(log.problem, raw, "table", "fine_step_m", expected)
    elif fine is not None and sum(high - low for low, high in zones) / fine > MAX_TABLE_ROWS:
        expected = message(
            "fine_rows_too_many",
            "found {fine:g}; expected at most {most} rows in the fine zones",
            fine=fine,
            most=MAX_TABLE_ROWS,
        )
        tell(log.problem, raw, "table", "fine_step_m", expected)


def ullage_without_reference():
    """Message about ullages without the height from which they are measured."""
    return message(
        "ullage_without_reference",
        "ullages are measured from the reference height; expected datum.reference_height_m",
    )


def _check_presence(table, raw, log):
    def tell_problem(key, expected):
        tell(log.problem, raw, "table", key, expected)

    is_in_inches, step = table["height_unit"] in INCH_STEPS_M, table["step_m"]
    if is_in_inches and table["heights_in"] is not None:
        tell_problem(
            "heights_in",
            message(
                "two_units_of_heights",
                "given beside height_unit = {unit}; expected a single unit of heights",
                unit=table["height_unit"],
            ),
        )
    if table["ullage"] and is_not_given(raw, "datum", "reference_height_m"):
        tell_problem("ullage", ullage_without_reference())
    if is_in_inches and step is not None:
        tell_problem(
            "step_m",
            message(
                "step_beside_inches",
                "found {step:g}; expected a blank: {unit} is the step",
                step=step,
                unit=table["height_unit"],
            ),
        )
    no_error_limit = is_not_given(raw, "table", "max_interpolation_error_l")
    if not is_in_inches and no_error_limit and is_not_given(raw, "table", "step_m"):
        expected = message(
            "step_missing",
            "missing; expected the step of the capacity table, or max_interpolation_error_l, or "
            "height_unit = ft-in-8 or ft-in-16",
        )
        tell_problem("step_m", expected)
    for given, missing in (("fine_step_m", "fine_zones"), ("fine_zones", "fine_step_m")):
        if table[given] is not None and is_not_given(raw, "table", missing):
            tell_problem(missing, missing_beside(given))
    if table["fine_step_m"] is not None and (is_in_inches or is_not_given(raw, "table", "step_m")):
        expected = message(
            "fine_step_without_step",
            "given without step_m; expected fine zones only in a table with step_m",
        )
        tell_problem("fine_step_m", expected)


def _check_step(step, table, height, raw, log):
    key = "step_m" if table["step_m"] is not None else "height_unit"
    if height is None:
        return
    if step >= height:
        expected = message(
            "step_above_height",
            "found {step:g}; expected less than the height, {height:g} m: is it in millimetres?",
            step=step,
            height=height,
        )
        tell(log.problem, raw, "table", key, expected)
    elif height / step > MAX_TABLE_ROWS:
        expected = message(
            "table_too_long",
            "{rows:.0f} rows in the table, expected at most {most}: a step of {least:g} m or more",
            rows=height / step,
            most=MAX_TABLE_ROWS,
            least=math.ceil(1e5 * height / MAX_TABLE_ROWS) / 1e5,
        )
        tell(log.problem, raw, "table", key, expected)
    elif step > COARSE_STEP_M:
        expected = message(
            "coarse_step",
            "{step_m:g} m is a coarse step for a table: is it in another unit?",
            step_m=step,
        )
        tell(log.warning, raw, "table", key, expected)


def _check_zones(zones, extent, raw, log):
    def tell_problem(expected):
        tell(log.problem, raw, "table", "fine_zones", expected)

    top = extent.top_m if extent.top_m is not None else extent.height_m
    for low, high in zones:
        if low >= high:
            expected = message(
                "zone_upside_down",
                "found {low:g}-{high:g}; expected the lower dip first",
                low=low,
                high=high,
            )
            tell_problem(expected)
        elif top is not None and high > top + 1e-9:
            expected = message(
                "zone_above_top",
                "found {low:g}-{high:g}; expected dips up to {top:g} m: is it in another unit?",
                low=low,
                high=high,
                top=top,
            )
            tell_problem(expected)
    for (low, high), (next_low, next_high) in pairwise(sorted(zones)):
        if next_low < high:
            expected = message(
                "zones_overlap",
                "{low:g}-{high:g} and {next_low:g}-{next_high:g} overlap; expected zones "
                "that do not overlap",
                low=low,
                high=high,
                next_low=next_low,
                next_high=next_high,
            )
            tell_problem(expected)


MAX_DIP_OFFSET_M = 1.0  # largest distance of dip plate and bottom
DENSITIES = (
    ("survey", "liquid_density_kg_m3"),
    ("table", "liquid_density_kg_m3"),
    ("table", "other_densities_kg_m3"),
    ("roof", "reference_density_kg_m3"),
    ("liquid", "density_kg_m3"),
)


def check_settings(values, tables, extent, kind, raw, log):
    """Check datum, deliveries, pairs of keys and densities; parameters as in `check_tank`."""
    datum, table = values["datum"], values["table"]
    _check_dip_plate(values, tables, kind, raw, log)
    for given, missing in (("dip_x_m", "dip_y_m"), ("dip_y_m", "dip_x_m")):
        if datum[given] is not None and is_not_given(raw, "datum", missing):
            tell(log.problem, raw, "datum", missing, missing_beside(given))
    _check_survey_liquid(values["survey"], extent, raw, log)
    _check_densities(values, raw, log)
    if table["other_densities_kg_m3"] and not loads_the_shell(values):
        expected = message(
            "densities_without_head",
            "given with corrections.head = false; expected one or the other",
        )
        tell(log.problem, raw, "table", "other_densities_kg_m3", expected)
    _check_deliveries(table["minimum_delivery_m"] or (), extent, raw, log)
    _check_country(values["certificate"].get("country"), raw, log)
    certificate, surveyed = values["certificate"], values["survey"]["date"]
    issued, last_day = certificate.get("date_of_issue"), certificate.get("survey_end")
    if last_day and surveyed and last_day < surveyed:
        expected = message(
            "ended_before_survey",
            "found {last_day}, before the first day {surveyed}; expected no earlier day",
            last_day=last_day,
            surveyed=surveyed,
        )
        tell(log.problem, raw, "certificate", "survey_end", expected)
    surveyed = max(filter(None, (surveyed, last_day)), default=None)
    if issued and surveyed and issued < surveyed:
        expected = message(
            "issued_before_survey",
            "found {issued}, before the survey of {surveyed}; expected no earlier day",
            issued=issued,
            surveyed=surveyed,
        )
        tell(log.problem, raw, "certificate", "date_of_issue", expected)


def _check_country(country, raw, log):
    """Require the two-letter code of the country of issue, for the digital certificate."""
    if country and not (len(country) == 2 and country.isascii() and country.isalpha()):
        expected = message(
            "country_unknown",
            "found {found!r}; expected the two letters of a country by ISO 3166-1, such as: BR",
            found=country,
        )
        tell(log.problem, raw, "certificate", "country", expected)


def _check_deliveries(heights, extent, raw, log):
    """Require different heights of minimum deliveries, within the height of the tank."""
    for place, height in enumerate(heights):
        expected = ""
        if extent.height_m is not None and height > extent.height_m:
            expected = message(
                "delivery_too_high",
                "found {height:g}; expected at most the height of the tank, {height_m:g} m",
                height=height,
                height_m=extent.height_m,
            )
        elif height in heights[:place]:
            expected = message(
                "delivery_twice", "found {height:g}; expected it once", height=height
            )
        if expected:
            tell(log.problem, raw, "table", "minimum_delivery_m", expected)


def _check_dip_plate(values, tables, kind, raw, log):
    """Compare the dip plate with the bottom; before a scan is fitted, its bottom is unknown."""
    plate, bottoms = values["datum"]["dip_plate_z_m"], bottoms_z(values, tables, kind)
    if plate is None or not bottoms:
        return
    low, high = min(bottoms), max(bottoms)
    if kind in ("horizontal", "sphere") and plate < low:
        expected = message(
            "plate_below_tank",
            "{below:g} m below the inside bottom; expected 0 or above: there is no liquid below it",
            below=low - plate,
        )
        tell(log.problem, raw, "datum", "dip_plate_z_m", expected)
        return
    if low - MAX_DIP_OFFSET_M <= plate <= high + MAX_DIP_OFFSET_M:
        return
    edge = values["datum"]["bottom_z_m"]
    of_edge = "" if edge is None else message("of_edge", " (bottom_z_m = {edge:g})", edge=edge)
    above, below = plate - high, low - plate
    if above > 0:
        expected = message(
            "plate_above_bottom",
            "{above:g} m above the bottom{of_edge}; expected at most {most:g} m: is it in "
            "another unit or frame?",
            above=above,
            of_edge=of_edge,
            most=MAX_DIP_OFFSET_M,
        )
    else:
        expected = message(
            "plate_below_bottom",
            "{below:g} m below the bottom{of_edge}; expected at most {most:g} m: is it in "
            "another unit or frame?",
            below=below,
            of_edge=of_edge,
            most=MAX_DIP_OFFSET_M,
        )
    tell(log.problem, raw, "datum", "dip_plate_z_m", expected)


def bottoms_z(values, tables, kind):
    """Known heights of the bottom, m, in the frame of the points."""
    if kind in ("horizontal", "sphere"):
        return [] if has_wall_points(tables) else [0.0]
    if values["datum"]["bottom_z_m"] is None:
        return []
    surveyed = [] if tables["bottom"] is None else tables["bottom"].of("z_m")
    edge, rise = values["datum"]["bottom_z_m"], rise_of_bottom(values)
    centre = None if rise is None else edge + rise
    return [z for z in (edge, centre, *surveyed) if z is not None]


def _check_survey_liquid(survey, extent, raw, log):
    level, density = survey["liquid_level_m"], survey["liquid_density_kg_m3"]
    if density and is_not_given(raw, "survey", "liquid_level_m"):
        expected = message(
            "density_without_level",
            "a density without liquid_level_m; set both to 0 when the tank was empty",
        )
        tell(log.problem, raw, "survey", "liquid_density_kg_m3", expected)
    if level and (density == 0 or is_not_given(raw, "survey", "liquid_density_kg_m3")):
        expected = message(
            "level_without_density",
            "missing, but liquid_level_m = {level:g}; expected the density of the liquid",
            level=level,
        )
        tell(log.problem, raw, "survey", "liquid_density_kg_m3", expected)
    if level and extent.top_m is not None and level > extent.top_m:
        expected = message(
            "level_above_shell",
            "found {level:g}; expected at most the top of the shell, {top_m:g} m above the "
            "table's zero: is it in another unit?",
            level=level,
            top_m=extent.top_m,
        )
        tell(log.problem, raw, "survey", "liquid_level_m", expected)


def _check_densities(values, raw, log):
    lightest, heaviest = DENSITIES_KG_M3
    for section, key in DENSITIES:
        given = values[section][key]
        for density in given if isinstance(given, tuple) else (given,):
            if not density:
                continue
            if density < RELATIVE_DENSITY:
                expected = message(
                    "density_in_g_cm3",
                    "found {density:g}; expected kg/m3, such as 850: is it in g/cm3?",
                    density=density,
                )
                tell(log.problem, raw, section, key, expected)
            elif not lightest <= density <= heaviest:
                expected = message(
                    "strange_density",
                    "{density_kg_m3:g} kg/m3; liquids in tanks have {least:g} to {most:g}",
                    density_kg_m3=density,
                    least=lightest,
                    most=heaviest,
                )
                tell(log.warning, raw, section, key, expected)
    table = values["table"]
    all_of_table = [*(table["other_densities_kg_m3"] or ()), table["liquid_density_kg_m3"]]
    if len(set(all_of_table)) < len(all_of_table):
        expected = message(
            "density_twice",
            "a density is given twice, or is that of liquid_density_kg_m3; expected other "
            "densities",
        )
        tell(log.problem, raw, "table", "other_densities_kg_m3", expected)
    of_table, of_roof = table["liquid_density_kg_m3"], values["roof"]["reference_density_kg_m3"]
    if of_table and of_roof and of_table != of_roof:
        text = message(
            "roof_density",
            "{roof_kg_m3:g} kg/m3 beside {table_kg_m3:g} kg/m3 of the table: roof and liquid "
            "head are computed for different liquids",
            roof_kg_m3=of_roof,
            table_kg_m3=of_table,
        )
        tell(log.warning, raw, "roof", "reference_density_kg_m3", text)


# ---- checks of standard deviations of readings that are too small: in metres, or in degrees


def check_tiny_sds(tables, registers, raw, log):
    """Report each column, and each instrument, with standard deviations too small for any reading.

    One small value is sufficient; the other values of the column may be plausible.
    """

    def tell(column, smallest, *details):
        (log.problem if smallest < SURE[column] else log.warning)(*details)

    of_methods = (name for method in methods() for name in method.tables_with_sds)
    for name in (*of_methods, "tape_checks"):
        table = tables.get(name)
        if not has_rows(table):
            continue
        for column, least in LEAST.items():
            if table.columns.get(column) is None:
                continue
            sd = table.numbers(column)
            is_tiny = (sd > 0) & (sd < least)
            if is_tiny.any():
                place = int(np.argmax(is_tiny))
                expected = _sd_message(column, sd[place], int(is_tiny.sum()))
                tell(column, sd[is_tiny].min(), table.file, expected, table.rows[place], column)
    register = raw.registers.get("instruments")
    for name, given in registers["instruments"].items():
        for key, least in LEAST.items():
            if given.get(key) is not None and 0 < given[key] < least:
                row = register.rows.get(name) if register else None
                column = f"{name}.{key}" if name else key
                file, expected = raw.file_of("instruments"), _sd_message(key, given[key], 1)
                tell(key, given[key], file, expected, row, column)


def _sd_message(column, found, count):
    if column == "s_mm":
        return message(
            "sd_below_any_mm",
            "found {found:g}, and {count} in all below {least:g}; expected millimetres: is it in"
            " metres?",
            found=found,
            count=count,
            least=LEAST[column],
        )
    return message(
        "sd_below_any_arcsec",
        "found {found:g}, and {count} in all below {least:g}; expected seconds of arc: is it in"
        " degrees or gon?",
        found=found,
        count=count,
        least=LEAST[column],
    )
