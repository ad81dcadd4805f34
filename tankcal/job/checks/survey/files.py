"""Files of a survey, as used by its checks."""

from dataclasses import dataclass, field

import numpy as np

from tankcal.job.checking import tell_missing
from tankcal.job.entries import as_spelt
from tankcal.job.fields import is_blank
from tankcal.job.tables import REGISTERS, nearest
from tankcal.messages import message

MAX_HINTS = 50  # largest number of suggestions; thousands of them would take minutes


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
