"""What a file of scans says that it holds, and a piece of its points."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class ScanHeader:
    """One scan of a file, before its points are read.

    Attributes
    ----------
    name : str
        Of the scan in its file; "": it has none.
    declared : int or None
        Points that the file says it holds; None: its format does not say.
    pose : ndarray, shape (4, 4), or None
        From the scan's own frame to the frame of the file, lengths in the unit of the file;
        None: the file has none, so that its coordinates are those of one frame.
    warning : Message or None
        Of a pose in the file that is not used.
    is_placed : bool
        Whether the file gives a position without a rotation: then the coordinates of several
        scans are in no common frame.
    """

    name: str
    declared: int | None
    pose: np.ndarray | None = None
    warning: str | None = None
    is_placed: bool = False


@dataclass(frozen=True)
class CloudHeader:
    """A file of scans whose header was found sound.

    Attributes
    ----------
    path : Path
    format : str
        "las", "laz", "e57", "ply", "ptx", "pts" or "xyz".
    bytes : int
        Of the file.
    scans : tuple of ScanHeader
        In the order of the file.
    """

    path: Path
    format: str
    bytes: int
    scans: tuple[ScanHeader, ...]


@dataclass(frozen=True)
class CloudPiece:
    """A part of a file that is read on its own, so that a file can be shared out.

    Attributes
    ----------
    scan : int or None
        The only scan that is read; None: all.
    first : int
        Records passed over; of text, bytes.
    count : int or None
        Records that are read; of text, bytes; None: to the end.
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
        Place of the scan among those of its file.
    xyz_m : ndarray of float64, shape (n, 3)
        In the scan's own frame, m: no pose is applied. Columns are contiguous, so what works
        column by column is fast.
    """

    scan: int
    xyz_m: np.ndarray
