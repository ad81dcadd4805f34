"""Point clouds of a job: their files, their scans, and what ties these."""

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
        Of its section in clouds.toml.
    file : str
        As it is written there.
    header : CloudHeader
    unit_m : float
        Metres of one unit of its coordinates.
    first : int
        Place of its first scan among those of the job.
    leave_out_m : ndarray, shape (k, 6)
        Boxes x0, y0, z0, x1, y1, z1 in the frame of the tank.
    time_s : float or None
        Since 2000.
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
        Of all files, in their order.
    tools : dict
        {scanner: (RangingInstrument, whether its offset is assumed, whether its scale is)}.
    sides : tuple of str
        "inside" or "outside": where the scanner stood, of each scan.
    targets : tuple of ScanTarget
    control : KnownTargets
        Of control.csv, where no survey is adjusted.
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
        return {name: given[0] for name, given in self.tools.items()}

    @property
    def declared(self):
        """Points that the files say they hold; of those that do not say, none."""
        return sum(one.declared or 0 for file in self.files for one in file.header.scans)
