"""Empty input files of a commissioning, with notes in a language."""

from tankcal.messages import message
from tankcal.products.gauge.reading import COLUMNS, READINGS, SECTIONS, SETTINGS
from tankcal.products.settings import empty_settings, empty_table, write_empty_files
from tankcal.text.words import load_words


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
    words = load_words(language)
    notes, fill_in = words["gauge"]["notes"], words["input"]["files"]["fill_in"]
    heading = notes["files"]["settings"].format(fill_in=fill_in)
    texts = {
        SETTINGS: empty_settings(SECTIONS, notes, heading, fill_in),
        READINGS: empty_table(COLUMNS, notes["readings"], notes["files"]["readings"]),
    }
    exists = message("gauge_exists", "exists already; expected a folder without it")
    return write_empty_files(folder, texts, exists)
