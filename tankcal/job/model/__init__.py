"""The checked job as frozen dataclasses, all in SI."""

from dataclasses import dataclass, field

from tankcal.job.model.parts import (
    Bottom,
    Course,
    Deadwood,
    End,
    Horizontal,
    Mesh,
    Roof,
    Sphere,
)
from tankcal.job.model.settings import (
    Datum,
    DeclaredInput,
    Material,
    StatedVolume,
    Survey,
    Switches,
    TableSpec,
    Tank,
)
from tankcal.survey.measurements import Measurements
from tankcal.survey.points import Points
from tankcal.tank.rules.model import Rule

__all__ = [
    "Bottom",
    "Course",
    "Datum",
    "Deadwood",
    "DeclaredInput",
    "End",
    "Horizontal",
    "InputFile",
    "Job",
    "Material",
    "Mesh",
    "Points",
    "Roof",
    "Sphere",
    "StatedVolume",
    "Survey",
    "Switches",
    "TableSpec",
    "Tank",
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

    tank, survey, datum, table  None only in a job that is read for its adjustment alone
    courses       vertical tanks, from the bottom up; else ()
    points        as handed in; None where there are none: sizes or a survey stand in their place
    bottom        of a vertical tank
    deadwood      in the order of the file
    roof          None: no floating roof
    horizontal, sphere, mesh  None for the other kinds
    measurements  the survey that the points are to be adjusted from, or None
    inputs        declared ones in the order of the file, then the defaults of those that bear on
                  the job and are not declared
    correlations  (name, name, r) of declared inputs
    rule          the decision rule that the table is judged by, or None
    circumference_m  of the first course by tape, outside; only compared; None: not given
    diameter_is   what the nominal diameter is: inside, middle or outside; only compared; or None
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
    measurements: Measurements | None = None
    correlations: tuple[tuple[str, str, float], ...] = ()
    stated: tuple[StatedVolume, ...] = ()
    rule: Rule | None = None
    circumference_m: float | None = None
    diameter_is: str | None = None
