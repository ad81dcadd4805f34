"""The checked job as frozen dataclasses, all in SI."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Tank:
    """The tank: `id`, `kind` ("vertical"), nominal sizes in m, and what is printed about it."""

    id: str
    kind: str
    nominal_diameter_m: float
    nominal_height_m: float
    details: dict  # owner, location, product, ...: text, printed when given


@dataclass(frozen=True)
class Survey:
    """The survey: `side` "outside" or "inside", `date` ISO text, temperatures in degC, or None."""

    side: str
    date: str
    shell_temperature_c: float | None = None
    liquid_level_m: float | None = None
    liquid_density_kg_m3: float | None = None


@dataclass(frozen=True)
class Datum:
    """Heights of the bottom of the first course and of the dip plate in the survey's frame, m."""

    bottom_z_m: float
    dip_plate_z_m: float | None = None  # None: the table's zero is the bottom
    dip_x_m: float | None = None
    dip_y_m: float | None = None
    reference_height_m: float | None = None


@dataclass(frozen=True)
class TableSpec:
    """What the capacity table is to be: row step m, reference temperature degC, coverage."""

    step_m: float
    reference_temperature_c: float
    liquid_density_kg_m3: float = 0.0
    coverage_probability: float = 0.95
    rule: str | None = None
    minimum_delivery_m: float | None = None
    language: str = "en"


@dataclass(frozen=True)
class Material:
    """The shell's steel: Young's modulus Pa, thermal expansion 1/K."""

    e_pa: float = 206e9
    expansion_per_k: float = 1.1e-5
    expansion_given: bool = False  # False: the default was taken, and the report says so


@dataclass(frozen=True)
class Course:
    """One ring of plates, from the bottom up: height, plate and paint thickness, m."""

    name: str
    height_m: float
    thickness_m: float
    paint_m: float = 0.0


@dataclass(frozen=True)
class Points:
    """Surveyed points, in the order of the file.

    names       (n,) text            rows        (n,) row of each in its file, for messages
    xyz_m       (n, 3) coordinates   covariance_m2  (3n, 3n), or None: not given
    sd_m        (n, 3) standard deviations, or None: not given (estimated from residuals)
    section     (n,) text or None: given section name
    generatrix  (n,) text or None
    """

    names: tuple
    xyz_m: np.ndarray
    sd_m: np.ndarray | None
    covariance_m2: np.ndarray | None
    section: tuple
    generatrix: tuple
    rows: tuple


@dataclass(frozen=True)
class DeclaredInput:
    """One row of uncertainty.csv: a standard uncertainty that the survey itself does not carry.

    u is SI (dimensionless for "scale", m, K, 1/K); `unit` and `u_as_read` are as the user wrote.
    """

    name: str
    u: float
    unit: str
    u_as_read: float
    type: str = "B"
    distribution: str = "normal"
    dof: float = np.inf
    note: str = ""


@dataclass(frozen=True)
class InputFile:
    """Name, size and SHA-256 of one file that the job was read from."""

    file: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Job:
    """A checked job, all in SI; `load` makes it, `tankcal.run` computes it."""

    tank: Tank
    survey: Survey
    datum: Datum
    table: TableSpec
    material: Material
    courses: tuple[Course, ...]
    points: Points
    inputs: tuple[DeclaredInput, ...] = ()
    certificate: dict = field(default_factory=dict)  # text, printed when given, never invented
    snooping: bool = True
    scale: str = "a_priori"
    files: tuple[InputFile, ...] = ()
    warnings: tuple = ()  # Problem rows that do not stop the job
    source: str = ""
