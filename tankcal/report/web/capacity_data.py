"""What the calculator of the page needs of a record: its rows, and what deliveries are made of.

The script computes as the workbook's calculator and `Capacity.delivery` do. The covariance factor
of a long table is nearly straight between few of its rows: only those are kept.
"""

import numpy as np

from tankcal.record.covariance_factor import factor_of
from tankcal.report.blocks import Block
from tankcal.report.numbers import unit
from tankcal.report.uncertainty.sources import critical_zone, groups_of
from tankcal.report.uncertainty.stated import by_monte_carlo, stated_rows, stated_U_m3
from tankcal.report.web.packing import packed
from tankcal.text.digits import decimals_of_rows
from tankcal.uncertainty import coverage_factor

BEND = 1e-6  # of the largest u: how far the factor may be from the straight line between kept rows
_NODES = 32  # at which k is given: the script interpolates log k over 1/dof


def calculator(paper):
    """The block of the calculator, for the record of a paper: shown on the page only."""
    record = paper.record
    capacity, spec = record["capacity"], record["job"]["table"]
    shown = unit(spec["volume_unit"])
    U = np.array(stated_U_m3(capacity)) * shown.factor
    height_m = capacity["height_m"]
    return Block(
        {
            "kind": "calculator",
            "text": paper.word("web.calculator_here"),
            "unit": shown.symbol,
            "least": shown.least,
            "reference_height_m": record["job"]["datum"]["reference_height_m"],
            "coverage": paper.coverage(),
            "critical_m": critical_zone(record),
            "height_m": packed(height_m),
            "volume": packed(np.array(capacity["volume_m3"]) * shown.factor),
            "U": packed(U),
            "u": packed(np.array(capacity["u_m3"]) * shown.factor, "<f4"),
            "k": packed(capacity["k"], "<f4"),
            "decimals": packed(decimals_of_rows(U), "u1"),
            "simulated": packed(by_monte_carlo(capacity), "u1"),
            "deliveries": _deliveries(record, shown.factor),
        }
    )


def _deliveries(record, unit_factor):
    """The factor at its kept rows, its sources, k by degrees of freedom, and what is stated."""
    capacity = record["capacity"]
    factor = factor_of(capacity) * unit_factor
    height_m = np.array(capacity["height_m"])
    largest = np.linalg.norm(factor, axis=1).max(initial=0.0)
    rows = straight_rows(height_m, factor, BEND * largest)
    owner, dof = sources_of(record)
    least_dof = min((one for one in dof if one is not None), default=None)
    return {
        "rows": packed(rows, "<u4"),
        "columns": factor.shape[1],
        "factor": packed(factor[rows], "<f4"),
        "source": owner,
        "dof": dof,
        "k": _k_of_dof(record["job"]["table"]["coverage_probability"], least_dof),
        "stated": [
            {key: one[key] for key in ("low_m", "high_m", "k")} | {"U": one["U_m3"] * unit_factor}
            for one in stated_rows(record)
            if one["low_m"] is not None
        ],
    }


def straight_rows(height_m, factor, bend):
    """Numbers of the rows to keep: (n,) first and last and each where the factor bends.

    height_m  (rows,)
    factor    (rows, c): its rows between kept ones are within `bend` (norm) of the straight line
    """
    kept, open_pieces = {0, len(height_m) - 1}, [(0, len(height_m) - 1)]
    while open_pieces:
        first, last = open_pieces.pop()
        if last - first < 2:
            continue
        part = (height_m[first : last + 1] - height_m[first]) / (height_m[last] - height_m[first])
        line = factor[first] + part[:, None] * (factor[last] - factor[first])
        departure = np.linalg.norm(factor[first : last + 1] - line, axis=1)
        if departure.max() > bend:
            middle = first + int(np.clip(np.argmax(departure), 1, last - first - 1))
            kept.add(middle)
            open_pieces += [(first, middle), (middle, last)]
    return np.array(sorted(kept))


def sources_of(record):
    """(number of the source of each column of the factor, degrees of freedom of each source).

    None stands for infinite ones.
    """
    groups = groups_of(record["capacity"]["input_kind"], record["budget"])
    owner = [i for i, one in enumerate(groups) for _ in range(one.first, one.last + 1)]
    return owner, [one.dof if np.isfinite(one.dof) else None for one in groups]


def _k_of_dof(probability, least_dof):
    """k at Chebyshev's points of 1/dof from 0 to 1/least_dof; the same k at both ends: normal."""
    widest = 0.0 if least_dof is None else 1 / least_dof
    nodes = widest * (1 - np.cos(np.pi * np.arange(_NODES + 1) / _NODES)) / 2
    with np.errstate(divide="ignore"):
        k = coverage_factor(probability, 1 / nodes)
    return {"inverse_dof": packed(nodes), "log_k": packed(np.log(k)), "least_dof": least_dof}
