"""Data model of planned surveys: of targets (`Plan`), and of a bare wall (`WallPlan`).

Positions of all items and precision of all readings, SI units.
"""

from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from tankcal.geometry.field.amplitudes import Amplitudes, assumed_amplitudes
from tankcal.job.model import Job
from tankcal.job.tables import RawJob, Value

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


SECTIONS_OF_TRAVERSE = {  # sections of tables if limbs are sighted from traverse stations
    "setups.csv": "tangents",
    "control.csv": "tangents",
    "directions.csv": "traverse",
    "zenith_angles.csv": "traverse",
    "slope_distances.csv": "traverse",
    "stadia.csv": "traverse",
}
USUAL_AT = (20.0, 80.0)  # default heights of readings, percent of the height of a course
SECONDS_PER_HIT = 10.0  # default time to aim, range and store


class Part:
    """A planned part of a `Design`: a strap, lines, a ring of set-ups, a traverse or a run.

    Attributes
    ----------
    survey : str
        Kind of survey that begins with this part, as in `tankcal new`.
    section : str
        Section of plan.toml.
    datum : str or None
        Default datum of the network of its set-ups.
    is_wall : bool
        Whether the part determines all courses of a wall without straps.
    faces : int
        Faces of the instrument in which each level is read; 0: does not apply.
    sections : dict
        {table that the part generates: section of plan.toml}, where they differ from other parts.
    """

    survey = ""
    section = ""
    datum = None
    is_wall = True
    faces = 0
    sections = MappingProxyType({})


@dataclass(frozen=True)
class PlannedStrap(Part):
    """A strapped circumference of a course.

    at_percent is its height in percent of the height of the course; more holds {column: value} of
    circumferences.csv.
    """

    course: str
    at_percent: float
    sd_mm: float
    readings: int = 1
    more: tuple = ()

    survey: ClassVar = "strapping"
    section: ClassVar = "straps"
    is_wall: ClassVar = False

    @property
    def name(self):
        """Name, "COURSE-PERCENT"."""
        return f"{self.course}-{self.at_percent:g}"


@dataclass(frozen=True)
class PlannedLines(Part):
    """Reference lines, evenly round the tank, read at given percentages of course heights."""

    count: int
    at_percent: tuple
    sd_mm: float
    faces: int = 2
    readings: int = 1
    instrument: str | None = None
    side: str = "outside"
    first_deg: float = 0.0

    survey: ClassVar = "reference-line"
    section: ClassVar = "lines"
    is_wall: ClassVar = False


@dataclass(frozen=True)
class PlannedHits(Part):
    """A ring of set-ups, each of which hits the bare wall at some heights of some courses.

    spread_deg is the range of azimuths about the axis seen from a set-up; None: the whole visible
    range. height_m is the height of the instrument above the bottom of the shell.
    """

    setups: int
    radius_m: float
    hits: int
    at_percent: tuple
    courses: tuple
    start_deg: float = 0.0
    height_m: float = 1.6
    spread_deg: float | None = None
    instrument: str | None = None

    survey: ClassVar = "wall-hits"
    section: ClassVar = "hits"


@dataclass(frozen=True)
class PlannedControl:
    """Control targets read at the start, at intervals, and at the end of each set-up of hits.

    every_min is the longest interval between readings, minutes; minutes is the duration of the hits
    of a set-up, None: SECONDS_PER_HIT each.
    """

    targets: int = 2
    every_min: float = 20.0
    minutes: float | None = None

    def times_min(self, ring):
        """Times (rounds,) of the readings in a set-up, minutes after its first hit."""
        hits = ring.hits * len(ring.at_percent) * len(ring.courses)
        minutes = self.minutes or np.ceil(hits * SECONDS_PER_HIT / 60)
        return np.linspace(0.0, minutes, int(np.ceil(minutes / self.every_min)) + 1)


@dataclass(frozen=True)
class PlannedTangents(Part):
    """A traverse round the tank with sights to both limbs at given heights of each course.

    Attributes
    ----------
    radius_m : float
        Radius of the ring of stations about the axis.
    height_m : float
        Height of the instrument above the bottom.
    sd_arcsec : float
        Standard deviation of a sight to a limb.
    readings : int
        Number of sights to each limb.
    traverse : tuple
        (s_mm of a distance, s_arcsec of an angle) between neighbouring stations; s_mm None: no
        distances.
    bar : tuple or None
        (name, s_arcsec of an angle to its ends) of a stadia over each neighbouring station.
    """

    stations: int
    radius_m: float
    at_percent: tuple
    sd_arcsec: float
    traverse: tuple
    bar: tuple | None = None
    start_deg: float = 0.0
    height_m: float = 1.6
    readings: int = 1
    instrument: str | None = None

    survey: ClassVar = "tangents"
    section: ClassVar = "tangents"
    datum: ClassVar = "minimal"
    sections: ClassVar = MappingProxyType(SECTIONS_OF_TRAVERSE)


@dataclass(frozen=True)
class PlannedRun(Part):
    """A run of metered liquid from dip to dip.

    Attributes
    ----------
    dips_m : tuple of float
        Successive dips; falling dips mean withdrawal.
    from_empty : bool
        Whether the run begins with the empty, dry tank, before the first dip.
    sd_m : float or None
        Standard deviation of a dip; None: from [liquid] of the job.
    celsius : float or None
        Temperature of liquid and shell; None: not read.
    """

    dips_m: tuple
    from_empty: bool = False
    meter: str | None = None
    sd_m: float | None = None
    celsius: float | None = None

    survey: ClassVar = "liquid"
    section: ClassVar = "runs"

    @property
    def batches(self):
        """Number of metered volumes."""
        return len(self.dips_m) - (0 if self.from_empty else 1)


def evenness_of_limbs(stations, radius_m, nominal_m):
    """Evenness of the limbs of a ring of stations round the wall.

    The limbs of a station lie acos(nominal / radius) to both sides of it. The result is 0.5 if left
    limbs lie half-way between right limbs, and 0 if they coincide.

    Examples
    --------
    >>> round(evenness_of_limbs(8, 10.98, 6.1), 2), round(evenness_of_limbs(9, 12.5, 6.1), 2)
    (0.5, 0.04)
    """
    apart = 2 * np.arccos(nominal_m / radius_m) * stations / (2 * np.pi)
    return abs(float(apart - np.round(apart)))


def even_radius_m(stations, radius_m, nominal_m, least_m):
    """Radius of a ring with evenly distributed limbs nearest to radius_m; None if there is none.

    least_m: smallest permitted radius.
    """
    half = (np.arange(stations // 2 + 1) + 0.5) * np.pi / stations
    radii = nominal_m / np.cos(half[half < np.pi / 2 - 1e-9])
    radii = radii[radii >= least_m]
    if not len(radii):
        return None
    return float(radii[np.argmin(np.abs(np.log(radii / radius_m)))])


@dataclass(frozen=True)
class Design:
    """Planned measurements of a bare wall.

    ties is (number of targets shared by neighbouring set-ups, s_mm, s_arcsec), or None if only the
    wall connects the set-ups. control are targets that show movements of a set-up; runs are runs of
    metered liquid.
    """

    straps: tuple[PlannedStrap, ...] = ()
    lines: PlannedLines | None = None
    hits: tuple[PlannedHits, ...] = ()
    ties: tuple | None = None
    tangents: PlannedTangents | None = None
    control: PlannedControl = PlannedControl()
    runs: tuple[PlannedRun, ...] = ()

    @property
    def parts(self):
        """All parts; the first determines the kind of the survey."""
        rings = (part for part in (self.tangents, self.lines) if part is not None)
        return (*self.hits, *rings, *self.straps, *self.runs)

    @property
    def datum(self):
        """Default of `adjustment.datum` for the network of the set-ups; None without a network."""
        return self.parts[0].datum or (None if self.ties is None else "inner")

    @property
    def is_metered_alone(self):
        """Whether the tank is measured by liquid only."""
        others = (self.straps, self.hits, self.lines, self.tangents)
        return bool(self.runs) and not any(others)

    @property
    def is_smoothed(self):
        """Whether the readings show the wall smoother than it is: `finding.is_smoothed`."""
        untied = self.ties is None and sum(ring.setups for ring in self.hits) > 1
        return self.tangents is not None or untied


@dataclass(frozen=True)
class WallPlan:
    """A planned survey of a bare wall.

    Attributes
    ----------
    job : Job
        Job with the readings of a tank of nominal size.
    design : Design
    limits : Limits
    amplitudes : Amplitudes
        Expected deviations of the wall from a cylinder.
    costs : dict
        {item: unit cost}: "strap", "line", "setup", "base", "reading", "run", "batch".
    dips_m : tuple of float
        Dips listed with their volumes and differences; (): those of the runs and the full tank.
    expected_run : float or None
        Relative standard deviation of the run effect that the runs are to estimate.
    volume_at : callable or None
        Function of a dip, m, that returns the approximate volume, m3, of a tank to be filled.
    obstacles : tuple of Box or Pillar
        Obstacles to lines of sight.
    folder : str
    raw : RawJob
        Content of the folder as read.
    warnings : tuple of Problem
    """

    job: Job
    design: Design
    limits: Limits
    amplitudes: Amplitudes = field(default_factory=assumed_amplitudes)
    costs: dict = field(default_factory=dict)
    dips_m: tuple = ()
    expected_run: float | None = None
    volume_at: object = None
    obstacles: tuple = ()
    folder: str = ""
    raw: RawJob | None = None
    warnings: tuple = ()

    def with_instrument(self, name, values, of="instruments"):
        """Return `raw` with new values {key: value} of an instrument or meter."""
        register = self.raw.registers[of]
        entry = register.entries[name] | {key: Value(value) for key, value in values.items()}
        register = replace(register, entries=register.entries | {name: entry})
        return replace(self.raw, registers=self.raw.registers | {of: register})
