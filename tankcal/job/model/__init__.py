"""The checked job as frozen dataclasses, all in SI."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tankcal.job.model.liquid import Meter, Metering
from tankcal.job.model.overrulings import Overruling
from tankcal.job.model.parts import (
    Bottom,
    Course,
    Deadwood,
    End,
    Horizontal,
    Mesh,
    Ring,
    Roof,
    Ship,
    Sphere,
    Top,
)
from tankcal.job.model.radii import Change, Radii
from tankcal.job.model.settings import (
    Datum,
    DeclaredInput,
    Inspection,
    Material,
    StatedVolume,
    Survey,
    Switches,
    TableSpec,
    Tank,
)
from tankcal.survey.points import Points
from tankcal.tank.rules.model import Rule

if TYPE_CHECKING:
    from tankcal.job.model.clouds import Clouds
    from tankcal.survey.great_circles import GreatCircles
    from tankcal.survey.measurements import Measurements
    from tankcal.survey.reference_line import ReferenceLines
    from tankcal.survey.strapping import Strapping
    from tankcal.survey.tangents import Tangents
    from tankcal.survey.wall_hits import WallHits

__all__ = [
    "Bottom",
    "Change",
    "Course",
    "Datum",
    "Deadwood",
    "DeclaredInput",
    "End",
    "Horizontal",
    "InputFile",
    "Inspection",
    "Job",
    "Material",
    "Mesh",
    "Meter",
    "Metering",
    "Overruling",
    "Points",
    "Radii",
    "Ring",
    "Roof",
    "Ship",
    "Sphere",
    "StatedVolume",
    "Survey",
    "Switches",
    "TableSpec",
    "Tank",
    "Top",
]


@dataclass(frozen=True)
class InputFile:
    """Name, size and SHA-256 of one file that the job was read from."""

    file: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Job:
    """A checked job, all in SI; `load` makes it, `tankcal.run` computes it.

    Attributes
    ----------
    tank, survey, datum, table
        None only in a job that is read for its adjustment alone.
    courses : tuple of Course
        Of vertical tanks, from the bottom up; of others ().
    points : Points or None
        As handed in; None where sizes or a survey stand in their place.
    bottom : Bottom
        Of a vertical tank.
    rings : tuple of Ring
        Of a lying cylinder that a tape was put round, from end A to end B; of others ().
    deadwood : tuple of Deadwood
        In the order of the file.
    roof : Roof or None
        None without a floating roof.
    top : Top or None
        Head on a vertical tank; None: its table ends with the shell.
    horizontal, sphere, mesh
        None for the other kinds of tank.
    ship : Ship or None
        Of a mesh: trims, lists and the pipe of a tank that goes to sea.
    measurements : Measurements or None
        The survey that the points are to be adjusted from.
    inputs : tuple of DeclaredInput
        Declared ones in the order of the file, then the defaults of those that bear on the job and
        are not declared.
    correlations : tuple of (name, name, r)
        Between declared inputs.
    certificate : dict
        Texts that are printed when given, never invented.
    warnings : tuple of Problem
        Rows that do not stop the job.
    rule : Rule or None
        The decision rule that the table is judged by.
    circumference_m : float or None
        Of the first course by tape, outside; only compared.
    diameter_is : {"inside", "middle", "outside"} or None
        What the nominal diameter is; only compared.
    diameter_within_m : float or None
        By how much the diameter as built may differ from a nominal one that is rounded.
    inspection : Inspection or None
        What an inspection is to know; None: nothing was said of one.
    strapping : Strapping or None
        Circumferences by tape, in place of points.
    lines : ReferenceLines or None
        Offsets from lines of sight, beside them.
    hits : WallHits or None
        Bare hits of the wall, in place of points.
    tangents : Tangents or None
        Sights to the limbs of the tank, in place of points.
    clouds : Clouds or None
        Files of scanners, in place of points.
    liquid : Metering or None
        Runs of metered liquid, beside a survey or alone.
    radii : Radii or None
        Of the courses, by a former table, a record or a declaration; alone, or beside a survey of
        some courses.
    change : Change or None
        How they may have changed since then; beside a survey.
    great_circles : GreatCircles or None
        Equator and meridians of a sphere by tape, in place of points.
    overrulings : tuple of Overruling
        What was decided by hand against the search for blunders, in the order of the file.
    """

    tank: Tank | None
    survey: Survey | None
    datum: Datum | None
    table: TableSpec | None
    material: Material
    courses: tuple[Course, ...]
    points: Points | None
    inputs: tuple[DeclaredInput, ...] = ()
    certificate: dict = field(default_factory=dict)  # text, printed when given, never invented
    snooping: bool = True
    scale: str = "a_priori"
    files: tuple[InputFile, ...] = ()
    warnings: tuple = ()  # Problem rows that do not stop the job
    source: str = ""
    switches: Switches = field(default_factory=Switches)
    bottom: Bottom = field(default_factory=Bottom)
    deadwood: tuple[Deadwood, ...] = ()
    roof: Roof | None = None
    horizontal: Horizontal | None = None
    sphere: Sphere | None = None
    mesh: Mesh | None = None
    ship: Ship | None = None
    measurements: "Measurements | None" = None
    correlations: tuple[tuple[str, str, float], ...] = ()
    stated: tuple[StatedVolume, ...] = ()
    rule: Rule | None = None
    circumference_m: float | None = None
    diameter_is: str | None = None
    diameter_within_m: float | None = None
    inspection: Inspection | None = None
    strapping: "Strapping | None" = None
    lines: "ReferenceLines | None" = None
    hits: "WallHits | None" = None
    tangents: "Tangents | None" = None
    clouds: "Clouds | None" = None
    liquid: Metering | None = None
    radii: Radii | None = None
    change: Change | None = None
    rings: tuple[Ring, ...] = ()
    great_circles: "GreatCircles | None" = None
    top: Top | None = None
    overrulings: tuple[Overruling, ...] = ()
