"""Reduction of metered rows to steps between dips, at the temperature of the table.

    rho(Tm) [f (1 + g) v + n] = rho(T_k) W_k - rho(T_k-1) W_k-1,   W = c(Ts) V(h),
    rho(T) = rho_0 (1 - b (T - T_0))

Division by rho(T_k) c_k gives a step  f v m / c_k = V(h_k) - q_k V(h_k-1)  with m = rho(Tm) /
                                       rho(T_k) and q = rho(T_k-1) c_k-1 / (rho(T_k) c_k). The
                                       metered volume less the right side is the misclosure.

Source: conservation of mass; ISO 4269:2001 and API MPMS 12 for the corrections that it replaces.
"""

from dataclasses import dataclass, replace

import numpy as np

MOST_ROWS = 3000  # largest number of rows of liquid.csv; the adjustment uses dense matrices
EMPTY = -1  # start of a step in the empty, dry tank, in place of the index of a dip


@dataclass(frozen=True)
class Fill:
    """Steps of all runs between valid dips.

    Attributes
    ----------
    runs, meters : tuple of str
        Names of the runs and of the meters.
    dip_row : ndarray of int, shape (d,)
        Row of the metering of each valid dip.
    start, end : ndarray of int, shape (n,)
        Dips at the start and end of each step, as indices of `dip_row`; EMPTY: start in the empty
        tank.
    run : ndarray of int, shape (n,)
        Index of the run of each step in `runs`.
    batches : ndarray of bool, shape (n, rows)
        Rows whose volumes belong to each step: several rows if the dips between them are not valid.
    """

    runs: tuple[str, ...]
    meters: tuple[str, ...]
    dip_row: np.ndarray
    start: np.ndarray
    end: np.ndarray
    run: np.ndarray
    batches: np.ndarray

    def __len__(self):
        """Number of steps."""
        return len(self.end)

    @property
    def from_empty(self):
        """Steps (n,) that start in the empty tank."""
        return self.start == EMPTY

    def differences(self, carried=None):
        """Return the matrix T (n, d) of V(h_k) - q_k V(h_k-1); carried (n,) is q, None: 1."""
        matrix, rows = np.zeros((len(self), len(self.dip_row))), np.arange(len(self))
        matrix[rows, self.end] = 1.0
        filled = ~self.from_empty
        q = np.ones(len(self)) if carried is None else carried
        matrix[rows[filled], self.start[filled]] = -q[filled]
        return matrix


def fill_of(metering):
    """Return the `Fill` of metered rows.

    Parameters
    ----------
    metering : object
        Object with run, meter, dip_m, used, as in `methods.liquid.readings.Metering`. The rows of a
        run are consecutive and the first row is its start; a blank dip there denotes the empty
        tank. The dip of an unused row is ignored, but its volume entered the tank.

    Returns
    -------
    Fill
    """
    runs = tuple(dict.fromkeys(metering.run))
    dips, steps = [], []
    for number, run in enumerate(runs):
        start_dip, rows = None, []
        for place in (i for i, name in enumerate(metering.run) if name == run):
            is_first = start_dip is None and not rows
            if not is_first or metering.volume_m3[place]:
                rows.append(place)
            # A row without a valid dip extends the current step: its volume is added to the next
            # valid dip.
            is_valid = metering.used[place] and np.isfinite(metering.dip_m[place])
            if is_first and metering.used[place] and not is_valid:
                start_dip, rows = EMPTY, []
            elif is_valid:
                if start_dip is not None:
                    steps.append((start_dip, len(dips), number, rows))
                start_dip, rows = len(dips), []
                dips.append(place)
    batches = np.zeros((len(steps), len(metering.run)), dtype=bool)
    for line, (_, _, _, rows) in zip(batches, steps, strict=True):
        line[rows] = True
    start, end, run = np.array([step[:3] for step in steps], dtype=int).reshape(-1, 3).T
    meters = tuple(dict.fromkeys(metering.meter))
    return Fill(runs, meters, np.array(dips, dtype=int), start, end, run, batches)


@dataclass(frozen=True)
class ReducedSteps:
    """Steps at the temperature of the table, compared with a geometry; m3, (n,) each.

    Attributes
    ----------
    indicated_m3 : ndarray
        Indication of the meter.
    by_factor_m3, by_meter_temperature_m3, by_shell_m3, by_tank_temperature_m3 : ndarray
        Corrections: factor of the meter; cooling or warming of the liquid on its way into the tank;
        shell at the temperature of the table; expansion or contraction of the previous content.
    increment_m3 : ndarray
        Sum of indication and corrections: volume between the dips by liquid, under its load.
    geometry_m3 : ndarray
        Volume between the dips by the geometry.
    misclosure_m3 : ndarray
        Increment less geometry.
    metered_m3 : ndarray
        f v m / c: part of the increment that is proportional to the meter factor.
    carried : ndarray
        q, factor on the volume before the step.
    by_row_m3 : ndarray, shape (n, rows)
        `metered_m3` for each row of the metering.
    """

    indicated_m3: np.ndarray
    by_factor_m3: np.ndarray
    by_meter_temperature_m3: np.ndarray
    by_shell_m3: np.ndarray
    by_tank_temperature_m3: np.ndarray
    increment_m3: np.ndarray
    geometry_m3: np.ndarray
    misclosure_m3: np.ndarray
    metered_m3: np.ndarray
    carried: np.ndarray
    by_row_m3: np.ndarray


def reduce_steps(metering, fill, volume_m3, growth=None):
    """Return the `ReducedSteps` steps of metered rows.

    Parameters
    ----------
    metering : object
        As for `fill_of`, also with volume_m3, meter_c, tank_c, meters, expansion_per_k, density_c.
    fill : Fill
    volume_m3 : array_like, shape (d,)
        Volumes of the geometry below each dip, loaded by the liquid at the dip, m3.
    growth : array_like, shape (d,), optional
        Factor on the volume below each dip due to the temperature of the shell; None: 1.

    Returns
    -------
    ReducedSteps
    """
    volume = np.asarray(volume_m3, dtype=float)
    shell_factors = np.ones(len(volume)) if growth is None else np.asarray(growth, dtype=float)
    factor = np.array([metering.meters[name].factor for name in metering.meter])
    indicated = np.where(fill.batches, metering.volume_m3, 0.0)
    tank = metering.tank_c[fill.dip_row]
    meter_to_tank = density_ratio(metering, metering.meter_c, tank[fill.end][:, None])
    # Apply the corrections in turn, so that their sum is exactly the increment.
    at_meter = factor * indicated
    in_tank = at_meter * meter_to_tank
    shell = shell_factors[fill.end]
    previous = np.where(fill.from_empty, 0.0, volume[fill.start])
    # q of the module docstring; there is no previous content at a start from empty.
    carried = density_ratio(metering, tank[fill.start], tank[fill.end])
    carried = np.where(fill.from_empty, 1.0, carried * shell_factors[fill.start] / shell)
    by_tank = (carried - 1) * previous
    by_row = in_tank / shell[:, None]
    geometry = volume[fill.end] - previous
    increment = by_row.sum(axis=1) + by_tank
    return ReducedSteps(
        indicated_m3=indicated.sum(axis=1),
        by_factor_m3=(at_meter - indicated).sum(axis=1),
        by_meter_temperature_m3=(in_tank - at_meter).sum(axis=1),
        by_shell_m3=(by_row - in_tank).sum(axis=1),
        by_tank_temperature_m3=by_tank,
        increment_m3=increment,
        geometry_m3=geometry,
        misclosure_m3=increment - geometry,
        metered_m3=by_row.sum(axis=1),
        carried=carried,
        by_row_m3=by_row,
    )


def density_ratio(metering, warm_c, cold_c):
    """Return rho(warm) / rho(cold) of the liquid.

    Parameters
    ----------
    metering : object
        Object with expansion_per_k and density_c.
    warm_c, cold_c : ndarray
        Temperatures, degC; nan: unknown.

    Returns
    -------
    ndarray
        1 if either temperature is unknown.
    """
    relative = [1 - metering.expansion_per_k * (t - metering.density_c) for t in (warm_c, cold_c)]
    ratio = relative[0] / relative[1]
    return np.where(np.isfinite(ratio), ratio, 1.0)


def load_densities(metering, fill):
    """Return the density (d,) of the liquid at each dip, kg/m3.

    If the temperature is unknown, it is the declared density.
    """
    warm = metering.tank_c[fill.dip_row] - metering.density_c
    share = metering.expansion_per_k * np.where(np.isfinite(warm), warm, 0.0)
    return metering.density_kg_m3 * (1 - share)


def with_expansion(metering, expansion_per_k):
    """Return the rows with another expansion coefficient of the liquid."""
    return replace(metering, expansion_per_k=expansion_per_k)
