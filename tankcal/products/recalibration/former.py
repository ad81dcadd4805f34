"""A capacity table in SI units with its declared facts, from any laboratory or from tankcal.

The declared facts are former.toml and courses.csv, read with their checks.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from tankcal.job.checking import RELATIVE_DENSITY, missing_beside, refuse_repeated
from tankcal.job.contract.courses import COLUMNS, SMALLEST_THICKNESS_MM, no_courses
from tankcal.job.contract.fittings import KEYS as ROOF
from tankcal.job.contract.fittings import upside_down
from tankcal.job.entries import read_columns, read_section, unknown_section
from tankcal.job.fields import KINDS, Field, choice, is_blank, number, positive
from tankcal.job.folder import MAX_SETTINGS_BYTES, read_csv, read_toml
from tankcal.job.tables import read_bytes
from tankcal.messages import message
from tankcal.products.linter.units import FOOT3_M3, IMPERIAL_GALLON_M3, US_GALLON_M3
from tankcal.products.linter.volumes import NO_UNITS, Units
from tankcal.units import FOOT_M, INCH_M

HEIGHT_UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": INCH_M, "ft": FOOT_M}
VOLUME_UNITS = {
    "m3": 1.0,
    "hL": 0.1,
    "L": 0.001,
    "bbl": 0.158987294928,
    "gal": US_GALLON_M3,
    "US gal": US_GALLON_M3,
    "imp gal": IMPERIAL_GALLON_M3,
    "ft3": FOOT3_M3,
}

FORMER = (
    Field("file", "text", "name of the table's file, beside this one"),
    Field("sheet", "text", "sheet of a workbook; blank: that of the longest table"),
    Field("volume_column", "text", "heading of the column of volumes, where there are several"),
    choice("height_unit", "unit of heights whose heading names none", tuple(HEIGHT_UNITS)),
    choice("volume_unit", "unit of volumes whose heading names none", tuple(VOLUME_UNITS)),
    choice("kind", "kind of tank", KINDS),
    number("reference_temperature_c", "temperature of the shell that the table is for", -200, 300),
    number("liquid_density_kg_m3", "of the head in the table, kg/m3; 0: without head", 0, 3000),
    positive("U_m3", "expanded uncertainty of every volume, m3", 1e6),
    positive("U_percent", "expanded uncertainty in percent of each volume", 100),
    positive("u_m3", "standard uncertainty of every volume, m3", 1e6),
    positive("u_percent", "standard uncertainty in percent of each volume", 100),
    positive("k", "coverage factor of U", 100),
    number("common", "correlation of its errors with those of the new table", 0, 1),
    positive("rounding_m3", "value of the last digit of its volumes, m3", 1000),
    positive("reference_height_m", "from the dip plate to the reference point, metres", 200),
    number("dip_from_a_m", "of a lying tank: the dip point, along its cylinder from A", 0, 200),
    Field("date", "date", "day of the calibration, year-month-day"),
    Field("method", "text", "how the tank was measured"),
    Field("laboratory", "text", "who calibrated it"),
    Field("number", "text", "number of the certificate"),
)
SECTIONS = {"former": FORMER, "roof": ROOF}
UNCERTAINTIES = ("U_m3", "U_percent", "u_m3", "u_percent")
FIELDS = tuple(
    replace(field, required=False) if field.name == "height_m" else field for field in COLUMNS
)


@dataclass(frozen=True)
class FormerRoof:
    """Floating roof deducted in a table.

    Attributes
    ----------
    mass_kg : float
    density_kg_m3 : float
        Density of the liquid for which the displacement was computed.
    weighing : {"air", "vacuum"}
        How the mass was weighed.
    critical_m : (float, float) or None
        Dips between which the roof is partly afloat.
    """

    mass_kg: float
    density_kg_m3: float
    weighing: Literal["air", "vacuum"]
    critical_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class FormerTable:
    """An issued capacity table, heights rising.

    Attributes
    ----------
    name : str
        File (and sheet), for messages and reports.
    height_m, volume_m3 : (rows,) ndarray
        Dips (never ullages), strictly rising; volumes as printed.
    height_quantum_m, volume_quantum_m3 : float
        Value of the last printed digit; 0 if values are not rounded (a record, or heights with even
        steps, which are exact).
    U_m3 : (rows,) ndarray or None
        Expanded uncertainties; None if unknown.
    k : float
        Coverage factor.
    common : float or None
        Correlation of its errors with those of the table compared; None: not declared.
    reference_temperature_c : float or None
        Shell temperature of the table; None: unknown.
    liquid_density_kg_m3 : float or None
        Density of the head in the table; 0: no head; None: unknown.
    roof : FormerRoof or None
    reference_height_m : float or None
        From the dip plate to the reference point.
    date, method, laboratory, number : str or None
        As declared, or as in the record.
    kind : {"vertical", "horizontal", "sphere", "mesh"} or None
    dip_from_a_m : float or None
        Dip point of a lying tank, along the axis from the start of its cylinder; None: half the
        length.
    factor_m3 : (rows, inputs) ndarray or None
        For a record: covariance = factor factor'.
    record : dict or None
        The record from which the table was read, as plain data.
    height_rounding_m : (rows,) ndarray or None
        Largest rounding error of each height; 0 if the steps are even. None: heights are not
        rounded.
    row : (rows,) ndarray of int or None
        Row number of each row in the file.
    warnings : tuple of Problem
        Warnings of the linter and of reading.
    """

    name: str
    height_m: np.ndarray
    volume_m3: np.ndarray
    height_quantum_m: float = 0.0
    volume_quantum_m3: float = 0.0
    U_m3: np.ndarray | None = None
    k: float = 2.0
    common: float | None = None
    reference_temperature_c: float | None = None
    liquid_density_kg_m3: float | None = None
    roof: FormerRoof | None = None
    reference_height_m: float | None = None
    date: str | None = None
    method: str | None = None
    laboratory: str | None = None
    number: str | None = None
    kind: str | None = None
    dip_from_a_m: float | None = None
    factor_m3: np.ndarray | None = None
    record: dict | None = None
    height_rounding_m: np.ndarray | None = None
    row: np.ndarray | None = None
    warnings: tuple = ()


@dataclass(frozen=True)
class FormerFacts:
    """Content of a former.toml.

    Attributes
    ----------
    name : str
        Name of the file.
    values : dict
        {key of [former]: value or None}.
    rows : dict
        {key: row of the file}.
    roof : FormerRoof or None
    """

    name: str = "former.toml"
    values: dict = field(default_factory=lambda: dict.fromkeys(field.name for field in FORMER))
    rows: dict = field(default_factory=dict)
    roof: FormerRoof | None = None

    def __getitem__(self, key):
        return self.values[key]

    @property
    def units(self):
        """Units of columns whose headings name no unit."""
        height, volume = self["height_unit"], self["volume_unit"]
        if height is None and volume is None:
            return NO_UNITS
        return Units(HEIGHT_UNITS.get(height), VOLUME_UNITS.get(volume))

    @property
    def uncertainty(self):
        """(key, value) of the declared uncertainty, or None."""
        stated = [key for key in UNCERTAINTIES if self[key] is not None]
        return (stated[0], self[stated[0]]) if stated else None

    def tell(self, log, key, expected):
        """Report a problem of one key."""
        log.problem(self.name, expected, self.rows.get(key), f"former.{key}")


def read_former_facts(path, log):
    """Return the `FormerFacts` of a former.toml (a Path); report its problems to `log`.

    Invalid keys count as not stated, so that the table is examined in the same run.
    """
    path = Path(path)
    data = read_bytes(path, log, MAX_SETTINGS_BYTES)
    settings, sections = (None, {}) if data is None else read_toml(path.name, data, log)
    if settings is None:
        return FormerFacts(path.name)
    for section in settings:
        if section not in SECTIONS:
            expected = unknown_section(section, SECTIONS)
            log.problem(path.name, expected, sections.get(section), f"[{section}]")
    entries = settings.get("former", {})
    if not any(not is_blank(value.raw) for value in entries.values()) and "former" not in settings:
        expected = message("former_no_section", "missing section; expected [former] with its keys")
        log.problem(path.name, expected, None, "[former]")
    values = read_section(path.name, "former", FORMER, entries, sections.get("former"), log)
    rows = {key: value.row for key, value in entries.items()}
    roof = _roof(path.name, settings.get("roof"), sections.get("roof"), log)
    declared = FormerFacts(path.name, values, rows, roof)
    _check(declared, log)
    return declared


def _check(declared, log):
    """Check that the uncertainty is stated once, with a factor for U, and check the density."""
    stated = [key for key in UNCERTAINTIES if declared[key] is not None]
    for key in stated[1:]:
        expected = message(
            "former_two_uncertainties",
            "given together with {other}; expected only one of {keys}",
            other=stated[0],
            keys=[*UNCERTAINTIES],
        )
        declared.tell(log, key, expected)
    if (
        stated
        and stated[0].startswith("U")
        and declared["k"] is None
        and not declared.rows.get("k")
    ):
        declared.tell(log, "k", missing_beside(stated[0]))
    density = declared["liquid_density_kg_m3"]
    if density is not None and 0 < density < RELATIVE_DENSITY:
        expected = message(
            "former_relative_density",
            "found {density:g}; expected kg/m3: is it a relative density?",
            density=density,
        )
        declared.tell(log, "liquid_density_kg_m3", expected)


def _roof(file, entries, row, log):
    """Return the FormerRoof of [roof]; None after reporting invalid or missing keys."""
    if entries is None:
        return None
    problems_before = len(log.problems)
    values = read_section(file, "roof", ROOF, entries, row, log)
    if all(value is None for value in values.values()) and len(log.problems) == problems_before:
        return None
    needed = ("mass_kg", "reference_density_kg_m3", "weighing")
    filled = [key for key in entries if not is_blank(entries[key].raw)]

    def tell(key, expected):
        value = entries.get(key)
        log.problem(file, expected, value.row if value and value.row else row, f"roof.{key}")

    for key in needed:
        if key not in filled:
            tell(key, missing_beside(filled[0] if filled else "[roof]"))
    low, high = values["critical_bottom_m"], values["critical_top_m"]
    for key, other in (("critical_bottom_m", high), ("critical_top_m", low)):
        if key not in filled and other is not None:
            tell(key, missing_beside("critical_top_m" if other is high else "critical_bottom_m"))
    if None not in (low, high) and low >= high:
        tell("critical_top_m", upside_down(low, high))
    if len(log.problems) != problems_before:
        return None
    return FormerRoof(
        values["mass_kg"],
        values["reference_density_kg_m3"],
        values["weighing"],
        None if low is None or high is None else (low, high),
    )


# ---- courses.csv


@dataclass(frozen=True)
class Courses:
    """The rings of a tank, from the bottom up.

    Attributes
    ----------
    file : str
    names : tuple of str
    heights_m : ndarray, shape (n,)
        nan if unknown.
    thickness_m : ndarray, shape (n,)
    """

    file: str
    names: tuple[str, ...]
    heights_m: np.ndarray
    thickness_m: np.ndarray

    def first(self, count):
        """Return the lowest `count` courses."""
        return replace(
            self,
            names=self.names[:count],
            heights_m=self.heights_m[:count],
            thickness_m=self.thickness_m[:count],
        )


def read_courses(path, log):
    """Return the `Courses` of a CSV file; None after reporting its problems to `log`."""
    path = Path(path)
    if not path.exists():
        log.problem(path.name, message("read_no_file", "not found; expected a file of courses"))
        return None
    data = read_bytes(path, log)
    if data is None:
        return None
    separator, decimal = (";", ",") if b";" in data[:2000] else (",", ".")
    table = read_csv(path.name, data, separator, decimal, log)
    if table is None:
        return None
    before = len(log.problems)
    values = read_columns("courses", table, log, FIELDS)
    if len(log.problems) > before or values.skipped:
        return None
    if values.is_empty:
        log.problem(path.name, no_courses())
        return None
    refuse_repeated(values, "course", log)
    plates = values.of("thickness_mm")
    for row, plate in zip(values.rows, plates, strict=True):
        if plate < SMALLEST_THICKNESS_MM:
            expected = message(
                "thin_course",
                "found {thickness:g}; expected millimetres, at least 1: is it in metres?",
                thickness=plate,
            )
            log.problem(path.name, expected, row, "thickness_mm")
    if len(log.problems) > before:
        return None
    heights = [np.nan if height is None else height for height in values.of("height_m")]
    return Courses(
        path.name, tuple(values.of("course")), np.array(heights), np.array(plates) / 1000
    )
