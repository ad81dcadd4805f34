"""Conversion of blocks to PDF by typst, with the page style page.typ.

The page style reads the blocks as JSON data. User text is therefore never interpreted as markup.
"""

import base64
import json
import re
import shutil
import subprocess
import sys
from contextlib import nullcontext
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from unicodedata import combining

from tankcal.errors import TankcalError
from tankcal.memory import return_freed_memory
from tankcal.messages import printable
from tankcal.report import attachments
from tankcal.report.attachments import with_signature_field
from tankcal.report.blocks import WEB_ONLY
from tankcal.report.composed_pages import LONG, compose_pages, is_composed, sample_rows
from tankcal.report.plain_formulas import formula_nodes
from tankcal.text.shipped import shipped_folder

STANDARDS = ["a-3a", "ua-1"]  # archival PDF/A-3a and accessible PDF/UA-1
PLACES = ("asked", "tables", "no")  # blocks that request their position on the page (page.typ)
UNSETTLED = "did not converge"  # text in typst's warning that positions are not final
FORGETTING = 12  # compilations after which typst discards unused cached data
_ALONE = Lock()  # held while a document with a long table is typeset
IN_A_PROCESS = """
import sys
from pathlib import Path
from tankcal.report.pdf import _compile_in
from tankcal.errors import TankcalError
folder = Path(sys.argv[1])
try:
    (folder / "made.part").write_bytes(_compile_in(folder, int(sys.argv[2])))
    (folder / "made.part").rename(folder / "made.pdf")
except TankcalError as error:
    (folder / "refused.txt").write_text(str(error), encoding="utf-8")
"""
# An escaped backslash, which is kept, or a control character in JSON notation.
_CONTROL_IN_JSON = re.compile(r"(\\\\)|\\u00[01][0-9a-f]|\\[bf]|[\x7f-\x9f]")
# Cells of numbers, which stay on one line.
_ON_ONE_LINE = re.compile(r"[0-9.,+*\N{MINUS SIGN}\N{EN DASH}\N{NARROW NO-BREAK SPACE}]*")
FONT_FILES = ("STIXGeneral*.ttf", "DejaVuSerif*.ttf", "DejaVuSans.ttf")


def pdf(blocks, folder=".", again=False, packed=None):
    """Typeset blocks as a PDF.

    Equal blocks and attachments give equal bytes.

    Parameters
    ----------
    blocks : list of dict
        Blocks; the first block is the document.
    folder : str or Path, optional
        Folder of the files that the document blocks attach.
    again : bool, optional
        True if a later document contains these blocks, so that the typesetter keeps its cache.
    packed : attachments.Packed, optional
        Compressed files that other papers of the run also embed.

    Returns
    -------
    bytes
        PDF/A-3a and PDF/UA-1.

    Raises
    ------
    TankcalError
        If a page cannot be typeset (a character without font, a broken SVG), or if an attached
        file has changed.
    """
    shown = [block for block in blocks if block["kind"] not in WEB_ONLY]
    blocks = [prepare_table(_add_formulas(block)) for block in shown]
    attached = attachments.contents(blocks, folder)
    files, blocks = _pictures_as_files(blocks)
    files["main.typ"] = (shipped_folder("report_templates") / "page.typ").read_bytes()

    def typeset(attached_files):
        return _typeset(files | attached_files, blocks, _timestamp(blocks[0]["date"]), again)

    content = _set(typeset, attached, packed)
    field = next((block["field"] for block in blocks if block.get("field")), None)
    return with_signature_field(content, field) if field else content


def _spell_controls(text):
    """Replace control characters in JSON, which no font contains, by texts such as `\\x00`."""
    return _CONTROL_IN_JSON.sub(_spell_control, text)


def _spell_control(match):
    if match[1]:
        return match[0]
    return json.dumps(printable(json.loads(f'"{match[0]}"')))[1:-1]


def _set(typeset, attached, packed):
    """Typeset the pages with the digests of attached files and replace the digests by the files.

    If the PDF has an unexpected form, the typesetter embeds the files itself.
    """
    if not attached:
        return typeset({})
    draft = typeset({f"attached-{name}": digest.encode() for name, (digest, _) in attached.items()})
    content = attachments.hold(draft, dict(attached.values()), packed or attachments.Packed())
    if content is None:
        content = typeset({f"attached-{name}": whole for name, (_, whole) in attached.items()})
    return content


def _typeset(files, blocks, timestamp, again):
    """Typeset the pages; compose those of long tables of numbers from a few typeset pages."""
    composed = [block for block in blocks if is_composed(block)]
    if composed:
        sampled = [
            block | {"samples": sample_rows(block)} if is_composed(block) else block
            for block in blocks
        ]
        draft = _compile(files | _block_file(sampled), timestamp)
        _discard_cache()
        return_freed_memory()
        if content := compose_pages(draft, composed):
            return content
    long = any("table" in block["kind"] and len(block["rows"]) > LONG for block in blocks)
    with _ALONE if long else nullcontext():
        content = _compile(files | _block_file(blocks), timestamp)
        if long and not again:
            _discard_cache()
    return content


def _block_file(blocks):
    """File of the blocks that the page style reads."""
    text = _spell_controls(json.dumps(blocks, ensure_ascii=False))
    return {"blocks.json": text.encode("utf-8")}


def _compile(files, timestamp):
    """Typeset the pages, in a separate process if the system limits the memory.

    A typesetter that runs out of memory terminates its process.
    """
    return_freed_memory()  # the typesetter cannot use memory that Python has freed but keeps
    with TemporaryDirectory(prefix="tankcal-page-") as folder:
        # Copy the fonts of the figures from matplotlib, except its fallback font.
        # The import of matplotlib is avoided, since it takes as long as typesetting several
        # pages.
        (package,) = find_spec("matplotlib").submodule_search_locations
        fonts = Path(package) / "mpl-data" / "fonts" / "ttf"
        for pattern in FONT_FILES:
            for path in fonts.glob(pattern):
                shutil.copyfile(path, Path(folder) / path.name)
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        if not _is_memory_limited():
            return _compile_in(folder, timestamp)
        command = [sys.executable, "-c", IN_A_PROCESS, folder, str(timestamp)]
        subprocess.run(command, capture_output=True, check=False)
        pdf_file, refusal = Path(folder, "made.pdf"), Path(folder, "refused.txt")
        if pdf_file.is_file():
            return pdf_file.read_bytes()
        if refusal.is_file():
            raise TankcalError(refusal.read_text(encoding="utf-8"))
        raise MemoryError


def _is_memory_limited():
    """Return whether the system limits the memory of this process."""
    if find_spec("resource") is None:  # Windows
        return False
    import resource

    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


def _compile_in(folder, timestamp):
    """Compile main.typ in a folder and return the PDF; raise TankcalError on failure.

    Fonts of the system are used only for characters that the fonts of tankcal lack. If the
    positions on the pages do not converge, figures no longer request their position. If this is
    not sufficient, no block requests its position.
    """
    import typst

    def compiled(ignore_system_fonts, places=PLACES):
        content, warnings = typst.compile_with_warnings(
            Path(folder) / "main.typ",
            root=folder,
            font_paths=[folder],
            ignore_system_fonts=ignore_system_fonts,
            sys_inputs={"places": places[0]},
            pdf_standards=STANDARDS,
            timestamp=timestamp,
        )
        if places[1:] and any(UNSETTLED in warning.message for warning in warnings):
            return compiled(ignore_system_fonts, places[1:])
        return content

    try:
        try:
            return compiled(ignore_system_fonts=True)
        except typst.TypstError as error:
            if "could not be displayed" not in error.message:
                raise
            return compiled(ignore_system_fonts=False)
    except typst.TypstError as error:
        raise TankcalError(f"the PDF cannot be set: {error.message}") from error


def _discard_cache():
    """Let the typesetter discard its cache, which holds a gigabyte for a long table."""
    import typst

    for _ in range(FORGETTING):
        typst.compile(b"", ignore_system_fonts=True)


def _add_formulas(block):
    """Add the formula nodes of a table, {column: {text: nodes}}.

    The nodes are derived from the text, so that typst code of a notebook is never executed.
    """
    if block["kind"] != "table":
        return block
    columns = block.get("formulas", ())
    nodes = {i: {row[i]: formula_nodes(row[i]) for row in block["rows"]} for i in columns}
    return block | {"formulas": nodes}


def _pictures_as_files(blocks):
    """Move images into separate files; return the files and the blocks that name them."""
    files, changed = {}, []
    for number, block in enumerate(blocks):
        if block["kind"] == "document":
            block = block | {"letterhead": _letterhead_with_file(block.get("letterhead"), files)}
        kind = next((kind for kind in ("svg", "png") if kind in block), None)
        if kind == "svg":
            name = f"figure-{number}.svg"
            files[name] = block["svg"].encode("utf-8")
        elif kind == "png":
            name = f"figure-{number}.png"
            files[name] = base64.b64decode(block["png"])
        if kind:
            block = {key: value for key, value in block.items() if key != kind} | {"file": name}
        changed.append(block)
    return files, changed


def _letterhead_with_file(letterhead, files):
    """Add the files of logo and mark to `files`; return the letterhead with their names."""
    for key in ("logo", "mark"):
        picture = letterhead and letterhead.get(key)
        if not isinstance(picture, dict):
            continue
        name, content = f"{key}.{picture['kind']}", picture["content"]
        is_svg = picture["kind"] == "svg"
        files[name] = content.encode("utf-8") if is_svg else base64.b64decode(content)
        letterhead = letterhead | {key: {"file": name, "alt": picture["alt"]}}
    return letterhead


def _timestamp(date):
    """Return the Unix time, s, of midnight UTC of an ISO date; 0 without a date."""
    if not date:
        return 0
    try:
        return int(datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp())
    except ValueError:
        raise TankcalError(f"the date of the document is {date!r}, not YYYY-MM-DD") from None


# ---- tables: alignment of decimal marks and widths of columns

# The typesetter lays out a long table several times. Without this preparation, it would count the
# letters of every cell each time.


def prepare_table(block):
    """Return a block in the form that `page.typ` requires; only tables change.

    A number with fewer decimals than its column becomes {"text": number, "missing": digits}. The
    page style sets the missing digits invisibly, so that the decimal marks are aligned. A
    `columns_table` also has `shares`, relative widths of its columns, and `even`. `even` is True if
    the table consists of numbers only, so that all rows have equal height.

    Examples
    --------
    >>> table = {"kind": "columns_table", "align": ["decimal"], "rows": [["1.25"], ["10"]]}
    >>> table |= {"decimal_mark": ".", "columns": [{"heading": "V", "unit": "L"}]}
    >>> prepared = prepare_table(table)
    >>> prepared["rows"], prepared["shares"], prepared["even"]
    ([['1.25'], [{'text': '10', 'missing': '.00'}]], [6], True)
    """
    if block["kind"] not in ("table", "columns_table"):
        return block
    columns = [[row[i] for row in block["rows"]] for i in range(len(block["align"]))]
    mark, formulas = block["decimal_mark"], block.get("formulas", ())
    filled = [
        _filled(texts, mark) if align == "decimal" and i not in formulas else texts
        for i, (texts, align) in enumerate(zip(columns, block["align"], strict=True))
    ]
    block = block | {"rows": [list(row) for row in zip(*filled, strict=True)]}
    if block["kind"] == "table":
        return block
    shares = [_share(*column) for column in zip(block["columns"], filled, strict=True)]
    even = all(_ON_ONE_LINE.fullmatch(text) for texts in columns for text in texts)
    return block | {"shares": shares, "even": even}


def _filled(texts, mark):
    """Return the numbers of a column, with the decimals that each lacks to the longest."""
    decimals = [len(text.rpartition(mark)[2]) if mark in text else None for text in texts]
    known = [count for count in decimals if count is not None]
    if not known:
        return texts
    longest = max(known)
    return [_cell(text, count, longest, mark) for text, count in zip(texts, decimals, strict=True)]


def _cell(text, decimals, longest, mark):
    if decimals == longest:
        return text
    missing = mark + "0" * longest if decimals is None else "0" * (longest - decimals)
    return {"text": text, "missing": missing}


def _share(column, cells):
    """Number of letters of the longest cell, heading or unit of a column, plus a margin of 1."""
    heads = map(_letters, (column["heading"], column["unit"]))
    return 1 + max(*heads, *map(_length, cells))


def _length(cell):
    if isinstance(cell, str):
        return _letters(cell)
    return _letters(cell["text"]) + len(cell["missing"])


def _letters(text):
    return len(text) if text.isascii() else sum(not combining(sign) for sign in text)
