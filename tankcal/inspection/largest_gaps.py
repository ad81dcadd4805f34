"""Largest gap of each weld and of all welds, with the expanded uncertainty of a maximum."""

from dataclasses import dataclass

import numpy as np

from tankcal.inspection.boards import REACH_M, UNCERTAIN
from tankcal.inspection.known_welds import BANDING, PEAKING
from tankcal.inspection.weld_boards import TOGETHER, noise_factor
from tankcal.record.inspection import WeldGap
from tankcal.uncertainty import coverage_factor
from tankcal.units import MM_PER_M

# Least share of determined boards: for a determined weld, and for all welds without a remark.
LEAST_SEEN, WELL_SEEN = 0.5, 0.9
KEPT = 3  # number of profiles saved for each kind of weld, at the largest gaps
PROBABILITY = 0.95  # coverage probability of U


@dataclass(frozen=True)
class GapFigure:
    """Largest gap of one kind of weld.

    Attributes
    ----------
    code : str
        "peaking" or "banding".
    value_mm, U_mm, k : float or None
        Gap, positive outwards, its expanded uncertainty and coverage factor; None if no gap is
        determined at any weld.
    course : int or None
        Course, counted from 1 at the bottom.
    height_m, azimuth_deg : float or None
        Middle of the board: height above the bottom of the shell, and azimuth clockwise from +y.
    used : int
        Number of welds with a determined gap.
    remark : str or None
        Without a value: "gap_no_weld", "gap_no_cloud", "gap_too_sparse" or "gap_too_uncertain".
        With a value: "gap_not_all" if some welds have no determined gap, "gap_partly_seen" if no
        board can be laid over some parts of the welds, or None.
    remark_values : dict
        Number of `welds` and of `determined` welds. With a value, also `seen`, the share of
        determined boards of these welds. For "gap_too_uncertain", also the least u, `u_mm`, and
        its limit, `most_mm`.
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
    """Gaps at the welds: a `WeldGap` for each weld, and a `GapFigure` for each kind of weld."""

    gaps: tuple
    figures: tuple


def largest_gaps(kind, boards, limit_mm):
    """Determine the largest gap of each weld of a kind, and of all these welds.

    Parameters
    ----------
    kind : str
        "peaking" or "banding".
    boards : sequence of Boards
        Boards of each weld of this kind.
    limit_mm : float or None
        Limit of the gap, mm; None if unknown.

    Returns
    -------
    list of WeldGap
        One gap for each weld.
    GapFigure
        Largest gap of all welds.
    """
    if not boards:
        return [], _no_figure(kind, 0, "gap_no_weld")
    # Neighbouring cells may share noise, so the variance of the noise is scaled.
    noise_scale = noise_factor(boards) ** 2
    most_m = np.inf if limit_mm is None else UNCERTAIN * limit_mm / MM_PER_M
    largest = [_largest(item, noise_scale, most_m) for item in boards]
    determined = [item.seen >= LEAST_SEEN for item in largest]
    sizes = [
        abs(item.gap_m) if known else -1.0 for item, known in zip(largest, determined, strict=True)
    ]
    order = np.argsort(sizes, kind="stable")[::-1]
    kept = set(order[:KEPT].tolist())
    gaps = [
        _weld_gap(item, gap, noise_scale, i in kept) if determined[i] else _no_gap(item.weld)
        for i, (item, gap) in enumerate(zip(boards, largest, strict=True))
    ]
    if not any(determined):
        least_m = min(item.least_u_m for item in largest)
        if not most_m < least_m < np.inf:
            return gaps, _no_figure(kind, len(boards), "gap_too_sparse")
        figure = _no_figure(kind, len(boards), "gap_too_uncertain")
        figure.remark_values.update(u_mm=MM_PER_M * least_m, most_mm=MM_PER_M * most_m)
        return gaps, figure
    known = [(boards[i], largest[i]) for i in np.flatnonzero(determined)]
    return gaps, _figure(kind, gaps[order[0]], largest[order[0]], known, len(boards), noise_scale)


def _figure(kind, gap, worst, known, welds, noise_scale):
    """`GapFigure` of the largest gap; `known` has (Boards, _Largest) of each determined weld."""
    # Gaps that may exceed the largest gap within 2 u of both are candidates for the true maximum.
    rivals = sum(_rivals(*pair, noise_scale, abs(worst.gap_m) - 2 * worst.u_m) for pair in known)
    k = factor_of_largest(rivals)
    seen = float(np.mean([gap_of_weld.seen for _, gap_of_weld in known]))
    remark = "gap_partly_seen" if seen < WELL_SEEN else None
    return GapFigure(
        code=kind,
        value_mm=gap.gap_mm,
        U_mm=MM_PER_M * k * worst.u_m,
        k=k,
        course=gap.course,
        height_m=gap.height_m,
        azimuth_deg=gap.azimuth_deg,
        used=len(known),
        remark="gap_not_all" if len(known) < welds else remark,
        remark_values={"welds": welds, "determined": len(known), "seen": seen},
    )


def undetermined(welds, remark):
    """`GapsFound` without any determined gap, as for a survey by points or strapping."""
    figures = []
    for kind in (PEAKING, BANDING):
        count = sum(weld.kind == kind for weld in welds)
        figures.append(_no_figure(kind, count, remark if count else "gap_no_weld"))
    return GapsFound(tuple(_no_gap(weld) for weld in welds), tuple(figures))


def factor_of_largest(rivals):
    """Coverage factor k of the largest of independent gaps.

    With a probability of 95 %, the error of none of the `rivals` gaps exceeds k u.

    >>> round(factor_of_largest(1), 3), round(factor_of_largest(20), 3)
    (1.96, 3.016)
    """
    return float(coverage_factor(PROBABILITY ** (1 / rivals), np.inf))


@dataclass(frozen=True)
class _Largest:
    """Largest gap of a weld.

    Attributes
    ----------
    board, cell : int
        Board and cell of the gap.
    gap_m, u_m : float
        Gap and its standard uncertainty, m.
    sure : ndarray of bool, shape (boards,)
        Boards that have a gap with a sufficiently small u.
    least_u_m : float
        Smallest u of all gaps, m; inf if no board has a gap.
    """

    board: int
    cell: int
    gap_m: float
    u_m: float
    sure: np.ndarray
    least_u_m: float

    @property
    def seen(self):
        """Share of the boards with a determined gap."""
        return float(np.mean(self.sure))


def _largest(boards, noise_scale, most_m):
    """`_Largest` within reach of the weld, from boards whose u is at most `most_m`."""
    sizes = np.where(np.isfinite(boards.gap_m), np.abs(boards.gap_m), -1.0)
    sizes[:, np.abs(boards.s_m) > REACH_M + 1e-9] = -1.0
    cell = np.argmax(sizes, axis=1)
    row = np.arange(len(cell))
    u = np.where(sizes[row, cell] >= 0, _standard_u(boards, noise_scale)[row, cell], np.inf)
    sure = (u < np.inf) & (u <= most_m)
    board = int(np.argmax(np.where(sure, sizes[row, cell], -1.0)))
    place = board, int(cell[board])
    return _Largest(*place, float(boards.gap_m[place]), float(u[board]), sure, float(u.min()))


def _standard_u(boards, noise_scale):
    """Standard uncertainties of the gaps, m; `noise_scale` multiplies the variance of the noise."""
    return np.sqrt(noise_scale * boards.noise_m2 + boards.missed_m2)


def _rivals(boards, largest, noise_scale, least_m):
    """Number of independent gaps of a weld whose value plus 2 u reaches `least_m`."""
    near = np.abs(boards.s_m) <= REACH_M + 1e-9
    with np.errstate(invalid="ignore"):
        is_candidate = np.abs(boards.gap_m) + 2 * _standard_u(boards, noise_scale) >= least_m
    return max(1, -(-np.count_nonzero(is_candidate[largest.sure][:, near]) // TOGETHER))


def _weld_gap(boards, largest, noise_scale, with_profile):
    """`WeldGap` of a determined weld."""
    weld, along = boards.weld, float(boards.along[largest.board])
    is_upright = weld.kind == PEAKING
    profile = boards.gap_m[largest.board]
    rivals = _rivals(boards, largest, noise_scale, abs(largest.gap_m) - 2 * largest.u_m)
    known = np.isfinite(profile) & with_profile
    azimuth = weld.azimuth_rad if is_upright else along
    return WeldGap(
        kind=weld.kind,
        course=weld.course + 1,
        height_m=along if is_upright else weld.low_m,
        azimuth_deg=float(np.degrees(azimuth) % 360),
        gap_mm=MM_PER_M * largest.gap_m,
        U_mm=MM_PER_M * factor_of_largest(rivals) * largest.u_m,
        along_mm=np.round(MM_PER_M * boards.s_m[known], 1).tolist(),
        profile_mm=np.round(MM_PER_M * profile[known], 2).tolist(),
    )


def _no_gap(weld):
    """`WeldGap` of a weld without a determined gap."""
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
    """`GapFigure` without a determined gap."""
    values = {"welds": welds, "determined": 0}
    return GapFigure(kind, None, None, None, None, None, None, 0, remark, values)
