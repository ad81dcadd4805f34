"""What a job declares about uncertainty, in SI."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class DeclaredInput:
    """A standard uncertainty that the survey itself does not carry: a row of uncertainty.csv.

    u is SI (dimensionless for "scale", "tilt" and "deadwood", m, K, 1/K, Pa, kg, kg/m3, m3), of a
    t distribution what `u_is` says, "scale" or "sd"; `u_as_read` is the same in
    `unit`, as the user wrote it.
    is_default  True: nobody declared it, tankcal assumes it
    """

    name: str
    u: float
    unit: str
    u_as_read: float
    type: str = "B"
    distribution: str = "normal"
    dof: float = np.inf
    note: str = ""
    is_default: bool = False
    u_is: str = "scale"


@dataclass(frozen=True)
class StatedVolume:
    """A dip whose volume is reported with its budget; with low_m a delivery (stated.csv).

    high_m, low_m  dips, from the table's zero
    volume_m3      that another table or a contract states, or None
    row, file      where it stands; a sheet of a workbook is "sheet stated"
    """

    high_m: float
    low_m: float | None = None
    volume_m3: float | None = None
    note: str = ""
    row: int | None = None
    file: str = field(default="stated.csv", compare=False)
