"""Declared scans of a wall: position, scanner and targets of each scan.

Angles are in radians, lengths in metres; values are neither corrected nor omitted.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.survey.wall_hits import RangingInstrument


@dataclass(frozen=True)
class ScanSetup:
    """A scan with its scanner and its declared pose.

    Attributes
    ----------
    name : str
        Unique name of the scan.
    scanner : str
    surface : str
        Surface scanned, "" if all are alike; each surface has its own incidence bias.
    pose : ndarray, shape (4, 4), or None
        From the frame of the scan to that of the tank, m; None: not given.
    beam_from_m : ndarray, shape (3,)
        Position of the scanner in the frame of the scan.
    s_translation_m, s_rotation_rad : float
        Standard deviations of the pose along and about each axis of the tank; nan: not declared.
    is_assumed : bool
        Whether one of these is an assumption of the program.
    """

    name: str
    scanner: str
    surface: str = ""
    pose: np.ndarray | None = None
    beam_from_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    s_translation_m: float = np.nan
    s_rotation_rad: float = np.nan
    is_assumed: bool = False

    @property
    def is_declared(self):
        """Whether both standard deviations of the pose are declared."""
        return not (np.isnan(self.s_translation_m) or np.isnan(self.s_rotation_rad))


@dataclass(frozen=True)
class ScanTarget:
    """A target of a scan: its position in the frame of the scan, and the sd of each axis, m."""

    scan: str
    target: str
    xyz_m: np.ndarray
    sd_m: float
    row: int | None = None


@dataclass(frozen=True)
class KnownTargets:
    """Targets with known positions, for example from a total station.

    Attributes
    ----------
    names : tuple of str
    xyz_m : ndarray, shape (k, 3)
        In the frame of the tank.
    covariance_m2 : ndarray, shape (3k, 3k)
    """

    names: tuple = ()
    xyz_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    covariance_m2: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True)
class Scanners:
    """Scanners by name, and the scanners with an assumed offset or scale."""

    tools: dict[str, RangingInstrument]
    assumed: tuple = ()
