"""Results of tickets: one row for each ticket, and the comparison with the other party."""

import os
from dataclasses import dataclass
from errno import EISDIR

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.quantity.chain import QUANTITIES, values_of
from tankcal.report.folders import replace_file
from tankcal.text.delimited import write_guarded

# First columns of `rows_of`, which identify a file that may be replaced.
_BEGINNINGS = (b"ticket,opening_tov_m3,", b"ticket,closing_tov_m3,")


@dataclass(frozen=True)
class Comparison:
    """Difference of a quantity from that of a meter or of the other party.

    Attributes
    ----------
    quantity, source : str
    difference : ndarray, shape (n,)
        Quantity of the ticket, without its sign, less that of the other party; m3 or kg. nan: no
        quantity of the other party.
    e_n : ndarray, shape (n,), or None
        Difference over the root of the sum of both squared U; None if the other U is not known.
    """

    quantity: str
    source: str
    difference: np.ndarray
    e_n: np.ndarray | None


def compare(tickets):
    """`Comparison` with the other party, or None if the tickets contain none."""
    if tickets.compared is None:
        return None
    quantity, values, other_u, source = tickets.compared
    result, place = tickets.quantities[tickets.result_state], QUANTITIES.index(quantity)
    difference = np.abs(result.value[:, place]) - values
    e_n = None
    if other_u is not None:
        both_u = np.hypot(result.U[:, place], other_u)
        e_n = np.where(both_u > 0, difference, np.nan) / np.where(both_u > 0, both_u, 1.0)
    return Comparison(quantity, source, difference, e_n)


def rows_of(tickets):
    """{column: value} of each ticket: steps, quantities, u and U, and the comparison.

    A number that does not exist, such as a difference without a quantity to compare with, is None.
    """
    columns = {"ticket": list(tickets.names)}
    for state, result in tickets.transfer.steps.items():
        for name, values in values_of(result).items():
            columns[f"{state}_{name}"] = values.tolist()
    for state, result in tickets.quantities.items():
        for place, name in enumerate(QUANTITIES):
            columns[f"{state}_{name}"] = result.value[:, place].tolist()
            columns[f"{state}_u_{name}"] = result.u[:, place].tolist()
            columns[f"{state}_U_{name}"] = result.U[:, place].tolist()
    if tickets.transfer.room_levels:
        rooms = tickets.transfer.rooms()
        for place, name in enumerate(tickets.transfer.room_levels):
            columns[f"closing_{name}_m3"] = rooms.value[:, place].tolist()
            columns[f"closing_U_{name}_m3"] = rooms.U[:, place].tolist()
    comparison = compare(tickets)
    if comparison is not None:
        columns[f"difference_{comparison.quantity}"] = _numbers(comparison.difference)
        if comparison.e_n is not None:
            columns["e_n"] = _numbers(comparison.e_n)
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _numbers(values):
    """Values as a list, with None for a value that is not finite."""
    return [value if np.isfinite(value) else None for value in values.tolist()]


def check_output(path):
    """Refuse a file that `write_rows` must not replace.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        For an existing file with other contents.
    IsADirectoryError
    """
    if path.is_dir():
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR), str(path))
    if not path.exists():
        return
    # A regular file is needed first: reading another one, such as a pipe, may never end.
    if path.is_file():
        with path.open("rb") as stream:
            start = stream.read(max(map(len, _BEGINNINGS)))
        if not start or start.startswith(_BEGINNINGS):
            return
    expected = message(
        "ticket_out_exists",
        "found a file that tankcal ticket did not write; expected a new name, or such a file",
    )
    raise InputError(Problem(str(path), expected))


def write_rows(path, rows):
    """Write the rows of `rows_of` to a CSV file, as a whole or not."""
    check_output(path)
    with (
        replace_file(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as stream,
    ):
        write_guarded(stream, [[*rows[0]], *(row.values() for row in rows)])
