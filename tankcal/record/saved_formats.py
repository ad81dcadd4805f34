"""Formats of data saved as JSON: the versions that are read, and the migration of older versions.

Once a version is released, an added or removed key, or a key with another meaning, needs a new
version: `version` increases, and a step converts data of the previous version. The tests keep files
of every released version. The folder `schemas` contains the keys of the written versions as JSON
schemas, which follow from dataclasses (`tankcal.record.schema`).
"""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import list_some, message
from tankcal.record.schema import check_data

MOST_NAMED = 3  # largest number of missing keys in a message
SCHEMAS = Path(__file__).with_name("schemas")


@dataclass(frozen=True)
class SavedFormat:
    """A format, and the versions that are read.

    Attributes
    ----------
    name : str
        Name of the format, such as "tankcal-record".
    version : int
        Version that is written.
    file : str
        Name of the written file.
    steps : dict
        {version: function that converts data of this version to the next version}.
    kinds : tuple of str
        Values of the key "kind"; () for a format without this key.
    complete : callable
        complete(data, version) adds to data of a version the keys that its drafts lacked.
    schemas : Path
        Folder of the JSON schemas of written data.
    """

    name: str
    version: int
    file: str
    steps: dict = field(default_factory=dict)
    kinds: tuple = ()
    complete: Callable = lambda saved, version: saved
    schemas: Path = SCHEMAS

    @property
    def format(self):
        """Value of the key "format" in written data."""
        return f"{self.name}/{self.version}"

    def schema_file(self, kind=None):
        """Return the path of the JSON schema of written data, of a kind if the format has any."""
        name = f"{self.name}-{self.version}"
        return self.schemas / (f"{name}-{kind}.json" if self.kinds else f"{name}.json")

    def schema(self, kind=None):
        """Return the JSON schema of written data, of a kind if the format has any."""
        return _read_schema(self.schema_file(kind))

    def version_of(self, saved):
        """Return the version of data if it can be read, otherwise None."""
        name = saved.get("format") if isinstance(saved, dict) else None
        if not isinstance(name, str):
            return None
        match = re.fullmatch(rf"{self.name}/([0-9]{{1,4}})", name)
        version = int(match[1]) if match else None
        return version if version in (*self.steps, self.version) else None

    def migrated(self, saved, name):
        """Return data of any readable version as data of the written version.

        Parameters
        ----------
        saved : dict
            Data as parsed; they are not changed.
        name : str
            Name of the file, for the problems.

        Returns
        -------
        dict
            The same object if it has the written version.

        Raises
        ------
        InputError
            In one line with the version, for missing keys or another format; with a line for each
            value of another type.
        """
        version = self.version_of(saved)
        if version is None:
            found = saved.get("format") if isinstance(saved, dict) else None
            expected = message(
                "record_of_other_format",
                "found format {found}, expected {expected} or an older version of it",
                found=repr(found), expected=repr(self.format),
            )  # fmt: skip
            raise InputError(Problem(name, expected))
        kind = saved.get("kind") if self.kinds else None
        if self.kinds and kind not in self.kinds:
            expected = message(
                "result_of_other_kind", "found kind {found}; expected one of: {kinds}",
                found=repr(kind), kinds=list_some(self.kinds, len(self.kinds)),
            )  # fmt: skip
            raise InputError(Problem(name, expected))
        try:
            saved = self.complete(saved, version)
            for step in range(version, self.version):
                saved = self.steps[step](saved)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            expected = message(
                "record_is_damaged",
                "found format {found}, but not what a file of that version holds ({what}); "
                "expected {file} as tankcal wrote it: make it again",
                found=f"{self.name}/{version}", what=str(error), file=self.file,
            )  # fmt: skip
            raise InputError(Problem(name, expected)) from error
        missing, problems = check_data(saved, self.schema(kind), name)
        if missing:
            expected = message(
                "record_lacks_keys",
                "found format {found} without {keys}, which every file of that version has; "
                "expected {file} as tankcal wrote it: make it again",
                found=f"{self.name}/{version}", keys=list_some(missing, MOST_NAMED), file=self.file,
            )  # fmt: skip
            raise InputError(Problem(name, expected))
        if problems:
            raise InputError(problems)
        return saved


@cache
def _read_schema(path):
    return json.loads(path.read_text(encoding="utf-8"))
