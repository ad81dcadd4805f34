"""Settings of tank, survey, datum, table and shell, in SI."""

from dataclasses import dataclass, field

import numpy as np

from tankcal.text.shipped import DEFAULT

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
