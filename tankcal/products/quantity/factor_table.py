"""Reading and checks of a supplied table of volume correction factors."""

import numpy as np

from tankcal.job.entries import read_columns
from tankcal.job.fields import number
from tankcal.job.folder import read_csv
from tankcal.job.tables import read_bytes
from tankcal.messages import message
from tankcal.tank.gauging import LIMITS
from tankcal.tank.volume_correction.corrections import FactorTable
from tankcal.tank.volume_correction.petroleum import DEGREES

TEMPERATURE = "temperature_c"
LEAST_FACTOR, MOST_FACTOR = 0.3, 1.7  # of a plausible table
BASE_TOLERANCE = 2e-4  # largest |factor - 1| at the base: half a step of a printed table


def read_factor_table(path, base, marks, log, settings_file):
    """Read a CSV file of factors: temperatures in the first column, densities as headings.

    Parameters
    ----------
    path : Path
    base : {"15C", "20C", "60F"}
        Base temperature of the factors.
    marks : tuple of str
        Separator and decimal mark, as `read_csv` takes them.
    log : Log
        Receives problems, and a warning if the factors do not follow the density.
    settings_file : str
        File with the section [csv], for messages.

    Returns
    -------
    FactorTable or None
        None after a problem.
    """
    data = read_bytes(path, log)
    raw = None if data is None else read_csv(path.name, data, *marks, log, settings_file)
    if raw is None:
        return None
    densities = _densities(raw, log)
    if densities is None:
        return None
    fields = [
        number(TEMPERATURE, "", *LIMITS["temperature_c"], required=True),
        *(
            number(heading, "", LEAST_FACTOR, MOST_FACTOR, required=True)
            for heading in raw.headings[1:]
        ),
    ]
    before = len(log.problems)
    columns = read_columns(None, raw, log, fields)
    values = [columns.numbers(field.name) for field in fields]
    if len(log.problems) > before:  # a blank cell was reported as well
        return None
    table = FactorTable(path.name, densities, values[0], np.column_stack(values[1:]), base)
    return table if _is_plausible(table, columns, raw, log) else None


def _densities(raw, log):
    """Densities of the headings, kg/m3; None after a problem."""
    first, *others = raw.headings
    if first != TEMPERATURE or len(others) < 2:
        expected = message(
            "factor_table_headings",
            "expected {temperature} as the first heading, then two or more densities in kg/m3, "
            "such as 840", temperature=TEMPERATURE,
        )  # fmt: skip
        log.problem(raw.file, expected, raw.heading_row)
        return None
    densities = []
    low, high = LIMITS["density_kg_m3"]
    for heading in others:
        try:
            value = float(heading.replace(",", "."))
        except ValueError:
            value = np.nan
        if not low <= value <= high or (densities and value <= densities[-1]):
            expected = message(
                "factor_table_density",
                "expected a density in kg/m3, from 300 to 2000, above that of the column before",
            )
            log.problem(raw.file, expected, raw.heading_row, heading)
            return None
        densities.append(value)
    return np.array(densities)


def _is_plausible(table, columns, raw, log):
    """Report rows that do not rise, factors that rise, and a base that is not that of the table."""
    rows, headings = columns.rows, raw.headings[1:]
    if len(rows) < 2:
        expected = message("factor_table_rows", "expected two or more temperatures, a row each")
        log.problem(table.file, expected)
        return False
    before = len(log.problems)
    for place in np.flatnonzero(np.diff(table.temperature_c) <= 0) + 1:
        expected = message(
            "factor_table_temperature", "expected a temperature above that of the row before"
        )
        log.problem(table.file, expected, rows[place], TEMPERATURE)
    for place, column in np.argwhere(np.diff(table.factors, axis=0) > 0):
        expected = message(
            "factor_table_rises",
            "found {value:g} after {before:g}; expected a factor that falls as the temperature "
            "rises", value=table.factors[place + 1, column], before=table.factors[place, column],
        )  # fmt: skip
        log.problem(table.file, expected, rows[place + 1], headings[column])
    if len(log.problems) > before:
        return False
    if table.temperature_c[0] <= table.base_c <= table.temperature_c[-1]:
        at_base = table._interpolate(table.density_kg_m3, table.base_c)
        worst = int(np.argmax(np.abs(at_base - 1)))
        if abs(at_base[worst] - 1) > BASE_TOLERANCE:
            expected = message(
                "factor_table_base",
                "the factor at {base:.4g} {unit} is {value:.5f}; expected 1 at the base: is base "
                "= {name} the base of this table?",
                base=table.base_c, unit=DEGREES, value=at_base[worst], name=table.base,
            )  # fmt: skip
            log.problem(table.file, expected, None, headings[worst])
            return False
    # A heavier product expands less: above the base its factor is larger, below it smaller.
    side = np.sign(table.temperature_c - table.base_c)[:, None]
    against = np.argwhere(side * np.diff(table.factors, axis=1) < 0)
    if len(against):
        place, column = against[0]
        expected = message(
            "factor_table_density_order",
            "{count} factors do not follow the density: a heavier product usually expands less",
            count=len(against),
        )
        log.warning(table.file, expected, rows[place], headings[column + 1])
    return True
