"""The expanded uncertainties that are printed, where they are not those of the table."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Printed:
    """U of rows and deliveries as papers print them: Monte Carlo's where the GUM's does not hold.

    Attributes
    ----------
    rows_m3 : ndarray, shape (rows,)
        U of the rows.
    by_gum : ndarray, shape (rows,), or None
        Whether it is the table's own; None: all.
    pairs_m3 : dict
        {(low_m, high_m): U} of the deliveries that were simulated.
    factor : float
        Of U of every other delivery: the largest that a simulated one needed whose volumes are
        smooth at both dips, at least 1.
    """

    rows_m3: np.ndarray
    by_gum: np.ndarray | None = None
    pairs_m3: dict = field(default_factory=dict)
    factor: float = 1.0

    def of(self, table, low_m, high_m, U_m3):
        """U of a volume (low_m None) or of a delivery, whose U by the table is U_m3.

        At a row its own; between two rows, of which one is not the table's, the largest of all.
        """
        if low_m is not None:
            return self.pairs_m3.get((low_m, high_m), self.factor * U_m3)
        rows = table.rows_of(high_m)
        if self.by_gum is None or np.all(self.by_gum[rows]):
            return U_m3
        largest = float(self.rows_m3[rows].max())
        return largest if len(rows) == 1 else max(U_m3, largest)


def printed_of_table(table):
    """`Printed` of a table by itself."""
    return Printed(table.U_m3)
