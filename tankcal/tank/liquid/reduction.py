"""Metered rows as steps between dips, brought to the temperature of the table.

    rho(Tm) [f (1 + g) v + n] = rho(T_k) W_k - rho(T_k-1) W_k-1,   W = c(Ts) V(h),
    rho(T) = rho_0 (1 - b (T - T_0))

Over rho(T_k) c_k: a step is  f v m / c_k = V(h_k) - q_k V(h_k-1)  with m = rho(Tm) / rho(T_k) and
q = rho(T_k-1) c_k-1 / (rho(T_k) c_k). What is metered less the right side is its misclosure.

Source: conservation of mass; ISO 4269:2001 and API MPMS 12 for the corrections that it stands for.
"""

from dataclasses import dataclass, replace

import numpy as np

EMPTY = -1  # in place of the dip that a step began at: the tank was empty and dry


@dataclass(frozen=True)
class Fill:
    """The steps of all runs, between the dips that count.

    Attributes
    ----------
    runs : tuple of str
        Names; meters likewise.
    dip_row : ndarray of int, shape (d,)
        Row of the metering of each dip that counts.
    start, end : ndarray of int, shape (n,)
        Dips that a step began and ended at, as places in `dip_row`; EMPTY: began in the empty tank.
    run : ndarray of int, shape (n,)
        Place of its run in `runs`.
    batches : ndarray of bool, shape (n, rows)
        Rows whose volumes belong to each step: several, where dips between them do not count.
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
        """(n,) bool: which steps began in the empty tank."""
        return self.start == EMPTY

    def differences(self, carried=None):
        """(n, d) matrix T of V(h_k) - q_k V(h_k-1); carried (n,) q, None: 1."""
        matrix, rows = np.zeros((len(self), len(self.dip_row))), np.arange(len(self))
        matrix[rows, self.end] = 1.0
        filled = ~self.from_empty
        q = np.ones(len(self)) if carried is None else carried
        matrix[rows[filled], self.start[filled]] = -q[filled]
        return matrix


def fill_of(metering):
    """`Fill` of metered rows.

    Parameters
    ----------
    metering : object
        With run, meter, dip_m, used as `job.model.liquid.Metering` has them: a run's rows follow
        one another, its first is its start; a blank dip there means the empty tank. Where a row is
        not used, its dip does not count, but its volume went in.

    Returns
    -------
    Fill
    """
    runs = tuple(dict.fromkeys(metering.run))
    dips, steps = [], []
    for number, run in enumerate(runs):
        before, rows = None, []
        for place in (i for i, name in enumerate(metering.run) if name == run):
            is_first = before is None and not rows
            if not is_first or metering.volume_m3[place]:
                rows.append(place)
            known = metering.used[place] and np.isfinite(metering.dip_m[place])
            if is_first and metering.used[place] and not known:
                before, rows = EMPTY, []
            elif known:
                if before is not None:
                    steps.append((before, len(dips), number, rows))
                before, rows = len(dips), []
                dips.append(place)
    batches = np.zeros((len(steps), len(metering.run)), dtype=bool)
    for line, (_, _, _, rows) in zip(batches, steps, strict=True):
        line[rows] = True
    start, end, run = np.array([step[:3] for step in steps], dtype=int).reshape(-1, 3).T
    meters = tuple(dict.fromkeys(metering.meter))
    return Fill(runs, meters, np.array(dips, dtype=int), start, end, run, batches)


@dataclass(frozen=True)
class Reduced:
    """Steps at the temperature of the table, against the volumes of a geometry; m3, (n,) each.

    Attributes
    ----------
    indicated_m3 : ndarray
        As the meter showed it.
    by_factor_m3, by_meter_temperature_m3, by_shell_m3, by_tank_temperature_m3 : ndarray
        What each correction adds: the meter's factor; the liquid cooled or warmed on its way into
        the tank; the shell brought to the table's temperature; what was in the tank already and
        grew or shrank.
    increment_m3 : ndarray
        Their sum: the volume between the dips by liquid, under its load.
    geometry_m3 : ndarray
        The same by the geometry.
    misclosure_m3 : ndarray
        The former less the latter.
    metered_m3 : ndarray
        f v m / c: the part of the increment that goes with the meter.
    carried : ndarray
        q, by which the volume before the step counts.
    by_row_m3 : ndarray, shape (n, rows)
        `metered_m3` by the rows that it is of.
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
    """`Reduced` steps of metered rows.

    Parameters
    ----------
    metering : object
        As of `fill_of`, with volume_m3, meter_c, tank_c, meters, expansion_per_k, density_c.
    fill : Fill
    volume_m3 : array_like, shape (d,)
        By the geometry below each dip, loaded by the liquid there.
    growth : array_like, shape (d,), optional
        Factor of the volume below each dip by the shell's temperature; None: 1.

    Returns
    -------
    Reduced
    """
    volume = np.asarray(volume_m3, dtype=float)
    grown = np.ones(len(volume)) if growth is None else np.asarray(growth, dtype=float)
    factor = np.array([metering.meters[name].factor for name in metering.meter])
    indicated = np.where(fill.batches, metering.volume_m3, 0.0)
    tank = metering.tank_c[fill.dip_row]
    on_the_way = density_ratio(metering, metering.meter_c, tank[fill.end][:, None])
    shown = factor * indicated
    warmed = shown * on_the_way
    shell = grown[fill.end]
    before = np.where(fill.from_empty, 0.0, volume[fill.start])
    carried = density_ratio(metering, tank[fill.start], tank[fill.end])
    carried = np.where(fill.from_empty, 1.0, carried * grown[fill.start] / shell)
    by_tank = (carried - 1) * before
    by_row = warmed / shell[:, None]
    geometry = volume[fill.end] - before
    increment = by_row.sum(axis=1) + by_tank
    return Reduced(
        indicated_m3=indicated.sum(axis=1),
        by_factor_m3=(shown - indicated).sum(axis=1),
        by_meter_temperature_m3=(warmed - shown).sum(axis=1),
        by_shell_m3=(by_row - warmed).sum(axis=1),
        by_tank_temperature_m3=by_tank,
        increment_m3=increment,
        geometry_m3=geometry,
        misclosure_m3=increment - geometry,
        metered_m3=by_row.sum(axis=1),
        carried=carried,
        by_row_m3=by_row,
    )


def density_ratio(metering, warm_c, cold_c):
    """rho(warm) / rho(cold); 1 where either temperature is not known."""
    relative = [1 - metering.expansion_per_k * (t - metering.density_c) for t in (warm_c, cold_c)]
    ratio = relative[0] / relative[1]
    return np.where(np.isfinite(ratio), ratio, 1.0)


def load_densities(metering, fill):
    """(d,) density of the liquid at each dip, kg/m3; that declared where its warmth is unknown."""
    warm = metering.tank_c[fill.dip_row] - metering.density_c
    share = metering.expansion_per_k * np.where(np.isfinite(warm), warm, 0.0)
    return metering.density_kg_m3 * (1 - share)


def with_expansion(metering, expansion_per_k):
    """The same rows for another expansion of the liquid."""
    return replace(metering, expansion_per_k=expansion_per_k)
