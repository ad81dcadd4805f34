"""Locations of the shipped files (examples, documentation, report templates), and languages.

In a wheel these folders are inside the package, in a checkout beside it.

Each language of the reports has a file in report_templates/words/.
"""

from pathlib import Path

from tankcal.errors import TankcalError

_PACKAGE = Path(__file__).resolve().parents[1]
DEFAULT = "en"
LANGUAGES = (DEFAULT, "pt-BR", "es")


def shipped_folder(name):
    """Return the path of a shipped folder, such as "examples" or "report_templates".

    Raises TankcalError if the installation lacks the folder.
    """
    for place in (_PACKAGE / name, _PACKAGE.parent / name):
        if place.is_dir():
            return place
    raise TankcalError(f"this installation of tankcal lacks its folder {name!r}: install it again")


def page_names():
    """Return the names of the pages of documentation, the studies last ("studies/coverage")."""
    folder = shipped_folder("docs")
    pages = sorted(path.stem for path in folder.glob("*.md"))
    studies = sorted(path.stem for path in folder.glob("studies/*.md"))
    return (*pages, *(f"studies/{name}" for name in studies))


def nearest_language(given):
    """Return the language for a code such as "pt", "pt_PT.UTF-8" or "ES"; None if unsupported."""
    first = given.strip().lower()[:2] if isinstance(given, str) else ""
    return next(
        (language for language in LANGUAGES if first and language.lower()[:2] == first), None
    )
