"""Benefit of a further month, of a prover's run and of a low stock, for a tank kept up.

Covariances do not depend on the readings: whitened rows of future steps are added to the triangle
of the steps so far.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.products.upkeep.filtering import add_rows, whiten_steps
from tankcal.products.upkeep.steps import Marks, Steps

MONTH_S = 30 * 86400.0
PROVED = 3e-4  # relative standard uncertainty of a meter after a prover's run
RUN_DOWN_STEPS = 6
LOW_SHARE = 0.5  # of the lowest level so far, to which the stock is run down


@dataclass(frozen=True)
class Gain:
    """Standard uncertainties after an addition.

    Attributes
    ----------
    name : {"now", "month", "prover", "low_stock"}
    u_delivery_m3 : float
        Of the delivery between the lowest and the highest level.
    u_content_m3 : float
        Of the content at the lowest level.
    """

    name: str
    u_delivery_m3: float
    u_content_m3: float


def predict_gains(operation, estimation, levels_m, *, proved=PROVED, low_m=None):
    """Predict u of deliveries and contents after each addition.

    Parameters
    ----------
    operation : causes.Operation
    estimation : estimation.Estimation
    levels_m : (float, float)
        Lowest and highest level.
    proved : float
        Relative standard uncertainty of each meter by a prover; its common standard remains.
    low_m : float, optional
        Level of the low stock; None: half of the lowest level.

    Returns
    -------
    list of Gain
    """
    causes, stock = estimation.balance.causes, operation.stock
    count, size = len(stock.names), len(causes.names)
    estimate = estimation.triangle.estimate
    columns = stock.columns(np.array(levels_m), estimate[:count])
    seconds = np.append(0.0, np.cumsum(estimation.steps.seconds))
    month = estimation.rows[(seconds[1:] > seconds[-1] - MONTH_S) & estimation.is_used]
    meters = causes.place("meter")
    prover = np.zeros((len(meters), 1 + size))
    prover[np.arange(len(meters)), 1 + meters] = causes.sd[meters] / (100 * proved)
    low = LOW_SHARE * levels_m[0] if low_m is None else low_m
    steps = _run_down(estimation.steps, stock.table, levels_m[0], low)
    balance = operation.linearize(steps, estimate)
    run = whiten_steps(balance.drift, np.column_stack([balance.misclosure_m3, balance.columns_m3]))
    gains = []
    for name, rows in (("now", month[:0]), ("month", month), ("prover", prover),
                       ("low_stock", run.rows)):  # fmt: skip
        triangle = add_rows(estimation.triangle, rows, np.ones(len(rows), dtype=bool))
        by_root = np.vstack([columns[0], columns[1] - columns[0]]) @ triangle.root[:count]
        u_content, u_delivery = np.linalg.norm(by_root, axis=1)
        gains.append(Gain(name, float(u_delivery), float(u_content)))
    return gains


def _run_down(steps, table, high_m, low_m):
    """Steps that sell the stock from a level to a lower level, by all meters as so far."""
    ends = table.volume(np.array([high_m, low_m]))
    stock = np.linspace(*ends, RUN_DOWN_STEPS + 1)
    hours = steps.marks.time_ns[-1] + 4 * 3600 * 10**9 * np.arange(1, RUN_DOWN_STEPS + 2)
    last = slice(len(steps.marks.sd_m) - 1, None)
    marks = Marks(hours, np.interp(stock, table.volume_m3, table.height_m),
                  np.repeat(steps.marks.sd_m[last], RUN_DOWN_STEPS + 1),
                  np.repeat(steps.marks.temperature_c[last], RUN_DOWN_STEPS + 1))  # fmt: skip
    share = steps.sold_m3.sum(axis=0) / steps.sold_m3.sum()
    sold = -np.diff(stock)[:, None] * share
    blank, none = np.full(RUN_DOWN_STEPS, np.nan), np.zeros(RUN_DOWN_STEPS, dtype=int)
    return Steps(marks, steps.meters, sold, np.full(sold.shape, np.nan), np.zeros(RUN_DOWN_STEPS),
                 blank, none, none)  # fmt: skip


def plan_folder(folder):
    """Predict the gains of the tank of a folder with upkeep.toml.

    Parameters
    ----------
    folder : path

    Returns
    -------
    levels_m : (float, float)
    gains : list of Gain
    k : float
    """
    from tankcal.gum.coverage import coverage_factor
    from tankcal.products.upkeep.reading import read_upkeep
    from tankcal.products.upkeep.upkeep import estimate_inputs

    inputs = read_upkeep(folder)
    operation, estimation, _, probability = estimate_inputs(inputs)
    k = float(coverage_factor(probability, np.inf))
    levels = estimation.balance.level_m
    ends = float(levels.min()), float(levels.max())
    return ends, predict_gains(operation, estimation, ends), k
