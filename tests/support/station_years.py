"""Years of stations as steps at their quiet marks, drawn by physics that is not the model.

The tank has rings of alternating radius, the deviation of the gauge a wave of 0.7 m. Meters walk
and wear, layers follow each delivery, lines warm with the air of the hour, losses have a sign.
"""

from dataclasses import dataclass, replace

import numpy as np
from example_logs import TrueTank

from tankcal.products.quantity.table import TankTable
from tankcal.products.upkeep.causes import PRIORS, YEAR_S, Meter, Operation, TableStock
from tankcal.products.upkeep.filtering import total_innovations, whiten_steps
from tankcal.products.upkeep.steps import Marks, Steps

EXPANSION, BASE_C = 0.00124, 15.0
SURVEY = {"radius": 0.001, "length": 0.006, "end": 0.010, "tilt": 0.002, "zero": 0.001}
METERS = ("1", "2", "3", "4")
U_METER = 300e-6
NOMINAL = TrueTank()
HEIGHTS_M = np.arange(0.0, 2.5001, 0.01)


def make_table(sizes=SURVEY):
    """Table of the nominal tank, with the covariance of its sizes."""
    columns = []
    for name, u in sizes.items():
        moved = [
            TrueTank(**{name: getattr(NOMINAL, name) + sign * u}).below(HEIGHTS_M)
            for sign in (1, -1)
        ]
        columns.append((moved[0] - moved[1]) / 2)
    return TankTable("station", "horizontal", HEIGHTS_M, NOMINAL.below(HEIGHTS_M),
                     np.stack(columns, axis=1), np.full(len(HEIGHTS_M), np.inf), 0.0, BASE_C,
                     0.0)  # fmt: skip


def liquid_factor(temperature_c):
    """Volume at the base temperature over the observed volume."""
    return 1 / (1 + EXPANSION * (temperature_c - BASE_C))


@dataclass
class Year:
    """What was drawn: steps as a log gives them, the true tank, the true meters and the model."""

    steps: Steps
    tank: TrueTank
    factors: dict
    operation: Operation


def draw_year(rng, table, *, days=365, sizes=SURVEY, marks=6, faults=None, tank=None,
              order_m3=(7.0, 7.0), load_m3=12.0):  # fmt: skip
    """`Year` of a station whose tank has drawn sizes, or of `tank`; faults {kind: (day, size)}.

    A delivery of about `load_m3` is ordered at a stock between the limits `order_m3`.
    """
    faults = faults or {}
    prior = PRIORS["station"]
    if tank is None:
        true = {name: getattr(NOMINAL, name) + u * rng.normal() for name, u in sizes.items()}
        tank = TrueTank(**true, ring=0.001 * rng.uniform(-1, 1))
    count = marks * days + 1
    # Marks between six and midnight, and a rest at night.
    hours = np.append(np.linspace(0.5, 5.5, 2), np.linspace(8, 22, marks - 2))
    time = np.append(0.0, (np.arange(days)[:, None] * 24 + hours).ravel()[: count - 1] + 1) * 3600
    day, seconds = time / 86400, np.diff(time)
    share = np.where(seconds > 4 * 3600, 0.0, seconds * (((time[1:] / 3600) % 24) > 6.6))
    share = share * rng.gamma(8, 1 / 8, size=len(share))
    sold = 5.0 * share / (share.sum() / days)
    split = rng.dirichlet(np.full(4, 6.0), size=len(sold)) * sold[:, None]
    air = 12 + 9 * np.sin(2 * np.pi * (day - 110) / 365) + 4 * np.sin(2 * np.pi * (day - 0.4))
    ground = 12 + 4 * np.sin(2 * np.pi * (day - 140) / 365)
    factor = {name: U_METER * rng.normal() for name in METERS}
    age = (time[1:] + time[:-1]) / 2 / YEAR_S
    walk = np.cumsum(rng.normal(size=(len(sold), 4)) * np.sqrt(seconds / YEAR_S)[:, None], axis=0)
    wear = (250e-6 + 250e-6 * rng.normal(size=4)) * age[:, None]
    true_factor = 1 + np.array(list(factor.values())) + 500e-6 * walk + wear
    if "meter" in faults:
        begin, size = faults["meter"]
        true_factor[:, 0] += np.where(day[:-1] >= begin, size, 0.0)
    line_share = np.clip(0.12 + 0.05 * rng.normal(), 0, None)
    line = ground + line_share * (air - ground) + 0.5 * rng.normal()
    mean = lambda values: (values[1:] + values[:-1]) / 2  # noqa: E731
    gone = (split * true_factor * liquid_factor(mean(line))[:, None]).sum(axis=1)
    gone = gone * (1 + max(0.0005 + 0.0003 * rng.normal(), 0.0))
    leak = np.full(len(sold), max(0.04 + 0.03 * rng.normal(), 0.0))
    if "leak" in faults:
        begin, size = faults["leak"]
        leak += size * np.clip((day[1:] - begin) / np.diff(day), 0, 1)
    gone = gone + leak * seconds / 3.6e6
    bias = 0.0015 * rng.normal()
    stock, stocks, layer, order = 14.0, [14.0], 0.0, order_m3[1]
    ticket, delivered_c, number, layers = (np.zeros(len(sold)) for _ in range(4))
    for k in range(len(sold)):
        layer *= np.exp(-seconds[k] / 43200)
        stock -= gone[k]
        if stock < order and seconds[k] < 4 * 3600:
            order = order_m3[0] + (np.ptp(order_m3) and np.ptp(order_m3) * rng.random())
            volume, warm = load_m3 + rng.choice([-1, 0, 1]), mean(ground)[k] + 3 * rng.normal()
            now = bias
            if "ticket" in faults and day[k] >= faults["ticket"][0]:
                now += faults["ticket"][1]
            shown = volume / (1 + now) * (1 + 0.0025 * rng.normal())
            ticket[k], delivered_c[k], number[k] = (
                shown + max(0.004 + 0.01 * rng.normal(), 0),
                warm,
                1,
            )
            stock += volume * liquid_factor(warm)
            layer += 0.4 * rng.normal()
        layers[k] = layer
        stocks.append(stock)
    sensor = 0.3 * rng.normal()
    true_c = ground + np.append(0.0, layers) + sensor
    level = tank.level(np.array(stocks) / liquid_factor(true_c))
    stay, wander = np.exp(-seconds / (5 * 86400)), [0.25e-3 * rng.normal()]
    for hold in stay:
        wander.append(hold * wander[-1] + 0.25e-3 * np.sqrt(1 - hold**2) * rng.normal())
    zero = 0.002 * rng.normal() + 150e-6 * rng.normal() * level
    zero = zero + 0.4e-3 * rng.normal() * np.sin(2 * np.pi * level / 0.7 + 6 * rng.random())
    if "zero" in faults:
        zero = zero + np.where(day >= faults["zero"][0], faults["zero"][1], 0.0)
    read = level + zero + np.array(wander) + 0.12e-3 * rng.normal(size=count)
    ns = (1e9 * time).astype(np.int64)
    nan = np.full((len(sold), 4), np.nan)
    steps = Steps(
        Marks(ns, read, np.full(count, 1e-5), ground), METERS, split, nan, ticket,
        np.where(number > 0, delivered_c, np.nan), number.astype(int),
        np.zeros(len(sold), dtype=int),
    )  # fmt: skip
    operation = Operation(
        TableStock(table, EXPANSION, BASE_C),
        {name: Meter(name, u_factor=U_METER) for name in METERS}, prior,
        (ns.astype(float), air), start_ns=0,
    )  # fmt: skip
    return Year(steps, tank, factor, operation)


def draw_from_model(rng, estimation):
    """`Estimation` with misclosures drawn by the model: constant causes, and those that drift.

    Levels, wander, layers and meter factors are simulated forwards in time, not by the filter.
    """
    balance = estimation.balance
    drift, steps = balance.drift, len(balance.drift)
    stay, decay = np.exp(-drift.seconds / drift.wander_s), np.exp(-drift.seconds / drift.layer_s)
    normal = rng.normal(size=(2, steps + 1))
    wander, layer = drift.wander_sd_m * normal[0], np.zeros(steps + 1)
    for k in range(steps):
        wander[k + 1] = stay[k] * wander[k] + np.sqrt(1 - stay[k] ** 2) * wander[k + 1]
        layer[k + 1] = decay[k] * layer[k] + drift.layer_sd_k[k] * normal[1, k]
    level = wander + drift.level_sd_m * rng.normal(size=steps + 1)
    walk = np.sqrt(drift.seconds[:, None] * drift.walk_per_s)
    factor = np.cumsum(walk * rng.normal(size=walk.shape), axis=0)
    misclosure = balance.columns_m3 @ rng.normal(size=balance.columns_m3.shape[1])
    misclosure += np.diff(drift.by_degree_m3 * layer - drift.area_m2 * level)
    misclosure += np.sum(drift.metered_m3 * factor, axis=1)
    misclosure += drift.noise_m3 * rng.normal(size=steps)
    is_used = np.ones(steps, dtype=bool)
    drift = replace(drift, is_used=is_used)
    balance = replace(balance, misclosure_m3=misclosure, drift=drift)
    rows = whiten_steps(drift, np.column_stack([misclosure, balance.columns_m3])).rows
    return replace(estimation, balance=balance, rows=rows,
                   innovations=total_innovations(rows, is_used)[:, 0])  # fmt: skip
