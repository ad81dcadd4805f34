"""Checks of a certificate without record: its text, from any laboratory and in six languages.

Words are searched, so a requirement that is not found may be met in other words. The capacity table
is examined by the linter.
"""

import re

from tankcal.errors import InputError
from tankcal.messages import message
from tankcal.products.assess.requirements import MAJOR, MINOR, OBSERVATION, Finding
from tankcal.products.assess.results import check_lint
from tankcal.products.assess.wording import (
    LABELS,
    claim_text,
    find_claim,
    find_interval,
    interval_text,
)
from tankcal.products.linter.linting import lint

# Expanded uncertainty with its number, such as "U = 0.5634 m³" or "± 1,234 L".
_STATED_U = re.compile(r"(?:\bU\s*=|±)\s*(\d+(?:[.,]\d+)?)(?!\d|\s*°|\s*K\b)")
# Value and U of a result, such as "1369.66 m³ ± 0.56 m³" or "V = ... with U = ...".
_RESULT = re.compile(
    r"(\d+[.,]\d+|\d+)\s*(m³|m3|L|l|bbl)\s+(?:±|with\s+U\s*=|com\s+U\s*=|con\s+U\s*=)\s*"
    r"(\d+[.,]\d+|\d+)\s*\2"
)
_RULES = re.compile(r"decision rule|regra de decisão|regla de decisión|règle de décision|ILAC-?G8"
                    r"|guard band|banda de guarda|entscheidungsregel", re.IGNORECASE)  # fmt: skip
MOST_DIGITS = 2  # significant digits of U, ILAC-P14


def check_labels(evidence):
    """Yield each requirement whose words the text does not contain."""
    text = "\n".join(evidence.certificate.pages)
    for name, pattern in LABELS.items():
        if not re.search(pattern, text, re.IGNORECASE):
            missing = message("assess_not_found", "no words for it in the text")
            yield Finding(missing, MINOR, evidence.certificate.name, section=name)


def check_claims(evidence):
    """Yield a statement of conformity without a decision rule in the text."""
    if any(map(_RULES.search, evidence.certificate.pages)):
        return
    for page, text in enumerate(evidence.certificate.pages, 1):
        if words := find_claim(" ".join(text.split())):
            yield Finding(claim_text(words), MAJOR, evidence.certificate.name, page)


def check_interval(evidence):
    """Yield an interval of calibration that a page states without its reason."""
    for page, text in enumerate(evidence.certificate.pages, 1):
        if words := find_interval(" ".join(text.split())):
            yield Finding(interval_text(words), MINOR, evidence.certificate.name, page)


def check_digits(evidence):
    """Yield printed U with more than two significant digits, and values with other decimals."""
    for page, text in enumerate(evidence.certificate.pages, 1):
        for match in _STATED_U.finditer(text):
            if count_digits(match[1]) > MOST_DIGITS:
                long = message(
                    "assess_digits", "U has more than two significant digits: {text}",
                    text=" ".join(match[0].split()),
                )  # fmt: skip
                yield Finding(long, MAJOR, evidence.certificate.name, page)
        for match in _RESULT.finditer(text):
            if _decimals(match[1]) != _decimals(match[3]):
                apart = message(
                    "assess_decimals", "the value and its U end at different decimals: {text}",
                    text=" ".join(match[0].split()),
                )  # fmt: skip
                yield Finding(apart, MINOR, evidence.certificate.name, page)


def check_table(evidence):
    """Yield the errors of the capacity table; an observation if there is no table."""
    certificate = evidence.certificate
    try:
        findings = lint(certificate.path).findings
    except InputError:
        text = message("assess_no_rows", "no capacity table could be read from the text")
        yield Finding(text, OBSERVATION, certificate.name)
        return
    yield from check_lint(findings, certificate.name)


def count_digits(number):
    """Count the significant digits of a printed number, without final zeros of an integer.

    Examples
    --------
    >>> [count_digits(number) for number in ("0.56", "0.5634", "420", "1,50", "0.050")]
    [2, 4, 2, 3, 2]
    """
    digits = re.sub(r"[.,]", "", number).lstrip("0")
    return len(digits if re.search(r"[.,]", number) else digits.rstrip("0"))


def _decimals(number):
    return len(re.split(r"[.,]", number)[1]) if re.search(r"[.,]", number) else 0
