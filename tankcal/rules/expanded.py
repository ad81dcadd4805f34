"""Is the expanded uncertainty within its limits, and from which level on?

U(h) <= limit V(h), or limit V(top). With a constant k, U is convex between rows and the limit is
linear, so what holds at two neighbouring rows holds between them. Nothing is divided, so the empty
tank (V = 0) keeps a limit only where U = 0, too. Deliveries are judged over all dips.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.deliveries import Delivery, least_delivery_m, ratio_of, worst_deliveries
from tankcal.errors import HeightError
from tankcal.rules.model import UncertaintyLimit
from tankcal.rules.printed import of_table

_ROUNDING = 1e-12  # relative: U equal to the limit keeps it


@dataclass(frozen=True)
class UncertaintyVerdict:
    """What became of one UncertaintyLimit.

    limit       the UncertaintyLimit
    code        "holds": everywhere; "holds_from": only from `from_m` on; "fails": nowhere;
                "stated": nothing is limited; "nothing_to_judge": no row or delivery is for use
    passed      True for "holds", False for "holds_from" and "fails", else None
    from_m      least dip from which on all rows keep the limit, or least height of deliveries that
                do; None: none does, or nothing is limited
    from_m3     volume at that dip; None for deliveries
    worst_low_m, worst_m   dips of what is nearest to the limit or farthest beyond it; worst_low_m
                is None but for deliveries; both are None where there is nothing to judge
    worst_m3, worst_U_m3   its volume and U
    worst_ratio U over what relative_to names (limit where it is just kept); inf for an empty tank
    """

    limit: UncertaintyLimit
    code: str
    passed: bool | None
    from_m: float | None = None
    from_m3: float | None = None
    worst_low_m: float | None = None
    worst_m: float | None = None
    worst_m3: float | None = None
    worst_U_m3: float | None = None
    worst_ratio: float | None = None


def judge_uncertainty(limit, table, lowest_m=None, printed=None):
    """UncertaintyVerdict of one UncertaintyLimit on a Capacity.

    lowest_m  dip of the start of the calibrated zone; only rows from there on are judged, and
              deliveries between them. None: all.
    printed   `Printed` uncertainties; None: the table's. Deliveries are searched by the table's U,
              taken larger by the factor of the printed ones
    Raises HeightError for a lowest_m above the table's last row.
    """
    if lowest_m is not None and lowest_m > table.height_m[-1]:
        raise HeightError(f"lowest level {lowest_m:g} m: the table ends at {table.height_m[-1]:g}")
    judged = table.for_use(table.height_m)
    if not np.any(judged):
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    printed = printed or of_table(table)
    capacity = float(table.volume_m3[judged][-1])
    if lowest_m is not None:
        judged &= table.height_m >= lowest_m
    if limit.of == "deliveries":
        return _judge_deliveries(limit, _from(table, lowest_m), capacity, printed.factor)
    if limit.of == "capacity":
        judged &= np.arange(len(judged)) == np.flatnonzero(judged).max(initial=-1)
    if not np.any(judged):
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    return _judge_rows(limit, table, printed.rows_m3, np.flatnonzero(judged), capacity)


def _from(table, lowest_m):
    """The table without its rows below a dip."""
    if lowest_m is None:
        return table
    keep = table.height_m >= lowest_m
    sources = tuple(replace(one, columns_m3=one.columns_m3[keep]) for one in table.sources)
    rows = {name: getattr(table, name)[keep] for name in ("height_m", "volume_m3", "area_m2")}
    return replace(table, sources=sources, **rows)


def _judge_rows(limit, table, printed, rows, capacity):
    volume, U = table.volume_m3[rows], printed[rows]
    base = volume if limit.relative_to == "itself" else np.full(len(rows), capacity)
    ratio = ratio_of(U, base)
    keeps = limit.limit * base * (1 + _ROUNDING) >= U
    broken = np.flatnonzero(~keeps)
    first = broken[-1] + 1 if len(broken) else 0
    code = "holds" if not len(broken) else "holds_from" if first < len(rows) else "fails"
    worst = int(np.argmax(ratio))
    return UncertaintyVerdict(
        limit,
        code,
        code == "holds",
        from_m=None if code == "fails" else float(table.height_m[rows[first]]),
        from_m3=None if code == "fails" else float(volume[first]),
        worst_m=float(table.height_m[rows[worst]]),
        worst_m3=float(volume[worst]),
        worst_U_m3=float(U[worst]),
        worst_ratio=float(ratio[worst]),
    )


def _judge_deliveries(limit, table, capacity, factor):
    """factor  by which U of deliveries is larger than the table says."""
    found = worst_deliveries(table, limit.minimum_height_m)
    if found is None:
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    is_relative = limit.relative_to == "itself"
    worst = _larger(found.relative if is_relative else found.absolute, factor)
    if limit.limit is None:
        worst = _larger(found.relative, factor)
        return _of_delivery(limit, "stated", worst, worst.relative)
    bound = limit.limit if is_relative else limit.limit * capacity
    ratio = worst.relative if is_relative else float(ratio_of(worst.U_m3, capacity))
    if (worst.relative if is_relative else worst.U_m3) <= bound * (1 + _ROUNDING):
        return _of_delivery(limit, "holds", worst, ratio, limit.minimum_height_m)
    from_m = least_delivery_m(table, bound / factor * (1 + _ROUNDING), is_relative)
    code = "fails" if from_m is None else "holds_from"
    return _of_delivery(limit, code, worst, ratio, from_m)


def _larger(delivery, factor):
    return replace(delivery, U_m3=factor * delivery.U_m3, relative=factor * delivery.relative)


def _of_delivery(limit, code, worst: Delivery, ratio, from_m=None):
    return UncertaintyVerdict(
        limit,
        code,
        {"holds": True, "stated": None}.get(code, False),
        from_m=from_m,
        worst_low_m=worst.low_m,
        worst_m=worst.high_m,
        worst_m3=worst.volume_m3,
        worst_U_m3=worst.U_m3,
        worst_ratio=ratio,
    )
