"""Bare hits of a wall by a total station, as they were read: no target, no name.

Angles are radians, lengths metres; nothing has been corrected or left out.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class RangingInstrument:
    """A total station that ranges without a reflector.

    Attributes
    ----------
    name : str
    correction : float
        True distance = (reading + correction_m) (1 + correction).
    correction_m : float
    u_scale : float
        Standard uncertainty of the scale, relative.
    u_offset_m : float
        Of the offset, m; nan: not known, something else must tell it.
    u_incidence_m : float
        Of the bias at 60 degrees of incidence, m.
    certificate : str
    """

    name: str
    correction: float = 0.0
    correction_m: float = 0.0
    u_scale: float = 0.0
    u_offset_m: float = np.nan
    u_incidence_m: float = 0.0
    certificate: str = ""


@dataclass(frozen=True)
class ControlReading:
    """A control target as a set-up read it at some time; nan: this was not read.

    Attributes
    ----------
    setup, target : str
    direction_rad, zenith_rad, distance_m : float
    time_s : float
        Since some common moment.
    row : int or None
    """

    setup: str
    target: str
    direction_rad: float
    zenith_rad: float
    distance_m: float
    time_s: float
    row: int | None = None


@dataclass(frozen=True)
class WallHits:
    """Hits of a wall, in the order of their file, and what took them; n hits.

    Attributes
    ----------
    setup : tuple of str, length n
    set : tuple of str or None, length n
        Of directions within the set-up, with a zero of its own.
    course : tuple of str or None, length n
        As the crew has it.
    direction_rad, zenith_rad, distance_m : ndarray, shape (n,)
        As read.
    sd_m, sd_rad : ndarray, shape (n,)
        Of a distance, and of either angle.
    surface : tuple of str, length n
        "paint", "rust", "tape" or "".
    check : ndarray of bool, shape (n,)
        Only compared.
    setups : dict
        {name: measurements.Setup}, each with its instrument.
    instruments : dict
        {name: RangingInstrument}.
    stations : dict
        {station: (3,) coordinates, nan: not known}, as control.csv has them.
    control : tuple of ControlReading
    rows : tuple of int
    file : str
    """

    setup: tuple
    set: tuple
    course: tuple
    direction_rad: np.ndarray
    zenith_rad: np.ndarray
    distance_m: np.ndarray
    sd_m: np.ndarray
    sd_rad: np.ndarray
    surface: tuple
    check: np.ndarray
    setups: dict
    instruments: dict
    stations: dict = field(default_factory=dict)
    control: tuple[ControlReading, ...] = ()
    rows: tuple = ()
    file: str = "wall_hits.csv"

    def __len__(self):
        return len(self.setup)

    @property
    def instrument(self):
        """(n,) name of the instrument of each hit."""
        return tuple(self.setups[name].instrument for name in self.setup)
