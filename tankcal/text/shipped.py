"""Locations of the shipped files: examples, documentation and report templates.

In a wheel these folders are inside the package, in a checkout beside it.
"""

from pathlib import Path

from tankcal.errors import TankcalError

_PACKAGE = Path(__file__).resolve().parents[1]


def shipped_folder(name):
    """Return the path of a shipped folder, such as "examples" or "report_templates".

    Raises TankcalError if the installation lacks the folder.
    """
    for place in (_PACKAGE / name, _PACKAGE.parent / name):
        if place.is_dir():
            return place
    raise TankcalError(f"this installation of tankcal lacks its folder {name!r}: install it again")


def page_names():
    """Return the names of the pages of documentation in alphabetical order."""
    return tuple(sorted(path.stem for path in shipped_folder("docs").glob("*.md")))
