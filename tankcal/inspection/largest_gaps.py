"""The largest gap of each weld and of all, with the U of the largest of many."""

from dataclasses import dataclass

import numpy as np

from tankcal.inspection.boards import REACH_M, UNCERTAIN
from tankcal.inspection.known_welds import BANDING, PEAKING
from tankcal.inspection.weld_boards import TOGETHER, noise_factor
from tankcal.record.inspection import WeldGap
from tankcal.uncertainty import coverage_factor

KEPT = 3  # profiles of each kind, of the largest gaps
PROBABILITY = 0.95
IN_MM = 1000.0


@dataclass(frozen=True)
class GapFigure:
    """The largest gap of one kind of weld, for judging.

    Attributes
    ----------
    code : str
        "peaking" or "banding".
    value_mm, U_mm, k : float or None
        Outwards positive; None: not determined at any weld.
    course : int or None
        From the bottom, 1 first.
    height_m, azimuth_deg : float or None
        Of the middle of the board, above the bottom of the shell and clockwise from +y.
    used : int
        Welds that it is the largest of.
    remark : str or None
        "gap_no_weld", "gap_no_cloud", "gap_too_sparse", "gap_too_uncertain" or, where some welds
        have no gap, "gap_not_all".
    remark_values : dict
        welds, determined; of "gap_too_uncertain" u_mm and most_mm, too.
    """

    code: str
    value_mm: float | None
    U_mm: float | None
    k: float | None
    course: int | None
    height_m: float | None
    azimuth_deg: float | None
    used: int
    remark: str | None
    remark_values: dict


@dataclass(frozen=True)
class GapsFound:
    """Gaps at the welds: a `WeldGap` of each, and a `GapFigure` of peaking and of banding."""

    gaps: tuple
    figures: tuple


def largest_gaps(kind, boards, limit_mm):
    """`WeldGap` of each weld, and the `GapFigure` of all."""
    if not boards:
        return [], _no_figure(kind, 0, "gap_no_weld")
    more = noise_factor(boards) ** 2
    largest = [_largest(one, more) for one in boards]
    most = np.inf if limit_mm is None else UNCERTAIN * limit_mm / IN_MM
    told = [one is not None and one.u_m <= most for one in largest]
    if not any(told):
        unsure = [one.u_m for one in largest if one is not None]
        figure = _no_figure(kind, len(boards), "gap_too_uncertain" if unsure else "gap_too_sparse")
        if unsure:
            figure.remark_values.update(u_mm=IN_MM * min(unsure), most_mm=IN_MM * most)
        return [_no_gap(one.weld) for one in boards], figure
    sizes = [abs(one.gap_m) if known else -1.0 for one, known in zip(largest, told, strict=True)]
    order = np.argsort(sizes, kind="stable")[::-1]
    kept = set(order[:KEPT].tolist())
    gaps = [
        _weld_gap(one, found, i in kept) if told[i] else _no_gap(one.weld)
        for i, (one, found) in enumerate(zip(boards, largest, strict=True))
    ]
    worst = largest[order[0]]
    least = abs(worst.gap_m) - 2 * worst.u_m
    rivals = sum(
        _rivals(one, more, least) for one, known in zip(boards, told, strict=True) if known
    )
    k, gap = factor_of_largest(rivals), gaps[order[0]]
    values = {"welds": len(boards), "determined": sum(told)}
    figure = GapFigure(
        code=kind,
        value_mm=gap.gap_mm,
        U_mm=IN_MM * k * worst.u_m,
        k=k,
        course=gap.course,
        height_m=gap.height_m,
        azimuth_deg=gap.azimuth_deg,
        used=sum(told),
        remark=None if all(told) else "gap_not_all",
        remark_values=values,
    )
    return gaps, figure


def undetermined(welds, remark):
    """`GapsFound` of welds that nothing is told of, such as of a survey by points or straps."""
    figures = []
    for kind in (PEAKING, BANDING):
        count = sum(one.kind == kind for one in welds)
        figures.append(_no_figure(kind, count, remark if count else "gap_no_weld"))
    return GapsFound(tuple(_no_gap(one) for one in welds), tuple(figures))


def factor_of_largest(rivals):
    """k of the largest of so many independent gaps: 95 % that none is further off than k u.

    >>> round(factor_of_largest(1), 3), round(factor_of_largest(20), 3)
    (1.96, 3.016)
    """
    return float(coverage_factor(PROBABILITY ** (1 / rivals), np.inf))


@dataclass(frozen=True)
class _Largest:
    """Of the boards of a weld: which board and cell, its gap and u, and how many might be it."""

    board: int
    cell: int
    gap_m: float
    u_m: float
    rivals: int


def _largest(boards, more):
    """`_Largest` within reach of the weld; None: no gap is known."""
    sizes = np.where(np.abs(boards.s_m) <= REACH_M + 1e-9, np.abs(boards.gap_m), np.nan)
    if not np.isfinite(sizes).any():
        return None
    board, cell = np.unravel_index(np.nanargmax(sizes), sizes.shape)
    u = np.sqrt(more * boards.noise_m2[board, cell] + boards.missed_m2[board, cell])
    rivals = _rivals(boards, more, sizes[board, cell] - 2 * u)
    gap = float(boards.gap_m[board, cell])
    return _Largest(int(board), int(cell), gap, float(u), rivals)


def _rivals(boards, more, least_m):
    """How many independent gaps of a weld may be larger than that: 2 u beyond it."""
    u = np.sqrt(more * boards.noise_m2 + boards.missed_m2)
    near = np.abs(boards.s_m) <= REACH_M + 1e-9
    with np.errstate(invalid="ignore"):
        count = np.count_nonzero((np.abs(boards.gap_m) + 2 * u >= least_m) & near)
    return max(1, -(-count // TOGETHER))


def _weld_gap(boards, found, with_profile):
    weld, along = boards.weld, float(boards.along[found.board])
    is_upright = weld.kind == PEAKING
    profile = boards.gap_m[found.board]
    known = np.isfinite(profile) & with_profile
    azimuth = weld.azimuth_rad if is_upright else along
    return WeldGap(
        kind=weld.kind,
        course=weld.course + 1,
        height_m=along if is_upright else weld.low_m,
        azimuth_deg=float(np.degrees(azimuth) % 360),
        gap_mm=IN_MM * found.gap_m,
        U_mm=IN_MM * factor_of_largest(found.rivals) * found.u_m,
        along_mm=np.round(IN_MM * boards.s_m[known], 1).tolist(),
        profile_mm=np.round(IN_MM * profile[known], 2).tolist(),
    )


def _no_gap(weld):
    """`WeldGap` of a weld of which nothing is determined."""
    return WeldGap(
        kind=weld.kind,
        course=weld.course + 1,
        height_m=(weld.low_m + weld.high_m) / 2,
        azimuth_deg=float(np.degrees(weld.azimuth_rad) % 360),
        gap_mm=None,
        U_mm=None,
        along_mm=[],
        profile_mm=[],
    )


def _no_figure(kind, welds, remark):
    values = {"welds": welds, "determined": 0}
    return GapFigure(kind, None, None, None, None, None, None, 0, remark, values)
