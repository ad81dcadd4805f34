"""Results of earlier runs of an upkeep, so that a month computes the new data only.

Each result is a file with its key as its name: the SHA-256 of all data on which it depends. A file
is complete or absent, so a run that is stopped loses only the part in work. Files contain plain
arrays, and a damaged file counts as absent.
"""

import hashlib
import os
import tempfile
import zipfile
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from tankcal.version import find_version

SUFFIX = ".npz"


def hash_arrays(*values):
    """SHA-256 of arrays, texts, numbers and dataclasses of these, as hexadecimal text."""
    digest = hashlib.sha256()
    for name, value in _flatten("", values):
        digest.update(f"{name}:".encode())
        is_plain = isinstance(value, np.ndarray) and value.dtype != object
        content = value if is_plain else repr(np.asarray(value).tolist())
        digest.update(np.ascontiguousarray(content).data if is_plain else content.encode())
    return digest.hexdigest()


class State:
    """Folder with results of earlier runs.

    Parameters
    ----------
    folder : path or None
        Created if missing; None: results are not kept.
    """

    def __init__(self, folder=None):
        self.folder = None if folder is None else Path(folder)
        self.read_count = self.written_count = 0

    def key(self, *parts):
        """Key of a result that depends on these parts and on the version of tankcal."""
        return "" if self.folder is None else hash_arrays(find_version(), *parts)

    def load(self, key, kind, **unsaved):
        """Result of a key, an object of the dataclass `kind`; None if it was not kept.

        `unsaved` are the values of fields that were not saved.
        """
        if self.folder is None:
            return None
        try:
            with np.load(self.folder / f"{key}{SUFFIX}", allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            result = _build(kind, arrays, "", unsaved)
        except (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError):
            return None
        self.read_count += 1
        return result

    def save(self, key, result):
        """Keep a result; fields with steps are omitted."""
        self.written_count += 1
        if self.folder is None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=self.folder, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, **{name: np.asarray(value) for name, value in _flatten("", result)
                                  if not name.startswith("steps.")})  # fmt: skip
            os.replace(name, self.folder / f"{key}{SUFFIX}")
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise


NO_STATE = State()


def _flatten(place, value):
    """Yield (name, value) of all parts of nested dataclasses and sequences; None has no part."""
    if is_dataclass(value):
        for item in fields(value):
            yield from _flatten(f"{place}{item.name}.", getattr(value, item.name))
    elif isinstance(value, tuple | list) and any(is_dataclass(item) or isinstance(item, np.ndarray)
                                                 for item in value):  # fmt: skip
        for number, item in enumerate(value):
            yield from _flatten(f"{place}{number}.", item)
    elif value is not None:
        yield place, value


def _build(kind, arrays, place, unsaved):
    """Object of a dataclass from its saved parts."""
    values = dict(unsaved)
    for item in fields(kind):
        if item.name not in values:
            values[item.name] = _build_field(item.type, arrays, f"{place}{item.name}.")
    return kind(**values)


def _build_field(kind, arrays, name):
    """Value of a field: a number, text, array, tuple, dataclass, or None without saved parts."""
    entries = [entry for entry in get_args(kind) if is_dataclass(entry)]
    if entries:  # a tuple of dataclasses
        count = len({key[len(name) :].partition(".")[0] for key in arrays
                     if key.startswith(name) and key != name})  # fmt: skip
        return tuple(_build(entries[0], arrays, f"{name}{i}.", {}) for i in range(count))
    if is_dataclass(kind):
        return _build(kind, arrays, name, {})
    if name not in arrays:
        return None
    value = arrays[name]
    if kind is tuple:
        return tuple(value.tolist())
    return value.item() if value.ndim == 0 else value
