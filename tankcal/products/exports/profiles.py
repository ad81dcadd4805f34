"""Profiles of gauging and inventory systems: descriptions of their files (TOML).

`[profile]` states the system and the source, `[table]` the rows and columns, `[levels]` and
`[volumes]` their format, `[file]` separators and headers. docs/exports.md lists every key.
"""

import string
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.entries import read_section
from tankcal.job.fields import Field, choice, number
from tankcal.job.folder import MAX_SETTINGS_BYTES, read_toml
from tankcal.job.tables import Log, nearest, read_bytes, shown
from tankcal.messages import message
from tankcal.tank.dips import METRES_PER_INCH, VOLUME_UNITS_M3
from tankcal.text.shipped import shipped_folder

_PARTS_OF_INCH = {"in": 1, "1/2 in": 2, "1/4 in": 4, "1/8 in": 8, "1/16 in": 16}
INCREMENTS_M = {
    "m": Fraction(1),
    "dm": Fraction(1, 10),
    "cm": Fraction(1, 100),
    "mm": Fraction(1, 1000),
    "1/100 m": Fraction(1, 100),
    "ft": 12 * METRES_PER_INCH,
    **{name: METRES_PER_INCH / part for name, part in _PARTS_OF_INCH.items()},
}
MARKED = {"ft-in-8": METRES_PER_INCH / 8, "ft-in-16": METRES_PER_INCH / 16}  # 3' 4 5/8"
LEVEL_UNITS_M = {name: INCREMENTS_M[name] for name in ("m", "cm", "mm", "ft", "in")} | MARKED
VOLUMES_M3 = VOLUME_UNITS_M3 | {
    "hL": Fraction(1, 10),
    "gal": 231 * METRES_PER_INCH**3,
    "ft3": (12 * METRES_PER_INCH) ** 3,
}
LEVEL_COLUMNS = ("dip", "ullage", "increments")
VOLUME_COLUMNS = ("volume", "increment_volume")
LINE_ENDS = {"lf": "\n", "crlf": "\r\n"}
PLACEHOLDERS = ("tank", "number", "level_unit", "volume_unit", "date", "points")
MOST_POINTS, MOST_LINES, MOST_LETTERS = 100_000, 40, 300  # letters of a line

FIELDS = {
    "profile": (
        Field("name", "text", "name of the system", required=True),
        Field("source", "text", "where this was read", required=True),
        Field("verified", "flag", "whether it was read in the system's own text"),
        Field("remark", "text", "anything that is to stand beside it"),
    ),
    "table": (
        choice("grid", "which rows", ("every row", "step", "fractions", "breakpoints"),
               required=True),
        number("step_m", "from row to row, where grid is step", 0, 100, above_low=True),
        number("parts", "equal parts of the highest dip, where grid is fractions", 2, MOST_POINTS),
        number("min_points", "fewest rows that the system takes", 1, MOST_POINTS),
        number("max_points", "most rows that the system takes", 1, MOST_POINTS),
        choice("interpolation", "how the system reads between rows", ("linear", "spline")),
        choice("order", "of the rows by level", ("ascending", "descending")),
        choice("zero_row", "whether dip 0 has a row", ("free", "required", "forbidden")),
        number("level_offset_m", "what the system adds to every level", -1000, 1000),
        number("volume_offset_m3", "what the system adds to every volume", -1e6, 1e6),
    ),
    "levels": (
        choice("unit", "unit of dips and ullages", tuple(LEVEL_UNITS_M)),
        number("decimals", "decimals of dips and ullages", 0, 6),
        choice("increment", "what the column increments counts", tuple(INCREMENTS_M)),
    ),
    "volumes": (
        choice("unit", "unit of volumes", tuple(VOLUMES_M3), required=True),
        number("decimals", "decimals of volumes", 0, 6, required=True),
        number("digits", "most digits of a volume, decimals too", 1, 15),
        number("largest", "largest volume that the system takes, in its unit", 0, above_low=True),
    ),
    "file": (
        choice("separator", "between the columns", (",", ";", "\t", " ", "|")),
        choice("decimal", "mark of decimals", (".", ",")),
        choice("thousands", "mark between thousands", ("", ",", ".", " ", "'")),
        choice("line_end", "of every line", tuple(LINE_ENDS)),
        choice("encoding", "of the text", ("utf-8", "utf-8-sig", "cp1252", "ascii")),
        choice("ending", "of the file's name", (".csv", ".txt", ".tab", ".dat", ".prn")),
        Field("comment", "text", "what a line of provenance begins with"),
        Field("provenance", "flag", "whether lines of provenance stand above the rows"),
    ),
}  # fmt: skip
LISTS = {("table", "columns"): True, ("file", "headings"): False, ("file", "header"): False}
_FOLDER, _ENDING = "products/exports/shipped_profiles", ".toml"


@dataclass(frozen=True)
class Profile:
    """Description of a file for a system: the keys of its TOML file, with defaults.

    Attributes
    ----------
    code : str
        Name of the profile's file without its extension.
    step_m : float or None
        Step between rows, if grid is "step".
    parts : int or None
        Number of equal parts of the highest dip, if grid is "fractions".
    min_points, max_points : int or None
        None: no known limit.
    largest : float or None
        Largest volume, in the unit of volumes.
    """

    code: str
    name: str
    source: str
    columns: tuple[str, ...]
    grid: str
    volume_unit: str
    volume_decimals: int
    verified: bool = False
    remark: str = ""
    step_m: float | None = None
    parts: int | None = None
    min_points: int | None = None
    max_points: int | None = None
    interpolation: str = "linear"
    order: str = "ascending"
    zero_row: str = "free"
    level_offset_m: float = 0.0
    volume_offset_m3: float = 0.0
    level_unit: str = "m"
    level_decimals: int = 3
    increment: str | None = None
    digits: int | None = None
    largest: float | None = None
    separator: str = ","
    decimal: str = "."
    thousands: str = ""
    line_end: str = "lf"
    encoding: str = "utf-8"
    ending: str = ".csv"
    comment: str = "#"
    provenance: bool = True
    headings: tuple[str, ...] = ()
    header: tuple[str, ...] = ()

    @property
    def leading(self):
        """The leading column of levels: dip, ullage or increments."""
        return next(column for column in self.columns if column in LEVEL_COLUMNS)

    @property
    def level_quantum_m(self):
        """Value of the last digit of a level, m, as a Fraction."""
        if self.leading == "increments":
            return INCREMENTS_M[self.increment]
        if self.level_unit in MARKED:
            return MARKED[self.level_unit]
        return LEVEL_UNITS_M[self.level_unit] / 10**self.level_decimals

    @property
    def volume_quantum_m3(self):
        """Value of the last digit of a volume, m3, as a Fraction."""
        return VOLUMES_M3[self.volume_unit] / 10**self.volume_decimals


def shipped_profiles():
    """{name: Profile} of the profiles that ship with tankcal."""
    paths = sorted(shipped_folder(_FOLDER).glob(f"*{_ENDING}"))
    return {path.stem: _read(path) for path in paths}


def find_profile(name):
    """Return the Profile with a shipped name, or of a TOML file.

    Raises InputError with every problem of the file, or with the list of names.
    """
    shipped = shipped_folder(_FOLDER) / f"{name}{_ENDING}"
    if "/" not in name and "\\" not in name and shipped.is_file():
        return _read(shipped)
    if name.lower().endswith(_ENDING):
        return _read(Path(name))
    names = [path.stem for path in sorted(shipped_folder(_FOLDER).glob(f"*{_ENDING}"))]
    expected = message(
        "export_no_profile",
        "no profile {name!r}{hint}; expected a .toml file, or one of {names}",
        name=name[:60], hint=nearest(name, names), names=names,
    )  # fmt: skip
    raise InputError(Problem("--profile", expected))


def _read(path):
    log = Log()
    data = read_bytes(path, log, MAX_SETTINGS_BYTES)
    profile = None if data is None else parse_profile(path.name, data, log)
    log.stop_if_problems()
    return profile


def parse_profile(file, data, log):
    """Return the Profile in the bytes of a TOML file; None after reporting its problems."""
    problems_before = len(log.problems)
    settings, sections = read_toml(file, data, log)
    if settings is None:
        return None
    for section in [setting for setting in settings if setting not in FIELDS]:
        text = message(
            "export_section", "unknown section; expected one of {names}{hint}",
            names=list(FIELDS), hint=nearest(section, FIELDS),
        )  # fmt: skip
        log.problem(file, text, sections.get(section), f"[{section}]")
    values = {}
    for section, fields in FIELDS.items():
        stated, row = dict(settings.get(section, {})), sections.get(section)
        for (_, key), needed in (entry for entry in LISTS.items() if entry[0][0] == section):
            place = (file, f"{section}.{key}")
            values[section, key] = _list_of_texts(*place, stated.pop(key, None), row, needed, log)
        read = read_section(file, section, fields, stated, row, log)
        values |= {(section, key): value for key, value in read.items()}
    tell = _Reporter(file, settings, sections, log)
    _check_columns(values, tell)
    _check_table(values, tell)
    _check_marks(values, tell)
    return _profile(file, values) if len(log.problems) == problems_before else None


def _list_of_texts(file, name, value, row, needed, log):
    """Return a tuple of texts of a list; () without a list."""
    raw = None if value is None else value.raw
    if raw is None or raw == []:
        if needed:
            log.problem(file, message("export_no_list", "missing; expected a list of texts"),
                        row, name)  # fmt: skip
        return ()
    are_lines = isinstance(raw, list) and all(
        isinstance(text, str) and text.isprintable() and len(text) <= MOST_LETTERS for text in raw
    )
    if not are_lines or len(raw) > MOST_LINES:
        text = message(
            "export_texts", "found {found}; expected a list of at most {most} texts, each of one "
            "line", found=shown(raw), most=MOST_LINES,
        )  # fmt: skip
        log.problem(file, text, value.row or row, name)
        return ()
    return tuple(raw)


class _Reporter:
    """Reports problems of a key of the profile, with its row."""

    def __init__(self, file, settings, sections, log):
        self.file, self.settings, self.sections, self.log = file, settings, sections, log

    def __call__(self, section, key, text):
        value = self.settings.get(section, {}).get(key)
        row = self.sections.get(section) if value is None else value.row
        self.log.problem(self.file, text, row, f"{section}.{key}")


def _check_columns(values, tell):
    columns = values["table", "columns"]
    known = LEVEL_COLUMNS + VOLUME_COLUMNS
    for name in dict.fromkeys(columns):
        if name not in known:
            text = message(
                "export_column", "found {found}; expected one of {names}{hint}",
                found=shown(name), names=list(known), hint=nearest(name, known),
            )  # fmt: skip
            tell("table", "columns", text)
        elif columns.count(name) > 1:
            text = message("export_column_twice", "{name} is given twice", name=name)
            tell("table", "columns", text)
    if columns and set(columns) <= set(known):
        for needed in (LEVEL_COLUMNS, VOLUME_COLUMNS):
            if not set(needed) & set(columns):
                text = message("export_column_of", "has none of {names}; expected one of them",
                               names=list(needed))  # fmt: skip
                tell("table", "columns", text)
    headings = values["file", "headings"]
    if headings and len(headings) != len(columns):
        text = message(
            "export_headings", "{count} headings; expected {columns}, one for each column",
            count=len(headings), columns=len(columns),
        )  # fmt: skip
        tell("file", "headings", text)
    if "increments" in columns and values["levels", "increment"] is None:
        text = message("export_no_increment", "missing; expected it for the column increments")
        tell("levels", "increment", text)
    for line in values["file", "header"]:
        for name in _unknown_placeholders(line):
            text = message(
                "export_placeholder", "found {found} in braces; expected one of {names}",
                found=shown(name), names=list(PLACEHOLDERS),
            )  # fmt: skip
            tell("file", "header", text)


def _unknown_placeholders(line):
    """Unknown placeholders in braces; {} for unpaired braces."""
    try:
        parts = list(string.Formatter().parse(line))
    except ValueError:
        return [line]
    return [
        name for _, name, form, turned in parts
        if name is not None and (name not in PLACEHOLDERS or form or turned)
    ]  # fmt: skip


def _check_table(values, tell):
    step, grid = values["table", "step_m"], values["table", "grid"]
    if grid == "step" and step is None:
        text = message("export_no_step", "missing; expected it where grid is step")
        tell("table", "step_m", text)
    if grid != "step" and step is not None:
        tell("table", "step_m", message("export_step", "given where grid is not step; remove it"))
    if (grid == "fractions") != (values["table", "parts"] is not None):
        text = message("export_parts", "expected with grid = 'fractions', and only there")
        tell("table", "parts", text)
    wholes = (("table", "parts"), ("table", "min_points"), ("table", "max_points"),
              ("levels", "decimals"), ("volumes", "decimals"), ("volumes", "digits"))  # fmt: skip
    for section, key in wholes:
        value = values[section, key]
        if value is not None and value != int(value):
            text = message("export_whole", "found {value:g}; expected a whole number", value=value)
            tell(section, key, text)
    fewest, most = values["table", "min_points"], values["table", "max_points"]
    if fewest is not None and most is not None and fewest > most:
        text = message("export_points_cross", "{fewest:g}, above max_points {most:g}",
                       fewest=fewest, most=most)  # fmt: skip
        tell("table", "min_points", text)
    digits, decimals = values["volumes", "digits"], values["volumes", "decimals"]
    if digits is not None and decimals is not None and digits <= decimals:
        text = message(
            "export_digits_cross", "{digits:g} digits; expected more than the {decimals:g} "
            "decimals", digits=digits, decimals=decimals,
        )  # fmt: skip
        tell("volumes", "digits", text)
    if values["levels", "unit"] in MARKED and values["levels", "decimals"]:
        text = message("export_marks", "given for feet and inches in parts; remove it")
        tell("levels", "decimals", text)


def _check_marks(values, tell):
    separator = values["file", "separator"] or ","
    decimal = values["file", "decimal"] or "."
    thousands = values["file", "thousands"] or ""
    if separator == decimal:
        tell("file", "separator", message("export_mark_twice", "is the decimal mark, too; expected "
             "another"))  # fmt: skip
    if thousands and thousands in (separator, decimal):
        text = message("export_thousands", "is the separator or the decimal mark, too; expected "
                       "another")  # fmt: skip
        tell("file", "thousands", text)
    if separator == " " and values["levels", "unit"] in MARKED:
        text = message("export_spaces", "stands within feet and inches, too; expected another")
        tell("file", "separator", text)


def _profile(file, values):
    renamed = {
        (section, key): f"{section.removesuffix('s')}_{key}"
        for section in ("levels", "volumes")
        for key in ("unit", "decimals")
    }
    whole = {"min_points", "max_points", "level_decimals", "volume_decimals", "digits"}
    settings = {}
    for place, value in values.items():
        name = renamed.get(place, place[1])
        if value is not None:
            settings[name] = int(value) if name in whole else value
    for name in settings.keys() & {"name", "source", "remark"}:
        settings[name] = _MESSAGES.get(settings[name], settings[name])
    return Profile(code=file.removesuffix(_ENDING), **settings)


# ---- texts of the shipped profiles, for translation


_TEXTS = (
    message(
        "profile_typed",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display",
    ),
    message(
        "profile_typed_claim",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; its claim of 0.1 % does not hold for a lying tank",
    ),
    message(
        "profile_typed_linear",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; for Universal Linear, what Universal Curved does was not found",
    ),
    message(
        "profile_typed_offsets",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; copy the profile to set the offsets, and give --points",
    ),
    message(
        "profile_typed_limit",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; give --points, the limit was not found",
    ),
    message(
        "profile_typed_spline",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; give --points, the limit was not found. Taken as a natural cubic spline: the end "
        "condition was not found",
    ),
    message("profile_litres", "Unit of volumes is assumed to be the litre"),
    message("profile_layout", "Layout of the file is assumed"),
    message(
        "profile_layout_initial",
        "Layout of the file is assumed; the first row is the initial volume",
    ),
    message(
        "profile_units_assumed",
        "Units and marks are assumed; dV is the volume since the row before",
    ),
    message(
        "profile_columns_assumed",
        "The order of the columns and the headings are assumed: compare with an export of your "
        "system",
    ),
    message("profile_every_row", "Every row, decimal point, comma"),
    message(
        "profile_fractions",
        "Enter the highest dip as the diameter (function 607) and the volumes only (function 606): "
        "the console takes them at 5, 10, ... 100 % of the diameter",
    ),
    message("profile_any", "any program that reads CSV"),
    message("profile_russian", "a Russian level meter"),
    message("profile_aveva_centimetres", "AVEVA (increments of 1/100 m)"),
    message("profile_aveva_sixteenths", "AVEVA (increments of 1/16 in)"),
    message("profile_jde_increments", "Oracle JD Edwards (volume for each increment)"),
    message("profile_jde", "Oracle JD Edwards (height and volume)"),
    message("profile_siemens_spline", "Siemens LUT400, HydroRanger (cubic spline)"),
    message("profile_siemens_linear", "Siemens LUT400, HydroRanger (linear)"),
    message("profile_tls", "Veeder-Root TLS (20 points)"),
    message("profile_arts", "ARTS retail data model"),
    message("profile_own_choice", "own choice of tankcal"),
    message(
        "profile_tls_manual",
        "Serial Interface Manual 576013-635, revision U, functions 606 and 607",
    ),
)
_MESSAGES = {str(text): text for text in _TEXTS}
