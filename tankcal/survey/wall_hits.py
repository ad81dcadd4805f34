"""Wall hits of a total station as read, without targets or names.

Angles are in radians, lengths in metres; values are neither corrected nor omitted.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.messages import message

MOST_HITS = 25_000  # largest number that was verified, see docs/studies/sizes.md
FEWEST_HITS = 5  # smallest number of hits of a section of the wall


def too_many_hits(count):
    """Message about more hits than can be used."""
    return message(
        "too_many_hits",
        "{count} hits; expected at most {most}, the largest number that was verified: take every"
        " second one or hand them in as points.csv",
        count=count,
        most=MOST_HITS,
    )


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
        Relative standard uncertainty of the scale.
    u_offset_m : float
        Standard uncertainty of the offset, m; nan: unknown, to be estimated from the wall.
    u_incidence_m : float
        Standard uncertainty of the bias at 60 degrees of incidence, m.
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
    """A reading of a control target from a set-up; nan: not read.

    Attributes
    ----------
    setup, target : str
    direction_rad, zenith_rad, distance_m : float
    time_s : float
        Time since a common origin, s.
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
    """n hits of a wall, in the order of their file, with their instruments.

    Attributes
    ----------
    setup : tuple of str, length n
    set : tuple of str or None, length n
        Set of directions within the set-up, with its own circle zero.
    course : tuple of str or None, length n
        Course recorded in the field.
    direction_rad, zenith_rad, distance_m : ndarray, shape (n,)
        As read.
    sd_m, sd_rad : ndarray, shape (n,)
        Standard deviations of the distance, and of each angle.
    surface : tuple of str, length n
        "paint", "rust", "tape" or "".
    check : ndarray of bool, shape (n,)
        True: compared only.
    setups : dict
        {name: measurements.Setup}, each with its instrument.
    instruments : dict
        {name: RangingInstrument}.
    stations : dict
        {station: (3,) coordinates from control.csv, m; nan: unknown}.
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
        """Names (n,) of the instruments of the hits."""
        return tuple(self.setups[name].instrument for name in self.setup)
