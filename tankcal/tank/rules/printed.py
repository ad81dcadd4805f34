"""Printed expanded uncertainties, where they differ from those of the table."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Printed:
    """U of rows and deliveries as printed in reports: Monte Carlo where the GUM does not apply.

    Attributes
    ----------
    rows_m3 : ndarray, shape (rows,)
        U of the rows.
    by_gum : ndarray, shape (rows,), or None
        Whether U of a row is that of the table; None: all rows.
    pairs_m3 : dict
        {(low_m, high_m): U} of simulated deliveries.
    factor : float
        Factor on U of all other deliveries: the largest ratio among simulated deliveries with
        smooth volumes at both dips, at least 1.
    """

    rows_m3: np.ndarray
    by_gum: np.ndarray | None = None
    pairs_m3: dict = field(default_factory=dict)
    factor: float = 1.0

    def of(self, table, low_m, high_m, U_m3):
        """Return the printed U of a volume or of a delivery.

        Parameters
        ----------
        table : Capacity
        low_m : float or None
            Lower dip of a delivery, m; None: the volume below high_m.
        high_m : float
            Dip, m.
        U_m3 : float
            U of the table.

        Returns
        -------
        float
            For a delivery, the simulated U, otherwise `factor` times U of the table. For a volume
            at a row, U of the row. Between two rows, of which at least one differs from the table,
            the largest U of the rows and the table.
        """
        if low_m is not None:
            return self.pairs_m3.get((low_m, high_m), self.factor * U_m3)
        rows = table.rows_of(high_m)
        if self.by_gum is None or np.all(self.by_gum[rows]):
            return U_m3
        largest = float(self.rows_m3[rows].max())
        return largest if len(rows) == 1 else max(U_m3, largest)


def printed_of_table(table):
    """Return the `Printed` with the uncertainties of the table."""
    return Printed(table.U_m3)
