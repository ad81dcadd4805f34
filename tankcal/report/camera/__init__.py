"""Output of the camera analyses: lines in the terminal, papers, CSV tables and JSON.

A result is the dict of `plain_<kind>` of `tankcal.record.camera_<kind>`, possibly with the key
"made_from". This package computes no number.
"""

import json
from importlib import import_module
from pathlib import Path
from textwrap import wrap

from tankcal.messages import message
from tankcal.record import manifest
from tankcal.record.versions import CAMERA_KINDS
from tankcal.report import folders
from tankcal.report.camera.paper import CameraPaper, describe_origin
from tankcal.report.outputs import write_rows
from tankcal.report.papers import write_papers

__all__ = ["CameraPaper", "describe_origin", "lines", "refuse_foreign", "write"]

RECORD = "camera.json"
TEMPLATE = "camera.ipynb"
TABLES = (
    "cameras.csv",
    "pairs.csv",
    "parameters.csv",
    "correlations.csv",
    "groups.csv",
    "components.csv",
    "loadings.csv",
    "dropped.csv",
    "advice.csv",
    "runs.csv",
    "check_points.csv",
    "axes.csv",
    "classes.csv",
)
FILES = (RECORD, *TABLES, "report.ipynb", "report.pdf", "report.html", manifest.FILE)


def lines(result, language=None):
    """Lines of text for the terminal, with aligned tables, in a language or English."""
    paper = CameraPaper(result, language)
    return lines_of(_load_module(result).summary(paper))


def write(result, directory, progress=None, language=None):
    """Write JSON, CSV tables, notebook, PDF and web page of a result, all or none of them.

    Parameters
    ----------
    result : dict
        Result of an analysis.
    directory : path-like
        Folder, created if missing. Earlier results of these analyses in it are replaced.
    progress : callable, optional
        Called as progress(text, done, total).
    language : str, optional
        Language of notebook, PDF and web page, one of languages.LANGUAGES; by default English.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If the folder contains other files.
    TankcalError
        If the language has no words.
    """
    refuse_foreign(directory)
    from tankcal.report.notebook import (
        join_templates,  # not for lines in a terminal: it takes a second
    )

    kind = CameraPaper(result, language).result["kind"]
    progress = progress or (lambda text, done, total: None)
    with folders.replace_folder(directory, language) as temporary:
        text = json.dumps(result, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        (temporary / RECORD).write_text(text + "\n", encoding="utf-8")
        for name, rows in _load_module(result).tables(result).items():
            if rows:
                write_rows(rows, temporary / name)
        others = [other for other in CAMERA_KINDS if other != kind]
        notebook = join_templates(RECORD, others, (TEMPLATE,), LANGUAGE=language)
        write_papers(
            notebook,
            temporary,
            (("report.pdf", ""),),
            lambda done, total: progress(
                message("camera_writing_report", "writing the report"), done, total
            ),
        )
    return [Path(directory) / name for name in FILES if (Path(directory) / name).exists()]


def refuse_foreign(directory):
    """Raise InputError if `directory` exists and contains files other than those of write()."""
    folders.refuse_foreign(directory, FILES)


def _load_module(result):
    """Module that presents results of this kind."""
    return import_module(f"tankcal.report.camera.{result['kind']}")


# ---- text for the terminal

WIDTH = 100  # characters of a line of text; tables may be wider
_GAP = "  "
_BLANKS = dict.fromkeys(
    map(ord, "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{FIGURE SPACE}"), " "
)


def lines_of(shown):
    """Return the lines of text of blocks (list of `report.blocks.Block`), without figures.

    Lines are not broken at no-break spaces, which are replaced by normal spaces.
    """
    lines = []
    for block in shown:
        block_lines = _WRITERS.get(block.data["kind"], lambda _: [])(block.data)
        if block_lines:
            lines += [*([""] if lines else []), *block_lines]
    return [line.translate(_BLANKS).rstrip() for line in lines]


def _heading(block):
    return [block["text"], "-" * len(block["text"])]


def _paragraph(block):
    return _wrap(block["text"])


def _listing(block):
    return [line for item in block["items"] for line in _wrap(item, "- ", "  ")]


def _wrap(text, first="", later=""):
    return wrap(
        text,
        WIDTH,
        initial_indent=first,
        subsequent_indent=later,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _result(block):
    note = _wrap(block["note"], _GAP, _GAP) if block["note"] else []
    return [*_wrap(f"{block['label']}: {block['text']}"), *note]


def _key_values(block):
    width = max((len(name) for name, _ in block["items"]), default=0)
    lines = [block["caption"]] if block["caption"] else []
    for name, value in block["items"]:
        lines += _wrap(value or " ", f"{name:<{width}}{_GAP}", " " * (width + len(_GAP)))
    return lines


def _table(block):
    """Return the lines of a table with aligned columns."""
    heads = [column["heading"] for column in block["columns"]]
    units = [column["unit"] for column in block["columns"]]
    columns = [
        _align(texts, align, block["decimal_mark"])
        for texts, align in zip(zip(*block["rows"], strict=True), block["align"], strict=False)
    ] or [()] * len(heads)
    rows = [heads, *([units] if any(units) else []), *zip(*columns, strict=True)]
    widths = [max(map(len, texts)) for texts in zip(*rows, strict=True)]
    lines = [
        _GAP.join(
            text.ljust(width) if align == "left" else text.rjust(width)
            for text, width, align in zip(row, widths, block["align"], strict=True)
        ).rstrip()
        for row in rows
    ]
    below_head = 2 if any(units) else 1
    rule = "-" * (sum(widths) + len(_GAP) * (len(widths) - 1))
    caption = _wrap(block["caption"]) if block["caption"] else []
    return [*caption, *lines[:below_head], rule, *lines[below_head:]]


def _align(texts, align, mark):
    """Pad the numbers of a column so that their decimal marks are aligned."""
    if align != "decimal":
        return texts
    tails = [len(text) - text.rfind(mark) if mark in text else 0 for text in texts]
    longest = max(tails, default=0)
    return [text + " " * (longest - tail) for text, tail in zip(texts, tails, strict=True)]


_WRITERS = {
    "heading": _heading,
    "paragraph": _paragraph,
    "notice": _paragraph,
    "list": _listing,
    "result": _result,
    "key_values": _key_values,
    "table": _table,
}
