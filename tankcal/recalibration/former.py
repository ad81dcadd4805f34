"""A capacity table in SI units with its declared facts, from any laboratory or from tankcal."""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class FormerRoof:
    """Floating roof deducted in a table.

    Attributes
    ----------
    mass_kg : float
    density_kg_m3 : float
        Density of the liquid for which the displacement was computed.
    weighing : {"air", "vacuum"}
        How the mass was weighed.
    critical_m : (float, float) or None
        Dips between which the roof is partly afloat.
    """

    mass_kg: float
    density_kg_m3: float
    weighing: Literal["air", "vacuum"]
    critical_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class FormerTable:
    """An issued capacity table, heights rising.

    Attributes
    ----------
    name : str
        File (and sheet), for messages and reports.
    height_m, volume_m3 : (rows,) ndarray
        Dips (never ullages), strictly rising; volumes as printed.
    height_quantum_m, volume_quantum_m3 : float
        Value of the last printed digit; 0 if values are not rounded (a record, or heights with even
        steps, which are exact).
    U_m3 : (rows,) ndarray or None
        Expanded uncertainties; None if unknown.
    k : float
        Coverage factor.
    common : float or None
        Correlation of its errors with those of the table compared; None: not declared.
    reference_temperature_c : float or None
        Shell temperature of the table; None: unknown.
    liquid_density_kg_m3 : float or None
        Density of the head in the table; 0: no head; None: unknown.
    roof : FormerRoof or None
    reference_height_m : float or None
        From the dip plate to the reference point.
    date, method, laboratory, number : str or None
        As declared, or as in the record.
    kind : {"vertical", "horizontal", "sphere", "mesh"} or None
    dip_from_a_m : float or None
        Dip point of a lying tank, along the axis from the start of its cylinder; None: half the
        length.
    factor_m3 : (rows, inputs) ndarray or None
        For a record: covariance = factor factor'.
    record : dict or None
        The record from which the table was read, as plain data.
    height_rounding_m : (rows,) ndarray or None
        Largest rounding error of each height; 0 if the steps are even. None: heights are not
        rounded.
    row : (rows,) ndarray of int or None
        Row number of each row in the file.
    warnings : tuple of Problem
        Warnings of the linter and of reading.
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
