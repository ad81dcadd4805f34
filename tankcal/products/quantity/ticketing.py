"""Tickets in Python (`tankcal.ticket`, `ticket` of a result), and again for `tankcal verify`."""

import numpy as np

from tankcal.messages import message
from tankcal.products.quantity.reading import read_tickets
from tankcal.products.quantity.results import ticket_file
from tankcal.products.quantity.table import read_table, table_of
from tankcal.products.recomputing import compare_values, find_record
from tankcal.record.schema import to_plain
from tankcal.record.ticket import TICKET
from tankcal.tank.volume_correction.corrections import FactorTable


def ticket(source, settings, rows=None):
    """Compute the quantity of a transfer or of a stock, with its uncertainty.

    Parameters
    ----------
    source : Result, dict or path
        Result of `tankcal.run`, record of `tankcal.record.load`, or a record.json or its folder.
    settings : path or dict
        ticket.toml, or its content as {section: {key: value}} (docs/ticket.md).
    rows : path, optional
        CSV file with a ticket in each row; its columns replace keys of `settings`.

    Returns
    -------
    Tickets
        `quantities`, `frame()`, `budget()`, `warnings`, and `write(folder)` for the document.

    Raises
    ------
    InputError
        With every problem of the inputs.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"), simulated=False)
    >>> product = {"correction": "D1250-04", "group": "products", "base": "20C",
    ...            "density_kg_m3": 840.4, "density_is": "base"}
    >>> transfer = tankcal.ticket(result, {
    ...     "product": product,
    ...     "opening": {"dip_m": 2.317, "temperature_c": 28.4, "ambient_c": 25.0},
    ...     "closing": {"dip_m": 8.642, "temperature_c": 31.2, "ambient_c": 29.0},
    ... })
    >>> print(transfer)
    1: NSV, closing less opening, 823.8 m3, U = 1.1 m3 (k = 1.96)
    >>> transfer.budget().index[0]  # the largest contribution to u
    'table'
    """
    return read_tickets(table_of(source), settings, rows)


def compute_again(saved, folder):
    """Compute a saved ticket again from its inputs and its record.

    Parameters
    ----------
    saved : dict
        Content of ticket.json.
    folder : Path
        Folder to be searched for the record: a record.json in it or in its subfolders.

    Returns
    -------
    numbers : int or None
        Number of the compared values; None: the record was not found.
    problems : list of Problem
        Differences.
    notes : list of Message
        Checks that were not possible.

    Raises
    ------
    InputError
        If the inputs are not those of a ticket.
    """
    path = find_record(folder, saved["table"]["sha256"])
    if path is None:
        text = message(
            "verify_record_not_found",
            "the record of {file} is not in the folder of the inputs ({folder}): its numbers were "
            "not computed again; --job FOLDER names another folder",
            file=TICKET.file, folder=str(folder),
        )  # fmt: skip
        return None, [], [text]
    factors = saved["factors"]
    if factors is not None:
        grid = (np.array(factors[key]) for key in ("density_kg_m3", "temperature_c", "factor"))
        factors = FactorTable(factors["file"], *grid, saved["inputs"]["product"].get("base"))
    tickets = read_tickets(read_table(path), saved["inputs"], factors=factors)
    again = to_plain(ticket_file(tickets))
    for name in ("format", "tankcal", "files", "warnings", "inputs"):
        del again[name]
    return *compare_values(TICKET.file, saved, again), []
