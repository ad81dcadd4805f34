"""HyTD of gauges supported by the shell: downward movement of their reference by the head.

A shell that bulges becomes shorter (membrane, no axial load). With radius r and plate t of a
course:

    shortening(L) = sum over the courses of nu rho g / (E t) * integral of (L - z) r dz

The gauge applies C = 0 for L < L_0, C = -(L - L_0) D for L >= L_0, the two-parameter line nearest
to this curve. It corrects the level shown by the gauge, independently of the head in the table.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.units import STANDARD_GRAVITY

POISSON = 0.3  # Poisson's ratio of the shell
_SAMPLES = 150  # number of levels at which the line is compared with the curve


@dataclass(frozen=True)
class GaugeCorrection:
    """The line C = -(L - L_0) D of a gauge, and its largest distance from the movement.

    Attributes
    ----------
    start_m : float
        L_0, the level below which the correction is 0.
    factor : float
        D, metres of movement per metre of level.
    off_m : float
        Largest distance of the line from the movement.
    """

    start_m: float
    factor: float
    off_m: float


def shortening_m(level_m, courses, density_kg_m3, e_pa, zero_m=0.0):
    """Shortening of the shell at each level, m.

    Parameters
    ----------
    level_m : array_like, shape (n,)
        Dips.
    courses : sequence of (height_m, thickness_m, radius_m)
        From the bottom up.
    density_kg_m3, e_pa : float
        Density of the liquid, and Young's modulus of the shell.
    zero_m : float, optional
        Height of the zero of dips above the bottom.

    Examples
    --------
    >>> shortening = shortening_m([8.0], [(8.0, 0.008, 7.2)], 1000, 206e9)
    >>> print((1000 * shortening).round(3))  # nu rho g r h^2 / (2 E t)
    [0.411]
    """
    surface = np.asarray(level_m, dtype=float) + zero_m
    total, bottom = np.zeros_like(surface), 0.0
    for height, thickness, radius in courses:
        deep, shallow = (np.maximum(surface - z, 0) for z in (bottom, bottom + height))
        # integral of (L - z) r dz over the wet part of the course, divided by t
        total += radius * (deep**2 - shallow**2) / (2 * thickness)
        bottom += height
    return POISSON * density_kg_m3 * STANDARD_GRAVITY / e_pa * total


def gauge_correction(top_m, courses, density_kg_m3, e_pa, zero_m=0.0):
    """Return the `GaugeCorrection` nearest to the shortening at all levels up to the top.

    Parameters
    ----------
    top_m : float
        Highest dip.
    courses, density_kg_m3, e_pa, zero_m
        As in `shortening_m`.
    """
    from scipy.optimize import linprog, minimize_scalar

    even = np.linspace(0.0, top_m, _SAMPLES + 1)

    def best(start):
        """(D, largest distance) of the best line from a level on, by linear programming."""
        level = np.append(even, start)
        true = shortening_m(level, courses, density_kg_m3, e_pa, zero_m)
        rise, scale = np.maximum(level - start, 0), true.max()
        # Minimise the bound e with -e <= D rise - movement <= e; unknowns D and e.
        rows = np.column_stack([np.append(rise, -rise), np.full(2 * len(rise), -1.0)])
        solution = linprog([0, 1], rows, np.append(true, -true) / scale, bounds=[(0, None)] * 2)
        return solution.x * scale

    starts = np.linspace(0.0, 0.9 * top_m, 31)
    nearest = int(np.argmin([best(start)[1] for start in starts]))
    bounds = starts[max(nearest - 1, 0)], starts[min(nearest + 1, 30)]
    start = minimize_scalar(lambda level: best(level)[1], bounds=bounds, method="bounded").x
    factor, off = best(start)
    return GaugeCorrection(float(start), float(factor), float(off))
