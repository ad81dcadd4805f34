"""The files of a survey as its checks see them."""

from dataclasses import dataclass, field

import numpy as np

from tankcal.job.checking import tell_missing
from tankcal.job.entries import as_spelt
from tankcal.job.fields import is_blank
from tankcal.job.tables import REGISTERS, nearest
from tankcal.messages import message

MAX_HINTS = 50  # a suggestion for every one of thousands of names would cost minutes


@dataclass(frozen=True)
class SurveyFiles:
    """What was read of a survey, and the log.

    values     of the settings, or None: unreadable
    tables     {name: ColumnValues, or None: not there or unreadable}
    registers  {"cameras" or "instruments": {name: {key: value}}}
    raw        RawJob
    told       (file, row) of the rows that have a problem already
    """

    values: dict | None
    tables: dict
    registers: dict
    raw: object
    log: object
    told: frozenset = field(default_factory=frozenset)

    def is_unreadable(self, name):
        """Is the table or register there, but not readable?"""
        among = self.raw.registers if name in REGISTERS else self.raw.tables
        return name in among and among[name] is None

    def sound(self, table):
        """(n,) True for the rows of a table without a problem."""
        return np.array([(table.file, row) not in self.told for row in table.rows], dtype=bool)

    def is_given(self, register, owner, key):
        """Does a camera or an instrument have the key, be its value good or bad?"""
        entries = self.raw.registers[register].entries[owner]
        value = entries.get(as_spelt(register, entries, key))
        return value is not None and not is_blank(value.raw)

    def tell_key(self, to, register, owner, key, expected):
        """Tell log.problem or log.warning about one key of a camera or an instrument."""
        known = self.raw.registers[register]
        key = as_spelt(register, known.entries[owner], key)
        value = known.entries[owner].get(key)
        row = known.rows[owner] if value is None else value.row
        to(known.file, expected, row, f"{owner}.{key}")


def refuse_undefined(files, table, column, defined, where):
    """A problem for each name in a column that `defined` lacks; `where` is its table or register.

    A table that is not there at all is one problem. Where a name in it could not be read, nothing
    is told: it may be that one.
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


def tell_rows(to, table, is_told, column, expected):
    """Tell log.problem or log.warning the same of each row where `is_told` (n,) is True.

    Once only where several do because the table has no such column, or nothing in it.
    """
    if np.count_nonzero(is_told) > 1 and table.columns.get(column) is None:
        without = message("column_missing_or", "the column is missing or {what}", what=expected)
        to(table.file, without, None, column)
        return
    for place in np.flatnonzero(is_told):
        to(table.file, expected, table.rows[place], column)
