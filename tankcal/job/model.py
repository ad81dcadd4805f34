"""The checked job as frozen dataclasses, all in SI."""

from dataclasses import dataclass, field

import numpy as np

from tankcal.job.measurements import Measurements


@dataclass(frozen=True)
class Tank:
    """The tank: its kind, nominal sizes (None: not given), and what is printed about it.

    kind     "vertical", "horizontal", "sphere" or "mesh"
    details  owner, location, product, ...: text, printed when given
    """

    id: str
    kind: str
    nominal_diameter_m: float | None
    nominal_height_m: float | None
    details: dict
    nominal_volume_m3: float | None = None


@dataclass(frozen=True)
class Survey:
    """The survey: `date` ISO text, temperature of the shell degC, liquid that was in the tank.

    side            "outside" or "inside": where points and sizes were measured
    liquid_level_m  dip of the survey day, from the table's zero; None or 0: empty
    """

    side: str
    date: str
    shell_temperature_c: float | None = None
    liquid_level_m: float | None = None
    liquid_density_kg_m3: float | None = None


@dataclass(frozen=True)
class Datum:
    """Heights in the survey's frame, m.

    bottom_z_m     bottom of the first course of a vertical tank. Horizontal cylinder and sphere
                   without points: 0, for z then counts from the inside bottom beneath the dip
                   point; with points, and for a mesh: None, the tank's own lowest point
    dip_plate_z_m  the dip plate, which is the table's zero; None: the zero is the bottom
    """

    bottom_z_m: float | None
    dip_plate_z_m: float | None = None
    dip_x_m: float | None = None
    dip_y_m: float | None = None
    reference_height_m: float | None = None


@dataclass(frozen=True)
class TableSpec:
    """What the capacity table is to be.

    step_m                      None: given by `height_unit`, or chosen so that linear interpolation
                                errs by at most `max_interpolation_error_m3`
    reference_temperature_c     of the shell
    liquid_density_kg_m3        of the liquid head; 0: no head
    height_unit                 "m", "ft-in-8" or "ft-in-16" (rows of 1/8 and 1/16 inch)
    volume_unit                 "m3", "L" or "bbl" (42 US gallons)
    other_densities_kg_m3       densities of further tables
    fine_step_m, fine_zones     smaller step between the dips of each (low_m, high_m), ascending
    max_interpolation_error_m3  bound of the error of linear interpolation between rows; or None
    height_expansion            whether dips expand with the shell, too
    """

    step_m: float | None
    reference_temperature_c: float
    liquid_density_kg_m3: float = 0.0
    coverage_probability: float = 0.95
    rule: str | None = None
    minimum_delivery_m: float | None = None
    language: str = "en"
    height_unit: str = "m"
    volume_unit: str = "m3"
    other_densities_kg_m3: tuple[float, ...] = ()
    fine_step_m: float | None = None
    fine_zones: tuple[tuple[float, float], ...] = ()
    max_interpolation_error_m3: float | None = None
    height_expansion: bool = False


@dataclass(frozen=True)
class Switches:
    """Which corrections are made; one that is off is named in the report."""

    plate: bool = True
    paint: bool = True
    temperature: bool = True
    head: bool = True
    tilt: bool = True
    bottom: bool = True
    deadwood: bool = True
    roof: bool = True


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
    causes      named causes that the covariance contains (`surveys.Cause`): covariance = the rest
                + sum of column column', their columns over the coordinates of these points
    from_adjustment  True: adjusted from a survey; the covariance has the scale that it should have
    """

    names: tuple
    xyz_m: np.ndarray
    sd_m: np.ndarray | None
    covariance_m2: np.ndarray | None
    section: tuple
    generatrix: tuple
    rows: tuple
    causes: tuple = ()
    from_adjustment: bool = False


@dataclass(frozen=True)
class Bottom:
    """The bottom of a vertical tank, below or above the bottom of its first course.

    form        "flat", "leaning" (square to the shell's axis), "cone", "dish", "points" (a surveyed
                surface) or "liquid" (measured volumes)
    centre_z_m  cone and dish: z of the centre in the survey's frame; the edge is at bottom_z_m
    xyz_m       (n, 3) points: surveyed, in the survey's frame
    sd_m        (n,) standard deviations of their z, or None: not given
    level_m     (n,) liquid: dips, from the table's zero, ascending
    volume_m3   (n,) liquid: the capacity below each level, ascending
    u_m3        (n,) their standard uncertainties, or None: not given
    rows        (n,) row of each point or level in its file, for messages
    """

    form: str = "flat"
    centre_z_m: float | None = None
    xyz_m: np.ndarray | None = None
    sd_m: np.ndarray | None = None
    level_m: np.ndarray | None = None
    volume_m3: np.ndarray | None = None
    u_m3: np.ndarray | None = None
    rows: tuple = ()


@dataclass(frozen=True)
class Deadwood:
    """A thing in the tank that takes room (negative volume) or gives some (positive).

    bottom_m, top_m  dips, from the table's zero; the volume is linear in height between them
    u_m3             standard uncertainty of the volume, or None: not given
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

    critical_bottom_m, critical_top_m  dips, from the table's zero: between them it is partly afloat
    reference_density_kg_m3            of the liquid that the table is for
    weighing                           "air" or "vacuum": what `mass_kg` was weighed in
    """

    mass_kg: float
    critical_bottom_m: float
    critical_top_m: float
    reference_density_kg_m3: float
    weighing: str


@dataclass(frozen=True)
class End:
    """One end of a horizontal cylinder, bulging outwards; sizes as measured.

    kind              "flat", "conical", "ellipsoidal", "torispherical" or "spherical"
    depth_m           along the axis, from the end of the cylinder; flat: 0; torispherical: 0, it
                      follows from the radii
    dish_radius_m     torispherical: radius of the dish (crown); else None
    knuckle_radius_m  torispherical: radius of the knuckle; else None
    """

    kind: str
    depth_m: float = 0.0
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None


@dataclass(frozen=True)
class Horizontal:
    """A horizontal cylinder between its ends A and B; sizes as measured, on the side of the survey.

    length_m            of the cylinder, without the ends; the same inside and outside
    width_m, height_m   of its cross-section, equal when round; None: they come from the points
    tilt                rise of end B over end A per metre of axis, tan of the angle; None: from
                        the points
    roll_rad            turn of the cross-section about the axis, clockwise seen from A
    dip_from_a_m        of the dip point, along the axis from the start of the cylinder at A
    dip_direction       dips are read "plumb", or "square" to the axis
    thickness_m         plate and paint, to be subtracted from what was measured outside
    azimuth_rad         direction from A to B, clockwise from +y; None: no points
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


@dataclass(frozen=True)
class Sphere:
    """A sphere.

    diameter_m   as measured, on the side of the survey; None: it comes from the points
    thickness_m  plate and paint, to be subtracted from what was measured outside
    """

    diameter_m: float | None
    thickness_m: float = 0.0


@dataclass(frozen=True)
class Mesh:
    """A closed mesh of the inside: name and bytes of its file, metres of one unit of it."""

    file: str
    unit_m: float
    data: bytes = field(repr=False)


@dataclass(frozen=True)
class DeclaredInput:
    """One row of uncertainty.csv: a standard uncertainty that the survey itself does not carry.

    u is SI (dimensionless for "scale" and "tilt", m, K, 1/K, Pa, kg, kg/m3); `unit` and `u_as_read`
    are as the user wrote.
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
    """A checked job, all in SI; `load` makes it, `tankcal.run` computes it.

    tank, survey, datum, table  None only in a job that is read for its adjustment alone
    courses       vertical tanks, from the bottom up; else ()
    points        as handed in; None where there are none: sizes or a survey stand in their place
    bottom        of a vertical tank
    deadwood      in the order of the file
    roof          None: no floating roof
    horizontal, sphere, mesh  None for the other kinds
    measurements  the survey that the points are to be adjusted from, or None
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
    switches: Switches = Switches()
    bottom: Bottom = Bottom()
    deadwood: tuple[Deadwood, ...] = ()
    roof: Roof | None = None
    horizontal: Horizontal | None = None
    sphere: Sphere | None = None
    mesh: Mesh | None = None
    measurements: Measurements | None = None
