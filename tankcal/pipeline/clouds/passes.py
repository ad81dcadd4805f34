"""Passes over the files of the clouds of a job: points in the frame of the tank, and their counts.

A `Share` is the part of a file that is read in one go. This module reads all shares one after the
other; `clouds.cluster` reads them by workers. The sums agree to the last bit.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from tankcal.clouds import CloudPiece, estimate_count, pieces_of, read_cloud
from tankcal.clouds.contents import WHOLE
from tankcal.clouds.formats.files import count_mismatch, open_cloud
from tankcal.clouds.wall import sample_points, sum_cells
from tankcal.messages import message
from tankcal.survey.readings import certified_distance_m

TOLD_EVERY_S = 0.5  # s between two reports of progress


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
