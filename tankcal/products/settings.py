"""Settings of a product: a TOML file with sections of declared keys, and its empty files."""

from collections.abc import Mapping
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.entries import read_section, unknown_section
from tankcal.job.folder import MAX_SETTINGS_BYTES, declared_marks, flattened, read_toml
from tankcal.job.tables import read_bytes


def read_sections(source, sections, log, name=None):
    """Read a TOML file; problems are added to `log`, and stop the reading if it is no TOML.

    Parameters
    ----------
    source : Path or Mapping
        The file, or its content as {section: {key: value}}.
    sections : dict
        {section: tuple of Field}.
    log : Log
    name : str, optional
        Name of the source in messages; None: name of the file.

    Returns
    -------
    values : dict
        {section: {key: value or None}}, every section and key.
    places : dict
        {"section.key": row}, and {section: row} of the sections in the file.
    marks : tuple or None
        Separator and decimal mark of CSV files; None after a problem.
    """
    name = name or source.name
    if isinstance(source, Mapping):
        settings, rows = flattened(name, source, {}, log)
    else:
        data = read_bytes(source, log, MAX_SETTINGS_BYTES)
        settings, rows = (None, {}) if data is None else read_toml(name, data, log)
    log.stop_if_problems()
    for section in settings:
        if section not in sections:
            log.problem(name, unknown_section(section, sections), rows.get(section),
                        f"[{section}]")  # fmt: skip
    marks = declared_marks(name, settings, log)
    values, places = {}, {section: rows.get(section) for section in sections if section in settings}
    for section, fields in sections.items():
        entries = settings.get(section, {})
        values[section] = read_section(name, section, fields, entries, rows.get(section), log)
        places |= {f"{section}.{key}": entry.row for key, entry in entries.items()}
    return values, places, marks


def drop_blanks(sections):
    """Sections with their filled keys only: {section: {key: value}}."""
    filled = {
        section: {key: value for key, value in values.items() if value is not None}
        for section, values in sections.items()
    }
    return {section: values for section, values in filled.items() if values}


def fill_blanks(values, defaults):
    """Values of the keys of `defaults`, which replace blank values: {key: value}."""
    return {
        key: default if values[key] is None else values[key] for key, default in defaults.items()
    }


def write_empty_files(folder, texts, exists):
    """Write the empty files of a product.

    Parameters
    ----------
    folder : path
        Created if missing.
    texts : dict of {str: str}
        {name of a file: content}.
    exists : Message
        The problem of a file that is there already; none is then written.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        If a file exists.
    """
    folder = Path(folder)
    existing = [name for name in texts if (folder / name).exists()]
    if existing:
        raise InputError([Problem(name, exists) for name in existing])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return list(texts)


def empty_settings(sections, notes, heading, fill_in, asked=()):
    """Return the text of a TOML file with every key blank, and its note beside it.

    Parameters
    ----------
    sections : dict
        {section: tuple of Field}; the section csv is left out.
    notes : dict
        {section: {key: note}}.
    heading : str
        Comment of the first line.
    fill_in : str
        Words before the notes of the keys to fill in.
    asked : collection of (str, str), optional
        Section and key to fill in although a Field does not require it.

    Returns
    -------
    str
    """
    lines = [f"# {heading}"]
    for section, fields in sections.items():
        if section == "csv":
            continue
        lines += ["", f"[{section}]"]
        for field in fields:
            choices = f" ({', '.join(field.choices)})" if field.choices else ""
            ask = f"{fill_in}: " if field.required or (section, field.name) in asked else ""
            setting = f'{field.name} = ""'
            lines.append(f"{setting:<32} # {ask}{notes[section][field.name]}{choices}")
    return "\n".join(lines) + "\n"


def empty_table(columns, notes, heading):
    """Return the text of a CSV file without rows: notes {column: note}, and the headings."""
    lines = [f"# {heading}", *(f"# {field.name}: {notes[field.name]}" for field in columns)]
    return "\n".join([*lines, ",".join(field.name for field in columns)]) + "\n"
