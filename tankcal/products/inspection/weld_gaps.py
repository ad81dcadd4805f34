"""Peaking and banding: the largest gap of each weld and of all welds, from the points of scans.

The expanded uncertainty of the largest gap accounts for all gaps that may be the largest.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.methods.clouds.passes import Placing, Reading, Telling, open_passes
from tankcal.products.inspection.boards import (
    REACH_M,
    TOGETHER,
    UNCERTAIN,
    board_reach,
    lay_boards,
    noise_factor,
)
from tankcal.products.inspection.welds import (
    ALONG_M,
    BANDING,
    BINS,
    COUNT_BYTES,
    PEAKING,
    build_round_grid,
    build_upright_grid,
    choose_cell_width,
    fill_weld_cells,
    list_welds,
    locate_wall,
)
from tankcal.record.inspection import WeldGap
from tankcal.uncertainty import coverage_factor
from tankcal.units import FULL_TURN, MM_PER_M

MEMORY_BYTES = 512 << 20  # memory of the histograms; more welds require several passes


def find_gaps(result, limits_mm, reading=None, progress=None):
    """Determine the gaps at the welds of a computed job from its clouds.

    Without clouds, no gap is determined, with the remark "gap_no_cloud".

    Parameters
    ----------
    result : tankcal.pipeline.result.Result
        Result for an upright tank. The files of its clouds are read again.
    limits_mm : dict
        Limits of the rule, {"peaking": mm, "banding": mm}. A missing key is an unknown limit.
    reading : tankcal.methods.clouds.passes.Reading, optional
        Number of workers; by default the files are read in this process.
    progress : callable, optional
        Function that receives a message for each step.

    Returns
    -------
    WeldGaps

    Raises
    ------
    InputError
        If the file of a cloud cannot be read.
    """
    job, clouded = result.job, result.sights.get("clouds")
    heights = [course.height_m for course in job.courses]
    given = [course.welds_rad for course in job.courses]
    if clouded is None:
        return empty_gaps(list_welds(heights, given), "gap_no_cloud")
    wall, reading = clouded.cells, reading or Reading()
    welds = list_welds(heights, given, wall.welds, wall.surface.radius_m)
    telling = Telling(progress, reading.part_progress)
    placing = Placing.of(job.clouds, clouded.registration)
    with open_passes(placing, reading, telling) as passes:
        telling.step(
            message("cloud_weld_pass", "laying boards over {count} welds", count=len(welds))
        )
        return find_gaps_in_cloud(passes, wall, welds, limits_mm)


def find_gaps_in_cloud(passes, wall, welds, limits_mm, *, memory_bytes=MEMORY_BYTES):
    """Determine the gaps at the welds of an upright tank from the points of its scans.

    Parameters
    ----------
    passes : object
        Object with a method `gather(taken_of, *sizes)` that processes all points, such as
        `tankcal.clouds.wall.Passes`, `JobPasses` or `ClusterPasses`.
    wall : tankcal.clouds.wall.CloudWall
        Coarse cells of the same points.
    welds : sequence of KnownWeld
        Welds of `list_welds`, with heights above the lowest joint of the wall.
    limits_mm : dict
        Limits, {"peaking": mm, "banding": mm}. A gap whose u exceeds a quarter of its limit is not
        determined. With a missing key, a gap is determined for any u.
    memory_bytes : int, optional
        Memory of the fine cells. If the welds require more, they are processed in several passes.

    Returns
    -------
    WeldGaps
        Gaps in the order of the welds, with profiles of the three largest gaps of each kind. The k
        of U accounts for all gaps that may be the largest (two-sided, 95 % for all together).
    """
    across_m = choose_cell_width(wall)
    boards = []
    for batch in _batches(welds, wall, across_m, memory_bytes):
        boards += _board_batch(passes, wall, batch, across_m)
    gaps, figures = [None] * len(welds), []
    for kind in (PEAKING, BANDING):
        places = [i for i, weld in enumerate(welds) if weld.kind == kind]
        batch, figure = select_largest_gaps(kind, [boards[i] for i in places], limits_mm.get(kind))
        for i, gap in zip(places, batch, strict=True):
            gaps[i] = gap
        figures.append(figure)
    return WeldGaps(tuple(gaps), tuple(figures))


def _batches(welds, wall, across_m, memory_bytes):
    """Yield lists of welds whose cells fit into `memory_bytes`."""
    cell_bytes, around_m = len(wall.sides) * BINS * COUNT_BYTES, FULL_TURN * wall.surface.radius_m
    batch, used_bytes = [], 0
    for weld in welds:
        rows = 2 * board_reach(weld, across_m) / across_m
        tall = weld.high_m - weld.low_m
        along = (around_m if weld.kind == BANDING else tall) / ALONG_M + 1
        required_bytes = cell_bytes * rows * along
        if batch and used_bytes + required_bytes > memory_bytes:
            yield batch
            batch, used_bytes = [], 0
        batch.append(weld)
        used_bytes += required_bytes
    if batch:
        yield batch


def _board_batch(passes, wall, welds, across_m):
    """`Boards` of welds, from one pass over the points."""
    grids = {}
    for kind, grid_of in ((PEAKING, build_upright_grid), (BANDING, build_round_grid)):
        if strips := [(weld, board_reach(weld, across_m)) for weld in welds if weld.kind == kind]:
            grids[kind] = grid_of(wall, strips, across_m)
    cells = passes.gather(fill_weld_cells, wall.surface, tuple(grids.values()))
    fields = {
        kind: (grid, *locate_wall(grid, counts))
        for (kind, grid), counts in zip(grids.items(), cells.counts, strict=True)
    }
    return [lay_boards(wall, weld, across_m, *fields[weld.kind]) for weld in welds]


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
class WeldGaps:
    """Gaps at the welds: a `WeldGap` for each weld, and a `GapFigure` for each kind of weld."""

    gaps: tuple
    figures: tuple


def select_largest_gaps(kind, boards, limit_mm):
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
    k = maximum_coverage_factor(rivals)
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


def empty_gaps(welds, remark):
    """`WeldGaps` without any determined gap, as for a survey by points or strapping."""
    figures = []
    for kind in (PEAKING, BANDING):
        count = sum(weld.kind == kind for weld in welds)
        figures.append(_no_figure(kind, count, remark if count else "gap_no_weld"))
    return WeldGaps(tuple(_no_gap(weld) for weld in welds), tuple(figures))


def maximum_coverage_factor(rivals):
    """Coverage factor k of the largest of independent gaps.

    With a probability of 95 %, the error of none of the `rivals` gaps exceeds k u.

    >>> round(maximum_coverage_factor(1), 3), round(maximum_coverage_factor(20), 3)
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
        U_mm=MM_PER_M * maximum_coverage_factor(rivals) * largest.u_m,
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
