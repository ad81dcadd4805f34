"""Computation of a saved upkeep again, for `tankcal verify`."""

from pathlib import Path

from tankcal.messages import message
from tankcal.products.recomputing import compare_values
from tankcal.products.upkeep.reading import SETTINGS, read_upkeep
from tankcal.products.upkeep.saved import UPKEEP
from tankcal.products.upkeep.upkeep import keep_up
from tankcal.record.manifest import digest_of
from tankcal.record.schema import to_plain


def compute_again(saved, folder):
    """Compute a saved upkeep again from its logs.

    Parameters
    ----------
    saved : dict
        Content of upkeep.json.
    folder : Path
        Folder of the input files.

    Returns
    -------
    count : int or None
        Number of the compared values; None: the inputs are not in the folder.
    problems : list of Problem
        Differences.
    notes : list of Message
        Checks that were not possible.

    Raises
    ------
    InputError
        If the inputs are not those of an upkeep.
    """
    settings = Path(folder) / SETTINGS
    digests = {file["sha256"] for file in saved["files"] if file["file"] == SETTINGS}
    if not settings.is_file() or digest_of(settings) not in digests:
        note = message(
            "verify_upkeep_inputs",
            "{folder} does not contain {settings} with the SHA-256 stated in {file}; the values "
            "were not computed again",
            folder=str(folder),
            settings=SETTINGS,
            file=UPKEEP.file,
        )
        return None, [], [note]
    inputs = read_upkeep(settings, source=saved["inputs"]["upkeep"]["record"])
    again = to_plain(keep_up(inputs, with_steps="steps" in saved))
    return *compare_values(UPKEEP.file, _drop_texts(saved), _drop_texts(again)), []


def _drop_texts(upkeep):
    """Content of upkeep.json, without its version and the English texts of warnings."""
    keys = ("file", "column", "code", "values")
    warnings = [{key: warning[key] for key in keys} for warning in upkeep["warnings"]]
    return {**upkeep, "warnings": warnings, "tankcal": ""}
