"""The passes over a job's clouds by workers of dask, on this machine or on others.

Each share of a file is read by one worker, which gives back its sample or its sums; these are added
in a tree. They are whole numbers and samples that know no order, so the record has the same bytes
with any number of workers and any shares. The workers themselves are those of `cluster`.
"""

import contextlib
import ctypes
import socket
import time
import uuid
from functools import cache

from tankcal.clouds import count_about
from tankcal.clouds.wall.cells import WallCells
from tankcal.clouds.wall.passes import cells_of, sample_of
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.cloud_passes import JobPasses, Tally
from tankcal.pipeline.cluster import Watch, count_cores, failures_told, is_installed, open_client

PAYS, FEWEST_CORES = 200_000_000, 4  # points and cores from which local workers pay: docs/clouds.md
FEWEST_EACH, MOST_EACH = 1 << 20, 1 << 23  # points of a share
SHARES_OF_WORKER = 6
FAN = 8  # parts that are added at once
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, KEPT_BYTES = -1, -3, 8 << 20  # of mallopt(3)
LOOK_S = 0.05  # between looks


@contextlib.contextmanager
def open_passes(placing, reading, telling):
    """The passes over clouds as `Reading` asks for them: in this process or by workers.

    Raises
    ------
    InputError
        Where dask is not installed, or an address does not answer.
    """
    workers = _workers_for(placing, reading.cluster)
    if workers == 0:
        yield JobPasses(placing, telling)
        return
    with open_client(workers) as client:
        yield ClusterPasses(client, placing, telling)


def _workers_for(placing, cluster):
    """Number of local workers, 0: none; or an address."""
    cores = count_cores()
    if cluster == "auto":
        if cores < FEWEST_CORES or not is_installed():
            return 0
        points = sum(count_about(file.header) for file in placing.files)
        return cores if points >= PAYS else 0
    return {None: 0, "local": cores}.get(cluster, cluster)


class ClusterPasses:
    """Both passes by workers (see `tankcal.clouds.wall.passes`).

    Attributes
    ----------
    left_out : ndarray of int, shape (scans,)
        Points in boxes that are left out, of the last pass.
    """

    def __init__(self, client, placing, telling, points_each=None):
        self.client, self.placing, self.telling = client, placing, telling
        self.points_each = points_each
        self.left_out = None

    def sample(self, most):
        """`PointSample` of at most so many points."""
        with failures_told():
            return self._reduced(_sample_part, _add_samples, most)

    def cells(self, surface, grid, scans):
        """`WallCells` of all points."""
        with failures_told():
            packed = self._reduced(_cells_part, _add_cells, surface, grid, scans)
        cells = WallCells(surface, grid, scans)
        cells.add_packed(packed)
        return cells

    def gather(self, taken_of, *sizes):
        """What taken_of(points, *sizes) takes of all points; two of it have `merged`."""
        with failures_told():
            return self._reduced(_taken_part, _add_taken, taken_of, *sizes)

    def _reduced(self, part_of, added, *sizes):
        """What the shares give, added in a tree."""
        shares = self.placing.shares(self._points_each())
        about = sum(one.points for one in shares)
        topic = f"tankcal-{uuid.uuid4().hex}"
        read = {}

        def note(event):  # of a share that is read again, its last word counts
            number, count = event[1]
            read[number] = count

        level = [
            self.client.submit(
                part_of, self.placing, share, topic, number, *sizes, key=f"{topic}-0-{number}"
            )
            for number, share in enumerate(shares)
        ]
        depth = 0
        while len(level) > 1:
            depth += 1
            level = [
                self.client.submit(added, level[i : i + FAN], *sizes, key=f"{topic}-{depth}-{i}")
                for i in range(0, len(level), FAN)
            ]
        self.client.subscribe_topic(topic, note)
        try:
            found, tally = self._result_of(
                level[0], lambda: self.telling.tell(sum([*read.values()]), about)
            )
        finally:
            with contextlib.suppress(Exception):  # of a scheduler that is gone
                self.client.unsubscribe_topic(topic)
        tally.check(self.placing)
        self.left_out = tally.left_out
        return found

    def _points_each(self):
        if self.points_each:
            return self.points_each
        points = sum(count_about(file.header) for file in self.placing.files)
        workers = max(len(self.client.scheduler_info(n_workers=-1)["workers"]), 1)
        return int(min(max(points / workers / SHARES_OF_WORKER, FEWEST_EACH), MOST_EACH))

    def _result_of(self, future, tell):
        """The result of a future; InputError in one line for what keeps it from coming."""
        watch = Watch(self.client)
        while not future.done():
            time.sleep(LOOK_S)
            tell()
            watch.look()
        return future.result()


def _sample_part(placing, share, topic, number, most):
    """`PointSample` of a share, and its `Tally`."""
    tally = _tally_of(placing, share, topic, number)
    sample = sample_of(placing.points([share], tally), most)
    sample.reduce()
    return sample, tally


def _cells_part(placing, share, topic, number, surface, grid, scans):
    """Packed sums of a share, and its `Tally`."""
    tally = _tally_of(placing, share, topic, number)
    cells = cells_of(placing.points([share], tally), surface, grid, scans)
    return cells.packed(), tally


def _taken_part(placing, share, topic, number, taken_of, *sizes):
    """What is taken of a share, and its `Tally`."""
    tally = _tally_of(placing, share, topic, number)
    return taken_of(placing.points([share], tally), *sizes), tally


def _add_taken(parts, *_):
    """What was taken of several shares as one."""
    (taken, _), *others = parts
    for other, _ in others:
        taken = taken.merged(other)
    return taken, Tally.added([one for _, one in parts])


def _add_samples(parts, most):
    """Several samples as one."""
    (sample, _), *others = parts
    tally = Tally.added([one for _, one in parts])
    for other, _ in others:
        sample = sample.merged(other)
        sample.reduce()
    return sample, tally


def _add_cells(parts, surface, grid, scans):
    """Several packed sums as one."""
    cells = WallCells(surface, grid, scans)
    for packed, _ in parts:
        cells.add_packed(packed)
    return cells.packed(), Tally.added([one for _, one in parts])


def _tally_of(placing, share, topic, number):
    """A `Tally` that tells the client how far it is; InputError where this machine has no file."""
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
    """Let malloc keep what is free: workers of dask are told to give it back at once, and each
    array of a few hundred kilobytes would then be made of fresh pages: LAS took twice the time.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):  # another system than Linux
        malloc = ctypes.CDLL(None).mallopt
        malloc(M_MMAP_THRESHOLD, KEPT_BYTES)
        malloc(M_TRIM_THRESHOLD, 2 * KEPT_BYTES)
