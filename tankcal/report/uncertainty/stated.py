"""Stated uncertainty: uncertain inputs, rows of the table, volumes and deliveries.

If Monte Carlo does not validate the GUM interval, the Monte Carlo interval is stated. U is then the
larger distance of its ends from the volume (docs/studies/propagation.md).
"""

import math
from dataclasses import dataclass
from itertools import groupby

from tankcal.report.tables import Column, Table
from tankcal.tank.gauging import room_levels
from tankcal.text.digits import LITRE_DECIMALS, decimals_of


@dataclass(frozen=True)
class Group:
    """Columns `first` to `last` (from 0) of the covariance factor with a common source and dof."""

    name: str
    first: int
    last: int
    dof: float


def critical_zone(record):
    """Return the dips (low, high), m, of the critical zone of a floating roof, or None."""
    if not record["roof"] or not record["job"]["corrections"]["roof"]:
        return None
    roof = roof_of(record)
    return roof["roof_critical_bottom"], roof["roof_critical_top"]


def roof_of(record):
    """Return the values of the floating roof, {code: value}."""
    return {line["code"]: line["value"] for line in record["roof"]}


def read_room_levels(record):
    """Return {name of a room: dip} of the operating levels that the calculators can use."""
    heights = record["capacity"]["height_m"]
    zone = None
    if record["roof"]:
        roof = roof_of(record)
        zone = roof["roof_critical_bottom"], roof["roof_critical_top"]
    return room_levels(record["job"].get("levels") or {}, heights[0], heights[-1], zone)


def is_roof_in_table(record):
    """Whether the table contains the displacement of the floating roof."""
    return all(choice["value"] != "off" for choice in record["choices"] if choice["code"] == "roof")


def groups_of(kinds, lines):
    """Return the sources of the columns of the covariance factor.

    Columns with a common estimate form one source. Several sources of one kind, such as items of
    deadwood or instruments, have as many columns as lines.

    Parameters
    ----------
    kinds : list of str
        Kind of input of each column.
    lines : list of dict
        Lines of the budget, in the order of the columns. Correlated inputs "a & b" have a line
        each. As a group they have the smallest of their degrees of freedom.

    Returns
    -------
    list of Group
    """
    remaining, groups, column = list(lines), [], 0
    for kind, run in groupby(kinds):
        count, names = len(list(run)), [kind]
        if not any(line["kind"] == kind for line in remaining):
            names = kind.split(" & ")
        while remaining[0]["kind"] not in names:  # a source without columns
            remaining.pop(0)
        end = next(
            (i for i, line in enumerate(remaining) if line["kind"] not in names), len(remaining)
        )
        each = [
            math.inf if (dof := remaining.pop(0)["dof"]) is None else dof
            for _ in range(end if len(names) == 1 else len(names))
        ]
        if len(names) == 1 and len(each) == count:
            groups += [Group(kind, column + i, column + i, dof) for i, dof in enumerate(each)]
        else:
            groups.append(Group(kind, column, column + count - 1, min(each)))
        column += count
    return groups


MONTE_CARLO = "monte_carlo"  # code of a Monte Carlo interval in the record
UNLIMITED = "∞"  # infinite degrees of freedom
MARK = "*"  # mark of rows with a Monte Carlo interval
_SAME_M = 1e-9  # tolerance for equal dips


def stated_U_m3(capacity):
    """Return the stated U of all rows, m3."""
    return capacity.get("stated_U_m3", capacity["U_m3"])


def flag_simulated(capacity):
    """Return for all rows whether the interval is a result of Monte Carlo."""
    # Records of earlier versions have no intervals: all are results of the GUM.
    sources = capacity.get("interval", ["gum"] * len(capacity["volume_m3"]))
    return [source == MONTE_CARLO for source in sources]


def k_of_rows(capacity):
    """Return the coverage factors of all rows; None for a Monte Carlo interval."""
    pairs = zip(capacity["k"], flag_simulated(capacity), strict=True)
    return [None if simulated else k for k, simulated in pairs]


def uneven_rows(capacity):
    """Return the indices of rows whose interval is asymmetric within the digits of U."""
    indices = []
    for row, (simulated, U) in enumerate(
        zip(flag_simulated(capacity), stated_U_m3(capacity), strict=True)
    ):
        if simulated:
            values = (capacity[key][row] for key in ("volume_m3", "low_m3", "high_m3"))
            if _is_uneven(*values, U):
                indices.append(row)
    return indices


def stated_rows(record):
    """Return the stated volumes and deliveries of `budgets` as rows (list of dict).

    The list is empty if no input of the table is uncertain and no volume was requested. In this
    case U would contain the contribution of the reading only, and could be mistaken for the U of
    the tank.

    The keys are low_m, high_m, volume_m3, U_m3, k (None: Monte Carlo), dof (None: infinite),
    relative (None: volume 0), low_m3 and high_m3 (None: symmetric interval), simulated and for_use.
    minimum_m is the minimum height for which the delivery is the worst (or None). stated_m3 and
    note are taken from stated.csv. Volumes of the operating levels have a table of their own
    (`limit_rows`).
    """
    budgets = record.get("budgets", [])
    asked = any(budget.get("stated_m3") is not None or budget.get("note") for budget in budgets)
    if not asked and not any(stated_U_m3(record["capacity"])):
        return []
    limits = {_dips(limit) for limit in record.get("limits") or ()}
    return [
        _stated_row(record, budget)
        for budget in budgets
        if _dips(budget) not in limits or budget["stated_m3"] is not None or budget["note"]
    ]


def _dips(row):
    return row["low_m"], row["high_m"]


def limit_rows(record):
    """Return the volumes of the operating levels, as `stated_rows` with the key tank_limit."""
    budgets = {_dips(budget): budget for budget in record.get("budgets", ())}
    return [
        _stated_row(record, budgets[_dips(limit)]) | {"tank_limit": limit["code"]}
        for limit in record.get("limits") or ()
    ]


def _stated_row(record, budget):
    U, low, high = (
        budget.get("stated_U_m3", budget["U_m3"]),
        budget.get("low_m3"),
        budget.get("high_m3"),
    )
    simulated, volume = budget.get("interval") == MONTE_CARLO, budget["volume_m3"]
    if not (simulated and _is_uneven(volume, low, high, U)):
        low = high = None
    return {
        **{key: budget[key] for key in ("low_m", "high_m", "volume_m3", "for_use")},
        "U_m3": U,
        "k": None if simulated else budget["k"],
        "dof": budget.get("dof"),
        "relative": U / volume if volume else None,
        "low_m3": low,
        "high_m3": high,
        "simulated": simulated,
        "minimum_m": _minimum(record, budget),
        "stated_m3": budget.get("stated_m3"),
        "note": budget.get("note"),
    }


def _minimum(record, budget):
    """Return the minimum height for which a delivery is the worst, or None."""
    for worst in record.get("deliveries") or []:
        if is_same_delivery(worst["at_minimum"], budget):
            return worst["minimum_m"]
    return None


def is_same_delivery(first, second):
    """Return whether two deliveries have equal dips; False if one of them is None."""
    if first is None or second is None or second["low_m"] is None:
        return False
    return all(abs(first[key] - second[key]) < _SAME_M for key in ("low_m", "high_m"))


def _is_uneven(volume, low, high, U):
    return abs((high - volume) - (volume - low)) > 10.0 ** -decimals_of(U)


# ---- deliveries with the largest uncertainty, for each minimum height

# Keys of the worst deliveries in the record.
CRITERIA = ("absolute", "relative", "at_minimum")


def worst_delivery_rows(paper):
    """Return a row for each minimum height and criterion, each delivery once (list of dict)."""
    return [
        delivery | {"minimum_m": entry["minimum_m"], "which": paper.word(f"worst.{name}")}
        for entry in paper.record["deliveries"]
        for name in CRITERIA
        if (delivery := entry[name])
        and not (name == "relative" and is_same_delivery(delivery, entry["at_minimum"]))
    ]


def worst_deliveries(paper):
    """Table of the worst deliveries."""
    return [paper.show(WORST_DELIVERIES, worst_delivery_rows(paper))]


WORST_DELIVERIES = Table(
    "worst_deliveries",
    (
        Column("minimum_m", "m", height=True, sheet="at_least_m"),
        Column("which", sheet="largest", width=44),
        Column("high_m", "m", height=True, heading="dip_high", sheet="from_dip_m"),
        Column("low_m", "m", height=True, heading="dip_low", sheet="down_to_m"),
        Column("volume_m3", "m3", u="U_m3", least=LITRE_DECIMALS, sheet="volume_m3", width=14),
        Column("U_m3", "m3", u="U_m3", sheet="U_m3"),
        Column("k", decimals=2, sheet="k", width=10),
        Column("relative", "share", digits=2, align="right", sheet="relative"),
        Column("u_m3", "m3", u="u_m3", on="", sheet="standard_u_m3", width=14),
        Column("dof", decimals=0, nothing=UNLIMITED, on="", sheet="dof"),
    ),
    last={"sheet": "minimum_m u_m3 dof which"},
)
