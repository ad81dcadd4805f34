"""The passes over the files of a job's clouds: points placed in the frame of the tank, counted.

What is read in one go is a `Share` of a file. Here all shares are read one after the other;
`cloud_cluster` has the same from workers. Both give the same sums to the last bit.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from tankcal.clouds import CloudPiece, count_about, pieces_of, read_cloud
from tankcal.clouds.contents import WHOLE
from tankcal.clouds.formats.files import count_mismatch, open_cloud
from tankcal.clouds.wall import cells_of, sample_of
from tankcal.messages import message
from tankcal.survey.readings import certified_distance_m

TOLD_EVERY_S = 0.5


@dataclass(frozen=True)
class Reading:
    """How the files of clouds are read, and who is told.

    Attributes
    ----------
    cluster : None, "auto", "local", int or str
        None: in this process; "auto": by local workers where that pays; "local": by as many as
        there are cores; a number of local workers; the address of a scheduler of dask.
    part_progress : callable or None
        part_progress(text, points read, points in all).
    """

    cluster: object = None
    part_progress: object = None


@dataclass(frozen=True)
class Share:
    """A piece of a file: number of the file, its piece, about how many points it has."""

    file: int
    piece: CloudPiece = WHOLE
    points: float = 0.0


@dataclass(frozen=True)
class Placing:
    """All that is needed to read shares of a job's clouds, in whatever process.

    Attributes
    ----------
    files : tuple of job.model.clouds.CloudFile
    scans : tuple of ScanSetup
    ranging : dict of str to RangingInstrument
    rotation, place_m : ndarray, shapes (scans, 3, 3) and (scans, 3)
        Of the registration.
    """

    files: tuple
    scans: tuple
    ranging: dict
    rotation: np.ndarray
    place_m: np.ndarray

    @classmethod
    def of(cls, clouds, registration):
        """Of the clouds of a job and the `Registration` of their scans."""
        files = tuple(replace(one, header=_from_root(one.header)) for one in clouds.files)
        places = registration.rotation, registration.place_m
        return cls(files, clouds.scans, clouds.ranging, *places)

    def shares(self, points_each=None):
        """`Share`s of all files; None: each file is one."""
        found = []
        for number, file in enumerate(self.files):
            pieces = pieces_of(file.header, points_each) if points_each else (WHOLE,)
            points = count_about(file.header)
            for piece in pieces:
                found.append(Share(number, piece, _points_in(file.header, piece, points)))
        return tuple(found)

    def tally(self, tell_read=None):
        """A `Tally` of the files."""
        return Tally(len(self.files), len(self.scans), tell_read)

    def points(self, shares, tally):
        """Scan and places (n, 3) in the frame of the tank, m, of shares one after the other."""
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
        given = self.scans[scan]
        tool = self.ranging[given.scanner]
        beam = xyz_m - given.beam_from_m if given.beam_from_m.any() else xyz_m
        if tool.correction or tool.correction_m:
            distance = np.maximum(np.sqrt((beam * beam).sum(axis=1)), 1e-9)
            beam = beam * (certified_distance_m(distance, tool) / distance)[:, None]
        x, y, z = beam.T  # no product of matrices: its rounding would hang on the number of points
        found = np.empty((3, len(beam)))
        for row, (a, b, c), place in zip(
            found, self.rotation[scan], self.place_m[scan], strict=True
        ):
            np.multiply(x, a, out=row)
            row += b * y
            row += c * z
            row += place
        return found.T


class Tally:
    """What is counted beside the points: records read of each file, points in boxes of each scan.

    files, scans  numbers of them
    tell_read     called with the records read in all, now and then
    """

    def __init__(self, files, scans, tell_read=None):
        self.left_out = np.zeros(scans, dtype=int)
        self.read = np.zeros(files, dtype=int)
        self._tell_read, self._now = tell_read, 0

    @classmethod
    def added(cls, tallies):
        """One that has counted what all of them have."""
        found = cls(len(tallies[0].read), len(tallies[0].left_out))
        for one in tallies:
            found.left_out += one.left_out
            found.read += one.read
        return found

    def tell(self, file, read):
        """So many records were read of the share at hand."""
        self._now = read
        if self._tell_read is not None:
            self._tell_read(int(self.read.sum()) + read)

    def end(self, file):
        """The share at hand is read."""
        self.read[file] += self._now
        self._now = 0

    def check(self, placing):
        """InputError where all shares together have not the points that a file declares."""
        for file, read in zip(placing.files, self.read, strict=True):
            declared = [one.declared for one in file.header.scans]
            if None not in declared and read != sum(declared):
                raise count_mismatch(open_cloud(file.header.path), sum(declared), int(read))

    def __getstate__(self):
        return {**self.__dict__, "_tell_read": None}


class JobPasses:
    """Both passes over all files in this process (see `tankcal.clouds.wall.passes`).

    Attributes
    ----------
    left_out : ndarray of int, shape (scans,)
        Points in boxes that are left out, of the last pass.
    """

    def __init__(self, placing, telling=None):
        self.placing, self.telling = placing, telling or Telling()
        self.left_out = np.zeros(len(placing.scans), dtype=int)

    def sample(self, most):
        """`PointSample` of at most so many points."""
        return self.gather(sample_of, most)

    def cells(self, surface, grid, scans):
        """`WallCells` of all points."""
        return self.gather(cells_of, surface, grid, scans)

    def gather(self, taken_of, *sizes):
        """What taken_of(points, *sizes) takes of all points."""
        shares = self.placing.shares()
        about = sum(one.points for one in shares)
        tally = self.placing.tally(lambda read: self.telling.tell(read, about))
        found = taken_of(self.placing.points(shares, tally), *sizes)
        tally.check(self.placing)
        self.left_out = tally.left_out
        return found


class Telling:
    """Tells how many points of a pass were read, under the text of the step that is done.

    progress, part_progress  as `chain.run` takes them
    """

    def __init__(self, progress=None, part_progress=None):
        self._progress, self._part = progress, part_progress
        self._text, self._told = message("reading_points", "reading points"), 0.0

    def step(self, text):
        """A step begins."""
        self._text, self._told = text, 0.0
        if self._progress is not None:
            self._progress(text)

    def tell(self, read, about):
        """So many of about so many points are read."""
        now = time.monotonic()
        if self._part is not None and now - self._told >= TOLD_EVERY_S:
            self._told = now
            self._part(self._text, int(read), int(max(read, about)))


def _from_root(header):
    """The header with the whole path of its file: other processes stand in other folders."""
    return replace(header, path=header.path.absolute())


def _points_in(header, piece, about):
    """About how many points a piece of a file has."""
    if piece.scan is not None:
        return header.scans[piece.scan].declared
    if piece.count is None:
        return about
    return about * piece.count / header.bytes if header.format == "xyz" else piece.count


def _is_in_boxes(xyz_m, boxes_m):
    inside = np.zeros(len(xyz_m), dtype=bool)
    for box in boxes_m:
        inside |= np.all((xyz_m >= box[:3]) & (xyz_m <= box[3:]), axis=1)
    return inside
