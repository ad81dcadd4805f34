"""Point clouds of a job: files, scans, and the data of their registration."""

from dataclasses import dataclass, field

import numpy as np

from tankcal.clouds.contents import CloudHeader
from tankcal.survey.scans import KnownTargets


@dataclass(frozen=True)
class CloudFile:
    """One file of a scanner.

    Attributes
    ----------
    name : str
        Name of its section in clouds.toml.
    file : str
        File name as given in clouds.toml.
    header : CloudHeader
    unit_m : float
        Length of one unit of its coordinates, m.
    first : int
        Index of its first scan among the scans of the job.
    leave_out_m : ndarray, shape (k, 6)
        Boxes x0, y0, z0, x1, y1, z1 without points of the tank, in the frame of the tank.
    time_s : float or None
        Time of the scans, s since 2000.
    """

    name: str
    file: str
    header: CloudHeader
    unit_m: float
    first: int
    leave_out_m: np.ndarray
    time_s: float | None = None


@dataclass(frozen=True)
class Clouds:
    """All clouds of a job.

    Attributes
    ----------
    files : tuple of CloudFile
    scans : tuple of ScanSetup
        Scans of all files, in the order of the files.
    tools : dict
        {scanner: (RangingInstrument, is its offset assumed, is its scale assumed)}.
    sides : tuple of str
        "inside" or "outside": position of the scanner in each scan.
    targets : tuple of ScanTarget
    control : KnownTargets
        Control points of control.csv, if no survey is adjusted.
    """

    files: tuple
    scans: tuple
    tools: dict
    sides: tuple
    targets: tuple = ()
    control: KnownTargets = field(default_factory=KnownTargets)

    @property
    def ranging(self):
        """{scanner: RangingInstrument}."""
        return {name: tool[0] for name, tool in self.tools.items()}

    @property
    def declared(self):
        """Number of points declared by the files; files without a declaration count 0."""
        return sum(scan.declared or 0 for file in self.files for scan in file.header.scans)
