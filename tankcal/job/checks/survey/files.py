"""Files of a survey, as used by its checks."""

import re
from dataclasses import dataclass, field

import numpy as np

from tankcal.job.checking import has_rows, tell_missing
from tankcal.job.contract.observations import READINGS
from tankcal.job.entries import as_spelt
from tankcal.job.fields import is_blank
from tankcal.job.tables import REGISTERS, nearest
from tankcal.messages import message

MAX_HINTS = 50  # largest number of suggestions; thousands of them would take minutes
KNOWN = (("control", "point"), ("check", "point"), ("targets", "point"), ("setups", "station"))


@dataclass(frozen=True)
class SurveyFiles:
    """Content of the files of a survey, and the log.

    Attributes
    ----------
    values : dict or None
        {section: {key: value}} of the settings; None: unreadable.
    tables : dict
        {name: ColumnValues; None: missing or unreadable}.
    registers : dict
        {"cameras" or "instruments": {name: {key: value}}}.
    raw : RawJob
        Job as read.
    log : Log
        Receives problems and warnings.
    told : frozenset of (str, int)
        File and row of the rows with problems reported before.
    """

    values: dict | None
    tables: dict
    registers: dict
    raw: object
    log: object
    told: frozenset = field(default_factory=frozenset)

    def is_unreadable(self, name):
        """Return True if the table or register exists but is not readable."""
        among = self.raw.registers if name in REGISTERS else self.raw.tables
        return name in among and among[name] is None

    def sound(self, table):
        """True for the rows of a table without a problem, shape (n,)."""
        return np.array([(table.file, row) not in self.told for row in table.rows], dtype=bool)

    def is_given(self, register, owner, key):
        """Return True if a camera or an instrument has the key, with a valid or invalid value."""
        entries = self.raw.registers[register].entries[owner]
        value = entries.get(as_spelt(register, entries, key))
        return value is not None and not is_blank(value.raw)

    def tell_key(self, report, register, owner, key, expected):
        """Report on one key of a camera or an instrument.

        Parameters
        ----------
        report : callable
            log.problem or log.warning.
        register : str
            "cameras" or "instruments".
        owner, key : str
            Name of the camera or instrument, and key.
        expected : Message
            Text of the report.
        """
        entries_of_register = self.raw.registers[register]
        key = as_spelt(register, entries_of_register.entries[owner], key)
        value = entries_of_register.entries[owner].get(key)
        row = entries_of_register.rows[owner] if value is None else value.row
        report(entries_of_register.file, expected, row, f"{owner}.{key}")


def refuse_undefined(files, table, column, defined, where):
    """Report each name in a column that is not defined.

    A missing table of definitions is reported once. If one of its names is unreadable, nothing is
    reported, because the unreadable name may be the missing one.

    Parameters
    ----------
    files : SurveyFiles
        Files of the survey.
    table : ColumnValues
        Table with the names.
    column : str
        Column of the names.
    defined : collection of str or None
        Defined names; None for an unreadable name.
    where : str
        Table or register with the definitions.
    """
    its_table = files.tables.get(where)
    if files.is_unreadable(where) or None in defined or (its_table and its_table.skipped):
        return
    first, count = {}, {}
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is not None and name not in defined:
            first.setdefault(name, row)
            count[name] = count.get(name, 0) + 1
    file = files.raw.file_of(where)
    if first and not defined:
        tell_missing(files.log, file, table.file, column)
        return
    for number, (name, row) in enumerate(first.items()):
        hint = nearest(name, defined) if number < MAX_HINTS else ""
        more = (
            message("rows_name_it", "; {count} rows refer to it", count=count[name])
            if count[name] > 1
            else ""
        )
        expected = message(
            "name_undefined",
            "found {name!r}; expected a name defined in {file}{hint}{more}",
            name=name,
            file=file,
            hint=hint,
            more=more,
        )
        files.log.problem(table.file, expected, row, column)


def tell_rows(report, table, is_told, column, expected):
    """Report the rows where `is_told` (n,) is True.

    If several rows are concerned because the column is missing or blank, one message is sufficient.

    Parameters
    ----------
    report : callable
        log.problem or log.warning.
    table : ColumnValues
        Table with n rows.
    is_told : ndarray of bool, shape (n,)
        Rows to be reported.
    column : str
        Column of the fault.
    expected : Message
        Text of the report.
    """
    if np.count_nonzero(is_told) > 1 and table.columns.get(column) is None:
        summary = message("column_missing_or", "the column is missing or {what}", what=expected)
        report(table.file, summary, None, column)
        return
    for place in np.flatnonzero(is_told):
        report(table.file, expected, table.rows[place], column)


# ---- checks for one point in two spellings: P1, p1, P 1, P-1, P01


def _columns():
    """(table, column) of all names of observed points."""
    yield "image_points", "point"
    yield "stadia", "to"
    for name in READINGS:
        for column in ("at", "from", "to"):
            yield name, column


def observed_names(files):
    """{name: number of rows} of the observed points and of the stations."""
    counts = {}
    for name, column in (*_columns(), ("setups", "station")):
        table = files.tables[name]
        if has_rows(table) and column in table.columns:
            for point in table.of(column):
                counts[point] = counts.get(point, 0) + 1
    return counts


def all_points(files):
    """Names of all points of the survey, in the order of its files."""
    counts = observed_names(files)
    for name, column in KNOWN:
        if has_rows(files.tables[name]):
            counts |= dict.fromkeys(files.tables[name].of(column), 1)
    return [name for name in counts if name is not None]


def plain(name):
    """Common form of the spellings of one name: P1 for p1, P 1, P-1, P_01."""
    text = re.sub(r"[\s_.\-/#()]+", "-", name.casefold())
    text = re.sub(r"(?<=[^\W\d])-(?=\d)|(?<=\d)-(?=[^\W\d])", "", text)
    return re.sub(r"(?<!\d)0+(?=\d)", "", text).strip("-")


def check_names(files):
    """Report similar spellings; a spelling in a single row is a problem.

    A point in a single row cannot be determined; a point in several rows may be another point.
    """
    places = {}
    for name, column in (*KNOWN, *_columns()):
        table = files.tables[name]
        if has_rows(table) and column in table.columns:
            for row, point in zip(table.rows, table.of(column), strict=True):
                if point is not None:
                    entry = places.setdefault(point, [table.file, row, column, 0])
                    entry[3] += 1
    similar = {}
    for point in places:
        similar.setdefault(plain(point), []).append(point)
    for spellings in similar.values():
        if len(spellings) > 1:
            _tell(files, sorted(spellings, key=lambda point: -places[point][3]), places)


def _tell(files, spellings, places):
    most_frequent, *others = spellings
    for point in others:
        file, row, column, count = places[point]
        if count == 1:
            rows_of_other = places[most_frequent][3]
            expected = message(
                "spelt_once",
                "{point!r} is in 1 row, {other!r} in {rows} rows; expected one spelling of "
                "one point, or another name",
                point=point,
                other=most_frequent,
                rows=rows_of_other,
            )
            if rows_of_other == 1:
                expected = message(
                    "each_spelt_once",
                    "{point!r} is in 1 row, {other!r} in 1 row; expected one spelling of one "
                    "point, or another name",
                    point=point,
                    other=most_frequent,
                )
            files.log.problem(file, expected, row, column)
        else:
            expected = message(
                "two_spellings",
                "{point!r} is in {rows} rows, {other!r} in {rows_of_other} rows: is it one "
                "point in two spellings?",
                point=point,
                rows=count,
                other=most_frequent,
                rows_of_other=places[most_frequent][3],
            )
            files.log.warning(file, expected, row, column)
