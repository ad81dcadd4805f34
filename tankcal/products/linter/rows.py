"""Rows of a table in SI units, with the values of their last digits, for other packages."""

from dataclasses import dataclass
from math import gcd, isfinite

import numpy as np

from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.products.linter.linting import check_file
from tankcal.products.linter.totals import NO_NOMINAL, NO_UNITS, likely_units

_SAME_UNIT = 1e-6
_SAME_TOP = 1e-3  # relative difference of the tops of tables of one tank in two sheets
_MOST_DIGITS = 6  # largest number of decimals of a rounded number
_SMALL_UNIT_M3, _THOUSANDS = 0.01, 3  # unit and decimals that suggest a thousands separator
_FEWEST_FOR_ROUNDING = 8  # fewest rows that show the rounding


@dataclass(frozen=True)
class TableRows:
    """Rows of a capacity table as printed, in SI units, volumes rising.

    Attributes
    ----------
    name : str
        File, or file and sheet.
    row : (rows,) ndarray of int
        Row numbers in the file.
    height_m : (rows,) ndarray
        Strictly rising; minus the ullage for ullages.
    volume_m3 : (rows,) ndarray
    height_rounding_m : (rows,) ndarray
        Largest rounding error of each height; 0 if the steps are even.
    height_quantum_m : float
        Twice the usual rounding error of a height.
    volume_quantum_m3 : float
        Last digit, or 2, 5, 10 ... of it if all volumes are multiples; 0 if not rounded.
    is_ullage : bool
    U_m3, u_m3 : (rows,) ndarray or None
        Expanded or standard uncertainties, whichever the table has.
    k : float or None
        Coverage factor in the table; the median if rows differ.
    height_unit_m, volume_unit_m3 : float
    joints_m : tuple of float
        Heights at which the area of the cross section or its derivative jumps.
    """

    name: str
    row: np.ndarray
    height_m: np.ndarray
    volume_m3: np.ndarray
    height_rounding_m: np.ndarray
    height_quantum_m: float
    volume_quantum_m3: float
    is_ullage: bool
    U_m3: np.ndarray | None
    u_m3: np.ndarray | None
    k: float | None
    height_unit_m: float
    volume_unit_m3: float
    joints_m: tuple[float, ...]


def read_rows(path, log, sheet=None, declared=NO_UNITS, volume_column=None):
    """Return (`TableRows` or None, `Report`) of the capacity table in a file.

    Parameters
    ----------
    path : path
        As in `lint`.
    log : Log
        Receives problems that prevent use of the rows although the linter finds no error: ambiguous
        units or columns, unreadable uncertainties.
    sheet : str, optional
        None: the sheet with the longest table, or a sheet of the same tank with uncertainties.
    declared : Units
        Sizes of units of columns whose headings state none.
    volume_column : str, optional
        Heading of the column of volumes, if there are several.

    Returns
    -------
    (TableRows or None, Report)
        None if the report has errors, or after reporting to `log`.

    Raises
    ------
    InputError
        If the file cannot be read or contains no table.
    """
    choose = None if sheet is not None else _sheet_with_uncertainties
    result = check_file(path, NO_NOMINAL, sheet, declared, choose)
    tables = [table for table in result.tables if table.volumes is not None]
    if result.report.errors or not tables:
        return None, result.report
    problems_before = len(log.problems)
    selected = _select_table(tables, volume_column, log)
    if selected is None or not (
        _has_clear_units(selected, declared, log) and _has_clear_marks(selected, log)
    ):
        return None, result.report
    rows = _rows(selected, log)
    return (rows if len(log.problems) == problems_before else None), result.report


def _sheet_with_uncertainties(sheets):
    """Index of the sheet with the longest table, or with uncertainties of the same tank."""
    longest = [max(tables, key=lambda table: len(table.entries), default=None) for tables in sheets]
    sizes = [
        0 if longest_table is None else len(longest_table.entries) for longest_table in longest
    ]
    best = sizes.index(max(sizes))
    top = _top(longest[best])
    for number, table in enumerate(longest):
        if table is None or table.uncertainty is None or top is None:
            continue
        top_of_table = _top(table)
        if top_of_table and all(
            abs(a - b) <= _SAME_TOP * abs(a) for a, b in zip(top, top_of_table, strict=True)
        ):
            return number
    return best


def _top(table):
    """(height, volume) of the last row of a table, in SI if its units are stated; or None."""
    last = table.entries[-1]
    if last.height.value is None or last.volume.value is None:
        return None
    height_unit, volume_unit = table.height_unit_m or 1.0, table.volume_unit_m3 or 1.0
    return last.height.value * height_unit, last.volume.value * volume_unit


def _select_table(tables, volume_column, log):
    """Return the selected table; None after reporting that there is none, or more than one."""
    names = [str(table.table.entries[0].volume_column) for table in tables]
    if volume_column is not None:
        matching = [
            candidate
            for candidate, name in zip(tables, names, strict=True)
            if name.strip().casefold() == volume_column.strip().casefold()
        ]
        if len(matching) == 1:
            return matching[0]
        expected = message(
            "former_no_column",
            "no column of volumes {column!r}{hint}; the table has {names}",
            column=volume_column,
            hint=nearest(volume_column, names),
            names=names,
        )
        log.problem(tables[0].table.name, expected)
        return None
    best = max(tables, key=lambda table: len(table.volumes.volume))
    for other_table in tables:
        if other_table is not best and not _agree(best, other_table):
            expected = message(
                "former_many_columns",
                "several columns of volumes that differ ({names}); name one: volume_column in "
                "former.toml",
                names=names,
            )
            log.problem(best.table.name, expected)
            return None
    return best


def _agree(first, second):
    """Whether two tables contain equal values, such as one in m3 and one in litres."""
    h, v = _rows_in_si(first)
    h2, v2 = _rows_in_si(second)
    between = np.interp(h2, h, v)
    return bool(np.all(abs(between - v2) <= _SAME_TOP * max(v[-1], v2[-1])))


def _rows_in_si(checked_table):
    """Heights and volumes of a table in m and m3."""
    return (
        checked_table.volumes.height * checked_table.units.height_m,
        checked_table.volumes.volume * checked_table.units.volume_m3,
    )


def _has_clear_units(checked_table, declared, log):
    """Whether headings state the units, or only one pair of units is plausible for a tank."""
    if not _agrees_with_headings(checked_table, declared, log):
        return False
    if None not in (checked_table.table.height_unit_m, checked_table.table.volume_unit_m3):
        return True
    if checked_table.table.volume_choices:
        expected = message(
            "former_gallons",
            "gallons of no country, US or imperial; expected US gal or imp gal in the heading, or "
            "volume_unit in former.toml",
        )
        log.problem(checked_table.table.name, expected)
        return False
    likely = likely_units(checked_table.table, checked_table.volumes)
    if len(likely) == 1:
        return True
    expected = message(
        "former_no_units",
        "the headings name no units, and {count} pairs of units give a usual tank; expected "
        "height_unit and volume_unit in former.toml",
        count=len(likely),
    )
    log.problem(checked_table.table.name, expected)
    return False


def _agrees_with_headings(checked_table, declared, log):
    """Whether declared units agree with the units in the headings."""
    problems_before = len(log.problems)
    choices = checked_table.table.volume_choices
    if choices and declared.volume_m3 is not None and declared.volume_m3 not in choices:
        expected = message(
            "lint_other_gallons",
            "the heading names gallons; declared units of {declared:g} m3; expected US gal or imp "
            "gal",
            declared=declared.volume_m3,
        )
        log.problem(checked_table.table.name, expected)
        return False
    units = (("m", checked_table.table.height_unit_m, declared.height_m),
            ("m3", checked_table.table.volume_unit_m3, declared.volume_m3))  # fmt: skip
    for unit, matching, declared_size in units:
        if (
            declared_size is not None
            and matching is not None
            and abs(matching / declared_size - 1) > _SAME_UNIT
        ):
            expected = message(
                "lint_other_unit",
                "the heading says units of {said:g} {unit}; declared {declared:g} {unit}",
                said=matching,
                declared=declared_size,
                unit=unit,
            )
            log.problem(checked_table.table.name, expected)
    return len(log.problems) == problems_before


def _has_clear_marks(checked_table, log):
    """Whether 1.327 is 1.327; three decimals of a litre are more likely thousands."""
    entries = [entry for entry in checked_table.series.entries if entry.volume.value]
    is_typed = all(entry.volume.is_typed and not entry.volume.marks for entry in entries)
    is_fine = checked_table.units.volume_m3 < _SMALL_UNIT_M3
    if not (is_typed and is_fine and all(e.volume.decimals == _THOUSANDS for e in entries)):
        return True
    expected = message(
        "former_thousands",
        "found {found} in a unit of {unit:g} m3, and three decimals in every row; expected volumes "
        "without thousands marks: is that one?",
        found=entries[0].volume.text,
        unit=checked_table.units.volume_m3,
    )
    log.problem(checked_table.table.name, expected, entries[0].row, entries[0].volume_column)
    return False


def _rows(checked_table, log):
    """Build the `TableRows` of a table."""
    table, series, units = checked_table.table, checked_table.series, checked_table.units
    place = {float(height): k for k, height in enumerate(series.height)}
    at = [place[float(height)] for height in checked_table.volumes.height]
    entries = [series.entries[k] for k in at]
    rounding = series.rounding[at] * units.height_m
    volume = checked_table.volumes.volume
    U, is_expanded, k = _uncertainties(table, entries, units, log)
    return TableRows(
        name=table.name,
        row=np.array([entry.row for entry in entries]),
        height_m=checked_table.volumes.height * units.height_m,
        volume_m3=volume * units.volume_m3,
        height_rounding_m=rounding,
        height_quantum_m=2 * float(np.median(rounding)),
        volume_quantum_m3=_quantum(volume, checked_table.volumes.decimals) * units.volume_m3,
        is_ullage=series.direction < 0,
        U_m3=U if is_expanded else None,
        u_m3=None if is_expanded else U,
        k=k,
        height_unit_m=units.height_m,
        volume_unit_m3=units.volume_m3,
        joints_m=tuple(joint * units.height_m for joint in checked_table.volumes.joints),
    )


def _quantum(volume, decimals):
    """1, 2 or 5 times a power of ten of which all volumes are multiples; 0: not rounded."""
    if decimals > _MOST_DIGITS:
        return 0.0
    digits = np.rint(volume * 10.0**decimals)
    common = gcd(*(int(digit) for digit in digits)) if len(digits) >= _FEWEST_FOR_ROUNDING else 1
    fits = [multiple * 10**power for power in range(6) for multiple in (1, 2, 5)]
    coarsest = max(fit for fit in fits if common % fit == 0)
    return coarsest * 10.0**-decimals


def _uncertainties(table, entries, units, log):
    """Return ((rows,) in m3 or None, whether expanded, k or None) from the columns of the table."""
    heading = table.uncertainty
    if heading is None:
        return None, True, None
    values = []
    for entry in entries:
        reading = entry.uncertainty
        if reading is not None and reading.value is not None and reading.value >= 0:
            values.append(reading.value)
            continue
        values.append(np.nan)
        complaint = reading.complaint if reading is not None and reading.value is None else None
        expected = complaint or message(
            "former_negative_U",
            "found {found}; expected an uncertainty of 0 or more",
            found=reading.text if reading else "",
        )
        column = message("former_column_of_U", "uncertainties")
        log.problem(table.name, expected, entry.row, column)
    size = units.volume_m3 if heading.unit is None else heading.unit
    volume_m3 = np.array([entry.volume.value for entry in entries]) * units.volume_m3
    scale = volume_m3 / 100 if heading.in_percent else size
    factors = [e.k.value for e in entries if e.k is not None and e.k.value is not None]
    k = heading.k if heading.k is not None else (float(np.median(factors)) if factors else None)
    if k is not None and not (isfinite(k) and 0 < k <= 100):
        k = None
    return np.array(values) * scale, heading.is_expanded, k
