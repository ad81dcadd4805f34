"""Settings of a product: a TOML file with sections of declared keys, and its empty files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.entries import read_section, unknown_section
from tankcal.job.folder import MAX_SETTINGS_BYTES, declared_marks, flattened, read_toml
from tankcal.job.tables import read_bytes
from tankcal.messages import Message
from tankcal.text.words import load_words


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


@dataclass(frozen=True)
class EmptyFiles:
    """Empty input files of a product, with a note beside each key and column.

    Attributes
    ----------
    product : str
        Section of the words with the notes.
    settings : (str, dict)
        Name of the TOML file, and {section: tuple of Field}; the section csv is left out.
    table : (str, tuple of Field, str, str)
        Name of the CSV file, its columns, and the keys of its notes and of its heading.
    exists : Message
        The problem of a file that is there already; none is then written.
    asked : collection of (str, str)
        Section and key to fill in although a Field does not require it.
    shared_notes : dict
        {section: key of its notes}, where it is not the section.
    """

    product: str
    settings: tuple
    table: tuple
    exists: Message
    asked: tuple = ()
    shared_notes: Mapping = field(default_factory=dict)

    def write(self, folder, language):
        """Write the files to a folder, which is created if missing; return their names.

        Raises
        ------
        InputError
            If a file exists.
        """
        words, folder = load_words(language), Path(folder)
        notes, fill_in = words[self.product]["notes"], words["input"]["files"]["fill_in"]
        texts = {
            self.settings[0]: self._settings_text(notes, fill_in),
            self.table[0]: self._table_text(notes),
        }
        existing = [name for name in texts if (folder / name).exists()]
        if existing:
            raise InputError([Problem(name, self.exists) for name in existing])
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        return list(texts)

    def _settings_text(self, notes, fill_in):
        lines = [f"# {notes['files']['settings'].format(fill_in=fill_in)}"]
        for section, fields in self.settings[1].items():
            if section == "csv":
                continue
            lines += ["", f"[{section}]"]
            of_section = notes[self.shared_notes.get(section, section)]
            for key in fields:
                choices = f" ({', '.join(key.choices)})" if key.choices else ""
                ask = f"{fill_in}: " if key.required or (section, key.name) in self.asked else ""
                setting = f'{key.name} = ""'
                lines.append(f"{setting:<32} # {ask}{of_section[key.name]}{choices}")
        return "\n".join(lines) + "\n"

    def _table_text(self, notes):
        _, columns, of_columns, heading = self.table
        lines = [f"# {notes['files'][heading]}"]
        lines += [f"# {column.name}: {notes[of_columns][column.name]}" for column in columns]
        return "\n".join([*lines, ",".join(column.name for column in columns)]) + "\n"
