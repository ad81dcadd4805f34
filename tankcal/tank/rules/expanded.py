"""Is the expanded uncertainty within its limits, and from which level on?

U(h) <= limit V(h), or limit V(top). With a constant k, U is convex between rows and the limit is
linear, so what holds at two neighbouring rows holds between them. Nothing is divided, so the empty
tank (V = 0) keeps a limit only where U = 0, too. Deliveries are judged over all dips by the law of
propagation, and those that were simulated by what is printed of them: the worst one, and some down
to the lowest dip, where the volume cannot fall below nothing and the errors of the two dips do not
cancel as the law of propagation has it (`deliveries_to_judge`).
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import HeightError
from tankcal.messages import message
from tankcal.tank.deliveries import (
    Delivery,
    deliveries,
    least_delivery_m,
    ratio_of,
    worst_deliveries,
)
from tankcal.tank.rules.model import UncertaintyLimit
from tankcal.tank.rules.printed import printed_of_table

_ROUNDING = 1e-12  # relative: U equal to the limit keeps it
_SAME_M = 1e-6  # heights of deliveries nearer than this are the same
TO_LOWEST = 12  # deliveries to the lowest dip that are simulated for a limit


@dataclass(frozen=True)
class UncertaintyVerdict:
    """What became of one UncertaintyLimit.

    Attributes
    ----------
    limit : UncertaintyLimit
        The UncertaintyLimit.
    code : str
        "holds": everywhere; "holds_from": only from `from_m` on; "fails": nowhere; "stated":
        nothing is limited; "nothing_to_judge": no row or delivery is for use.
    passed : bool or None
        True for "holds", False for "holds_from" and "fails", else None.
    from_m : float or None
        Least dip from which on all rows keep the limit, or least height of deliveries that do;
        None: none does, or nothing is limited.
    from_m3 : float or None
        Volume at that dip; None for deliveries.
    worst_low_m, worst_m : float or None
        Dips of what is nearest to the limit or farthest beyond it; worst_low_m is None but for
        deliveries; both are None where there is nothing to judge.
    worst_m3, worst_U_m3 : float or None
        Its volume and U.
    worst_ratio : float or None
        U over what relative_to names (limit where it is just kept); inf for an empty tank.
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
    printed   `Printed` uncertainties; None: the table's. Deliveries are searched by the table's U;
              the worst one and all that were simulated have the U that is printed of them
    Raises HeightError for a lowest_m above the table's last row.
    """
    if lowest_m is not None and lowest_m > table.height_m[-1]:
        raise HeightError(
            message(
                "lowest_above_table",
                "lowest level {lowest_m:g} m: the table ends at {end_m:g}",
                lowest_m=lowest_m,
                end_m=table.height_m[-1],
            )
        )
    judged = table.for_use(table.height_m)
    if not np.any(judged):
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    printed = printed or printed_of_table(table)
    capacity = float(table.volume_m3[judged][-1])
    if lowest_m is not None:
        judged &= table.height_m >= lowest_m
    if limit.of == "deliveries":
        return _judge_deliveries(limit, _from(table, lowest_m), capacity, printed)
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


def deliveries_to_judge(limit, table):
    """((low_m, high_m), ...) of the deliveries that a limit of deliveries is decided by.

    The worst by U and by U over its volume, and some to the lowest dip, from the least height to
    the whole table; only what is for use.
    """
    found = worst_deliveries(table, limit.minimum_height_m)
    if found is None:
        return ()
    lowest, top = table.height_m[0], table.height_m[-1]
    heights = np.linspace(limit.minimum_height_m, top - lowest, TO_LOWEST)
    highs = np.minimum(lowest + heights, top)
    usable = table.for_use(highs) & table.for_use(lowest)
    pairs = [(one.low_m, one.high_m) for one in (found.absolute, found.relative)]
    return (*pairs, *((float(lowest), float(high)) for high in highs[usable]))


def _judge_deliveries(limit, table, capacity, printed):
    found = worst_deliveries(table, limit.minimum_height_m)
    if found is None:
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    is_relative = limit.relative_to == "itself" or limit.limit is None
    judged = _as_printed(found.relative if is_relative else found.absolute, limit, table, printed)

    def size(one):
        return one.relative if is_relative else one.U_m3

    worst = max(judged, key=size)
    ratio = worst.relative if is_relative else float(ratio_of(worst.U_m3, capacity))
    if limit.limit is None:
        return _of_delivery(limit, "stated", worst, ratio)
    bound = (limit.limit if is_relative else limit.limit * capacity) * (1 + _ROUNDING)
    broken = [_height(one) for one in judged if size(one) > bound]
    if not broken:
        return _of_delivery(limit, "holds", worst, ratio, limit.minimum_height_m)
    from_m = least_delivery_m(table, bound / printed.factor, is_relative)
    kept = [_height(one) for one in judged if _height(one) > max(broken) + _SAME_M]
    if from_m is not None and max(broken) > from_m - _SAME_M:
        from_m = float(np.ceil(1000 * min(kept) - 1e-6) / 1000) if kept else None
    code = "fails" if from_m is None else "holds_from"
    return _of_delivery(limit, code, worst, ratio, from_m)


def _as_printed(worst, limit, table, printed):
    """The worst Delivery by the table, and all that were simulated, with their printed U."""
    first, last = table.height_m[[0, -1]]
    least = limit.minimum_height_m - _SAME_M
    pairs = {(worst.low_m, worst.high_m): printed.of(table, worst.low_m, worst.high_m, worst.U_m3)}
    pairs |= {
        (low, high): U
        for (low, high), U in printed.pairs_m3.items()
        if low >= first and high <= last and high - low >= least
    }
    low, high = np.array(list(pairs)).T
    found, U = deliveries(table, low, high), np.array(list(pairs.values()))
    k = ratio_of(U, found.u_m3)
    fields = (low, high, found.volume_m3, found.u_m3, found.dof, k, U)
    rows = zip(*fields, ratio_of(U, found.volume_m3), strict=True)
    return [
        Delivery(*map(float, row))
        for row, for_use in zip(rows, found.for_use, strict=True)
        if for_use
    ]


def _height(delivery):
    return delivery.high_m - delivery.low_m


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
