"""Common part of all simulated surveys: random errors, declared values and the files of a job."""

import datetime
from dataclasses import dataclass, field

import numpy as np

from tankcal.products.intercomparison.tank import REFERENCE_C
from tankcal.units import FULL_TURN

NOMINAL_E_GPA, U_E_GPA = 206.0, 2.0  # declared Young's modulus and its standard uncertainty
NOMINAL_EXPANSION, U_EXPANSION = 1.15e-5, 4e-7  # declared thermal expansion and its u, 1/K
# Standard uncertainties: plate thickness, paint, height of a course, dip plate, shell temperature.
U_PLATE_M, U_PAINT_M, U_COURSE_M, U_ZERO_M, U_SHELL_K = 1.5e-4, 5e-5, 1e-3, 1e-3, 1.0
# Numbers of bottom points on rings round the middle, and standard deviation of their levelling.
FLOOR_POINTS, FLOOR_SD_M = (4, 8, 12, 16, 20), 1.5e-3
FITTING_PART = 0.02  # relative standard uncertainty of the volume of deadwood
STEP_M = 0.01  # height step of the requested table


@dataclass
class Chance:
    """Random errors of a simulated survey; with size 0 the readings have no errors."""

    rng: np.random.Generator
    size: float = 1.0

    def normal(self, sd, shape=None):
        """Normal errors with standard deviation `sd`."""
        return self.size * sd * self.rng.normal(size=shape)

    def declared(self, sd, digits=2):
        """Declared value of a standard deviation: exact in half of the cases, else 15 % off."""
        factor = np.exp(0.15 * self.rng.normal()) if self.rng.uniform() < 0.5 else 1.0
        return float(f"{sd * (factor if self.size else 1.0):.{digits}g}")

    def blunders(self, count, share):
        """Indices (k,) of the readings with a gross error; `share` is their expected share."""
        if not self.size:
            return np.empty(0, dtype=int)
        return np.flatnonzero(self.rng.uniform(size=count) < share)


@dataclass
class Parts:
    """Content of the files of a job.

    Attributes
    ----------
    settings : dict
        Settings of job.toml, {"section.key": value}.
    tables : dict
        CSV files, {name: [headings, row, ...]}.
    registers : dict
        Other TOML files, such as {"instruments": {name: {key: value}}}.
    files : dict
        Other files, {path: bytes}.
    """

    settings: dict
    tables: dict = field(default_factory=dict)
    registers: dict = field(default_factory=dict)
    files: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Site:
    """A tank during a survey.

    Attributes
    ----------
    tank : Tank
        The true tank.
    chance : Chance
        Random errors of the survey.
    outside : bool
        Whether the survey is from outside.
    shell_c : float
        True temperature of the shell.
    frame_m : ndarray, shape (3,)
        Foot of the axis in the coordinate system of the survey.
    zero_m : float
        Levelled height of the dip plate above the foot of the shell.
    parts : Parts
        Files of the job.
    inputs : list
        Rows of uncertainty.csv.
    """

    tank: object
    chance: Chance
    outside: bool
    shell_c: float
    frame_m: np.ndarray
    zero_m: float
    parts: Parts
    inputs: list

    @property
    def expansion_factor(self):
        """Factor of all lengths by thermal expansion, relative to the reference temperature."""
        return self.tank.expansion_factor(self.shell_c)

    def places(self, azimuth, z, off_m=0.0, outside=None):
        """True points (n, 3) of the expanded wall in the coordinate system of the survey, m.

        Parameters
        ----------
        azimuth, z : array_like, shape (n,)
            Azimuths, rad, and heights of the tank at the reference temperature, m.
        off_m : float or array_like, shape (n,)
            Distance outwards from the wall, m.
        outside : bool, optional
            Whether the points are on the outside; by default as in the survey.
        """
        outside = self.outside if outside is None else outside
        cool = self.tank.places_m(azimuth, z, 0.0, outside)
        if np.any(off_m):
            ray = np.column_stack([np.sin(azimuth), np.cos(azimuth), np.zeros(len(cool))])
            # The distance itself does not expand, so it is divided by the factor applied below.
            cool = cool + np.asarray(off_m)[..., None] * ray / self.expansion_factor
        return self.frame_m + self.expansion_factor * cool

    def level(self, z):
        """Observed heights above the dip plate, for heights z at the reference temperature, m."""
        return self.expansion_factor * np.asarray(z) - self.zero_m

    def add_input(self, name, u, unit, note):
        """Add a row to uncertainty.csv."""
        self.inputs.append([name, u, unit, note])


def observe_site(tank, chance, asked, *, outside, frame_m=(0.0, 0.0, 0.0)):
    """Simulate the common observations of a survey: courses, plates, bottom and deadwood.

    Parameters
    ----------
    tank : Tank
        The true tank.
    chance : Chance
        Random errors.
    asked : Asked
        Requested conditions of the capacity table.
    outside : bool
        Whether the survey is from outside.
    frame_m : sequence of 3 float
        Foot of the axis in the coordinate system of the survey, m.

    Returns
    -------
    Site
    """
    shell_c = float(np.round(chance.rng.uniform(12.0, 32.0), 1))
    read_c = round(shell_c + float(chance.normal(U_SHELL_K)), 1)
    frame = np.asarray(frame_m, float)
    f = tank.expansion_factor(shell_c)
    zero = f * tank.plate_z_m + float(chance.normal(U_ZERO_M))
    parts = Parts(_settings(tank, asked, outside, read_c, frame, zero))
    site = Site(tank, chance, outside, shell_c, frame, zero, parts, [])
    parts.tables["courses"] = _courses(site)
    parts.tables["bottom"] = _bottom(site)
    parts.tables["deadwood"] = _fittings(site)
    head = asked.density_kg_m3 > 0
    site.add_input("datum", 1000 * U_ZERO_M, "mm", "levelling of the dip plate")
    site.add_input("course_heights", 1000 * U_COURSE_M, "mm", "tape along the shell")
    site.add_input("shell_temperature", U_SHELL_K, "K", "contact thermometer")
    site.add_input("expansion", U_EXPANSION, "1/K", "handbook")
    if outside or head:
        site.add_input("plate_thickness", 1000 * U_PLATE_M, "mm", "ultrasonic gauge")
    if outside:
        site.add_input("paint", 1000 * U_PAINT_M, "mm", "coating gauge")
    if head:
        site.add_input("youngs_modulus", U_E_GPA, "GPa", "handbook")
    return site


def finish(site):
    """`Parts` of a site, with its uncertainty.csv."""
    site.parts.tables["uncertainty"] = [["input", "u", "unit", "note"], *site.inputs]
    return site.parts


def _settings(tank, asked, outside, read_c, frame, zero):
    """Settings of job.toml."""
    return {
        "tank.id": tank.name,
        "tank.kind": "vertical",
        "tank.nominal_diameter_m": round(2 * tank.radius_m, 2),
        "tank.nominal_height_m": round(tank.height_m, 1),
        "survey.side": "outside" if outside else "inside",
        "survey.date": datetime.date(2026, 5, 4),
        "survey.shell_temperature_c": read_c,
        "datum.bottom_z_m": float(frame[2]),
        "datum.dip_plate_z_m": round(float(frame[2] + zero), 5),
        "table.step_m": STEP_M,
        "table.reference_temperature_c": asked.reference_temperature_c,
        "table.liquid_density_kg_m3": asked.density_kg_m3,
        "material.e_gpa": NOMINAL_E_GPA,
        "material.expansion_per_k": NOMINAL_EXPANSION,
        "certificate.notice": "SIMULATION",
        "certificate.condition_of_tank": "No tank: a simulated survey of a comparison of software",
    }


def _courses(site):
    """Rows of courses.csv; plates and paint have one common error each for all courses."""
    tank, chance = site.tank, site.chance
    along = np.hypot(1, np.hypot(*tank.lean))
    heights = tank.courses_m * np.array(along) + chance.normal(U_COURSE_M, len(tank.courses_m))
    plate, paint = chance.normal(U_PLATE_M), chance.normal(U_PAINT_M)
    rows = [["course", "height_m", "thickness_mm", "paint_mm"][: 4 if site.outside else 3]]
    for k, (height, true) in enumerate(zip(heights, tank.plates_m, strict=True), 1):
        measured = [round(1000 * float(value), 3) for value in (true + plate, tank.paint_m + paint)]
        rows.append([str(k), round(float(height), 5), *measured[: len(rows[0]) - 2]])
    return rows


def _bottom(site):
    """Rows of bottom.csv: levelled points in the middle, on rings and close to the wall."""
    tank, chance = site.tank, site.chance
    rows = [["x_m", "y_m", "z_m", "s_mm"]]
    places = [(0.0, 0.0)]
    for ring, count in enumerate(FLOOR_POINTS, 1):
        r = tank.radius_m * min(ring / len(FLOOR_POINTS), 0.985)
        turn = FULL_TURN * (np.arange(count) + 0.5 * (ring % 2)) / count
        places += list(zip(r * np.sin(turn), r * np.cos(turn), strict=True))
    x, y = np.array(places).T
    z = tank.floor.height_m(x, y, tank.radius_m)
    observed = site.frame_m + site.expansion_factor * np.column_stack([x, y, z])
    observed[:, 2] += chance.normal(FLOOR_SD_M, len(observed))
    return rows + [[*np.round(point, 5).tolist(), 1000 * FLOOR_SD_M] for point in observed]


def _fittings(site):
    """Rows of deadwood.csv: dips, volumes from drawings and their u."""
    tank, chance = site.tank, site.chance
    rows = [["name", "bottom_m", "top_m", "volume_m3", "u_m3"]]
    for fitting in tank.fittings:
        u = max(FITTING_PART * abs(fitting.volume_m3), 1e-3)
        volume = fitting.volume_m3 + chance.normal(u)
        low, high = np.round(np.array([fitting.low_m, fitting.high_m]) - tank.plate_z_m, 4)
        rows.append([fitting.name, float(low), float(high), round(float(volume), 5), round(u, 5)])
    return rows


@dataclass(frozen=True)
class TableRequest:
    """Requested heights and conditions of a capacity table.

    Attributes
    ----------
    dips_m : tuple of float
        Heights above the dip plate.
    density_kg_m3 : float
        Density of the liquid; 0 for an empty shell.
    reference_temperature_c : float
        Reference temperature of the shell.
    """

    dips_m: tuple
    density_kg_m3: float = 0.0
    reference_temperature_c: float = REFERENCE_C


def request_table(tank, density_kg_m3):
    """`TableRequest` of a tank: every half metre, and pairs for deliveries of 1 cm, 10 cm and 2 m.

    The deliveries of 1 cm and 10 cm are in the middle of every course and across every weld between
    courses, where a table computed by sections changes its slope.
    """
    lowest = tank.lowest_level_m - tank.plate_z_m
    top = np.floor(100 * (tank.height_m - tank.plate_z_m - 0.02)) / 100
    first = max(np.ceil(100 * (lowest + 0.05)) / 100, 0.3)
    dips = {first, top, *np.arange(0.5, top, 0.5)}
    joints = tank.joints_m - tank.plate_z_m
    places = [*(joints[:-1] + joints[1:]) / 2, *(joints[1:-1] - 0.05)]
    for place in places:
        low = np.round(place, 2)
        dips |= {low, low + 0.01, low + 0.1}
    rounded = sorted({round(float(dip), 2) for dip in dips if first - 1e-9 <= dip <= top + 1e-9})
    return TableRequest(tuple(rounded), density_kg_m3)
