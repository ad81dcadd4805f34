"""Simulated surveys of a tank by each method, as the files of a job.

Simulated surveys by points of the wall: read by a total station, or already adjusted.

The total station reads without a reflector, in the tank off its middle. Adjusted points have a
common scale and offset error.

Simulated strapping of every course, or of the first course with optical reference lines.

The tape follows the convex hull of the outside.

    parts = METHODS["tape"](tank, Chance(rng), asked)

Each method takes the true `Tank`, the source of random errors (`Chance`) and the requested
conditions of the capacity table (`Asked`). It returns the `Parts` of a job.

A simulation adds errors of the instruments to the true tank, and declares their standard
uncertainties. The formulas are deliberately independent of `tankcal.survey` and `tankcal.geometry`,
so that an error there does not affect the true values.
"""

import datetime
import struct
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from tankcal.products.intercomparison.site import finish, observe_site
from tankcal.units import FULL_TURN

# Standard uncertainties of scale, offset and incidence bias; standard deviation of a distance.
U_SCALE, U_OFFSET_M, U_BIAS_M, HIT_SD_M, ARCSEC = 10e-6, 5e-4, 1e-3, 1.2e-3, 1 / 206265
HIT_SD_RAD = 5 * ARCSEC  # standard deviation of an angle
PARTS, COUNTS = (0.2, 0.8), (20, 24, 30)  # levels as shares of a course, points per level
TOOL_HEIGHT_M, OFF_PART = 1.6, 0.15  # height, and largest offset from the middle over the radius
TARGETS, TIMES = 3, ("2026-05-04T09:00", "2026-05-04T10:15")  # number and times of control targets
SPOILT, LADDER_M = 0.01, (0.06, 0.15)  # share of points on a ladder, and its distance
MOST_HITS = 2400  # largest number of points
ADJUSTED_U_SCALE, ADJUSTED_U_OFFSET_M = 15e-6, 3e-4  # standard uncertainties of scale and offset
FRAME_M = (512.0, 347.0, 21.0)  # foot of the axis in the coordinate system of the survey
ADJUSTED_PARTS = {
    2: (0.2, 0.8),
    3: (0.15, 0.5, 0.85),
}  # levels as shares of a course, by number of rings
ADJUSTED_SPOILT, FAR_M = 0.005, (0.015, 0.04)  # share and size of gross errors
PIPE_POINTS, PIPE_M = 4, (0.07, 0.12)  # number of points on a fitting, and distance from the wall


def observe_hits(tank, chance, asked):
    """Simulate one set-up with two levels of each course.

    The ground mark of the set-up is the origin, and its horizontal circle defines the axes.
    """
    rng = chance.rng
    offset = OFF_PART * tank.radius_m * rng.uniform(-1, 1, 2)
    mark = np.array([*offset, float(tank.floor.height_m(*offset, tank.radius_m))])
    site = observe_site(tank, chance, asked, outside=False, frame_m=-np.round(mark, 3))
    height = float(np.round(TOOL_HEIGHT_M + 0.05 * rng.normal(), 3))
    station = np.array([0.0, 0.0, height])
    tool = Tool(
        chance.normal(U_SCALE), chance.normal(U_OFFSET_M), chance.normal(U_BIAS_M),
        HIT_SD_M, HIT_SD_RAD,
    )  # fmt: skip
    course, aims = _aims(rng, site)
    readings = read_wall(chance, site, station, aims, tool)
    spoilt = chance.blunders(len(readings), SPOILT)
    readings[spoilt, 2] -= rng.uniform(*LADDER_M, len(spoilt))
    parts = site.parts
    parts.tables["wall_hits"] = [["setup", "course", "direction_deg", "zenith_deg", "distance_m",
                                  "time"]]  # fmt: skip
    parts.tables["wall_hits"] += [
        ["I", str(number + 1), *_angles(reading), round(float(reading[2]), 5), TIMES[0]]
        for number, reading in zip(course, readings, strict=True)
    ]
    parts.tables["control_readings"] = _control(site, station, tool)
    parts.tables["setups"] = [
        ["setup", "station", "instrument", "instrument_height_m"],
        ["I", "SI", "TS-1", height],
    ]
    parts.registers["instruments"] = {
        "TS-1": {
            "kind": "total_station",
            "certificate": "simulated",
            "u_scale_ppm": 1e6 * U_SCALE,
            "u_offset_mm": 1000 * U_OFFSET_M,
            "u_incidence_mm": 1000 * U_BIAS_M,
            "s_mm": chance.declared(1000 * HIT_SD_M),
            "s_arcsec": 5.0,
        }
    }
    return finish(site)


def _aims(rng, site):
    """Course indices and aimed points, equally spaced from a random azimuth at each level."""
    tank = site.tank
    count = min(int(rng.choice(COUNTS)), MOST_HITS // (2 * len(tank.courses_m)))
    course, azimuth, z = [], [], []
    for k, (low, height) in enumerate(zip(tank.joints_m[:-1], tank.courses_m, strict=True)):
        for part in PARTS:
            azimuth.append(FULL_TURN * (np.arange(count) + rng.uniform()) / count)
            z.append(np.full(count, low + part * height))
            course += [k] * count
    azimuth, z = np.concatenate(azimuth), np.concatenate(z)
    return course, site.places(azimuth, z)


def _control(site, station, tool):
    """Rows of readings to three targets on the wall, before and after the wall points."""
    rows = [["setup", "target", "direction_deg", "zenith_deg", "distance_m", "time"]]
    tank, chance = site.tank, site.chance
    azimuth = FULL_TURN * (np.arange(TARGETS) + 0.2) / TARGETS
    places = site.places(azimuth, np.full(TARGETS, min(1.5, 0.4 * tank.height_m)), -0.002)
    target_tool = Tool(tool.scale, tool.offset_m, 0.0, 0.5e-3, 3 * ARCSEC)
    for time in TIMES:
        for k, reading in enumerate(read_targets(chance, station, places, target_tool)):
            rows.append(["I", f"K{k + 1}", *_angles(reading), round(float(reading[2]), 5), time])
    return rows


def _angles(reading):
    """Direction and zenith angle of a reading in degrees."""
    return [round(float(angle), 6) for angle in np.degrees(reading[:2])]


@dataclass(frozen=True)
class Tool:
    """Errors of an instrument.

    Attributes
    ----------
    scale, offset_m : float
        Scale error and offset of distances.
    bias_m : float
        Additional distance to the wall at 60 degrees of incidence, compared with 0 degrees.
    sd_m, sd_rad : float
        Standard deviations of distances and angles.
    """

    scale: float = 0.0
    offset_m: float = 0.0
    bias_m: float = 0.0
    sd_m: float = 0.0
    sd_rad: float = 0.0


def angles_of(away, zero=0.0):
    """Directions (n,), clockwise from `zero`, and zenith angles (n,) of vectors (n, 3), rad."""
    direction = np.arctan2(away[:, 0], away[:, 1]) - zero
    return direction % (2 * np.pi), np.arctan2(np.hypot(away[:, 0], away[:, 1]), away[:, 2])


def rays_of(direction, zenith):
    """Unit vectors (n, 3) of directions, clockwise from +y, and zenith angles, rad."""
    level = np.sin(zenith)
    return np.column_stack([level * np.sin(direction), level * np.cos(direction), np.cos(zenith)])


def read_targets(chance, station, targets, tool, zero=0.0):
    """Simulate direction, zenith angle and distance (n, 3) to targets.

    Parameters
    ----------
    chance : Chance
        Random errors.
    station : ndarray, shape (3,)
        Place of the instrument.
    targets : array_like, shape (n, 3)
        Places of the targets.
    tool : Tool
        Errors of the instrument.
    zero : float
        Azimuth of the zero of the horizontal circle, rad.
    """
    vectors = np.asarray(targets, float) - station
    direction, zenith = angles_of(vectors, zero)
    length = np.linalg.norm(vectors, axis=1) * (1 + tool.scale) + tool.offset_m
    readings = np.column_stack([direction, zenith, length])
    return readings + chance.normal(1.0, readings.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]


def incidence(tank, places, rays):
    """Cosines (n,) of the incidence of rays (n, 3) on the wall at places (n, 3).

    The places are those of the tank at the reference temperature.
    """
    radial_vector = places[:, :2] - tank.axis_m(places[:, 2])
    normal = np.column_stack([radial_vector, -(radial_vector @ tank.lean)])
    return np.abs(np.sum(normal * rays, axis=1)) / np.linalg.norm(normal, axis=1)


def read_wall(chance, site, station, aims, tool, zero=0.0):
    """Simulate direction, zenith angle and distance (n, 3) to the expanded wall from inside.

    Parameters
    ----------
    chance : Chance
        Random errors.
    site : Site
        Tank during the survey.
    station : array_like, shape (3,)
        Place of the instrument in the coordinate system of the survey.
    aims : array_like, shape (n, 3)
        Points on the lines of sight, in the same system.
    tool : Tool
        Errors of the instrument.
    zero : float
        Azimuth of the zero of the horizontal circle, rad.
    """
    tank, f = site.tank, site.expansion_factor
    vectors = np.asarray(aims, float) - station
    rays = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    origin = (np.asarray(station, float) - site.frame_m) / f
    cool = tank.ranges_m(origin, rays)
    cosine = incidence(tank, origin + cool[:, None] * rays, rays)
    direction, zenith = angles_of(vectors, zero)
    length = f * cool * (1 + tool.scale) + tool.offset_m + tool.bias_m * (1 / cosine - 1)
    readings = np.column_stack([direction, zenith, length])
    return readings + chance.normal(1.0, readings.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]


def observe_points(tank, chance, asked):
    """Simulate rings of points in each course, from inside or outside."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=rng.uniform() < 0.5, frame_m=FRAME_M)
    azimuth, z, names = _layout(rng, tank)
    sd = rng.uniform(0.7e-3, 1.5e-3)
    scale, offset = chance.normal(ADJUSTED_U_SCALE), chance.normal(ADJUSTED_U_OFFSET_M)
    offsets = np.full(len(z), float(offset))
    spoilt = chance.blunders(len(z), ADJUSTED_SPOILT)
    offsets[spoilt] += rng.choice([-1, 1], len(spoilt)) * rng.uniform(*FAR_M, len(spoilt))
    if chance.size:
        pipe = rng.integers(len(z), size=PIPE_POINTS)
        offsets[pipe] = (1 if site.outside else -1) * rng.uniform(*PIPE_M, PIPE_POINTS)
    observed = site.places(azimuth, z, offsets)
    observed = (
        site.frame_m + (1 + scale) * (observed - site.frame_m) + chance.normal(sd, observed.shape)
    )
    declared_sd = chance.declared(1000 * sd)
    rows = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    rows += [
        [name, *np.round(point, 5).tolist(), declared_sd, declared_sd, declared_sd]
        for name, point in zip(names, observed, strict=True)
    ]
    site.parts.tables["points"] = rows
    site.add_input("scale", 1e6 * ADJUSTED_U_SCALE, "ppm", "certificate of the instrument")
    site.add_input("offset", 1000 * ADJUSTED_U_OFFSET_M, "mm", "reflectorless ranging, certificate")
    return finish(site)


def _layout(rng, tank):
    """Azimuths, heights and names of rings of nearly equally spaced points."""
    count, rings = int(rng.choice([24, 32, 40])), int(rng.choice([2, 3]))
    azimuth, z, names = [], [], []
    for course, (low, high) in enumerate(zip(tank.joints_m[:-1], tank.joints_m[1:], strict=True)):
        for ring, part in enumerate(ADJUSTED_PARTS[rings]):
            turn = FULL_TURN * (np.arange(count) + rng.uniform() + 0.2 * rng.uniform(-1, 1, count))
            azimuth.append(turn / count)
            z.append(low + (high - low) * (part + 0.03 * rng.uniform(-1, 1, count)))
            names += [f"C{course + 1}R{ring + 1}P{k + 1}" for k in range(count)]
    return np.concatenate(azimuth), np.concatenate(z), names


PHOTOGRAPH_FRAME_M = (100.0, 200.0, 50.0)  # foot of the axis in the coordinate system of the survey
FORMAT_MM, C_MM = (36.0, 24.0), 20.0  # size of the image, nominal principal distance
# Standard deviations of the interior orientation about its nominal values.
CAMERA_SD = {"c": 0.05, "x0": 0.03, "y0": 0.03, "K1": 3e-5, "K2": 3e-8, "P1": 2e-6, "P2": 2e-6}
# Standard deviations of image and control coordinates, standard uncertainty of the scale.
IMAGE_SD_MM, CONTROL_SD_M, PHOTOGRAPH_U_SCALE = 6e-4, 1e-3, 10e-6
TARGET_M, U_TARGET_M = 1e-3, 1e-4  # distance from the wall to the centre of a target, and its u
# Generatrices, levels as shares of a course, and approximate number of control points.
GENERATRICES, PHOTOGRAPH_PARTS, CONTROL = 24, (0.2, 0.8), 12
STATIONS, HEIGHTS_M = 18, (1.5, 4.0)  # number of photographs, alternating heights of the camera
GRAZING = 0.3  # cosine of the incidence below which a target is not measured
FEWEST_RAYS = 3  # least number of photographs of a target
PHOTOGRAPH_SPOILT, FAR_MM = 0.003, (0.01, 0.05)  # share and size of gross errors in the image


def observe_photographs(tank, chance, asked):
    """Simulate photographs of rings of targets, with control points by a total station."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=True, frame_m=PHOTOGRAPH_FRAME_M)
    names, azimuth, z = _targets(rng, tank)
    thick = TARGET_M + chance.normal(U_TARGET_M)
    places = site.places(azimuth, z, np.full(len(z), float(thick)))
    interior = {"c": C_MM, "x0": 0.0, "y0": 0.0, "K1": 0.0, "K2": 0.0, "P1": 0.0, "P2": 0.0}
    interior = {key: value + CAMERA_SD[key] * rng.normal() for key, value in interior.items()}
    declared_sd_um = chance.declared(1000 * IMAGE_SD_MM)
    rows, rays = [["photo", "point", "x_mm", "y_mm"]], np.zeros(len(names), dtype=int)
    photos = [["photo", "camera"]]
    for number, (centre, rotation) in enumerate(_stations(rng, site)):
        image, is_seen = photograph(places, site, centre, rotation, interior)
        image = image + chance.normal(IMAGE_SD_MM, image.shape)
        spoilt = chance.blunders(len(image), PHOTOGRAPH_SPOILT)
        image[spoilt, 0] += rng.uniform(*FAR_MM, len(spoilt))
        photos.append([f"S{number + 1}", "C1"])
        rays += is_seen
        for k in np.flatnonzero(is_seen):
            xy = [round(float(item), 5 if chance.size else 8) for item in image[k]]
            rows.append([f"S{number + 1}", names[k], *xy])
    poor = {names[k] for k in np.flatnonzero(rays < FEWEST_RAYS)}
    tables = site.parts.tables
    tables["image_points"] = [rows[0], *(item for item in rows[1:] if item[1] not in poor)]
    tables["photos"] = photos
    tables["targets"] = [["point", "section", "generatrix", "z_m", "offset_mm"]]
    tables["targets"] += [
        [name, *name[1:].split("-"), round(float(position[2]), 2), 1000 * TARGET_M]
        for name, position in zip(names, places, strict=True)
        if name not in poor
    ]
    tables["control"] = _control_photograph(site, names, places, poor)
    site.parts.registers["cameras"] = {
        "C1": {
            "format_mm": list(FORMAT_MM),
            "c_mm": C_MM,
            "convention": "distortion_of_ideal",
            "affinity": "b1_b2",
        }
    }
    site.parts.settings |= {"adjustment.datum": "control", "adjustment.image_sd_um": declared_sd_um}
    site.add_input("scale", 1e6 * PHOTOGRAPH_U_SCALE, "ppm", "certificate of the total station")
    site.add_input("offset", 1000 * U_TARGET_M, "mm", "thickness of the targets")
    return finish(site)


def _targets(rng, tank):
    """Names T{section}-{generatrix}, azimuths and heights of targets, two rings per course."""
    names, azimuth, z = [], [], []
    section = 0
    for low, height in zip(tank.joints_m[:-1], tank.courses_m, strict=True):
        for part in PHOTOGRAPH_PARTS:
            section += 1
            for k in range(GENERATRICES):
                names.append(f"T{section}-{k + 1}")
                azimuth.append(FULL_TURN * (k + 0.1 * rng.uniform(-1, 1)) / GENERATRICES)
                z.append(low + height * (part + 0.02 * rng.uniform(-1, 1)))
    return names, np.array(azimuth), np.array(z)


def _stations(rng, site):
    """Yield projection centres and rotations into the image; one of three has a roll of 90 deg."""
    tank = site.tank
    stand_off = max(6.0, 0.9 * tank.height_m)
    for k in range(STATIONS):
        azimuth = FULL_TURN * (k + 0.1 * rng.normal()) / STATIONS
        distance = tank.radius_m + stand_off * rng.uniform(0.9, 1.1)
        height = HEIGHTS_M[k % 2] + 0.1 * rng.normal()
        centre = site.frame_m + [distance * np.sin(azimuth), distance * np.cos(azimuth), height]
        aim = site.frame_m + [*(0.2 * rng.normal(size=2)), 0.5 * tank.height_m]
        roll = 0.03 * rng.normal() + (0.0 if k % 3 else 1.0) * np.pi / 2
        yield centre, camera_rotation(centre, aim, roll)


def camera_rotation(centre, aim, roll):
    """Rotation (3, 3) of a camera aimed at a point, with rows x right, y up and z backwards.

    Parameters
    ----------
    centre, aim : ndarray, shape (3,)
        Projection centre, and the point on the optical axis.
    roll : float
        Rotation about the optical axis, rad.
    """
    back = centre - aim
    back = back / np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    roll_matrix = np.array([[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]])
    return np.vstack([roll_matrix @ np.vstack([right, up]), back])


def photograph(places, site, centre, rotation, interior):
    """Image coordinates of targets, and their visibility.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Targets in the coordinate system of the survey.
    site : Site
        Tank during the survey.
    centre, rotation : ndarray, shapes (3,) and (3, 3)
        Exterior orientation, as in `camera_rotation`.
    interior : dict
        Interior orientation c, x0, y0, K1, K2, P1 and P2, mm.

    Returns
    -------
    ndarray, shape (n, 2)
        Image coordinates, mm.
    ndarray of bool, shape (n,)
        Whether a target is in the image and not hidden by grazing incidence.
    """
    u, v, w = rotation @ (places - centre).T
    ahead = w < -0.5
    w = np.where(ahead, w, -1.0)
    x, y = -interior["c"] * u / w, -interior["c"] * v / w
    r2 = x * x + y * y
    radial = interior["K1"] * r2 + interior["K2"] * r2 * r2
    p1, p2 = interior["P1"], interior["P2"]
    image = np.column_stack([
        interior["x0"] + x * (1 + radial) + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y,
        interior["y0"] + y * (1 + radial) + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y,
    ])  # fmt: skip
    inside = (np.abs(image) < np.array(FORMAT_MM) / 2).all(axis=1)
    radial_vector = (
        places[:, :2] - site.frame_m[:2] - site.tank.axis_m(places[:, 2] - site.frame_m[2])
    )
    back = centre - places
    outwards = np.sum(radial_vector * back[:, :2], axis=1)
    cosine = outwards / np.hypot(*radial_vector.T) / np.linalg.norm(back, axis=1)
    return image, ahead & inside & (cosine > GRAZING)


def _control_photograph(site, names, places, poor):
    """Rows of control points: targets over the whole shell, measured by a total station."""
    chance = site.chance
    scale = chance.normal(PHOTOGRAPH_U_SCALE)
    good = [k for k, name in enumerate(names) if name not in poor]
    chosen = good[:: max(len(good) // CONTROL, 1)]
    observed = site.frame_m + (1 + scale) * (places[chosen] - site.frame_m)
    observed = observed + chance.normal(CONTROL_SD_M, observed.shape)
    sd = [1000 * CONTROL_SD_M] * 3
    rows = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    return rows + [
        [names[k], *np.round(point, 5).tolist(), *sd]
        for k, point in zip(chosen, observed, strict=True)
    ]


LEVELS, REPEATS = (0.2, 0.8), 2  # levels as shares of a course, measurements at a level
# Tape: u of its scale, thermal expansion, 1/K, certified temperature and tension.
TAPE_U_SCALE, TAPE_EXPANSION, TAPE_C, TAPE_N = 12e-6, 1.15e-5, 20.0, 50.0
# Tape: thickness, cross-section, Young's modulus, and standard deviations of laying and reading.
THICK_M, SECTION_MM2, TAPE_E_GPA, LAYING_M, READ_M = 2e-4, 2.5, 206.0, 3e-4, 4e-4
PULL_SD_N = 3.0  # standard deviation of the mean tension round the tank from the reading
LONGEST_STEP_M = 0.004  # largest distance between points of the hull
# Least number of lines, largest arc between them, and levels as shares of a course.
FEWEST, ARC_M, TAPE_PARTS = 8, 3.5, (0.2, 0.8)
COLLIMATION_RAD, STANDS_M = 6 / 206265, 0.3  # collimation error of the plummet, height above foot
OFFSET_READ_M = 5e-4  # standard deviation of an offset
FIRST_COURSE_REPEATS = 3  # number of circumference measurements at a level
CLOSE_M, MOST_STEPS = 1e-9, 60  # last step and number of iterations of `offsets_m`


def girth_m(tank, z):
    """Perimeter of the convex hull of the outside at a height, m, at the reference temperature.

    The difference of length between polygon and curve is corrected as for a circle.
    """
    count = int(FULL_TURN * tank.radius_m / LONGEST_STEP_M)
    azimuth = FULL_TURN * (np.arange(count) + 0.5) / count
    places = tank.places_m(azimuth, np.full(count, float(z)), outside=True)[:, :2]
    half = np.pi / count
    return float(ConvexHull(places - places.mean(axis=0)).area * half / np.sin(half))


def observe_tape(tank, chance, asked):
    """Simulate two circumferences at each of two levels of each course."""
    site = observe_site(tank, chance, asked, outside=True)
    strap(site, range(len(tank.courses_m)))
    # Standard deviation of the radius round the wall, root mean square over the courses, m.
    azimuth = FULL_TURN * np.arange(2048) / 2048
    middles = (tank.joints_m[:-1] + tank.joints_m[1:]) / 2
    form = float(np.sqrt(np.mean([np.var(tank.radii_m(azimuth, z)) for z in middles])))
    site.parts.settings["shell.shape_sd_mm"] = chance.declared(1000 * form, 1)
    return finish(site)


def strap(site, courses, repeats=REPEATS):
    """Add simulated circumferences and the tape to the files of a site.

    Parameters
    ----------
    site : Site
        Tank during the survey.
    courses : iterable of int
        Indices of the courses.
    repeats : int
        Number of measurements at a level.
    """
    tank, chance, parts = site.tank, site.chance, site.parts
    scale, read_sd = chance.normal(TAPE_U_SCALE), chance.declared(1000 * READ_M)
    stiff_n = SECTION_MM2 * 1e-6 * TAPE_E_GPA * 1e9
    rows = [["circumference", "course", "level_m", "reading_m", "s_mm", "tension_n"]]
    for course in courses:
        for part in LEVELS:
            z = tank.joints_m[course] + part * tank.courses_m[course]
            true = site.expansion_factor * girth_m(tank, z) + np.pi * THICK_M
            for _ in range(repeats):
                pull = float(np.round(chance.rng.uniform(45, 60)))
                # True length of a nominal metre: scale, temperature and tension of the tape.
                unit = (1 + scale) * (1 + TAPE_EXPANSION * (site.shell_c - TAPE_C))
                unit *= 1 + (pull + chance.normal(PULL_SD_N) - TAPE_N) / stiff_n
                error = chance.normal(LAYING_M) + chance.normal(READ_M)
                reading = round(float(true / unit + error), 5)
                level = round(float(site.level(z)), 4)
                name = f"{course + 1}-{round(100 * part)}"
                rows.append([name, str(course + 1), level, reading, read_sd, pull])
    parts.tables["circumferences"] = rows
    parts.registers.setdefault("instruments", {})["T-1"] = {
        "kind": "tape",
        "certificate": "simulated",
        "certified_temperature_c": TAPE_C,
        "tension_n": TAPE_N,
        "expansion_per_k": TAPE_EXPANSION,
        "thickness_mm": 1000 * THICK_M,
        "section_mm2": SECTION_MM2,
        "e_gpa": TAPE_E_GPA,
        "u_scale_ppm": 1e6 * TAPE_U_SCALE,
        "laying_mm": 1000 * LAYING_M,
    }


def observe_lines(tank, chance, asked):
    """Simulate offsets from equally spaced lines, on both faces at two levels of each course."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=True)
    strap(site, [0], FIRST_COURSE_REPEATS)
    count = max(FEWEST, 4 * int(np.ceil(FULL_TURN * tank.radius_m / ARC_M / 4)))
    names = [f"L{k + 1}" for k in range(count)]
    azimuth = FULL_TURN * np.arange(count) / count
    stands = rng.uniform(0.15, 0.25, count)
    kappa, read_sd = chance.normal(COLLIMATION_RAD), chance.declared(1000 * OFFSET_READ_M)
    rows = [["line", "course", "level_m", "offset_mm", "s_mm", "face", "reference"]]
    reference = TAPE_PARTS[0] * tank.courses_m[0]
    feet = (
        tank.places_m(azimuth, np.full(count, reference), outside=True)[:, :2]
        * site.expansion_factor
    )
    outwards = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    lines = feet + stands[:, None] * outwards  # places at the temperature of the shell
    for course, (low, height) in enumerate(zip(tank.joints_m[:-1], tank.courses_m, strict=True)):
        for part in TAPE_PARTS:
            z = low + part * height
            offsets = offsets_m(site, lines, outwards, z)
            for face, sign in ((1, 1), (2, -1)):
                tilt_errors = sign * kappa * (z - STANDS_M)
                readings = offsets + tilt_errors + chance.normal(OFFSET_READ_M, count)
                level = round(float(site.level(z)), 4)
                is_reference = "true" if course == 0 and part == TAPE_PARTS[0] else ""
                rows += [
                    [
                        name,
                        str(course + 1),
                        level,
                        round(1000 * offset, 3),
                        read_sd,
                        face,
                        is_reference,
                    ]
                    for name, offset in zip(names, readings.tolist(), strict=True)
                ]
    parts = site.parts
    angles = np.degrees(azimuth).round(6).tolist()
    parts.tables["lines"] = [["line", "azimuth_deg", "side"]]
    parts.tables["lines"] += [
        [name, azimuth_deg, "outside"] for name, azimuth_deg in zip(names, angles, strict=True)
    ]
    parts.tables["offsets"] = rows
    parts.registers["instruments"]["ZL-1"] = {"kind": "plummet", "certificate": "simulated"}
    parts.settings["shell.shape_sd_mm"] = chance.declared(1000 * _shape_sd_of_course_m(tank), 1)
    return finish(site)


def offsets_m(site, lines, inwards_from, z):
    """Horizontal distances (n,) from vertical lines to the expanded wall, m.

    Parameters
    ----------
    site : Site
        Tank during the survey.
    lines : ndarray, shape (n, 2)
        Places of the lines.
    inwards_from : ndarray, shape (n, 2)
        Unit vectors outwards.
    z : float
        Height at the reference temperature.
    """
    tank, f = site.tank, site.expansion_factor
    offsets = np.full(len(lines), 0.2)
    for _ in range(MOST_STEPS):
        places = (lines - offsets[:, None] * inwards_from) / f
        beyond = tank.beyond_m(np.column_stack([places, np.full(len(lines), z)]), outside=True)
        offsets += f * beyond
        if np.abs(beyond).max() < CLOSE_M:
            break
    return offsets


def _shape_sd_of_course_m(tank):
    """Standard deviation of the radius round the middle of the first course, m."""
    azimuth = FULL_TURN * np.arange(2048) / 2048
    return float(np.std(tank.radii_m(azimuth, tank.courses_m[0] / 2)))


# Standard uncertainties of the scanner: offset, scale, and bias at 60 degrees of incidence.
CLOUD_U_OFFSET_M, CLOUD_U_SCALE, CLOUD_U_BIAS_M = 1e-3, 10e-6, 1e-3
NOISE_M = (0.8e-3, 2.0e-3)  # smallest and largest standard deviation of a range
TARGET_SD_M, CLOUD_TARGETS = 6e-4, 6  # standard deviation of a scanned target, number of targets
TOOL = {"u_scale_ppm": 5.0, "u_offset_mm": 0.3}  # standard uncertainties of the total station
TOOL_SD_RAD, TOOL_SD_M = 2 / 206265, 5e-4  # standard deviations of the total station
# Largest tilt of the scanner about each axis; lowest and highest elevation of its rays.
LEVELLED_RAD, LOWEST_RAD, HIGHEST_RAD = 0.01, np.radians(-40), np.radians(72)
CLOUD_SPOILT, CLOUD_FAR_M = (
    0.002,
    0.4,
)  # share of stray points, and their largest distance before the wall
LAS_STEP_M = 1e-4  # resolution of coordinates in LAS files


def observe_cloud(tank, chance, asked, points=200_000):
    """Simulate two scans with together `points` points; roof columns hide parts of the wall.

    Parameters
    ----------
    tank : Tank
        The true tank.
    chance : Chance
        Random errors.
    asked : Asked
        Requested conditions of the capacity table.
    points : int
        Number of rays of both scans.

    Returns
    -------
    Parts
    """
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=False)
    scale, offset = chance.normal(CLOUD_U_SCALE), chance.normal(CLOUD_U_OFFSET_M)
    bias = chance.normal(CLOUD_U_BIAS_M)
    noise = float(rng.uniform(*NOISE_M))
    targets = _targets_cloud(rng, site)
    rows = [["scan", "target", "x_m", "y_m", "z_m", "s_mm"]]
    parts, clouds = site.parts, {}
    reach = 1.02 * tank.radius_m * site.expansion_factor
    low = -0.3
    for name, place in zip("AB", _stands(rng, tank), strict=True):
        rotation = _rotation(rng)
        rays, ranges = _scan(chance, site, place, rotation, points // 2, bias, noise)
        ranges = ranges * (1 + scale) + offset
        parts.files[f"scans/{name.lower()}.las"] = las_bytes(ranges[:, None] * rays)
        for target, position in targets.items():
            observed = (position - place) @ rotation + chance.normal(TARGET_SD_M, 3)
            rows.append([name, target, *np.round(observed, 5).tolist(), 1000 * TARGET_SD_M])
        clouds[name] = {
            "file": f"scans/{name.lower()}.las",
            "unit": "m",
            "scanner": "scanner 1",
            "u_offset_mm": 1000 * CLOUD_U_OFFSET_M,
            "u_scale_ppm": 1e6 * CLOUD_U_SCALE,
            "u_incidence_mm": 1000 * CLOUD_U_BIAS_M,
            "certificate": "simulated",
            "leave_out": [[-reach, -reach, low, reach, reach, 0.05]],
        }
    parts.registers["clouds"] = clouds
    parts.tables["scan_targets"] = rows
    _read_network(site, targets)
    return finish(site)


def _stands(rng, tank):
    """Yield two places of the scanner, on opposite sides of the middle."""
    azimuth = rng.uniform(0, FULL_TURN)
    distances = tank.radius_m * rng.uniform(0.2, 0.35, 2)
    for turn, distance in ((azimuth, distances[0]), (azimuth + np.pi + 0.5, distances[1])):
        yield np.array([distance * np.sin(turn), distance * np.cos(turn), rng.uniform(1.4, 1.7)])


def _targets_cloud(rng, site):
    """Places of targets in the tank, {name: place}, at different heights and azimuths."""
    tank = site.tank
    places = {}
    for k in range(CLOUD_TARGETS):
        azimuth = FULL_TURN * (k + 0.3 * rng.uniform(-1, 1)) / CLOUD_TARGETS
        distance = tank.radius_m * rng.uniform(0.75, 0.9)
        z = rng.uniform(0.3, 1.0) if k % 2 else rng.uniform(0.5, 0.8) * tank.height_m
        places[f"T{k + 1}"] = np.array([distance * np.sin(azimuth), distance * np.cos(azimuth), z])
    return places


def _read_network(site, targets):
    """Add a set-up of a total station, whose station and mark are control points."""
    chance, rng = site.chance, site.chance.rng
    station, mark = np.array([0.1, 0.15, 1.5]), np.array([0.3 * site.tank.radius_m, -0.1, 0.9])
    tool = Tool(
        chance.normal(1e-6 * TOOL["u_scale_ppm"]), chance.normal(1e-3 * TOOL["u_offset_mm"]),
        0.0, TOOL_SD_M, TOOL_SD_RAD,
    )  # fmt: skip
    zero = float(rng.uniform(0, FULL_TURN))
    sighted = {**targets, "R1": mark}
    readings = read_targets(chance, station, np.array(list(sighted.values())), tool, zero)
    tables = site.parts.tables
    tables["directions"] = [["setup", "to", "direction_deg", "s_arcsec"]]
    tables["zenith_angles"] = [["setup", "to", "zenith_deg", "s_arcsec"]]
    tables["slope_distances"] = [["setup", "to", "distance_m", "s_mm"]]
    for name, (direction, zenith, length) in zip(sighted, readings.tolist(), strict=True):
        tables["directions"].append(["1", name, round(float(np.degrees(direction)), 6), 2.0])
        tables["zenith_angles"].append(["1", name, round(float(np.degrees(zenith)), 6), 2.0])
        tables["slope_distances"].append(["1", name, round(length, 5), 1000 * TOOL_SD_M])
    tables["setups"] = [
        ["setup", "station", "instrument", "instrument_height_m"],
        ["1", "S1", "TS-1", 0.0],
    ]
    held = [
        [name, *map(float, position), 0.0, 0.0, 0.0]
        for name, position in (("S1", station), ("R1", mark))
    ]
    tables["control"] = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"], *held]
    site.parts.registers["instruments"] = {
        "TS-1": {"kind": "total_station", "certificate": "simulated", **TOOL}
    }


def _rotation(rng):
    """Random rotation (3, 3) from the scanner's to the tank's coordinates, with a small tilt."""
    a, b = LEVELLED_RAD * rng.uniform(-1, 1, 2)
    c = rng.uniform(0, FULL_TURN)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def _scan(chance, site, place, rotation, count, bias, noise):
    """Unit rays (n, 3) in the scanner's coordinates and noisy ranges (n,) of the returns, m."""
    rng, tank, f = chance.rng, site.tank, site.expansion_factor
    lines = int(np.sqrt(count * (HIGHEST_RAD - LOWEST_RAD) / FULL_TURN))
    columns = count // lines
    rise, turn = np.meshgrid(
        np.linspace(LOWEST_RAD, HIGHEST_RAD, lines), FULL_TURN * np.arange(columns) / columns
    )
    scanner_rays = rays_of(turn.ravel(), np.pi / 2 - rise.ravel())
    origin, rays = place / f, scanner_rays @ rotation.T
    cool = tank.ranges_m(origin, rays)
    is_hit = np.isfinite(cool)
    cosine = np.ones(len(scanner_rays))
    cosine[is_hit] = incidence(tank, origin + cool[is_hit, None] * rays[is_hit], rays[is_hit])
    ranges = f * cool + bias * (1 / np.maximum(cosine, 0.1) - 1)
    for fitting in tank.fittings:
        if fitting.width_m > 0:
            ranges = np.minimum(ranges, f * _column_ranges_m(fitting, origin, rays))
    ranges = np.minimum(ranges, f * _floor_ranges_m(tank, origin, rays))
    ranges += chance.normal(noise, len(scanner_rays))
    spoilt = chance.blunders(len(scanner_rays), CLOUD_SPOILT)
    ranges[spoilt] -= rng.uniform(0, CLOUD_FAR_M, len(spoilt))
    is_return = np.isfinite(ranges)
    return scanner_rays[is_return], ranges[is_return]


def _column_ranges_m(column, origin, rays):
    """Distances along rays to an upright round column, m; inf for rays that miss it."""
    x, y = origin[0] - column.x_m, origin[1] - column.y_m
    a = rays[:, 0] ** 2 + rays[:, 1] ** 2
    b = rays[:, 0] * x + rays[:, 1] * y
    root = b**2 - a * (x**2 + y**2 - column.width_m**2 / 4)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (-b - np.sqrt(np.maximum(root, 0))) / a
    z = origin[2] + t * rays[:, 2]
    return np.where((root > 0) & (t > 0) & (z < column.high_m), t, np.inf)


def _floor_ranges_m(tank, origin, rays):
    """Distances along rays to the bottom, m; inf for rays that miss it."""
    down = rays[:, 2] < -1e-3
    t = np.full(len(rays), np.inf)
    direction = rays[down]
    length = origin[2] / -direction[:, 2]
    # The bottom is nearly level, so that a vertical correction converges.
    for _ in range(20):
        points = origin + length[:, None] * direction
        height = points[:, 2] - tank.floor.height_m(points[:, 0], points[:, 1], tank.radius_m)
        length = length + height / -direction[:, 2]
    t[down] = length
    return t


def las_bytes(xyz):
    """Bytes of a LAS 1.2 file, point format 0, with coordinates (n, 3) in steps of 0.1 mm."""
    steps = np.round(xyz / LAS_STEP_M).astype("<i4")
    low, high = steps.min(axis=0) * LAS_STEP_M, steps.max(axis=0) * LAS_STEP_M
    bounds = [bound for pair in zip(high, low, strict=True) for bound in map(float, pair)]
    head = struct.pack(
        "<4sHHIHH8sBB32s32sHHHIIBHI5I3d3d6d",
        *(b"LASF", 0, 0, 0, 0, 0, b"\0" * 8, 1, 2),
        *(b"simulated", b"tankcal intercomparison", 124, 2026, 227, 227, 0, 0, 20),
        *(len(xyz), len(xyz), 0, 0, 0, 0),
        *(LAS_STEP_M,) * 3,
        *(0.0,) * 3,
        *bounds,
    )
    rows = np.zeros(
        len(xyz),
        dtype=[("xyz", "<i4", 3), ("intensity", "<u2"), ("rest", "u1", 4), ("source", "<u2")],
    )
    rows["xyz"] = steps
    rows["rest"][:, 0] = 0b00001001  # the first of one return
    return head + rows.tobytes()


STEPS_M, LAST_M = (0.25, 0.5), 0.05  # steps of the dips of both runs; last dip below the top
# Water: density at a temperature, and thermal expansion; below, their standard uncertainties.
DENSITY_KG_M3, DENSITY_C, EXPANSION_PER_K = 998.6, 18.0, 1.86e-4
U_DENSITY, U_EXPANSION, U_TEMPERATURE_K = 0.05, 1e-5, 0.1
# Meter: factor, its relative u, repeatability, fixed error of a batch, and deviation of a run.
FACTOR, U_FACTOR, LIQUID_REPEATS, FIXED_M3, RUN_SD = 1.0004, 1.5e-4, 8e-5, 2e-3, 8e-5
DIP_SD_M, DIP_ZERO_SD_M = 5e-4, 3e-4  # standard deviations of a dip, and of the zero of all dips
U_RADIUS_M = 0.02  # declared standard uncertainty of the radii of the drawing
FLOW_M3_H = 80.0  # mean flow rate
BATCH_DIGITS = 4  # decimals of a batch in m3


HEADINGS = [
    *("run", "meter", "volume_m3", "dip_m"),
    *("meter_temperature_c", "tank_temperature_c", "shell_temperature_c"),
    *("flow_m3_h", "time"),
]


def observe_liquid(tank, chance, asked):
    """Simulate two runs with one meter; the radii of the courses are not measured."""
    site = observe_site(tank, chance, asked, outside=False)
    del site.parts.tables["bottom"]  # the first batch measures the volume below the first dip
    factor, zero = FACTOR * (1 + chance.normal(U_FACTOR)), chance.normal(DIP_ZERO_SD_M)
    water = Water(
        DENSITY_KG_M3 + chance.normal(U_DENSITY), EXPANSION_PER_K + chance.normal(U_EXPANSION)
    )
    declared_dip_sd = chance.declared(1000 * DIP_SD_M)
    rows, clock = [HEADINGS], datetime.datetime(2026, 5, 4, 7, 0)
    for run, step in enumerate(STEPS_M, 1):
        rows.append([str(run), "M-1", 0.0, "", "", "", "", "", clock.isoformat("T", "minutes")])
        clock = _fill(site, rows, clock, str(run), list_dips(tank, step), water, factor, zero)
        clock += datetime.timedelta(days=2)
    site.parts.tables["liquid"] = rows
    site.parts.registers["meters"] = {
        "M-1": {
            "factor": FACTOR,
            "u_factor_ppm": 2e6 * U_FACTOR,
            "k": 2,
            "repeatability_ppm": 1e6 * LIQUID_REPEATS,
            "fixed_l": 1000 * FIXED_M3,
            "flow_min_m3_h": 30,
            "flow_max_m3_h": 120,
            "certificate": "simulated",
        }
    }
    site.parts.settings |= {
        "liquid.density_kg_m3": DENSITY_KG_M3,
        "liquid.density_temperature_c": DENSITY_C,
        "liquid.expansion_per_k": EXPANSION_PER_K,
        "liquid.u_density_kg_m3": U_DENSITY,
        "liquid.u_expansion_per_k": U_EXPANSION,
        "liquid.u_temperature_c": U_TEMPERATURE_K,
        "liquid.s_dip_mm": declared_dip_sd,
        "liquid.u_dip_zero_mm": 1000 * DIP_ZERO_SD_M,
        "liquid.run_ppm": 1e6 * RUN_SD,
        "liquid.u_radius_mm": 1000 * U_RADIUS_M,
    }
    return finish(site)


@dataclass(frozen=True)
class Water:
    """True density and thermal expansion of the liquid."""

    density_kg_m3: float
    expansion_per_k: float

    def at(self, celsius):
        """Density at a temperature, kg/m3."""
        return self.density_kg_m3 * (1 - self.expansion_per_k * (celsius - DENSITY_C))


def _fill(site, rows, clock, run, dips, water, factor, zero):
    """Add the rows of a run, and return the time of its end."""
    tank, chance, rng = site.tank, site.chance, site.chance.rng
    run_error, previous_mass = chance.normal(RUN_SD), 0.0
    warm = 17.0 + rng.uniform(0, 2)
    for dip in dips:
        meter_c, warm = warm + rng.normal(0.3, 0.2), warm + rng.normal(0.02, 0.02)
        shell_c = warm + rng.normal(0.4, 0.1)
        mass = liquid_mass_kg(tank, dip, water.at(warm), shell_c)
        indicated = (mass - previous_mass) / water.at(meter_c) / (factor * (1 + run_error))
        reading = indicated + chance.normal(np.hypot(LIQUID_REPEATS * indicated, FIXED_M3))
        previous_mass = mass
        clock += datetime.timedelta(minutes=15 + round(60 * indicated / FLOW_M3_H))
        observed_dip = dip + zero + chance.normal(DIP_SD_M)
        temperatures = np.array([meter_c, warm, shell_c]) + chance.normal(U_TEMPERATURE_K, 3)
        temperatures = np.round(temperatures, 2 if chance.size else 6)
        flow = FLOW_M3_H * rng.uniform(0.95, 1.05)
        rows.append(
            [run, "M-1", round(float(reading), BATCH_DIGITS),
             round(float(observed_dip), 5), *temperatures.tolist(),
             round(float(flow), 1), clock.isoformat("T", "minutes")]
        )  # fmt: skip
    return clock


def list_dips(tank, step_m):
    """Dips of a run, m; the lowest dip covers the bottom."""
    first = max(tank.lowest_level_m - tank.plate_z_m + 0.05, 0.3)
    first = np.ceil(20 * first) / 20
    top = tank.height_m - tank.plate_z_m - LAST_M
    return np.round(np.arange(first, top, step_m), 3)


def liquid_mass_kg(tank, dip, density, shell_c):
    """Mass of liquid below a dip, kg, in the tank expanded by temperature and liquid head."""
    return float(density * tank.volumes_m3(dip, density, celsius=shell_c)[0])


METHODS = {
    "points": observe_points,
    "photographs": observe_photographs,
    "total-station": observe_hits,
    "tape": observe_tape,
    "reference-line": observe_lines,
    "cloud": observe_cloud,
    "liquid": observe_liquid,
}
