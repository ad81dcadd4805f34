"""Which columns of a table hold heights and which volumes, and in which units, by their headings.

English, Portuguese and Spanish; the unit stands in the heading, in brackets or as a word, or in a
row of units below it.
"""

import re
import unicodedata
from dataclasses import dataclass

_HEIGHT = re.compile(
    "heights?|dips?|innage|levels?|gauge|depth|sounding|altura|nivel|cota|medida|medic(ao|ion)|"
    "regua|sondagem|enchimento|profundida(de|d)|sonda|sondaje|regla|varilla|aforo"
)
_ULLAGE = re.compile("ullage|outage|vacio|vazio|espaco")
_VOLUME = re.compile(
    "volumen?s?|capacity|capacidade?|quantity|quantidade|cantidad|contents?|conteudo|contenido"
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
_BOUND = re.compile("from|to|de|a|ate|desde|hasta")  # of an interval of volumes
_RATE = re.compile(r"/ ?(mm|cm|dm|m|in|ft|pol)\b")
_FEET = re.compile("ft|foot|feet|pes|pies")
_OF_INCH = re.compile(r"(?<![\d.,])(?:1/)?(8|16)(?![\d.,]|/)|(eighth|oitavo|octavo)|"
                      r"(sixteenth|dezesseis ?avo|dieciseisavo)", re.ASCII)  # fmt: skip
_PARTS = re.compile("proportional|proporciona|interpola|milimetrica")

HEIGHT_UNITS_M = (
    (re.compile("m|met(re|er|ro)s?"), 1.0),
    (re.compile("dm|decimet(re|er|ro)s?"), 0.1),
    (re.compile("cm|centimet(re|er|ro)s?"), 0.01),
    (re.compile("mm|mill?imet(re|er|ro)s?"), 0.001),
    (re.compile("in|inch(es)?|pol(egadas?)?|pulgadas?"), 0.0254),
    (re.compile("ft|foot|feet"), 0.3048),
)
VOLUME_UNITS_M3 = (
    (re.compile("m3|cbm|kl"), 1.0),
    (re.compile("l|lts?|ltr|lit(re|er|ro)s?|dm3"), 0.001),
    (re.compile("hl|hectolit(re|er|ro)s?"), 0.1),
    (re.compile("bbls?|barrels?|barril|barris|barriles"), 0.158987294928),
    (re.compile("gal(lons?|ao|oes|on|ones)?"), 0.003785411784),
)


@dataclass(frozen=True)
class Heading:
    """What a heading says.

    role  "height", "ullage", "volume" or "" (something else)
    unit  its size in m or m3; None when the heading names none
    """

    text: str
    role: str
    unit: float | None

    @property
    def is_in_feet(self):
        """Whether it names feet."""
        return _any(_FEET, _words(self.text))


@dataclass(frozen=True)
class Uncertainty:
    """What a heading of a column of uncertainties says.

    is_expanded  U; else the standard uncertainty u
    unit         size of its unit in m3; None when the heading names none
    in_percent   of the volume
    k            coverage factor that the heading names, or None
    """

    is_expanded: bool
    unit: float | None
    in_percent: bool
    k: float | None


def uncertainty_of(cell):
    """The `Uncertainty` of volumes that a heading announces, or None."""
    if not isinstance(cell, str):
        return None
    words, letters = _words(cell), re.findall(r"[A-Za-z]+", cell)
    is_named = _any(_UNCERTAINTY, words)
    if not (is_named or letters[:1] in (["U"], ["u"])) or _RATE.search(_plain(cell)):
        return None
    is_foreign = _any(_OF_SOMETHING_ELSE, words) or _unit(HEIGHT_UNITS_M, words) is not None
    if is_foreign or "/" in cell:
        return None
    is_standard = _any(_STANDARD, words) or (not is_named and letters[0] == "u")
    k = _COVERAGE.search(_plain(cell))
    k = None if k is None else float(k[1].replace(",", "."))
    return Uncertainty(not is_standard, _unit(VOLUME_UNITS_M3, words), "%" in cell, k)


def is_coverage_factor(cell):
    """Whether a heading announces coverage factors."""
    words = _words(cell) if isinstance(cell, str) else []
    return words[:1] == ["k"] or _any(_FACTOR, words)


def heading_of(cell):
    """The `Heading` of a cell; a cell that is no text says nothing."""
    if not isinstance(cell, str):
        return Heading("", "", None)
    text, words = cell.strip(), _words(cell)
    if not words or _RATE.search(_plain(cell)) or _any(_OTHER, words):
        return Heading(text, "", None)
    height_unit, volume_unit = _unit(HEIGHT_UNITS_M, words), _unit(VOLUME_UNITS_M3, words)
    if _any(_ULLAGE, words):
        return Heading(text, "ullage", height_unit)
    is_bound = any(map(_BOUND.fullmatch, words)) and all(
        _BOUND.fullmatch(word) or _unit(VOLUME_UNITS_M3, [word]) for word in words
    )
    if is_bound:
        return Heading(text, "", None)
    if _any(_VOLUME, words) or (volume_unit is not None and not _any(_HEIGHT, words)):
        return Heading(text, "volume", volume_unit)
    if _any(_HEIGHT, words) or height_unit is not None:
        return Heading(text, "height", height_unit)
    return Heading(text, "", None)


def is_unit(cell):
    """Whether a cell names a unit and nothing else."""
    words = _words(cell) if isinstance(cell, str) else []
    units = HEIGHT_UNITS_M + VOLUME_UNITS_M3
    return bool(words) and all(_unit(units, [word]) is not None for word in words)


def parts_of_inch(text):
    """8 or 16 where a heading of feet and inches names eighths or sixteenths, else None."""
    found = _OF_INCH.search(_plain(text)) if _any(_FEET, _words(text)) else None
    if found is None:
        return None
    return int(found[1]) if found[1] else 8 if found[2] else 16


def announces_parts(cell):
    """Whether a cell announces proportional parts."""
    return isinstance(cell, str) and _PARTS.search(_plain(cell)) is not None


def _plain(text):
    """Lower case, without accents, superscripts as digits."""
    decomposed = unicodedata.normalize("NFKD", text)
    return "".join(char for char in decomposed if not unicodedata.combining(char)).lower()


def _words(text):
    plain = re.sub(r"metros? cubicos?|cubic met(re|er)s?|m\^3|\bm 3\b", "m3", _plain(text))
    return re.findall(r"[a-z]+3?", plain)


def _any(pattern, words):
    return any(pattern.fullmatch(word) for word in words)


def _unit(units, words):
    """Size of the last unit that is named."""
    found = [size for word in words for pattern, size in units if pattern.fullmatch(word)]
    return found[-1] if found else None
