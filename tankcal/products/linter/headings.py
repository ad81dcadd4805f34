"""Identify columns of heights and volumes, and their units, from their headings.

Headings may be in English, Portuguese or Spanish. The unit is part of the heading, in brackets or
as a word, or stands in a row of units below it.
"""

import re
from dataclasses import dataclass

from tankcal.messages import Message
from tankcal.products.linter.units import (
    LENGTH,
    NO_UNIT,
    VOLUME,
    Unit,
    drop_prepositions,
    names_only_units,
    plain_text,
    size_of,
    tokens_of,
    unit_of,
)

_HEIGHT = re.compile(
    "heights?|dips?|innage|levels?|gauge|depth|sounding|altura|nivel|cota|medida|medic(ao|ion)|"
    "regua|sondagem|enchimento|profundida(de|d)|sonda|sondaje|regla|varilla|aforo|alt|niv|hgt|ht"
)
_ULLAGE = re.compile("ullage|outage|vacio|vazio|espaco")
_VOLUME = re.compile(
    "volumen?s?|vols?|capacity|capacidade?|quantity|quantidade|cantidad|contents?|conteudo|contenido"
)
_OTHER = re.compile(
    "u|k|sd|per|por|uncertainty|incerteza|incertidumbre|area|temperatur[ae]|densit[ya]|densidade?|"
    "correction|correcao|correccion|difference|diferenca|diferencia|increment[o]?|delta|fa[c]?tor|"
    "deviation|desvio|low|high"
)
_UNCERTAINTY = re.compile("uncertainty|incerteza|incertidumbre")
_STANDARD = re.compile("standard|padrao|estandar|tipica")
_FACTOR = re.compile("coverage|abrangencia|cobertura")
_OF_SOMETHING_ELSE = re.compile("radius|raio|radio|area|input|entrada|height|altura|dip")
_COVERAGE = re.compile(r"\bk ?= ?(\d{1,2}(?:[.,]\d{1,4})?)", re.ASCII)
_BOUND = re.compile("from|to|de|a|ate|desde|hasta")  # bounds of a range of volumes
_RATE = re.compile(r"(\w*)[ )\]]*/ ?(mm|cm|dm|m|in|ft|pol)\b")
_SYMBOL = re.compile("h|hl")  # h/cm: a height in cm
_FEET = re.compile("ft|foot|feet|pes|pies")
_OF_INCH = re.compile(r"(?<![\d.,])(?:1/)?(8|16)(?![\d.,]|/)|(eighth|oitavo|octavo)|"
                      r"(sixteenth|dezesseis ?avo|dieciseisavo)", re.ASCII)  # fmt: skip
_PARTS = re.compile("proportional|proporciona|interpola|milimetrica")


@dataclass(frozen=True)
class Heading:
    """Role and unit of a column from its heading.

    role is "height", "ullage", "volume" or "" (other); named is the `Unit`, NO_UNIT for other
    roles.
    """

    text: str
    role: str
    named: Unit = NO_UNIT

    @property
    def unit(self):
        """Size of the unit in m or m3; None if the heading states no usable unit."""
        return self.named.size

    @property
    def is_in_feet(self):
        """Whether the heading contains feet."""
        return _any(_FEET, _words(self.text))

    @property
    def is_in_feet_and_inches(self):
        """Whether the heading contains feet and inches, as for labels such as 5-3."""
        return self.is_in_feet and (
            self.role != "volume"
            and len({size_of(w, LENGTH) for w in _words(self.text)} - {None}) > 1
        )


@dataclass(frozen=True)
class Uncertainty:
    """Kind and unit of a column of uncertainties from its heading.

    Attributes
    ----------
    is_expanded : bool
        True: U; False: standard uncertainty u.
    unit : float or None
        Size of its unit in m3; None if the heading states no usable unit.
    in_percent : bool
        Whether it is in percent of the volume.
    k : float or None
        Coverage factor in the heading.
    complaint : str
        Why the stated unit cannot be used, or "".
    """

    is_expanded: bool
    unit: float | None
    in_percent: bool
    k: float | None
    complaint: Message | str = ""


def uncertainty_of(cell):
    """Return the `Uncertainty` of volumes in a heading, or None."""
    if not isinstance(cell, str):
        return None
    words, letters = _words(cell), re.findall(r"[A-Za-z]+", cell)
    is_named = _any(_UNCERTAINTY, words)
    is_symbol = letters[:1] in (["U"], ["u"]) and words[:1] not in (["us"], ["uk"])
    if not (is_named or is_symbol) or _is_rate(cell):
        return None
    is_foreign = _any(_OF_SOMETHING_ELSE, words) or any(size_of(w, LENGTH) for w in words)
    if is_foreign or "/" in cell:
        return None
    is_standard = _any(_STANDARD, words) or (not is_named and letters[0] == "u")
    k = _COVERAGE.search(plain_text(cell))
    k = None if k is None else float(k[1].replace(",", "."))
    in_percent = "%" in cell
    unit = NO_UNIT if in_percent else unit_of(_COVERAGE.sub(" ", plain_text(cell)), VOLUME)
    return Uncertainty(not is_standard, unit.size, in_percent, k, unit.complaint)


def is_coverage_factor(cell):
    """Whether a heading is that of coverage factors."""
    words = _words(cell) if isinstance(cell, str) else []
    return words[:1] == ["k"] or _any(_FACTOR, words)


def heading_of(cell):
    """Return the `Heading` of a cell; no role for a cell without text."""
    if not isinstance(cell, str):
        return Heading("", "")
    text, words = cell.strip(), _words(cell)
    is_bare_unit = names_only_units(cell)
    if not (words or is_bare_unit) or _is_rate(cell) or _any(_OTHER, words):
        return Heading(text, "")
    has_length = any(size_of(word, LENGTH) is not None for word in words)
    has_volume = any(size_of(word, VOLUME) is not None for word in words)
    if _any(_ULLAGE, words):
        return Heading(text, "ullage", unit_of(text, LENGTH))
    has_number = any(char.isdigit() for token in tokens_of(text) for char in token[:1])
    is_bound = (
        not has_number
        and any(map(_BOUND.fullmatch, words))
        and all(_BOUND.fullmatch(word) or size_of(word, VOLUME) for word in words)
    )
    if is_bound:
        return Heading(text, "")
    is_height = _any(_HEIGHT, words)
    if _any(_VOLUME, words) or (has_volume and not is_height):
        return Heading(text, "volume", unit_of(text, VOLUME))
    if is_height or has_length:
        return Heading(text, "height", unit_of(text, LENGTH))
    return Heading(text, "volume", unit_of(text, VOLUME)) if is_bare_unit else Heading(text, "")


def _is_rate(text):
    """Whether a heading is of volume per height (L/cm); h/cm and ft/in are not."""
    match = _RATE.search(plain_text(text))
    if match is None:
        return False
    over = match[1]
    is_height = _HEIGHT.fullmatch(over) or _ULLAGE.fullmatch(over) or _SYMBOL.fullmatch(over)
    return not (is_height or size_of(over, LENGTH) is not None)


def is_unit(cell):
    """Whether a cell contains only a unit, possibly with a factor."""
    return isinstance(cell, str) and names_only_units(cell)


def parts_of_inch(text):
    """Return 8 or 16 if a heading of feet and inches contains eighths or sixteenths, else None."""
    match = _OF_INCH.search(plain_text(text)) if _any(_FEET, _words(text)) else None
    if match is None:
        return None
    return int(match[1]) if match[1] else 8 if match[2] else 16


def is_heading_of_parts(cell):
    """Whether a cell is a heading of proportional parts."""
    return isinstance(cell, str) and _PARTS.search(plain_text(cell)) is not None


def _words(text):
    """Words of a heading."""
    return [token for token in drop_prepositions(tokens_of(text)) if token[0].isalpha()]


def _any(pattern, words):
    """Whether a word matches a pattern."""
    return any(pattern.fullmatch(word) for word in words)
