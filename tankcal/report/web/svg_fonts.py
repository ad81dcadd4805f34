"""Embedding of fonts in SVG images, since other fonts would change the width of labels."""

import base64
import io
import re
from functools import cache
from html import unescape
from pathlib import Path

_FAMILY = "STIXGeneral"  # font of tankcal.pipeline.plot_style, part of matplotlib
_TEXT = re.compile(r"<(?:text|tspan)\b[^>]*>([^<]*)")
_ROOT = re.compile(r"<svg\b[^>]*>")
_STYLES = {"": "STIXGeneral", "italic": "STIXGeneralItalic", "bold": "STIXGeneralBol"}


def with_fonts(svg):
    """Embed the letters of the font into an SVG; return SVGs with other fonts unchanged."""
    if _FAMILY not in svg:
        return svg
    letters = "".join(sorted(set(unescape("".join(_TEXT.findall(svg))))))
    used = [style for style in _STYLES if not style or re.search(rf"font[^;\"]*{style}", svg)]
    faces = "".join(_face(style, letters) for style in used)
    root = _ROOT.search(svg)
    return f"{svg[: root.end()]}<style>{faces}</style>{svg[root.end() :]}"


@cache
def _face(style, letters):
    """Return a CSS rule @font-face with the given letters in a style of the font."""
    from fontTools import subset  # a dependency of matplotlib
    from fontTools.ttLib import TTFont
    from matplotlib import get_data_path

    font = TTFont(Path(get_data_path()) / "fonts/ttf" / f"{_STYLES[style]}.ttf",
                  recalcTimestamp=False)  # fmt: skip
    options = subset.Options(notdef_outline=True, hinting=False, name_IDs=[])
    options.drop_tables += ["FFTM"]  # contains dates, which would change the bytes
    cut = subset.Subsetter(options)
    cut.populate(text=letters)
    cut.subset(font)
    stream = io.BytesIO()
    font.save(stream)
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    look = {"": "", "italic": "font-style:italic;", "bold": "font-weight:bold;"}[style]
    return f"@font-face{{font-family:{_FAMILY};{look}src:url(data:font/ttf;base64,{data})}}"
