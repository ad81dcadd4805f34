"""Validation of files kept by an earlier batch: outcomes and rows of the summary.

Users can edit both. Invalid data are treated as missing: the job is computed again, and no change
is reported.
"""

from functools import cache
from math import isfinite

from tankcal.report.batch.paper import OF_RULE
from tankcal.text.words import load_words

TEXTS = ("tank", "kind", "date", "rule", *OF_RULE)
NUMBERS = ("height_m", "volume_m3", "U_m3", "former_m3", "of_tank_m3")
PLACES = ("book", "column", "cell")
PASSED = "global_test"  # the only Boolean verdict


def is_step(step):
    """Return whether the attributes of a `StepOutcome` have valid types."""
    return (
        isinstance(step.key, str)
        and isinstance(step.status, str)
        and step.status in codes("statuses")
        and isinstance(step.files, list)
        and all(isinstance(name, str) for name in step.files)
        and isinstance(step.values, dict)
        and are_values(step.values)
        and all(isinstance(rows, list) for rows in (step.problems, step.warnings))
        and all(map(is_problem, (*step.problems, *step.warnings)))
        and all(map(_is_count, (step.problem_count, step.warning_count)))
    )


def is_row(row):
    """Return whether a row of a summary can be compared with another row."""
    return (
        isinstance(row, dict)
        and isinstance(row.get("name"), str)
        and isinstance(row.get("status"), str)
        and row["status"] in codes("statuses")
        and are_values(row)
    )


def are_values(values):
    """Return whether the numbers, texts and verdicts among values are valid."""
    return (
        all(_is_number(values.get(name)) for name in NUMBERS)
        and all(_is_text(values.get(name)) for name in TEXTS if name != PASSED)
        and isinstance(values.get(PASSED), bool | None)
        and all(
            values.get(name) is None or values[name].lower() in codes(words)
            for name, words in OF_RULE.items()
            if name != PASSED
        )
    )


def is_problem(plain):
    """Return whether plain data have the form of `errors.problem_of`."""
    return (
        isinstance(plain, dict)
        and isinstance(plain.get("file"), str)
        and all(_is_text(plain.get(name)) for name in PLACES)
        and isinstance(plain.get("row"), int | None)
        and _is_message(plain)
    )


def _is_message(plain):
    return (
        isinstance(plain.get("text"), str)
        and _is_text(plain.get("code"))
        and isinstance(plain.get("values"), dict)
        and all(map(_can_be_said, plain["values"].values()))
    )


def _can_be_said(value):
    if isinstance(value, list):
        return all(map(_can_be_said, value))
    return _is_message(value) if isinstance(value, dict) else True


def _is_number(value):
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return value is None or (is_number and abs(value) < 1e300 and isfinite(value))


def _is_text(value):
    return isinstance(value, str | None)


def _is_count(value):
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


@cache
def codes(words):
    """Return the codes of the summary with words: of "statuses" or of a verdict."""
    return frozenset(load_words("en")["batch"][words])
