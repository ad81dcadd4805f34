"""From raw tables to values: each key and cell is read according to its `Field`."""

import re
from dataclasses import dataclass, replace

import numpy as np

from tankcal.job.contract import KEYS, KINDS, OPEN_SECTIONS, REGISTER_KEYS, columns_of
from tankcal.job.contract.registers import FAMILIES, SHORT_KEYS
from tankcal.job.field_values import IN_TOML, NEXT_TO_ZERO, read_value, settle_decimal
from tankcal.job.fields import Field, Refused, is_blank
from tankcal.job.tables import nearest, shown
from tankcal.messages import message
from tankcal.text.naming import MAX_NAME, NUMBER
from tankcal.text.words import NO, YES, meant


@dataclass(frozen=True)
class ColumnValues:
    """Columns of one table, in the order of its rows; a blank or invalid value is None.

    A column that is missing or blank in every row is None as a whole.

    Attributes
    ----------
    file : str
        File or sheet of the table.
    rows : tuple of int
        Row of each entry in the file.
    skipped : int
        Number of rows that could not be read, which are missing here.
    columns : dict of {str: list or None}
        Values of each column.
    """

    file: str
    rows: tuple[int, ...]
    skipped: int
    columns: dict[str, list | None]

    def of(self, name):
        """Values of a column; a list of None if the column is missing or blank."""
        return self.columns[name] or [None] * len(self.rows)

    def numbers(self, name):
        """Values of a numeric column, shape (n,); nan for blank and invalid values."""
        return np.array(self.of(name), dtype=float)

    def records(self):
        """Yield {column: value} of each row."""
        columns = [self.of(name) for name in self.columns]
        for values in zip(*columns, strict=True):
            yield dict(zip(self.columns, values, strict=True))

    @property
    def is_empty(self):
        """Return True if the table has no row, readable or not."""
        return not self.rows and not self.skipped


def read_settings(raw, log, is_whole=True):
    """Read the settings of a job.

    Parameters
    ----------
    raw : RawJob
        Job as read; its settings are readable.
    log : Log
        Receives the problems.
    is_whole : bool, optional
        False: no key is required.

    Returns
    -------
    dict of {str: dict}
        {section: {key: value}}; None for a blank, missing or invalid value.
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
    """Read the cameras, instruments, clouds or meters of a job.

    An entry whose keys are all blank is ignored. A family of keys, such as marks, is a single value
    {name in the family: value}, without blank and invalid items.

    Returns
    -------
    dict of {str: dict}
        {entry: {key: value}}; None for a blank, missing or invalid value.
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
    """{name: value} of the keys of a family; invalid values go to `log`."""
    values = {}
    for key, value in entries.items():
        first, _, item = key.partition(".")
        if first != family or is_blank(value.raw):
            continue
        try:
            item = read_value(Field(key, "name", ""), item)
            values[item] = read_value(field, value.raw)
        except Refused as refusal:
            log.problem(file, refusal.text, value.row, f"{owner}.{key}")
    return values


def as_spelt(register, entries, key):
    """Spelling of a key in an entry: the short one if only the short one is filled in."""
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
    """Kind of tank; None if the settings do not state it. Problems are not logged here."""
    value = (raw.settings or {}).get("tank", {}).get("kind")
    kind = value.raw.strip() if value and isinstance(value.raw, str) else None
    if kind is None or kind in KINDS:
        return kind
    return meant(kind, KINDS)


def _says_nothing(value):
    """Return True if a setting has no effect: blank, 0 or false."""
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
    """Message about a section with an unknown name."""
    return message("unknown_section", "unknown section{hint}", hint=nearest(section, known))


def _unknown_key(key, known):
    return message("unknown_key", "unknown key{hint}", hint=nearest(key, known))


def _own_fields(section, fields, given):
    """Text fields defined by the user, which are printed under their names in job.toml."""
    known = [field.name for field in fields]
    return [
        Field(key, "text", "a field of your own")
        for key in given
        if key not in known and _is_own(section, key, known)
    ]


def _is_own(section, key, known):
    """Return True for a key defined by the user: in OPEN_SECTIONS, and not close to a known key."""
    plain = re.fullmatch(r"[a-z][a-z0-9_]{0,39}", key)
    return section in OPEN_SECTIONS and plain is not None and not nearest(key, known)


def read_setting(file, name, field, value, kind, log, is_required, row=None):
    """Read the value of one key.

    Parameters
    ----------
    file : str
        File or sheet of the setting.
    name : str
        Name of the key in messages.
    field : Field
        Description of the key.
    value : Value or None
        Value as read; None: missing.
    kind : str or None
        Kind of tank; None: not known.
    log : Log
        Receives the problems.
    is_required : bool
        True: a missing or blank value is a problem.
    row : int, optional
        First row of the section, for messages about a missing key.

    Returns
    -------
    object
        Value; None if blank, missing or invalid.
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
    """Read one section of a file other than the settings of a job.

    Parameters
    ----------
    file, section : str
        Names of file and section.
    fields : sequence of Field
        Keys of the section.
    given : dict of {str: Value}
        Entries as read.
    row : int or None
        First row of the section.
    log : Log
        Receives unknown, missing and invalid keys.

    Returns
    -------
    dict
        {key: value}; None if blank, missing or invalid.
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
    """Row of a value; for a value in an inline table, the row of its section."""
    return row if value is None or value.row is None else value.row


def read_columns(name, table, log, fields=None, kind=None):
    """Read the columns of a table.

    Parameters
    ----------
    name : str
        Name of the table.
    table : Table
        Table as read.
    log : Log
        Receives unknown, missing and invalid columns and cells.
    fields : sequence of Field, optional
        Columns of the table; None: as in a job with this kind of tank.
    kind : str, optional
        Kind of tank.

    Returns
    -------
    ColumnValues
    """
    fields = columns_of(name, kind) if fields is None else fields
    known, refused = [field.name for field in fields], ()
    if table.decimal is not None and not set(table.headings) <= set(known):
        from tankcal.job.headings import rename_headings  # slow; needed only for foreign headings

        headings, refused = rename_headings(table, fields, log)
        table = replace(table, headings=headings)
    for heading in table.headings:
        if heading not in known and heading not in refused:
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
    """Values of one column; None if it is optional and blank in every row."""
    position = table.headings.index(field.name)
    raws = [row[position] for row in table.rows]
    is_filled_in = field.required or field.in_full
    if not field.required and all(is_blank(raw) for raw in raws):
        return None
    values, known_values = _plain_numbers(field, raws, table.decimal), {}
    for place, raw in enumerate(raws):
        if values[place] is not None:
            continue
        if is_blank(raw):
            if is_filled_in:
                row = table.row_numbers[place]
                log.problem(
                    table.file,
                    message(
                        "blank_cell",
                        "blank; expected {expectation}",
                        expectation=field.expectation,
                    ),
                    row,
                    field.name,
                )
        elif type(raw) is str and raw in known_values:
            values[place] = known_values[raw]  # names and choices recur, and reading is slow
        else:
            try:
                values[place] = known_values[raw] = read_value(field, raw, table.decimal)
            except Refused as refusal:
                log.problem(table.file, refusal.text, table.row_numbers[place], field.name)
    return values


def _plain_numbers(field, raws, decimal):
    """Valid numbers of a long column, converted together for speed; None for other values."""
    if field.kind != "number" or decimal != ".":
        return [None] * len(raws)
    is_number = NUMBER.fullmatch
    values = np.array(
        [
            float(raw) if type(raw) is str and len(raw) <= MAX_NAME and is_number(raw) else np.nan
            for raw in raws
        ]
    )
    is_valid = (values >= field.low) & (values <= field.high) & np.isfinite(values)
    if field.low == 0:
        is_valid &= (values == 0) | (values >= NEXT_TO_ZERO)
    if field.above_low:
        is_valid &= values > field.low
    return [value if keep else None for value, keep in zip(values.tolist(), is_valid, strict=True)]
