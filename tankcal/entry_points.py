"""Entry points of other distributions, found without `importlib.metadata` where none exist."""

import os
import sys


def find_entry_points(group):
    """Return {name: "module:class"} of the entry points of a group, sorted by name.

    The files are first searched for the name of the group, because the package
    `importlib.metadata` loads more slowly than the command line.
    """
    if not any(_names_group(folder, group) for folder in sys.path):
        return {}
    from importlib.metadata import entry_points

    entries = sorted(entry_points(group=group), key=lambda entry: entry.name)
    return {entry.name: entry.value for entry in entries}


def _names_group(folder, group):
    """Whether a distribution in a folder of `sys.path` has entry points of the group."""
    try:
        names = os.listdir(folder or ".")
    except OSError:
        return False
    for name in names:
        if name.endswith((".dist-info", ".egg-info")):
            try:
                with open(os.path.join(folder, name, "entry_points.txt"), encoding="utf-8") as file:
                    if f"[{group}]" in file.read():
                        return True
            except OSError:  # a distribution without entry points
                continue
    return False
