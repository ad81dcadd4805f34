"""Rows of the hidden sheet of workings, and the notation of their formulas.

In the texts of formulas, `[tov_c]` denotes the cell of a key, `[tov@]` the cell of the opening
(`[tov_o]`) or of the closing (`[tov_c]`), and `#fine` the number of a sentence.
"""

from dataclasses import dataclass

from tankcal.report.workbook.calculator.cells import is_no_number
from tankcal.text.digits import NOTHING

STATES = ("o", "c")  # opening and closing
NONE = f'"{NOTHING}"'


@dataclass(frozen=True)
class Cell:
    """Cell with a formula and its result for a blank form."""

    key: str
    formula: str
    result: float | str = NOTHING


@dataclass(frozen=True)
class Row:
    """Row of the workings: symbol, cells from column B, and the key of a label after the symbol."""

    symbol: str
    cells: tuple[Cell, ...]
    label: str = ""


def cell_row(key, symbol, formula, result=NOTHING):
    """Row with a common cell of both states."""
    return Row(symbol, (Cell(key, formula, result),))


def state_row(key, symbol, formula, result=NOTHING):
    """Row with a cell for each state; the results may differ, as a pair."""
    results = result if isinstance(result, tuple) else (result, result)
    return Row(
        symbol,
        tuple(
            Cell(f"{key}_{state}", formula.replace("@", f"_{state}"), value)
            for state, value in zip(STATES, results, strict=True)
        ),
    )


def first_true(cases, otherwise):
    """Formula of the sentence of the first condition that is true; `cases` are pairs."""
    formula = otherwise
    for condition, sentence in reversed(cases):
        formula = f"IF({condition},#{sentence},{formula})"
    return formula


def choice_code(cell, names):
    """Formula of the place of a choice in a named list; 0: blank, -1: not in the list."""
    return f"IF(ISBLANK({cell}),0,IF(ISNUMBER(MATCH({cell},{names},0)),MATCH({cell},{names},0),-1))"


def fault(cell, low, high):
    """Condition that a cell contains no number from `low` to `high`."""
    return f"OR({is_no_number(cell)},{cell}<{low},{cell}>{high})"
