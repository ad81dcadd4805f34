"""Metered filling of a tank: its meters, and each step of its runs."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Meter:
    """One meter, as its certificate says: true volume = factor x indicated volume.

    The standard deviation of a batch v is sqrt((repeatability v)^2 + fixed_m3^2).

    Attributes
    ----------
    name : str
        Of its section in meters.toml.
    factor : float
    u_factor : float
        Standard uncertainty of the factor, relative.
    repeatability : float
        Standard deviation of a batch, relative to its volume.
    fixed_m3 : float
        Standard deviation of a batch that does not grow with it.
    certificate, prover : str
        Printed when given, else "".
    flow_min_m3_h, flow_max_m3_h : float or None
        Range of flow that it was proved for.
    factor_after : float or None
        Proved again after the calibration; None: it was not.
    row : int or None
        Of its section in the input, for messages.
    """

    name: str
    factor: float
    u_factor: float
    repeatability: float
    fixed_m3: float
    certificate: str = ""
    prover: str = ""
    flow_min_m3_h: float | None = None
    flow_max_m3_h: float | None = None
    factor_after: float | None = None
    row: int | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Metering:
    """All runs of a job, n rows in the order of liquid.csv, in SI; nan: not given.

    Rows of one run follow one another, but for rows that are not used; the first of a run has
    volume 0 and is its start.

    Attributes
    ----------
    row : ndarray of int, shape (n,)
        Row of the input, for messages.
    run, meter : tuple of str, length n
    volume_m3 : ndarray, shape (n,)
        Indicated, since the row above: positive when filled, negative when emptied, 0 at the start
        of a run.
    dip_m : ndarray, shape (n,)
        As read; nan only at the start of a run: the tank was empty and dry.
    s_dip_m : ndarray, shape (n,)
        Standard deviation of the dip, always given; 0 where the tank was empty and dry.
    s_volume_m3 : ndarray, shape (n,)
        Of the batch, in place of what the meter says of it; nan: by the meter.
    meter_c, tank_c, shell_c : ndarray, shape (n,)
        Temperatures of the liquid at the meter and in the tank and of the shell, degrees Celsius;
        nan: no correction.
    flow_m3_h : ndarray, shape (n,)
    time : tuple, length n
        ISO texts or None.
    used : ndarray of bool, shape (n,)
        False: the *dip* of the row is not used; its volume still went in.
    note : tuple, length n
    meters : dict
        {name: Meter}, those of meters.toml that are read.
    density_kg_m3 : float
        Of the calibrating liquid at density_c.
    density_c : float
    expansion_per_k : float
        Of the liquid's volume, 1/K.
    u_density_kg_m3 : float
    u_dip_zero_m : float
        Standard uncertainty of what all dips have in common.
    flex_sd_m3_per_m : float
        Standard deviation of the prior of the bottom's flexing, m3 for each metre of head.
    run_sd : float or None
        Relative standard deviation of the run effect; None: estimated, from two runs or more.
    certified : {"joint", "liquid", "geometry"}
        The table that is printed.
    u_expansion_per_k : float
        Standard uncertainty of expansion_per_k.
    u_temperature_c : float
        Standard deviation of one temperature.
    u_radius_m : float or None
        Of an upright tank that liquid alone tells: standard deviation of each course's radius from
        half the nominal diameter; None: without a nominal diameter.
    file : str
        Of the rows, for messages.
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
        """{name of the run: places of its rows, in order}."""
        places = {}
        for place, run in enumerate(self.run):
            places.setdefault(run, []).append(place)
        return {run: np.array(rows) for run, rows in places.items()}
