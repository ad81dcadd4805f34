"""Passes over the files of point clouds, in this process or by workers.

Passes over the files of the clouds of a job: points in the frame of the tank, and their counts.

A `Share` is the part of a file that is read in one go. This module reads all shares one after the
other; `clouds.cluster` reads them by workers. The sums agree to the last bit.

Passes over the clouds of a job by dask workers, on this machine or on other machines.

Each worker reads one share of a file and returns its sample or its sums, which are added in a tree.
The sums are integers and the samples do not depend on the order. The record therefore has the same
bytes for any number of workers and any shares. `cluster` starts the workers.
"""

import contextlib
import ctypes
import socket
import time
import uuid
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tankcal.clouds import CloudPiece, estimate_count, pieces_of, read_cloud
from tankcal.clouds.formats.files import WHOLE, count_mismatch, open_cloud
from tankcal.clouds.wall.cells import WallCells
from tankcal.clouds.wall.passes import sample_points, sum_cells
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.methods.clouds.cluster import (
    Watch,
    count_cores,
    is_installed,
    open_client,
    report_failures,
)
from tankcal.survey.wall_hits import certified_distance_m

TOLD_EVERY_S = 0.5  # s between two reports of progress
# Fewest points and cores for which local workers are faster: docs/clouds.md.
PAYS, FEWEST_CORES = 200_000_000, 4
FEWEST_EACH, MOST_EACH = 1 << 20, 1 << 23  # points of a share
SHARES_OF_WORKER = 6  # shares per worker
FAN = 8  # results added in one task
# Parameters of mallopt(3), and the size up to which freed memory is kept.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, KEPT_BYTES = -1, -3, 8 << 20
LOOK_S = 0.05  # s between two checks of the cluster


# ---- passes over the files of the clouds of a job


@dataclass(frozen=True)
class Reading:
    """Processes that read the files of clouds, and the function that receives the progress.

    Attributes
    ----------
    cluster : None, "auto", "local", int or str
        None: this process; "auto": local workers for large clouds; "local": as many workers as
        there are cores; an integer: number of local workers; an address: the scheduler of a dask
        cluster.
    part_progress : callable or None
        part_progress(text, points read, points in all).
    """

    cluster: object = None
    part_progress: object = None


@dataclass(frozen=True)
class Share:
    """A piece of a file: number of the file, its piece, and its approximate number of points."""

    file: int
    piece: CloudPiece = WHOLE
    points: float = 0.0


@dataclass(frozen=True)
class Placing:
    """All data that a process needs to read shares of the clouds of a job.

    Attributes
    ----------
    files : tuple of methods.clouds.readings.CloudFile
    scans : tuple of ScanSetup
    ranging : dict of str to RangingInstrument
        Instruments by name.
    rotation, place_m : ndarray, shapes (scans, 3, 3) and (scans, 3)
        Rotation and origin of each scan in the frame of the tank, m, from the registration.
    """

    files: tuple
    scans: tuple
    ranging: dict
    rotation: np.ndarray
    place_m: np.ndarray

    @classmethod
    def of(cls, clouds, registration):
        """Return the `Placing` of the clouds of a job and the `Registration` of their scans."""
        files = tuple(
            replace(file, header=replace(file.header, path=file.header.path.absolute()))
            for file in clouds.files
        )
        places = registration.rotation, registration.place_m
        return cls(files, clouds.scans, clouds.ranging, *places)

    def shares(self, points_each=None):
        """Return the `Share`s of all files; None: one share per file."""
        shares = []
        for number, file in enumerate(self.files):
            pieces = pieces_of(file.header, points_each) if points_each else (WHOLE,)
            points = estimate_count(file.header)
            for piece in pieces:
                shares.append(Share(number, piece, _points_in(file.header, piece, points)))
        return tuple(shares)

    def tally(self, tell_read=None):
        """Return an empty `Tally` of the files."""
        return Tally(len(self.files), len(self.scans), tell_read)

    def points(self, shares, tally):
        """Yield the scan number and the points of each chunk of given shares.

        Parameters
        ----------
        shares : sequence of Share
        tally : Tally
            Counts the records read and the points in excluded boxes.

        Yields
        ------
        (int, ndarray of shape (n, 3))
            Scan, and points in the frame of the tank, m.
        """
        for share in shares:
            file = self.files[share.file]
            chunks = read_cloud(
                file.header,
                piece=share.piece,
                unit_m=file.unit_m,
                progress=lambda read, _, __, file=share.file: tally.tell(file, read),
            )
            for chunk in chunks:
                scan = file.first + chunk.scan
                xyz = self._placed(chunk.xyz_m, scan)
                if len(file.leave_out_m):
                    kept = ~_is_in_boxes(xyz, file.leave_out_m)
                    tally.left_out[scan] += len(xyz) - np.count_nonzero(kept)
                    xyz = xyz[kept]
                if len(xyz):
                    yield scan, xyz
            tally.end(share.file)

    def _placed(self, xyz_m, scan):
        """Points (n, 3) of a scan in the frame of the tank, m, with certified distances."""
        setup = self.scans[scan]
        tool = self.ranging[setup.scanner]
        beam = xyz_m - setup.beam_from_m if setup.beam_from_m.any() else xyz_m
        if tool.correction or tool.correction_m:
            # Distances are corrected along the beam, before the rotation.
            distance = np.maximum(np.sqrt((beam * beam).sum(axis=1)), 1e-9)
            beam = beam * (certified_distance_m(distance, tool) / distance)[:, None]
        # A matrix product would round differently for different numbers of points.
        x, y, z = beam.T
        placed = np.empty((3, len(beam)))
        for row, (a, b, c), place in zip(
            placed, self.rotation[scan], self.place_m[scan], strict=True
        ):
            np.multiply(x, a, out=row)
            row += b * y
            row += c * z
            row += place
        return placed.T


class Tally:
    """Counts of a pass: records read from each file, and points of each scan in excluded boxes.

    Parameters
    ----------
    files, scans : int
        Numbers of files and scans.
    tell_read : callable, optional
        Called with the number of all records read.
    """

    def __init__(self, files, scans, tell_read=None):
        self.left_out = np.zeros(scans, dtype=int)
        self.read = np.zeros(files, dtype=int)
        self._tell_read, self._now = tell_read, 0

    @classmethod
    def added(cls, tallies):
        """Return the sum of several tallies."""
        total = cls(len(tallies[0].read), len(tallies[0].left_out))
        for tally in tallies:
            total.left_out += tally.left_out
            total.read += tally.read
        return total

    def tell(self, file, read):
        """Report the number of records read of the current share."""
        self._now = read
        if self._tell_read is not None:
            self._tell_read(int(self.read.sum()) + read)

    def end(self, file):
        """Close the current share and add its records to those of its file."""
        self.read[file] += self._now
        self._now = 0

    def check(self, placing):
        """Raise InputError if the shares lack points that a file declares, or have more."""
        for file, read in zip(placing.files, self.read, strict=True):
            declared = [scan.declared for scan in file.header.scans]
            if None not in declared and read != sum(declared):
                raise count_mismatch(open_cloud(file.header.path), sum(declared), int(read))

    def __getstate__(self):
        return {**self.__dict__, "_tell_read": None}


class JobPasses:
    """Both passes over all files in this process (see `tankcal.clouds.wall.passes`).

    Attributes
    ----------
    left_out : ndarray of int, shape (scans,)
        Points of the last pass in excluded boxes.
    """

    def __init__(self, placing, telling=None):
        self.placing, self.telling = placing, telling or Telling()
        self.left_out = np.zeros(len(placing.scans), dtype=int)

    def sample(self, most):
        """Return a `PointSample` of at most `most` points."""
        return self.gather(sample_points, most)

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
        return self.gather(sum_cells, surface, grid, scans)

    def gather(self, taken_of, *sizes):
        """Return taken_of(points, *sizes) for all points."""
        shares = self.placing.shares()
        about = sum(share.points for share in shares)
        tally = self.placing.tally(lambda read: self.telling.tell(read, about))
        result = taken_of(self.placing.points(shares, tally), *sizes)
        tally.check(self.placing)
        self.left_out = tally.left_out
        return result


class Telling:
    """Reports the number of points read, under the text of the current step.

    Parameters
    ----------
    progress, part_progress : callable, optional
        As in `chain.run`.
    """

    def __init__(self, progress=None, part_progress=None):
        self._progress, self._part = progress, part_progress
        self._text, self._told = message("reading_points", "reading points"), 0.0

    def step(self, text):
        """Begin a step."""
        self._text, self._told = text, 0.0
        if self._progress is not None:
            self._progress(text)

    def tell(self, read, about):
        """Report the points read so far, out of approximately `about` points."""
        now = time.monotonic()
        if self._part is not None and now - self._told >= TOLD_EVERY_S:
            self._told = now
            self._part(self._text, int(read), int(max(read, about)))


def _points_in(header, piece, about):
    """Approximate number of points of a piece of a file."""
    if piece.scan is not None:
        return header.scans[piece.scan].declared
    if piece.count is None:
        return about
    return about * piece.count / header.bytes if header.format == "xyz" else piece.count


def _is_in_boxes(xyz_m, boxes_m):
    """Whether each point lies in a box, shape (n,); boxes: lowest and highest corner, (k, 6), m."""
    inside = np.zeros(len(xyz_m), dtype=bool)
    for box in boxes_m:
        inside |= np.all((xyz_m >= box[:3]) & (xyz_m <= box[3:]), axis=1)
    return inside


# ---- passes over the clouds of a job by dask workers, on this machine or on other machines


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
        with report_failures():
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
        with report_failures():
            sums = self._reduced(_cells_part, _add_cells, surface, grid, scans)
        cells = WallCells(surface, grid, scans)
        cells.add_packed(sums)
        return cells

    def gather(self, taken_of, *sizes):
        """Return taken_of(points, *sizes) for all points.

        Results of different shares are combined by their method `merge`.
        """
        with report_failures():
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
