"""Conversion of an executed notebook into the list of its blocks."""

import base64

from tankcal.errors import TankcalError
from tankcal.report import blocks
from tankcal.report.laboratory import data_problem
from tankcal.report.markdown import nodes

PARTS = ("certificate", "working-papers", "field-table")
BESIDE = ("field-table",)  # parts that repeat other parts; the whole report omits them


def blocks_of(notebook, part="", name="notebook"):
    """Return the blocks of a notebook in order.

    Parameters
    ----------
    notebook : dict
        Executed notebook.
    part : str, optional
        Name of a part. A part consists of the cells with its tag and of the untagged cells that
        follow. "" selects all parts except BESIDE.
    name : str, optional
        Title of a notebook without a document block.

    Returns
    -------
    list of dict
        Blocks; the first block has the kind "document".

    Raises
    ------
    TankcalError
        For an unknown or empty part, and for a cell that ended in an error.
    """
    if part not in ("", *PARTS):
        raise TankcalError(f"part {part!r} is not known; it is one of: {', '.join(PARTS)}")
    shown = []
    for number, cell in _cells(notebook, part):
        shown += _blocks_of_cell(cell, f"cell {number}")
    if part and not shown:
        raise TankcalError(f"the notebook has nothing to show that is tagged {part!r}")
    if not shown or shown[0]["kind"] != "document":
        shown.insert(0, blocks.document(title=name).data)
    return _headings_in_steps(shown if part else _mark_copy(shown))


def _mark_copy(shown):
    """Return the blocks of a whole notebook without signature, with a notice below the title.

    Only the PDF of the certificate is signed, so that a certificate has a single original.
    """
    copies = [block["copy"] for block in shown if block.get("copy")]
    notes = [
        block.data
        for notice, sentence in copies
        for block in (blocks.notice(notice), blocks.paragraph(sentence))
    ]
    shown = [block for block in shown if not block.get("copy")]
    place = next((i for i, block in enumerate(shown, 1) if block["kind"] == "masthead"), 1)
    return [*shown[:place], *notes, *shown[place:]]


def last_cell(notebook, part=""):
    """Number, from 1, of the last cell that `blocks_of` reads; the last cell if it reads none."""
    return max((number for number, _ in _cells(notebook, part)), default=len(notebook["cells"]))


def _headings_in_steps(shown):
    """Return the blocks without gaps in heading levels, which screen readers need."""
    level = 0

    def stepped(item):
        nonlocal level
        if "level" not in item:
            return item
        level = min(item["level"], level + 1)
        return item | {"level": level}

    return [
        block | {"nodes": [stepped(node) for node in block["nodes"]]}
        if block["kind"] == "markdown"
        else stepped(block)
        for block in shown
    ]


def _cells(notebook, part):
    """Yield (number, cell) for the cells of a part; an untagged cell belongs to the part before."""
    current = ""
    for number, cell in enumerate(notebook["cells"], 1):
        tags = cell["metadata"].get("tags", [])
        current = next((tag for tag in tags if tag in PARTS), current)
        if current in ("", part) or (not part and current not in BESIDE):
            yield number, cell


def _blocks_of_cell(cell, place):
    """Return the blocks of one cell; `place` names the cell in error messages."""
    if cell["cell_type"] == "markdown":
        return (
            [{"kind": "markdown", "nodes": nodes(cell["source"])}] if cell["source"].strip() else []
        )
    if cell["cell_type"] != "code":
        return []
    shown = [_block_of_output(output, place) for output in cell["outputs"]]
    return [block for block in shown if block]


def _block_of_output(output, place):
    """Return the block of an output of a cell, or None for an output that is not shown."""
    if output["output_type"] == "error":
        raise TankcalError(f"{place} of the notebook failed: {output['ename']}: {output['evalue']}")
    if output["output_type"] == "stream":
        if output["name"] == "stderr":  # remarks of libraries are kept in the notebook only
            return None
        return blocks.code(output["text"].rstrip("\n")).data if output["text"].strip() else None
    data = output.get("data", {})
    if blocks.MIME in data:
        return _check(data[blocks.MIME], place)
    if "image/svg+xml" in data:
        return _picture(data, "svg", data["image/svg+xml"])
    if "image/png" in data:
        return _picture(data, "png", data["image/png"])
    if "text/plain" in data:
        return blocks.code(data["text/plain"]).data
    return None


def _picture(data, kind, content):
    """Return the figure block of an image, with its text as the alternative text."""
    if kind == "png":
        content = base64.b64encode(base64.b64decode(content)).decode("ascii")
    alt = data.get("text/plain", "picture")
    return {"kind": "figure", kind: content, "caption": "", "alt": alt, "width": 1.0}


_KEYS = {  # keys that a block of each kind must have
    "document": {"part", "title", "author", "date", "language", "notice", "running", "footer"},
    "masthead": {"title", "subtitle", "laboratory", "number_label", "number"},
    "heading": {"text", "level"},
    "paragraph": {"text"},
    "list": {"items"},
    "notice": {"text"},
    "result": {"label", "text", "note"},
    "signature": {"labels"},
    "hash_code": {"svg", "code", "text", "alt"},
    "end": {"text"},
    "code": {"text"},
    "key_values": {"caption", "items"},
    "table": {"caption", "columns", "rows", "align"},
    "columns_table": {"caption", "columns", "rows", "align", "across"},
    "figure": {"caption", "alt", "width", "svg"},
    "calculator": {"text", "unit", "height_m", "volume", "U", "deliveries"},
    "tank_view": {"text", "shell", "solid", "reason"},
    "wall_map": {"text", "names", "azimuth_deg", "height_m", "residual_m", "joints_m", "rejected"},
    "cloud_map": {"text", "columns", "tenths", "azimuth_deg", "height_m", "limit_mm", "hidden"},
}


def _check(data, place):
    """Return a valid block; raise TankcalError for a block of a later version."""
    kind = data.get("kind") if isinstance(data, dict) else None
    if kind not in _KEYS:
        raise TankcalError(f"{place} of the notebook shows a block of unknown kind: {kind!r}")
    missing = sorted(_KEYS[kind] - set(data))
    if missing:
        raise TankcalError(f"{place} of the notebook: its {kind} lacks {', '.join(missing)}")
    if kind == "document" and data.get("letterhead") is not None:
        problem = data_problem(data["letterhead"])
        if problem:
            raise TankcalError(f"{place} of the notebook: its letterhead {problem}")
    return data
