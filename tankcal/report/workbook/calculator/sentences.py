"""Sentences of the calculator on its input, with numbers.

The first sentences concern valid input; all others begin with the word for "refused".
"""

from tankcal.report.workbook.calculator import service
from tankcal.report.workbook.calculator.service import SHELL_C
from tankcal.text.digits import fixed, shortest
from tankcal.text.words import marks_of

GOOD = (
    "within", "fine", "shell_fine", "wanted_within", "not_used", "product_none", "density_left_out",
    "head_single", "head_unknown", "head_applied", "delivery", "no_delivery",
)  # fmt: skip
REFUSED = (
    "dip_blank", "no_number", "below", "above", "critical", "wanted_blank", "wanted_below",
    "wanted_above", "wanted_critical", "no_single_dip", "volumes_fall", "shell_blank",
    "shell_range", "product_unknown", "density_blank", "density_range", "liquid_blank",
    "liquid_range", "factor_blank", "factor_range", "head_outside", "swapped",
)  # fmt: skip
KEYS = (*GOOD, *REFUSED)


def number(key):
    """Return the number of a sentence, from 1."""
    return KEYS.index(key) + 1


def sentences(book, table):
    """Return all sentences in the order of `KEYS` (list of str)."""
    marks = marks_of(book.words)
    heights, volumes = table.height_m, table.volume_m3
    critical = table.critical or (0.0, 0.0)
    values = {
        "first": fixed(heights[0], table.digits, marks),
        "last": fixed(heights[-1], table.digits, marks),
        "least": fixed(min(volumes), 3, marks),
        "most": fixed(max(volumes), 3, marks),
        "critical_low": fixed(critical[0], table.digits, marks),
        "critical_high": fixed(critical[1], table.digits, marks),
        "light": shortest(min(table.densities), marks),
        "heavy": shortest(max(table.densities), marks),
        "own": shortest(table.densities[0], marks),
        "cold": shortest(service.LEAST_C, marks),
        "hot": shortest(service.MOST_C, marks),
        "shell_cold": shortest(SHELL_C[0], marks),
        "shell_hot": shortest(SHELL_C[1], marks),
        "temperature": shortest(table.job["table"]["reference_temperature_c"], marks),
        "densities": book.sheet_name("other_densities"),
        "deliveries": book.sheet_name("deliveries"),
    }
    texts = [book.word(f"sentences.{key}", of="calculator", **values) for key in KEYS]
    refused = refused_word(book)
    return [
        f"{refused} {text}" if key in REFUSED else text
        for key, text in zip(KEYS, texts, strict=True)
    ]


def refused_word(book):
    """Return the first word of all refusals."""
    return book.word("texts.refused", of="calculator")
