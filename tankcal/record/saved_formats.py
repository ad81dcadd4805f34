"""Formats of what is saved as JSON: which versions are read, and how an older one becomes new.

A key that comes, goes or changes its meaning makes a new version, once the last one has been
released: `version` counts up, and a step says what data of the version before get for each of them.
Every released version has kept files in the tests. The keys of the version that is written are in
the folder `schemas`, as JSON schemas that follow from dataclasses (`tankcal.record.schema`).
"""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import list_some, message
from tankcal.record.schema import checked

MOST_NAMED = 3  # keys that are missing
SCHEMAS = Path(__file__).with_name("schemas")


@dataclass(frozen=True)
class SavedFormat:
    """A format and the versions of it that are read.

    name       such as "tankcal-record"
    version    the one that is written
    file       name of the file as tankcal writes it
    steps      {version: function that makes data of the next version of it}
    kinds      what may stand under the key "kind"; none: there is no such key
    completed  function that adds to data of a version what its drafts did not have:
               completed(data, version)
    """

    name: str
    version: int
    file: str
    steps: dict = field(default_factory=dict)
    kinds: tuple = ()
    completed: Callable = lambda saved, version: saved

    @property
    def format(self):
        """What stands under the key "format" in what is written."""
        return f"{self.name}/{self.version}"

    def schema_file(self, kind=None):
        """Path of the JSON schema of what is written, of a kind where there are any."""
        name = f"{self.name}-{self.version}"
        return SCHEMAS / (f"{name}-{kind}.json" if self.kinds else f"{name}.json")

    def schema(self, kind=None):
        """The JSON schema of what is written, of a kind where there are any."""
        return _read(self.schema_file(kind))

    def version_of(self, saved):
        """The version of data that can be read; None of anything else."""
        found = saved.get("format") if isinstance(saved, dict) else None
        match = re.fullmatch(rf"{self.name}/([0-9]{{1,4}})", found) if _is_text(found) else None
        version = int(match[1]) if match else None
        return version if version in (*self.steps, self.version) else None

    def migrated(self, saved, name):
        """Data of any version that can be read, as one of `version`; the same when it is one.

        saved  as parsed; it is not changed        name  of its file, for problems

        Raises InputError: in one line, with the version, for what lacks keys or is of another
        format; with a line for each value that is not of its type.
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
            saved = self.completed(saved, version)
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
        missing, problems = checked(saved, self.schema(kind), name)
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
def _read(path):
    return json.loads(path.read_text(encoding="utf-8"))


def _is_text(found):
    return isinstance(found, str)
