"""Empty input files of an upkeep, with notes in a language."""

from tankcal.messages import message
from tankcal.products.settings import empty_settings, empty_table, write_empty_files
from tankcal.products.upkeep.reading import METER_COLUMNS, METERS, SECTIONS, SETTINGS
from tankcal.text.words import load_words

LOGS = ("levels", "meters", "deliveries", "events", "air")
ASKED = {("upkeep", "record"), ("levels", "files"), ("meters", "files")}


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
    words = load_words(language)
    notes, fill_in = words["upkeep"]["notes"], words["input"]["files"]["fill_in"]
    heading = notes["files"]["settings"].format(fill_in=fill_in)
    of_sections = notes | dict.fromkeys(LOGS, notes["logs"])
    texts = {
        SETTINGS: empty_settings(SECTIONS, of_sections, heading, fill_in, ASKED),
        METERS: empty_table(METER_COLUMNS, notes["meter"], notes["files"]["meters"]),
    }
    exists = message("upkeep_exists", "exists already; expected a folder without it")
    return write_empty_files(folder, texts, exists)
