"""From the checked meters.toml, liquid.csv and [liquid] to `Metering`, in SI."""

import datetime
from dataclasses import dataclass, field

import numpy as np

from tankcal.job.structure import structure
from tankcal.methods.liquid.checks import meters_read
from tankcal.methods.liquid.columns import EXPANSION_SHARE, JOINT, RADIUS_SHARE, TEMPERATURE_SD_K
from tankcal.methods.liquid.runs import CHECK

_EPOCH = datetime.datetime(2000, 1, 1)


@dataclass(frozen=True)
class Meter:
    """One meter according to its certificate: true volume = factor x indicated volume.

    The standard deviation of a batch v is sqrt((repeatability v)^2 + fixed_m3^2).

    Attributes
    ----------
    name : str
        Name of its section in meters.toml.
    factor : float
    u_factor : float
        Relative standard uncertainty of the factor.
    repeatability : float
        Standard deviation of a batch, relative to its volume.
    fixed_m3 : float
        Constant part of the standard deviation of a batch.
    certificate, prover : str
        Printed if given, else "".
    flow_min_m3_h, flow_max_m3_h : float or None
        Range of flow rates of the proving.
    factor_after : float or None
        Factor proved after the calibration; None: not proved again.
    row : int or None
        Row of its section in the input, for messages.
    """

    name: str
    factor: float
    u_factor: float
    repeatability: float
    fixed_m3: float = 0.0
    certificate: str = ""
    prover: str = ""
    flow_min_m3_h: float | None = None
    flow_max_m3_h: float | None = None
    factor_after: float | None = None
    row: int | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Metering:
    """All runs of a job, n rows in the order of liquid.csv, in SI; nan: not given.

    The rows of one run are consecutive, except for rows that are not used. The first row of a run
    has volume 0 and is its start.

    Attributes
    ----------
    row : ndarray of int, shape (n,)
        Row of the input, for messages.
    run, meter : tuple of str, length n
    volume_m3 : ndarray, shape (n,)
        Indicated volume since the row above: positive when filled, negative when emptied, 0 at the
        start of a run.
    dip_m : ndarray, shape (n,)
        Dip as read; nan only at the start of a run: the tank was empty and dry.
    s_dip_m : ndarray, shape (n,)
        Standard deviation of the dip, always given; 0 if the tank was empty and dry.
    s_volume_m3 : ndarray, shape (n,)
        Standard deviation of the batch, which replaces that of the meter; nan: by the meter.
    meter_c, tank_c, shell_c : ndarray, shape (n,)
        Temperatures of the liquid at the meter and in the tank and of the shell, degrees Celsius;
        nan: no correction.
    flow_m3_h : ndarray, shape (n,)
    time : tuple, length n
        Times in ISO format, or None.
    used : ndarray of bool, shape (n,)
        False: the *dip* of the row is not used; its volume still entered the tank.
    note : tuple, length n
    meters : dict
        {name: Meter} of the meters in use.
    density_kg_m3 : float
        Density of the calibrating liquid at density_c.
    density_c : float
    expansion_per_k : float
        Cubic thermal expansion of the liquid, 1/K.
    u_density_kg_m3 : float
    u_dip_zero_m : float
        Standard uncertainty of the common error of all dips.
    flex_sd_m3_per_m : float
        Prior standard deviation of the flexing of the bottom, m3 per metre of head.
    run_sd : float or None
        Relative standard deviation of the run effect; None: estimated, from two runs or more.
    certified : {"joint", "liquid", "geometry"}
        Table to be printed.
    u_expansion_per_k : float
        Standard uncertainty of expansion_per_k.
    u_temperature_c : float
        Standard deviation of one temperature.
    u_radius_m : float or None
        Prior standard deviation of the radius of each course about half the nominal diameter, for a
        vertical tank calibrated with liquid alone; None: without a nominal diameter.
    file : str
        File of the rows, for messages.
    meters_file : str
    """

    row: np.ndarray
    run: tuple[str, ...]
    meter: tuple[str, ...]
    volume_m3: np.ndarray
    dip_m: np.ndarray
    s_dip_m: np.ndarray
    s_volume_m3: np.ndarray
    meter_c: np.ndarray
    tank_c: np.ndarray
    shell_c: np.ndarray
    flow_m3_h: np.ndarray
    time: tuple[str | None, ...]
    used: np.ndarray
    note: tuple[str | None, ...]
    meters: dict[str, Meter]
    density_kg_m3: float
    density_c: float
    expansion_per_k: float
    u_density_kg_m3: float
    u_dip_zero_m: float
    flex_sd_m3_per_m: float
    run_sd: float | None = None
    certified: str = "joint"
    u_expansion_per_k: float = 0.0
    u_temperature_c: float = 0.0
    u_radius_m: float | None = None
    file: str = field(default="liquid.csv", compare=False)
    meters_file: str = field(default="meters.toml", compare=False)

    def __len__(self):
        """Number of rows."""
        return len(self.row)

    @property
    def runs(self):
        """{name of the run: indices of its rows, in order}."""
        places = {}
        for place, run in enumerate(self.run):
            places.setdefault(run, []).append(place)
        return {run: np.array(rows) for run, rows in places.items()}


def make_metering(values, tables, registers, raw):
    """Build `Metering` from the values, tables and registers of a job without problems."""
    table, given = tables["liquid"], values["liquid"]
    rows, meters = raw.registers["meters"].rows, registers["meters"]
    names = tuple(meters_read(table, meters))
    dips = table.numbers("dip_m")
    default_sd = np.nan if given["s_dip_mm"] is None else given["s_dip_mm"]
    # A start without a dip was empty and dry, and has no uncertainty.
    sds = table.numbers("s_dip_mm")
    sds = np.where(np.isnan(dips), 0.0, np.where(np.isnan(sds), default_sd, sds))
    return Metering(
        row=np.array(table.rows),
        run=tuple(table.of("run")),
        meter=names,
        volume_m3=table.numbers("volume_m3"),
        dip_m=dips,
        s_dip_m=sds / 1000,
        s_volume_m3=table.numbers("s_volume_l") / 1000,
        meter_c=table.numbers("meter_temperature_c"),
        tank_c=table.numbers("tank_temperature_c"),
        shell_c=table.numbers("shell_temperature_c"),
        flow_m3_h=table.numbers("flow_m3_h"),
        time=tuple(map(_moment, table.of("time"))),
        used=np.array([use != CHECK for use in table.of("use")]),
        note=tuple(table.of("note")),
        meters={name: _meter(name, meters[name], rows.get(name)) for name in dict.fromkeys(names)},
        **_settings(given, values),
        file=table.file,
        meters_file=raw.file_of("meters"),
    )


def _settings(given, values):
    """Keys of [liquid] in SI, with defaults for blank keys."""
    expansion, diameter = given["expansion_per_k"], values["tank"]["nominal_diameter_m"]
    u_expansion = given["u_expansion_per_k"]
    u_radius = given["u_radius_mm"]
    if u_radius is None:
        u_radius = None if diameter is None else RADIUS_SHARE * diameter / 2 * 1000
    return {
        "density_kg_m3": given["density_kg_m3"],
        "density_c": given["density_temperature_c"],
        "expansion_per_k": expansion,
        "u_density_kg_m3": given["u_density_kg_m3"],
        "u_expansion_per_k": EXPANSION_SHARE * expansion if u_expansion is None else u_expansion,
        "u_temperature_c": _or_default(given["u_temperature_c"], TEMPERATURE_SD_K),
        "u_dip_zero_m": given["u_dip_zero_mm"] / 1000,
        "flex_sd_m3_per_m": _or_default(given["bottom_flex_m3_per_m"], 0.0),
        "run_sd": None if given["run_ppm"] is None else given["run_ppm"] / 1e6,
        "u_radius_m": None if u_radius is None else u_radius / 1000,
        "certified": given["table"] or JOINT,
    }


def _or_default(value, default):
    return default if value is None else value


def _meter(name, given, row):
    u_factor = given["u_factor_ppm"] / (given["k"] or 1.0) / 1e6
    return structure(Meter, given, name=name, u_factor=u_factor, row=row)


def _moment(seconds):
    """Time in ISO format from seconds since 2000."""
    return None if seconds is None else (_EPOCH + datetime.timedelta(seconds=seconds)).isoformat()
