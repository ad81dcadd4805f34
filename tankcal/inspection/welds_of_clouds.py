"""Peaking and banding of the welds of a shell, from the points of its scans."""

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

MEMORY_BYTES = 512 << 20  # of the histograms; beyond, welds take turns in passes of their own


def gaps_of_result(result, limits_mm, reading=None, progress=None):
    """`GapsFound` of a computed job: of its clouds, or without any "gap_no_cloud" at each weld.

    Parameters
    ----------
    result : tankcal.pipeline.result.Result
        Of an upright tank; its files of clouds are read once more.
    limits_mm : dict
        {"peaking": mm, "banding": mm} of the rule; one that is left out is not known.
    reading : tankcal.pipeline.cloud_passes.Reading, optional
        By how many workers; None: in this process.
    progress : callable, optional
        Is told what is being done.

    Raises
    ------
    InputError
        For a file of a cloud that cannot be read any more.
    """
    job, clouded = result.job, result.clouded
    heights = [one.height_m for one in job.courses]
    given = [one.welds_rad for one in job.courses]
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
    """`GapsFound` of the welds of an upright tank, by the points of its scans.

    Parameters
    ----------
    passes : object
        With `gather(taken_of, *sizes)`, as `tankcal.clouds.wall.Passes`, `JobPasses` of a job and
        `ClusterPasses` have it: goes over all points.
    wall : tankcal.clouds.wall.CloudWall
        What the coarse cells of the same points show.
    welds : sequence of KnownWeld
        Of `known_welds`; heights count from the lowest joint of the wall.
    limits_mm : dict
        {"peaking": mm, "banding": mm}: a gap whose u exceeds a quarter of its limit is not
        determined. One that is left out is not known: whatever the u, it is told.
    memory_bytes : int, optional
        That the fine cells may take; welds that need more take turns, each time with a pass.

    Returns
    -------
    GapsFound
        Gaps in the order of the welds, with profiles of the three largest of each kind. U of a gap
        has the k of the largest of as many as may be it (two-sided, 95 % for all together).
    """
    across_m = width_by_density(wall)
    boards = []
    for some in _batches(welds, wall, across_m, memory_bytes):
        boards += _boards_of(passes, wall, some, across_m)
    gaps, figures = [None] * len(welds), []
    for kind in (PEAKING, BANDING):
        places = [i for i, one in enumerate(welds) if one.kind == kind]
        some, figure = largest_gaps(kind, [boards[i] for i in places], limits_mm.get(kind))
        for i, gap in zip(places, some, strict=True):
            gaps[i] = gap
        figures.append(figure)
    return GapsFound(tuple(gaps), tuple(figures))


def _batches(welds, wall, across_m, memory_bytes):
    """Lists of welds whose cells fit into memory together."""
    each, around_m = len(wall.sides) * BINS * COUNT_BYTES, FULL_TURN * wall.surface.radius_m
    batch, used = [], 0
    for one in welds:
        rows = 2 * reach_of(one, across_m) / across_m
        tall = one.high_m - one.low_m
        along = (around_m if one.kind == BANDING else tall) / ALONG_M + 1
        need = each * rows * along
        if batch and used + need > memory_bytes:
            yield batch
            batch, used = [], 0
        batch.append(one)
        used += need
    if batch:
        yield batch


def _boards_of(passes, wall, welds, across_m):
    """`Boards` of welds, by one pass over the points."""
    grids = {}
    for kind, grid_of in ((PEAKING, grid_of_uprights), (BANDING, grid_of_rounds)):
        if mine := [(one, reach_of(one, across_m)) for one in welds if one.kind == kind]:
            grids[kind] = grid_of(wall, mine, across_m)
    cells = passes.gather(weld_cells_of, wall.surface, tuple(grids.values()))
    fields = {
        kind: (grid, *located(grid, counts))
        for (kind, grid), counts in zip(grids.items(), cells.counts, strict=True)
    }
    return [boards_of(wall, one, across_m, *fields[one.kind]) for one in welds]
