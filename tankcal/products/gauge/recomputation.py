"""Computation of a saved comparison again, for `tankcal verify`."""

from pathlib import Path

from tankcal.errors import InputError
from tankcal.messages import message
from tankcal.products.gauge.commissioning import commission, readings_of
from tankcal.products.gauge.reading import (
    READINGS,
    read_files,
    read_saved_comparison,
    read_tank,
)
from tankcal.products.gauge.saved import GAUGE, GaugeRecord
from tankcal.products.recomputing import compare_values, find_record
from tankcal.products.settings import drop_blanks
from tankcal.record.manifest import digest_of
from tankcal.record.schema import from_plain, to_plain


def compute_again(saved, folder):
    """Compute a saved comparison again from its readings.

    The saved readings and settings are also compared with the input files, and the saved facts of
    the tank with its record, if these files are found.

    Parameters
    ----------
    saved : dict
        Content of gauge.json.
    folder : Path
        Folder of the input files.

    Returns
    -------
    count : int
        Number of the compared values.
    problems : list of Problem
        Differences.
    notes : list of Message
        Checks that were not possible.

    Raises
    ------
    InputError
        If the inputs are not those of a comparison.
    """
    folder, facts = Path(folder), saved["record"]
    again, notes = {}, []
    files = _find_inputs(saved, folder)
    if files is None:
        notes.append(
            message(
                "verify_gauge_inputs",
                "{folder} does not contain the input files with the SHA-256 stated in {file}; "
                "readings and settings were taken from {file}",
                folder=str(folder),
                file=GAUGE.file,
            )
        )
    else:
        sections, table = read_files(*files)
        again |= {"inputs": drop_blanks(sections), "readings": to_plain(readings_of(table))}
    if facts is not None:
        record = _find_record(saved, folder)
        if record is None:
            notes.append(
                message(
                    "verify_gauge_record",
                    "the record of the tank is not in {folder}: its values were taken from {file}",
                    folder=str(folder),
                    file=GAUGE.file,
                )
            )
        else:
            again["record"] = to_plain(read_tank(record))
    comparison = read_saved_comparison(
        saved["inputs"],
        saved["readings"],
        None if facts is None else from_plain(GaugeRecord, facts, GAUGE.file),
        tuple((file["file"], file["sha256"]) for file in saved["files"]),
    )
    result = to_plain(commission(comparison))
    for name in ("format", "tankcal", "files", "inputs", "readings", "record"):
        del result[name]
    return *compare_values(GAUGE.file, _comparable(saved), _comparable(again | result)), notes


def _comparable(gauge):
    """Content of gauge.json, without the rows and the English texts of its warnings."""
    keys = ("file", "column", "code", "values")
    warnings = [{key: warning[key] for key in keys} for warning in gauge["warnings"]]
    return {**gauge, "warnings": warnings}


def _find_inputs(saved, folder):
    """Paths of gauge.toml and readings.csv with the saved SHA-256; None if one is missing."""
    paths = [folder / file["file"] for file in saved["files"]]
    is_found = len(paths) == 2 and paths[1].name == READINGS
    for path, file in zip(paths, saved["files"], strict=True):
        is_found = is_found and path.is_file() and digest_of(path) == file["sha256"]
    return paths if is_found else None


def _find_record(saved, folder):
    """The record.json of the tank: as named in gauge.toml, or below the folder of the inputs."""
    places = [folder]
    named = saved["inputs"].get("gauge", {}).get("record")
    if isinstance(named, str):
        places.insert(0, folder / named)
    for place in places:
        try:
            path = find_record(place, saved["record"]["sha256"])
        except InputError:
            continue
        if path is not None:
            return path
    return None
