"""Uncertain inputs of the covariance factor, and the critical zone of a table."""

import math
from dataclasses import dataclass
from itertools import groupby

from tankcal.tank.gauging import room_levels


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
        each = [_dof(remaining.pop(0)) for _ in range(end if len(names) == 1 else len(names))]
        if len(names) == 1 and len(each) == count:
            groups += [Group(kind, column + i, column + i, dof) for i, dof in enumerate(each)]
        else:
            groups.append(Group(kind, column, column + count - 1, min(each)))
        column += count
    return groups


def _dof(line):
    return math.inf if line["dof"] is None else line["dof"]
