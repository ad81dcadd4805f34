"""Comparison of a saved file of a product with the values computed again, for `tankcal verify`."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.record.manifest import digest_of

RECORD = "record.json"
MOST_FOLDERS = 200  # of the folder of the inputs that are searched for the record
TOLERANCE = 1e-9  # largest relative difference between two computations


def compare_values(file, recorded, computed):
    """Compare all values of a saved file with those computed again.

    Parameters
    ----------
    file : str
        Name of the saved file in messages.
    recorded, computed : dict
        Plain data; the keys of `computed` are compared.

    Returns
    -------
    count : int
        Number of the compared values.
    problems : list of Problem
        Differences.
    """
    pairs = [
        pair for name in computed for pair in _leaves(name, recorded.get(name), computed[name])
    ]
    problems = []
    for place, old, new in pairs:
        if not _agree(old, new):
            expected = message(
                "verify_value_apart",
                "{place} is {recorded}, computed again {computed}; expected equal values",
                place=place, recorded=_value_text(old), computed=_value_text(new),
            )  # fmt: skip
            problems.append(Problem(file, expected))
    return len(pairs), problems


def find_record(folder, digest):
    """The record.json with a SHA-256 in a folder or its subfolders; None if there is none."""
    folder = Path(folder)
    if folder.is_file():
        folder = folder.parent
    try:
        subfolders = sorted(path for path in folder.iterdir() if path.is_dir())[:MOST_FOLDERS]
    except OSError as error:
        raise InputError(Problem(str(folder), str(error))) from error
    for place in (folder, *subfolders, *(path / "results" for path in subfolders)):
        path = place / RECORD
        if path.is_file() and digest_of(path) == digest:
            return path
    return None


def _leaves(place, recorded, computed):
    """Yield (place, recorded, computed) of all values of two nested data."""
    if isinstance(computed, dict) and isinstance(recorded, dict):
        for name in {**recorded, **computed}:
            yield from _leaves(f"{place}.{name}", recorded.get(name), computed.get(name))
    elif isinstance(computed, list) and isinstance(recorded, list):
        if len(computed) != len(recorded):
            yield f"{place}[]", len(recorded), len(computed)
        for row, pair in enumerate(zip(recorded, computed, strict=False)):
            yield from _leaves(f"{place}[{row}]", *pair)
    else:
        yield place, recorded, computed


def _agree(recorded, computed):
    numbers = (int, float)
    if isinstance(recorded, bool) or isinstance(computed, bool):
        return recorded is computed
    if isinstance(recorded, numbers) and isinstance(computed, numbers):
        # Small contributions are differences of large numbers, so 1e-9 alone is too strict.
        return abs(recorded - computed) <= TOLERANCE * max(abs(computed), 1e-3)
    return recorded == computed


def _value_text(value):
    return f"{value:.10g}" if isinstance(value, float) else repr(value)[:80]
