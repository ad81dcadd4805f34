"""Checked job as frozen dataclasses, in SI."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

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
from tankcal.job.model.settings import (
    Datum,
    DeclaredInput,
    Equipment,
    Inspection,
    Levels,
    Material,
    NextVerification,
    Overruling,
    Seal,
    StatedVolume,
    Survey,
    Switches,
    TableSpec,
    Tank,
)
from tankcal.survey.points import Points
from tankcal.tank.rules.model import Rule

if TYPE_CHECKING:
    from tankcal.methods.clouds.readings import Clouds
    from tankcal.methods.liquid.readings import Metering
    from tankcal.methods.radii.readings import Radii
    from tankcal.survey.measurements import Measurements
    from tankcal.survey.reference_line import ReferenceLines
    from tankcal.survey.strapping import Strapping
    from tankcal.survey.tangents import Tangents
    from tankcal.survey.wall_hits import WallHits

__all__ = [
    "Bottom",
    "Course",
    "Datum",
    "Deadwood",
    "DeclaredInput",
    "End",
    "Horizontal",
    "InputFile",
    "Inspection",
    "Job",
    "Levels",
    "Material",
    "Mesh",
    "Overruling",
    "Points",
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
    """Name, size and SHA-256 of one input file of the job."""

    file: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Job:
    """A checked job, in SI; `load` builds it, `tankcal.run` calculates it.

    Attributes
    ----------
    tank, survey, datum, table
        None only in a job that is read for its adjustment alone.
    courses : tuple of Course
        Courses of a vertical tank, from the bottom up; () for other tanks.
    points : Points or None
        Points as supplied; None if sizes or a survey replace them.
    bottom : Bottom
        Bottom of a vertical tank.
    rings : tuple of Ring
        Strapped rings of a lying cylinder, from end A to end B; () for other tanks.
    deadwood : tuple of Deadwood
        In the order of the file.
    roof : Roof or None
        None without a floating roof.
    top : Top or None
        Head on a vertical tank; None: its table ends with the shell.
    horizontal, sphere, mesh
        None for the other kinds of tank.
    ship : Ship or None
        Trims, lists and sounding pipe of a tank of a ship, described by a mesh.
    measurements : Measurements or None
        Survey to be adjusted, which determines the points.
    inputs : tuple of DeclaredInput
        Declared inputs in the order of the file, then defaults of inputs that affect the job and
        are not declared.
    correlations : tuple of (name, name, r)
        Correlation coefficients between declared inputs.
    certificate : dict
        Texts that are printed if given, never invented.
    warnings : tuple of Problem
        Findings that do not prevent a calculation.
    rule : Rule or None
        Decision rule for the table.
    circumference_m : float or None
        Outside circumference of the first course by tape; only compared.
    diameter_is : {"inside", "middle", "outside"} or None
        Definition of the nominal diameter; only compared.
    diameter_within_m : float or None
        Largest difference of the diameter as built from a rounded nominal diameter.
    inspection : Inspection or None
        Input of an inspection; None: not given.
    levels : Levels or None
        Operating levels; None: not given.
    strapping : Strapping or None
        Circumferences by tape, which replace points.
    lines : ReferenceLines or None
        Offsets from lines of sight, in addition to circumferences.
    hits : WallHits or None
        Sights to the bare wall, which replace points.
    tangents : Tangents or None
        Sights to the limbs of the tank, which replace points.
    clouds : Clouds or None
        Files of scanners, which replace points.
    liquid : Metering or None
        Runs of metered liquid, in addition to a survey or alone.
    radii : Radii or None
        Radii of the courses by a former table, a record or a declaration; alone, or in addition to
        a survey of some courses.
    surveys : dict
        {name of a `methods.base.Method`: its readings}, for each method of the job that has no
        attribute of its own, such as "great_circles".
    overrulings : tuple of Overruling
        Manual decisions against the search for blunders, in the order of the file.
    equipment : tuple of Equipment
        Equipment used in the survey, with its calibrations.
    seals : tuple of Seal
        Seal plan of the tank.
    next_verification : NextVerification or None
    """

    tank: Tank | None
    survey: Survey | None
    datum: Datum | None
    table: TableSpec | None
    material: Material
    courses: tuple[Course, ...]
    points: Points | None
    inputs: tuple[DeclaredInput, ...] = ()
    certificate: dict = field(
        default_factory=dict
    )  # texts that are printed if given, never invented
    snooping: bool = True
    scale: str = "a_priori"
    files: tuple[InputFile, ...] = ()
    warnings: tuple = ()  # Problems that do not prevent a calculation
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
    levels: Levels | None = None
    strapping: "Strapping | None" = None
    lines: "ReferenceLines | None" = None
    hits: "WallHits | None" = None
    tangents: "Tangents | None" = None
    clouds: "Clouds | None" = None
    liquid: "Metering | None" = None
    radii: "Radii | None" = None
    rings: tuple[Ring, ...] = ()
    surveys: dict = field(default_factory=dict)
    top: Top | None = None
    overrulings: tuple[Overruling, ...] = ()
    equipment: tuple[Equipment, ...] = ()
    seals: tuple[Seal, ...] = ()
    next_verification: NextVerification | None = None
