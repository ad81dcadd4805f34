"""Check whether the expanded uncertainty is within its limits, and from which level on.

U(h) <= limit V(h), or limit V(top). With a constant k, U is convex between rows and the limit is
linear, so a limit met at two neighbouring rows is met between them. No quantity is divided, so the
empty tank (V = 0) meets a limit only if U = 0 as well. Deliveries are judged over all dips by the
law of propagation, and simulated deliveries by their printed U. The simulated deliveries are the
worst one, and some to the lowest dip (`deliveries_to_judge`). There the volume cannot be negative,
and the errors of the two dips do not cancel according to the law of propagation.
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
from tankcal.tank.rules.model import UncertaintyLimit, printed_of_table

_ROUNDING = 1e-12  # relative tolerance: U equal to the limit meets it
_SAME_M = 1e-6  # heights of deliveries with a smaller difference are equal
TO_LOWEST = 12  # number of simulated deliveries to the lowest dip for a limit


@dataclass(frozen=True)
class UncertaintyVerdict:
    """Result of an UncertaintyLimit.

    Attributes
    ----------
    limit : UncertaintyLimit
    code : str
        "holds": everywhere; "holds_from": only from `from_m` on; "fails": nowhere; "stated": no
        limit is given; "nothing_to_judge": no row or delivery is for use.
    passed : bool or None
        True for "holds", False for "holds_from" and "fails", else None.
    from_m : float or None
        Least dip from which on all rows meet the limit, or least height of such deliveries; None:
        none, or no limit is given.
    from_m3 : float or None
        Volume at that dip; None for deliveries.
    worst_low_m, worst_m : float or None
        Dips of the row or delivery closest to the limit or farthest beyond it; worst_low_m is None
        except for deliveries; both are None if no row or delivery is judged.
    worst_m3, worst_U_m3 : float or None
        Volume and U of that row or delivery.
    worst_ratio : float or None
        U over the quantity in relative_to (equal to the limit if it is just met); inf for an empty
        tank.
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
    """Return the UncertaintyVerdict of an UncertaintyLimit for a Capacity.

    Parameters
    ----------
    limit : UncertaintyLimit
    table : Capacity
    lowest_m : float, optional
        Dip at the start of the calibrated zone; only rows from there on, and deliveries between
        them, are judged. None: all.
    printed : PrintedU, optional
        Printed uncertainties; None: those of the table. The search for deliveries uses the U of the
        table; the worst delivery and all simulated deliveries have their printed U.

    Returns
    -------
    UncertaintyVerdict

    Raises
    ------
    HeightError
        For a lowest_m above the last row of the table.
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
    judged_rows = table.for_use(table.height_m)
    if not np.any(judged_rows):
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    printed = printed or printed_of_table(table)
    capacity = float(table.volume_m3[judged_rows][-1])
    if lowest_m is not None:
        judged_rows &= table.height_m >= lowest_m
    if limit.of == "deliveries":
        return _judge_deliveries(limit, _restrict_table(table, lowest_m), capacity, printed)
    if limit.of == "capacity":
        judged_rows &= np.arange(len(judged_rows)) == np.flatnonzero(judged_rows).max(initial=-1)
    if not np.any(judged_rows):
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    return _judge_rows(limit, table, printed.rows_m3, np.flatnonzero(judged_rows), capacity)


def _restrict_table(table, lowest_m):
    """Return the table from a dip on."""
    if lowest_m is None:
        return table
    selected = table.height_m >= lowest_m
    sources = tuple(
        replace(source, columns_m3=source.columns_m3[selected]) for source in table.sources
    )
    rows = {name: getattr(table, name)[selected] for name in ("height_m", "volume_m3", "area_m2")}
    return replace(table, sources=sources, **rows)


def _judge_rows(limit, table, printed, rows, capacity):
    """Return the verdict of the rows of a table."""
    volume, U = table.volume_m3[rows], printed[rows]
    base = volume if limit.relative_to == "itself" else np.full(len(rows), capacity)
    ratio = ratio_of(U, base)
    # A product instead of a quotient: an empty tank has no ratio.
    is_met = limit.limit * base * (1 + _ROUNDING) >= U
    exceeded = np.flatnonzero(~is_met)
    # The limit is met from the row after the last row that exceeds it.
    first = exceeded[-1] + 1 if len(exceeded) else 0
    code = "holds" if not len(exceeded) else "holds_from" if first < len(rows) else "fails"
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
    """Return ((low_m, high_m), ...) of the deliveries that decide a limit of deliveries.

    They are the deliveries with the largest U and the largest U over volume, and some to the lowest
    dip, from the least height to the whole table; only dips for use.
    """
    worst = worst_deliveries(table, limit.minimum_height_m)
    if worst is None:
        return ()
    lowest, top = table.height_m[0], table.height_m[-1]
    heights = np.linspace(limit.minimum_height_m, top - lowest, TO_LOWEST)
    highs = np.minimum(lowest + heights, top)
    usable = table.for_use(highs) & table.for_use(lowest)
    pairs = [(delivery.low_m, delivery.high_m) for delivery in (worst.absolute, worst.relative)]
    return (*pairs, *((float(lowest), float(high)) for high in highs[usable]))


def _judge_deliveries(limit, table, capacity, printed):
    """Return the verdict of the deliveries of a table."""
    worst_of_table = worst_deliveries(table, limit.minimum_height_m)
    if worst_of_table is None:
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    is_relative = limit.relative_to == "itself" or limit.limit is None
    judged = _printed_deliveries(
        worst_of_table.relative if is_relative else worst_of_table.absolute, limit, table, printed
    )

    def size(delivery):
        return delivery.relative if is_relative else delivery.U_m3

    worst = max(judged, key=size)
    ratio = worst.relative if is_relative else float(ratio_of(worst.U_m3, capacity))
    if limit.limit is None:
        return _delivery_verdict(limit, "stated", worst, ratio)
    bound = (limit.limit if is_relative else limit.limit * capacity) * (1 + _ROUNDING)
    exceeded_heights = [_height(delivery) for delivery in judged if size(delivery) > bound]
    if not exceeded_heights:
        return _delivery_verdict(limit, "holds", worst, ratio, limit.minimum_height_m)
    # The factor of printed over propagated U reduces the limit for deliveries without simulation.
    from_m = least_delivery_m(table, bound / printed.factor, is_relative)
    met_heights = [
        _height(delivery)
        for delivery in judged
        if _height(delivery) > max(exceeded_heights) + _SAME_M
    ]
    # A simulated delivery exceeds the limit above that height: use simulated heights only.
    if from_m is not None and max(exceeded_heights) > from_m - _SAME_M:
        from_m = float(np.ceil(1000 * min(met_heights) - 1e-6) / 1000) if met_heights else None
    code = "fails" if from_m is None else "holds_from"
    return _delivery_verdict(limit, code, worst, ratio, from_m)


def _printed_deliveries(worst, limit, table, printed):
    """Return the worst Delivery of the table and all simulated deliveries, with their printed U."""
    first, last = table.height_m[[0, -1]]
    least = limit.minimum_height_m - _SAME_M
    pairs = {(worst.low_m, worst.high_m): printed.of(table, worst.low_m, worst.high_m, worst.U_m3)}
    pairs |= {
        (low, high): U
        for (low, high), U in printed.pairs_m3.items()
        if low >= first and high <= last and high - low >= least
    }
    low, high = np.array(list(pairs)).T
    computed, U = deliveries(table, low, high), np.array(list(pairs.values()))
    k = ratio_of(U, computed.u_m3)
    fields = (low, high, computed.volume_m3, computed.u_m3, computed.dof, k, U)
    rows = zip(*fields, ratio_of(U, computed.volume_m3), strict=True)
    return [
        Delivery(*map(float, row))
        for row, for_use in zip(rows, computed.for_use, strict=True)
        if for_use
    ]


def _height(delivery):
    """Return the height of a delivery."""
    return delivery.high_m - delivery.low_m


def _delivery_verdict(limit, code, worst: Delivery, ratio, from_m=None):
    """Return the verdict for the worst delivery."""
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
