"""Empty input files of a commissioning, with notes in a language."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.gauge.reading import COLUMNS, READINGS, SECTIONS, SETTINGS
from tankcal.text.words import load_words

SHOWN = tuple(section for section in SECTIONS if section != "csv")


def write_starter(folder, language):
    """Write gauge.toml and readings.csv to fill in.

    Parameters
    ----------
    folder : path
        Created if missing; existing files are not replaced.
    language : str
        Language of the notes.

    Returns
    -------
    list of str
        Names of the written files.

    Raises
    ------
    InputError
        If a file exists, or the folder cannot be written.
    """
    folder = Path(folder)
    existing = [name for name in (SETTINGS, READINGS) if (folder / name).exists()]
    if existing:
        text = message("gauge_exists", "exists already; expected a folder without it")
        raise InputError([Problem(name, text) for name in existing])
    words = load_words(language)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SETTINGS).write_text(settings_text(words), encoding="utf-8")
    (folder / READINGS).write_text(readings_text(words), encoding="utf-8")
    return [SETTINGS, READINGS]


def settings_text(words):
    """Text of gauge.toml: every key blank, with its note."""
    notes, fill_in = words["gauge"]["notes"], words["input"]["files"]["fill_in"]
    lines = [f"# {notes['files']['settings'].format(fill_in=fill_in)}"]
    for section in SHOWN:
        lines += ["", f"[{section}]"]
        for field in SECTIONS[section]:
            choices = f" ({', '.join(field.choices)})" if field.choices else ""
            ask = f"{fill_in}: " if field.required else ""
            setting = f'{field.name} = ""'
            lines.append(f"{setting:<32} # {ask}{notes[section][field.name]}{choices}")
    return "\n".join(lines) + "\n"


def readings_text(words):
    """Text of readings.csv: notes and the headings of the columns."""
    notes = words["gauge"]["notes"]
    lines = [f"# {notes['files']['readings']}"]
    lines += [f"# {field.name}: {notes['readings'][field.name]}" for field in COLUMNS]
    return "\n".join([*lines, ",".join(field.name for field in COLUMNS)]) + "\n"
