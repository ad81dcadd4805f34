"""What job.toml says of tank, survey, datum, table and shell, in SI."""

from dataclasses import dataclass, field

import numpy as np

from tankcal.text.languages import DEFAULT

# What a job declares about uncertainty, in SI.


@dataclass(frozen=True)
class DeclaredInput:
    """A standard uncertainty that the survey itself does not carry: a row of uncertainty.csv.

    u is SI (dimensionless for "scale", "tilt" and "deadwood", m, K, 1/K, Pa, kg, kg/m3, m3), of a
    t distribution what `u_is` says, "scale" or "sd"; `u_as_read` is the same in
    `unit`, as the user wrote it.

    Attributes
    ----------
    is_default : bool
        True: nobody declared it, tankcal assumes it.
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
    """A dip whose volume is reported with its budget; with low_m a delivery (stated.csv).

    Attributes
    ----------
    high_m, low_m : float
        Dips, from the table's zero.
    volume_m3 : float or None
        That another table or a contract states, or None.
    row, file : int or None
        Where it stands; a sheet of a workbook is "sheet stated".
    """

    high_m: float
    low_m: float | None = None
    volume_m3: float | None = None
    note: str = ""
    row: int | None = None
    file: str = field(default="stated.csv", compare=False)


@dataclass(frozen=True)
class Tank:
    """The tank: its kind, nominal sizes (None: not given), and what is printed about it.

    Attributes
    ----------
    kind : str
        "vertical", "horizontal", "sphere" or "mesh".
    details : dict
        Owner, location, product, ...: text, printed when given.
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

    Attributes
    ----------
    side : str
        "outside" or "inside": where points and sizes were measured.
    liquid_level_m : float or None
        Dip of the survey day, from the table's zero; None or 0: empty.
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
    """Heights in the survey's frame, m.

    Attributes
    ----------
    bottom_z_m : float or None
        Bottom of the first course of a vertical tank. Horizontal cylinder and sphere without
        points: 0, for z then counts from the inside bottom beneath the dip point; with points,
        and for a mesh: None, the tank's own lowest point.
    dip_plate_z_m : float or None
        The dip plate, which is the table's zero; None: the zero is the bottom.
    """

    bottom_z_m: float | None
    dip_plate_z_m: float | None = None
    dip_x_m: float | None = None
    dip_y_m: float | None = None
    reference_height_m: float | None = None

    @property
    def plate_level_m(self):
        """Level of the dip plate above the bottom of the first course, m; 0 where none is given."""
        return 0.0 if self.dip_plate_z_m is None else self.dip_plate_z_m - self.bottom_z_m


@dataclass(frozen=True)
class TableSpec:
    """What the capacity table is to be.

    Attributes
    ----------
    step_m : float or None
        None: given by `height_unit`, or chosen so that linear interpolation errs by at most
        `max_interpolation_error_m3`.
    reference_temperature_c : float
        Of the shell.
    liquid_density_kg_m3 : float
        Of the liquid head; 0: no head.
    height_unit : str
        "m", "ft-in-8" or "ft-in-16" (rows of 1/8 and 1/16 inch).
    volume_unit : str
        "m3", "L" or "bbl" (42 US gallons).
    other_densities_kg_m3 : tuple of float
        Densities of further tables.
    fine_step_m, fine_zones : float or None
        Smaller step between the dips of each (low_m, high_m), ascending.
    max_interpolation_error_m3 : float or None
        Bound of the error of linear interpolation between rows; or None.
    height_expansion : bool
        Whether dips expand with the shell, too.
    rule : str or None
        Name of the decision rule, as written (`Job.rule` has it); or None.
    minimum_delivery_m : tuple of float or None
        Heights of the least deliveries to be reported; None: not given.
    monte_carlo : bool
        Whether the model is drawn from, too.
    pressure_pa : float or None
        Gauge pressure in a sphere that the table is for; None: none.
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
    pressure_pa: float | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Inspection:
    """What an inspection of the tank is to know.

    Attributes
    ----------
    rule : str or None
        Name of the rule that it is judged by, as written; None: the usual one.
    yield_pa : float or None
        Yield stress of the shell's steel, Pa; None: not given.
    """

    rule: str | None = None
    yield_pa: float | None = None


@dataclass(frozen=True)
class Switches:
    """Which corrections are made; one that is off is named in the report.

    Attributes
    ----------
    plate, paint, temperature, head, tilt, bottom, deadwood, roof, top : bool
        False: that correction is not made.
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
    """The shell's steel.

    Attributes
    ----------
    e_pa : float
        Young's modulus, Pa.
    expansion_per_k : float
        Thermal expansion, 1/K.
    expansion_given : bool
        False: the default was taken, and the report says so.
    poisson : float or None
        Poisson's ratio of the wall of a sphere; None: 0.3.
    """

    e_pa: float = 206e9
    expansion_per_k: float = 1.1e-5
    expansion_given: bool = False
    poisson: float | None = field(default=None, metadata={"optional": True})
