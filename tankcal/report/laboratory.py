"""The laboratory: letterhead of its documents, and the scope of its accreditation.

Letterhead of the laboratory: name, address, logo and colours, from a TOML file.

The file is checked when it is read. The papers take the letterhead from the document block of the
executed notebook. A logo must be a self-contained picture without programs or external links.

Scope of a laboratory's accreditation: its calibration and measurement capabilities (CMC).

A letterhead may state the CMC by kind and capacity of the tank. An accredited certificate states no
smaller uncertainty than the CMC, and a calibration outside the scope bears no accreditation mark.
Source: ILAC-P14:09/2020, section 5, as summarised in a public guidance page; the text itself was
not read.
"""

import base64
import io
import json
import re
import struct
from dataclasses import asdict, dataclass
from pathlib import Path
from xml.etree import ElementTree

from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.entries import read_section
from tankcal.job.fields import KINDS, Field, number, positive
from tankcal.job.folder import MAX_SETTINGS_BYTES, read_toml
from tankcal.job.tables import Log, nearest, read_bytes
from tankcal.messages import message
from tankcal.report.uncertainty.stated import stated_U_m3
from tankcal.text.delimited import read_json

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
LETTERHEAD_FILE = "letterhead.json"  # saved beside a notebook whose papers have a letterhead
PLACE = "place"  # value of a mark that is an empty frame
LEAST_CONTRAST = 4.5  # smallest contrast of text with white paper: WCAG 2.2, 1.4.3
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_LABORATORY = (
    Field("name", "text", "name of the laboratory", required=True),
    Field("address", "names", "lines of its address, and whatever stands below it"),
    Field("logo", "text", "file of the logo beside this one, .svg or .png"),
    Field("logo_text", "text", "what the logo shows, for who cannot see it"),
    Field("accreditation_mark", "text", "file of the accreditation mark beside this one"),
    Field("accreditation_text", "text", "what the mark shows, for who cannot see it"),
    Field("accreditation_place", "flag", "true: an empty frame where the mark is to be put"),
)
_COLOURS = (
    Field("ink", "text", "of titles, headings and thick rules, such as #1a2b3c", start="#1a2b3c"),
    Field("line", "text", "of thin rules, such as #9aa5b1", start="#9aa5b1"),
)
_SECTIONS = {"laboratory": _LABORATORY, "colours": _COLOURS}
CMC = "cmc"  # sections [cmc.NAME]
_CAPABILITY = (
    Field("tanks", "names", "kinds of tank of this entry of the scope", required=True),
    number("from_m3", "smallest capacity of this entry, m3; blank: 0", 0, 1e9),
    number("to_m3", "largest capacity of this entry, m3; blank: no limit", 0, 1e9),
    positive(
        "percent",
        "smallest expanded uncertainty of a capacity in the scope, percent of the capacity",
        100,
        required=True,
    ),
)


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


@dataclass(frozen=True)
class Logo:
    """A checked logo: kind "svg" or "png", content (text or base64), alternative text."""

    kind: str
    content: str
    alt: str


@dataclass(frozen=True)
class Capability:
    """Calibration and measurement capability (CMC) of a laboratory for some tanks.

    Attributes
    ----------
    name : str
    tanks : tuple of str
        Kinds of tank.
    from_m3, to_m3 : float or None
        Range of the capacities; None: no limit.
    percent : float
        Smallest expanded uncertainty of a capacity, percent of the capacity.
    """

    name: str
    tanks: tuple[str, ...]
    from_m3: float | None
    to_m3: float | None
    percent: float


@dataclass(frozen=True)
class Letterhead:
    """Letterhead of a laboratory.

    Attributes
    ----------
    name : str
        Name of the laboratory.
    address : tuple of str
        Lines of the address.
    logo : Logo or None
    colours : dict
        Colours "ink" and "line" as #rrggbb.
    mark : Logo, PLACE or None
        Accreditation mark of the certificate; PLACE: an empty frame.
    cmc : tuple of Capability
        Scope of the accreditation; (): not stated.
    """

    name: str
    address: tuple[str, ...]
    logo: Logo | None
    colours: dict
    mark: Logo | str | None = None
    cmc: tuple[Capability, ...] = ()

    def data(self):
        """Return the letterhead as a dict for a document block."""
        data = asdict(self) | {"address": list(self.address)}
        cmc = [capability | {"tanks": list(capability["tanks"])} for capability in data.pop(CMC)]
        return data | ({CMC: cmc} if cmc else {})

    def save(self, directory):
        """Write the letterhead into the folder of the notebook and return the file name."""
        text = json.dumps(self.data(), ensure_ascii=False, indent=1)
        (Path(directory) / LETTERHEAD_FILE).write_text(text + "\n", encoding="utf-8")
        return LETTERHEAD_FILE


def load(path):
    """Read the Letterhead of a TOML file; raise InputError that lists all problems."""
    path, log = Path(path), Log()
    data = read_bytes(path, log, MAX_SETTINGS_BYTES)
    letterhead = None if data is None else _parse(path, data, log)
    log.stop_if_problems()
    return letterhead


def _parse(path, data, log):
    """Return the Letterhead of TOML bytes, or None; problems go to the log."""
    settings, rows = read_toml(path.name, data, log)
    if settings is None:
        return None
    for section in settings:
        # Sections above a section, such as "" and "cmc", are empty.
        is_known = section in _SECTIONS or section.startswith(f"{CMC}.")
        if not is_known and (settings[section] or section not in ("", CMC)):
            expected = message(
                "unknown_section_of_letterhead",
                "unknown section; expected [laboratory], [colours] or [cmc.NAME]{hint}",
                hint=nearest(section, _SECTIONS),
            )
            log.problem(path.name, expected, rows.get(section), f"[{section}]")
    sections = {
        name: read_section(path.name, name, fields, settings.get(name, {}), rows.get(name), log)
        for name, fields in _SECTIONS.items()
    }
    given_colours = settings.get("colours", {})
    colours = {
        field.name: _colour(path.name, field, sections["colours"], given_colours, log)
        for field in _COLOURS
    }
    laboratory = sections["laboratory"]
    given = settings.get("laboratory", {})
    logo, mark = (
        _read_logo(path, laboratory, given, log, key) for key in ("logo", "accreditation")
    )
    cmc = _capabilities(path.name, settings, rows, log)
    if log.problems:
        return None
    if mark is None and laboratory["accreditation_place"]:
        mark = PLACE
    return Letterhead(laboratory["name"], laboratory["address"] or (), logo, colours, mark, cmc)


def _capabilities(file, settings, rows, log):
    """Return the Capability of each section [cmc.NAME]; problems go to the log."""
    capabilities = []
    for section, given in settings.items():
        prefix, _, name = section.partition(".")
        if prefix != CMC or not name:
            continue
        values = read_section(file, section, _CAPABILITY, given, rows.get(section), log)
        for kind in values["tanks"] or ():
            if kind not in KINDS:
                expected = message(
                    "no_kind_of_cmc",
                    "found {kind!r}; expected {kinds}{hint}",
                    kind=kind,
                    kinds=", ".join(KINDS),
                    hint=nearest(kind, KINDS),
                )
                log.problem(file, expected, given["tanks"].row, f"{section}.tanks")
        capabilities.append(Capability(name, **values))
    return tuple(capabilities)


def _colour(file, field, values, given, log):
    """Return a checked colour in lower case; problems go to the log."""
    colour = values[field.name] or field.start
    problem = colour_problem(field.name, colour)
    if problem:
        log.problem(file, problem, given[field.name].row, f"colours.{field.name}")
    return colour.lower()


def colour_problem(name, colour):
    """Return a message if a colour is not #rrggbb, or is text too light for white paper."""
    if not isinstance(colour, str) or not _COLOUR.fullmatch(colour):
        return message(
            "no_colour", "found {colour!r}; expected a colour such as #1a2b3c", colour=colour
        )
    if name == "ink" and contrast_with_white(colour) < LEAST_CONTRAST:
        return message(
            "colour_too_light",
            "{colour} is too light for text: its contrast with white paper is {contrast:.1f}, "
            "expected at least {least}",
            colour=colour,
            contrast=contrast_with_white(colour),
            least=LEAST_CONTRAST,
        )
    return None


def contrast_with_white(colour):
    """Contrast ratio of a colour #rrggbb with white, 1 to 21 (WCAG 2.2, relative luminance)."""
    shares = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    # Gamma-corrected sRGB values become linear; their weighted sum is the luminance.
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    weights = (0.2126, 0.7152, 0.0722)
    return 1.05 / (sum(w * s for w, s in zip(weights, linear, strict=True)) + 0.05)


def _read_logo(path, laboratory, given, log, which):
    """Return the checked logo or accreditation mark of the laboratory, or None."""
    key = which if which == "logo" else f"{which}_mark"
    name = laboratory[key]
    if name is None:
        return None
    row = given[key].row
    kind = Path(name).suffix.lower().removeprefix(".")
    if kind not in ("svg", "png") or Path(name).name != name:
        expected = message(
            "no_logo_name",
            "found {name!r}; expected the name of an .svg or .png file beside this one",
            name=name,
        )
        log.problem(path.name, expected, row, f"laboratory.{key}")
        return None
    if not (path.parent / name).is_file():
        expected = message(
            "no_logo_file", "no file {name!r} beside this one; expected the logo", name=name
        )
        log.problem(path.name, expected, row, f"laboratory.{key}")
        return None
    data = read_bytes(path.parent / name, log)
    problem = None if data is None else logo_problem(kind, data)
    if problem:
        log.problem(name, problem)
    if data is None or problem:
        return None
    content = data.decode("utf-8-sig") if kind == "svg" else base64.b64encode(data).decode("ascii")
    return Logo(kind, content, laboratory[f"{which}_text"] or laboratory["name"])


def read_saved(path):
    """Read a letterhead written by `Letterhead.save` (dict); raise InputError if it is invalid."""
    name = Path(path).name
    try:
        data = read_json(path)
    except (OSError, ValueError) as error:
        raise InputError(
            Problem(
                name,
                message(
                    "letterhead_unreadable",
                    "cannot be read as a letterhead: {error}",
                    error=reason_of(error),
                ),
            )
        ) from error
    # Earlier versions wrote no mark.
    data = {"mark": None} | data if isinstance(data, dict) else data
    problem = data_problem(data)
    if problem:
        raise InputError(Problem(name, problem))
    return data


def data_problem(data):
    """Return a message about an invalid letterhead dict, or None if the dict is valid."""
    shape = {"name": str, "address": list, "logo": dict | None, "colours": dict}
    shape |= {"mark": dict | str | None} if isinstance(data, dict) and "mark" in data else {}
    shape |= {CMC: list} if isinstance(data, dict) and CMC in data else {}
    if not _has_shape(data, shape) or not all(isinstance(line, str) for line in data["address"]):
        return f"is no letterhead: expected {', '.join(shape)}"
    if set(data["colours"]) != {field.name for field in _COLOURS}:
        return f"expected the colours {', '.join(field.name for field in _COLOURS)}"
    problems = [colour_problem(*item) for item in data["colours"].items()]
    kinds = {"name": str, "tanks": list, "percent": int | float}
    kinds |= dict.fromkeys(("from_m3", "to_m3"), int | float | None)
    if not all(_has_shape(capability, kinds) for capability in data.get(CMC, ())):
        problems.append(f"expected {', '.join(kinds)} in each of its cmc")
    mark = data.get("mark")
    if isinstance(mark, str):
        problems.append(None if mark == PLACE else f"its mark is {mark!r}, expected {PLACE!r}")
    else:
        problems.append(_saved_logo_problem(mark))
    return next(filter(None, [*problems, _saved_logo_problem(data["logo"])]), None)


def _saved_logo_problem(logo):
    if logo is None:
        return None
    if not _has_shape(logo, dict.fromkeys(("kind", "content", "alt"), str)):
        return "its logo is none: expected kind, content, alt"
    if logo["kind"] == "svg":
        return logo_problem("svg", logo["content"].encode("utf-8"))
    try:
        return logo_problem("png", base64.b64decode(logo["content"], validate=True))
    except ValueError:
        return "its logo is no base64"


def _has_shape(data, shape):
    if not isinstance(data, dict) or set(data) != set(shape):
        return False
    return all(isinstance(data[key], kind) for key, kind in shape.items())


def find_capability(letterhead, record):
    """Return the CMC (dict) for the tank of a record, or None.

    If several entries of the scope apply, the smallest uncertainty counts.
    """
    tank, capacity = record["job"]["tank"], record["capacity"]
    if not letterhead or not tank or not capacity:
        return None
    top_m3 = capacity["volume_m3"][-1]
    applicable = [
        capability
        for capability in letterhead.get(CMC, ())
        if tank["kind"] in capability["tanks"]
        and (capability["from_m3"] or 0) <= top_m3
        and (capability["to_m3"] is None or top_m3 <= capability["to_m3"])
    ]
    return min(applicable, key=lambda capability: capability["percent"], default=None)


def is_outside_scope(letterhead, record):
    """Whether a letterhead states CMC, but none for the tank of a record."""
    return bool(letterhead and letterhead.get(CMC)) and find_capability(letterhead, record) is None


def letterhead_in_scope(letterhead, record):
    """Return the letterhead (dict), without the accreditation mark outside the scope."""
    return letterhead | {"mark": None} if is_outside_scope(letterhead, record) else letterhead


def refuse_below_capability(letterhead, record):
    """Raise InputError if U of the capacity is below the CMC of a `Letterhead`."""
    capability = find_capability(letterhead and letterhead.data(), record)
    if capability is None:
        return
    capacity = record["capacity"]
    percent = 100 * stated_U_m3(capacity)[-1] / capacity["volume_m3"][-1]
    if percent < capability["percent"]:
        text = message(
            "below_cmc",
            "U of the capacity is {percent:.2g} %, below the CMC of {cmc:g} %; expected the "
            "missing contributions in uncertainty.csv, or a letterhead without this CMC",
            percent=percent,
            cmc=capability["percent"],
        )
        raise InputError(Problem("--letterhead", text, None, f"{CMC}.{capability['name']}"))
