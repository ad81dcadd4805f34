"""Peaking and banding at the welds of a shell, from the points of its scans."""

from tankcal.geometry.outlines import FULL_TURN
from tankcal.inspection.known_welds import BANDING, PEAKING, known_welds
from tankcal.inspection.largest_gaps import GapsFound, largest_gaps, undetermined
from tankcal.inspection.weld_boards import boards_of, reach_of
from tankcal.inspection.weld_cells import (
    ALONG_M,
    BINS,
    COUNT_BYTES,
    grid_of_rounds,
    grid_of_uprights,
    located,
    weld_cells_of,
    width_by_density,
)
from tankcal.messages import message
from tankcal.pipeline.cloud_cluster import open_passes
from tankcal.pipeline.cloud_passes import Placing, Reading, Telling

MEMORY_BYTES = 512 << 20  # memory of the histograms; more welds require several passes


def gaps_of_result(result, limits_mm, reading=None, progress=None):
    """Determine the gaps at the welds of a computed job from its clouds.

    Without clouds, no gap is determined, with the remark "gap_no_cloud".

    Parameters
    ----------
    result : tankcal.pipeline.result.Result
        Result for an upright tank. The files of its clouds are read again.
    limits_mm : dict
        Limits of the rule, {"peaking": mm, "banding": mm}. A missing key is an unknown limit.
    reading : tankcal.pipeline.cloud_passes.Reading, optional
        Number of workers; by default the files are read in this process.
    progress : callable, optional
        Function that receives a message for each step.

    Returns
    -------
    GapsFound

    Raises
    ------
    InputError
        If the file of a cloud cannot be read.
    """
    job, clouded = result.job, result.sights.get("clouds")
    heights = [course.height_m for course in job.courses]
    given = [course.welds_rad for course in job.courses]
    if clouded is None:
        return undetermined(known_welds(heights, given), "gap_no_cloud")
    wall, reading = clouded.cells, reading or Reading()
    welds = known_welds(heights, given, wall.welds, wall.surface.radius_m)
    telling = Telling(progress, reading.part_progress)
    placing = Placing.of(job.clouds, clouded.registration)
    with open_passes(placing, reading, telling) as passes:
        telling.step(
            message("cloud_weld_pass", "laying boards over {count} welds", count=len(welds))
        )
        return gaps_of_cloud(passes, wall, welds, limits_mm)


def gaps_of_cloud(passes, wall, welds, limits_mm, *, memory_bytes=MEMORY_BYTES):
    """Determine the gaps at the welds of an upright tank from the points of its scans.

    Parameters
    ----------
    passes : object
        Object with a method `gather(taken_of, *sizes)` that processes all points, such as
        `tankcal.clouds.wall.Passes`, `JobPasses` or `ClusterPasses`.
    wall : tankcal.clouds.wall.CloudWall
        Coarse cells of the same points.
    welds : sequence of KnownWeld
        Welds of `known_welds`, with heights above the lowest joint of the wall.
    limits_mm : dict
        Limits, {"peaking": mm, "banding": mm}. A gap whose u exceeds a quarter of its limit is not
        determined. With a missing key, a gap is determined for any u.
    memory_bytes : int, optional
        Memory of the fine cells. If the welds require more, they are processed in several passes.

    Returns
    -------
    GapsFound
        Gaps in the order of the welds, with profiles of the three largest gaps of each kind. The k
        of U accounts for all gaps that may be the largest (two-sided, 95 % for all together).
    """
    across_m = width_by_density(wall)
    boards = []
    for batch in _batches(welds, wall, across_m, memory_bytes):
        boards += _board_batch(passes, wall, batch, across_m)
    gaps, figures = [None] * len(welds), []
    for kind in (PEAKING, BANDING):
        places = [i for i, weld in enumerate(welds) if weld.kind == kind]
        batch, figure = largest_gaps(kind, [boards[i] for i in places], limits_mm.get(kind))
        for i, gap in zip(places, batch, strict=True):
            gaps[i] = gap
        figures.append(figure)
    return GapsFound(tuple(gaps), tuple(figures))


def _batches(welds, wall, across_m, memory_bytes):
    """Yield lists of welds whose cells fit into `memory_bytes`."""
    cell_bytes, around_m = len(wall.sides) * BINS * COUNT_BYTES, FULL_TURN * wall.surface.radius_m
    batch, used_bytes = [], 0
    for weld in welds:
        rows = 2 * reach_of(weld, across_m) / across_m
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
    for kind, grid_of in ((PEAKING, grid_of_uprights), (BANDING, grid_of_rounds)):
        if strips := [(weld, reach_of(weld, across_m)) for weld in welds if weld.kind == kind]:
            grids[kind] = grid_of(wall, strips, across_m)
    cells = passes.gather(weld_cells_of, wall.surface, tuple(grids.values()))
    fields = {
        kind: (grid, *located(grid, counts))
        for (kind, grid), counts in zip(grids.items(), cells.counts, strict=True)
    }
    return [boards_of(wall, weld, across_m, *fields[weld.kind]) for weld in welds]
