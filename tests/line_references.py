"""Line numbers in docs/house.md: `path.py:LINE` `name` is the line that defines the name.

`python tests/line_references.py` writes them anew.
"""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "house.md"
REFERENCE = re.compile(r"`(tankcal/[\w/]+\.py):(\d+)` `(\w+)`")


def definition_line(path, name):
    """Line of the definition of a function or class of a module; None if there is none."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    kinds = (ast.FunctionDef, ast.ClassDef)
    return next((i.lineno for i in tree.body if isinstance(i, kinds) and i.name == name), None)


def references(text):
    """(path, line, name) of each reference of a page."""
    return [(path, int(line), name) for path, line, name in REFERENCE.findall(text)]


def with_lines(text):
    """The page with the present lines."""

    def renewed(match):
        path, line, name = match.groups()
        return f"`{path}:{definition_line(path, name) or line}` `{name}`"

    return REFERENCE.sub(renewed, text)


if __name__ == "__main__":
    PAGE.write_text(with_lines(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
