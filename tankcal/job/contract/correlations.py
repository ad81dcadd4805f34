"""Columns of correlations.csv, and checks of its pairs of declared inputs."""

from tankcal.gum.distributions import Normal
from tankcal.job.contract.shorthand import choice, number
from tankcal.job.contract.uncertainty import INPUTS
from tankcal.messages import message
from tankcal.uncertainty import Input, Inputs

CORRELATED = tuple(name for name, declarable in INPUTS.items() if declarable.correlates)

COLUMNS = (
    choice("input", "an input of uncertainty.csv", CORRELATED, required=True),
    choice("with", "another input, correlated with the first", CORRELATED, required=True),
    number("r", "coefficient of correlation of the two inputs", -1, 1, required=True),
)


def check_correlations(table, inputs, raw, log):
    """Check that each pair is declared once and that the correlation matrix is valid.

    Parameters
    ----------
    table : ColumnValues
        Rows of correlations.csv.
    inputs : ColumnValues or None
        Rows of uncertainty.csv; None if missing or unreadable.
    raw, log
        Raw job, and log of its problems.
    """
    before = len(log.problems)
    known = _declared(inputs, raw)
    pairs, first_row = {}, {}
    for row, first, second, r in zip(
        table.rows, *map(table.of, ("input", "with", "r")), strict=True
    ):
        for column, name in (("input", first), ("with", second)):
            if None not in (known, name) and name not in known:
                expected = message(
                    "correlation_unknown",
                    "found {name}; expected an input of {of}",
                    name=name,
                    of=raw.file_of("uncertainty"),
                )
                log.problem(table.file, expected, row, column)
        if first is not None and first == second:
            expected = message(
                "correlation_with_itself", "found {one} again; expected another input", one=first
            )
            log.problem(table.file, expected, row, "with")
        pair = frozenset((first, second))
        if None not in pair and pair in first_row:
            expected = message(
                "correlation_twice",
                "{one} and {other} are already in row {first_row}; expected once",
                one=first,
                other=second,
                first_row=first_row[pair],
            )
            log.problem(table.file, expected, row, "with")
        first_row.setdefault(pair, row)
        pairs[first, second] = r
    if len(log.problems) == before and not (
        table.skipped or None in [*(name for pair in pairs for name in pair), *pairs.values()]
    ):
        _check_together(table, pairs, log)


def _declared(inputs, raw):
    """Return the names of the declared inputs; None if some of them could not be read."""
    if inputs is None:
        is_there = "uncertainty" in raw.tables
        return None if is_there else ()
    names = inputs.of("input")
    return None if inputs.skipped or None in names else names


def _check_together(table, pairs, log):
    """Check that the matrix of all coefficients is positive semidefinite."""
    names = dict.fromkeys(name for pair in pairs for name in pair)
    try:
        Inputs([Input(name, Normal(1.0)) for name in names], pairs)
    except ValueError as error:
        expected = message(
            "correlations_impossible",
            "{error}; expected coefficients that are possible together",
            error=str(error),
        )
        log.problem(table.file, expected, None, "r")
