"""The layout of a record: which keys it has, as `layouts/N.txt` lists them for version N.

A key's path names the keys above it, `[]` being each row of a list: `adjustment.photos[].x_m`.
`.*` stands for whatever keys a user or a message gives: `job.certificate.*`. Every key that is
listed is there in each record that has what is above it.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

ANY = "*"


def layout_file(version):
    """Path of the list of keys of a version."""
    return Path(__file__).with_name("layouts") / f"{version}.txt"


@cache
def layout_of(version):
    """The keys of a version as a tree: {key: {key below it: ...}}, a row of a list being `[]`."""
    tree = {}
    for path in layout_file(version).read_text(encoding="utf-8").split():
        branch = tree
        for key in path.replace("[]", ".[]").split("."):
            branch = branch.setdefault(key, {})
    return tree


def missing_keys(record, version) -> Iterator[str]:
    """Paths of keys that a version lists and `record` lacks; of the rows of a list the first is
    looked at, for one program wrote them all."""
    return _missing(record, layout_of(version), "")


def _missing(value, branch, path):
    if value is None or not branch or ANY in branch:
        return
    if "[]" in branch:
        if not isinstance(value, list):
            yield path
        elif value:
            yield from _missing(value[0], branch["[]"], path + "[]")
        return
    for key, below in branch.items():
        place = f"{path}.{key}".lstrip(".")
        if not isinstance(value, dict) or key not in value:
            yield place
        else:
            yield from _missing(value[key], below, place)


def keys_in(record, free=()):
    """Set of the paths of all keys that `record` has, in every row of its lists.

    free  paths of dicts with any keys: "job.certificate"
    """
    return set(_keys(record, "", frozenset(free)))


def _keys(value, path, free):
    if path in free:
        yield f"{path}.{ANY}"
    elif isinstance(value, dict):
        for key, item in value.items():
            place = f"{path}.{key}".lstrip(".")
            yield place
            yield from _keys(item, place, free)
    elif isinstance(value, list):
        for item in value:
            if isinstance(item, dict | list):
                yield from _keys(item, path + "[]", free)
