"""Writing a value to the digits that its uncertainty deserves: one function for every paper.

The uncertainty keeps two significant digits and the value ends at the same place (JCGM 100:2008
7.2.6). Both are rounded to the nearest, a half away from zero, as the spreadsheet that shows the
same numbers does: on their 15 decimal digits, so that 2.675 is a half although its binary form
lies below it. Two digits rounded down lose at most 4.8 % of U (10.5 -> 10); where a rounding would
take more than 5 % away, which one digit can, U is rounded up (EA-4/02, 6.3).
"""

from dataclasses import dataclass
from decimal import ROUND_HALF_UP, ROUND_UP, Context, Decimal
from math import inf, isfinite

NOTHING = "–"
LITRE_DECIMALS = 3  # rows of a table in m3 keep their litres: deliveries are far better known
UNKNOWN_DECIMALS = 6  # of a value without an uncertainty: it is not rounded to one
WITH_U = range(-12, 15)  # powers of ten of a first digit that are written out beside an uncertainty
WITHOUT_U = range(-4, 6)  # and in a number that has none
_LARGEST_LOSS = Decimal("0.05")
SIGNIFICANT = 2  # digits of u (JCGM 100:2008 7.2.6)
_WIDE = Context(prec=400)
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Marks:
    """What stands between digits.

    decimal      decimal mark
    group        between groups of three digits; "" for none
    least        digits that a whole part has when it is grouped: 5 leaves 1234 as it is
    of_decimals  True: digits behind the mark are grouped too (SI Brochure 5.4.4)
    minus        sign of a negative value
    """

    decimal: str = "."
    group: str = ""
    least: int = 5
    of_decimals: bool = False
    minus: str = "\N{MINUS SIGN}"


ENGLISH = Marks()
ENGLISH_SI = Marks(group="\N{NARROW NO-BREAK SPACE}", of_decimals=True)
PORTUGUESE = Marks(decimal=",", group=".", least=4)
COMMA_SI = Marks(decimal=",", group="\N{NARROW NO-BREAK SPACE}", of_decimals=True)
PROGRAM = Marks(minus="-")  # CSV, and whatever a program reads again


@dataclass(frozen=True)
class Written:
    """A value and its uncertainty as texts with the same last place.

    value, uncertainty  separate texts without the power of ten; NOTHING for what is not known
    power               " × 10ⁿ" that belongs to both, or ""
    both                "12.345 ± 0.067", with a power "(1.234 ± 0.056) × 10²⁰"
    concise             "12.345(67)" (JCGM 100 7.2.2), "12.3(1.2)" where U has a digit before the
                        mark; without uncertainty the value alone
    decimals            digits behind the mark; negative: that many whole digits are rounded off
    """

    value: str
    uncertainty: str
    power: str
    both: str
    concise: str
    decimals: int


def format_with_u(
    value, u, marks=ENGLISH, *, significant=SIGNIFICANT, least=None, written_out=WITH_U
):
    """`value` with its standard or expanded uncertainty `u`, both in one unit.

    value        number; None, nan and inf are written as NOTHING
    u            0 or more; None, nan and inf: not known, and 0 exact: the value then has
                 UNKNOWN_DECIMALS
    significant  digits of u, 1 or more
    least        decimals that both have at least: 0 keeps whole units (12 346 ± 1 235 instead of
                 12 300 ± 1 200), 3 the litres; None: as u says
    written_out  powers of ten of the first digit (of the larger of both) that are not set apart
    Raises ValueError for a negative u.
    """
    if not _is_number(value):
        return Written(NOTHING, NOTHING, "", NOTHING, NOTHING, UNKNOWN_DECIMALS)
    known = _is_number(u)
    number, spread = _exact(value), _exact(u if known else 0.0)
    exponent = max((quantity.adjusted() for quantity in (number, spread) if quantity), default=0)
    exponent = 0 if exponent in written_out else exponent
    number, spread = number.scaleb(-exponent, _WIDE), spread.scaleb(-exponent, _WIDE)
    decimals = _decimals(spread, significant, least)
    spread = _spread(spread, decimals)
    text, power = _text(number, decimals, marks), _power(exponent)
    if not known:
        return Written(text, NOTHING, power, text + power, text + power, decimals)
    of_spread = _text(spread, decimals if spread else 0, marks)
    both = f"{text} ± {of_spread}"
    concise = f"{text}({_brackets(spread, decimals, marks)})" if spread else text
    return Written(
        text, of_spread, power, f"({both}){power}" if power else both, concise + power, decimals
    )


def decimals_of(u, *, significant=SIGNIFICANT, least=0):
    """Decimals that show u with `significant` digits, at least `least` (None: may be negative).

    UNKNOWN_DECIMALS where u is 0, None or not finite. For what takes a number of decimals, such as
    the number format of a cell. Raises ValueError for a negative u.
    """
    return _decimals(_exact(u if _is_number(u) else 0.0), significant, least)


def round_u(u, *, significant=SIGNIFICANT):
    """u as it is printed: 417 is 420, which no number format makes of it; None where not known."""
    if not _is_number(u):
        return None
    exact = _exact(u)
    return float(_spread(exact, _decimals(exact, significant, None))) if exact else 0.0


def bound_of_decimals(decimals, *, significant=SIGNIFICANT):
    """The u below which `decimals_of` gives that many decimals or more: 0.0995 for 3."""
    return (10**significant - 0.5) / 10.0**decimals


def decimals_of_mantissa(value, u, *, significant=SIGNIFICANT):
    """Decimals of the mantissa of `value`, at least 0, with which it ends where its u does.

    For a number format with a power of ten (1.742E-03). UNKNOWN_DECIMALS where u is 0 or not known.
    """
    if not (_is_number(u) and u and _is_number(value) and value):
        return UNKNOWN_DECIMALS
    last = _decimals(_exact(u), significant, None)
    return max(_rounded(_exact(value), last).adjusted() + last, 0)


def decimals_of_rows(
    uncertainties, *, significant=SIGNIFICANT, least=0, most=None, unknown=UNKNOWN_DECIMALS
):
    """Decimals of each row of a column by its own uncertainty, at least `least`.

    most  at most so many, where an uncertainty may be the rounding of what is exact; None: any
    A row without an uncertainty (0, None or nan: the empty tank) is written as the next one is,
    else as the one before it, and with `unknown` decimals where no row has one.
    """
    most = inf if most is None else most
    known = [_is_number(u) and u != 0 for u in uncertainties]
    decimals = [
        min(decimals_of(u, significant=significant, least=least), most) if here else None
        for u, here in zip(uncertainties, known, strict=True)
    ]
    following = next((d for d in reversed(decimals) if d is not None), unknown)
    for i in reversed(range(len(decimals))):
        following = decimals[i] = following if decimals[i] is None else decimals[i]
    return decimals


def decimals_of_height(height_m):
    """Decimals of a height: millimetres, and up to two more where these are not zeros."""
    shown = round(height_m, 5)
    return next((d for d in (3, 4) if round(height_m, d) == shown), 5)


def fixed(value, decimals, marks=ENGLISH):
    """`value` with that many decimals (0 or more) and no minus before zero; NOTHING for none."""
    return _text(_exact(value), decimals, marks) if _is_number(value) else NOTHING


def format_significant(value, digits, marks=ENGLISH):
    """`value` with that many significant digits, no whole digit rounded off; NOTHING for none.

    For what has no uncertainty beside it, or is one. Powers of ten but WITHOUT_U are set apart.
    """
    if not _is_number(value):
        return NOTHING
    number, decimals, exponent = _mantissa(value, digits)
    return _text(number, decimals, marks) + _power(exponent)


def shortest(value, marks=ENGLISH, *, digits=6):
    """`format_significant` without zeros at its end: a number as somebody chose it."""
    if not _is_number(value):
        return NOTHING
    number, decimals, exponent = _mantissa(value, digits)
    needed = -_rounded(number, decimals).normalize(_WIDE).as_tuple().exponent
    return _text(number, max(needed, 0), marks) + _power(exponent)


def superscript(text):
    """Digits and hyphens raised: "mm-2" is "mm⁻²"."""
    return str(text).translate(_SUPERSCRIPTS)


def _is_number(value):
    return value is not None and isfinite(value)


def _exact(value):
    """The 15 decimal digits that a double holds for certain."""
    return Decimal(f"{float(value):.15g}")


def _mantissa(value, digits):
    """Number, its decimals and the power of ten set apart, for so many significant digits."""
    number = _exact(value)
    if not number:
        return number, 0, 0
    exponent = _rounded(number, digits - 1 - number.adjusted()).adjusted()
    if exponent in WITHOUT_U:
        return number, max(digits - 1 - exponent, 0), 0
    return number.scaleb(-exponent, _WIDE), digits - 1, exponent


def _power(exponent):
    return f"\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10{superscript(exponent)}" if exponent else ""


def _decimals(u, significant, least):
    if u < 0:
        raise ValueError(f"uncertainty {u}: expected 0 or more")
    if significant < 1:
        raise ValueError(f"{significant} significant digits: expected 1 or more")
    if not u:
        return max(UNKNOWN_DECIMALS, least or 0)
    decimals = significant - 1 - u.adjusted()
    if _spread(u, decimals).adjusted() > u.adjusted():  # 0.0996 -> 0.10
        decimals -= 1
    return decimals if least is None else max(decimals, least)


def _spread(u, decimals):
    rounded = _rounded(u, decimals)
    if u and (u - rounded) / u > _LARGEST_LOSS:
        return _rounded(u, decimals, ROUND_UP)
    return rounded


def _rounded(number, decimals, rounding=ROUND_HALF_UP):
    return number.quantize(Decimal(1).scaleb(-decimals), rounding, _WIDE)


def _text(number, decimals, marks):
    """Digits with their marks; a zero has no sign."""
    rounded = _rounded(number, decimals)
    whole, _, behind = f"{rounded.copy_abs():f}".partition(".")
    if marks.group and len(whole) >= marks.least:
        whole = _grouped(whole[::-1], marks.group)[::-1]
    if marks.group and marks.of_decimals and len(behind) >= marks.least:
        behind = _grouped(behind, marks.group)
    sign = marks.minus if rounded < 0 else ""
    return sign + whole + (marks.decimal + behind if behind else "")


def _grouped(digits, mark):
    return mark.join(digits[i : i + 3] for i in range(0, len(digits), 3))


def _brackets(spread, decimals, marks):
    if decimals > 0 and spread < 1:
        return f"{spread.scaleb(decimals):f}"
    return _text(spread, decimals, marks)
