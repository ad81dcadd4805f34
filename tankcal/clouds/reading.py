"""The doors to files of scanners: what a file holds, and its points, a chunk at a time."""

import time

import numpy as np

from tankcal.clouds.contents import WHOLE, CloudChunk, CloudHeader
from tankcal.clouds.formats import describe_file, read_pieces, share_out
from tankcal.clouds.formats.columns import rows_about
from tankcal.clouds.formats.files import EXTENT_LIMIT, count_mismatch, open_cloud
from tankcal.errors import reason_of
from tankcal.messages import message

COARSEST_M = 1e-4  # the next float32 after a coordinate may lie this far off
TOLD_EVERY_S = 0.4


def describe_cloud(path):
    """What a file of a scanner says that it holds, its header checked against its size.

    Parameters
    ----------
    path
        Of a LAS, LAZ, E57, PLY, PTX, PTS file, or of text with x, y and z in columns.

    Returns
    -------
    CloudHeader

    Raises
    ------
    InputError
        With every problem that the header shows: of the file, its format, sizes that do not fit
        into it, numbers that can be no scale, offset, box or pose, a library that is missing.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "wall.xyz"
    >>> _ = path.write_text("x y z\\n6.5 0 1\\n0 6.5 1\\n")
    >>> describe_cloud(path).format
    'xyz'
    """
    file = open_cloud(path)
    kind, scans = _guarded(file, lambda: describe_file(file))
    return CloudHeader(file.path, kind, file.bytes, scans)


def pieces_of(header, points_each):
    """The pieces of a described file, each read on its own; together they are the file.

    Parameters
    ----------
    header
        `CloudHeader` of `describe_cloud`.
    points_each : int
        About how many points a piece has: LAS, LAZ, PLY of binary numbers and text in columns
        are cut so; E57 has a piece for each scan, and PTX, PTS and PLY of text are one.

    Returns
    -------
    tuple of CloudPiece

    Raises
    ------
    InputError
        As `read_cloud` raises it for a file that changed.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "wall.xyz"
    >>> _ = path.write_text("6.5 0 1\\n0 6.5 1\\n0 6.5 2\\n")
    >>> header = describe_cloud(path)
    >>> [one.first for one in pieces_of(header, 1)]
    [0, 16]
    """
    file = _unchanged(header)
    return _guarded(file, lambda: share_out(file, points_each))


def count_about(header):
    """How many points a described file has: as it declares or, of text, by its first lines."""
    declared = [scan.declared for scan in header.scans]
    return rows_about(open_cloud(header.path)) if None in declared else sum(declared)


def read_cloud(header, *, piece=WHOLE, unit_m=1.0, chunk=1 << 18, progress=None):
    """The points of a described file, a chunk at a time; memory does not grow with the file.

    Points without a return are counted as read and left out. A pose is not applied.

    Parameters
    ----------
    header
        `CloudHeader` of `describe_cloud`.
    piece : CloudPiece, optional
        Of `pieces_of`: what is read of it.
    unit_m : optional
        Length of one unit of the file, m (0.001 for millimetres).
    chunk : optional
        Most points at a time.
    progress : callable, optional
        progress(points read, points in all or None, name of the file), a few times a second and
        at the end; with a piece, those of the piece.

    Yields
    ------
    CloudChunk

    Raises
    ------
    InputError
        Where the points are not as many as the header says, not finite, too far apart, or in
        float32 that cannot tell a tenth of a millimetre; where a file cannot be decoded.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "wall.csv"
    >>> _ = path.write_text("x;y;z\\n6500,5;0;1000\\n")
    >>> for part in read_cloud(describe_cloud(path), unit_m=0.001):
    ...     print(part.scan, part.xyz_m)
    0 [[6.5005 0.     1.    ]]
    """
    file = _unchanged(header)
    count = _Count(file, header, piece, progress)
    check = _Check(file, unit_m, piece)
    parts = iter(read_pieces(file, chunk, piece))
    while (found := _guarded(file, lambda: next(parts, None))) is not None:
        count.add(found)
        xyz = check.metres(found)
        if len(xyz):
            yield CloudChunk(found.scan, xyz)
    count.finish()


def _unchanged(header):
    """The `CloudFile` of a header; InputError where it has another size now."""
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


def _guarded(file, task):
    """The result of a task; a disk that fails meanwhile is the file's problem."""
    try:
        return task()
    except OSError as error:
        reason = reason_of(error)
        failed = message("cloud_file_failed", "reading it failed: {reason}", reason=reason)
        raise file.refusal(failed) from error


class _Count:
    """Records read of each scan, against what was declared; tells the progress."""

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
        self.told = time.monotonic()

    def add(self, piece):
        """Count a piece; InputError when there are more than declared."""
        self.read[piece.scan] += piece.read
        self._compare(piece.scan, is_done=False)
        if self.progress and time.monotonic() - self.told >= TOLD_EVERY_S:
            self._tell()

    def finish(self):
        """InputError when a scan has fewer than declared."""
        for scan in range(len(self.scans)):
            self._compare(scan, is_done=True)
        if self.progress:
            self._tell()

    def _tell(self):
        self.told = time.monotonic()
        self.progress(sum(self.read), self.total, self.file.name)

    def _compare(self, scan, is_done):
        declared, read = self.declared[scan], self.read[scan]
        if declared is not None and (read > declared or (is_done and read < declared)):
            raise count_mismatch(self.file, self.scans[scan].declared, self.first + read)


class _Check:
    """Coordinates that are finite, near each other, fine enough, in metres."""

    def __init__(self, file, unit_m, piece):
        self.file, self.unit_m = file, unit_m
        self.done, self.first = piece.first, None

    def metres(self, piece):
        """float64 (n, 3), m; InputError for what can be no point of a wall."""
        xyz, before = piece.xyz, self.done
        self.done += piece.read
        if not len(xyz):
            return xyz
        if self.first is None:
            self.first = np.array(xyz[0], dtype=float)
        far = np.abs(self.first) + EXTENT_LIMIT  # of a first point that is not finite: never near
        low, high = xyz.min(axis=0), xyz.max(axis=0)
        with np.errstate(invalid="ignore", over="ignore"):
            is_near = (low >= self.first - EXTENT_LIMIT) & (high <= self.first + EXTENT_LIMIT)
        if not (is_near.all() and np.isfinite(far).all()):
            raise self._far(piece, before)
        if xyz.dtype == np.float32:
            self._check_spacing(max(np.abs(low).max(), np.abs(high).max()))
        xyz = xyz.astype(np.float64, copy=False)
        return xyz if self.unit_m == 1.0 else xyz * self.unit_m

    def _far(self, piece, before):
        first = np.where(np.isfinite(self.first), self.first, 0.0)
        with np.errstate(invalid="ignore", over="ignore"):
            bad = ~(np.abs(piece.xyz - first) <= EXTENT_LIMIT).all(axis=1)
        i = int(np.flatnonzero(bad)[0]) if bad.any() else 0
        x, y, z = (f"{value:g}" for value in piece.xyz[i])
        is_exact = len(piece.xyz) == piece.read
        numbers = [before + i + 1] if is_exact else [before + 1, before + piece.read]
        if np.isfinite(piece.xyz[i]).all():
            return self.file.refusal(
                message(
                    "cloud_file_far",
                    "point {number} is ({x}, {y}, {z}), {most:g} or more from the first: damaged, "
                    "or to be cleaned before",
                    number=_place(numbers),
                    x=x,
                    y=y,
                    z=z,
                    most=EXTENT_LIMIT,
                )
            )
        return self.file.refusal(
            message(
                "cloud_file_not_finite",
                "point {number} is ({x}, {y}, {z}); expected finite numbers: export it without "
                "points that have no return",
                number=_place(numbers),
                x=x,
                y=y,
                z=z,
            )
        )

    def _check_spacing(self, largest):
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


def _place(numbers):
    """The number of a point, or between which ones it is."""
    if len(numbers) == 1:
        return str(numbers[0])
    first, last = numbers
    return message("cloud_file_between", "between {first} and {last}", first=first, last=last)
