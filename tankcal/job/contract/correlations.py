"""correlations.csv: its columns; pairs of declared inputs, each once, and possible together."""

from tankcal.gum.distributions import Normal
from tankcal.job.contract.shorthand import choice, number
from tankcal.job.contract.uncertainty import INPUTS
from tankcal.messages import message
from tankcal.uncertainty import Input, Inputs

CORRELATED = tuple(name for name, one in INPUTS.items() if one.correlates)

COLUMNS = (
    choice("input", "an input of uncertainty.csv", CORRELATED, required=True),
    choice("with", "another input, correlated with the first", CORRELATED, required=True),
    number("r", "coefficient of correlation of the two inputs", -1, 1, required=True),
)


def check_correlations(table, inputs, raw, log):
    """Pairs of inputs of uncertainty.csv, each once, whose coefficients can hold together.

    inputs  uncertainty.csv, or None: not there or unreadable
    """
    before = len(log.problems)
    known = _declared(inputs, raw)
    pairs, first_row = {}, {}
    for row, one, other, r in zip(table.rows, *map(table.of, ("input", "with", "r")), strict=True):
        for column, name in (("input", one), ("with", other)):
            if None not in (known, name) and name not in known:
                expected = message(
                    "correlation_unknown",
                    "found {name}; expected an input of {of}",
                    name=name,
                    of=raw.file_of("uncertainty"),
                )
                log.problem(table.file, expected, row, column)
        if one is not None and one == other:
            expected = message(
                "correlation_with_itself", "found {one} again; expected another input", one=one
            )
            log.problem(table.file, expected, row, "with")
        pair = frozenset((one, other))
        if None not in pair and pair in first_row:
            expected = message(
                "correlation_twice",
                "{one} and {other} are already in row {first_row}; expected once",
                one=one,
                other=other,
                first_row=first_row[pair],
            )
            log.problem(table.file, expected, row, "with")
        first_row.setdefault(pair, row)
        pairs[one, other] = r
    if len(log.problems) == before and not (table.skipped or None in _flat(pairs)):
        _check_together(table, pairs, log)


def _declared(inputs, raw):
    """Names of the declared inputs; None where some of them could not be read."""
    if inputs is None:
        is_there = "uncertainty" in raw.tables
        return None if is_there else ()
    names = inputs.of("input")
    return None if inputs.skipped or None in names else names


def _flat(pairs):
    return [*(name for pair in pairs for name in pair), *pairs.values()]


def _check_together(table, pairs, log):
    """Is the matrix of all coefficients positive semidefinite?"""
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
