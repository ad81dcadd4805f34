"""Settings of the site (Sphinx); `make site` stages its pages by docs/stage.py and builds them."""

import re

import tankcal

project = "tankcal"
author = "The tankcal authors"
project_copyright = author
version = release = tankcal.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
language = "en"
myst_enable_extensions = []
myst_heading_anchors = 4
suppress_warnings = [
    "misc.highlighting_failure",  # a shell's session that is no program
    "ref.python",  # a name of several packages
]
templates_path = []

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True  # fields of a dataclass are told once

highlight_language = "none"  # of what says no language
html_theme = "furo"
html_title = f"tankcal {version}"
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_static_path = ["_static"]  # beside this file
html_css_files = ["site.css"]

SECTION = re.compile(r"^\s*-{3,}\s*$")


def set_plain_docstrings(app, what, name, obj, options, lines):
    """Keep the columns of a docstring without numpydoc sections, and of every module: the text
    after its first paragraph is set as typed."""
    if what in ("property", "attribute"):  # else a colon would be read as a type
        lines[0] = lines[0].replace(": ", "; ", 1)
    has_headings = any(SECTION.match(line) for line in lines)
    if (has_headings and what != "module") or "" not in lines:
        return
    first = lines.index("")
    rest = lines[first + 1 :]
    has_columns = any(line.startswith(" ") or "  " in line.strip() for line in rest)
    if has_headings or has_columns:
        lines[first:] = ["", "::", "", *("   " + line for line in rest), ""]


def tell_fields_apart(app, what, name, obj, options, lines):
    """Attributes that share a line ("low, high : ndarray") become one each, as napoleon needs."""
    if "Attributes" not in lines:
        return
    at = lines.index("Attributes") + 2
    while at < len(lines):
        names, _, kind = lines[at].partition(" : ")
        end = at + 1
        while end < len(lines) and lines[end].startswith(" "):
            end += 1
        if re.fullmatch(r"\w+(, \w+)+", names):
            told = [
                [f"{one} : {kind}" if kind else one, *lines[at + 1 : end]]
                for one in names.split(", ")
            ]
            lines[at:end] = [line for one in told for line in one]
            end = at + sum(map(len, told))
        at = end


def mark_code(app, what, name, obj, options, lines):
    """A single backtick in a docstring means code, whatever the markup of the site says."""
    end = lines.index("::") if "::" in lines else len(lines)
    text = re.sub(r"(?<![`:\w])`([^`]+)`(?!`)", r"``\1``\\ ", "\n".join(lines[:end]))
    lines[:end] = text.replace("|", r"\|").split("\n")


def setup(app):
    """Docstrings are taken as they stand in this house."""
    app.connect("autodoc-process-docstring", set_plain_docstrings, priority=100)
    app.connect("autodoc-process-docstring", tell_fields_apart, priority=200)
    app.connect("autodoc-process-docstring", mark_code, priority=900)
