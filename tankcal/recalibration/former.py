"""A former capacity table in SI units, with what was declared of it: of any laboratory, or ours."""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class FormerRoof:
    """The floating roof that a table has deducted.

    Attributes
    ----------
    mass_kg : float
    density_kg_m3 : float
        Of the liquid that it was taken to float in.
    weighing : {"air", "vacuum"}
        How the mass was weighed.
    critical_m : (float, float) or None
        Dips between which it is partly afloat.
    """

    mass_kg: float
    density_kg_m3: float
    weighing: Literal["air", "vacuum"]
    critical_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class FormerTable:
    """A capacity table as it was handed out, heights rising.

    Attributes
    ----------
    name : str
        File (and sheet), for messages and papers.
    height_m, volume_m3 : (rows,) ndarray
        Dips, never ullages, strictly rising; volumes as printed.
    height_quantum_m, volume_quantum_m3 : float
        Value of the last printed digit; 0 where nothing was rounded (a record, or heights that
        rise by an even step: such rows stand where they say).
    U_m3 : (rows,) ndarray or None
        Expanded uncertainties; None where none is known.
    k : float
        Their coverage factor.
    common : float or None
        Correlation of its errors with those of the table that it is compared with; None: not
        declared.
    reference_temperature_c : float or None
        The shell's, that the table is for; None: not known.
    liquid_density_kg_m3 : float or None
        Of the head in the table; 0: without head; None: not known.
    roof : FormerRoof or None
    reference_height_m : float or None
        From the dip plate to the reference point.
    date, method, laboratory, number : str or None
        As declared, or as the record has them.
    kind : {"vertical", "horizontal", "sphere", "mesh"} or None
    dip_from_a_m : float or None
        Of a lying tank: the dip point, along the axis from the start of its cylinder; None: half
        the length.
    factor_m3 : (rows, inputs) ndarray or None
        Of a record: covariance = factor factor'.
    record : dict or None
        The record that it was read from, as plain data.
    height_rounding_m : (rows,) ndarray or None
        Largest rounding error of each height: 0 where the steps are even. None: none is rounded.
    row : (rows,) ndarray of int or None
        Where each row stands in the file.
    warnings : tuple of Problem
        What deserves a look: of the linter, and of reading.
    """

    name: str
    height_m: np.ndarray
    volume_m3: np.ndarray
    height_quantum_m: float = 0.0
    volume_quantum_m3: float = 0.0
    U_m3: np.ndarray | None = None
    k: float = 2.0
    common: float | None = None
    reference_temperature_c: float | None = None
    liquid_density_kg_m3: float | None = None
    roof: FormerRoof | None = None
    reference_height_m: float | None = None
    date: str | None = None
    method: str | None = None
    laboratory: str | None = None
    number: str | None = None
    kind: str | None = None
    dip_from_a_m: float | None = None
    factor_m3: np.ndarray | None = None
    record: dict | None = None
    height_rounding_m: np.ndarray | None = None
    row: np.ndarray | None = None
    warnings: tuple = ()
