"""The largest gap of each weld and of all, with the U of the largest of many."""

from dataclasses import dataclass

import numpy as np

from tankcal.inspection.boards import REACH_M, UNCERTAIN
from tankcal.inspection.known_welds import BANDING, PEAKING
from tankcal.inspection.weld_boards import TOGETHER, noise_factor
from tankcal.record.inspection import WeldGap
from tankcal.uncertainty import coverage_factor

LEAST_SEEN, WELL_SEEN = 0.5, 0.9  # of the boards of a weld: it is determined, it is seen whole
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
        "gap_no_weld", "gap_no_cloud", "gap_too_sparse", "gap_too_uncertain"; where a value is,
        "gap_not_all": some welds have none, or "gap_partly_seen": there are parts of welds where
        no board can be laid.
    remark_values : dict
        welds, determined; where a value is seen, too: the share of boards that could be laid over
        the welds that have one; of "gap_too_uncertain" u_mm (the least) and most_mm.
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
    """`WeldGap` of each weld, and the `GapFigure` of all.

    Parameters
    ----------
    kind : str
        "peaking" or "banding".
    boards : sequence of Boards
        Of each weld of that kind.
    limit_mm : float or None
        Of a gap, mm; None: not known.
    """
    if not boards:
        return [], _no_figure(kind, 0, "gap_no_weld")
    more = noise_factor(boards) ** 2
    most_m = np.inf if limit_mm is None else UNCERTAIN * limit_mm / IN_MM
    largest = [_largest(one, more, most_m) for one in boards]
    told = [one.seen >= LEAST_SEEN for one in largest]
    sizes = [abs(one.gap_m) if known else -1.0 for one, known in zip(largest, told, strict=True)]
    order = np.argsort(sizes, kind="stable")[::-1]
    kept = set(order[:KEPT].tolist())
    gaps = [
        _weld_gap(one, found, more, i in kept) if told[i] else _no_gap(one.weld)
        for i, (one, found) in enumerate(zip(boards, largest, strict=True))
    ]
    if not any(told):
        least_m = min(one.least_u_m for one in largest)
        if not most_m < least_m < np.inf:
            return gaps, _no_figure(kind, len(boards), "gap_too_sparse")
        figure = _no_figure(kind, len(boards), "gap_too_uncertain")
        figure.remark_values.update(u_mm=IN_MM * least_m, most_mm=IN_MM * most_m)
        return gaps, figure
    known = [(boards[i], largest[i]) for i in np.flatnonzero(told)]
    return gaps, _figure(kind, gaps[order[0]], largest[order[0]], known, len(boards), more)


def _figure(kind, gap, worst, known, welds, more):
    """`GapFigure` of the largest; known  (Boards, _Largest) of the welds that have one."""
    rivals = sum(_rivals(*one, more, abs(worst.gap_m) - 2 * worst.u_m) for one in known)
    k = factor_of_largest(rivals)
    seen = float(np.mean([found.seen for _, found in known]))
    remark = "gap_partly_seen" if seen < WELL_SEEN else None
    return GapFigure(
        code=kind,
        value_mm=gap.gap_mm,
        U_mm=IN_MM * k * worst.u_m,
        k=k,
        course=gap.course,
        height_m=gap.height_m,
        azimuth_deg=gap.azimuth_deg,
        used=len(known),
        remark="gap_not_all" if len(known) < welds else remark,
        remark_values={"welds": welds, "determined": len(known), "seen": seen},
    )


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
    """Of the boards of a weld: which board and cell, its gap and u, and how many might be it.

    sure       (boards,) boards that have a gap whose u is small enough
    least_u_m  of all that have a gap; inf: none has
    """

    board: int
    cell: int
    gap_m: float
    u_m: float
    sure: np.ndarray
    least_u_m: float

    @property
    def seen(self):
        """Share of the boards that are sure."""
        return float(np.mean(self.sure))


def _largest(boards, more, most_m):
    """`_Largest` within reach of the weld, of boards whose u is at most that."""
    sizes = np.where(np.isfinite(boards.gap_m), np.abs(boards.gap_m), -1.0)
    sizes[:, np.abs(boards.s_m) > REACH_M + 1e-9] = -1.0
    cell = np.argmax(sizes, axis=1)
    row = np.arange(len(cell))
    u = np.where(sizes[row, cell] >= 0, _u_of(boards, more)[row, cell], np.inf)
    sure = (u < np.inf) & (u <= most_m)
    board = int(np.argmax(np.where(sure, sizes[row, cell], -1.0)))
    place = board, int(cell[board])
    return _Largest(*place, float(boards.gap_m[place]), float(u[board]), sure, float(u.min()))


def _u_of(boards, more):
    return np.sqrt(more * boards.noise_m2 + boards.missed_m2)


def _rivals(boards, largest, more, least_m):
    """How many independent gaps of a weld may be larger than that: 2 u beyond it."""
    near = np.abs(boards.s_m) <= REACH_M + 1e-9
    with np.errstate(invalid="ignore"):
        may = np.abs(boards.gap_m) + 2 * _u_of(boards, more) >= least_m
    return max(1, -(-np.count_nonzero(may[largest.sure][:, near]) // TOGETHER))


def _weld_gap(boards, found, more, with_profile):
    weld, along = boards.weld, float(boards.along[found.board])
    is_upright = weld.kind == PEAKING
    profile = boards.gap_m[found.board]
    rivals = _rivals(boards, found, more, abs(found.gap_m) - 2 * found.u_m)
    known = np.isfinite(profile) & with_profile
    azimuth = weld.azimuth_rad if is_upright else along
    return WeldGap(
        kind=weld.kind,
        course=weld.course + 1,
        height_m=along if is_upright else weld.low_m,
        azimuth_deg=float(np.degrees(azimuth) % 360),
        gap_mm=IN_MM * found.gap_m,
        U_mm=IN_MM * factor_of_largest(rivals) * found.u_m,
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
