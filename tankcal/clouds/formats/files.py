"""The file of a cloud: opened with care, its format by signature first, then by ending."""

import importlib.util
import stat
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal.clouds.contents import CloudPiece
from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message
from tankcal.version import install_command

TEXT_ENDINGS = (".ptx", ".pts", ".xyz", ".asc", ".txt", ".csv")
ENDINGS = (".las", ".laz", ".e57", ".ply", *TEXT_ENDINGS)
SNIFFED = 1 << 16  # bytes from the start of a file that tell its format
EXTENT_LIMIT = 1e7  # units of the file: more is damage, or no cloud of a tank


@dataclass(frozen=True)
class CloudFile:
    """A regular file with something in it.

    Attributes
    ----------
    path : Path
    bytes : int
        Its size.
    start : bytes
        At most the first `SNIFFED` of it.
    """

    path: Path
    bytes: int
    start: bytes

    @property
    def name(self):
        """As messages name it."""
        return self.path.name

    @property
    def ending(self):
        """In small letters, with its point."""
        return self.path.suffix.lower()

    def refusal(self, *texts, row=None):
        """The InputError of what is wrong with the file."""
        return InputError([Problem(self.name, text, row) for text in texts])


@dataclass(frozen=True)
class Piece:
    """Some records of one scan as their format gives them.

    Attributes
    ----------
    scan : int
    xyz : ndarray, shape (n, 3)
        In the unit of the file, each column contiguous; float32 where the file has no more.
    read : int
        Records read for it, n and those without a return.
    """

    scan: int
    xyz: np.ndarray
    read: int


def ranges_of(count, each):
    """`CloudPiece`s of so many records each, the last of what is left."""
    return tuple(
        CloudPiece(None, first, min(each, count - first)) for first in range(0, count, each)
    )


def open_cloud(path):
    """The `CloudFile` at a path; InputError where there is none that can be read."""
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
    """ "las" (of "laz", too), "e57", "ply", or "text"; InputError for a file of another kind."""
    for signature, found in ((b"LASF", "las"), (b"ASTM-E57", "e57"), (b"ply", "ply")):
        if file.start.startswith(signature):
            return found
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
    """InputError where a library of the extra `tankcal[clouds]` is missing."""
    if importlib.util.find_spec(module) is None:
        missing = message(
            "cloud_file_no_library",
            "the library {library} that reads it is not installed; expected: {command}",
            library=module,
            command=install_command("clouds"),
        )
        raise file.refusal(missing)


def count_mismatch(file, declared, found):
    """The refusal of a file that holds fewer or more points than it says."""
    return file.refusal(
        message(
            "cloud_file_count",
            "declares {declared} points and holds {found}; expected the same number: is the file "
            "cut or damaged?",
            declared=declared,
            found=found,
        )
    )


def cut_short(file, what, needed, there):
    """The text of a part that a file of this size cannot hold."""
    return message(
        "cloud_file_short",
        "{what} ends at byte {needed} of a file of {there} bytes: is it cut or damaged?",
        what=what,
        needed=needed,
        there=there,
    )


def no_points(file):
    """The refusal of a file without any point."""
    return file.refusal(message("cloud_file_no_points", "holds no points"))
