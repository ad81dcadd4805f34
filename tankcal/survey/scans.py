"""Scans of a wall as they were declared: where they stood, by which scanner, and their targets.

Angles are radians, lengths metres; nothing has been corrected or left out.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.survey.wall_hits import RangingInstrument


@dataclass(frozen=True)
class ScanSetup:
    """One scan: its scanner, and what was declared of its pose.

    Attributes
    ----------
    name : str
        Of the scan, once in the job.
    scanner : str
    surface : str
        That it saw, "" for all the same: each has a bias by incidence of its own.
    pose : ndarray, shape (4, 4), or None
        From the scan's frame to that of the tank, m; None: not given.
    beam_from_m : ndarray, shape (3,)
        Where the scanner stood, in the scan's own frame.
    s_translation_m, s_rotation_rad : float
        Of the pose along and about each axis of the tank's frame; nan: not declared.
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
        """Are both standard deviations of its pose there?"""
        return not (np.isnan(self.s_translation_m) or np.isnan(self.s_rotation_rad))


@dataclass(frozen=True)
class ScanTarget:
    """A target as a scan shows it: its place in the scan's own frame, the sd of each axis."""

    scan: str
    target: str
    xyz_m: np.ndarray
    sd_m: float
    row: int | None = None


@dataclass(frozen=True)
class KnownTargets:
    """Targets whose places are known otherwise, by total station, say.

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
    """Scanners by name, and which of them have an assumed offset or scale."""

    tools: dict[str, RangingInstrument]
    assumed: tuple = ()
