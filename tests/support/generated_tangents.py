"""Tangents to walls that are no model of the package, from stations of a traverse round the tank.

    read = take_tangents(surface, station, levels_m, tool, rng, zero)

A wall is any function of azimuth and height about a leaning axis. The telescope is turned until its
sight just touches the wall somewhere, the hull over a valley: no formula of the package is used.
"""

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from generated_hits import Surface, _radius, network_tables, observe
from job_builder import tangent_parts, write_folder

import tankcal
from tankcal.survey.measurements import Setup
from tankcal.survey.tangents import Tangents
from tankcal.survey.wall_hits import NETWORK, Poses

STEPS, HALVINGS = 400, 32  # along a sight near the wall; of the bracket of its azimuth
SIDES = ("left", "right")


@dataclass(frozen=True)
class Circle:
    """What a theodolite adds to its angles, and how they scatter."""

    sd_rad: float = 0.0
    turned_rad: float = 0.0  # disturbed after the traverse


def take_tangents(
    surface, station, levels_m, size_m, tool=Circle(), rng=None, zero=0.0, steps=STEPS
):
    """Rows (level, side, direction rad, zenith rad): both limbs at each level.

    size_m  radius of the wall, about
    """
    station = np.asarray(station, dtype=float)
    levels = np.repeat(np.asarray(levels_m, dtype=float), 2)
    sign = np.tile([-1.0, 1.0], len(levels_m))
    centre = surface.foot_m + np.outer(levels, surface.slope)
    away = centre - station[:2]
    distance = np.hypot(*away.T)
    length = np.sqrt(distance**2 - size_m**2)
    zenith = np.arctan2(length, levels - station[2])
    nominal = np.arctan2(*away.T) + sign * np.arcsin(size_m / distance)
    along = length[:, None] + np.linspace(-0.35, 0.35, steps) * size_m
    low, high = nominal - sign * 0.05, nominal + sign * 0.05  # through the tank; past it
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        ray = np.column_stack([np.sin(middle), np.cos(middle), 1 / np.tan(zenith)])
        places = station + along[:, :, None] * ray[:, None, :]
        beyond = surface.beyond(places.reshape(-1, 3)).reshape(along.shape).min(axis=1)
        hits = beyond < 0
        low, high = np.where(hits, middle, low), np.where(hits, high, middle)
    read = np.column_stack([(low + high) / 2 - zero + tool.turned_rad, zenith])
    if rng is not None:
        read += tool.sd_rad * rng.normal(size=read.shape)
    read[:, 0] %= 2 * np.pi
    return [
        (level, SIDES[int(side > 0)], *pair)
        for level, side, pair in zip(levels, sign, read.tolist(), strict=True)
    ]


def ring_of_stations(count, distance_m, height_m=1.5, turn=0.0):
    """(n, 3) places of instruments, evenly round the origin."""
    f = turn + 2 * np.pi * np.arange(count) / count
    return np.column_stack(
        [distance_m * np.sin(f), distance_m * np.cos(f), np.full(count, height_m)]
    )


def traverse_tables(stations, zeros, tool, rng=None, s_mm=0.5, s_arcsec=2.0):
    """Tables of a traverse: each set-up reads the two stations beside it, both ways."""
    count, readings = len(stations), {}
    for i in range(count):
        beside = [(i - 1) % count, (i + 1) % count]
        names = [f"S{k + 1}" for k in beside]
        readings[f"I{i + 1}"] = (
            names,
            observe(stations[i], stations[beside], tool, rng, zeros[i]),
        )
    places = [[f"S{i + 1}", *map(float, at)] for i, at in enumerate(stations)]
    control = {"control": [["point", "x_m", "y_m", "z_m"], *places]}  # where the frame is, about
    return network_tables(readings, s_mm, s_arcsec) | control


def rows_of(setup, read, course_of, s_arcsec, **more):
    """Rows of tangents.csv as {column: value}."""
    return [
        {
            "setup": setup,
            "course": course_of(level),
            "level_m": float(level),
            "side": side,
            "direction_deg": float(np.degrees(direction)),
            "zenith_deg": float(np.degrees(zenith)),
            "s_arcsec": s_arcsec,
            **more,
        }
        for level, side, direction, zenith in read
    ]


@cache
def _any_job(folder):
    stations = ring_of_stations(4, 14.0)
    rows = [
        row
        for i in range(4)
        for row in rows_of(f"I{i + 1}", [(1.0, "left", 1.0, 1.5)], lambda z: "1", 3.0)
    ]
    from generated_hits import Tool

    return tankcal.load(
        write_folder(folder, tangent_parts(rows, traverse_tables(stations, np.zeros(4), Tool())))
    )


def tangent_job(rng, wall, *, folder, stations, levels=2, sd_rad=2.4e-5, lean=2e-3, scale=20e-6):
    """A Job of a generated wall whose limbs were sighted, its `Poses` and tools, as known.

    The poses scatter as their covariance says: each station by 0.5 mm, its zero by 3 seconds of
    arc, and all by the scale of the traverse.
    """
    parts = {1: (0.5,), 2: (0.25, 0.75)}[levels]
    slope = tuple(lean * rng.normal(size=2))
    foot = tuple(0.05 * wall.radius_m * rng.uniform(-1, 1, 2))
    surface = Surface(partial(_radius, wall), foot, slope)
    true = ring_of_stations(
        stations, (1.8 + 0.4 * rng.uniform()) * wall.radius_m, turn=rng.uniform(0, 6)
    )
    z = [(c + part) * wall.course_m for c in range(wall.courses) for part in parts]
    found = [
        (f"I{i + 1}", *row)
        for i, at in enumerate(true)
        for row in take_tangents(surface, at, z, wall.radius_m, Circle(sd_rad), rng)
    ]
    setup, level, side, direction, zenith = zip(*found, strict=True)
    course = [str(int(one / wall.course_m) + 1) for one in level]
    n = len(found)
    given = Tangents(
        *(setup, (None,) * n, tuple(course), np.array(level), np.array(side) == "right"),
        *(np.array(direction), np.array(zenith), np.full(n, sd_rad), np.zeros(n, dtype=bool)),
        {name: Setup(name, "S" + name[1:], "TS", 0.0) for name in dict.fromkeys(setup)},
        rows=tuple(range(2, n + 2)),
    )
    job = _any_job(folder)
    along = wall.course_m * np.hypot(1, np.hypot(*slope))
    course = replace(job.courses[0], height_m=along, thickness_m=0.0, paint_m=0.0)
    job = replace(
        job,
        tangents=given,
        measurements=None,
        courses=tuple(replace(course, name=str(i + 1)) for i in range(wall.courses)),
        tank=replace(job.tank, nominal_diameter_m=2 * wall.radius_m, nominal_height_m=None),
    )
    return job, _known_poses(rng, true, scale), ((scale, 0.0),)


def _known_poses(rng, true, scale):
    count = len(true)
    own = np.tile([5e-4, 5e-4, 5e-4, 1.5e-5], count)
    stretch = np.column_stack([true, np.zeros(count)]).ravel()
    stretch[2::4] = 0.0
    by = np.vstack([stretch, np.eye(4 * count)]).T  # by the scale, then by what each has
    covariance = np.zeros((4 * count + 2, 4 * count + 2))
    covariance[:-2, :-2] = np.diag(own**2) + scale**2 * np.outer(stretch, stretch)
    covariance[-2, :-2] = covariance[:-2, -2] = scale**2 * stretch
    covariance[-2, -2] = scale**2
    error = by @ (np.append(scale, own) * rng.normal(size=4 * count + 1))
    error = error.reshape(count, 4)
    keys = tuple((f"I{i + 1}", None) for i in range(count))
    return Poses(
        keys=keys,
        xyz_m=true + error[:, :3],
        orientation_rad=error[:, 3],
        instruments=("TS",),
        scale=np.zeros(1),
        offset_m=np.zeros(1),
        covariance=covariance,
        ties=(NETWORK,) * count,
    )
