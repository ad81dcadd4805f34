"""The part of the record that says what is stated: budgets, deliveries, rule, Monte Carlo."""

from dataclasses import asdict, fields

import numpy as np

from tankcal.gum.volume_budgets import budget
from tankcal.record.rules import as_json


def budget_of(result):
    """What contributes to the uncertainty of the top row, by the table alone."""
    top = budget(result.table, result.table.height_m[-1])
    return [line_of(line) for line in top.lines]


def line_of(line):
    """A `gum.BudgetRow`, with the unit of its sensitivity."""
    return {
        "input": line.name,
        "kind": line.name,
        "estimate": line.estimate,
        "u": line.u,
        "unit": line.unit or None,
        "type": line.type,
        "distribution": line.distribution,
        "dof": line.dof,
        "sensitivity": line.sensitivity,
        "sensitivity_unit": _sensitivity_unit(line.unit),
        "contribution_m3": line.contribution,
        "share": line.share,
        "halved": line.halved,
        "is_default": line.is_default,
        "correlations": line.correlations,
        "note": line.note,
    }


def _sensitivity_unit(unit):
    """Cubic metres by the unit of the input; that of an input in cubic metres is 1."""
    if not unit:
        return None
    return {"1/K": "m3 K", "m3": "1"}.get(unit, f"m3/{unit}")


def budgets_of(result):
    """Volumes and deliveries that the report states, each with its budget and its interval."""
    simulation = result.simulation
    asked = {(one.low_m, one.high_m): one for one in result.job.stated}
    found = [_budget_of(one, asked, None, _of_volume(one, result)) for one in result.stated.volumes]
    delivered = simulation and simulation.of_delivered
    for number, one in enumerate(result.stated.deliveries):
        judged = simulation and _of_place(simulation.of_deliveries[1], number)
        interval = simulation and _of_place(delivered, number)
        found.append(_budget_of(one, asked, judged, _of_delivery(one, interval)))
    return found


def _of_volume(one, result):
    """The interval of a volume that counts: that of its row; U between rows is the largest."""
    rows = result.table.rows_of(one.high_m)
    intervals = result.intervals
    if np.all(intervals.by_gum[rows]):
        return _even(one.volume_m3, one.U_m3, "gum")
    if len(rows) > 1:
        U = float(np.hypot(intervals.U_m3[rows].max(), one.reading_U_m3))
        return _even(one.volume_m3, max(one.U_m3, U), "gum" if one.U_m3 >= U else "monte_carlo")
    (row,) = rows
    return _with_reading(one, intervals.low_m3[row], intervals.high_m3[row])


def _of_delivery(one, interval):
    """The same of a delivery, by its own interval of the table, or None."""
    if interval is None or interval["by_gum"]:
        return _even(one.volume_m3, one.U_m3, "gum")
    return _with_reading(one, interval["low_m3"], interval["high_m3"])


def _with_reading(one, low_m3, high_m3):
    """Monte Carlo's interval of the table, each side made longer by what reading adds, in squares.

    The errors of reading are each reading's own and as likely up as down; but no tank holds less
    than nothing.
    """
    down = float(np.hypot(one.volume_m3 - low_m3, one.reading_U_m3))
    up = float(np.hypot(high_m3 - one.volume_m3, one.reading_U_m3))
    low = one.volume_m3 - down
    low = max(low, 0.0) if one.low_m is None else low
    return _interval(max(down, up), low, one.volume_m3 + up, "monte_carlo")


def _even(volume_m3, U_m3, source):
    return _interval(U_m3, volume_m3 - U_m3, volume_m3 + U_m3, source)


def _interval(U_m3, low_m3, high_m3, source):
    return {"stated_U_m3": U_m3, "low_m3": low_m3, "high_m3": high_m3, "interval": source}


def _budget_of(one, asked, judged, interval):
    stated = asked.get((one.low_m, one.high_m))
    return {
        **{key: getattr(one, key) for key in _BUDGET},
        **interval,
        "stated_m3": stated and stated.volume_m3,
        "note": stated.note if stated else "",
        "monte_carlo": judged,
        "lines": [line_of(line) for line in one.lines],
    }


_BUDGET = ("low_m", "high_m", "volume_m3", "table_u_m3", "u_m3", "dof", "k", "U_m3", "for_use")


def _of_place(columns, number):
    """What a `Verdict` or `Intervals` say of one volume."""
    return {one.name: getattr(columns, one.name)[number] for one in fields(columns)}


def deliveries_of(result):
    """The worst delivery of each minimum height."""
    return [asdict(worst) for worst in result.stated.worst]


def rule_of(result):
    """The verdict of the job's decision rule; None without one."""
    return None if result.rule is None else as_json(result.rule)


def monte_carlo_of(result):
    """The simulation of every row, and whether the GUM interval stands; None where it is off."""
    simulation = result.simulation
    if simulation is None:
        return None
    return {
        "seed": simulation.seed,
        "probability": simulation.found.probability,
        "digits": simulation.digits,
        "curved": simulation.curved,
        "drawn": simulation.drawn,
        "validated": int(np.sum(simulation.judged.validated)),
        "rows": _of_volumes(simulation.found, simulation.judged) | {"bent": simulation.bent},
        "deliveries": {
            "low_m": simulation.delivered.low_m,
            "high_m": simulation.delivered.high_m,
            **_of_volumes(*simulation.of_deliveries),
        },
    }


def _of_volumes(found, judged):
    names = ("d_low", "d_high", "tolerance", "validated", "sure")
    return {**found.by_volume, **{name: getattr(judged, name) for name in names}}


def intervals_of(result):
    """{key: (rows,)} the interval of each row that counts, and the U that it is stated with."""
    found = result.intervals
    return {
        "low_m3": found.low_m3,
        "high_m3": found.high_m3,
        "interval": np.where(found.by_gum, "gum", "monte_carlo"),
        "stated_U_m3": found.U_m3,
    }
