"""What a wrong number was meant to be: slips of the pen that lead to the expected value."""

from itertools import pairwise

from tankcal.messages import message


def suggestion(text, expected, tolerance, decimals):
    """(number as text, what the slip was), or None.

    text       as written, decimal point, no thousands marks
    expected   value from the neighbouring rows, and how far it may be off
    decimals   that the other rows have
    The nearest of the one-digit slips is taken, else of the others in this order: two digits
    changed places, a decimal mark moved, a digit missing, a digit too many.
    """
    for slip, candidates in (
        (message("slip_one_digit", "one digit"), _one_digit(text)),
        (message("slip_transposed", "two digits changed places"), _transposed(text)),
        (message("slip_decimal_mark", "the decimal mark"), _moved_mark(text, decimals)),
        (message("slip_digit_missing", "a digit is missing"), _inserted(text)),
        (message("slip_digit_too_many", "a digit too many"), _removed(text)),
    ):
        good = [
            (abs(float(candidate) - expected), candidate)
            for candidate in candidates
            if candidate != text
            and _is_written_so(candidate, decimals)
            and abs(float(candidate) - expected) <= tolerance
        ]
        if good:
            return min(good)[1], slip
    return None


def _is_written_so(text, decimals):
    """Whether people write it so: no needless zero before it, no more decimals than usual."""
    whole, _, part = text.partition(".")
    return not (whole[:1] == "0" and len(whole) > 1) and len(part) <= decimals


def _one_digit(text):
    return [
        text[:k] + digit + text[k + 1 :]
        for k, char in enumerate(text)
        if char.isdigit()
        for digit in "0123456789"
    ]


def _transposed(text):
    places = [k for k, char in enumerate(text) if char.isdigit()]
    found = []
    for a, b in pairwise(places):
        chars = list(text)
        chars[a], chars[b] = chars[b], chars[a]
        found.append("".join(chars))
    return found


def _moved_mark(text, decimals):
    value = float(text)
    return [f"{value * 10.0**power:.{decimals}f}" for power in (-6, -3, -2, -1, 1, 2, 3, 6)]


def _inserted(text):
    return [
        text[:k] + digit + text[k:]
        for k in range(len(text) + 1)
        if k or text[:1].isdigit()
        for digit in "0123456789"
    ]


def _removed(text):
    return [
        text[:k] + text[k + 1 :]
        for k, char in enumerate(text)
        if char.isdigit() and sum(c.isdigit() for c in text) > 1
    ]
