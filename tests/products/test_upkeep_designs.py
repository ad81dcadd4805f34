"""What everyday data determine: u of sizes, contents and deliveries before a single reading.

Kind of truth: numbers of another author for stations and an upright tank that are described, but
whose steps are not given. docs/studies/upkeep.md has both.
"""

from dataclasses import replace

import numpy as np
import pytest
from drawn_stations import DRAWING, SizedStock, nominal_sizes, section_volume
from station_years import METERS, SURVEY, draw_year, make_table

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


def station_row(year, *, groups=6, sizes=DRAWING, meter=0.0015, level_mm=0.12, days=730):
    """u of radius, length, end, tilt, zero in mm, of three contents in L, of 0.5 to 2.0 m in ppm."""
    day = year.steps.marks.time_ns / 86400e9
    steps = year.steps.part(0, int(np.searchsorted(day, days)) - 1)
    if groups < len(GROUPS):
        reason = np.where(steps.tickets > 0, REASONS.index("no_ticket"), 0)
        steps = replace(steps, reason=reason)
    stock = SizedStock(section_volume, nominal_sizes(), sizes, make_table(sizes))
    meters = {name: Meter(name, u_factor=meter if groups > 1 else 0.0) for name in METERS}
    prior = priors_of(groups) | {"level_mm": level_mm}
    operation = Operation(stock, meters, prior, year.operation.air, start_ns=0)
    _, covariance, _ = estimate_design(operation, steps)
    part = covariance[:5, :5]
    u = 1000 * np.array(list(sizes.values())) * np.sqrt(np.diag(part))
    dips = np.array([0.5, 1.25, 2.2, 2.0])
    columns = stock.columns(dips, np.zeros(5))
    between = columns[3] - columns[0]
    delivered = np.diff(stock.volume_m3(dips[[0, 3]], np.zeros(5)))[0]
    contents = 1000 * np.sqrt(np.einsum("ij,jk,ik->i", columns[:3], part, columns[:3]))
    return [*u, *contents, 1e6 * np.sqrt(between @ part @ between) / delivered]
