"""Headings of a table: columns of heights and volumes, and their units in three languages.

Units in headings: names in three languages, factors before them, unusable units.

A heading without a unit leaves the unit open. A heading with a unit of another quantity (kg, %, V),
or with an unknown unit, must not: `unit_of` then returns a complaint instead of a size.

Exact sizes: 1 in = 0.0254 m, 1 US gallon = 231 in3, 1 barrel = 42 US gallons, 1 imperial gallon =
4.54609 L.

Headings may be in English, Portuguese or Spanish. The unit is part of the heading, in brackets or
as a word, or stands in a row of units below it.
"""

import re
import unicodedata
from dataclasses import dataclass
from math import log10, prod

from tankcal.messages import Message, message
from tankcal.tank.dips import INCHES_PER_FOOT, METRES_PER_INCH, VOLUME_UNITS_M3
from tankcal.units import FOOT_M, INCH_M

FOOT3_M3 = float((INCHES_PER_FOOT * METRES_PER_INCH) ** 3)
LENGTH, VOLUME = "length", "volume"
US_GALLON_M3 = float(231 * METRES_PER_INCH**3)
IMPERIAL_GALLON_M3 = 4.54609e-3
GALLONS_M3 = (US_GALLON_M3, IMPERIAL_GALLON_M3)  # possible sizes if no country is stated
_BARREL_M3 = float(VOLUME_UNITS_M3["bbl"])

_SIZES = {
    LENGTH: (
        (r"m|ms|mts|mtrs?|met(?:re|er|ro)s?", 1.0),
        (r"dm|decimet(?:re|er|ro)s?", 0.1),
        (r"cms?|centimet(?:re|er|ro)s?", 0.01),
        (r"mms?|mill?imet(?:re|er|ro)s?", 0.001),
        (r"ins?|inch(?:es)?|pol|polegadas?|pulg?|plg|pulgadas?", INCH_M),
        (r"ft|foot|feet|pes?|pies?", FOOT_M),
    ),
    VOLUME: (
        (r"m3|kl|[kq]uilolit(?:re|er|ro)s?|kilolit(?:re|er|ro)s?", 1.0),
        (r"hl|hectolit(?:re|er|ro)s?", 0.1),
        (r"dal|de[ck]alit(?:re|er|ro)s?", 0.01),
        (r"l|lit|lts?|ltrs?|lit(?:re|er|ro)s?|dm3", 0.001),
        (r"dl|decilit(?:re|er|ro)s?", 1e-4),
        (r"cl|centilit(?:re|er|ro)s?", 1e-5),
        (r"ml|mill?ilit(?:re|er|ro)s?|cm3", 1e-6),
        (r"mm3", 1e-9),
        (r"megalit(?:re|er|ro)s?", 1000.0),
        (r"bbls?|bls|brls?|barrels?|barril|barris|barriles", _BARREL_M3),
        (r"kbbls?|kilobarrels?", 1000 * _BARREL_M3),
        (r"ft3", FOOT3_M3),
        (r"in3", float(METRES_PER_INCH**3)),
        (r"yd3", 27 * FOOT3_M3),
    ),
}
MOST_LETTERS = 500  # largest length of a heading, which limits the time of pattern searches
_GALLON = re.compile("gals?|gallons?|galao|galoes|galon|galones")
_BARREL = re.compile("k?bbls?|bls|brls?|barrels?|barril|barris|barriles")
_US = re.compile("us|american|americanos?|americanas?|estadounidenses?")
_IMPERIAL = re.compile("uk|imp|imperial|imperiais|imperiales|british|britanicos?|ingles|ingleses|"
                       "english|canadian|canadenses?|canadienses?")  # fmt: skip
_DRY = re.compile("dry|secos?")
_OF_DRINKS = re.compile("beer|ale|wine|spirits?|whisk[e]?y|cerveja|cerveza|vinho|vino")
_FOREIGN = (
    (
        re.compile(
            "kgs?|kgf|g|grams?|gramos?|gramas?|mg|t|tons?|tonnes?|toneladas?|tm|mt|kt|lbs?|lbm|"
            "pounds?|libras?|oz|ounces?|cwt|[kq]uilos?|(?:k|qu)ilogram[ao]?s?|kilogrammes?"
        ),
        message("lint_kind_mass", "a mass"),
    ),
    (
        re.compile("%|‰|percent|pct|perc|porcent|porcentage[mn]s?|porcentajes?|percentage|"
                   "percentual|porciento|ppm"),
        message("lint_kind_percent", "a percentage"),
    ),
    (re.compile("v|mv|kv|ma|volts?|voltios?|amps?|hz|khz|ohms?|counts?|digits?|pulses?|pulsos?"),
     message("lint_kind_signal", "a signal")),
    (re.compile("bar|mbar|k?pa|mpa|hpa|psig?|psia|mmhg|mca|mwc|mmh|inh|atm|kgfcm"),
     message("lint_kind_pressure", "a pressure")),
    (re.compile("°c|°f|°|degc|degf|celsius|fahrenheit|kelvin"),
     message("lint_kind_temperature", "a temperature")),
    (
        re.compile(
            "m2|cm2|mm2|ft2|in2|sqft|sqm|km|km3|yds?|yards?|jardas?|yardas?|nm|um|micra|microns?|"
            "thou|mils?|qts?|quarts?|cuartos?|pts?|pints?|pintas?|floz|mmbbls?|mbbls?|mcf|"
            "mmcf|scf|mscf|mgals?|kgals?|gl|gls|glns?|min|hrs?|hours?|horas?|days?|dias?|"
            "acft|hhds?|firkins?|casks?|cubits?|rods?|chains?|fathoms?|fms?|bushels?|pipas?"
        ),
        message("lint_kind_unknown", "not a unit that is read"),
    ),
)  # fmt: skip
_UNKNOWN = _FOREIGN[-1][1]
_UNCLEAR = message("lint_kind_unclear", "a name with several meanings")
_BY_POSITION = re.compile("v|t|g|counts?|digits?|min|mils?|libras?|oz|dias?|horas?|hours?|days?")
_LARGE_PREFIX = re.compile(r"(?<![A-Za-z])(M{1,2}(?:bbls?|BBLS?|CFs?|cf|SCF|scf|gals?|GALS?)|"
                           r"Mm[3³]|MM[3³]|M[Ll]|GL|Gl)(?![A-Za-z])")  # fmt: skip

# words in brackets or after a comma in headings that are not units
_ORDINARY = re.compile(
    "net|gross|total|tot|liq|liquid|liquido|liquida|bruto|bruta|neto|neta|util|agua|water|product|"
    "produto|producto|oil|gas|glp|lpg|oleo|aceite|tank|tk|tq|tanque|shell|bottom|top|fundo|fondo|"
    "topo|innage|outage|ullage|dip|dips|level|nivel|height|altura|volume|volumen|vol|capacity|"
    "capacidade|capacidad|cap|observed|obs|corrected|cor|corr|nominal|ref|reference|referencia|"
    "datum|plate|strike|indicated|real|atual|actual|new|old|novo|nuevo|std|standard|max|min|safe|"
    "tov|gov|gsv|nsv|approx|aprox|main|inner|outer|interno|externo|inside|outside|cumulative|"
    "acumulado|acumulada|incl|excl|roof|teto|techo|no|nr|num|col|coluna|columna|column|[a-fhijknopq"
    "rsuwyz]|[ivx]+|product[os]?|vertical|horizontal|manual|auto|dry|wet|hot|cold|north|south|"
    "east|west|norte|sul|sur|leste|este|oeste|the|and|of|de|do|da|del|em|en|in|to|at|e|y|a|o|"
    "medida|medido|lida|lido|leida|leido|read|interpolated|table|tabela|tabla|content|contents"
)
_BETWEEN = frozenset(
    ("of", "de", "da", "do", "del", "a", "an", "the", "um", "uma", "un", "una", "em", "en", "in")
)
_TIMES = frozenset(("x", "×", "*", "·"))
_OPENS, _CLOSES = frozenset("([{"), frozenset(")]}")
_BREAKS = frozenset((",", ";", ":", "/", "-", "=", *_OPENS))
_INTRODUCES = frozenset(("in", "em", "en"))
_PARTS_OF_INCH = (2, 4, 8, 16, 32, 64)
_PLAIN_FACTORS = frozenset((2.0, 5.0, 20.0, 25.0, 50.0, *(1 / n for n in (3, *_PARTS_OF_INCH))))
_LEAST_BARE_FACTOR = 100.0  # smallest factor without a sign; (10) may be the number of a column

_SUBSTITUTIONS = tuple(
    (re.compile(pattern, re.ASCII), into)
    for pattern, into in (
        (r"_", " , "),
        (r"\b([hkdcm])\. ?([mlg])\b(?!\.?[a-z])", r"\1\2"),  # c.m.
        (r"(?<![\d.,])(?<!\d )['’]?000(?:['’]?s)?(?![\d.,])", " 1000 "),  # '000 L, 000's L
        (r"(?<=\d)['’]s\b", " "),  # 100's L
        (r"\busa?\b|\bu\.s\.?(?:a\.?)?|\beua\b|\be\.u\.a\.?|\bee\.? ?uu\.?", " us "),
        (r"\bu\.k\.?", " uk "),
        (r"″|”|\"|''|′′|’’", " in "),
        (r"(?<![a-z])['′’]", " ft "),
        (r"(?<=[a-z])\.", " "),
        (r"\s+", " "),
        (r"\bfl ?oz\b", "floz"),
        (r"\bpor ?cento\b|\bpor ?ciento\b|\bper ?cent\b", "percent"),
        (r"\b(?:at|@|to|a)? ?\d+(?:[.,]\d+)? ?(?:°|o|deg)? ?[cfk]\b", " "),  # 15 degrees Celsius
        (r"\d[\d.,]* ?(?:kg|g|t|lb)s? ?/ ?(?:m|l|dm|cm|gal|ft|bbl) ?3?\b", " "),  # 700 kg/m3
        (r"\b(?:at|@|a) ?\d[\d.,]* ?(?:m?bar|[kmh]?pa|psi|atm)g?\b", " "),
        (r"\b(m|dm|cm|mm|ft|in|yd|pol|pulg|feet|foot) ?(?:\^|\*\*) ?([23])\b", r"\1\2"),
        (r"\b(?:cubic|cu|cub)[ -]?(?:feet|foot|ft)\b|\b(?:feet|foot|ft)[ -]?(?:cubed|3)\b|"
         r"\b(?:cuft|cft|cf|fcu)\b|\bp(?:es?|ies?) ?(?:cubicos?|cub|3)\b", " ft3 "),
        (r"\b(?:cubic|cu|cub)[ -]?(?:inch(?:es)?|in)\b|\b(?:inch(?:es)?|in|pol|pulg|plg)3\b|"
         r"\bcuin\b|\b(?:pol|polegadas?|pulg|pulgadas?) ?(?:cubicas?|cub|3)\b", " in3 "),
        (r"\b(?:cubic|cu|cub)[ -]?(?:yards?|yds?)\b|\byds?3\b|\b[jy]ardas? ?(?:cubicas?|3)\b",
         " yd3 "),
        (r"\b(?:cubic|cu|cub)[ -]?decimet(?:re|er)s?\b|\bdecimetros? cubicos?\b", " dm3 "),
        (r"\b(?:cubic|cu|cub)[ -]?centimet(?:re|er)s?\b|\bcentimetros? cubicos?\b|\bccm?\b",
         " cm3 "),
        (r"\b(?:cubic|cu|cub)[ -]?mill?imet(?:re|er)s?\b|\bmill?imetros? cubicos?\b", " mm3 "),
        (r"\b(?:cubic|cu|cub)[ -]?(?:met(?:re|er)s?|m)\b|\b(?:m|mts?|mtrs?|metros?) ?"
         r"(?:cubicos?|cub|3)\b|\bcbm\b", " m3 "),
        (r"\bus ?-?(g|gals?)\b", " us gal "),
        (r"\b(?:uk|imp|i) ?-?gals?\b|\bgpi\b", " imp gal "),
        (r"\b(?:thousands?|mil|mill?ares|milhares|miles)\b", " 1000 "),
        (r"\b(?:hundreds?|cem|cien|centenas|centenares)\b", " 100 "),
        (r"\b(?:millions?|milhoes|millones)\b", " 1000000 "),
        (r"\b(?:1/)?(8|16|32|64)[ -]?(?:ths?|nds?|avos?)\b", r" 1/\1 "),
        (r"\b(?:eighths?|oitavos?|octavos?)\b", " 1/8 "),
        (r"\b(?:sixteenths?|dezesseis ?avos?|dieciseis ?avos?)\b", " 1/16 "),
        (r"\b(?:quarters?)\b|\b[cq]uartos? de (?=pol|pulg|plg)", " 1/4 "),
        (r"\b(?:half|halves)\b|\b(?:meia|media) (?=pol|pulg|plg)", " 1/2 "),
        (r"\b(?:tenths?|decimos?|decimas?)\b", " 1/10 "),
        (r"\b(?:hundredths?|centesimos?|centesimas?)\b", " 1/100 "),
        (r"\b(?:thousandths?|milesimos?|milesimas?)\b", " 1/1000 "),
    )
)  # fmt: skip
_TOKEN = re.compile(
    r"[0-9]+/[0-9]+|[0-9]+(?:[.,][0-9]+)*(?:\^[0-9]+)?|°?[^\W\d_]+[23]?|[%‰°]|[()\[\]{},;:/×*·=-]"
)
_POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")


@dataclass(frozen=True)
class Unit:
    """The unit in a heading.

    Attributes
    ----------
    size : float or None
        In m or m3, with its factor; None if no usable unit is stated.
    factor : float
        Number before the unit (10 in "10 L"); 1 without a number.
    is_multiplied : bool
        Whether the factor has a multiplication sign ("x 10 L"), and so is no rounding.
    choices : tuple of float
        Sizes of an ambiguous name, in m3.
    complaint : Message or str
        Why the stated unit cannot be used; empty if it can.
    """

    size: float | None = None
    factor: float = 1.0
    is_multiplied: bool = False
    choices: tuple[float, ...] = ()
    complaint: Message | str = ""

    @property
    def is_named(self):
        """Whether the heading states a unit, usable or not."""
        return self.size is not None or bool(self.choices or self.complaint)


NO_UNIT = Unit()


def plain_text(text):
    """Lower-case text without accents, superscripts as digits, ½ as 1/2; "" if too long."""
    if len(text) > MOST_LETTERS:
        return ""
    text = re.sub("10([⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda power: "10^" + power[1].translate(_POWERS), text)
    text = re.sub("([¼-¾⅐-⅞])", r" \1", text)
    decomposed = unicodedata.normalize("NFKD", text).replace("\u2044", "/")
    return "".join(char for char in decomposed if not unicodedata.combining(char)).lower()


def tokens_of(text):
    """Words, numbers, units and marks of a heading; each unit by one name."""
    plain = plain_text(text)
    for pattern, into in _SUBSTITUTIONS:
        plain = pattern.sub(into, plain)
    return _TOKEN.findall(plain)


def size_of(token, dimension):
    """Size of the unit of a token, in m or m3; None for any other token."""
    for pattern, size in _PATTERNS[dimension]:
        if pattern.fullmatch(token):
            return size
    return US_GALLON_M3 if dimension == VOLUME and _GALLON.fullmatch(token) else None


_PATTERNS = {
    dimension: tuple((re.compile(pattern), size) for pattern, size in sizes)
    for dimension, sizes in _SIZES.items()
}


def unit_of(text, dimension):
    """Return the `Unit` in a heading of heights (LENGTH) or volumes (VOLUME)."""
    tokens = drop_prepositions(tokens_of(text))
    large = _LARGE_PREFIX.search(text) if dimension == VOLUME else None
    if large is not None:
        return Unit(complaint=_unusable(large[0], _UNCLEAR, dimension))
    places = [k for k, token in enumerate(tokens) if size_of(token, dimension) is not None]
    if not places:
        return _unit_without_size(tokens, dimension, text)
    ratio = _foreign_ratio(tokens, places)
    if ratio:
        return Unit(complaint=_unusable(ratio, _UNKNOWN, dimension))
    sizes = [size_of(tokens[k], dimension) for k in places]
    factor, is_multiplied, unclear = _factor(tokens, places)
    if unclear:
        return Unit(complaint=_unclear_factor(unclear))
    is_feet_and_inches = dimension == LENGTH and set(sizes) == {FOOT_M, INCH_M}
    if len({round(log10(size), 6) for size in sizes}) > 1 and not is_feet_and_inches:
        both = " ".join(tokens[k] for k in places)
        return Unit(complaint=_unusable(both, message("lint_kind_two", "two units"), dimension))
    if dimension == VOLUME:
        choices, complaint = _countries(tokens, [tokens[k] for k in places])
        if complaint:
            return Unit(complaint=complaint)
        if choices:
            choices = tuple(factor * size for size in choices)
            size = choices[0] if len(choices) == 1 else None
            return Unit(size, factor, is_multiplied, choices if size is None else ())
    return Unit(factor * sizes[-1], factor, is_multiplied)


def names_only_units(text):
    """Whether a cell contains only units, usable or not, with factors and marks."""
    tokens = tokens_of(text)
    words = [token for token in tokens if token[0].isalpha() or token in ("%", "‰", "°")]
    is_unit = [
        any(size_of(word, dimension) is not None for dimension in (LENGTH, VOLUME))
        or _kind(word) is not None
        or word in _TIMES
        or any(dimension.fullmatch(word) for dimension in (_US, _IMPERIAL, _DRY))
        for word in words
    ]
    return all(is_unit) and any(word not in _TIMES for word in words)


def countries_in(text):
    """Sizes of the gallons of the countries in a text, in m3."""
    tokens = tokens_of(text)
    gallons = [token for token in tokens if _GALLON.fullmatch(token)]
    return _countries(tokens, gallons)[0] if gallons else ()


def drop_prepositions(tokens):
    """Tokens without an "in" that is no inch: before a word, a unit or a number."""
    kept = []
    for k, token in enumerate(tokens):
        after = tokens[k + 1] if k + 1 < len(tokens) else ")"
        is_fraction = "/" in after and after[0].isdigit()
        is_last_word = not (after[0].isalnum() or after[0] in "%‰°")
        if is_fraction:
            is_last_word = k + 2 == len(tokens) or tokens[k + 2] in _CLOSES | {","}
        has_number = k > 0 and tokens[k - 1][0].isdigit()
        if token == "in" and not (is_last_word or has_number or after in _TIMES):
            kept.append("em")  # replaced by a preposition of another language
            continue
        kept.append(token)
    return kept


def _kind(token):
    """Kind of a unit that is neither height nor volume; None for any other token."""
    return next((kind for pattern, kind in _FOREIGN if pattern.fullmatch(token)), None)


def _unit_without_size(tokens, dimension, text):
    """Return the `Unit` of a heading without a usable unit.

    A complaint if it states another unit.
    """

    def unusable(token, kind):
        written = re.search(re.escape(token), text, re.IGNORECASE)
        return Unit(complaint=_unusable(written[0] if written else token, kind, dimension))

    for k, token in enumerate(tokens):
        kind = _kind(token)
        if kind is not None and (not _BY_POSITION.fullmatch(token) or _is_placed(tokens, k)):
            return unusable(token, kind)
    for k, token in enumerate(tokens):
        is_word = token.rstrip("23").isalpha() and not _ORDINARY.fullmatch(token)
        is_length = size_of(token, LENGTH) is not None
        if is_length and dimension == VOLUME and _is_placed(tokens, k):
            return unusable(token, message("lint_kind_length", "a length"))
        is_volume = size_of(token, VOLUME) is not None
        if is_volume and dimension == LENGTH and _is_placed(tokens, k):
            return unusable(token, message("lint_kind_volume", "a volume"))
        if is_word and token not in _TIMES and _is_alone(tokens, k):
            return unusable(token, _UNKNOWN)
    for k, token in enumerate(tokens):
        value = number_of(token)
        before, after = _neighbours(tokens, k)
        is_bare = before in _OPENS and after in _CLOSES and value and value >= _LEAST_BARE_FACTOR
        is_power = is_bare and float(log10(value)).is_integer()
        is_part = "/" in token and before in _OPENS and after in _CLOSES  # (16ths)
        if value and (before in _TIMES or is_power or is_part):
            return Unit(complaint=_unclear_factor(token))
    return NO_UNIT


def _neighbours(tokens, k):
    """The tokens before and after a token; "(" and ")" at the ends."""
    return tokens[k - 1] if k else "(", tokens[k + 1] if k + 1 < len(tokens) else ")"


def _is_placed(tokens, k):
    """Whether a token is at the position of a unit: in brackets, last, or after a comma or "in"."""
    before, after = _neighbours(tokens, k)
    is_last = k + 1 == len(tokens) and (k > 0 or len(tokens) == 1)
    is_symbol = tokens[k] == "v" and before not in _BREAKS | _INTRODUCES  # volume V
    return not is_symbol and (
        is_last or before in _BREAKS - {"-"} or before in _INTRODUCES or after in _CLOSES
    )


def _is_alone(tokens, k):
    """Whether a word is the only one in brackets, or after a comma, a slash or "in"."""
    before, after = _neighbours(tokens, k)
    is_end = k + 1 == len(tokens) or after in _CLOSES or after in (",", ";")
    return k > 0 and is_end and (before in _BREAKS - {"-"} or before in _INTRODUCES)


def _foreign_ratio(tokens, places):
    """Text of a ratio of units such as kg/L; "" if there is none."""
    for k in places:
        for neighbour, slash in ((k - 2, k - 1), (k + 2, k + 1)):
            if 0 <= neighbour < len(tokens) and 0 <= slash < len(tokens) and tokens[slash] == "/":
                kind = _kind(tokens[neighbour])
                if kind is not None and not _BY_POSITION.fullmatch(tokens[neighbour]):
                    return "".join(tokens[min(k, neighbour) : max(k, neighbour) + 1])
    return ""


def number_of(token):
    """Value of a typed number or fraction; None for any other token."""
    if not token[0].isdigit():
        return None
    if "/" in token:
        over, under = token.split("/")
        return int(over) / int(under) if int(under) else None
    base, _, power = token.partition("^")
    grouped = re.fullmatch(r"[1-9]\d{0,2}(?:[.,]000)+", base)
    base = re.sub("[.,]", "", base) if grouped else base.replace(",", ".")
    if base.count(".") > 1 or len(base) > 12 or len(power) > 1:
        return None
    return float(base) ** int(power or 1)


def _factor(tokens, places):
    """(factor, whether it has a multiplication sign, text of an unclear number or "")."""
    numbers, is_multiplied = {}, False
    for k, token in enumerate(tokens):
        value = number_of(token)
        if value is None:
            continue
        before, after = _neighbours(tokens, k)
        ahead = k + 1
        while (
            ahead < len(tokens)
            and ahead not in places
            and (
                tokens[ahead] in _TIMES | _BETWEEN
                or any(pattern.fullmatch(tokens[ahead]) for pattern in (_US, _IMPERIAL))
            )
        ):
            ahead += 1
        signs = {before, *tokens[k + 1 : ahead]} & _TIMES
        is_before = ahead in places
        is_behind = k - 1 in places and ("/" in token or before in _TIMES)
        is_behind |= k - 2 in places and before in _TIMES
        is_over = before == "/" and k - 2 in places and ahead not in places
        is_part = "/" in token and any(size_of(tokens[p], LENGTH) == INCH_M for p in places)
        if not (signs or is_before or is_behind or is_over or is_part):
            is_bare = before in _OPENS and after in _CLOSES and value >= _LEAST_BARE_FACTOR
            if is_bare and float(log10(value)).is_integer():
                return 1.0, False, token
            continue
        if is_over:
            value = 1 / value if value in _PARTS_OF_INCH else 0.0
        if signs and not is_before and value == 1:
            continue
        is_free = k > 0 and not signs and tokens[k - 1][0].isalpha()
        if is_free and tokens[k - 1] not in _BETWEEN and k - 1 not in places:
            is_free = not _ROLE_WORD.fullmatch(tokens[k - 1])
        else:
            is_free = False
        is_power_of_ten = value > 0 and abs(log10(value) - round(log10(value))) < 1e-9
        if is_free or not (is_power_of_ten or value in _PLAIN_FACTORS):
            return 1.0, False, token
        numbers[k], is_multiplied = value, is_multiplied or bool(signs)
    return float(prod(numbers.values())), is_multiplied, ""


_ROLE_WORD = re.compile(
    "heights?|dips?|innage|levels?|gauge|depth|sounding|altura|nivel|medida|volumen?s?|vols?|"
    "capacity|capacidade?|quantity|quantidade|cantidad|contents?|conteudo|contenido|ullage|outage"
)


def _countries(tokens, names):
    """(sizes of gallons, complaint) from the country in the tokens."""
    is_us, is_imperial, is_dry = (
        any(pattern.fullmatch(token) for token in tokens) for pattern in (_US, _IMPERIAL, _DRY)
    )
    gallons = [name for name in names if _GALLON.fullmatch(name)]
    is_of_drinks = any(_OF_DRINKS.fullmatch(token) for token in tokens)
    is_odd = (is_imperial or is_of_drinks) and any(_BARREL.fullmatch(name) for name in names)
    if is_odd or (gallons and (is_dry or (is_us and is_imperial))):
        return (), _unusable(" ".join(names), _UNCLEAR, VOLUME)
    if not gallons:
        return (), ""
    if is_us or is_imperial:
        return (US_GALLON_M3 if is_us else IMPERIAL_GALLON_M3,), ""
    return GALLONS_M3, ""


def _unusable(unit, kind, dimension):
    """Message about a unit that cannot be used."""
    expected = "m, dm, cm, mm, in, ft"
    if dimension == VOLUME:
        expected = "m3, L, hL, bbl, US gal, imp gal, ft3"
    return message(
        "lint_unusable_unit",
        "found the unit {unit}, {meaning}; expected a heading with one of the units {units}: "
        "convert the column, or correct the heading",
        unit=unit,
        meaning=kind,
        units=expected,
    )


def _unclear_factor(number):
    """Message about a number that may be a factor."""
    return message(
        "lint_unclear_factor",
        "found the number {number} in the heading, perhaps a factor; expected a factor with its "
        "unit, such as (x 10 L) or (1/8 in), or no number",
        number=number,
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
