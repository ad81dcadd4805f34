"""A survey that is planned: where things will stand and how well they will be measured, in SI."""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.geometry.field.amplitudes import Amplitudes, assumed_amplitudes
from tankcal.job.model import Job
from tankcal.job.tables import RawJob

TAPED = ("distances", "height_differences", "plumb_lines")  # tables of a plan, without values


@dataclass(frozen=True)
class Targets:
    """Targets on the wall, row by row from the bottom up.

    names, section, generatrix  (n,) text
    course      (n,) index of the course
    height_m    (n,) above the bottom of the shell
    arc_m       (n,) along the lowest course from the reference weld, clockwise seen from above
    xyz_m       (n, 3) centres of the targets, in the frame of the survey
    outwards    (n, 3) unit normals of the wall, towards the observer
    offset_m    from the wall to the centres, towards the observer
    clearance_m  from any weld to a target
    welds_rad   azimuths of the upright welds
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

    def taken(self, keep):
        """The targets of a mask (n,)."""
        keep, found = np.flatnonzero(keep), {}
        for name in _OF_EACH:
            one = getattr(self, name)
            is_array = isinstance(one, np.ndarray)
            found[name] = one[keep] if is_array else tuple(one[i] for i in keep)
        return replace(self, **found)

    def followed_by(self, others):
        """These targets and others after them."""
        both = {}
        for name in _OF_EACH:
            one, other = getattr(self, name), getattr(others, name)
            is_array = isinstance(one, np.ndarray)
            both[name] = np.concatenate([one, other]) if is_array else one + other
        return replace(self, **both)


_OF_EACH = ("names", "section", "generatrix", "course", "height_m", "arc_m", "xyz_m", "outwards")


@dataclass(frozen=True)
class Photograph:
    """One exposure. station: the name of the place; readings: of each image point.

    xyz_m  (3,) projection centre      rotation  (3, 3)     sd_mm  of one reading, x and y
    place  (file, row, column) where the plan has it, for messages
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
class Instrumented:
    """One set-up of a total station, measured from its own centre; each angle `sets` times.

    xyz_m  (3,)    direction_sd_rad, zenith_sd_rad, distance_sd_m  of one; None: not measured
    sights names of other set-ups that are sighted, centre to centre
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
    """One tape, levelled height or plumb line between two points, measured `readings` times.

    table  of TAPED     kind  "spatial" or "horizontal" of a distance
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
    """A stadia over a station, read from a set-up `readings` times: the base between them.

    setup, to    names of points        bar  the stadia, as in instruments.toml
    angle_sd_rad of one angle between the ends of the bar
    row          of stadia.csv, for messages; None: not given there
    """

    setup: str
    to: str
    bar: str
    angle_sd_rad: float
    readings: int = 1
    row: int | None = None

    @property
    def name(self):
        """SETUP-TO."""
        return f"{self.setup}-{self.to}"


@dataclass(frozen=True)
class Known:
    """A control point: nominal coordinates (3,), sds (3,); nan: not known, 0: held exactly."""

    name: str
    xyz_m: np.ndarray
    sd_m: np.ndarray


@dataclass(frozen=True)
class Box:
    """An obstacle whose sides are along the axes of the survey's frame.

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
    """An upright cylinder that stands in the way: axis (2,), radius, lowest and highest z, m."""

    axis_m: np.ndarray
    radius_m: float
    low_m: float
    high_m: float
    name: str = "cylinder"


@dataclass(frozen=True)
class Shell:
    """The nominal shell: axis (2,), radius of its lowest course on the side of the survey, z of
    bottom and top, m.

    outside  True: the observer stands outside
    """

    axis_m: np.ndarray
    radius_m: float
    low_m: float
    high_m: float
    outside: bool


@dataclass(frozen=True)
class Limits:
    """What the plan has to meet.

    incidence_rad  largest angle between the line of sight and the normal of the wall
    relative_u     largest U over volume     of  "top": of the full tank; "delivery": of the worst
                   delivery of the least minimum
    rays           fewest rays of a point that is not weak
    place          (file, row, column) where the plan has `of`, for messages
    """

    incidence_rad: float
    relative_u: float | None = None
    of: str = "top"
    rays: int = 3
    place: tuple = ("plan.toml", None, None)


@dataclass(frozen=True)
class Plan:
    """A survey before it is made.

    Attributes
    ----------
    job : Job
        Tank, courses, table, inputs, and, as its measurements, cameras, instruments, settings.
    photos, setups, ties, known, extra, obstacles
        Tuples of the classes above; extra are points off the wall, {name: (3,) nominal place}.
    facing : dict
        {name: (3,) unit normal} of the marks among them that face one way, as tape ends do.
    bases : tuple of Base
    bars : dict
        {name: length, m} of the stadias of its instruments.
    amplitudes : Amplitudes
        How far the wall departs from a cylinder, as it is expected.
    costs : dict
        {item: cost of one}: "photo_station", "photograph", "setup", "tape", "base",
        "control_point", "target", "reading".
    folder : str
        Its name.
    given : RawJob or None
        What stands in the folder, as it was read (`job.tables.RawJob`).
    """

    job: Job
    shell: Shell
    targets: Targets
    photos: tuple[Photograph, ...]
    setups: tuple[Instrumented, ...]
    ties: tuple[Tie, ...]
    known: tuple[Known, ...]
    extra: dict
    facing: dict
    obstacles: tuple
    limits: Limits
    bases: tuple[Base, ...] = ()
    bars: dict = field(default_factory=dict)
    amplitudes: Amplitudes = field(default_factory=assumed_amplitudes)
    costs: dict = field(default_factory=dict)
    folder: str = ""
    given: RawJob | None = None
    warnings: tuple = ()

    @property
    def stations(self):
        """Names of the photo stations, in order."""
        return tuple(dict.fromkeys(one.station for one in self.photos))

    @property
    def points(self):
        """{name: (3,) nominal place} of everything that can be measured, set-ups among them."""
        found = dict(zip(self.targets.names, self.targets.xyz_m, strict=True))
        found |= self.extra
        return found | {one.name: one.xyz_m for one in self.setups}
