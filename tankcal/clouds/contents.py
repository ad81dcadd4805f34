"""Header of a scanner file, pieces of the file, and chunks of its points."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np


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
