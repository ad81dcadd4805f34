"""From raw tables to values: each key and cell is read as its `Field` says, or told to the log."""

import re
from dataclasses import dataclass, replace

import numpy as np

from tankcal.job.contract import KEYS, KINDS, OPEN_SECTIONS, REGISTER_KEYS, columns_of
from tankcal.job.contract.registers import FAMILIES, SHORT_KEYS
from tankcal.job.decimals import settle_decimal
from tankcal.job.field_values import IN_TOML, NEXT_TO_ZERO, read_value
from tankcal.job.fields import Field, Refused, is_blank
from tankcal.job.tables import nearest, shown
from tankcal.messages import message
from tankcal.text.form_words import NO, YES, meant
from tankcal.text.naming import MAX_NAME
from tankcal.text.numerals import NUMBER


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

    def numbers(self, name):
        """(n,) the values of a column of numbers, nan where there is none."""
        return np.array(self.of(name), dtype=float)

    @property
    def is_empty(self):
        """Has it no row at all, not even one that cannot be read?"""
        return not self.rows and not self.skipped


def read_settings(raw, log, is_whole=True):
    """{section: {key: value}} with None for what is blank, missing or bad (told to `log`).

    is_whole  False: nothing of it is required
    """
    kind = kind_of(raw)
    for section, entries in raw.settings.items():
        _refuse_unknown(raw.settings_file, section, entries, raw.sections.get(section), log)
    values = {}
    for section, fields in KEYS.items():
        given = raw.settings.get(section, {})
        is_foreign = not any(field.suits(kind) for field in fields)
        if is_foreign and not all(_says_nothing(value) for value in given.values()):
            expected = message(
                "remove_section",
                "{only_for}; remove the section",
                only_for=_only_for(fields[0], kind),
            )
            log.problem(raw.settings_file, expected, raw.sections.get(section), f"[{section}]")
        values[section] = {
            field.name: None
            if is_foreign
            else read_setting(
                raw.settings_file,
                f"{section}.{field.name}",
                field,
                given.get(field.name),
                kind,
                log,
                is_whole and field.is_required(kind),
            )
            for field in (*fields, *_own_fields(section, fields, given))
        }
    return values


def read_register(raw, name, log):
    """{name: {key: value}} of cameras or instruments, with None for what is blank, missing or bad.

    An entry in which nothing is filled in counts as not there. A family of keys (marks) is one
    value {name in the family: value}, without those that are blank or bad.
    """
    register = raw.registers.get(name)
    if register is None:
        return {}
    fields, values = REGISTER_KEYS[name], {}
    known = [*(field.name for field in fields), *SHORT_KEYS[name].values()]
    for owner, entries in register.entries.items():
        if all(is_blank(value.raw) for value in entries.values()):
            continue
        row = register.rows[owner]
        try:
            name_read = read_value(Field(owner, "name", ""), owner)
            if name_read != owner:
                expected = message(
                    "spaces_in_name",
                    "found {found}; expected {wanted}, without extra spaces",
                    found=shown(owner),
                    wanted=shown(name_read),
                )
                log.problem(register.file, expected, row, owner)
        except Refused as refusal:
            log.problem(register.file, refusal.text, row, owner)
        for key, value in entries.items():
            if key not in known and key.partition(".")[0] not in FAMILIES.get(name, ()):
                log.problem(register.file, _unknown_key(key, known), value.row, f"{owner}.{key}")
        _refuse_two_spellings(register.file, name, owner, entries, log)
        values[owner] = {}
        for field in fields:
            key = as_spelt(name, entries, field.name)
            place = (register.file, f"{owner}.{key}")
            values[owner][field.name] = read_setting(
                *place, field, entries.get(key), None, log, field.required, row
            )
        for family, field in FAMILIES.get(name, {}).items():
            values[owner][family] = _read_family(register.file, owner, family, field, entries, log)
    return values


def _read_family(file, owner, family, field, entries, log):
    """{name: value} of the keys that belong to a family; what is bad is told to `log`."""
    found = {}
    for key, value in entries.items():
        first, _, own = key.partition(".")
        if first != family or is_blank(value.raw):
            continue
        try:
            own = read_value(Field(key, "name", ""), own)
            found[own] = read_value(field, value.raw)
        except Refused as refusal:
            log.problem(file, refusal.text, value.row, f"{owner}.{key}")
    return found


def as_spelt(register, entries, key):
    """The spelling of a key that an entry has: its short one when that alone is filled in."""
    short = SHORT_KEYS[register].get(key)
    return short if _is_filled(entries, short) and not _is_filled(entries, key) else key


def _is_filled(entries, key):
    return key in entries and not is_blank(entries[key].raw)


def _refuse_two_spellings(file, register, owner, entries, log):
    for key, short in SHORT_KEYS[register].items():
        if _is_filled(entries, key) and _is_filled(entries, short):
            expected = message(
                "short_spelling_too",
                "given together with {key}; expected only one of them: they are the same parameter",
                key=key,
            )
            log.problem(file, expected, entries[short].row, f"{owner}.{short}")


def kind_of(raw):
    """The kind of tank, or None where the settings do not tell it; nothing is told to a log."""
    value = (raw.settings or {}).get("tank", {}).get("kind")
    kind = value.raw.strip() if value and isinstance(value.raw, str) else None
    if kind is None or kind in KINDS:
        return kind
    return meant(kind, KINDS)


def _says_nothing(value):
    """Whether a setting may stand in a job of a kind that it is not for: blank, 0 or false."""
    if isinstance(value.raw, str) and meant(value.raw, (YES, NO)) == NO:
        return True
    return is_blank(value.raw) or (isinstance(value.raw, int | float) and value.raw == 0)


def _only_for(field, kind):
    return message(
        "only_for_kinds",
        "only for a tank of kind {kinds}; this one is {of_kind}",
        kinds=[*field.kinds],
        of_kind=kind,
    )


def _refuse_unknown(file, section, entries, section_row, log):
    if section not in KEYS:
        log.problem(
            file,
            unknown_section(section, KEYS),
            section_row,
            f"[{section}]",
        )
        return
    known = [field.name for field in KEYS[section]]
    for key, value in entries.items():
        if key not in known and not _is_own(section, key, known):
            log.problem(file, _unknown_key(key, known), value.row, f"{section}.{key}")


def unknown_section(section, known):
    """What is said of a section that is none of the known ones."""
    return message("unknown_section", "unknown section{hint}", hint=nearest(section, known))


def _unknown_key(key, known):
    return message("unknown_key", "unknown key{hint}", hint=nearest(key, known))


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


def read_setting(file, name, field, value, kind, log, is_required, row=None):
    """The value of one key, or None after telling `log`, which calls it `name`.

    value  its tables.Value, or None         kind  of the tank, or None
    row    where its section begins, for a message that it is missing
    """
    if value is None or (is_blank(value.raw) and value.raw not in field.choices):
        if is_required:
            wanted = field.wanted()
            expected = message("missing_key", "missing; expected {wanted}", wanted=wanted)
            if value is not None:
                expected = message("blank_key", "blank; expected {wanted}", wanted=wanted)
            log.problem(file, expected, _row_of(value, row), name)
        return None
    if not field.suits(kind):
        if not _says_nothing(value):
            log.problem(
                file,
                message("remove_key", "{only_for}; remove it", only_for=_only_for(field, kind)),
                _row_of(value, row),
                name,
            )
        return None
    try:
        return read_value(field, value.raw, IN_TOML if file.endswith(".toml") else None)
    except Refused as refusal:
        log.problem(file, refusal.text, _row_of(value, row), name)
        return None


def read_section(file, section, fields, given, row, log):
    """{key: value or None} of one section of a file; unknown, missing and bad goes to the log.

    given  {key: tables.Value}         row  where the section begins
    """
    known = [field.name for field in fields]
    for key, value in given.items():
        if key not in known:
            expected = message(
                "unknown_key_of_section",
                "unknown key; expected {known}{hint}",
                known=[*known],
                hint=nearest(key, known),
            )
            log.problem(file, expected, value.row or row, f"{section}.{key}")
    return {
        field.name: read_setting(
            file,
            f"{section}.{field.name}",
            field,
            given.get(field.name),
            None,
            log,
            field.required,
            row,
        )
        for field in fields
    }


def _row_of(value, row):
    """The row of a value; of one within an inline table, that of its section."""
    return row if value is None or value.row is None else value.row


def read_columns(name, table, log, fields=None, kind=None):
    """ColumnValues of one raw table; unknown, missing and bad things are told to `log`.

    fields  its columns; None: those that the table of this name has in a job of a tank of the kind
    """
    fields = columns_of(name, kind) if fields is None else fields
    known, told = [field.name for field in fields], ()
    if table.decimal is not None and not set(table.headings) <= set(known):
        from tankcal.job.headings import rename_headings  # lists of others alone need its words

        headings, told = rename_headings(table, fields, log)
        table = replace(table, headings=headings)
    for heading in table.headings:
        if heading not in known and heading not in told:
            expected = message(
                "unknown_column",
                "unknown column{hint}; expected {known}",
                hint=nearest(heading, known),
                known=[*known],
            )
            log.problem(table.file, expected, table.heading_row, heading)
    columns, table = {}, replace(table, decimal=settle_decimal(table, fields, log))
    for field in fields:
        columns[field.name] = None
        if field.name in table.headings:
            columns[field.name] = _column(table, field, log)
        elif field.required:
            expected = message(
                "missing_column", "missing column; expected {wanted}", wanted=field.wanted()
            )
            log.problem(table.file, expected, table.heading_row, field.name)
    return ColumnValues(table.file, table.row_numbers, table.skipped, columns)


def _column(table, field, log):
    position = table.headings.index(field.name)
    raws = [row[position] for row in table.rows]
    filled = field.required or field.in_full
    if not field.required and all(is_blank(raw) for raw in raws):
        return None
    values, read = _plain_numbers(field, raws, table.decimal), {}
    for place, raw in enumerate(raws):
        if values[place] is not None:
            continue
        if is_blank(raw):
            if filled:
                row = table.row_numbers[place]
                log.problem(
                    table.file,
                    message(
                        "blank_cell",
                        "blank; expected {expectation}",
                        expectation=field.expectation(),
                    ),
                    row,
                    field.name,
                )
        elif type(raw) is str and raw in read:
            values[place] = read[raw]  # names and choices come again and again
        else:
            try:
                values[place] = read[raw] = read_value(field, raw, table.decimal)
            except Refused as refusal:
                log.problem(table.file, refusal.text, table.row_numbers[place], field.name)
    return values


def _plain_numbers(field, raws, decimal):
    """The sound numbers among the texts of a long column, None for all else."""
    if field.kind != "number" or decimal != ".":
        return [None] * len(raws)
    is_number = NUMBER.fullmatch
    values = np.array(
        [
            float(raw) if type(raw) is str and len(raw) <= MAX_NAME and is_number(raw) else np.nan
            for raw in raws
        ]
    )
    sound = (values >= field.low) & (values <= field.high) & np.isfinite(values)
    if field.low == 0:
        sound &= (values == 0) | (values >= NEXT_TO_ZERO)
    if field.above_low:
        sound &= values > field.low
    return [value if good else None for value, good in zip(values.tolist(), sound, strict=True)]
