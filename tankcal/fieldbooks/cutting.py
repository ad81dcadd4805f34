"""Numbers that were cut short: a file that broke off, or was spoilt, within a number.

An instrument writes each kind of number with the same decimals, zeros at the end too. A number with
FEWER decimals less than the median of its kind was not written by it. What counts is what stands
there, not the value: 290.0000 is whole, 290. is not.
"""

import re
from statistics import median

from tankcal.messages import message

FEWER = 3  # decimals; fewer where the median has fewer than these are not judged


def tell_cut_numbers(book, log):
    """Tell each number of a book that its reader handed to `FieldBook.keep_text`."""
    told = {one.row for one in log.problems if one.file == book.file}
    for column, texts in book.texts.items():
        decimals = [_decimals(text) for text, _ in texts]
        usual = median(decimals)
        if usual < FEWER or _is_without_zeros(texts, decimals, usual):
            continue
        for (text, row), count in zip(texts, decimals, strict=True):
            if count <= usual - FEWER and row not in told:
                expected = message(
                    "cut_short",
                    "found {text!r}; expected {usual:.0f} decimals as elsewhere in the file: cut"
                    " short?",
                    text=text[:40],
                    usual=usual,
                )
                log.problem(book.file, expected, row, column)


def _decimals(text):
    """How many digits stand behind the last mark of decimals."""
    _, mark, behind = text.replace(",", ".").rpartition(".")
    return sum(one.isdigit() for one in behind) if mark else 0


def _is_without_zeros(texts, decimals, usual):
    """Whether the file leaves out zeros at the end: some numbers are a little short, none has 0."""
    whole = [text for (text, _), count in zip(texts, decimals, strict=True) if count >= usual]
    are_uneven = any(usual - FEWER < count < usual for count in decimals)
    return are_uneven and not any(re.search(r"0\D*$", text) for text in whole)
