"""Blocks as a PDF, by typst: the page style is page.typ, the blocks reach it as JSON data.

No text of a user is ever read as markup, for typst sees it only as strings of that data.
"""

import base64
import json
import shutil
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from tankcal.errors import TankcalError
from tankcal.shipped import shipped

STANDARDS = ["a-3a", "ua-1"]  # archival, and readable by a screen reader
FONT_FILES = ("STIXGeneral*.ttf", "DejaVuSerif*.ttf", "DejaVuSans.ttf")


def pdf(blocks):
    """The blocks as the bytes of a PDF; the same blocks give the same bytes.

    Raises TankcalError when the page cannot be set: a character that no font has, a broken SVG.
    """
    files, blocks = _pictures_as_files(blocks)
    files["main.typ"] = (shipped("report_templates") / "page.typ").read_bytes()
    files["blocks.json"] = json.dumps(blocks, ensure_ascii=False).encode("utf-8")
    return _compile(files, _timestamp(blocks[0]["date"]))


def _compile(files, timestamp):
    """Set the page; the machine's own fonts are asked only for signs that the shipped ones lack."""
    import typst

    def compiled(ignore_system_fonts):
        return typst.compile(
            files,
            font_paths=[folder],
            ignore_system_fonts=ignore_system_fonts,
            pdf_standards=STANDARDS,
            timestamp=timestamp,
        )

    with TemporaryDirectory(prefix="tankcal-fonts-") as folder:
        _copy_fonts(folder)
        try:
            try:
                return compiled(ignore_system_fonts=True)
            except typst.TypstError as error:
                if "could not be displayed" not in error.message:
                    raise
                return compiled(ignore_system_fonts=False)
        except typst.TypstError as error:
            raise TankcalError(f"the PDF cannot be set: {error.message}") from error


def _copy_fonts(folder):
    """The fonts of the figures, from matplotlib; not its font of boxes for unknown signs."""
    import matplotlib

    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    for pattern in FONT_FILES:
        for path in fonts.glob(pattern):
            shutil.copyfile(path, Path(folder) / path.name)


def _pictures_as_files(blocks):
    """Pictures go into files of their own; a block then names its file."""
    files, changed = {}, []
    for number, block in enumerate(blocks):
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


def _timestamp(date):
    """Seconds of the ISO date's midnight, UTC; of 1970 when there is no date."""
    if not date:
        return 0
    try:
        return int(datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp())
    except ValueError:
        raise TankcalError(f"the date of the document is {date!r}, not YYYY-MM-DD") from None
