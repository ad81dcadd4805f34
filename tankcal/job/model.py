"""Checked job as frozen dataclasses, in SI."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tankcal.survey.points import Points
from tankcal.tank.rules import Rule
from tankcal.text.shipped import DEFAULT

if TYPE_CHECKING:
    from tankcal.methods.clouds.readings import Clouds
    from tankcal.methods.liquid.readings import Metering
    from tankcal.methods.radii.readings import Radii
    from tankcal.survey.measurements import Measurements
    from tankcal.survey.reference_line import ReferenceLines
    from tankcal.survey.strapping import Strapping
    from tankcal.survey.tangents import Tangents
    from tankcal.survey.wall_hits import WallHits


# Declared inputs of uncertainty and volumes to be reported.


@dataclass(frozen=True)
class DeclaredInput:
    """A standard uncertainty that is not part of the survey: a row of uncertainty.csv.

    u is in SI units (dimensionless for "scale", "tilt" and "deadwood", else m, K, 1/K, Pa, kg,
    kg/m3 or m3). For a t distribution, `u_is` states whether u is its "scale" or its "sd".
    `u_as_read` is the value in `unit`, as given by the user.

    Attributes
    ----------
    is_default : bool
        True: not declared, but assumed by tankcal.
    """

    name: str
    u: float
    unit: str
    u_as_read: float
    type: str = "B"
    distribution: str = "normal"
    dof: float = np.inf
    note: str = ""
    is_default: bool = False
    u_is: str = "scale"


@dataclass(frozen=True)
class StatedVolume:
    """Dip whose volume is reported with its budget; with low_m, a delivery (stated.csv).

    Attributes
    ----------
    high_m, low_m : float
        Dips, from the zero of the table.
    volume_m3 : float or None
        Volume stated by another table or a contract, or None.
    row, file : int or None
        Row and file; a sheet of a workbook is "sheet stated".
    """

    high_m: float
    low_m: float | None = None
    volume_m3: float | None = None
    note: str = ""
    row: int | None = None
    file: str = field(default="stated.csv", compare=False)


@dataclass(frozen=True)
class Levels:
    """Operating levels of the tank: dips from the zero of the table, m; None: not given.

    Attributes
    ----------
    full_m, maximum_m, minimum_m, pump_suction_m : float or None
        Full tank, safe fill, lowest dip in operation, and lowest dip that can be pumped.
    """

    full_m: float | None = None
    maximum_m: float | None = None
    minimum_m: float | None = None
    pump_suction_m: float | None = None


@dataclass(frozen=True)
class Tank:
    """The tank: kind, nominal dimensions (None: not given), and texts for the report.

    Attributes
    ----------
    kind : str
        "vertical", "horizontal", "sphere" or "mesh".
    details : dict
        Owner, location, product, ...: texts that are printed if given.
    """

    id: str
    kind: str
    nominal_diameter_m: float | None
    nominal_height_m: float | None
    details: dict
    nominal_volume_m3: float | None = None


@dataclass(frozen=True)
class Survey:
    """The survey: `date` in ISO format, shell temperature in degrees C, liquid in the tank.

    Attributes
    ----------
    side : str
        "outside" or "inside": side of the wall on which points and dimensions were measured.
    liquid_level_m : float or None
        Dip on the day of the survey, from the zero of the table; None or 0: empty.
    pressure_pa : float or None
        Gauge pressure in a sphere on that day; None: none.
    """

    side: str
    date: str
    shell_temperature_c: float | None = None
    liquid_level_m: float | None = None
    liquid_density_kg_m3: float | None = None
    pressure_pa: float | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Datum:
    """Heights in the frame of the survey, m.

    Attributes
    ----------
    bottom_z_m : float or None
        Lower edge of the first course of a vertical tank. Horizontal cylinder and sphere without
        points: 0, because z counts from the inside bottom beneath the dip point. With points, and
        for a mesh: None; the lowest point of the tank applies.
    dip_plate_z_m : float or None
        Dip plate, the zero of the table; None: the bottom is the zero.
    """

    bottom_z_m: float | None
    dip_plate_z_m: float | None = None
    dip_x_m: float | None = None
    dip_y_m: float | None = None
    reference_height_m: float | None = None

    @property
    def plate_level_m(self):
        """Level of the dip plate above the bottom of the first course, m; 0 if not given."""
        return 0.0 if self.dip_plate_z_m is None else self.dip_plate_z_m - self.bottom_z_m


@dataclass(frozen=True)
class TableSpec:
    """Specification of the capacity table.

    Attributes
    ----------
    step_m : float or None
        None: given by `height_unit`, or chosen so that the error of linear interpolation is at most
        `max_interpolation_error_m3`.
    reference_temperature_c : float
        Reference temperature of the shell.
    liquid_density_kg_m3 : float
        Density of the liquid for the head correction; 0: no head.
    height_unit : str
        "m", "ft-in-8" or "ft-in-16" (rows of 1/8 and 1/16 inch).
    volume_unit : str
        "m3", "L", "hL", "bbl" (42 US gallons), "US gal" or "imp gal".
    heights_in : str or None
        "cm": heights of the printed table in centimetres; None: metres.
    ullage : bool or None
        True: the table has the ullage of each row.
    other_densities_kg_m3 : tuple of float
        Densities of further tables.
    fine_step_m, fine_zones : float or None
        Smaller step between the dips of each (low_m, high_m), ascending.
    max_interpolation_error_m3 : float or None
        Limit of the error of linear interpolation between rows; or None.
    height_expansion : bool
        True: dips are corrected for the thermal expansion of the shell.
    rule : str or None
        Name of the decision rule, as written (`Job.rule` contains the rule); or None.
    minimum_delivery_m : tuple of float or None
        Heights of the minimum deliveries to be reported; None: not given.
    monte_carlo : bool
        True: also simulate the model by the Monte Carlo method.
    pressure_pa : float or None
        Gauge pressure in a sphere for the table; None: none.
    """

    step_m: float | None
    reference_temperature_c: float
    liquid_density_kg_m3: float = 0.0
    coverage_probability: float = 0.95
    rule: str | None = None
    minimum_delivery_m: tuple[float, ...] | None = None
    monte_carlo: bool = True
    language: str = DEFAULT
    height_unit: str = "m"
    volume_unit: str = "m3"
    other_densities_kg_m3: tuple[float, ...] = ()
    fine_step_m: float | None = None
    fine_zones: tuple[tuple[float, float], ...] = ()
    max_interpolation_error_m3: float | None = None
    height_expansion: bool = False
    heights_in: str | None = field(default=None, metadata={"optional": True})
    ullage: bool | None = field(default=None, metadata={"optional": True})
    pressure_pa: float | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Inspection:
    """Input of an inspection of the tank.

    Attributes
    ----------
    rule : str or None
        Name of the rule of the assessment, as written; None: the default.
    yield_pa : float or None
        Yield stress of the steel of the shell, Pa; None: not given.
    """

    rule: str | None = None
    yield_pa: float | None = None


@dataclass(frozen=True)
class Switches:
    """Corrections to be applied; the report names those that are switched off.

    Attributes
    ----------
    plate, paint, temperature, head, tilt, bottom, deadwood, roof, top : bool
        False: the correction is not applied.
    """

    plate: bool = True
    paint: bool = True
    temperature: bool = True
    head: bool = True
    tilt: bool = True
    bottom: bool = True
    deadwood: bool = True
    roof: bool = True
    top: bool = field(
        default=True, metadata={"doc": "take the head on top into account", "optional": True}
    )


@dataclass(frozen=True)
class Material:
    """Material of the shell.

    Attributes
    ----------
    e_pa : float
        Young's modulus, Pa.
    expansion_per_k : float
        Coefficient of linear thermal expansion, 1/K.
    expansion_given : bool
        False: the default is used, and the report states it.
    poisson : float or None
        Poisson's ratio of the wall of a sphere; None: 0.3.
    """

    e_pa: float = 206e9
    expansion_per_k: float = 1.1e-5
    expansion_given: bool = False
    poisson: float | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Equipment:
    """Measuring equipment of a survey with its calibration (equipment.toml); "": not given.

    Attributes
    ----------
    date, due : str
        Day of its calibration, and the last day on which this calibration may be used.
    uncertainty : str
        Uncertainty as stated by its certificate.
    """

    name: str
    description: str
    serial_number: str = ""
    laboratory: str = ""
    certificate: str = ""
    date: str = ""
    due: str = ""
    uncertainty: str = ""


@dataclass(frozen=True)
class Seal:
    """A seal of the tank (seals.toml); "": not given.

    Attributes
    ----------
    place, mark, secures : str
        Sealed part, number or mark of the seal, and the parts that it secures.
    attached : str
        Day on which it was attached.
    """

    name: str
    place: str
    mark: str = ""
    secures: str = ""
    attached: str = ""


@dataclass(frozen=True)
class NextVerification:
    """Last day of the next verification: demanded by a rule or wished by the customer.

    Attributes
    ----------
    date : str
    rule, clause : str or None
        Rule that demands it; None: the customer asked for the date.
    years : float or None
        Period of the rule.
    """

    date: str
    rule: str | None = None
    clause: str | None = None
    years: float | None = None


# ---- manual decisions against the search for blunders, or before it


@dataclass(frozen=True)
class Overruling:
    """Manual decision on a point of the wall or on a reading of the survey.

    Attributes
    ----------
    point : str or None
        Name of the point; None: a reading.
    table, reading_row : str, int or None
        Table of a reading and row in the table; None: a point.
    decision : {"keep", "leave_out"}
        "keep": not rejected by the search; "leave_out": removed before the search.
    reason : str
    by, date : str
        "": not given.
    row, file
        Row and file of the decision, for messages.
    """

    point: str | None
    table: str | None
    reading_row: int | None
    decision: str
    reason: str
    by: str = ""
    date: str = ""
    row: int | None = None
    file: str = field(default="overrulings.csv", compare=False)

    @property
    def is_kept(self):
        """Return True if the point or reading is kept."""
        return self.decision == "keep"

    @property
    def what(self):
        """Name of the point or reading in reports."""
        return self.point if self.table is None else f"{self.table} {self.reading_row}"


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
class Course:
    """One ring of plates, from the bottom up.

    Attributes
    ----------
    name : str
    height_m : float
        From joint to joint, m.
    thickness_m : float
        Thickness of its plates, m.
    paint_m : float
        Thickness of their paint, m.
    welds_rad : tuple of float or None
        Azimuths of its vertical welds, clockwise from +y, rad; None: not known.
    """

    name: str
    height_m: float
    thickness_m: float
    paint_m: float = 0.0
    welds_rad: tuple[float, ...] | None = field(
        default=None,
        metadata={
            "doc": "azimuths of its vertical welds, clockwise from +y; left out if unknown",
            "optional": True,
        },
    )


@dataclass(frozen=True)
class Ring:
    """One ring of plates of a lying cylinder, from end A to end B.

    Attributes
    ----------
    name : str
    length_m : float
        Along the axis, m.
    thickness_m : float
        Thickness of its plates, m.
    paint_m : float
        Thickness of their paint, m.
    lap : str or None
        "inner" or "outer" for lap-jointed rings; None: not known.
    """

    name: str
    length_m: float
    thickness_m: float = 0.0
    paint_m: float = 0.0
    lap: str | None = None


@dataclass(frozen=True)
class Bottom:
    """Bottom of a vertical tank, below or above the lower edge of its first course.

    Attributes
    ----------
    form : str
        "flat", "leaning" (perpendicular to the axis of the shell), "cone", "dish", "ellipsoidal",
        "torispherical", "points" (a surveyed surface), "cloud" (a surface measured by scans) or
        "liquid" (measured volumes).
    centre_z_m : float or None
        Cone, dish and so on: z of the centre in the frame of the survey; the edge is at bottom_z_m.
    xyz_m : ndarray, shape (n, 3)
        Points: surveyed, in the frame of the survey; for a cloud None until its scans are read.
    sd_m : ndarray, shape (n,)
        Standard deviations of their z, or None: not given.
    level_m : ndarray, shape (n,)
        Liquid: dips, from the zero of the table, ascending.
    volume_m3 : ndarray, shape (n,)
        Liquid: capacity below each level, ascending.
    u_m3 : ndarray, shape (n,)
        Standard uncertainties of the capacities, or None: not given.
    rows : tuple
        Row of each point or level in its file, for messages.
    shared : tuple of survey.results.Cause
        Cloud: common causes of error of the heights; each has (n,) m.
    dish_radius_m, knuckle_radius_m : float or None
        Torispherical: radii if given; else None.
    standard : str or None
        Torispherical: standard that defines the radii from the diameter; else None.
    """

    form: str = "flat"
    centre_z_m: float | None = None
    xyz_m: np.ndarray | None = None
    sd_m: np.ndarray | None = None
    level_m: np.ndarray | None = None
    volume_m3: np.ndarray | None = None
    u_m3: np.ndarray | None = None
    rows: tuple = ()
    shared: tuple = ()
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    standard: str | None = None


@dataclass(frozen=True)
class Top:
    """Head on the shell of a vertical tank, which can contain liquid; inside dimensions.

    Attributes
    ----------
    form : str
        "cone", "dish", "ellipsoidal" or "torispherical".
    depth_m : float or None
        Height of its centre above the top of the shell; None: determined by the radii.
    dish_radius_m, knuckle_radius_m : float or None
        Torispherical: radii if given; else None.
    standard : str or None
        Torispherical: standard that defines the radii from the diameter; else None.
    """

    form: str
    depth_m: float | None = None
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    standard: str | None = None


@dataclass(frozen=True)
class Deadwood:
    """Object in the tank that reduces (negative volume) or increases (positive) the capacity.

    Attributes
    ----------
    bottom_m, top_m : float
        Dips, from the zero of the table; the volume is linear in height between them.
    u_m3 : float or None
        Standard uncertainty of the volume, or None: not given.
    """

    name: str
    bottom_m: float
    top_m: float
    volume_m3: float
    u_m3: float | None = None
    row: int | None = None


@dataclass(frozen=True)
class Roof:
    """A floating roof. It displaces its mass over the density of the liquid.

    Attributes
    ----------
    critical_bottom_m, critical_top_m : float
        Dips, from the zero of the table; between them the roof is partly afloat.
    reference_density_kg_m3 : float
        Density of the liquid of the table.
    weighing : str
        "air" or "vacuum": condition of the weighing that gave `mass_kg`.
    high_critical_bottom_m, high_critical_top_m : float or None
        Critical zone with the legs in their high position; None: they have a single position.
    """

    mass_kg: float
    critical_bottom_m: float
    critical_top_m: float
    reference_density_kg_m3: float
    weighing: str
    high_critical_bottom_m: float | None = None
    high_critical_top_m: float | None = None


@dataclass(frozen=True)
class End:
    """One end of a horizontal cylinder, curved outwards; dimensions as measured.

    Attributes
    ----------
    kind : str
        "flat", "conical", "ellipsoidal", "torispherical", "spherical" or "guppy".
    depth_m : float
        Along the axis, from the end of the cylinder; flat: 0; torispherical: 0 if determined by the
        radii.
    dish_radius_m : float or None
        Torispherical: radius of the dish (crown) if given; else None.
    knuckle_radius_m : float or None
        Torispherical: radius of the knuckle if given; else None.
    standard : str or None
        Torispherical: standard that defines the radii from the diameter; else None.
    """

    kind: str
    depth_m: float = 0.0
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    standard: str | None = field(
        default=None,
        metadata={"doc": "form that both radii follow from; left out if none", "optional": True},
    )


@dataclass(frozen=True)
class Horizontal:
    """Horizontal cylinder between its ends A and B; dimensions on the side of the survey.

    Attributes
    ----------
    length_m : float
        Length of the cylinder without the ends; equal inside and outside.
    width_m, height_m : float or None
        Width and height of its cross-section, equal if round; None: from the points or the straps.
    tilt : float or None
        Rise of end B over end A per metre of axis, tan of the angle; None: from the points.
    roll_rad : float
        Rotation of the cross-section about the axis, clockwise seen from A.
    dip_from_a_m : float
        Position of the dip point along the axis, from the end A of the cylinder.
    dip_direction : str
        Direction of the dips: "plumb", or "square" to the axis.
    thickness_m : float
        Thickness of plate and paint, subtracted from outside dimensions; for strapped rings,
        thickness of the ends.
    azimuth_rad : float or None
        Direction from A to B, clockwise from +y; None: no points.
    tube_angle_rad : float or None
        Inclination of the gauge tube perpendicular to the axis; positive: its top is to the right,
        seen from A; None: plumb.
    tube_offset_m : float or None
        Distance of the tube from the axis, positive to the right, seen from A; None: 0.
    """

    length_m: float
    end_a: End
    end_b: End
    width_m: float | None
    height_m: float | None
    tilt: float | None = 0.0
    roll_rad: float = 0.0
    dip_from_a_m: float = 0.0
    dip_direction: str = "plumb"
    thickness_m: float = 0.0
    azimuth_rad: float | None = None
    tube_angle_rad: float | None = field(
        default=None,
        metadata={"doc": "of the gauge tube off the plumb; left out if plumb", "optional": True},
    )
    tube_offset_m: float | None = field(
        default=None,
        metadata={"doc": "of the tube off the axis; left out if through it", "optional": True},
    )


@dataclass(frozen=True)
class Sphere:
    """A sphere.

    Attributes
    ----------
    diameter_m : float or None
        Diameter as measured, on the side of the survey; None: from the points.
    thickness_m : float
        Thickness of plate and paint, subtracted from outside dimensions.
    ovality_m : float or None
        Prior standard deviation of its degree 2, for directions without straps; None: a share of
        its radius.
    form_m : float or None
        Prior standard deviation of its radius in higher degrees; None: as in
        `geometry.field.places`.
    """

    diameter_m: float | None
    thickness_m: float = 0.0
    ovality_m: float | None = None
    form_m: float | None = None


@dataclass(frozen=True)
class Ship:
    """Attitudes and sounding pipe of a tank of a ship, in addition to its mesh.

    Attributes
    ----------
    trim_m : tuple of float
        Draught aft less draught forward, for the tables of corrections, ascending.
    length_between_marks_m : float
        Distance between the marks of the draughts.
    list_rad : tuple of float
        List to starboard, ascending.
    bow_azimuth_rad : float
        Azimuth of the bow, clockwise from +y of the frame of the mesh.
    pipe_bottom_m, pipe_top_m : tuple of float
        Ends of the sounding pipe in the frame of the mesh.
    correction_step_m : float or None
        Step of the soundings in tables of corrections; None: automatic.
    contraction : float or None
        Relative contraction of all lengths from measurement to service; None: not given.
    """

    trim_m: tuple[float, ...]
    length_between_marks_m: float
    list_rad: tuple[float, ...]
    bow_azimuth_rad: float
    pipe_bottom_m: tuple[float, float, float]
    pipe_top_m: tuple[float, float, float]
    correction_step_m: float | None = None
    contraction: float | None = None


@dataclass(frozen=True)
class Mesh:
    """A closed mesh of the inside.

    Attributes
    ----------
    file : str
        Name of its file.
    unit_m : float
        Length of one unit of its coordinates, m.
    data : bytes
        Content of the file.
    """

    file: str
    unit_m: float
    data: bytes = field(repr=False)


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

    @property
    def has_network(self) -> bool:
        """Whether the job has measurements that a network adjustment makes into points."""
        return self.measurements is not None

    @property
    def network(self) -> "Measurements":
        """Measurements to be adjusted; without a network, `Measurements` that contain none."""
        from tankcal.survey.measurements import Measurements  # only jobs with a network load it

        return self.measurements or Measurements()
