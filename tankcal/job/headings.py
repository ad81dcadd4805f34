"""Recognition of the columns in a list of the user, by their headings.

The names of a column are its own name, its headings in the forms of all languages, and the usual
headings of survey software. A unit in a heading must be known; a different unit gives a factor.
"""

import re
import unicodedata
from dataclasses import dataclass
from fractions import Fraction

from tankcal.messages import message
from tankcal.text.naming import split_unit
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

USUAL = {  # usual headings, by the name of the column without its unit
    "point": (
        *("point", "point name", "point id", "point number", "name", "id", "no", "number", "pt"),
        *("ponto", "nome", "nome do ponto", "numero", "punto", "nombre", "nombre del punto", "pto"),
        *("no do ponto", "n° do ponto", "numero do ponto", "no de punto", "n° de punto", "n°"),
        *("numero de punto", "numero del punto", "vertex", "vertice", "n o", "pt id", "pt no"),
    ),
    "x": (
        *("x", "coord x", "coordenada x", "coordinate x", "e", "east", "easting", "este", "leste"),
        *("coord e", "coord este", "coordenada este", "coord leste", "coordenada leste"),
    ),
    "y": (
        *("y", "coord y", "coordenada y", "coordinate y", "n", "north", "northing", "norte"),
        *("coord n", "coord norte", "coordenada norte"),
    ),
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
LENGTHS = {  # metres of one unit
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
MOST_LETTERS = 80  # longest heading that is recognised


@dataclass(frozen=True)
class Meaning:
    """Column recognised in a heading.

    Attributes
    ----------
    column : str
        Name of the column.
    factor : Fraction or None
        Factor of its values; None: the unit of the heading cannot be converted.
    unit : str
        Unit in the heading; "" without a unit.
    """

    column: str
    factor: Fraction | None
    unit: str = ""


def meanings_of(headings, fields):
    """{heading: Meaning}; a heading and its column must match only each other."""
    labels = [load_words(name)["input"]["labels"] for name in LANGUAGES]
    names = {field.name: _names_of(field, labels) for field in fields}
    meanings = {}
    for heading in headings:
        if not isinstance(heading, str) or len(heading) > MOST_LETTERS:
            continue
        candidates = [
            meaning for field in fields for meaning in _meaning(heading, field, names[field.name])
        ]
        exact = [
            meaning for meaning in candidates if meaning.factor == 1
        ] or candidates  # a column may exist in several units
        if len({meaning.column for meaning in exact}) == 1:
            meanings[heading] = exact[0]
    columns = [meaning.column for meaning in meanings.values()]
    return {
        heading: meaning
        for heading, meaning in meanings.items()
        if columns.count(meaning.column) == 1
    }


def stated_meaning(heading, field):
    """`Meaning` of a heading assigned to a column by the user; a unit in brackets is converted."""
    parts = _BRACKETED.fullmatch(heading)
    unit = _unit_of(parts[2]) if parts else ""
    field_unit = split_unit(field.name)[1]
    if unit in LENGTHS and field_unit in LENGTHS:
        return Meaning(field.name, LENGTHS[unit] / LENGTHS[field_unit], unit)
    return Meaning(field.name, Fraction(1), unit)


def rename_headings(table, fields, log):
    """Replace foreign headings by the names of columns.

    The renamed headings are reported in one warning. A heading in another unit is a problem.

    Parameters
    ----------
    table : Table
        Table as read.
    fields : sequence of Field
        Columns of the table.
    log : Log
        Receives warning and problems.

    Returns
    -------
    headings : tuple of str
        Headings with the names of columns.
    refused : set of str
        Headings in another unit.
    """
    known = {field.name for field in fields}
    foreign = [heading for heading in table.headings if heading not in known]
    free = [field for field in fields if field.name not in table.headings]
    meanings = meanings_of(foreign, free) if foreign else {}
    renamed = {
        heading: meaning.column for heading, meaning in meanings.items() if meaning.factor == 1
    }
    if renamed:
        text = message(
            "headings_read",
            "headings are read as {pairs}",
            pairs=[f"{heading} = {column}" for heading, column in renamed.items()],
        )
        log.warning(table.file, text, table.heading_row)
    for heading, meaning in meanings.items():
        if meaning.factor is None:
            text = message(
                "heading_in_unknown_unit",
                "is {column} in {unit}, a unit that is not converted; expected the unit of "
                "{column}",
                column=meaning.column,
                unit=meaning.unit,
            )
            log.problem(table.file, text, table.heading_row, heading)
        elif meaning.factor != 1:
            text = message(
                "heading_in_other_unit",
                "is {column} in {unit}; expected its own unit: tankcal import {file} --replace "
                "converts it",
                column=meaning.column,
                unit=meaning.unit,
                file=table.file,
            )
            log.problem(table.file, text, table.heading_row, heading)
    refused = {heading for heading, meaning in meanings.items() if meaning.factor != 1}
    return tuple(renamed.get(heading, heading) for heading in table.headings), refused


def _names_of(field, labels):
    """Normalised names of a column, without its unit; `labels` are those of each language."""
    stem, _ = split_unit(field.name)
    translated = [known.get(stem, stem) for known in labels]
    return {_plain(name) for name in (stem, *translated, *USUAL.get(stem, ()))}


def _meaning(heading, field, names):
    """List with the `Meaning` of the heading for this column; empty if it does not match."""
    _, field_unit = split_unit(field.name)
    if _plain(heading) in names:
        return [Meaning(field.name, Fraction(1))]
    for pattern in (_BRACKETED, _LAST_WORD):
        parts = pattern.fullmatch(heading.replace("_", " ").strip())
        if parts is None or _plain(parts[1]) not in names:
            continue
        unit = _unit_of(parts[2])
        if unit == _plain(field_unit):
            return [Meaning(field.name, Fraction(1), unit)]
        if unit in LENGTHS and field_unit in LENGTHS:
            return [Meaning(field.name, LENGTHS[unit] / LENGTHS[field_unit], unit)]
        return [Meaning(field.name, None, parts[2].strip())] if pattern is _BRACKETED else []
    return []


def _unit_of(text):
    plain = _plain(text)
    return UNIT_NAMES.get(plain, plain)


def _plain(text):
    """Text in lower case, without accents and punctuation, words separated by one blank."""
    letters = unicodedata.normalize("NFKD", text.lower())
    letters = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return " ".join(re.split(r"[\s_.:#]+", letters)).strip()
