"""Examine a file and return its findings."""

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.tables import Log, nearest
from tankcal.messages import message
from tankcal.products.linter.grids import read_grids
from tankcal.products.linter.heights import Series, check_heights
from tankcal.products.linter.layout import Table, find_tables
from tankcal.products.linter.volumes import (
    NO_NOMINAL,
    NO_UNITS,
    Nominal,
    Units,
    Volumes,
    check_totals,
    check_volumes,
    choose_units,
)
from tankcal.text.display import table_html

# Largest number of rows of proportional parts: 9 for a centimetre, 7 or 15 for an inch.
MOST_PARTS = 15
_SAME_AREA = 0.02  # largest relative deviation of parts from the rise of the table
_PART_OF_LARGEST = 0.5  # smallest share of the rows of the largest table of a capacity table
_ROWS_OF_SLOPE = 10  # rows over which the area of the cross section is averaged


@dataclass(frozen=True)
class Finding:
    """A finding about a table.

    Attributes
    ----------
    severity : str
        "error" or "warning".
    problem : Problem
        With its row and column.
    """

    severity: str
    problem: Problem

    def __str__(self):
        return str(self.text)

    @property
    def text(self):
        """The complete line as a Message."""
        expected = self.problem.expected
        if self.severity == "error":
            text = message("is_error", "error: {text}", text=expected)
        else:
            text = message("is_warning", "warning: {text}", text=expected)
        return replace(self.problem, expected=text).text


@dataclass(frozen=True, repr=False)
class Report:
    """Findings about the tables of a file.

    Attributes
    ----------
    findings : tuple of Finding
        In the order of the file.
    summaries : tuple of str
        One line about each table read.
    """

    findings: tuple[Finding, ...]
    summaries: tuple[str, ...]

    @property
    def errors(self):
        """Number of findings that are errors."""
        return sum(finding.severity == "error" for finding in self.findings)

    def __str__(self) -> str:
        warnings = len(self.findings) - self.errors
        return f"{self.errors} errors, {warnings} warnings"

    def __repr__(self) -> str:
        return f"<Report of {self}>"

    def _repr_html_(self) -> str:
        rows = [
            [
                finding.severity,
                finding.problem.row,
                finding.problem.column,
                str(finding.problem.expected),
            ]
            for finding in self.findings
        ]
        caption = "; ".join([*self.summaries, str(self)])
        return table_html(caption, ["", "row", "column", "finding"], rows)


def lint(
    path: str | PathLike,
    nominal: Nominal = NO_NOMINAL,
    sheet: str | None = None,
    even_steps: bool = True,
) -> Report:
    """Examine the capacity table in a file.

    Parameters
    ----------
    path : path
        A CSV file, an Excel workbook (.xlsx), a PDF with the table as text, or a record.json of
        tankcal.
    nominal : Nominal, optional
        Nominal tank to compare total and last row with.
    sheet : str, optional
        Name of the sheet; None: the sheet with the longest table.
    even_steps : bool, optional
        False: the rows are breakpoints without even steps, so that no row is missing and no height
        is odd.

    Returns
    -------
    Report

    Raises
    ------
    InputError
        If the file cannot be read or contains no table.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import tankcal
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "table.csv")
    ...     size = path.write_text("height_m,volume_m3\\n0,0\\n0.1,10\\n0.2,19\\n0.3,18\\n")
    ...     report = tankcal.lint(path)
    >>> print(report)
    1 errors, 0 warnings
    >>> print(report.findings[0].problem.expected)
    found 18 after 19; expected volumes that do not fall
    """
    return check_file(path, nominal, sheet, even_steps=even_steps).report


@dataclass(frozen=True)
class CheckedTable:
    """A table and the results of its checks; all results None if it cannot be read."""

    table: Table
    series: Series | None
    volumes: Volumes | None
    units: Units | None


@dataclass(frozen=True)
class CheckedFile:
    """Report of a file, and its capacity tables, the longest ones."""

    report: Report
    tables: tuple[CheckedTable, ...]


def check_file(
    path,
    nominal=NO_NOMINAL,
    sheet=None,
    declared=NO_UNITS,
    choose=None,
    even_steps=True,
):
    """Return the `CheckedFile` tables of a file, examined as in `lint`.

    Parameters
    ----------
    path : path
    nominal : Nominal, optional
    sheet : str, optional
        As in `lint`.
    declared : Units, optional
        Units of columns whose headings state none; None for unknown ones.
    choose : callable, optional
        Function of the tables of all sheets that returns the index of the sheet; None: the sheet
        with the longest table.
    even_steps : bool, optional
        As in `lint`.
    """
    path, log = Path(path), Log()
    grids = read_grids(path, log)
    log.stop_if_problems()
    tables = _select_tables(path.name, grids, sheet, log, choose)
    tables = [_apply_declared_units(table, declared) for table in tables]
    longest = max(len(table.entries) for table in tables)
    complaints = [
        problem
        for table in tables
        if len(table.entries) >= _PART_OF_LARGEST * longest
        for problem in table.complaints
    ]
    if complaints:
        raise InputError(list(dict.fromkeys(complaints)))
    summaries, areas, checked_tables = [], None, []
    for table in tables:
        if len(table.entries) >= _PART_OF_LARGEST * longest:
            has_several = sum(other_table.name == table.name for other_table in tables) > 1
            checked_table, summary, areas = _check_table(
                table, nominal, log, even_steps, has_several
            )
            summaries.append(summary)
            checked_tables.append(checked_table)
    for table in tables:
        if len(table.entries) <= MOST_PARTS < longest:
            _check_parts(table, areas, log)
    report = Report(_findings(log), tuple(line for line in summaries if line))
    return CheckedFile(report, tuple(checked_tables))


def _apply_declared_units(table, declared):
    """Return the table with declared units where its headings state none."""
    choices = table.volume_choices
    is_choice = not choices or declared.volume_m3 in choices
    is_settled = bool(choices) and is_choice and declared.volume_m3 is not None
    return replace(
        table,
        height_unit_m=table.height_unit_m or declared.height_m,
        volume_unit_m3=table.volume_unit_m3 or (declared.volume_m3 if is_choice else None),
        volume_choices=() if is_settled else choices,
    )


def _select_tables(file, grids, sheet, log, choose=None):
    """Return the tables of the selected sheet; raise InputError if there is none."""
    if sheet is not None:
        names = [grid.sheet for grid in grids if grid.sheet]
        if sheet not in names:
            expected = message(
                "lint_no_sheet",
                "no sheet {sheet!r}{hint}; the file has {names}",
                sheet=sheet,
                hint=nearest(sheet, names),
                names=", ".join(names) or message("lint_no_sheets", "none"),
            )
            raise InputError(Problem(file, expected))
        grids = [grid for grid in grids if grid.sheet == sheet]
    sheets_read = []
    for grid in grids:
        sheet_log = Log()
        tables = find_tables(grid, sheet_log)
        size = max((len(table.entries) for table in tables), default=0)
        sheets_read.append((size, tables, sheet_log))
    size, tables, sheet_log = max(
        sheets_read, key=lambda candidate: candidate[0], default=(0, (), Log())
    )
    if size and choose is not None:
        _, tables, sheet_log = sheets_read[choose([candidate[1] for candidate in sheets_read])]
    if size == 0:
        refusals = [problem for *_, candidate in sheets_read for problem in candidate.problems]
        if refusals:
            raise InputError(refusals)
        expected = message(
            "lint_no_table",
            "no table found; expected a column of heights and a column of volumes, with headings "
            "such as height_m, volume_m3",
        )
        raise InputError(Problem(file, expected))
    log.problems += sheet_log.problems
    log.warnings += sheet_log.warnings
    return tables


def _check_table(table, nominal, log, even_steps, has_several):
    """Return (CheckedTable, summary, (least, largest) area in m2) of one table; report its faults.

    With `has_several` tables, the summary also has the column of volumes.
    """
    if not table.has_heading:
        log.warning(
            table.name,
            message(
                "lint_no_heading", "no heading: taken as heights in column 1, volumes in column 2"
            ),
        )
    series = check_heights(table, log, even_steps)
    volumes = check_volumes(table, series, log) if series else None
    if volumes is None:
        return CheckedTable(table, series, None, None), "", None
    units = choose_units(table, volumes, log)
    check_totals(table, volumes, units, series.step, nominal, log)
    low, high = sorted(abs(float(h)) * units.height_m for h in volumes.height[[0, -1]])
    summary = message(
        "lint_summary",
        "{table}: {rows} rows, {low:.6g} to {high:.6g} m, step {step:.6g} m, total {total:.9g} m3",
        table=f"{table.name}, {table.entries[0].volume_column}" if has_several else table.name,
        rows=len(volumes.volume),
        low=low,
        high=high,
        step=series.step * units.height_m,
        total=volumes.volume[-1] * units.volume_m3,
    )
    return CheckedTable(table, series, volumes, units), summary, _area_range(volumes, units)


def _area_range(volumes, units):
    """Least and largest mean area of the cross section over ten rows, m2."""
    apart = min(_ROWS_OF_SLOPE, len(volumes.height) - 1)
    rise = volumes.volume[apart:] - volumes.volume[:-apart]
    area = rise / (volumes.height[apart:] - volumes.height[:-apart])
    scale = units.volume_m3 / units.height_m
    return float(area.min()) * scale, float(area.max()) * scale


def _findings(log):
    """Findings in the order of the file, from the problems and warnings of a log."""
    findings = [Finding("error", problem) for problem in log.problems]
    findings += [Finding("warning", problem) for problem in log.warnings]
    return tuple(sorted(dict.fromkeys(findings), key=lambda finding: finding.problem.row or 0))


# ---- proportional parts beside a table


def _check_parts(table, main, log):
    """Report parts that are not proportional, or disagree with the rise of the main table.

    Parameters
    ----------
    table : Table
        Table of parts: marks 1, 2, ... and their volumes.
    main : (float, float)
        Smallest and largest area of the steps of the main table, m2.
    log : Log

    Notes
    -----
    Part j is j * p, rounded. Some p must lie between (v_j - q/2) / j and (v_j + q/2) / j for all j.
    """
    entries = [e for e in table.entries if e.height.value and e.volume.value is not None]
    if len(entries) < 2:
        return
    marks = np.array([entry.height.value for entry in entries])
    values = np.array([entry.volume.value for entry in entries])
    half = 0.5 * 10.0 ** -max(entry.volume.decimals for entry in entries) * (1 + 1e-9)
    low, high = (values - half) / marks, (values + half) / marks
    if low.max() > high.min():
        # The wrong row is the row without which the others agree, or the row farthest from them.
        is_odd = [np.delete(low, k).max() <= np.delete(high, k).min() for k in range(len(entries))]
        part = float(np.median(values / marks))
        worst = int(np.argmax(is_odd if any(is_odd) else abs(values - marks * part)))
        entry = entries[worst]
        rest = np.delete(values, worst).sum() / np.delete(marks, worst).sum()
        expected = rest * marks[worst]
        about = f"{expected:.{entry.volume.decimals}f}"
        text = message(
            "lint_odd_part",
            "found {found}; expected about {about}, in proportion to the others",
            found=entry.volume.text,
            about=about,
        )
        log.problem(table.name, text, entry.row, entry.volume_column)
        return
    _check_size_of_parts(table, entries, float(low.max()), float(high.min()), main, log)


def _check_size_of_parts(table, entries, low, high, main, log):
    """Report parts that disagree with the rise of the main table."""
    if main is None or table.height_unit_m is None or table.volume_unit_m3 is None:
        return
    unit = table.volume_unit_m3 / table.height_unit_m
    least, most = main
    if high * unit < least * (1 - _SAME_AREA) or low * unit > most * (1 + _SAME_AREA):
        text = message(
            "lint_parts_size",
            "proportional parts of {part:.6g} for each mark; expected {least:.6g} to "
            "{most:.6g}, as the table rises",
            part=0.5 * (low + high),
            least=least / unit,
            most=most / unit,
        )
        log.problem(table.name, text, entries[0].row, entries[0].volume_column)
