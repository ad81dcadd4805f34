"""Reading a table: ullage instead of dip, and the dip of a volume."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError
from tankcal.messages import message
from tankcal.text.digits import PROGRAM, format_with_u


@dataclass(frozen=True)
class Dips:
    """Dips of given volumes.

    Attributes
    ----------
    height_m : ndarray, shape (n,)
        The dips, m.
    u_m : ndarray, shape (n,)
        Their standard uncertainties, m.
    """

    height_m: np.ndarray
    u_m: np.ndarray

    def __str__(self):
        """One line for each dip: "6.4213 m, u = 0.0021 m"."""
        return "\n".join(map(_line_of, self.height_m, self.u_m))

    def __repr__(self):
        """The lines of `str`, as an interpreter shows them."""
        return str(self)


def _line_of(height_m, u_m):
    shown = format_with_u(height_m, u_m, PROGRAM, least=3)
    return f"{shown.value} m, u = {shown.uncertainty} m"


def ullage_m(reference_height_m, dip_m):
    """Height from the liquid up to the reference point: reference height - dip; or back again.

    Both directions are the same subtraction. Raises HeightError for a dip (ullage) below 0 or
    above the reference height.
    """
    dips = np.asarray(dip_m, dtype=float)
    outside = ~((dips >= 0) & (dips <= reference_height_m))
    if np.any(outside):
        raise HeightError(
            message(
                "dip_beyond_reference",
                "dip {dip_m:g} m is outside 0 to the reference height, {reference_m:g} m",
                dip_m=np.atleast_1d(dips)[np.atleast_1d(outside)][0],
                reference_m=reference_height_m,
            )
        )
    return reference_height_m - dips


def dips_of(height_m, volume_m3, factor_m3, wanted_m3):
    """`Dips` at which the table, read linearly between its rows, gives the wanted volumes.

    h = h_a + (V - V_a) (h_b - h_a) / (V_b - V_a),   u(h) = u(V) / ((V_b - V_a) / (h_b - h_a))

    A row itself is read with the slope of the interval below it, as in the table's own reading.

    Parameters
    ----------
    height_m, volume_m3 : array_like, shape (rows,)
        Dips, ascending, m, and volumes, m3.
    factor_m3 : array_like, shape (rows, inputs)
        Factor of the covariance of the rows: u(V) is that of the table at h.
    wanted_m3 : float or array_like, shape (n,)
        Volumes, m3.

    Returns
    -------
    Dips

    Raises
    ------
    HeightError
        For a volume outside the table, and for one that stands there at more than one height (rows
        of equal volume, or a volume that falls).

    Examples
    --------
    >>> found = dips_of([0.0, 1.0, 2.0], [0.0, 50.0, 100.0], [[0.1], [0.1], [0.1]], 75.0)
    >>> found
    1.5000 m, u = 0.0020 m
    >>> found.height_m, found.u_m
    (array([1.5]), array([0.002]))
    """
    heights, volumes = np.asarray(height_m, dtype=float), np.asarray(volume_m3, dtype=float)
    wanted = np.atleast_1d(np.asarray(wanted_m3, dtype=float))
    upper = _row_above(heights, volumes, wanted)
    lower = upper - 1
    step = heights[upper] - heights[lower]
    slope = (volumes[upper] - volumes[lower]) / step
    part = (wanted - volumes[lower]) / (volumes[upper] - volumes[lower])
    factor = np.asarray(factor_m3, dtype=float)
    columns = (1 - part)[:, None] * factor[lower] + part[:, None] * factor[upper]
    from_below, from_above = heights[lower] + part * step, heights[upper] - (1 - part) * step
    dips = np.where(part < 0.5, from_below, from_above)  # so that a row gives its own height
    return Dips(dips, np.sqrt(np.sum(columns**2, axis=1)) / slope)


def _row_above(heights, volumes, wanted):
    """(n,) first row that is not below each volume (1 for the first row of all).

    Raises HeightError where there is none, or more than one place in the table.
    """
    rising = np.maximum.accumulate(volumes)
    lasting = np.minimum.accumulate(volumes[::-1])[::-1]
    outside = ~((wanted >= lasting[0]) & (wanted <= rising[-1]))
    if np.any(outside):
        raise HeightError(
            message(
                "volume_outside_table",
                "volume {volume_m3:g} m3 is outside the capacity table ({first_m3:g} to "
                "{last_m3:g} m3)",
                volume_m3=wanted[outside][0],
                first_m3=lasting[0],
                last_m3=rising[-1],
            )
        )
    reached = np.searchsorted(rising, wanted, side="left")  # first row not below the volume
    left = np.searchsorted(lasting, wanted, side="right") - 1  # last row not above it
    unclear = left > reached
    if np.any(unclear):
        low, high = heights[reached[unclear][0]], heights[left[unclear][0]]
        raise HeightError(
            message(
                "volume_without_dip",
                "volume {volume_m3:g} m3 has no single dip: the table has it from "
                "{low_m:g} to {high_m:g} m",
                volume_m3=wanted[unclear][0],
                low_m=low,
                high_m=high,
            )
        )
    return np.clip(reached, 1, len(heights) - 1)
