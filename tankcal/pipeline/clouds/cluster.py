"""Passes over the clouds of a job by dask workers, on this machine or on other machines.

Each worker reads one share of a file and returns its sample or its sums, which are added in a tree.
The sums are integers and the samples do not depend on the order. The record therefore has the same
bytes for any number of workers and any shares. `cluster` starts the workers.
"""

import contextlib
import ctypes
import socket
import time
import uuid
from functools import cache

from tankcal.clouds import estimate_count
from tankcal.clouds.wall.cells import WallCells
from tankcal.clouds.wall.passes import sample_points, sum_cells
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.clouds.passes import JobPasses, Tally
from tankcal.pipeline.cluster import Watch, count_cores, failures_told, is_installed, open_client

# Fewest points and cores for which local workers are faster: docs/clouds.md.
PAYS, FEWEST_CORES = 200_000_000, 4
FEWEST_EACH, MOST_EACH = 1 << 20, 1 << 23  # points of a share
SHARES_OF_WORKER = 6  # shares per worker
FAN = 8  # results added in one task
# Parameters of mallopt(3), and the size up to which freed memory is kept.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, KEPT_BYTES = -1, -3, 8 << 20
LOOK_S = 0.05  # s between two checks of the cluster


@contextlib.contextmanager
def open_passes(placing, reading, telling):
    """Open the passes over clouds that a `Reading` requests: in this process or by workers.

    Parameters
    ----------
    placing : Placing
    reading : Reading
    telling : Telling
        Receives the progress.

    Yields
    ------
    JobPasses or ClusterPasses

    Raises
    ------
    InputError
        If dask is not installed, or if an address does not answer.
    """
    workers = _workers_for(placing, reading.cluster)
    if workers == 0:
        yield JobPasses(placing, telling)
        return
    with open_client(workers) as client:
        yield ClusterPasses(client, placing, telling)


def _workers_for(placing, cluster):
    """Number of local workers, 0 for this process, or the address of a scheduler."""
    cores = count_cores()
    if cluster == "auto":
        if cores < FEWEST_CORES or not is_installed():
            return 0
        points = sum(estimate_count(file.header) for file in placing.files)
        return cores if points >= PAYS else 0
    return {None: 0, "local": cores}.get(cluster, cluster)


class ClusterPasses:
    """Both passes by workers (see `tankcal.clouds.wall.passes`).

    Attributes
    ----------
    left_out : ndarray of int, shape (scans,)
        Points of the last pass in excluded boxes.
    """

    def __init__(self, client, placing, telling, points_each=None):
        self.client, self.placing, self.telling = client, placing, telling
        self.points_each = points_each
        self.left_out = None

    def sample(self, most):
        """Return a `PointSample` of at most `most` points."""
        with failures_told():
            return self._reduced(_sample_part, _add_samples, most)

    def cells(self, surface, grid, scans):
        """Return the `WallCells` of all points.

        Parameters
        ----------
        surface, grid, scans
            As for `tankcal.clouds.wall.cells.WallCells`.

        Returns
        -------
        WallCells
        """
        with failures_told():
            sums = self._reduced(_cells_part, _add_cells, surface, grid, scans)
        cells = WallCells(surface, grid, scans)
        cells.add_packed(sums)
        return cells

    def gather(self, taken_of, *sizes):
        """Return taken_of(points, *sizes) for all points.

        Results of different shares are combined by their method `merge`.
        """
        with failures_told():
            return self._reduced(_taken_part, _add_taken, taken_of, *sizes)

    def _reduced(self, part_of, add_parts, *sizes):
        """Sum of the results of all shares, added in a tree."""
        shares = self.placing.shares(self._points_each())
        about = sum(share.points for share in shares)
        topic = f"tankcal-{uuid.uuid4().hex}"
        points_read = {}

        def note(event):  # the last count replaces that of a share read twice
            number, count = event[1]
            points_read[number] = count

        level = [
            self.client.submit(
                part_of, self.placing, share, topic, number, *sizes, key=f"{topic}-0-{number}"
            )
            for number, share in enumerate(shares)
        ]
        depth = 0
        while len(level) > 1:
            # Add FAN results per task, level by level.
            depth += 1
            level = [
                self.client.submit(
                    add_parts, level[i : i + FAN], *sizes, key=f"{topic}-{depth}-{i}"
                )
                for i in range(0, len(level), FAN)
            ]
        self.client.subscribe_topic(topic, note)
        try:
            result, tally = self._result_of(
                level[0], lambda: self.telling.tell(sum([*points_read.values()]), about)
            )
        finally:
            with contextlib.suppress(Exception):  # the scheduler may have ended
                self.client.unsubscribe_topic(topic)
        tally.check(self.placing)
        self.left_out = tally.left_out
        return result

    def _points_each(self):
        """Number of points per share, from the number of points and workers."""
        if self.points_each:
            return self.points_each
        points = sum(estimate_count(file.header) for file in self.placing.files)
        workers = max(len(self.client.scheduler_info(n_workers=-1)["workers"]), 1)
        return int(min(max(points / workers / SHARES_OF_WORKER, FEWEST_EACH), MOST_EACH))

    def _result_of(self, future, tell):
        """Wait for the result of a future; raise InputError if the cluster fails."""
        watch = Watch(self.client)
        while not future.done():
            time.sleep(LOOK_S)
            tell()
            watch.look()
        return future.result()


def _sample_part(placing, share, topic, number, most):
    """`PointSample` of a share, and its `Tally`."""
    tally = _tally_of(placing, share, topic, number)
    sample = sample_points(placing.points([share], tally), most)
    sample.reduce()
    return sample, tally


def _cells_part(placing, share, topic, number, surface, grid, scans):
    """Packed sums of a share, and its `Tally`."""
    tally = _tally_of(placing, share, topic, number)
    cells = sum_cells(placing.points([share], tally), surface, grid, scans)
    return cells.pack_sums(), tally


def _taken_part(placing, share, topic, number, taken_of, *sizes):
    """Result of taken_of for a share, and its `Tally`."""
    tally = _tally_of(placing, share, topic, number)
    return taken_of(placing.points([share], tally), *sizes), tally


def _add_taken(parts, *_):
    """Merge the results of several shares."""
    (taken, _), *others = parts
    for other, _ in others:
        taken = taken.merge(other)
    return taken, Tally.added([tally for _, tally in parts])


def _add_samples(parts, most):
    """Merge several samples."""
    (sample, _), *others = parts
    tally = Tally.added([part_tally for _, part_tally in parts])
    for other, _ in others:
        sample = sample.merge(other)
        sample.reduce()
    return sample, tally


def _add_cells(parts, surface, grid, scans):
    """Add several packed sums."""
    cells = WallCells(surface, grid, scans)
    for sums, _ in parts:
        cells.add_packed(sums)
    return cells.pack_sums(), Tally.added([tally for _, tally in parts])


def _tally_of(placing, share, topic, number):
    """`Tally` that reports its progress to the client; InputError if the file is missing here."""
    from distributed import get_worker

    path = placing.files[share.file].header.path
    if not path.exists():
        raise InputError(
            Problem(
                path.name,
                message(
                    "cluster_no_file",
                    "the worker on {machine} does not find it as {path}; expected it under the "
                    "same path on all machines of the cluster",
                    machine=socket.gethostname(),
                    path=str(path),
                ),
            )
        )
    _keep_memory()
    worker = get_worker()
    return placing.tally(lambda read: worker.log_event(topic, (number, read)))


@cache
def _keep_memory():
    """Let malloc keep freed memory.

    Dask makes its workers return freed memory at once. Each array of a few hundred kilobytes would
    then need fresh pages, and reading a LAS file took twice as long.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):  # mallopt exists on Linux only
        malloc = ctypes.CDLL(None).mallopt
        malloc(M_MMAP_THRESHOLD, KEPT_BYTES)
        malloc(M_TRIM_THRESHOLD, 2 * KEPT_BYTES)
