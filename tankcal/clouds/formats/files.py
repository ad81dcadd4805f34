"""Scanner files: opening, format by signature or extension, header, pieces and chunks."""

import importlib.util
import stat
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message
from tankcal.version import install_command


@dataclass(frozen=True)
class ScanHeader:
    """Header of one scan of a file.

    Attributes
    ----------
    name : str
        Name of the scan in its file, or "" if the file gives no name.
    declared : int or None
        Number of points that the file declares for the scan, or None if the format has no count.
    pose : ndarray, shape (4, 4), or None
        Transformation from the frame of the scan to the frame of the file, lengths in the unit of
        the file. None if the file contains no pose; all its coordinates then refer to one frame.
    warning : Message or None
        Warning about a pose of the file that is not used.
    is_placed : bool
        Whether the file gives a position without a rotation. Several such scans have no common
        frame.
    """

    name: str
    declared: int | None
    pose: np.ndarray | None = None
    warning: str | None = None
    is_placed: bool = False


@dataclass(frozen=True)
class CloudHeader:
    """Valid header of a file of scans.

    Attributes
    ----------
    path : Path
        Path of the file.
    format : str
        "las", "laz", "e57", "ply", "ptx", "pts" or "xyz".
    bytes : int
        Size of the file.
    scans : tuple of ScanHeader
        Scans in the order of the file.
    """

    path: Path
    format: str
    bytes: int
    scans: tuple[ScanHeader, ...]


@dataclass(frozen=True)
class CloudPiece:
    """Part of a file that can be read independently of the rest.

    Attributes
    ----------
    scan : int or None
        Index of the only scan to read, or None for all scans.
    first : int
        Number of records to skip; bytes for text in columns.
    count : int or None
        Number of records to read; bytes for text in columns. None: to the end of the file.
    """

    scan: int | None = None
    first: int = 0
    count: int | None = None


WHOLE = CloudPiece()


@dataclass(frozen=True)
class CloudChunk:
    """Some points of one scan.

    Attributes
    ----------
    scan : int
        Index of the scan in its file.
    xyz_m : ndarray of float64, shape (n, 3)
        Coordinates in the frame of the scan, m, without its pose. Each column is contiguous, which
        makes operations by column fast.
    """

    scan: int
    xyz_m: np.ndarray


TEXT_ENDINGS = (".ptx", ".pts", ".xyz", ".asc", ".txt", ".csv")
ENDINGS = (".las", ".laz", ".e57", ".ply", *TEXT_ENDINGS)
SNIFFED = 1 << 16  # bytes at the start of a file that are read to determine its format
EXTENT_LIMIT = 1e7  # largest extent of a cloud, in units of the file; a larger one is damage


@dataclass(frozen=True)
class CloudFile:
    """Regular file that is not empty.

    Attributes
    ----------
    path : Path
        Path of the file.
    bytes : int
        Size of the file.
    start : bytes
        The first bytes of the file, at most `SNIFFED`.
    """

    path: Path
    bytes: int
    start: bytes

    @property
    def name(self):
        """Name of the file in messages."""
        return self.path.name

    @property
    def ending(self):
        """File extension in lower case, with its point."""
        return self.path.suffix.lower()

    def refusal(self, *texts, row=None):
        """Create an InputError with one problem per text."""
        return InputError([Problem(self.name, text, row) for text in texts])


@dataclass(frozen=True)
class Piece:
    """Some records of one scan.

    Attributes
    ----------
    scan : int
        Index of the scan in its file.
    xyz : ndarray, shape (n, 3)
        Coordinates in the unit of the file, each column contiguous; float32 if the file contains
        float32.
    read : int
        Number of records read: n, plus the records without a return.
    """

    scan: int
    xyz: np.ndarray
    read: int


def divide_records(count, each):
    """Divide `count` records into pieces of `each` records; the last may be shorter."""
    return tuple(
        CloudPiece(None, first, min(each, count - first)) for first in range(0, count, each)
    )


def open_cloud(path):
    """Open a path as a `CloudFile`; raise InputError if it is not a readable, non-empty file."""
    path = Path(path)
    try:
        status = path.stat()
        is_regular = stat.S_ISREG(status.st_mode)
        if is_regular:
            with path.open("rb") as stream:
                start = stream.read(SNIFFED)
    except (OSError, ValueError) as error:
        reason = reason_of(error)
        unreadable = message("cloud_file_unreadable", "cannot be read: {reason}", reason=reason)
        raise InputError(Problem(path.name or str(path), unreadable)) from error
    if not is_regular:
        irregular = message("cloud_file_irregular", "is a folder or a device; expected a file")
        raise InputError(Problem(path.name or str(path), irregular))
    file = CloudFile(path, status.st_size, start)
    if not start:
        raise file.refusal(message("cloud_file_empty", "empty; expected points of a scanner"))
    return file


def find_format(file):
    """Return "las" (LAS and LAZ), "e57", "ply" or "text"; raise InputError for other files."""
    for signature, kind in ((b"LASF", "las"), (b"ASTM-E57", "e57"), (b"ply", "ply")):
        if file.start.startswith(signature):
            return kind
    start = file.start
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        wide = message(
            "cloud_file_utf16", "text of two bytes a letter (UTF-16); expected UTF-8 or ASCII"
        )
        raise file.refusal(wide)
    is_text = b"\0" not in start and not start.startswith((b"# .PCD", b"solid"))
    if not is_text or file.ending not in TEXT_ENDINGS:
        other = message(
            "cloud_file_other",
            "its first bytes are of no format that is read; expected a file of one of {endings}",
            endings=list(ENDINGS),
        )
        raise file.refusal(other)
    return "text"


def require_library(file, module):
    """Raise InputError if a library of the extra `tankcal[clouds]` is missing."""
    if importlib.util.find_spec(module) is None:
        missing = message(
            "cloud_file_no_library",
            "the library {library} that reads it is not installed; expected: {command}",
            library=module,
            command=install_command("clouds"),
        )
        raise file.refusal(missing)


def count_mismatch(file, declared, found):
    """Create the InputError for a file whose number of points differs from the declared number."""
    return file.refusal(
        message(
            "cloud_file_count",
            "declares {declared} points and holds {found}; expected the same number: is the file "
            "cut or damaged?",
            declared=declared,
            found=found,
        )
    )


def describe_cut(file, what, needed, there):
    """Create the message for a part of the file that ends beyond the end of the file."""
    return message(
        "cloud_file_short",
        "{what} ends at byte {needed} of a file of {there} bytes: is it cut or damaged?",
        what=what,
        needed=needed,
        there=there,
    )


def no_points(file):
    """Create the InputError for a file without points."""
    return file.refusal(message("cloud_file_no_points", "holds no points"))
