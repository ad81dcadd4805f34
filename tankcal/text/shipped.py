"""Where the files are that ship beside the code: the examples and the report templates.

In a wheel they lie inside the package, in a checkout beside it.
"""

from pathlib import Path

from tankcal.errors import TankcalError

_PACKAGE = Path(__file__).resolve().parents[1]


def shipped_folder(name):
    """Path of the shipped folder `name` ("examples", "report_templates").

    Raises TankcalError when the installation lacks it.
    """
    for place in (_PACKAGE / name, _PACKAGE.parent / name):
        if place.is_dir():
            return place
    raise TankcalError(f"this installation of tankcal lacks its folder {name!r}: install it again")
