"""Data model of a planned survey.

Positions of all items and precision of all readings, SI units.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.geometry.field.amplitudes import Amplitudes, assumed_amplitudes
from tankcal.job.model import Job
from tankcal.job.tables import RawJob

TAPED = ("distances", "height_differences", "plumb_lines")  # tables of ties


@dataclass(frozen=True)
class Targets:
    """Targets on the wall, row by row from the bottom up.

    Attributes
    ----------
    names, section, generatrix : tuple of str
        One each for n targets.
    course : ndarray of int, shape (n,)
        Index of the course.
    height_m : ndarray, shape (n,)
        Height above the bottom of the shell.
    arc_m : ndarray, shape (n,)
        Arc along the lowest course from the reference weld, clockwise seen from above.
    xyz_m : ndarray, shape (n, 3)
        Centres of the targets in the frame of the survey.
    outwards : ndarray, shape (n, 3)
        Unit normals of the wall, towards the observer.
    offset_m : float
        Distance from the wall to the centres, towards the observer.
    clearance_m : float
        Smallest distance of a target from a weld.
    welds_rad : tuple of float
        Azimuths of the vertical welds.
    """

    names: tuple
    section: tuple
    generatrix: tuple
    course: np.ndarray
    height_m: np.ndarray
    arc_m: np.ndarray
    xyz_m: np.ndarray
    outwards: np.ndarray
    offset_m: float
    clearance_m: float
    welds_rad: tuple = ()

    def select(self, keep):
        """Return the targets selected by a mask (n,)."""
        keep, selected = np.flatnonzero(keep), {}
        for name in _OF_EACH:
            values = getattr(self, name)
            is_array = isinstance(values, np.ndarray)
            selected[name] = values[keep] if is_array else tuple(values[i] for i in keep)
        return replace(self, **selected)

    def append(self, others):
        """Return these targets followed by other targets."""
        both = {}
        for name in _OF_EACH:
            first, second = getattr(self, name), getattr(others, name)
            is_array = isinstance(first, np.ndarray)
            both[name] = np.concatenate([first, second]) if is_array else first + second
        return replace(self, **both)


_OF_EACH = ("names", "section", "generatrix", "course", "height_m", "arc_m", "xyz_m", "outwards")


@dataclass(frozen=True)
class Photograph:
    """One exposure.

    Attributes
    ----------
    name : str
    station : str
        Name of the position of the camera.
    camera : str
    xyz_m : ndarray, shape (3,)
        Projection centre.
    rotation : ndarray, shape (3, 3)
    sd_mm : float
        Standard deviation of one reading of an image coordinate.
    readings : int
        Number of readings of each image point.
    place : tuple
        (file, row, column) of its definition, for messages.
    """

    name: str
    station: str
    camera: str
    xyz_m: np.ndarray
    rotation: np.ndarray
    sd_mm: float
    readings: int = 1
    place: tuple = ("plan.toml", None, None)


@dataclass(frozen=True)
class PlannedSetup:
    """One set-up of a total station; each reading is repeated in `sets` sets.

    xyz_m (3,) is the centre of the instrument. direction_sd_rad, zenith_sd_rad and distance_sd_m
    are standard deviations of one reading, None if not measured. sights lists the other set-ups
    that are sighted, centre to centre.
    """

    name: str
    instrument: str
    xyz_m: np.ndarray
    direction_sd_rad: float | None
    zenith_sd_rad: float | None
    distance_sd_m: float | None
    sets: int = 1
    sights: tuple = ()
    place: tuple = ("plan.toml", None, None)


@dataclass(frozen=True)
class Tie:
    """One taped distance, levelled height difference or plumb line between two points.

    table is one of TAPED; kind is "spatial" or "horizontal" for a distance; readings is the number
    of repeated readings.
    """

    name: str
    table: str
    start: str
    end: str
    sd_m: float
    kind: str = "spatial"
    instrument: str | None = None
    readings: int = 1


@dataclass(frozen=True)
class Base:
    """A base between two points: a stadia over one station, read from a set-up at the other.

    Attributes
    ----------
    setup, to : str
        Names of the points.
    bar : str
        Stadia, as in instruments.toml.
    angle_sd_rad : float
        Standard deviation of one angle between the ends of the bar.
    readings : int
    row : int or None
        Row of stadia.csv, for messages; None if not listed there.
    """

    setup: str
    to: str
    bar: str
    angle_sd_rad: float
    readings: int = 1
    row: int | None = None

    @property
    def name(self):
        """Name of the base, "SETUP-TO"."""
        return f"{self.setup}-{self.to}"


@dataclass(frozen=True)
class ControlPoint:
    """Control point: nominal coordinates (3,) and sds (3,); sd nan: unknown, 0: held exactly."""

    name: str
    xyz_m: np.ndarray
    sd_m: np.ndarray


@dataclass(frozen=True)
class Box:
    """Obstacle with sides parallel to the axes of the survey's frame.

    Attributes
    ----------
    low_m, high_m : ndarray, shape (3,)
        Two opposite corners, m.
    name : str
    """

    low_m: np.ndarray
    high_m: np.ndarray
    name: str = "box"


@dataclass(frozen=True)
class Pillar:
    """Obstacle: a vertical cylinder with axis (2,), radius, lowest and highest z, m."""

    axis_m: np.ndarray
    radius_m: float
    low_m: float
    high_m: float
    name: str = "cylinder"


@dataclass(frozen=True)
class Shell:
    """Nominal shell as seen from the side of the survey, m.

    axis_m (2,) is the axis, radius_m the radius of the lowest course, low_m and high_m are z of
    bottom and top. is_outside is True if the observer stands outside.
    """

    axis_m: np.ndarray
    radius_m: float
    low_m: float
    high_m: float
    is_outside: bool


@dataclass(frozen=True)
class Limits:
    """Requirements on the plan.

    Attributes
    ----------
    incidence_rad : float
        Largest angle between the line of sight and the normal of the wall.
    relative_u : float or None
        Largest U over volume.
    quantity : str
        "top": limit for the full tank; "delivery": for the worst delivery of the smallest minimum.
    rays : int
        Fewest rays of a point that is not weak.
    place : tuple
        (file, row, column) of `limits.of` in the plan, for messages.
    """

    incidence_rad: float
    relative_u: float | None = None
    quantity: str = "top"
    rays: int = 3
    place: tuple = ("plan.toml", None, None)


@dataclass(frozen=True)
class Plan:
    """A planned survey.

    Attributes
    ----------
    job : Job
        Tank, courses, table and inputs; its measurements hold cameras, instruments and settings.
    photos, setups, ties, known, obstacles : tuple
        Items of the classes above.
    extra : dict
        {name: (3,) nominal position} of points off the wall.
    facing : dict
        {name: (3,) unit normal} of extra points visible from one side only, such as tape ends.
    bases : tuple of Base
    bars : dict
        {name: length, m} of the stadias in the instruments.
    amplitudes : Amplitudes
        Expected deviations of the wall from a cylinder.
    costs : dict
        {item: unit cost}: "photo_station", "photograph", "setup", "tape", "base",
        "control_point", "target", "reading".
    folder : str
        Name of the folder.
    raw : RawJob or None
        Content of the folder as read (`job.tables.RawJob`).
    """

    job: Job
    shell: Shell
    targets: Targets
    photos: tuple[Photograph, ...]
    setups: tuple[PlannedSetup, ...]
    ties: tuple[Tie, ...]
    known: tuple[ControlPoint, ...]
    extra: dict
    facing: dict
    obstacles: tuple
    limits: Limits
    bases: tuple[Base, ...] = ()
    bars: dict = field(default_factory=dict)
    amplitudes: Amplitudes = field(default_factory=assumed_amplitudes)
    costs: dict = field(default_factory=dict)
    folder: str = ""
    raw: RawJob | None = None
    warnings: tuple = ()

    @property
    def stations(self):
        """Names of the photo stations, in order."""
        return tuple(dict.fromkeys(photo.station for photo in self.photos))

    @property
    def points(self):
        """Nominal positions {name: (3,)} of all points that can be measured, set-ups included."""
        positions = dict(zip(self.targets.names, self.targets.xyz_m, strict=True))
        positions |= self.extra
        return positions | {setup.name: setup.xyz_m for setup in self.setups}
