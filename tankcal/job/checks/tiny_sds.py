"""Checks of standard deviations of readings that are too small: in metres, or in degrees.

A value finer than any reading causes a warning, because error-free readings may test a formula. A
value that is possible only in another unit is a problem.
"""

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.messages import message
from tankcal.methods.base import methods

LEAST = {"s_mm": 0.02, "s_arcsec": 0.02}  # smallest sd of a scale or circle
SURE = {"s_mm": 0.002, "s_arcsec": 0.002}  # smaller values are in metres or degrees


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
                expected = _expected(column, sd[place], int(is_tiny.sum()))
                tell(column, sd[is_tiny].min(), table.file, expected, table.rows[place], column)
    register = raw.registers.get("instruments")
    for name, given in registers["instruments"].items():
        for key, least in LEAST.items():
            if given.get(key) is not None and 0 < given[key] < least:
                row = register.rows.get(name) if register else None
                column = f"{name}.{key}" if name else key
                file, expected = raw.file_of("instruments"), _expected(key, given[key], 1)
                tell(key, given[key], file, expected, row, column)


def _expected(column, found, count):
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
