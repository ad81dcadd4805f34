"""Checks of a logo: a self-contained picture without programs and without external links."""

import io
import re
import struct
from xml.etree import ElementTree

MAX_LOGO_BYTES = 500_000  # largest size of the file
MAX_LOGO_PIXELS = 4000  # pixels along a side
MAX_DRAWN = 100_000  # elements of an SVG after the expansion of its references
_SVG = "{http://www.w3.org/2000/svg}"
_PNG = b"\x89PNG\r\n\x1a\n"  # first bytes of a PNG file
_ACTIVE = {  # SVG elements with programs, animation or foreign content
    "script", "foreignObject", "set", "animate", "animateMotion", "animateTransform", "handler",
    "iframe", "embed", "object", "audio", "video", "discard",
}  # fmt: skip
_EMBEDDED = re.compile(r"data:image/(png|jpeg);base64,[A-Za-z0-9+/=\s]*")
_URL = re.compile(r"url\s*\(\s*[\"']?\s*(.)", re.IGNORECASE)
_REFERENCE = re.compile(r"url\s*\(\s*[\"']?\s*#([^\"')\s]+)", re.IGNORECASE)


def logo_problem(kind, data):
    """Return the reason why the bytes of an "svg" or "png" file are no valid logo, or None."""
    if len(data) > MAX_LOGO_BYTES:
        return f"has {len(data) / 1000:.0f} kB; expected at most {MAX_LOGO_BYTES / 1000:.0f} kB"
    return svg_problem(data) if kind == "svg" else png_problem(data)


def svg_problem(data):
    """Return the reason why the bytes of an SVG are no valid logo, or None."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return "is no UTF-8 text; expected an SVG"
    for mark in ("<!DOCTYPE", "<!ENTITY", "<?xml-stylesheet"):
        if mark.lower() in text.lower():
            return f"has {mark}; expected a plain SVG, without it"
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        return f"cannot be read as an SVG ({error})"
    if root.tag != f"{_SVG}svg":
        return "expected an SVG: <svg> of the SVG namespace outermost"
    if "viewBox" not in root.attrib and not {"width", "height"} <= set(root.attrib):
        return "has no size; expected a viewBox, or width and height"
    problems = (problem for element in root.iter() if (problem := _element_problem(element)))
    return next(problems, None) or _expansion_problem(root)


def _element_problem(element):
    name = _local(element.tag)
    if name in _ACTIVE:
        return f"has <{name}>; expected a picture without programs or animation"
    for key, value in element.attrib.items():
        key = _local(key)
        if key.lower().startswith("on"):
            return f"has {key}=; expected a picture without programs"
        is_link = key in ("href", "src")
        if is_link and not (value.strip().startswith("#") or _EMBEDDED.fullmatch(value.strip())):
            return f"links to {value[:60]!r}; expected everything inside the file"
        if not is_link and _leads_out(value):
            return f"{key}= leads out of the file: {value[:60]!r}"
    if name == "style" and _leads_out(element.text or ""):
        return "its <style> leads out of the file; expected everything inside"
    return None


def _leads_out(text):
    """Return whether a style or value may refer to another file; escapes could hide this."""
    if any(start != "#" for start in _URL.findall(text)):
        return True
    return "@import" in text.lower() or ("\\" in text and "(" in text)


def _local(name):
    return name.rpartition("}")[2]


def _expansion_problem(root):
    """Return a problem if references are circular or expand to too many elements."""
    by_id = {part.attrib["id"]: part for part in root.iter() if "id" in part.attrib}
    sizes, open_ = {}, set()

    def size(element):
        # An element that is still being counted refers to itself.
        """Return the number of drawn elements, limited to MAX_DRAWN + 1."""
        if element in open_:
            return MAX_DRAWN + 1
        if element not in sizes:
            open_.add(element)
            inside = [*element, *(by_id[name] for name in _references(element) if name in by_id)]
            sizes[element] = 1 + sum(min(size(part), MAX_DRAWN + 1) for part in inside)
            open_.discard(element)
        return sizes[element]

    try:
        too_large = size(root) > MAX_DRAWN
    except RecursionError:
        too_large = True
    return f"draws more than {MAX_DRAWN} parts, or itself" if too_large else None


def _references(element):
    for key, value in element.attrib.items():
        if _local(key) == "href" and value.strip().startswith("#"):
            yield value.strip()[1:]
        yield from _REFERENCE.findall(value)


def png_problem(data):
    """Return the reason why the bytes of a PNG are no valid logo, or None."""
    if not data.startswith(_PNG) or data[12:16] != b"IHDR" or len(data) < 24:
        return "is no PNG file"
    size = struct.unpack(">II", data[16:24])
    if not all(1 <= side <= MAX_LOGO_PIXELS for side in size):
        wide, high = size
        return f"has {wide} x {high} pixels; expected at most {MAX_LOGO_PIXELS} along a side"
    from matplotlib.image import imread

    try:
        imread(io.BytesIO(data), format="png")
    except Exception as error:  # a broken image can raise any exception
        return f"cannot be read as a PNG ({error})"
    return None
