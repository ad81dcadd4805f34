"""Design of an upkeep: u of sizes, contents and deliveries before a single reading.

Kind of truth: numbers of another author for stations and an upright tank that are described, but
whose steps are not given. docs/studies/upkeep.md has both.
"""

from dataclasses import replace

import numpy as np
import pytest
from page_figures import agree, figures_of
from station_years import METERS, draw_year, make_table
from test_upkeep_planning import make_known_form, make_steps

from tankcal.products.quantity.table import TankTable
from tankcal.products.upkeep.causes import PRIORS, Meter, Operation, TableStock
from tankcal.products.upkeep.filtering import (
    add_rows,
    start_triangle,
    total_innovations,
    whiten_steps,
)
from tankcal.products.upkeep.steps import REASONS, Marks, Steps

CONSTANTS = {"gauge_wander_days", "layer_h"}
GROUPS = (
    ("level_mm",),
    ("meter_percent", "meters_common_percent", "meter_repeatability_percent"),
    ("meter_walk_ppm", "meter_wear_ppm", "u_meter_wear_ppm"),
    ("gauge_zero_mm", "gauge_scale_ppm", "gauge_bend_mm", "gauge_wander_mm"),
    ("temperature_k", "layer_k", "line_k", "line_season_k", "air_percent", "u_air_percent",
     "ticket_temperature_k"),
    ("loss_l_h", "u_loss_l_h", "vapour_percent", "u_vapour_percent"),
    ("ticket_percent", "ticket_own_percent", "hose_l", "u_hose_l"),
)  # fmt: skip


def priors_of(groups):
    """Priors of a station without the causes of later groups."""
    kept = CONSTANTS.union(*GROUPS[:groups])
    return {name: value if name in kept else 0.0 for name, value in PRIORS["station"].items()}


def estimate_design(operation, steps):
    """(causes, covariance of the estimates, linearised steps) before a reading is taken."""
    balance = operation.linearize(steps)
    data = np.column_stack([balance.misclosure_m3, balance.columns_m3])
    rows = whiten_steps(balance.drift, data).rows
    triangle = add_rows(start_triangle(data.shape[1] - 1), rows, steps.is_used)
    return balance.causes, triangle.root @ triangle.root.T, balance


def station_row(steps, *, groups=6, sizes=(), meter=0.0015, level_mm=0.12, days=730, zero_mm=0.0):
    """u of five sizes in mm, of three contents in L, and of 0.5 to 2.0 m in ppm; r of two pairs."""
    day = steps.marks.time_ns / 86400e9
    steps = steps.part(0, int(np.searchsorted(day, days)) - 1)
    if groups < len(GROUPS):
        reason = np.where(steps.tickets > 0, REASONS.index("no_ticket"), 0)
        steps = replace(steps, reason=reason)
    stock = make_known_form(**dict(sizes))
    meters = {name: Meter(name, u_factor=meter if groups > 1 else 0.0) for name in METERS}
    prior = priors_of(groups) | {"level_mm": level_mm, "gauge_zero_mm": zero_mm}
    operation = Operation(stock, meters, prior, start_ns=0)
    _, covariance, _ = estimate_design(operation, steps)
    part, sd = covariance[:5, :5], np.sqrt(np.diag(covariance)[:5])
    u = 1000 * np.array(list(stock.sd.values())) * sd * [0.5, 1, 1, 1, 1]  # of the radius
    dips = np.array([0.5, 1.25, 2.2, 2.0])
    columns = stock.columns(dips, stock.at)[:, :5]
    between = columns[3] - columns[0]
    delivered = np.diff(stock.volume_m3(dips[[0, 3]], stock.at))[0]
    contents = 1000 * np.sqrt(np.einsum("ij,jk,ik->i", columns[:3], part, columns[:3]))
    delivery = 1e6 * np.sqrt(between @ part @ between) / delivered
    return [*u, *contents, delivery, part[4, 3] / sd[4] / sd[3], part[1, 0] / sd[1] / sd[0]]


def sd_of_causes(year, days):
    """sd of a leak (L/h), zero (mm), all meters and a meter of 35 % (%) that began days ago."""
    share = np.array([0.35, 0.25, 0.20, 0.20]) / 0.25
    sold = year.steps.sold_m3 * share
    total = year.steps.sold_m3.sum(axis=1, keepdims=True)
    sold *= total / np.maximum(sold.sum(axis=1, keepdims=True), 1e-12)
    steps = replace(year.steps, sold_m3=sold)
    _, _, balance = estimate_design(year.operation, steps)
    drift, count = balance.drift, len(steps)
    rows = whiten_steps(drift, np.column_stack([balance.misclosure_m3, balance.columns_m3])).rows
    end = np.cumsum(steps.seconds)
    begun = end > end[-1] - days * 86400
    metered = drift.metered_m3 / 100
    level = np.append(False, begun) * -drift.area_m2 / 1000
    columns = np.column_stack([
        begun * drift.seconds / 3.6e6, np.diff(level), begun * metered.sum(axis=1),
        begun * metered[:, 0],
    ])  # fmt: skip
    effects = whiten_steps(drift, np.column_stack([np.zeros(count), columns])).rows[:, 1:]
    return 1 / np.linalg.norm(total_innovations(rows, steps.is_used, effects)[:, 1:], axis=0)


# ---- an upright tank of six courses

RADIUS_M, COURSE_M, TOP_M = 11.0, 2.2, 13.2


def upright_row(*, common=0.002, own=0.001, meter=300e-6, rack=1000e-6, mean_k=0.25, daily_k=0.15):
    """u of the mean and of a radius in mm, of 1.5 to 12 m in ppm, of receipt meter and rack."""
    heights = np.arange(0.0, TOP_M + 0.01, 0.05)
    inside = np.clip(heights[:, None] - COURSE_M * np.arange(6), 0, COURSE_M)
    by_radius = 2 * np.pi * RADIUS_M * inside  # m3 per m of each radius
    volume = np.pi * RADIUS_M**2 * heights
    factor = np.column_stack([common * by_radius.sum(axis=1), own * by_radius])
    table = TankTable("u", "vertical", heights, volume, factor, np.full(len(heights), np.inf), 0.0,
                      15.0, 0.0)  # fmt: skip
    # 262 days of loading, and a receipt of 118 700 m3 / 45 whenever there is room.
    rng, load, receipt = np.random.default_rng(1), 118_700 / 262, 118_700 / 45
    stock, stocks, sold, tickets = 0.9 * volume[-1], [], [], []
    stocks.append(stock)
    while len(tickets) < 262 + 45:
        if stock < 1.5 * np.pi * RADIUS_M**2 + load + 700 * rng.random():
            stock, now, ticket = stock + receipt, 0.0, receipt
        else:
            now = load * rng.uniform(0.8, 1.2)
            stock, ticket = stock - now, 0.0
        stocks.append(stock)
        sold.append(now)
        tickets.append(ticket)
    count, tickets = len(tickets), np.array(tickets)
    time = (np.arange(count + 1) * 365 / count * 86400e9).astype(np.int64)
    warm = 15 + 10 * np.sin(2 * np.pi * np.arange(count + 1) / count)
    marks = Marks(time, np.array(stocks) / (np.pi * RADIUS_M**2), np.zeros(count + 1), warm)
    steps = Steps(marks, ("rack",), np.array(sold)[:, None], np.full((count, 1), np.nan), tickets,
                  np.full(count, 15.0), (tickets > 0).astype(int),
                  np.zeros(count, int))  # fmt: skip
    prior = PRIORS["terminal"] | {"ticket_percent": 100 * meter, "temperature_k": mean_k,
                                  "layer_k": daily_k}  # fmt: skip
    stock_of = TableStock(table, 0.00085, 15.0)
    operation = Operation(stock_of, {"rack": Meter("rack", u_factor=rack)}, prior, start_ns=0)
    causes, covariance, _ = estimate_design(operation, steps)
    size = len(stock_of.names)
    # The table's own causes are turned: x = turn z, with z the common and the six own errors.
    turn = stock_of.turn
    covariance_z = np.eye(7) - turn.T @ (np.eye(size) - covariance[:size, :size]) @ turn
    mean, single = np.append(common, np.full(6, own / 6)), np.append(common, np.zeros(6))
    single[4] = own  # of the fourth course; the lowest is never emptied
    dips = stock_of.columns(np.array([1.5, 12.0]), np.zeros(size))
    between = dips[1] - dips[0]
    delivered = np.pi * RADIUS_M**2 * 10.5
    ticket, meters = causes.place("ticket")[0], [causes.place("meter")[0], *causes.place("meters")]
    weights = np.zeros(len(causes.names))
    weights[meters] = causes.sd[meters]
    return [
        *(1000 * np.sqrt(part @ covariance_z @ part) for part in (mean, single)),
        1e6 * np.sqrt(between @ covariance[:size, :size] @ between) / delivered,
        1e6 * meter * np.sqrt(covariance[ticket, ticket]),
        1e4 * np.sqrt(weights @ covariance @ weights),
    ]


# ---- the tables of the page

SURVEY = {"u_diameter_mm": 2.0, "u_length_mm": 6.0, "u_end_depth_mm": 10.0,
          "u_tilt_mm_per_m": 2.0, "u_zero_mm": 1.0}  # fmt: skip
ORDERS = 2.3, 11.8  # stocks in m3: levels 0.35 to 1.92 m, 274 deliveries
STATION_CASES = [
    (
        "docs/studies/upkeep.md",
        "| levels 0.12 mm alone | () | () | () | () | () | () | () | () | () |",
        {"groups": 1},
    ),
    (
        "docs/studies/upkeep.md",
        "| + meters 0.15 % each | () | () | () | () | () | () | () | () | () |",
        {"groups": 2},
    ),
    (
        "docs/studies/upkeep.md",
        "| + walk and wear | () | () | () | () | () | () | () | () | () |",
        {"groups": 3},
    ),
    (
        "docs/studies/upkeep.md",
        "| + wander, scale, bends of the gauge | () | () | () | () | () | () | () | () | () |",
        {"groups": 4},
    ),
    (
        "docs/studies/upkeep.md",
        "| + temperatures | () | () | () | () | () | () | () | () | () |",
        {"groups": 5},
    ),
    (
        "docs/studies/upkeep.md",
        "| + losses: complete | () | () | () | () | () | () | () | () | () |",
        {"groups": 6},
    ),
    (
        "docs/studies/upkeep.md",
        "| complete, tickets 0.25 % | () | () | () | () | () | () | () | () | () |",
        {"groups": 7},
    ),
    (
        "docs/studies/upkeep.md",
        "| complete, meters 0.5 % | () | () | () | () | () | () | () | () | () |",
        {"meter": 0.005},
    ),
    (
        "docs/studies/upkeep.md",
        "| complete, meters 0.03 % | () | () | () | () | () | () | () | () | () |",
        {"meter": 3e-4},
    ),
    (
        "docs/studies/upkeep.md",
        "| complete, gauge of 1 mm steps | () | () | () | () | () | () | () | () | () |",
        {"level_mm": float(np.hypot(0.12, 1 / np.sqrt(12)))},
    ),
    (
        "docs/studies/upkeep.md",
        "| complete, beside a survey | () | () | () | () | () | () | () | () | () |",
        {"sizes": SURVEY},
    ),
    (
        "docs/studies/upkeep.md",
        "| complete, zero of the gauge 2 mm | () | () | () | () | () | () | () | () | () |",
        {"zero_mm": 2.0},
    ),
    (
        "docs/studies/upkeep.md",
        "| complete, 60 days | () | () | () | () | () | () | () | () | () |",
        {"days": 60},
    ),
]
UPRIGHT_CASES = [
    ("docs/studies/upkeep.md", "| upright, complete | () | () | () | () | () |", {}),
    (
        "docs/studies/upkeep.md",
        "| temperatures to 0.05 K | () | () | () | () | () |",
        {"mean_k": 0.05, "daily_k": 0.05},
    ),
    (
        "docs/studies/upkeep.md",
        "| receipt meter proved to 100 ppm | () | () | () | () | () |",
        {"meter": 100e-6},
    ),
    (
        "docs/studies/upkeep.md",
        "| both | () | () | () | () | () |",
        {"mean_k": 0.05, "daily_k": 0.05, "meter": 100e-6},
    ),
    (
        "docs/studies/upkeep.md",
        "| good table: 0.7 mm, 0.3 mm | () | () | () | () | () |",
        {"common": 7e-4, "own": 3e-4},
    ),
    (
        "docs/studies/upkeep.md",
        "| no meter traceable (1 %) | () | () | () | () | () |",
        {"meter": 0.01, "rack": 0.01},
    ),
    (
        "docs/studies/upkeep.md",
        "| no table (5 cm, 1 cm) | () | () | () | () | () |",
        {"common": 0.05, "own": 0.01},
    ),
]
OTHER_AUTHOR = [
    ("docs/studies/upkeep.md", "| other author | () | () | () | () | () | () | () | () | () |"),
    ("docs/studies/upkeep.md", "| other author | () | () | () | () |"),
    ("docs/studies/upkeep.md", "| other author | () | () | () | () | () |"),
]  # fmt: skip
STOCKS = {"order_m3": (2.8, 12.4), "load_m3": 13.27}  # levels 0.42 to 1.92 m, 278 deliveries


def rows_of_tables():
    """Yield (page, row with () for its numbers, values) of each row of the three tables."""
    _, steps = make_steps(730, ORDERS)
    for page, row, values in STATION_CASES:
        yield page, row, station_row(steps, **values)[:9]
    year = draw_year(np.random.default_rng(1), make_table(), days=548, **STOCKS)
    for days in (8, 15, 29, 92, 183):
        row = ("docs/studies/upkeep.md", "| () days | () | () | () | () |")
        yield row[0], row[1].replace("()", str(days), 1), sd_of_causes(year, days)
    for page, row, values in UPRIGHT_CASES:
        yield page, row, upright_row(**values)


@pytest.mark.slow
def test_correlations_of_the_other_author():
    """Zero with tilt 0.83, radius with length -0.74; a gauge at mid-length would have neither."""
    *_, zero, length = station_row(make_steps(730, ORDERS)[1])
    assert zero == pytest.approx(0.83, abs=0.06)
    assert length == pytest.approx(-0.74, abs=0.08)


@pytest.mark.slow
def test_designs_of_the_page():
    """Each printed number of the tables of designs; the numbers of the other author are beside."""
    for page, row, values in rows_of_tables():
        stated = figures_of(page, row)
        assert agree(values, stated), (row, values, stated)
