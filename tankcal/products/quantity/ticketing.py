"""Tickets in Python: `tankcal.ticket`, and the method `ticket` of a result."""

from tankcal.products.quantity.reading import read_tickets
from tankcal.products.quantity.table import table_of


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
