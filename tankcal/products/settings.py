"""Settings of a product: a TOML file with sections of declared keys."""

from collections.abc import Mapping

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
