"""From raw tables to values: each key and cell is read as its `Field` says, or told to the log."""

import re
from dataclasses import dataclass

from tankcal.job.contract import (
    COLUMNS,
    KEYS,
    LATER_ABOVE_ZERO,
    LATER_KEYS,
    LATER_KINDS,
    LATER_SECTIONS,
    OPEN_SECTIONS,
)
from tankcal.job.fields import Field, Refused, is_blank, read_value
from tankcal.job.tables import nearest


@dataclass(frozen=True)
class ColumnValues:
    """The columns of one table, in the order of its rows; a value that is blank or bad is None.

    A column that the table lacks, or that is blank in every row, is None as a whole. `skipped` rows
    of the file are missing here, for they could not be read.
    """

    file: str
    rows: tuple[int, ...]
    skipped: int
    columns: dict[str, list | None]

    def of(self, name):
        """The values of a column; a list of None when the column is not given."""
        return self.columns[name] or [None] * len(self.rows)


def read_settings(raw, log):
    """{section: {key: value}} with None for what is blank, missing or bad (told to `log`)."""
    file = raw.settings_file
    for section, entries in raw.settings.items():
        _refuse_unknown(file, section, entries, raw.sections.get(section), log)
    values = {}
    for section, fields in KEYS.items():
        given = raw.settings.get(section, {})
        values[section] = {
            field.name: _setting(file, section, field, given.get(field.name), log)
            for field in (*fields, *_own_fields(section, fields, given))
        }
    for section, key, what in LATER_ABOVE_ZERO:
        if (values[section][key] or 0) > 0:
            expected = f"not available in this version: {what}; remove it or set it to 0"
            log.problem(file, expected, raw.settings[section][key].row, f"{section}.{key}")
    return values


def _refuse_unknown(file, section, entries, section_row, log):
    later = "not available in this version of tankcal; remove it or set it to 0"
    if section not in KEYS and section not in LATER_SECTIONS:
        log.problem(file, f"unknown section{nearest(section, KEYS)}", section_row, f"[{section}]")
        return
    known = [field.name for field in KEYS.get(section, ())]
    for key, value in entries.items():
        name = f"{section}.{key}"
        if section in LATER_SECTIONS or key in LATER_KEYS.get(section, ()):
            if not is_blank(value.raw) and value.raw not in (0, []):
                log.problem(file, later, value.row, name)
        elif key not in known and not _is_own(section, key, known):
            log.problem(file, f"unknown key{nearest(key, known)}", value.row, name)


def _own_fields(section, fields, given):
    """Text fields of the user's own: printed under the name that they have in job.toml."""
    known = [field.name for field in fields]
    return [
        Field(key, "text", "a field of your own")
        for key in given
        if key not in known and _is_own(section, key, known)
    ]


def _is_own(section, key, known):
    """Whether a key is the user's own: only in OPEN_SECTIONS, and no slip of a known one."""
    plain = re.fullmatch(r"[a-z][a-z0-9_]{0,39}", key)
    return section in OPEN_SECTIONS and plain is not None and not nearest(key, known)


def _setting(file, section, field, value, log):
    name = f"{section}.{field.name}"
    if value is None or (is_blank(value.raw) and value.raw not in field.choices):
        if field.required:
            found = "missing" if value is None else "blank"
            row = None if value is None else value.row
            log.problem(file, f"{found}; expected {field.wanted()}", row, name)
        return None
    if name == "tank.kind" and value.raw in LATER_KINDS:
        expected = f"not available in this version: a tank of kind {value.raw!r}; only 'vertical'"
        log.problem(file, expected, value.row, name)
        return None
    try:
        return read_value(field, value.raw)
    except Refused as refusal:
        log.problem(file, str(refusal), value.row, name)
        return None


def read_columns(name, table, log):
    """ColumnValues of one raw table; unknown, missing and bad things are told to `log`."""
    fields = COLUMNS[name]
    known = [field.name for field in fields]
    for heading in table.headings:
        if heading not in known:
            expected = f"unknown column{nearest(heading, known)}; expected {', '.join(known)}"
            log.problem(table.file, expected, table.heading_row, heading)
    columns = {}
    for field in fields:
        columns[field.name] = None
        if field.name in table.headings:
            columns[field.name] = _column(table, field, log)
        elif field.required:
            expected = f"missing column; expected {field.wanted()}"
            log.problem(table.file, expected, table.heading_row, field.name)
    return ColumnValues(table.file, table.row_numbers, table.skipped, columns)


def _column(table, field, log):
    position = table.headings.index(field.name)
    raws = [row[position] for row in table.rows]
    filled = field.required or field.in_full
    if not field.required and all(is_blank(raw) for raw in raws):
        return None
    values = []
    for row, raw in zip(table.row_numbers, raws, strict=True):
        value = None
        if is_blank(raw):
            if filled:
                log.problem(table.file, f"blank; expected {field.expectation()}", row, field.name)
        else:
            try:
                value = read_value(field, raw, table.decimal)
            except Refused as refusal:
                log.problem(table.file, str(refusal), row, field.name)
        values.append(value)
    return values


def settings_place(raw, section, key):
    """(file, row, name) of a setting, for a message about it."""
    value = raw.settings.get(section, {}).get(key)
    return raw.settings_file, value.row if value else None, f"{section}.{key}"
