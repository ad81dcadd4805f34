"""Write the files of a job from its parts."""

import io
import json
from datetime import date

from tankcal.text.spreadsheets import write_guarded


def job_files(parts):
    """Files of a job's folder, {path: bytes}, from its `Parts`."""
    files = {"job.toml": toml_text(_sections(parts.settings)).encode()}
    for name, rows in parts.tables.items():
        if len(rows) > 1:
            files[f"{name}.csv"] = csv_text(rows).encode()
    for name, entries in parts.registers.items():
        named = {f"{name}.{json.dumps(key)}": entry for key, entry in entries.items()}
        files[f"{name}.toml"] = toml_text(named).encode()
    return files | parts.files


def csv_text(rows, separator=","):
    """Text of a CSV file with these rows."""
    stream = io.StringIO()
    write_guarded(stream, rows, separator)
    return stream.getvalue()


def toml_text(sections):
    """Text of a TOML file with {section: {key: value}}."""
    parts = []
    for section, entries in sections.items():
        lines = [f"{key} = {_value(value)}" for key, value in entries.items()]
        parts.append("\n".join([f"[{section}]", *lines]) + "\n")
    return "\n".join(parts)


def _sections(settings):
    """Convert {"section.key": value} to {section: {key: value}}."""
    sections = {}
    for path, value in settings.items():
        section, _, key = path.rpartition(".")
        sections.setdefault(section, {})[key] = value
    return sections


def _value(value):
    """Value as TOML; strings, numbers and flags have the form of JSON."""
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value, ensure_ascii=False)
