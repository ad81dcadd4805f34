"""Results of tickets: one row for each ticket, and the comparison with the other party."""

from dataclasses import dataclass

import numpy as np

from tankcal.products.quantity.chain import QUANTITIES, values_of
from tankcal.text.delimited import write_guarded


@dataclass(frozen=True)
class Comparison:
    """Difference of a quantity from that of a meter or of the other party.

    Attributes
    ----------
    quantity, source : str
    difference : ndarray, shape (n,)
        Quantity of the ticket, without its sign, less that of the other party; m3 or kg.
    e_n : ndarray, shape (n,), or None
        Difference over the root of the sum of both squared U; None if the other U is not known.
    """

    quantity: str
    source: str
    difference: np.ndarray
    e_n: np.ndarray | None


def compare(tickets, quantities):
    """`Comparison` with the other party, or None if the tickets contain none."""
    if tickets.compared is None:
        return None
    quantity, values, other_u, source = tickets.compared
    result, place = quantities.get("moved", quantities["closing"]), QUANTITIES.index(quantity)
    difference = np.abs(result.value[:, place]) - values
    e_n = None if other_u is None else difference / np.hypot(result.U[:, place], other_u)
    return Comparison(quantity, source, difference, e_n)


def rows_of(tickets, quantities, steps):
    """{column: value} of each ticket: steps, quantities, u and U, and the comparison."""
    columns = {"ticket": list(tickets.names)}
    for state, result in steps.items():
        for name, values in values_of(result).items():
            columns[f"{state}_{name}"] = values.tolist()
    for state, result in quantities.items():
        for place, name in enumerate(QUANTITIES):
            columns[f"{state}_{name}"] = result.value[:, place].tolist()
            columns[f"{state}_u_{name}"] = result.u[:, place].tolist()
            columns[f"{state}_U_{name}"] = result.U[:, place].tolist()
    comparison = compare(tickets, quantities)
    if comparison is not None:
        columns[f"difference_{comparison.quantity}"] = comparison.difference.tolist()
        if comparison.e_n is not None:
            columns["e_n"] = comparison.e_n.tolist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def write_rows(path, rows):
    """Write the rows of `rows_of` to a CSV file."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        write_guarded(stream, [[*rows[0]], *(row.values() for row in rows)])
