"""Standard deviations of readings of a wall that no reading has: in metres, or in degrees.

What is merely finer than anybody reads is doubted, for readings may be made up without errors to
check a formula; what is so only in another unit is refused.
"""

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.messages import message

LEAST = {"s_mm": 0.02, "s_arcsec": 0.02}  # smaller than any scale or circle is read
SURE = {"s_mm": 0.002, "s_arcsec": 0.002}  # millimetres that are metres, seconds that are degrees
READ = ("circumferences", "great_circles", "offsets", "wall_hits", "tangents", "tape_checks")


def check_tiny_sds(tables, registers, raw, log):
    """A line for each column of readings, and each instrument, whose standard deviations are
    smaller than those of any reading, though not all in the file have to be.
    """

    def tell(column, smallest, *told):
        (log.problem if smallest < SURE[column] else log.warning)(*told)

    for name in READ:
        table = tables.get(name)
        if not has_rows(table):
            continue
        for column, least in LEAST.items():
            if table.columns.get(column) is None:
                continue
            sd = table.numbers(column)
            tiny = (sd > 0) & (sd < least)
            if tiny.any():
                place = int(np.argmax(tiny))
                expected = _expected(column, sd[place], int(tiny.sum()))
                tell(column, sd[tiny].min(), table.file, expected, table.rows[place], column)
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
