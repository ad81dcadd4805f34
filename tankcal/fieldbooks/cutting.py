"""Detection of truncated numbers in a file that is incomplete or damaged.

An instrument writes each kind of number with a constant number of decimals, including zeros. A
number with at least FEWER decimals less than the median of its kind is therefore truncated. Only
the text counts: 290.0000 is complete, 290. is not. Files of two programs, or with records in two
forms, have two frequent numbers of decimals. Such numbers are read as written.
"""

import re
from collections import Counter
from statistics import median

from tankcal.messages import message

FEWER = 3  # missing decimals of a truncated number; fields with a smaller median are not tested
OFTEN, SHARE = 3, 0.1  # count and share of a field that make a number of decimals regular


def tell_cut_numbers(book, log):
    """Report each truncated number among the texts of `FieldBook.keep_text`."""
    reported_rows = {problem.row for problem in log.problems if problem.file == book.file}
    for column, texts in book.texts.items():
        decimals = [_decimals(text) for text, _ in texts]
        usual = median(decimals)
        if usual < FEWER or _is_without_zeros(texts, decimals, usual):
            continue
        counts = Counter(decimals)
        ways = {count for count, times in counts.items() if times >= max(OFTEN, SHARE * len(texts))}
        short = [count for count in sorted(ways) if count <= usual - FEWER]
        if short:
            text = message(
                "ways_of_writing",
                "numbers of {column} with {short} and with {usual:.0f} decimals, each frequent: "
                "read as written",
                column=column,
                short=", ".join(map(str, short)),
                usual=usual,
            )
            book.note(text)
        for (text, row), count in zip(texts, decimals, strict=True):
            if count <= usual - FEWER and count not in ways and row not in reported_rows:
                expected = message(
                    "cut_short",
                    "found {text!r} with {count} decimals; expected {usual:.0f}: {many} of the "
                    "{all} numbers of this field have at least that many (truncated? If the "
                    "number is correct, add its zeros)",
                    text=text[:40],
                    count=count,
                    usual=usual,
                    many=sum(number >= usual for number in decimals),
                    all=len(texts),
                )
                log.problem(book.file, expected, row, column)


def _decimals(text):
    """Return the number of digits after the last decimal mark."""
    _, mark, behind = text.replace(",", ".").rpartition(".")
    return sum(character.isdigit() for character in behind) if mark else 0


def _is_without_zeros(texts, decimals, usual):
    """Return whether the file omits final zeros: some numbers are short, none ends with 0."""
    whole = [text for (text, _), count in zip(texts, decimals, strict=True) if count >= usual]
    are_uneven = any(usual - FEWER < count < usual for count in decimals)
    return are_uneven and not any(re.search(r"0\D*$", text) for text in whole)
