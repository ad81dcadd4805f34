"""The layout of plain data that is saved: which keys it has, as a file lists them.

A key's path names the keys above it, `[]` being each row of a list: `adjustment.photos[].x_m`.
`.*` stands for whatever keys a user or a message gives: `job.certificate.*`. Every key that is
listed is there in all data that have what is above it.
"""

from collections.abc import Iterator
from functools import cache

ANY = "*"


@cache
def layout_of(file):
    """The keys that a Path lists as a tree: {key: {key below it: ...}}, a list's row being `[]`."""
    tree = {}
    for path in file.read_text(encoding="utf-8").split():
        branch = tree
        for key in path.replace("[]", ".[]").split("."):
            branch = branch.setdefault(key, {})
    return tree


def missing_keys(saved, file) -> Iterator[str]:
    """Paths of keys that a Path lists and plain data lack; of the rows of a list the first is
    looked at, for one program wrote them all."""
    return _missing(saved, layout_of(file), "")


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


def keys_in(saved, free=()):
    """Set of the paths of all keys that plain data have, in every row of their lists.

    free  paths of dicts with any keys: "job.certificate"
    """
    return set(_keys(saved, "", frozenset(free)))


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
