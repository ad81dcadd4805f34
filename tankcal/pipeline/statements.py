"""What is stated of a table beside its rows: budgets, the worst deliveries, a rule's verdict."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.tank.budgets import Budget, budget, reading_sources
from tankcal.tank.capacity import SAME_M
from tankcal.tank.deliveries import WorstDeliveries, worst_deliveries
from tankcal.tank.rules import Printed, StatedVolume, deliveries_to_check, judge

MINIMA_M = (1.5, 2.0, 3.0)  # of deliveries, where the job names none
QUARTERS = (0.25, 0.5, 0.75, 1.0)  # of the table, where the job names no dips
INCLINED = 0.010  # tilt from which a lying tank is an inclined one, m/m


@dataclass(frozen=True)
class Statements:
    """volumes, deliveries  `Budget`s of dips and of pairs of dips, as the job asks or by default
    worst  `WorstDeliveries` of each minimum height, ascending
    """

    volumes: tuple[Budget, ...]
    deliveries: tuple[Budget, ...]
    worst: tuple[WorstDeliveries, ...]

    @property
    def pairs(self):
        """((low_m, high_m), ...) of the deliveries."""
        return tuple(
            (stated_delivery.low_m, stated_delivery.high_m) for stated_delivery in self.deliveries
        )


def statements(job, table, largest_interpolation_m3):
    """What is stated of a table beside its rows, as the job asks or by default.

    Parameters
    ----------
    job : Job
    table : Capacity
        Made from it.
    largest_interpolation_m3 : float
        Largest error of linear interpolation between two rows, m3.

    Returns
    -------
    Statements
        Volumes at the dips of stated.csv, else at the rows next to the quarters of the table. The
        deliveries of stated.csv, then of each minimum height the worst one by U over its volume.

    Raises
    ------
    InputError
        For a stated dip outside the table.
    """
    _refuse_outside(job.stated, table)
    reading = reading_sources(job.inputs, largest_interpolation_m3)
    dips = [
        stated_delivery.high_m for stated_delivery in job.stated if stated_delivery.low_m is None
    ] or _quarters(table)
    worst = _worst(job, table)
    pairs = [
        (stated_delivery.low_m, stated_delivery.high_m)
        for stated_delivery in job.stated
        if stated_delivery.low_m is not None
    ]
    pairs += [(one.at_minimum.low_m, one.at_minimum.high_m) for one in worst if one.at_minimum]
    return Statements(
        volumes=tuple(budget(table, dip, reading=reading) for dip in dips),
        deliveries=tuple(
            budget(table, high, low, reading=reading) for low, high in dict.fromkeys(pairs)
        ),
        worst=worst,
    )


def pairs_to_simulate(stated, job, body, table):
    """((low_m, high_m), ...) of the `Statements`, then of the deliveries a rule is decided by."""
    judged = () if job.rule is None else deliveries_to_check(job.rule, table, _tank(job, body))
    return tuple(dict.fromkeys((*stated.pairs, *judged)))


def stated_volume(table, intervals, height_m):
    """The volume at a dip with the U that is printed (`capacity.Quantity`), reading left out.

    That of its row; between two rows, of which one has Monte Carlo's, the largest of all.

    Parameters
    ----------
    table : Capacity
    intervals : simulation.Intervals
        Of the rows of the table.
    height_m : float
        Dip, m; HeightError outside the table.
    """
    found, rows = table.at(height_m), table.rows_of(height_m)
    if np.all(intervals.by_gum[rows]):
        return found
    U = Printed(intervals.U_m3, intervals.by_gum).of(table, None, height_m, found.U_m3)
    if len(rows) == 1:
        ends = float(intervals.low_m3[rows[0]]), float(intervals.high_m3[rows[0]])
        return _by_monte_carlo(found, U, ends)
    return found if found.U_m3 == U else _by_monte_carlo(found, U, None)


def stated_delivery(table, simulation, low_m, high_m):
    """The volume between two dips with the U that is printed (`capacity.Quantity`).

    Reading is left out. One that was not simulated has the U of the law of propagation, and says
    so. HeightError outside the table.

    Parameters
    ----------
    table : Capacity
    simulation : simulation.TableSimulation or None
    low_m, high_m : float
        Dips, m.
    """
    found = table.delivery(low_m, high_m)
    if simulation is None:
        return found
    one = simulation.delivered
    same = np.isclose(one.low_m, low_m, rtol=0, atol=SAME_M)
    same &= np.isclose(one.high_m, high_m, rtol=0, atol=SAME_M)
    if not np.any(same):
        return replace(found, interval="gum_not_simulated")
    place, of_delivered = int(np.argmax(same)), simulation.of_delivered
    if of_delivered.by_gum[place]:
        return found
    ends = float(of_delivered.low_m3[place]), float(of_delivered.high_m3[place])
    return _by_monte_carlo(found, float(of_delivered.U_m3[place]), ends)


def _by_monte_carlo(found, U_m3, ends_m3):
    return replace(found, k=None, U_m3=U_m3, interval="monte_carlo", ends_m3=ends_m3)


def verdict_of(job, body, table, intervals, simulation):
    """`rules.RuleVerdict` of the job's decision rule, with the U that is printed; None without one.

    intervals  `simulation.Intervals` of the rows; simulation  `TableSimulation` or None
    """
    if job.rule is None:
        return None
    printed = _printed(intervals, simulation)
    return judge(job.rule, table, _tank(job, body), stated=_stated(job), printed=printed)


def _printed(intervals, simulation):
    """`rules.Printed`: of the rows, and of the deliveries that were simulated."""
    if simulation is None:
        return Printed(intervals.U_m3)
    delivered = simulation.delivered
    U = delivered.U_m3
    printed = simulation.of_delivered.U_m3
    ratio = np.divide(printed, U, out=np.ones(len(U)), where=U > 0)
    factor = np.max(ratio[simulation.smooth], initial=1.0)
    pairs = zip(delivered.low_m.tolist(), delivered.high_m.tolist(), strict=True)
    of_pairs = dict(zip(pairs, printed.tolist(), strict=True))
    return Printed(intervals.U_m3, intervals.by_gum, of_pairs, float(factor))


def _worst(job, table):
    """`WorstDeliveries` of the least heights; InputError for one that the job names and none is of.

    Of the heights that are looked at where it names none, those count that fit. The height of the
    table rounded to a millimetre counts as its height.
    """
    height = float(np.ptp(table.height_m))
    found = {
        one: worst_deliveries(table, min(one, height) if one <= round(height, 3) else one)
        for one in _minima(job)
    }
    if job.table.minimum_delivery_m is not None:
        problems = [
            Problem(
                SETTINGS_FILE,
                message(
                    "no_such_delivery",
                    "found {one:g}; expected at most {height:g} m: no two usable dips of the "
                    "table are further apart",
                    one=one,
                    height=height,
                ),
                column="table.minimum_delivery_m",
            )
            for one, worst in found.items()
            if worst is None
        ]
        if problems:
            raise InputError(problems)
    return tuple(worst for worst in found.values() if worst is not None)


def _refuse_outside(stated, table):
    """Raise InputError for every dip that the table, whose top is the shell's own, lacks."""
    top = max(round(table.height_m[-1], 3), table.height_m[-1])
    problems = [
        Problem(
            stated_delivery.file,
            message(
                "stated_outside_table",
                "found {dip:g}; expected {low:g} to {top:g}, the dips of the table",
                dip=dip,
                low=table.height_m[0],
                top=top,
            ),
            stated_delivery.row,
            column,
        )
        for stated_delivery in stated
        for column, dip in (("low_m", stated_delivery.low_m), ("high_m", stated_delivery.high_m))
        if dip is not None and not table.height_m[0] <= dip <= top
    ]
    if problems:
        raise InputError(problems)


def _minima(job):
    given = job.table.minimum_delivery_m
    return MINIMA_M if given is None else tuple(sorted(given))


def _quarters(table):
    """Dips of the rows next to the quarters, the top row last; a short table has fewer."""
    wanted = np.array(QUARTERS) * table.height_m[-1]
    rows = np.argmin(np.abs(table.height_m[:, None] - wanted), axis=0)
    return table.height_m[np.unique(rows)].tolist()


def _stated(job):
    """The volumes that an earlier table or a contract states."""
    return tuple(
        StatedVolume(stated_delivery.volume_m3, stated_delivery.high_m, stated_delivery.low_m)
        for stated_delivery in job.stated
        if stated_delivery.volume_m3 is not None
    )


def _tank(job, body):
    """The kind of tank in the words of the rules; that of a scanned one by its own tilt."""
    if job.tank.kind == "vertical":
        return "vertical_fixed_roof" if job.roof is None else "vertical_floating_roof"
    if job.tank.kind == "horizontal":
        return "inclined" if abs(body.parts[0].solid.tilt) > INCLINED else "horizontal"
    return "sphere" if job.tank.kind == "sphere" else "other"
