"""Reading of a table: ullage instead of dip, and the dip of a volume."""

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
        Dips, m.
    u_m : ndarray, shape (n,)
        Standard uncertainties of the dips, m.
    """

    height_m: np.ndarray
    u_m: np.ndarray

    def __str__(self):
        """Return one line for each dip: "6.4213 m, u = 0.0021 m"."""
        return "\n".join(map(_line_of, self.height_m, self.u_m))

    def __repr__(self):
        """Return the lines of `str`, for interactive sessions."""
        return str(self)


def _line_of(height_m, u_m):
    """Return a dip and its standard uncertainty as text."""
    formatted = format_with_u(height_m, u_m, PROGRAM, least=3)
    return f"{formatted.value} m, u = {formatted.uncertainty} m"


def ullage_m(reference_height_m, dip_m):
    """Return the ullage, reference height - dip, or the dip from the ullage.

    Both conversions are the same subtraction. Raises HeightError for a dip (ullage) below 0 or
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
    """Return the `Dips` at which the table, interpolated linearly, gives the wanted volumes.

    h = h_a + (V - V_a) (h_b - h_a) / (V_b - V_a),   u(h) = u(V) / ((V_b - V_a) / (h_b - h_a))

    At a row, the slope is that of the interval below, as in the reading of the table.

    Parameters
    ----------
    height_m, volume_m3 : array_like, shape (rows,)
        Dips, ascending, m, and volumes, m3.
    factor_m3 : array_like, shape (rows, inputs)
        Factor of the covariance of the rows, which gives u(V) of the table at h.
    wanted_m3 : float or array_like, shape (n,)
        Volumes, m3.

    Returns
    -------
    Dips

    Raises
    ------
    HeightError
        For a volume outside the table, or with more than one height (rows of equal volume, or a
        volume that falls).

    Examples
    --------
    >>> dips = dips_of([0.0, 1.0, 2.0], [0.0, 50.0, 100.0], [[0.1], [0.1], [0.1]], 75.0)
    >>> dips
    1.5000 m, u = 0.0020 m
    >>> dips.height_m, dips.u_m
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
    # The factor at the dip is interpolated like the volume.
    columns = (1 - part)[:, None] * factor[lower] + part[:, None] * factor[upper]
    from_below, from_above = heights[lower] + part * step, heights[upper] - (1 - part) * step
    dips = np.where(part < 0.5, from_below, from_above)  # exact at both rows
    return Dips(dips, np.sqrt(np.sum(columns**2, axis=1)) / slope)


def _row_above(heights, volumes, wanted):
    """Return the first row (n,) not below each volume (1 for the first row).

    Raises HeightError if no such row exists, or if the volume occurs at several heights.
    """
    # Envelopes of the volumes from below and above: they differ where the table is not ascending.
    rising = np.maximum.accumulate(volumes)
    falling = np.minimum.accumulate(volumes[::-1])[::-1]
    outside = ~((wanted >= falling[0]) & (wanted <= rising[-1]))
    if np.any(outside):
        raise HeightError(
            message(
                "volume_outside_table",
                "volume {volume_m3:g} m3 is outside the capacity table ({first_m3:g} to "
                "{last_m3:g} m3)",
                volume_m3=wanted[outside][0],
                first_m3=falling[0],
                last_m3=rising[-1],
            )
        )
    first = np.searchsorted(rising, wanted, side="left")  # first row not below the volume
    last = np.searchsorted(falling, wanted, side="right") - 1  # last row not above it
    unclear = last > first
    if np.any(unclear):
        low, high = heights[first[unclear][0]], heights[last[unclear][0]]
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
    return np.clip(first, 1, len(heights) - 1)
