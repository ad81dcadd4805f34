"""Blocks as a PDF, by typst: the page style is page.typ, the blocks reach it as JSON data.

No text of a user is ever read as markup, for typst sees it only as strings of that data.
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

from tankcal.errors import TankcalError
from tankcal.memory import return_freed_memory
from tankcal.messages import printable
from tankcal.report import attachments
from tankcal.report.blocks import WEB_ONLY
from tankcal.report.page_tables import prepared
from tankcal.report.plain_formulas import formula_nodes
from tankcal.report.signature_field import with_signature_field
from tankcal.text.shipped import shipped_folder

STANDARDS = ["a-3a", "ua-1"]  # archival, and readable by a screen reader
PLACES = ("asked", "tables", "no")  # who asks for its place on the page (page.typ)
UNSETTLED = "did not converge"  # in typst's warning that places are not those it set last
LONG = 5000  # rows of a table: set at once, two documents with more would take gigabytes
FORGETTING = 12  # pages later the typesetter has thrown away what none of them used
_ALONE = Lock()
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
# an escaped backslash, which is kept, or a control character as JSON writes it
_CONTROL_IN_JSON = re.compile(r"(\\\\)|\\u00[01][0-9a-f]|\\[bf]|[\x7f-\x9f]")
FONT_FILES = ("STIXGeneral*.ttf", "DejaVuSerif*.ttf", "DejaVuSans.ttf")


def pdf(blocks, folder=".", again=False, packed=None):
    """The blocks as the bytes of a PDF; the same blocks and attachments give the same bytes.

    folder   where the files lie that the document blocks attach
    again    whether a later document has the same blocks: what is known of them is kept for it
    packed   attachments.Packed, where other papers hold the same files inside

    Raises TankcalError when the page cannot be set (a character that no font has, a broken SVG),
    or a file to be attached is not the one that it was.
    """
    shown = [block for block in blocks if block["kind"] not in WEB_ONLY]
    blocks = [prepared(_with_formulas(block)) for block in shown]
    attached = attachments.contents(blocks, folder)
    files, blocks = _pictures_as_files(blocks)
    files["main.typ"] = (shipped_folder("report_templates") / "page.typ").read_bytes()
    files["blocks.json"] = _spell_controls(json.dumps(blocks, ensure_ascii=False)).encode("utf-8")
    long = any("table" in block["kind"] and len(block["rows"]) > LONG for block in blocks)
    with _ALONE if long else nullcontext():
        made = _set(files, attached, _timestamp(blocks[0]["date"]), packed)
        if long and not again:
            _forget()
    field = next((block["field"] for block in blocks if block.get("field")), None)
    return with_signature_field(made, field) if field else made


def _spell_controls(text):
    """JSON in which control characters, which no font has, are spelt out as the text `\\x00`."""
    return _CONTROL_IN_JSON.sub(_spell_control, text)


def _spell_control(match):
    if match[1]:
        return match[0]
    return json.dumps(printable(json.loads(f'"{match[0]}"')))[1:-1]


def _set(files, attached, timestamp, packed):
    """Set the page with the digests of the attached files, which then come into their place.

    Where they find no place, for the typesetter wrote a PDF of another form, it holds them itself.
    """
    if not attached:
        return _compile(files, timestamp)
    digests = {f"attached-{name}": digest.encode() for name, (digest, _) in attached.items()}
    made = _compile(files | digests, timestamp)
    held = attachments.hold(made, dict(attached.values()), packed or attachments.Packed())
    if held is None:
        whole = {f"attached-{name}": content for name, (_, content) in attached.items()}
        held = _compile(files | whole, timestamp)
    return held


def _compile(files, timestamp):
    """Set the page, in a process of its own where the system limits the memory.

    A typesetter that gets no more memory ends its process.
    """
    return_freed_memory()  # of which nothing would serve the typesetter
    with TemporaryDirectory(prefix="tankcal-page-") as folder:
        _copy_fonts(folder)
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        if not _is_memory_limited():
            return _compile_in(folder, timestamp)
        command = [sys.executable, "-c", IN_A_PROCESS, folder, str(timestamp)]
        subprocess.run(command, capture_output=True, check=False)
        made, refused = Path(folder, "made.pdf"), Path(folder, "refused.txt")
        if made.is_file():
            return made.read_bytes()
        if refused.is_file():
            raise TankcalError(refused.read_text(encoding="utf-8"))
        raise MemoryError


def _is_memory_limited():
    """Whether the system gives this process no more than so much memory."""
    if find_spec("resource") is None:  # Windows
        return False
    import resource

    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


def _compile_in(folder, timestamp):
    """The PDF of main.typ in a folder; fonts of the machine serve only letters that ours lack.

    Where tables and figures find no places that they all agree to, the figures no longer ask for
    theirs, and where that is not enough no block does. Raises TankcalError.
    """
    import typst

    def compiled(ignore_system_fonts, places=PLACES):
        found, warnings = typst.compile_with_warnings(
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
        return found

    try:
        try:
            return compiled(ignore_system_fonts=True)
        except typst.TypstError as error:
            if "could not be displayed" not in error.message:
                raise
            return compiled(ignore_system_fonts=False)
    except typst.TypstError as error:
        raise TankcalError(f"the PDF cannot be set: {error.message}") from error


def _forget():
    """Let the typesetter throw away what it has kept: of a long table a gigabyte."""
    import typst

    for _ in range(FORGETTING):
        typst.compile(b"", ignore_system_fonts=True)


def _copy_fonts(folder):
    """The fonts of the figures, from matplotlib; not its font of boxes for unknown signs.

    It need not be loaded for them, which takes as long as setting several pages.
    """
    (package,) = find_spec("matplotlib").submodule_search_locations
    fonts = Path(package) / "mpl-data" / "fonts" / "ttf"
    for pattern in FONT_FILES:
        for path in fonts.glob(pattern):
            shutil.copyfile(path, Path(folder) / path.name)


def _with_formulas(block):
    """A table with the nodes of each text in its columns of formulas: {column: {text: nodes}}.

    They are made here from the text, so that no typst code is ever taken from a notebook.
    """
    if block["kind"] != "table":
        return block
    columns = block.get("formulas", ())
    nodes = {i: {row[i]: formula_nodes(row[i]) for row in block["rows"]} for i in columns}
    return block | {"formulas": nodes}


def _pictures_as_files(blocks):
    """Pictures go into files of their own; a block then names its file."""
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
    """The letterhead with the names of the files of logo and mark, which are added to `files`."""
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
    """Seconds of the ISO date's midnight, UTC; of 1970 when there is no date."""
    if not date:
        return 0
    try:
        return int(datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp())
    except ValueError:
        raise TankcalError(f"the date of the document is {date!r}, not YYYY-MM-DD") from None
