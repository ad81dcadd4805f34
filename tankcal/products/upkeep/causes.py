"""Causes of the misclosures of everyday steps, with a column and a prior for each.

    N_k+1 - N_k + sum_j (1 + g_j) v_j c(Tm_j) + lambda_t dt + lambda_v v - (1 + b) D c(T_d) = errors
    N = stock at the base temperature, by the table at the level, shell and liquid corrected
    level = indication - z0 - s h - wander - bends - own error

The misclosure is delivered less sold less the increase of the stock. A column is its change for a
standard deviation of a cause. Losses, which have a sign, enter with their mean.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.products.quantity.chain import table_shell_factor
from tankcal.products.upkeep.filtering import Drift
from tankcal.products.upkeep.saved import hash_arrays
from tankcal.tank.service import shell_factor

YEAR_S = 365.25 * 86400
BENDS = 4  # waves of the deviation of the gauge along the tank
LEVEL_STEP_M = 1e-3  # half step of the derivative of the stock by the level
LAST_KEPT = 1e-5  # smallest cause of the table, relative to the largest, that is kept

# Standard uncertainties where upkeep.toml declares none. All are assumptions of tankcal.
PRIORS = {
    "station": {
        "gauge_zero_mm": 2.0, "gauge_scale_ppm": 150.0, "gauge_bend_mm": 0.4,
        "gauge_wander_mm": 0.25, "gauge_wander_days": 5.0, "level_mm": 0.12,
        "meter_percent": 0.15, "meters_common_percent": 0.02, "meter_walk_ppm": 500.0,
        "meter_wear_ppm": 250.0, "u_meter_wear_ppm": 250.0, "meter_repeatability_percent": 0.02,
        "temperature_k": 0.3, "layer_k": 0.4, "layer_h": 12.0,
        "line_k": 1.0, "line_season_k": 1.0, "air_percent": 12.0, "u_air_percent": 8.0,
        "loss_l_h": 0.04, "u_loss_l_h": 0.03, "vapour_percent": 0.05, "u_vapour_percent": 0.03,
        "ticket_percent": 0.15, "ticket_own_percent": 0.25, "ticket_temperature_k": 3.0,
        "hose_l": 4.0, "u_hose_l": 10.0,
    },
    "terminal": {
        "gauge_zero_mm": 2.0, "gauge_scale_ppm": 100.0, "gauge_bend_mm": 0.5,
        "gauge_wander_mm": 0.3, "gauge_wander_days": 5.0, "level_mm": 0.7,
        "meter_percent": 0.1, "meters_common_percent": 0.03, "meter_walk_ppm": 200.0,
        "meter_wear_ppm": 0.0, "u_meter_wear_ppm": 0.0, "meter_repeatability_percent": 0.01,
        "temperature_k": 0.25, "layer_k": 0.15, "layer_h": 12.0,
        "line_k": 0.25, "line_season_k": 0.0, "air_percent": 0.0, "u_air_percent": 0.0,
        "loss_l_h": 5.0, "u_loss_l_h": 5.0, "vapour_percent": 0.0, "u_vapour_percent": 0.0,
        "ticket_percent": 0.03, "ticket_own_percent": 0.01, "ticket_temperature_k": 0.25,
        "hose_l": 0.0, "u_hose_l": 0.0,
    },
}  # fmt: skip


@dataclass(frozen=True)
class Meter:
    """Certificate of a meter.

    Attributes
    ----------
    name : str
    factor : float
        Volume over indication.
    u_factor : float or None
        None: no certificate; the prior of meters applies.
    walk, wear, u_wear : float or None
        Relative, per root of a year and per year; None: the priors apply.
    """

    name: str
    factor: float = 1.0
    u_factor: float | None = None
    walk: float | None = None
    wear: float | None = None
    u_wear: float | None = None


class TableStock:
    """Stock of a tank by its capacity table, whose causes are the columns of its covariance.

    Parameters
    ----------
    table : quantity.table.TankTable
    expansion_per_k : float
        Cubic expansion of the liquid.
    base_c : float
        Base temperature.
    """

    kind = "table"

    def __init__(self, table, expansion_per_k, base_c):
        self.table, self.expansion_per_k, self.base_c = table, expansion_per_k, base_c
        # This covariance with as few columns as it has dimensions.
        _, sizes, turn = np.linalg.svd(table.factor_m3, full_matrices=False)
        kept = sizes > LAST_KEPT * np.max(sizes, initial=0.0)
        self.turn = turn[kept]
        self.factor_m3 = table.factor_m3 @ self.turn.T
        self.names = tuple(f"table {number + 1}" for number in range(int(kept.sum())))

    def volume_m3(self, level_m, x):
        """Volume of the table at levels (n,), with its causes at x (c,)."""
        return self.table.volume(level_m) + self.columns(level_m, x) @ x

    def columns(self, level_m, x):
        """Columns (n, c) of the causes at levels, at the estimates x."""
        return self.table.factor(level_m) @ self.turn.T

    def stock_m3(self, level_m, temperature_c, x):
        """Volume at the base temperature of liquid at levels and temperatures (n,)."""
        shell = table_shell_factor(self.table, level_m, temperature_c, self.table.expansion_per_k)
        return self.volume_m3(level_m, x) * shell * self.liquid_factor(temperature_c)

    def correction(self, temperature_c):
        """Factor from a volume of the table to the base temperature, for columns of causes."""
        shell = shell_factor(temperature_c, self.table.temperature_c, self.table.expansion_per_k)
        return shell * self.liquid_factor(temperature_c)

    def liquid_factor(self, temperature_c):
        """Factor from an observed volume of liquid to the base temperature."""
        return 1 / (1 + self.expansion_per_k * (temperature_c - self.base_c))


@dataclass(frozen=True)
class Causes:
    """Constant causes: names, kinds and standard deviations in their units.

    Attributes
    ----------
    names, kinds, units : tuple of str
    sd, mean : ndarray, shape (c,)
        Prior in the unit.
    """

    names: tuple
    kinds: tuple
    units: tuple
    sd: np.ndarray
    mean: np.ndarray

    def place(self, kind):
        """Indices of the causes of a kind."""
        return np.flatnonzero(np.array(self.kinds) == kind)


@dataclass(frozen=True)
class Balance:
    """Steps linearised at estimates.

    Attributes
    ----------
    misclosure_m3 : ndarray, shape (n,)
        At the adjusted levels, with the linear effect of all estimates restored.
    columns_m3 : ndarray, shape (n, c)
    causes : Causes
    drift : Drift
    level_m : ndarray, shape (m,)
        Adjusted levels of the marks.
    """

    misclosure_m3: np.ndarray
    columns_m3: np.ndarray
    causes: Causes
    drift: Drift
    level_m: np.ndarray


@dataclass
class Operation:
    """Tank in service: stock, meters and priors.

    Attributes
    ----------
    stock : TableStock or station.LyingStock
    meters : dict of {str: Meter}
    priors : dict
        Keys of PRIORS.
    air : tuple of (ndarray, ndarray) or None
        Times, nanoseconds UTC, and temperatures of the air.
    is_net : dict
        {"meters" or "deliveries": whether volumes are at the base temperature already}.
    start_ns : int
        Time from which drifts count: the first mark of all logs.
    offsets_ns : tuple of int
        Times from which the gauge has a new offset.
    """

    stock: object
    meters: dict
    priors: dict
    air: tuple | None = None
    is_net: dict = field(default_factory=dict)
    start_ns: int | None = None
    offsets_ns: tuple = ()

    def fingerprint(self):
        """Content that the estimates depend on: table, meters, priors and air."""
        table = self.stock.table
        return [table.digest, self.stock.names, self.stock.expansion_per_k, self.stock.base_c,
                sorted(self.meters.items()), sorted(self.priors.items()),
                sorted(self.is_net.items()), self.start_ns, self.offsets_ns,
                self.air and [hash_arrays(values) for values in self.air]]  # fmt: skip

    def linearize(self, steps, estimate=None, smoothed=None):
        """Linearise steps at estimates.

        Parameters
        ----------
        steps : steps.Steps
        estimate : ndarray, shape (c,), optional
            Constant causes, in standard deviations; None: 0.
        smoothed : ndarray, shape (m, 3), optional
            Errors of the levels and temperatures of the marks; None: 0.

        Returns
        -------
        Balance
        """
        marks, prior = steps.marks, self.priors
        count = len(marks.time_ns)
        smoothed = np.zeros((count, 3)) if smoothed is None else smoothed
        years = self._years(marks)
        warm = fill_gaps(marks.time_ns, marks.temperature_c, self.stock.base_c)
        # At adjusted levels, as all columns: readings share their errors with the misclosures.
        own_error = smoothed[:, 0] + smoothed[:, 1]
        level_causes = self._level_causes(marks.level_m - own_error, marks.time_ns)
        shapes = len(self.stock.names)
        x = np.zeros(shapes + level_causes[0].shape[1]) if estimate is None else estimate
        moved = level_causes[0] @ x[shapes : shapes + level_causes[0].shape[1]]
        error = moved + own_error
        level, form = marks.level_m - error, x[:shapes]
        low, high = self.stock.table.height_m[[0, -1]]
        level = np.clip(level, low + LEVEL_STEP_M, high - LEVEL_STEP_M)
        # A layer raises the level of an equal stock, so that columns at this level share its error.
        # The level of this stock at the indicated temperature does not.
        stock, area = self.stock.stock_m3(level, warm, form), self._slope(level, warm, form)
        if smoothed[:, 2].any():
            of_layer = self.stock.stock_m3(level, warm + smoothed[:, 2], form) - stock
            level = np.clip(level + of_layer / area, low + LEVEL_STEP_M, high - LEVEL_STEP_M)
            stock, area = self.stock.stock_m3(level, warm, form), self._slope(level, warm, form)
        by_degree = self.stock.stock_m3(level, warm + 0.5, form) - self.stock.stock_m3(
            level, warm - 0.5, form
        )
        by_form = self.stock.columns(level, form) * self.stock.correction(warm)[:, None]
        groups = [
            (self.stock.kind, self.stock.names, "1", np.ones(shapes), np.zeros(shapes),
             np.diff(by_form, axis=0)),
            ("gauge", level_causes[1], level_causes[2], level_causes[3],
             np.zeros(level_causes[0].shape[1]),
             -np.diff(area[:, None] * level_causes[0], axis=0)),
            ("temperature", ("temperature_sensor",), "K", [prior["temperature_k"]], [0.0],
             prior["temperature_k"] * np.diff(by_degree)[:, None]),
        ]  # fmt: skip
        metered, flow_groups, noise = self._flows(steps, warm, years)
        delivered = self._deliveries(steps, warm)
        groups += flow_groups
        seconds, known = steps.seconds, 0.0
        for name, kind, unit, mean, sd, column in (
            ("loss_by_time", "loss", "L/h", prior["loss_l_h"], prior["u_loss_l_h"],
             seconds / 3.6e6),
            ("loss_by_throughput", "throughput", "%", prior["vapour_percent"],
             prior["u_vapour_percent"], metered.sum(axis=1) / 100),
            ("ticket_bias", "ticket", "%", 0.0, prior["ticket_percent"], -delivered / 100),
        ):  # fmt: skip
            groups.append((kind, (name,), unit, [sd], [mean], sd * column[:, None]))
            known = known + mean * column  # losses have a sign, and a mean
        groups = [group for group in groups if group[1] and np.any(np.asarray(group[3]) > 0)]
        causes = Causes(
            names=tuple(name for group in groups for name in group[1]),
            kinds=tuple(group[0] for group in groups for _ in group[1]),
            units=tuple(
                unit
                for group in groups
                for unit in (
                    group[2] if isinstance(group[2], tuple) else (group[2],) * len(group[1])
                )
            ),
            sd=np.concatenate([group[3] for group in groups]),
            mean=np.concatenate([group[4] for group in groups]),
        )
        columns = np.hstack([group[5] for group in groups])
        hose = steps.tickets * prior["hose_l"] / 1000
        misclosure = delivered - hose - metered.sum(axis=1) - np.diff(stock) - known
        # Estimates that were inserted are unknowns about 0: their linear effect is restored.
        used = shapes + level_causes[0].shape[1]
        misclosure = misclosure + columns[:, :used] @ x[:used]
        at_marks = area * own_error - by_degree * smoothed[:, 2]
        misclosure = misclosure - np.diff(at_marks)
        of_ticket = prior["ticket_own_percent"] / 100
        by_degree_ticket = self.stock.expansion_per_k * prior["ticket_temperature_k"]
        is_unmeasured = ~np.isfinite(steps.delivered_c) & (steps.tickets > 0)
        ticket_noise = delivered * np.hypot(
            of_ticket, np.where(is_unmeasured, by_degree_ticket, 0.0)
        )
        drift = Drift(
            seconds=seconds, area_m2=area, by_degree_m3=by_degree, metered_m3=metered,
            level_sd_m=np.hypot(marks.sd_m, prior["level_mm"] / 1000),
            layer_sd_k=np.where(steps.tickets > 0, prior["layer_k"], 0.0),
            noise_m3=np.sqrt(noise**2 + ticket_noise**2
                             + steps.tickets * (prior["u_hose_l"] / 1000) ** 2 + 1e-12),
            is_used=steps.is_used, wander_sd_m=prior["gauge_wander_mm"] / 1000,
            wander_s=prior["gauge_wander_days"] * 86400, layer_s=prior["layer_h"] * 3600,
            walk_per_s=np.array([self._meter(name).walk ** 2 for name in steps.meters]) / YEAR_S,
        )  # fmt: skip
        return Balance(misclosure, columns, causes, drift, level)

    def split_steps(self, steps):
        """Changes of the stock, metered and delivered volumes at the levels as read, (n,) each."""
        warm = fill_gaps(steps.marks.time_ns, steps.marks.temperature_c, self.stock.base_c)
        stock = self.stock.stock_m3(steps.marks.level_m, warm, np.zeros(len(self.stock.names)))
        metered = self._flows(steps, warm, self._years(steps.marks))[0].sum(axis=1)
        return np.diff(stock), metered, self._deliveries(steps, warm)

    def _years(self, marks):
        """Time of each mark since the time from which drifts count."""
        start = marks.time_ns[0] if self.start_ns is None else self.start_ns
        return (marks.time_ns - start) * 1e-9 / YEAR_S

    def _slope(self, level, temperature_c, form):
        """Change of the stock per metre of level, shape (m,)."""
        high, low = (self.stock.stock_m3(level + step, temperature_c, form)
                     for step in (LEVEL_STEP_M, -LEVEL_STEP_M))  # fmt: skip
        return (high - low) / (2 * LEVEL_STEP_M)

    def _meter(self, name):
        """`Meter` with the priors in place of blanks."""
        meter, prior = self.meters.get(name, Meter(name)), self.priors
        values = {
            "u_factor": prior["meter_percent"] / 100, "walk": prior["meter_walk_ppm"] * 1e-6,
            "wear": prior["meter_wear_ppm"] * 1e-6, "u_wear": prior["u_meter_wear_ppm"] * 1e-6,
        }  # fmt: skip
        known = {key: getattr(meter, key) for key in values if getattr(meter, key) is not None}
        return Meter(name, meter.factor, **(values | known))

    def _level_causes(self, level_m, time_ns):
        """(columns (m, c) in m, names, units, sd) of the gauge: zeros, scale, waves of levels."""
        prior, high = self.priors, self.stock.table.height_m[-1]
        columns = [np.full(len(level_m), prior["gauge_zero_mm"] / 1000),
                   prior["gauge_scale_ppm"] * 1e-6 * level_m]  # fmt: skip
        names, sd = (
            ["gauge_zero", "gauge_scale"],
            [prior["gauge_zero_mm"], prior["gauge_scale_ppm"]],
        )
        for moment in self.offsets_ns:
            columns.append(prior["gauge_zero_mm"] / 1000 * (time_ns >= moment))
            names.append(f"gauge_offset {np.datetime64(moment, 'ns').astype('datetime64[D]')}")
            sd.append(prior["gauge_zero_mm"])
        for wave in range(1, BENDS + 1):
            angle = 2 * np.pi * wave * level_m / (1.1 * high)
            for name, shape in (("sin", np.sin(angle)), ("cos", np.cos(angle))):
                columns.append(prior["gauge_bend_mm"] / 1000 * shape)
                names.append(f"gauge_bend_{name}_{wave}")
                sd.append(prior["gauge_bend_mm"])
        kept = [place for place, value in enumerate(sd) if value > 0]
        stacked = np.stack(columns, axis=1)[:, kept]
        units = tuple("ppm" if names[place] == "gauge_scale" else "mm" for place in kept)
        return stacked, tuple(names[place] for place in kept), units, [sd[place] for place in kept]

    def _flows(self, steps, warm, years):
        """Metered volumes at the base (n, meters), groups of causes of the meters, their noise."""
        prior, mean_c = self.priors, (warm[1:] + warm[:-1]) / 2
        middle = (steps.marks.time_ns[1:] + steps.marks.time_ns[:-1]) // 2
        meters = [self._meter(name) for name in steps.meters]
        air = np.full(len(steps), np.nan)
        if self.air is not None:
            air = np.interp(middle, *self.air, left=np.nan, right=np.nan)
        warmer = np.nan_to_num(air - mean_c)
        is_measured = np.isfinite(steps.meter_c)
        line = mean_c + prior["air_percent"] / 100 * warmer
        at_meter = np.where(is_measured, steps.meter_c, line[:, None])
        factor = np.array([meter.factor for meter in meters])
        metered = steps.sold_m3 * factor * self.stock.liquid_factor(at_meter)
        by_degree = np.where(is_measured, 0.0, -metered * self.stock.expansion_per_k).sum(axis=1)
        if self.is_net.get("meters"):
            metered, by_degree = steps.sold_m3 * factor, np.zeros(len(steps))
        total = metered.sum(axis=1)
        age = years[1:] / 2 + years[:-1] / 2
        sd = np.array([meter.u_factor for meter in meters])
        wear = np.array([meter.u_wear for meter in meters])
        mean_wear = np.array([meter.wear for meter in meters])
        metered = metered * (1 + age[:, None] * mean_wear)
        season = 2 * np.pi * (middle * 1e-9 / YEAR_S)
        zeros = np.zeros(len(meters))
        groups = [
            ("meter", tuple(f"meter {name}" for name in steps.meters), "%", 100 * sd, zeros,
             metered * sd),
            ("meters", ("meters_common",), "%", [prior["meters_common_percent"]], [0.0],
             prior["meters_common_percent"] / 100 * total[:, None]),
            ("wear", tuple(f"wear {name}" for name in steps.meters), "ppm/a", 1e6 * wear, zeros,
             metered * age[:, None] * wear),
            ("line", ("line_temperature",), "K", [prior["line_k"]], [0.0],
             prior["line_k"] * by_degree[:, None]),
            ("line", ("line_season_sin", "line_season_cos"), "K", [prior["line_season_k"]] * 2,
             [0.0] * 2, prior["line_season_k"] * by_degree[:, None]
             * np.stack([np.sin(season), np.cos(season)], axis=1)),
            ("line", ("line_air",), "%", [prior["u_air_percent"] if self.air else 0.0], [0.0],
             prior["u_air_percent"] / 100 * (by_degree * warmer)[:, None]),
        ]  # fmt: skip
        noise = prior["meter_repeatability_percent"] / 100 * np.linalg.norm(metered, axis=1)
        return metered, groups, noise

    def _deliveries(self, steps, warm):
        """Delivered volumes (n,) at the base temperature."""
        if self.is_net.get("deliveries"):
            return steps.delivered_m3
        at = np.where(np.isfinite(steps.delivered_c), steps.delivered_c, warm[1:])
        return steps.delivered_m3 * self.stock.liquid_factor(at)


def fill_gaps(time_ns, values, constant):
    """Values (m,) with gaps interpolated in time; a constant if there is no value."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(values), float(constant))
    return np.interp(time_ns, time_ns[known], values[known])
