"""Headings of a technician's own list: which column of a job each of them means.

The names of a column are its own, its headings in the forms of all languages, and usual ones of
survey software. A unit in a heading must be known; another unit has a factor.
"""

import re
import unicodedata
from dataclasses import dataclass
from fractions import Fraction

from tankcal.messages import message
from tankcal.text.languages import LANGUAGES
from tankcal.text.unit_endings import parted
from tankcal.text.word_files import load_words

USUAL = {  # by the name of a column without its unit
    "point": (
        *("point", "point name", "point id", "point number", "name", "id", "no", "number", "pt"),
        *("ponto", "nome", "nome do ponto", "numero", "punto", "nombre", "nombre del punto", "pto"),
    ),
    "x": ("x", "coord x", "coordenada x", "coordinate x", "e", "east", "easting", "este", "leste"),
    "y": ("y", "coord y", "coordenada y", "coordinate y", "n", "north", "northing", "norte"),
    "z": (
        *("z", "coord z", "coordenada z", "coordinate z", "h", "height", "elevation", "elev"),
        *("altitude", "cota", "altura", "elevacao", "elevacion", "altitud"),
    ),
    "course": ("course", "ring", "anel", "virola", "anillo"),
    "thickness": ("thickness", "plate thickness", "espessura", "espesor"),
    "height": ("height", "altura"),
    "reading": ("reading", "leitura", "lectura"),
}
STANDARD_DEVIATIONS = (
    *("s", "sd", "std", "std dev", "standard deviation", "sigma", "u", "uncertainty"),
    *("dp", "desvio", "desvio padrao", "incerteza"),
    *("desv", "desviacion", "desviacion estandar", "desviacion tipica", "incertidumbre"),
)
USUAL |= {f"s{axis}": tuple(f"{name} {axis}" for name in STANDARD_DEVIATIONS) for axis in "xyz"}
LENGTHS = {  # sizes in metres
    "m": Fraction(1),
    "dm": Fraction(1, 10),
    "cm": Fraction(1, 100),
    "mm": Fraction(1, 1000),
    "in": Fraction(254, 10000),
    "ft": Fraction(3048, 10000),
}
UNIT_NAMES = {
    "metres": "m", "meters": "m", "metros": "m", "mts": "m", "milimetros": "mm",
    "millimetres": "mm", "millimeters": "mm", "centimetros": "cm", "centimetres": "cm",
    "inches": "in", "pol": "in", "polegadas": "in", "pulg": "in", "pulgadas": "in",
    "feet": "ft", "pes": "ft", "pies": "ft",
    "deg": "°", "degrees": "°", "graus": "°", "grados": "°",
}  # fmt: skip
_BRACKETED = re.compile(r"(.*?)[\s,]*[(\[]([^()\[\]]*)[)\]]\s*")
_LAST_WORD = re.compile(r"(.*\S)[\s,]+(\S+)")
MOST_LETTERS = 80


@dataclass(frozen=True)
class Meaning:
    """A column that a heading means.

    factor  of its values; None: the unit of the heading cannot be converted
    unit    as the heading has it, "" without one
    """

    column: str
    factor: Fraction | None
    unit: str = ""


def meanings_of(headings, fields):
    """{heading: Meaning} of the headings that mean exactly one column, and alone mean it."""
    names = {field.name: _names_of(field) for field in fields}
    found = {}
    for heading in headings:
        if not isinstance(heading, str) or len(heading) > MOST_LETTERS:
            continue
        meant = [one for field in fields for one in _meaning(heading, field, names[field.name])]
        exact = [one for one in meant if one.factor == 1] or meant  # of columns in several units
        if len({one.column for one in exact}) == 1:
            found[heading] = exact[0]
    columns = [one.column for one in found.values()]
    return {heading: one for heading, one in found.items() if columns.count(one.column) == 1}


def stated_meaning(heading, field):
    """The Meaning of a heading that the user gives a column: its unit in brackets has a factor."""
    parts = _BRACKETED.fullmatch(heading)
    unit = _unit_of(parts[2]) if parts else ""
    own = parted(field.name)[1]
    if unit in LENGTHS and own in LENGTHS:
        return Meaning(field.name, LENGTHS[unit] / LENGTHS[own], unit)
    return Meaning(field.name, Fraction(1), unit)


def rename_headings(table, fields, log):
    """(headings, refused) of a Table, with the names of columns in place of foreign headings.

    What was read is one warning. Headings in another unit are refused here, one problem each.
    """
    known = {field.name for field in fields}
    foreign = [heading for heading in table.headings if heading not in known]
    free = [field for field in fields if field.name not in table.headings]
    meanings = meanings_of(foreign, free) if foreign else {}
    renamed = {heading: one.column for heading, one in meanings.items() if one.factor == 1}
    if renamed:
        text = message(
            "headings_read",
            "headings are read as {pairs}",
            pairs=[f"{heading} = {column}" for heading, column in renamed.items()],
        )
        log.warning(table.file, text, table.heading_row)
    for heading, one in meanings.items():
        if one.factor is None:
            text = message(
                "heading_in_unknown_unit",
                "is {column} in {unit}, a unit that is not converted; expected the unit of "
                "{column}",
                column=one.column,
                unit=one.unit,
            )
            log.problem(table.file, text, table.heading_row, heading)
        elif one.factor != 1:
            text = message(
                "heading_in_other_unit",
                "is {column} in {unit}; expected its own unit: tankcal import {file} --replace "
                "converts it",
                column=one.column,
                unit=one.unit,
                file=table.file,
            )
            log.problem(table.file, text, table.heading_row, heading)
    told = {heading for heading, one in meanings.items() if one.factor != 1}
    return tuple(renamed.get(heading, heading) for heading in table.headings), told


def _names_of(field):
    """Plain names of a column without its unit."""
    stem, _ = parted(field.name)
    labels = [load_words(one)["input"]["labels"].get(stem, stem) for one in LANGUAGES]
    return {_plain(one) for one in (stem, *labels, *USUAL.get(stem, ()))}


def _meaning(heading, field, names):
    """A list of the Meaning that a heading has as a column, or an empty list."""
    _, own = parted(field.name)
    if _plain(heading) in names:
        return [Meaning(field.name, Fraction(1))]
    for pattern in (_BRACKETED, _LAST_WORD):
        parts = pattern.fullmatch(heading.replace("_", " ").strip())
        if parts is None or _plain(parts[1]) not in names:
            continue
        unit = _unit_of(parts[2])
        if unit == _plain(own):
            return [Meaning(field.name, Fraction(1), unit)]
        if unit in LENGTHS and own in LENGTHS:
            return [Meaning(field.name, LENGTHS[unit] / LENGTHS[own], unit)]
        return [Meaning(field.name, None, parts[2].strip())] if pattern is _BRACKETED else []
    return []


def _unit_of(text):
    plain = _plain(text)
    return UNIT_NAMES.get(plain, plain)


def _plain(text):
    """Lower case, without accents and marks, one blank between words."""
    letters = unicodedata.normalize("NFKD", text.lower())
    letters = "".join(one for one in letters if not unicodedata.combining(one))
    return " ".join(re.split(r"[\s_.:#]+", letters)).strip()
