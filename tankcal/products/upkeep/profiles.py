"""Profiles of logs: columns, units and times of a file, as declared in TOML."""

from dataclasses import dataclass, field
from pathlib import Path

from tankcal.job.entries import read_section
from tankcal.job.fields import Field, choice, number
from tankcal.job.folder import MAX_SETTINGS_BYTES, read_toml
from tankcal.job.tables import Log, nearest, read_bytes
from tankcal.messages import message
from tankcal.products.exports.profiles import LEVEL_UNITS_M, VOLUMES_M3
from tankcal.text.shipped import shipped_folder

LENGTHS_M = {name: float(LEVEL_UNITS_M[name]) for name in ("m", "cm", "mm", "ft", "in")}
LITRES_M3 = {name: float(size) for name, size in VOLUMES_M3.items()}
FORMATS = ("csv", "tls-inventory", "tls-delivery")
QUANTITIES = {  # column: quantity that decides its unit
    "time": None, "begin": "time", "end": "time", "level": "length", "water": "length",
    "volume": "volume", "total": "volume", "temperature": "temperature",
    "start_volume": "volume", "end_volume": "volume", "offset": "number", "value": "number",
    "tank": None, "meter": None, "ticket": None, "kind": None, "quality": None, "tag": None,
}  # fmt: skip
KINDS = {  # log: needed columns, of each group any
    "levels": (("time",), ("level", "tag")),
    "meters": (("time",), ("total", "volume")),
    "deliveries": (("time",), ("volume", "start_volume")),
    "events": (("time",), ("kind",)),
    "air": (("time",), ("temperature",)),
}
FIELDS = {
    "profile": (
        Field("source", "text", "where the format was read"),
        choice("format", "of the file", FORMATS),
    ),
    "columns": tuple(Field(name, "text", "heading") for name in QUANTITIES),
    "units": (
        choice("length", "of levels", tuple(LENGTHS_M)),
        choice("volume", "of volumes", tuple(LITRES_M3)),
        choice("temperature", "of temperatures", ("c", "f")),
    ),
    "file": (
        choice("separator", "between the columns", (",", ";", "\t", "|")),
        choice("decimal", "mark of decimals", (".", ",")),
        Field("time_format", "text", "as for strftime; blank: ISO 8601"),
        Field("encoding", "text", "of the text"),
        Field("headings", "names", "headings in order, of a file without a heading"),
        number("skip_rows", "rows above the heading", 0, 1000),
        Field("missing", "names", "words in place of a number"),
        Field("good", "names", "words of the column quality for valid readings"),
    ),
    "tags": tuple(Field(name, "text", "tag") for name in ("level", "temperature", "water")),
    "only": (Field("tank", "text", "value of the column tank"),),
}
_FOLDER = "products/upkeep/shipped_profiles"


@dataclass(frozen=True)
class LogProfile:
    """Description of the files of a log.

    Attributes
    ----------
    format : str
        A value of FORMATS.
    columns : dict
        {key of QUANTITIES: heading}.
    units : dict
        {"length", "volume" or "temperature": unit}.
    file : dict
        Keys of the section [file], without blanks.
    tags : dict
        {"level", "temperature" or "water": tag} of a file with a tag in each row.
    only : dict
        {"tank": text} of the rows to be read.
    """

    format: str
    columns: dict
    units: dict
    file: dict = field(default_factory=dict)
    tags: dict = field(default_factory=dict)
    only: dict = field(default_factory=dict)

    def to_si(self, column, values):
        """Values of a column in m, m3 or degC."""
        quantity = QUANTITIES[column]
        if quantity == "length":
            return values * LENGTHS_M[self.units["length"]]
        if quantity == "volume":
            return values * LITRES_M3[self.units["volume"]]
        if quantity == "temperature" and self.units.get("temperature") == "f":
            return (values - 32) / 1.8
        return values


def list_profiles():
    """Shipped profiles, {name: path}."""
    return {path.stem: path for path in sorted(Path(str(shipped_folder(_FOLDER))).glob("*.toml"))}


def read_log_profile(name, kind, folder, log):
    """Read a profile.

    Parameters
    ----------
    name : str or None
        Name of a shipped profile, or of a TOML file in the folder; None: the profile "plain".
    kind : str
        A key of KINDS.
    folder : Path
    log : Log

    Returns
    -------
    LogProfile or None
        None after a problem, which is in the log.
    """
    name = name or "plain"
    shipped = list_profiles()
    path = folder / name if name.endswith(".toml") else shipped.get(name)
    if path is None:
        text = message("upkeep_no_profile", "no profile {name}; expected a TOML file, or a name of "
                       "{names}{guess}", name=name, names=", ".join(sorted(shipped)),
                       guess=nearest(name, shipped))  # fmt: skip
        return log.problem("upkeep.toml", text, None, f"{kind}.profile")
    problems_here = Log()
    data = read_bytes(path, problems_here, MAX_SETTINGS_BYTES)
    content, rows = ({}, {}) if data is None else read_toml(path.name, data, problems_here)
    values = {
        section: {
            key: value
            for key, value in read_section(
                path.name,
                section,
                fields,
                content.get(section, {}),
                rows.get(section),
                problems_here,
            ).items()
            if value is not None
        }
        for section, fields in FIELDS.items()
    }
    profile = LogProfile(
        values["profile"].get("format", "csv"), values["columns"],
        {"temperature": "c"} | values["units"], values["file"], values["tags"], values["only"],
    )  # fmt: skip
    if profile.format == "csv" and not problems_here.problems:
        _check_columns(path.name, profile, kind, name == "plain", problems_here)
    log.problems.extend(problems_here.problems)
    return None if problems_here.problems else profile


def _check_columns(file, profile, kind, is_plain, log):
    """Report missing columns and units of a profile."""
    for group in KINDS[kind]:
        if not is_plain and not any(column in profile.columns for column in group):
            text = message("upkeep_profile_column", "missing; expected the heading of this column "
                           "for {kind}", kind=kind)  # fmt: skip
            log.problem(file, text, None, f"columns.{group[0]}")
    for column in profile.columns:
        quantity = QUANTITIES[column]
        if quantity in ("length", "volume") and quantity not in profile.units:
            text = message("upkeep_profile_unit", "missing; expected the unit of column {column}",
                           column=column)  # fmt: skip
            log.problem(file, text, None, f"units.{quantity}")
