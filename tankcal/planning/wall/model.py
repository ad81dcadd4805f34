"""A wall to be strapped, read from reference lines, hit, sighted by its limbs or filled by meter:
how, and the job that it will be.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.geometry.field.amplitudes import Amplitudes, assumed_amplitudes
from tankcal.job.model import Job
from tankcal.job.tables import RawJob, Value
from tankcal.planning.model import Limits

USUAL_AT = (20.0, 80.0)  # percent of a course's height: where its rows are read
SECONDS_PER_HIT = 10.0  # aim, range and store


@dataclass(frozen=True)
class PlannedStrap:
    """A circumference of a course, read some times.

    at_percent  of the course's height      more  {column of circumferences.csv: value}
    """

    course: str
    at_percent: float
    sd_mm: float
    readings: int = 1
    more: tuple = ()

    @property
    def name(self):
        """COURSE-PERCENT."""
        return f"{self.course}-{self.at_percent:g}"


@dataclass(frozen=True)
class PlannedLines:
    """Reference lines, evenly round the tank; each course is read at the same parts of it."""

    count: int
    at_percent: tuple
    sd_mm: float
    faces: int = 2
    readings: int = 1
    instrument: str | None = None
    side: str = "outside"
    first_deg: float = 0.0


@dataclass(frozen=True)
class PlannedHits:
    """A ring of set-ups, each of which hits the bare wall at some heights of some courses.

    spread_deg  of the wall that each sees, as azimuths about the axis; None: all that it can
    height_m    of the instrument above the bottom of the shell
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


@dataclass(frozen=True)
class PlannedControl:
    """Targets that each set-up of hits reads at its start, again and again, and at its end.

    every_min  minutes between two readings of a target, at most
    minutes    that the hits of a set-up take; None: SECONDS_PER_HIT each
    """

    targets: int = 2
    every_min: float = 20.0
    minutes: float | None = None

    def times_min(self, ring):
        """(rounds,) minutes after the first hit when a set-up of a `PlannedHits` reads them."""
        hits = ring.hits * len(ring.at_percent) * len(ring.courses)
        minutes = self.minutes or np.ceil(hits * SECONDS_PER_HIT / 60)
        return np.linspace(0.0, minutes, int(np.ceil(minutes / self.every_min)) + 1)


@dataclass(frozen=True)
class PlannedTangents:
    """A traverse round the tank, from whose stations both limbs are sighted at the same parts of
    each course.

    radius_m   of its ring about the axis      height_m  of the instrument above the bottom
    sd_arcsec  of a sight to a limb            readings  how often each limb is sighted
    traverse   (s_mm of a distance, s_arcsec of an angle) between neighbouring stations; s_mm None:
               no distances
    bar        (its name, s_arcsec of an angle to its ends) of a stadia over either one; None: none
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


@dataclass(frozen=True)
class PlannedRun:
    """A run of metered liquid, from dip to dip.

    dips_m      one after the other; falling ones: liquid is drawn off
    from_empty  whether it begins in the empty, dry tank, before the first dip
    sd_m        of a dip; None: that of the job's [liquid]
    celsius     of liquid and shell; None: temperatures are not read
    """

    dips_m: tuple
    from_empty: bool = False
    meter: str | None = None
    sd_m: float | None = None
    celsius: float | None = None

    @property
    def batches(self):
        """How many volumes are read."""
        return len(self.dips_m) - (0 if self.from_empty else 1)


def evenness_of_limbs(stations, radius_m, nominal_m):
    """How evenly the places that sights of a ring touch lie round the wall.

    The limbs of a station lie acos(nominal / radius) to both sides of it: 0.5, those of one side
    are half-way between those of the other; 0, they fall on the same places.

    Examples
    --------
    >>> round(evenness_of_limbs(8, 10.98, 6.1), 2), round(evenness_of_limbs(9, 12.5, 6.1), 2)
    (0.5, 0.04)
    """
    apart = 2 * np.arccos(nominal_m / radius_m) * stations / (2 * np.pi)
    return abs(float(apart - np.round(apart)))


def even_radius_m(stations, radius_m, nominal_m, least_m):
    """Radius of a ring whose limbs lie evenly, as near to another as can be; None: there is none.

    least_m  that it must have
    """
    half = (np.arange(stations // 2 + 1) + 0.5) * np.pi / stations
    found = nominal_m / np.cos(half[half < np.pi / 2 - 1e-9])
    found = found[found >= least_m]
    if not len(found):
        return None
    return float(found[np.argmin(np.abs(np.log(found / radius_m)))])


@dataclass(frozen=True)
class Design:
    """What will be measured.

    ties     (targets that neighbouring set-ups share, s_mm, s_arcsec); None: the wall alone ties
    control  targets that show whether a set-up moved
    runs     of metered liquid
    """

    straps: tuple[PlannedStrap, ...] = ()
    lines: PlannedLines | None = None
    hits: tuple[PlannedHits, ...] = ()
    ties: tuple | None = None
    tangents: PlannedTangents | None = None
    control: PlannedControl = PlannedControl()
    runs: tuple[PlannedRun, ...] = ()

    @property
    def is_metered_alone(self):
        """Whether liquid is all that measures the tank."""
        others = (self.straps, self.hits, self.lines, self.tangents)
        return bool(self.runs) and not any(others)

    @property
    def is_smoothed(self):
        """Whether its readings show the wall smoother than it is: `pipeline.wall.is_smoothed`."""
        untied = self.ties is None and sum(ring.setups for ring in self.hits) > 1
        return self.tangents is not None or untied


@dataclass(frozen=True)
class WallPlan:
    """A survey of a wall by tape, reference lines, bare hits or tangents, before it is made.

    Attributes
    ----------
    job : Job
        With the readings that a tank of the nominal sizes would give.
    design : Design
    limits : Limits
    amplitudes : Amplitudes
        How far the wall departs from a cylinder, as it is expected.
    costs : dict
        {item: cost of one}: "strap", "line", "setup", "base", "reading", "run", "batch".
    dips_m : tuple of float
        Whose volumes and differences are listed; (): those of the runs, and of the full tank.
    expected_run : float or None
        Relative standard deviation of the run effect that runs are to show.
    holds : callable or None
        Function of a dip, m, that gives m3, roughly: of a tank that will be filled.
    obstacles : tuple of Box or Pillar
        That cut lines of sight.
    folder : str
    given : RawJob
        What stands in the folder, as it was read.
    warnings : tuple of Problem
    """

    job: Job
    design: Design
    limits: Limits
    amplitudes: Amplitudes = field(default_factory=assumed_amplitudes)
    costs: dict = field(default_factory=dict)
    dips_m: tuple = ()
    expected_run: float | None = None
    holds: object = None
    obstacles: tuple = ()
    folder: str = ""
    given: RawJob | None = None
    warnings: tuple = ()

    def with_instrument(self, name, values, of="instruments"):
        """`given` with other values of an instrument, or of a meter: {key: value}."""
        register = self.given.registers[of]
        entry = register.entries[name] | {key: Value(one) for key, one in values.items()}
        register = replace(register, entries=register.entries | {name: entry})
        return replace(self.given, registers=self.given.registers | {of: register})
