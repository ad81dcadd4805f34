"""From the survey to the capacity table, and the statements that accompany its rows.

The wall may be that of an adjusted survey or of a plan.
"""

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.field.sites import MOST_SITES
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.methods.base import accompanying_methods, given_methods, method_of
from tankcal.pipeline.checks import compare_with_nominal, warn_of_undeclared
from tankcal.pipeline.checks.size import check_reference, check_scan, check_size, check_wall
from tankcal.pipeline.tanks import body_of, critical_zone, zero_height
from tankcal.solver.compiled import threads_for
from tankcal.tank.body import Body
from tankcal.tank.budgets import Budget, budget, reading_sources
from tankcal.tank.capacity import SAME_M, Capacity, refuse_falling
from tankcal.tank.deliveries import WorstDeliveries, worst_deliveries
from tankcal.tank.dips import (
    HEIGHT_STEPS_M,
    LADDERS_M,
    Straightness,
    choose_rows,
    interpolation_errors,
    table_heights,
    top_mark,
)
from tankcal.tank.rules import PrintedU, StatedVolume, deliveries_to_check, judge
from tankcal.uncertainty import ROUNDING, combine

CLOSED = 1e-3  # area at the top, relative to the largest area, below which a tank is closed
SAME_DIP_M = 1e-6  # largest difference of dips of a row and a joint that coincide


@dataclass(frozen=True)
class ComputedTable:
    """A tank with its capacity table.

    Attributes
    ----------
    body : Body
        Tank as the sum of its parts.
    zero_m : float
        Level of the table's zero (dip 0) in the frame of the parts, m.
    levels_m : ndarray, shape (rows,)
        Levels of the rows in that frame, m.
    breakpoints_m : ndarray
        Dips between empty and full at which the area jumps, m.
    table : Capacity
    straightness : Straightness
        Error of linear interpolation between the rows.
    """

    body: Body
    zero_m: float
    levels_m: np.ndarray
    breakpoints_m: np.ndarray
    table: Capacity
    straightness: Straightness

    @property
    def top_m(self):
        """Dip of the last row: the full tank, in whole millimetres."""
        return float(self.table.height_m[-1])

    @property
    def over_m(self):
        """Height of the last row above the top of the tank, m; negative below the top."""
        return float(self.levels_m[-1] - self.body.highest_m)

    def volume_m3(self, dips_m):
        """Exact volumes (n,) at dips, m3."""
        return _exact(self.body, self.zero_m)(dips_m)


def compute_table(job, survey, progress=lambda text: None, body=None):
    """Compute the capacity table of a job, with the covariance of its rows.

    Parameters
    ----------
    job : Job
    survey : Wall, Scan, mesh or None
        Survey of the tank; None if declared sizes alone describe it.
    progress : callable, optional
        Called with a line of text as each step begins.
    body : Body, optional
        Tank with additional information, such as metered liquid; None: from the survey.

    Returns
    -------
    ComputedTable

    Raises
    ------
    InputError, SolutionError
        If the capacity falls with rising dips: see `refuse_falling`.
    """
    progress(message("integrating", "integrating volumes"))
    if body is None:
        with threads_for(MOST_SITES):
            body = body_of(job, survey)
    zero = zero_height(job, survey)
    progress(message("propagating", "propagating the covariance to every row of the table"))
    spec = job.table
    top = top_mark(body.highest_m - zero, spec.height_unit, closed=_is_closed(body))
    breakpoints = np.unique([edge - zero for edge in body.breakpoints_m if 0 < edge - zero < top])
    exact = _exact(body, zero)
    heights = _choose_dips(spec, exact, top, breakpoints)
    levels = heights + zero
    volumes, areas, sources = _remove_rounding(*body.rows(levels))
    table = Capacity(
        height_m=heights,
        volume_m3=volumes,
        area_m2=areas,
        sources=sources,
        probability=spec.coverage_probability,
        critical_m=critical_zone(job),
    )
    dips = distinct_dips(heights, breakpoints)
    refuse_falling(job, body, zero, dips, exact(dips))
    straightness = interpolation_errors(exact, heights, breakpoints)
    return ComputedTable(body, zero, levels, breakpoints, table, straightness)


def distinct_dips(heights_m, breakpoints_m):
    """Rows, and the breakpoints that differ from a row by more than rounding.

    Across a joint, a table of geometry and liquid has a step: the difference of the areas times the
    estimated error of the joint's height, a few millilitres. Two dips closer than this would show
    the step as a falling volume.

    Examples
    --------
    >>> distinct_dips(np.array([4.79, 4.8]), np.array([4.795, 4.8 + 1e-15])).tolist()
    [4.79, 4.795, 4.8]
    """
    next_row = np.searchsorted(heights_m, breakpoints_m)
    neighbours = heights_m[np.clip([next_row - 1, next_row], 0, len(heights_m) - 1)]
    distance = np.abs(neighbours - breakpoints_m).min(axis=0)
    return np.union1d(heights_m, breakpoints_m[distance > SAME_DIP_M])


def check_table(job, survey, computed, sighting=None):
    """Warnings about a survey and the capacity table computed from it.

    Parameters
    ----------
    job : Job
    survey : Wall, Scan, mesh or None
        As passed to `compute_table`.
    computed : ComputedTable
    sighting : Sighting, Touching or Clouded, optional
        For a wall surveyed by reflectorless hits, by tangents or by clouds.

    Returns
    -------
    tuple of Problem
    """
    of_size = check_size(job, survey)
    survey = getattr(survey, "surveyed", None) or survey  # warnings are about the measurements
    return (
        *of_size,
        *_check_survey(job, survey, computed.top_m),
        *_check_sights(job, survey, sighting),
        *warn_of_undeclared(undeclared_inputs(job, survey, computed.body)),
        *compare_with_nominal(job.tank, computed.table.volume_m3[-1]),
    )


def undeclared_inputs(job, survey, body):
    """Inputs without u: those of the table, then those that affect only corrections of a ship."""
    by_method = (method.undeclared(job, survey) for method in given_methods(job))
    return tuple(dict.fromkeys((*body.undeclared(), *chain.from_iterable(by_method))))


def _check_sights(job, survey, sighting):
    """Warnings about the sights or clouds of a wall."""
    if sighting is None:
        return ()
    for method in given_methods(job):
        if method.is_sighted:
            return method.warnings(job, survey, sighting)
    return ()


def _check_survey(job, survey, top_m):
    """Warnings about a survey, and about the readings that accompany it."""
    if survey is None:
        return ()
    method = method_of(survey)
    if method is not None:
        problems = method.warnings(job, survey)
        if method.computes_top:
            problems = (*problems, *check_reference(job, top_m))
    elif survey.surveyed_as == "wall":
        from tankcal.pipeline.wall.finding import warnings_of

        problems = (*warnings_of(job, survey), *check_wall(job, survey))
    elif survey.surveyed_as == "scan":
        return check_scan(job, survey, top_m)
    else:  # a nominal wall
        return check_reference(job, top_m)
    for other in accompanying_methods(job):
        if other is not method:
            problems = (*problems, *other.warnings(job, survey))
    return problems


def _remove_rounding(volumes, areas, sources):
    """Rows with exact zeros in place of rounding errors.

    Below a raised bottom the volume is a difference of volumes, such as -9e-16 m3 with u of 3e-20
    m3. It would be written with twenty decimals. A row with volume 0 and a significant u is not
    changed.
    """
    u = combine(sources, len(volumes)).u
    largest_rounding = ROUNDING * np.max(np.abs(volumes), initial=0.0)
    is_empty = (np.abs(volumes) <= largest_rounding) & (u <= largest_rounding)
    has_no_area = np.abs(areas) <= ROUNDING * np.max(np.abs(areas), initial=0.0)
    rows = is_empty[:, None]
    sources = tuple(cause.mapped(lambda columns: np.where(rows, 0.0, columns)) for cause in sources)
    return np.where(is_empty, 0.0, volumes), np.where(has_no_area, 0.0, areas), sources


def _exact(body, zero_m):
    """Function from dips to exact volumes."""
    return lambda dips_m: body.volume_m3(dips_m + zero_m)


def _is_closed(body):
    """Whether a tank narrows to zero at its top, as a sphere or a horizontal cylinder does."""
    span = np.linspace(body.lowest_m, body.highest_m, 9)
    areas = body.area_m2(span)
    return bool(areas[-1] < CLOSED * areas.max())


def _choose_dips(spec, exact, top_m, breakpoints_m):
    """Dips of the rows: by the requested step, or by the bound on linear interpolation."""
    step = spec.step_m
    if step is None and spec.height_unit != "m":
        step = float(HEIGHT_STEPS_M[spec.height_unit])
    if spec.max_interpolation_error_m3 is not None:
        return choose_rows(
            exact,
            top_m,
            spec.max_interpolation_error_m3,
            breakpoints_m,
            step_m=step,
            ladder_m=LADDERS_M[spec.height_unit],
        ).height_m
    return table_heights(step, top_m, spec.fine_step_m, spec.fine_zones)


MINIMA_M = (1.5, 2.0, 3.0)  # default minimum heights of deliveries
QUARTERS = (0.25, 0.5, 0.75, 1.0)  # default dips, relative to the top of the table
INCLINED = 0.010  # tilt above which a horizontal tank counts as inclined, m/m


@dataclass(frozen=True)
class Statements:
    """Statements about a table.

    Attributes
    ----------
    volumes, deliveries : tuple of Budget
        Budgets of dips and of pairs of dips, requested in the job or by default.
    worst : tuple of WorstDeliveries
        For each minimum height, in ascending order.
    limits : tuple of TankLimit
        From the levels of the job; their budgets are among the volumes and deliveries.
    """

    volumes: tuple[Budget, ...]
    deliveries: tuple[Budget, ...]
    worst: tuple[WorstDeliveries, ...]
    limits: tuple["TankLimit", ...] = ()

    @property
    def pairs(self):
        """Pairs (low_m, high_m) of the deliveries."""
        return tuple(
            (stated_delivery.low_m, stated_delivery.high_m) for stated_delivery in self.deliveries
        )


@dataclass(frozen=True)
class TankLimit:
    """Volume below an operating level (low_m: None) or between two.

    Attributes
    ----------
    code : str
        Below a dip: "full", "maximum", "minimum", "pump_suction", "below_table".
        Between two dips: "working_capacity", "pumpable", "reserve".
    low_m, high_m : float
        Dips, m.
    """

    code: str
    low_m: float | None
    high_m: float


def tank_limits(levels, table):
    """Return the `TankLimit`s that follow from the levels of a job.

    Parameters
    ----------
    levels : Levels or None
    table : Capacity

    Returns
    -------
    tuple of TankLimit
        The levels from the top down, then the volumes between them.
    """
    if levels is None:
        return ()
    dips = {
        "full": levels.full_m,
        "maximum": levels.maximum_m,
        "minimum": levels.minimum_m,
        "pump_suction": levels.pump_suction_m,
        # No liquid is below the lowest row of a tank whose dip plate is its lowest point.
        "below_table": float(table.height_m[0]) if table.volume_m3[0] > 0 else None,
    }
    between = (
        ("working_capacity", "minimum", "maximum"),
        ("pumpable", "pump_suction", "maximum"),
        ("reserve", "maximum", "full"),
    )
    volumes = [TankLimit(code, None, dip) for code, dip in dips.items() if dip is not None]
    ends = [(code, dips[low], dips[high]) for code, low, high in between]
    deliveries = [
        TankLimit(code, low, high)
        for code, low, high in ends
        if None not in (low, high) and low < high
    ]
    return (*volumes, *deliveries)


def statements(job, table, largest_interpolation_m3):
    """Statements about a table, requested in the job or by default.

    Parameters
    ----------
    job : Job
    table : Capacity
        Capacity table of the job.
    largest_interpolation_m3 : float
        Largest error of linear interpolation between two rows, m3.

    Returns
    -------
    Statements
        Volumes at the dips of stated.csv, or by default at the rows next to the quarters of the
        table. Deliveries of stated.csv, then for each minimum height the delivery with the largest
        U relative to its volume. The volumes of the operating levels follow those of their kind.

    Raises
    ------
    InputError
        For a stated dip or an operating level outside the table.
    """
    _refuse_outside(job, table)
    limits = tank_limits(job.levels, table)
    reading = reading_sources(job.inputs, largest_interpolation_m3)
    dips = [
        stated_delivery.high_m for stated_delivery in job.stated if stated_delivery.low_m is None
    ] or _quarters(table)
    dips += [limit.high_m for limit in limits if limit.low_m is None]
    worst = _worst(job, table)
    pairs = [
        (stated_delivery.low_m, stated_delivery.high_m)
        for stated_delivery in job.stated
        if stated_delivery.low_m is not None
    ]
    pairs += [
        (deliveries_of_height.at_minimum.low_m, deliveries_of_height.at_minimum.high_m)
        for deliveries_of_height in worst
        if deliveries_of_height.at_minimum
    ]
    pairs += [(limit.low_m, limit.high_m) for limit in limits if limit.low_m is not None]
    return Statements(
        volumes=tuple(budget(table, dip, reading=reading) for dip in dict.fromkeys(dips)),
        deliveries=tuple(
            budget(table, high, low, reading=reading) for low, high in dict.fromkeys(pairs)
        ),
        worst=worst,
        limits=limits,
    )


def pairs_to_simulate(stated, job, body, table):
    """Pairs (low_m, high_m) of the `Statements` and of the deliveries that decide a rule."""
    judged = () if job.rule is None else deliveries_to_check(job.rule, table, _tank(job, body))
    return tuple(dict.fromkeys((*stated.pairs, *judged)))


def stated_volume(table, intervals, height_m):
    """Volume at a dip with its printed U (`capacity.Quantity`), without the reading.

    U is that of the row. Between two rows, one of which has a Monte Carlo result, U is the largest
    of all.

    Parameters
    ----------
    table : Capacity
    intervals : simulation.Intervals
        Intervals of the rows of the table.
    height_m : float
        Dip, m.

    Raises
    ------
    HeightError
        For a dip outside the table.
    """
    quantity, rows = table.at(height_m), table.rows_of(height_m)
    if np.all(intervals.by_gum[rows]):
        return quantity
    U = PrintedU(intervals.U_m3, intervals.by_gum).of(table, None, height_m, quantity.U_m3)
    if len(rows) == 1:
        ends = float(intervals.low_m3[rows[0]]), float(intervals.high_m3[rows[0]])
        return _replace_interval(quantity, U, ends)
    return quantity if quantity.U_m3 == U else _replace_interval(quantity, U, None)


def stated_delivery(table, simulation, low_m, high_m):
    """Volume between two dips with its printed U (`capacity.Quantity`), without the readings.

    A delivery that was not simulated has the U of the law of propagation, and its interval states
    this. Down to the empty tank, such a delivery has at least the U of the volume at its upper dip:
    the law of propagation lets errors cancel that do not (docs/studies/propagation.md).

    Parameters
    ----------
    table : Capacity
    simulation : simulation.TableSimulation or None
    low_m, high_m : float
        Dips, m.

    Raises
    ------
    HeightError
        For a dip outside the table.
    """
    quantity = table.delivery(low_m, high_m)
    if simulation is None:
        return quantity
    delivered = simulation.delivered
    is_same = np.isclose(delivered.low_m, low_m, rtol=0, atol=SAME_M)
    is_same &= np.isclose(delivered.high_m, high_m, rtol=0, atol=SAME_M)
    if not np.any(is_same):
        if quantity.value_m3 == table.at(high_m).value_m3:
            volume = stated_volume(table, simulation.intervals(table), high_m)
            if volume.U_m3 >= quantity.U_m3:
                return volume
        return replace(quantity, interval="gum_not_simulated")
    place, of_delivered = int(np.argmax(is_same)), simulation.of_delivered
    if of_delivered.by_gum[place]:
        return quantity
    ends = float(of_delivered.low_m3[place]), float(of_delivered.high_m3[place])
    return _replace_interval(quantity, float(of_delivered.U_m3[place]), ends)


def _replace_interval(quantity, U_m3, ends_m3):
    """Replace U and interval of a quantity by those of the Monte Carlo method."""
    return replace(quantity, k=None, U_m3=U_m3, interval="monte_carlo", ends_m3=ends_m3)


def verdict_of(job, body, table, intervals, simulation):
    """`rules.RuleVerdict` of the job's decision rule with the printed U; None without a rule.

    Parameters
    ----------
    job : Job
    body : Body
    table : Capacity
    intervals : simulation.Intervals
        Intervals of the rows.
    simulation : simulation.TableSimulation or None
    """
    if job.rule is None:
        return None
    printed = _make_printed_U(intervals, simulation)
    return judge(
        job.rule,
        table,
        _tank(job, body),
        stated=tuple(
            StatedVolume(stated_delivery.volume_m3, stated_delivery.high_m, stated_delivery.low_m)
            for stated_delivery in job.stated
            if stated_delivery.volume_m3 is not None
        ),
        printed=printed,
    )


def _make_printed_U(intervals, simulation):
    """`rules.PrintedU` of the rows and of the simulated deliveries."""
    if simulation is None:
        return PrintedU(intervals.U_m3)
    delivered = simulation.delivered
    U = delivered.U_m3
    printed = simulation.of_delivered.U_m3
    # Deliveries that were not simulated get the largest ratio of the smooth simulated deliveries.
    ratio = np.divide(printed, U, out=np.ones(len(U)), where=U > 0)
    factor = np.max(ratio[simulation.smooth], initial=1.0)
    pairs = zip(delivered.low_m.tolist(), delivered.high_m.tolist(), strict=True)
    of_pairs = dict(zip(pairs, printed.tolist(), strict=True))
    return PrintedU(intervals.U_m3, intervals.by_gum, of_pairs, float(factor))


def _worst(job, table):
    """`WorstDeliveries` of the minimum heights.

    Raises InputError for a height in the job without any delivery. Default heights without a
    delivery are omitted. The height of the table rounded to a millimetre counts as its height.
    """
    height = float(np.ptp(table.height_m))
    worst_by_height = {
        height_m: worst_deliveries(
            table, min(height_m, height) if height_m <= round(height, 3) else height_m
        )
        for height_m in sorted(
            MINIMA_M if job.table.minimum_delivery_m is None else job.table.minimum_delivery_m
        )
    }
    if job.table.minimum_delivery_m is not None:
        problems = [
            Problem(
                SETTINGS_FILE,
                message(
                    "no_such_delivery",
                    "found {one:g}; expected at most {height:g} m: no two usable dips of the "
                    "table are further apart",
                    one=height_m,
                    height=height,
                ),
                column="table.minimum_delivery_m",
            )
            for height_m, worst in worst_by_height.items()
            if worst is None
        ]
        if problems:
            raise InputError(problems)
    return tuple(worst for worst in worst_by_height.values() if worst is not None)


def _refuse_outside(job, table):
    """Raise InputError for stated dips and levels outside the table (to the top of the shell)."""
    dips = [
        (stated_delivery.file, stated_delivery.row, column, dip)
        for stated_delivery in job.stated
        for column, dip in (("low_m", stated_delivery.low_m), ("high_m", stated_delivery.high_m))
    ]
    levels = {} if job.levels is None else vars(job.levels)
    dips += [(SETTINGS_FILE, None, f"levels.{name}", dip) for name, dip in levels.items()]
    top = max(round(table.height_m[-1], 3), table.height_m[-1])
    problems = [
        Problem(
            file,
            message(
                "stated_outside_table",
                "found {dip:g}; expected {low:g} to {top:g}, the dips of the table",
                dip=dip,
                low=table.height_m[0],
                top=top,
            ),
            row,
            column,
        )
        for file, row, column, dip in dips
        if dip is not None and not table.height_m[0] <= dip <= top
    ]
    if problems:
        raise InputError(problems)


def _quarters(table):
    """Dips of the rows next to the quarters, with the top row last; a short table has fewer."""
    dips_m = np.array(QUARTERS) * table.height_m[-1]
    rows = np.argmin(np.abs(table.height_m[:, None] - dips_m), axis=0)
    return table.height_m[np.unique(rows)].tolist()


def _tank(job, body):
    """Kind of tank in the terms of the rules; a scanned tank is classified by its measured tilt."""
    if job.tank.kind == "vertical":
        return "vertical_fixed_roof" if job.roof is None else "vertical_floating_roof"
    if job.tank.kind == "horizontal":
        return "inclined" if abs(body.parts[0].solid.tilt) > INCLINED else "horizontal"
    return "sphere" if job.tank.kind == "sphere" else "other"
