"""What uncertain inputs the covariance factor of a record has, and where its table may be used."""

import math
from dataclasses import dataclass
from itertools import groupby


@dataclass(frozen=True)
class Group:
    """Columns of the covariance factor that were found together: first, last (from 0), dof."""

    name: str
    first: int
    last: int
    dof: float


def critical_zone(record):
    """(low, high) dips between which a floating roof forbids the table, or None."""
    if not record["roof"] or not record["job"]["corrections"]["roof"]:
        return None
    roof = roof_of(record)
    return roof["roof_critical_bottom"], roof["roof_critical_top"]


def roof_of(record):
    """{code: value} of the floating roof."""
    return {line["code"]: line["value"] for line in record["roof"]}


def groups_of(kinds, lines):
    """`Group`s of columns of these kinds: columns that were found together are one source.

    lines  of the budget, one for each source in the order of the columns; correlated inputs,
           "a & b", have a line each, and as a group the least degrees of freedom of theirs
    Several sources of one kind (items of deadwood, instruments) have as many columns as lines.
    """
    left, found, column = list(lines), [], 0
    for kind, run in groupby(kinds):
        count, names = len(list(run)), [kind]
        if not any(line["kind"] == kind for line in left):
            names = kind.split(" & ")
        while left[0]["kind"] not in names:  # a source without columns
            left.pop(0)
        own = next((i for i, line in enumerate(left) if line["kind"] not in names), len(left))
        each = [_dof(left.pop(0)) for _ in range(own if len(names) == 1 else len(names))]
        if len(names) == 1 and len(each) == count:
            found += [Group(kind, column + i, column + i, dof) for i, dof in enumerate(each)]
        else:
            found.append(Group(kind, column, column + count - 1, min(each)))
        column += count
    return found


def _dof(line):
    return math.inf if line["dof"] is None else line["dof"]
