"""Rounding of values and uncertainties for all reports.

The uncertainty has two significant digits, and the value ends at the same decimal (JCGM 100:2008
7.2.6). Both are rounded to nearest, with halves away from zero, on their 15 decimal digits, as
spreadsheets do: 2.675 is a half although its binary form is smaller. With two digits, rounding
down reduces U by at most 4.8 % (10.5 -> 10). U is rounded up where rounding would reduce it by more
than 5 %, which is possible with one digit (EA-4/02, 6.3).
"""

from dataclasses import dataclass
from decimal import ROUND_HALF_UP, ROUND_UP, Context, Decimal
from math import isfinite

NOTHING = "–"
# Rows of a table in m3 show litres, because deliveries have a smaller uncertainty.
LITRE_DECIMALS = 3
UNKNOWN_DECIMALS = 6  # decimals of a value without uncertainty
# Powers of ten of the first digit that need no separate power, with and without uncertainty
WITH_U, WITHOUT_U = range(-12, 15), range(-4, 6)
_LARGEST_LOSS = Decimal("0.05")
SIGNIFICANT = 2  # digits of u (JCGM 100:2008 7.2.6)
_WIDE = Context(prec=400)
_NEAR = 1e-7  # a mantissa, or a height in mm, this close to a bound is compared in decimals
# Scaled numbers up to this size differ from their 15 digits by less than the distance from a half.
_LARGEST_CLEAR, _NEAR_HALF = 1e10, 1e-3
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Marks:
    """Decimal mark, group mark and minus sign of numbers.

    Attributes
    ----------
    decimal : str
        Decimal mark.
    group : str
        Mark between groups of three digits; "" for no groups.
    least : int
        Smallest number of digits of a grouped integer part: with 5, 1234 is not grouped.
    of_decimals : bool
        Whether digits after the decimal mark are grouped (SI Brochure 5.4.4).
    minus : str
        Sign of a negative value.
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
PROGRAM = Marks(minus="-")  # CSV and other machine-readable output


@dataclass(frozen=True)
class Written:
    """Formatted value and uncertainty with the same last decimal.

    Attributes
    ----------
    value, uncertainty : str
        Separate texts without the power of ten; NOTHING if unknown.
    power : str
        Common power of ten, " × 10ⁿ", or "".
    both : str
        "12.345 ± 0.067", with a power of ten "(1.234 ± 0.056) × 10²⁰".
    concise : str
        "12.345(67)" (JCGM 100 7.2.2); "12.3(1.2)" if U has a digit before the decimal mark; the
        value alone if the uncertainty is unknown.
    decimals : int
        Digits after the decimal mark; negative for rounded integer digits.
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
    """Format a value with its standard or expanded uncertainty, both in one unit.

    Parameters
    ----------
    value : float or None
        None, nan and inf are formatted as NOTHING.
    u : float or None
        Not negative. None, nan and inf: unknown; 0: exact. The value then has UNKNOWN_DECIMALS.
    marks : Marks
    significant : int
        Significant digits of u, at least 1.
    least : int or None
        Smallest number of decimals: 0 keeps whole units (12 346 ± 1 235 instead of 12 300 ± 1 200),
        3 keeps litres. None: determined by u only.
    written_out : range
        Powers of ten of the first digit (of the larger number) that need no separate power.

    Returns
    -------
    Written

    Raises
    ------
    ValueError
        u is negative.
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
    """Return the number of decimals that show u with `significant` digits, at least `least`.

    If `least` is None the result may be negative. The result is UNKNOWN_DECIMALS if u is 0, None or
    not finite. It serves number formats of cells. Raises ValueError for a negative u.
    """
    return _decimals(_exact(u if _is_number(u) else 0.0), significant, least)


def round_u(u):
    """Round u to the printed value, such as 417 to 420; None if u is unknown."""
    if not _is_number(u):
        return None
    exact = _exact(u)
    return float(_spread(exact, _decimals(exact, SIGNIFICANT, None))) if exact else 0.0


def bound_of_decimals(decimals):
    """Return the bound of u below which `decimals_of` gives at least this number of decimals."""
    return (10**SIGNIFICANT - 0.5) / 10.0**decimals


def decimals_of_mantissa(value, u):
    """Return the decimals of the mantissa of `value` that end at the last digit of u, at least 0.

    For number formats with a power of ten (1.742E-03). The result is UNKNOWN_DECIMALS if u is 0 or
    unknown.
    """
    if not (_is_number(u) and u and _is_number(value) and value):
        return UNKNOWN_DECIMALS
    last = _decimals(_exact(u), SIGNIFICANT, None)
    return max(_round(_exact(value), last).adjusted() + last, 0)


def decimals_of_rows(
    uncertainties, *, significant=SIGNIFICANT, least=0, most=None, unknown=UNKNOWN_DECIMALS
):
    """Return the number of decimals of each row of a column, from the uncertainty of the row.

    A row without an uncertainty (0, None or nan: the empty tank) has the decimals of the next row,
    else of the previous row.

    Parameters
    ----------
    uncertainties : sequence of (float or None)
    significant : int
        Significant digits of an uncertainty.
    least : int
        Smallest number of decimals.
    most : int, optional
        Largest number of decimals, for uncertainties that may be rounding errors of exact values.
    unknown : int
        Decimals of all rows if no row has an uncertainty.

    Returns
    -------
    list of int
    """
    import numpy as np

    u = np.array(uncertainties, dtype=float)
    known = np.flatnonzero(np.isfinite(u) & (u != 0))
    if not len(known):
        return [unknown] * len(u)
    decimals = np.array(decimals_of_each(u[known], significant=significant, least=least))
    if most is not None:
        decimals = np.minimum(decimals, most)
    following = np.searchsorted(known, np.arange(len(u)))
    return decimals[np.minimum(following, len(known) - 1)].tolist()


def decimals_of_each(uncertainties, *, significant=SIGNIFICANT, least=0):
    """Return `decimals_of` for each uncertainty of a column (list of int)."""
    import numpy as np

    u = np.array(uncertainties, dtype=float)
    is_clear = (u > 1e-200) & (u < 1e200)  # powers of ten beyond would underflow or overflow
    size = np.where(is_clear, u, 1.0)
    exponent = np.floor(np.log10(size)).astype(int)
    mantissa = size / 10.0**exponent
    # Only numbers next to a power of ten, or to the half below it, require decimal arithmetic.
    # With a single digit, uncertainties may also be rounded up.
    half = 10 - 0.5 * 10.0 ** (1 - significant)
    for bound in (1.0, half, 10.0):
        is_clear &= (np.abs(mantissa - bound) > _NEAR) & (significant > 1)
    decimals = significant - 1 - exponent - (mantissa > half)
    if least is not None:
        decimals = np.maximum(decimals, least)
    decimals = decimals.tolist()
    for i in np.flatnonzero(~is_clear):
        decimals[i] = decimals_of(uncertainties[i], significant=significant, least=least)
    return decimals


def decimals_of_heights(heights_m):
    """Return `decimals_of_height` for each height of a column (list of int)."""
    import numpy as np

    millimetres = 1000 * np.array(heights_m, dtype=float)
    is_whole = np.abs(millimetres - np.rint(millimetres)) < _NEAR
    return [3 if whole else decimals_of_height(height)
            for height, whole in zip(heights_m, is_whole.tolist(), strict=True)]  # fmt: skip


def decimals_of_height(height_m):
    """Return the decimals of a height in metres: 3, or up to 5 if these are not zeros."""
    shown = round(height_m, 5)
    return next((d for d in (3, 4) if round(height_m, d) == shown), 5)


def fixed(value, decimals, marks=ENGLISH):
    """Format `value` with a number of decimals (0 or more), without a minus sign before zero."""
    return _text(_exact(value), decimals, marks) if _is_number(value) else NOTHING


def fixed_rows(values, decimals, marks=ENGLISH):
    """Format each value of a column as `fixed` does with the decimals of its row (list of str)."""
    import numpy as np

    size = np.abs(np.array(values, dtype=float))
    places = np.array(decimals, dtype=float)
    scaled = size * 10.0**places
    # Binary numbers round as their 15 digits do, except next to halves; nan is never clear.
    is_clear = (scaled < _LARGEST_CLEAR) & (places >= 0)
    is_clear[is_clear] = np.abs(scaled[is_clear] % 1 - 0.5) > _NEAR_HALF
    rows = zip(values, size.tolist(), scaled.tolist(), decimals, is_clear.tolist(), strict=True)
    return [
        (marks.minus if value < 0 and units > 0.5 else "") + _mark(f"{number:.{places}f}", marks)
        if clear
        else fixed(value, places, marks)
        for value, number, units, places, clear in rows
    ]


def format_significant(value, digits, marks=ENGLISH):
    """Format `value` with a number of significant digits, without rounding integer digits.

    For values without a stated uncertainty, and for uncertainties. Powers of ten outside WITHOUT_U
    are separate. None, nan and inf are formatted as NOTHING.
    """
    if not _is_number(value):
        return NOTHING
    number, decimals, exponent = _mantissa(value, digits)
    return _text(number, decimals, marks) + _power(exponent)


def shortest(value, marks=ENGLISH, *, digits=6):
    """Format `value` as `format_significant` does, without trailing zeros."""
    if not _is_number(value):
        return NOTHING
    number, decimals, exponent = _mantissa(value, digits)
    needed = -_round(number, decimals).normalize(_WIDE).as_tuple().exponent
    return _text(number, max(needed, 0), marks) + _power(exponent)


def superscript(text):
    """Convert digits and hyphens to superscripts: "mm-2" to "mm⁻²"."""
    return str(text).translate(_SUPERSCRIPTS)


def _is_number(value):
    """Return whether a value is a finite number."""
    return value is not None and isfinite(value)


def _exact(value):
    """Return the decimal number of the 15 digits that a double represents reliably."""
    return Decimal(f"{float(value):.15g}")


def _mantissa(value, digits):
    """Return (number, decimals, separate power of ten) for a number of significant digits."""
    number = _exact(value)
    if not number:
        return number, 0, 0
    exponent = _round(number, digits - 1 - number.adjusted()).adjusted()
    if exponent in WITHOUT_U:
        return number, max(digits - 1 - exponent, 0), 0
    return number.scaleb(-exponent, _WIDE), digits - 1, exponent


def _power(exponent):
    """Format a power of ten; "" for the power 0."""
    return f"\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10{superscript(exponent)}" if exponent else ""


def _decimals(u, significant, least):
    """Return the decimals that show u with a number of significant digits."""
    if u < 0:
        raise ValueError(f"uncertainty {u}: expected 0 or more")
    if significant < 1:
        raise ValueError(f"{significant} significant digits: expected 1 or more")
    if not u:
        return max(UNKNOWN_DECIMALS, least or 0)
    decimals = significant - 1 - u.adjusted()
    # 0.0996 -> 0.10; only digits that begin with 9 can be rounded to the next power of ten.
    if u.as_tuple().digits[0] == 9 and _spread(u, decimals).adjusted() > u.adjusted():
        decimals -= 1
    return decimals if least is None else max(decimals, least)


def _spread(u, decimals):
    """Round an uncertainty to a number of decimals; up, where rounding loses more than 5 %."""
    rounded = _round(u, decimals)
    if u and (u - rounded) / u > _LARGEST_LOSS:
        return _round(u, decimals, ROUND_UP)
    return rounded


def _round(number, decimals, rounding=ROUND_HALF_UP):
    """Round a number to a number of decimals, halves away from zero."""
    return number.quantize(Decimal(1).scaleb(-decimals), rounding, _WIDE)


def _text(number, decimals, marks):
    """Digits with their marks; a zero has no sign."""
    rounded = _round(number, decimals)
    sign = marks.minus if rounded < 0 else ""
    return sign + _mark(f"{rounded.copy_abs():f}", marks)


def _mark(digits, marks):
    """Set the decimal mark and the group marks of a number without sign, such as "12345.6"."""
    if not marks.group:
        return digits.replace(".", marks.decimal)
    whole, _, behind = digits.partition(".")
    if len(whole) >= marks.least:
        whole = _group_digits(whole[::-1], marks.group)[::-1]
    if marks.of_decimals and len(behind) >= marks.least:
        behind = _group_digits(behind, marks.group)
    return whole + (marks.decimal + behind if behind else "")


def _group_digits(digits, mark):
    return mark.join(digits[i : i + 3] for i in range(0, len(digits), 3))


def _brackets(spread, decimals, marks):
    if decimals > 0 and spread < 1:
        return f"{spread.scaleb(decimals):f}"
    return _text(spread, decimals, marks)
