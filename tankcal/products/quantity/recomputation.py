"""Computation of a saved ticket from its inputs and the record of its table."""

import numpy as np

from tankcal.messages import message
from tankcal.products.quantity.reading import read_tickets
from tankcal.products.quantity.saving import ticket_file
from tankcal.products.quantity.table import read_table
from tankcal.products.recomputing import compare_values, find_record
from tankcal.record.schema import to_plain
from tankcal.record.ticket import TICKET
from tankcal.tank.volume_correction.corrections import FactorTable


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
