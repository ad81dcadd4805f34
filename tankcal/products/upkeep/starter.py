"""Empty input files of an upkeep, with notes in a language."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.upkeep.reading import METER_COLUMNS, METERS, SECTIONS, SETTINGS
from tankcal.text.words import load_words

LOGS = ("levels", "meters", "deliveries", "events", "air")


def write_starter(folder, language):
    """Write upkeep.toml and meters.csv to fill in.

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
    existing = [name for name in (SETTINGS, METERS) if (folder / name).exists()]
    if existing:
        text = message("upkeep_exists", "exists already; expected a folder without it")
        raise InputError([Problem(name, text) for name in existing])
    words = load_words(language)
    notes, fill_in = words["upkeep"]["notes"], words["input"]["files"]["fill_in"]
    lines = [f"# {notes['files']['settings'].format(fill_in=fill_in)}"]
    for section, fields in SECTIONS.items():
        if section == "csv":
            continue
        lines += ["", f"[{section}]"]
        named = notes["logs" if section in LOGS else section]
        for field in fields:
            choices = f" ({', '.join(field.choices)})" if field.choices else ""
            is_log = section in ("levels", "meters") and field.name == "files"
            ask = f"{fill_in}: " if field.required or is_log else ""
            setting = f'{field.name} = ""'
            lines.append(f"{setting:<32} # {ask}{named[field.name]}{choices}")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SETTINGS).write_text("\n".join(lines) + "\n", encoding="utf-8")
    meters = [f"# {notes['files']['meters']}"]
    meters += [f"# {field.name}: {notes['meter'][field.name]}" for field in METER_COLUMNS]
    meters.append(",".join(field.name for field in METER_COLUMNS))
    (folder / METERS).write_text("\n".join(meters) + "\n", encoding="utf-8")
    return [SETTINGS, METERS]
