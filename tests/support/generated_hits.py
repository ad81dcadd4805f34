"""Bare hits of walls that are no model of the package, from set-ups in or round the tank.

    hits = take_hits(surface, station, targets, tool, rng)

A wall is any function of azimuth and height about a leaning axis; the sight is followed from the
instrument until it meets it: no formula of the package is used. An instrument may range too long,
by a scale, and by its angle of incidence.
"""

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from generated_strapping import girth_of
from job_builder import hit_parts, write_folder

import tankcal
from tankcal.survey.measurements import Setup
from tankcal.survey.strapping import Strap, Strapping, Tape
from tankcal.survey.wall_hits import RangingInstrument, WallHits

STEP = 1e-6


@dataclass(frozen=True)
class Surface:
    """A wall: radius(azimuth, z) about the axis foot_m + slope z; its foot at z = 0."""

    radius: object
    foot_m: tuple = (0.0, 0.0)
    slope: tuple = (0.0, 0.0)

    def beyond(self, places):
        """(n,) how far places (n, 3) lie outside the wall."""
        away = places[:, :2] - self.foot_m - np.outer(places[:, 2], self.slope)
        azimuth = np.arctan2(away[:, 0], away[:, 1])
        return np.hypot(*away.T) - self.radius(azimuth, places[:, 2])

    def at(self, azimuth, z):
        """(n, 3) places of the wall."""
        radius = self.radius(np.asarray(azimuth, dtype=float), np.asarray(z, dtype=float))
        x, y = (np.outer(z, self.slope) + self.foot_m).T
        return np.column_stack([x + radius * np.sin(azimuth), y + radius * np.cos(azimuth), z])


@dataclass(frozen=True)
class Tool:
    """What a total station adds to a distance, and how it scatters."""

    offset_m: float = 0.0
    scale: float = 0.0
    bias_m: float = 0.0  # at 60 degrees of incidence
    sd_m: float = 0.0
    sd_rad: float = 0.0


def take_hits(surface, station, aims, tool=Tool(), rng=None, zero=0.0):
    """(n, 3) direction (rad, from a zero at that azimuth), zenith angle, distance read.

    aims  (n, 3) places near the wall: the sight goes there, and is followed to the wall itself
    """
    away = np.asarray(aims, dtype=float) - station
    azimuth = np.arctan2(away[:, 0], away[:, 1])
    zenith = np.arctan2(np.hypot(*away[:, :2].T), away[:, 2])
    ray = away / np.linalg.norm(away, axis=1, keepdims=True)
    distance = np.linalg.norm(away, axis=1)
    for _ in range(50):
        there = station + distance[:, None] * ray
        slope = (surface.beyond(there + STEP * ray) - surface.beyond(there - STEP * ray)) / 2 / STEP
        change = surface.beyond(there) / slope
        distance -= np.clip(change, -0.05, 0.05)
        if np.max(np.abs(change)) < 1e-12:
            break
    read = (1 + tool.scale) * distance + tool.offset_m
    if tool.bias_m:
        across = np.abs(slope)  # of the sight on the normal
        read += tool.bias_m * (1 / across - 1)
    found = np.column_stack([(azimuth - zero) % (2 * np.pi), zenith, read])
    if rng is not None:
        sd = np.array([tool.sd_rad, tool.sd_rad, tool.sd_m])
        found += sd * rng.normal(size=found.shape)
    return found


def rows_of(setup, read, **more):
    """Rows of wall_hits.csv as texts by column."""
    return [
        {
            "setup": setup,
            "direction_deg": float(np.degrees(direction)),
            "zenith_deg": float(np.degrees(zenith)),
            "distance_m": float(distance),
            **more,
        }
        for direction, zenith, distance in read
    ]


def even_aims(surface, levels_m, count, turn=0.0):
    """(n, 3) places of a surface: so many evenly round each level."""
    azimuth = turn + 2 * np.pi * np.arange(count) / count
    return np.vstack([surface.at(azimuth, np.full(count, z)) for z in levels_m])


def observe(station, targets, tool=Tool(), rng=None, zero=0.0):
    """(n, 3) direction, zenith angle and distance read to targets (n, 3) with reflectors."""
    away = np.asarray(targets, dtype=float) - station
    distance = np.linalg.norm(away, axis=1)
    found = np.column_stack(
        [
            (np.arctan2(away[:, 0], away[:, 1]) - zero) % (2 * np.pi),
            np.arccos(away[:, 2] / distance),
            (1 + tool.scale) * distance + tool.offset_m,
        ]
    )
    if rng is not None:
        sd = np.array([tool.sd_rad, tool.sd_rad, tool.sd_m])
        found += sd * rng.normal(size=found.shape)
    return found


def network_tables(readings, s_mm=0.5, s_arcsec=2.0):
    """Tables of a network: {setup: (names, (n, 3) read)} as rows with headings."""
    tables = {
        "directions": [["setup", "to", "direction_deg", "s_arcsec"]],
        "zenith_angles": [["setup", "to", "zenith_deg", "s_arcsec"]],
        "slope_distances": [["setup", "to", "distance_m", "s_mm"]],
    }
    for setup, (names, read) in readings.items():
        for name, (direction, zenith, distance) in zip(names, read, strict=True):
            tables["directions"].append([setup, name, float(np.degrees(direction)), s_arcsec])
            tables["zenith_angles"].append([setup, name, float(np.degrees(zenith)), s_arcsec])
            tables["slope_distances"].append([setup, name, float(distance), s_mm])
    return tables


U_OFFSET, U_SCALE, U_BIAS = 5e-4, 10e-6, 1e-3
PARTS = {1: (0.5,), 2: (0.25, 0.75)}
PLATE_M, TAPE_M, TAPE_SCALE, LAID_M = 0.008, 2e-4, 10e-6, 5e-4


@cache
def _any_job(folder):
    rows = [{"setup": "I", "direction_deg": 1.0, "zenith_deg": 90.0, "distance_m": 6.0}]
    return tankcal.load(write_folder(folder, hit_parts(rows * 5)))


def hit_job(rng, wall, *, folder, hits, levels=2, straps=False, sd_m=1.5e-3, lean=2e-3):
    """A Job of a generated wall that was hit inside from one set-up off its middle.

    straps  two of the first course, by a tape with errors; of the offset, some 3 mm, nothing is
            known then, else it is drawn from its certificate
    """
    slope = tuple(lean * rng.normal(size=2))
    foot = tuple(0.3 * wall.radius_m * rng.uniform(-1, 1, 2))
    surface = Surface(partial(_radius, wall), foot, slope)
    station = np.array([0.0, 0.0, 1.6])
    offset = 3e-3 * rng.normal() if straps else U_OFFSET * rng.normal()
    tool = Tool(offset, U_SCALE * rng.normal(), U_BIAS * rng.normal(), sd_m, 3e-5)
    z = [(c + part) * wall.course_m for c in range(wall.courses) for part in PARTS[levels]]
    aims = even_aims(surface, z, hits, turn=rng.uniform(0, 6))
    read = take_hits(surface, station, aims, tool, rng)
    n = len(aims)
    known = RangingInstrument(
        "TS", u_scale=U_SCALE, u_offset_m=np.nan if straps else U_OFFSET, u_incidence_m=U_BIAS
    )
    nothing, job = (None,) * n, _any_job(folder)
    given = WallHits(
        *(("I",) * n, nothing, nothing, *read.T, np.full(n, sd_m), np.full(n, 3e-5), ("",) * n),
        *(np.zeros(n, dtype=bool), {"I": Setup("I", "SI", "TS", 1.6)}, {"TS": known}),
        rows=tuple(range(2, n + 2)),
    )
    along = wall.course_m * np.hypot(1, np.hypot(*slope))
    course = replace(job.courses[0], height_m=along, thickness_m=PLATE_M, paint_m=0.0)
    taped = None
    if straps:
        tape = Tape("T", 0.0, 0.0, None, None, 0.0, TAPE_M, u_scale=TAPE_SCALE)
        taped = Strapping(_straps(rng, wall), (tape,), shape_sd_m=None)
    return replace(
        job,
        hits=given,
        strapping=taped,
        courses=tuple(replace(course, name=str(i + 1)) for i in range(wall.courses)),
        tank=replace(job.tank, nominal_diameter_m=2 * wall.radius_m, nominal_height_m=None),
    )


def _radius(wall, azimuth, z):
    course = np.clip((z / wall.course_m).astype(int), 0, wall.courses - 1)
    zeta = 2 * (z / wall.course_m - course) - 1
    return wall.radius_at(course, zeta, azimuth % (2 * np.pi))


def _straps(rng, wall):
    """Two readings of the first course; the plate is not quite the one that is said."""
    plate = PLATE_M + rng.uniform(-2e-4, 2e-4)
    long = 1 + TAPE_SCALE * rng.normal()
    found = []
    for part in (0.2, 0.8):
        girth = girth_of(wall, 0, 2 * part - 1, plate) + np.pi * TAPE_M
        reading = girth / long + LAID_M * rng.normal()
        found.append(Strap(f"1-{part}", "1", part * wall.course_m, reading, LAID_M, "T"))
    return tuple(found)
