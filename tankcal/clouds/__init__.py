"""Point clouds: reading of scanner files, and detection of the wall in their points.

`describe_cloud` reads the header of a file. `read_cloud` yields the points in chunks, each scan in
its own frame. `pieces_of` divides a file into pieces that processes can read independently.
`tankcal.clouds.wall` sums the points in cells of the wall.
"""

import time

import numpy as np

from tankcal.clouds.formats import describe_file, divide_file, read_pieces
from tankcal.clouds.formats.columns import estimate_rows
from tankcal.clouds.formats.files import (
    EXTENT_LIMIT,
    WHOLE,
    CloudChunk,
    CloudHeader,
    CloudPiece,
    ScanHeader,
    count_mismatch,
    open_cloud,
)
from tankcal.errors import reason_of
from tankcal.messages import message

__all__ = [
    "CloudChunk",
    "CloudHeader",
    "CloudPiece",
    "ScanHeader",
    "describe_cloud",
    "estimate_count",
    "pieces_of",
    "read_cloud",
]


COARSEST_M = 1e-4  # largest permitted spacing of float32 coordinates, m
PROGRESS_PERIOD_S = 0.4  # least time between two reports of progress, s


def describe_cloud(path):
    """Read the header of a scanner file and check it against the size of the file.

    Parameters
    ----------
    path : path-like
        LAS, LAZ, E57, PLY, PTX or PTS file, or text file with x, y and z in columns.

    Returns
    -------
    CloudHeader

    Raises
    ------
    InputError
        If the file cannot be read, has an unknown format or an invalid header, or if a library is
        missing. The error lists all problems of the header.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "wall.xyz"
    >>> _ = path.write_text("x y z\\n6.5 0 1\\n0 6.5 1\\n")
    >>> describe_cloud(path).format
    'xyz'
    """
    file = open_cloud(path)
    kind, scans = _run_guarded(file, lambda: describe_file(file))
    return CloudHeader(file.path, kind, file.bytes, scans)


def pieces_of(header, points_each):
    """Divide a file into pieces that can be read independently.

    Parameters
    ----------
    header : CloudHeader
        Result of `describe_cloud`.
    points_each : int
        Approximate number of points per piece, for LAS, LAZ, binary PLY and text in columns. An
        E57 file has one piece per scan; a PTX, PTS or text PLY file is a single piece.

    Returns
    -------
    tuple of CloudPiece

    Raises
    ------
    InputError
        If the size of the file has changed since `describe_cloud`, or reading fails.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "wall.xyz"
    >>> _ = path.write_text("6.5 0 1\\n0 6.5 1\\n0 6.5 2\\n")
    >>> header = describe_cloud(path)
    >>> [piece.first for piece in pieces_of(header, 1)]
    [0, 16]
    """
    file = _open_unchanged(header)
    return _run_guarded(file, lambda: divide_file(file, points_each))


def estimate_count(header):
    """Number of points of a file, declared or estimated from the first lines of a text file."""
    declared = [scan.declared for scan in header.scans]
    return estimate_rows(open_cloud(header.path)) if None in declared else sum(declared)


def read_cloud(header, *, piece=WHOLE, unit_m=1.0, chunk=1 << 18, progress=None):
    """Yield the points of a file in chunks, with memory independent of the size of the file.

    Records without a return are counted and omitted. Poses are not applied.

    Parameters
    ----------
    header : CloudHeader
        Result of `describe_cloud`.
    piece : CloudPiece, optional
        Piece to read, from `pieces_of`; by default the whole file.
    unit_m : float, optional
        Length of one unit of the file, m (0.001 for millimetres).
    chunk : int, optional
        Largest number of records in a chunk.
    progress : callable, optional
        Called as progress(points read, total or None, name of the file), a few times per second
        and at the end. With a piece, the counts refer to the piece.

    Yields
    ------
    CloudChunk

    Raises
    ------
    InputError
        If the number of points differs from the header, if a point is not finite or too far from
        the first point, if float32 coordinates are coarser than 0.1 mm, or if decoding fails.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "wall.csv"
    >>> _ = path.write_text("x;y;z\\n6500,5;0;1000\\n")
    >>> for part in read_cloud(describe_cloud(path), unit_m=0.001):
    ...     print(part.scan, part.xyz_m)
    0 [[6.5005 0.     1.    ]]
    """
    file = _open_unchanged(header)
    count = _Count(file, header, piece, progress)
    check = _Check(file, unit_m, piece)
    chunks = iter(read_pieces(file, chunk, piece))
    while (records := _run_guarded(file, lambda: next(chunks, None))) is not None:
        count.add(records)
        xyz = check.to_metres(records)
        if len(xyz):
            yield CloudChunk(records.scan, xyz)
    count.finish()


def _open_unchanged(header):
    """Open the file of a header; raise InputError if its size has changed."""
    file = open_cloud(header.path)
    if file.bytes != header.bytes:
        raise file.refusal(
            message(
                "cloud_file_changed",
                "changed since it was looked at: {before} bytes, now {now}",
                before=header.bytes,
                now=file.bytes,
            )
        )
    return file


def _run_guarded(file, task):
    """Run a task and convert an OSError into an InputError of the file."""
    try:
        return task()
    except OSError as error:
        reason = reason_of(error)
        text = message("cloud_file_failed", "reading it failed: {reason}", reason=reason)
        raise file.refusal(text) from error


class _Count:
    """Comparison of the records read with the declared counts, and reports of progress."""

    def __init__(self, file, header, piece, progress):
        scans = header.scans
        self.file, self.scans, self.progress = file, scans, progress
        self.read = [0] * len(scans)
        self.declared = [scan.declared for scan in scans]
        if header.format == "xyz" and piece != WHOLE:  # a range of bytes, not of points
            self.declared = [None]
        self.first = 0
        if piece.scan is not None:
            self.declared = [n if i == piece.scan else 0 for i, n in enumerate(self.declared)]
        elif piece.count is not None and self.declared[0] is not None:
            self.first, self.declared = piece.first, [piece.count]
        self.total = None if None in self.declared else sum(self.declared)
        self.reported_s = time.monotonic()

    def add(self, piece):
        """Add the records of a piece; raise InputError above the declared count."""
        self.read[piece.scan] += piece.read
        self._compare(piece.scan, is_done=False)
        if self.progress and time.monotonic() - self.reported_s >= PROGRESS_PERIOD_S:
            self._report()

    def finish(self):
        """Check the final counts; raise InputError below the declared count."""
        for scan in range(len(self.scans)):
            self._compare(scan, is_done=True)
        if self.progress:
            self._report()

    def _report(self):
        self.reported_s = time.monotonic()
        self.progress(sum(self.read), self.total, self.file.name)

    def _compare(self, scan, is_done):
        declared, read = self.declared[scan], self.read[scan]
        if declared is not None and (read > declared or (is_done and read < declared)):
            raise count_mismatch(self.file, self.scans[scan].declared, self.first + read)


class _Check:
    """Checks of the coordinates (finite, close together, sufficient resolution) and conversion."""

    def __init__(self, file, unit_m, piece):
        self.file, self.unit_m = file, unit_m
        self.done, self.first = piece.first, None

    def to_metres(self, piece):
        """Check and convert coordinates to metres, float64 (n, 3); raise InputError if invalid."""
        xyz, before = piece.xyz, self.done
        self.done += piece.read
        if not len(xyz):
            return xyz
        if self.first is None:
            self.first = np.array(xyz[0], dtype=float)
        far = np.abs(self.first) + EXTENT_LIMIT  # not finite if the first point is not finite
        low, high = xyz.min(axis=0), xyz.max(axis=0)
        with np.errstate(invalid="ignore", over="ignore"):
            is_near = (low >= self.first - EXTENT_LIMIT) & (high <= self.first + EXTENT_LIMIT)
        if not (is_near.all() and np.isfinite(far).all()):
            raise self._invalid_point_error(piece, before)
        if xyz.dtype == np.float32:
            self._check_spacing(max(np.abs(low).max(), np.abs(high).max()))
        xyz = xyz.astype(np.float64, copy=False)
        return xyz if self.unit_m == 1.0 else xyz * self.unit_m

    def _invalid_point_error(self, piece, before):
        first = np.where(np.isfinite(self.first), self.first, 0.0)
        with np.errstate(invalid="ignore", over="ignore"):
            bad = ~(np.abs(piece.xyz - first) <= EXTENT_LIMIT).all(axis=1)
        i = int(np.flatnonzero(bad)[0]) if bad.any() else 0
        x, y, z = (f"{value:g}" for value in piece.xyz[i])
        # Only a range is known if records without a return were omitted.
        number = str(before + i + 1)
        if len(piece.xyz) != piece.read:
            number = message(
                "cloud_file_between",
                "between {first} and {last}",
                first=before + 1,
                last=before + piece.read,
            )
        values = {"number": number, "x": x, "y": y, "z": z}
        if np.isfinite(piece.xyz[i]).all():
            text = message(
                "cloud_file_far",
                "point {number} is ({x}, {y}, {z}), {most:g} or more from the first: damaged, "
                "or to be cleaned before",
                **values,
                most=EXTENT_LIMIT,
            )
        else:
            text = message(
                "cloud_file_not_finite",
                "point {number} is ({x}, {y}, {z}); expected finite numbers: export it without "
                "points that have no return",
                **values,
            )
        return self.file.refusal(text)

    def _check_spacing(self, largest):
        # The resolution of float32 is proportional to the coordinate.
        spacing = float(np.spacing(np.float32(largest))) * self.unit_m
        if spacing > COARSEST_M:
            raise self.file.refusal(
                message(
                    "cloud_file_coarse",
                    "numbers of 32 bits hold {largest:.0f} to {spacing_mm:.3g} mm only; expected "
                    "numbers of 64 bits, or coordinates from a nearby origin",
                    largest=float(largest),
                    spacing_mm=1000 * spacing,
                )
            )
