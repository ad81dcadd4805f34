"""Read a former table: rows with the linter's readers, other facts from former.toml."""

from dataclasses import dataclass, replace
from math import gcd, isfinite
from pathlib import Path

import numpy as np

from tankcal.errors import InputError
from tankcal.job.tables import Log, nearest
from tankcal.messages import message
from tankcal.products.linter.linting import check_file
from tankcal.products.linter.volumes import NO_NOMINAL, NO_UNITS, likely_units
from tankcal.products.recalibration.former import (
    FormerFacts,
    FormerRoof,
    FormerTable,
    read_former_facts,
)
from tankcal.record import load
from tankcal.record.covariance_factor import factor_of

MOST_FINDINGS = 20  # largest number of linter findings listed in an error
USUAL_K = 2.0
_RECORD_VALUES = (
    "reference_temperature_c", "liquid_density_kg_m3", "reference_height_m", "date", "method",
    "laboratory", "number", "kind", "dip_from_a_m",
)  # fmt: skip


def read_former(path, former_toml=None) -> FormerTable:
    """Read a former capacity table.

    Parameters
    ----------
    path : path
        A CSV file, an Excel workbook (.xlsx), a PDF with a text table, or a record.json of
        tankcal; heights in any unit that its headings name, feet and inches, or ullages. Or a
        former.toml that names such a file under `file`.
    former_toml : path, optional
        former.toml with other facts about the table (docs/read-table.md).

    Returns
    -------
    FormerTable
        Table in SI units, with rising dips, and the warnings of the linter.

    Raises
    ------
    InputError
        With all problems: of former.toml, of an unreadable file, errors found by the linter, and
        undetermined units, columns or reference heights.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from tankcal.products.recalibration.reading import read_former
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "old.csv")
    ...     size = path.write_text("Dip (cm);Volume (L)\\n0;0\\n10;1629\\n20;3259\\n30;4889\\n")
    ...     former = read_former(path)
    >>> former.height_m.tolist(), former.volume_m3.tolist(), former.volume_quantum_m3
    ([0.0, 0.1, 0.2, 0.3], [0.0, 1.629, 3.259, 4.889], 0.001)
    """
    path, log = Path(path), Log()
    declared = FormerFacts()
    if former_toml is None and path.suffix.lower() == ".toml":
        former_toml = path
        declared = read_former_facts(path, log)
        path = _find_named_file(declared, path, log)
    elif former_toml is not None:
        declared = read_former_facts(former_toml, log)
        _check_name(declared, path, log)
    rows, warnings = _read_rows(path, declared, log)
    if rows is None:
        log.stop_if_problems()
        raise AssertionError("no rows and no problem")
    with path.open("rb") as file:
        start = file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n")
    record = load(path) if path.suffix.lower() == ".json" or start[:1] == b"{" else None
    if record is None:
        former = _table_from_rows(rows, declared, log)
    else:
        former = _table_from_record(path, record, declared, log)
    log.stop_if_problems()
    return replace(former, warnings=warnings + tuple(log.warnings))


def _find_named_file(declared, path, log):
    """Return the file of the table named in a former.toml; raise InputError if none is named."""
    if declared["file"] is None:
        if not log.problems:
            expected = message("former_no_file", "missing; expected the table's file")
            declared.tell(log, "file", expected)
        log.stop_if_problems()
    named = Path(declared["file"])
    if named.name != declared["file"] or named.name in (".", ".."):
        expected = message(
            "former_file_elsewhere",
            "found {found}; expected the plain name of a file beside former.toml",
            found=declared["file"],
        )
        declared.tell(log, "file", expected)
        log.stop_if_problems()
    return path.parent / named


def _check_name(declared, path, log):
    if declared["file"] is not None and Path(declared["file"]).name != path.name:
        expected = message(
            "former_other_file",
            "found {found}, but the table is {name}; expected what is known of that one",
            found=declared["file"],
            name=path.name,
        )
        declared.tell(log, "file", expected)


def _read_rows(path, declared, log):
    """Return (TableRows or None, warnings); errors of the linter are reported to `log`."""
    try:
        rows, report = read_rows(
            path, log, declared["sheet"], declared.units, declared["volume_column"]
        )
    except InputError as error:
        log.problems += error.problems[:MOST_FINDINGS]
        return None, ()
    errors = [finding.problem for finding in report.findings if finding.severity == "error"]
    if errors:
        expected = message(
            "former_is_wrong",
            "the table has errors ({count}), so nothing is computed from it; correct them first "
            "(tankcal lint shows all)",
            count=len(errors),
        )
        log.problem(path.name, expected)
        log.problems += errors[:MOST_FINDINGS]
        return None, ()
    return rows, tuple(finding.problem for finding in report.findings)


def _table_from_rows(rows, declared, log):
    """Return the FormerTable of rows and of declared facts."""
    height = rows.height_m
    if rows.is_ullage:
        height = _dips(rows, declared, log)
    U, k = _uncertainty(rows, declared, log)
    quantum = declared["rounding_m3"] or rows.volume_quantum_m3
    return FormerTable(
        name=str(rows.name),
        height_m=height,
        volume_m3=rows.volume_m3,
        height_quantum_m=rows.height_quantum_m,
        volume_quantum_m3=quantum,
        U_m3=U,
        k=k,
        common=declared["common"],
        roof=declared.roof,
        height_rounding_m=rows.height_rounding_m,
        row=rows.row,
        **{key: declared[key] for key in _RECORD_VALUES},
    )


def _dips(rows, declared, log):
    """Return dips (rows,) from ullages and the reference height."""
    reference = declared["reference_height_m"]
    if reference is None:
        expected = message(
            "former_ullages",
            "a table of ullages; expected reference_height_m in former.toml, from the dip plate "
            "to the point that ullages count from",
        )
        log.problem(rows.name, expected)
        return rows.height_m
    dips = np.round(reference + rows.height_m, 9)
    lowest = float(dips[0])
    if lowest < -rows.height_quantum_m - 1e-9:
        expected = message(
            "former_low_reference",
            "the largest ullage is {ullage:g} m, {below:g} m more than reference_height_m; "
            "expected a reference height of at least that",
            ullage=-float(rows.height_m[0]),
            below=-lowest,
        )
        log.problem(rows.name, expected, int(rows.row[0]))
    return dips


def _uncertainty(rows, declared, log):
    """Return ((rows,) U in m3 or None, k), from the table or as declared."""
    k = rows.k if rows.k is not None else declared["k"]
    in_table = rows.U_m3 is not None or rows.u_m3 is not None
    if declared.uncertainty is not None and in_table:
        expected = message(
            "former_U_twice",
            "given, but the table has a column of uncertainties; expected only one of them",
        )
        declared.tell(log, declared.uncertainty[0], expected)
        return None, USUAL_K
    if not in_table and declared.uncertainty is None:
        return None, k or USUAL_K
    if k is None:
        k = USUAL_K
        if rows.U_m3 is not None:
            text = message(
                "former_no_factor",
                "expanded uncertainties without a coverage factor: taken as k = {k:g}",
                k=k,
            )
            log.warning(rows.name, text)
    if rows.U_m3 is not None:
        return rows.U_m3, k
    if rows.u_m3 is not None:
        return k * rows.u_m3, k
    key, value = declared.uncertainty
    scale = rows.volume_m3 / 100 if key.endswith("percent") else np.ones(len(rows.volume_m3))
    return (value if key.startswith("U") else k * value) * scale, k


def _table_from_record(path, record, declared, log):
    """Return the FormerTable of a record; declared facts must not contradict it."""
    table, job = record["capacity"], record["job"]
    certificate, choices = job.get("certificate") or {}, _choices(record)
    density = choices.get("head", job["table"].get("liquid_density_kg_m3"))
    survey = job.get("survey") or {}
    values = {
        "reference_temperature_c": job["table"].get("reference_temperature_c"),
        "liquid_density_kg_m3": density if isinstance(density, int | float) else 0.0,
        "reference_height_m": (job.get("datum") or {}).get("reference_height_m"),
        "date": survey.get("date"),
        "method": certificate.get("method") or choices.get("survey"),
        "laboratory": certificate.get("laboratory"),
        "number": certificate.get("number"),
        "kind": job["tank"].get("kind"),
        "dip_from_a_m": (job.get("horizontal") or {}).get("dip_from_a_m"),
    }
    for key in _RECORD_VALUES:
        stated = declared[key]
        if values[key] is None:
            values[key] = stated
        elif stated is not None and not _are_equal(stated, values[key]):
            expected = message(
                "former_against_record",
                "found {found}, but the record has {has}; expected no such key: it is taken from "
                "the record",
                found=str(stated),
                has=str(values[key]),
            )
            declared.tell(log, key, expected)
    for key in ("U_m3", "U_percent", "u_m3", "u_percent", "k", "rounding_m3"):
        if declared[key] is not None:
            expected = message(
                "former_known_to_record",
                "given for a record of tankcal, which has it; expected no such key",
            )
            declared.tell(log, key, expected)
    return FormerTable(
        name=path.name,
        height_m=np.array(table["height_m"], dtype=float),
        volume_m3=np.array(table["volume_m3"], dtype=float),
        U_m3=np.array(table["stated_U_m3"], dtype=float),
        k=float(np.median(table["k"])),
        common=declared["common"],
        roof=_roof_of_record(record) or declared.roof,
        factor_m3=factor_of(table),
        record=record,
        **values,
    )


def _choices(record):
    return {choice["code"]: choice["value"] for choice in record["choices"]}


def _are_equal(stated, has):
    if isinstance(stated, int | float) and isinstance(has, int | float):
        return abs(stated - has) <= 1e-9 * max(abs(stated), abs(has))
    return stated == has


def _roof_of_record(record):
    """Return the FormerRoof deducted in the record's table, or None."""
    details = {roof["code"]: roof["value"] for roof in record.get("roof") or ()}
    if not details or _choices(record).get("roof") == "off":
        return None
    critical = details.get("roof_critical_bottom"), details.get("roof_critical_top")
    return FormerRoof(
        float(details["roof_mass"]),
        float(details["roof_reference_density"]),
        details["roof_weighing"],
        None if None in critical else tuple(map(float, critical)),
    )


# ---- rows in SI

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
    rows = _table_rows(selected, log)
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


def _table_rows(checked_table, log):
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
