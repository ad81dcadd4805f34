"""A survey of a generated tank as Stands of `written_fieldbooks`, and the job that it is of."""

import datetime

import numpy as np
from generated_hits import Surface, even_aims, observe, take_hits
from job_builder import hit_parts, write_folder
from written_fieldbooks import START, Aim, Stand, both_faces

HEIGHT = 1.5
WALL = Surface(
    lambda azimuth, z: 6.5 + 0.003 * np.cos(2 * azimuth) + 0.0002 * z + 0 * azimuth,
    foot_m=(0.4, -0.3),
    slope=(0.001, -0.0005),
)
TARGETS = np.array([[3.0, 4.0, 0.5], [-4.0, 3.5, 2.5], [-2.0, -5.0, 1.0], [4.5, -3.0, 3.0]])
LEVELS = tuple(2.0 * course + part for course in range(4) for part in (0.5, 1.5))


def stand(name, xyz, *, zero=0.3, hits=12, first=1, collimation=0.0, index=0.0, faces=1, again=0):
    """A Stand that sees targets T1 to T4 (again so often) and so many hits at each level.

    xyz  the point below the instrument
    """
    place = np.array(xyz) + [0.0, 0.0, HEIGHT]
    hit = take_hits(WALL, place, even_aims(WALL, LEVELS, hits, turn=0.1), zero=zero)
    seen = observe(place, TARGETS + [0.0, 0.0, 0.1], zero=zero)
    clock = START
    aims = []

    def take(names, read, code, height):
        nonlocal clock
        for point, (direction, zenith, distance) in zip(names, read, strict=True):
            clock += datetime.timedelta(seconds=20)
            aims.append(Aim(point, float(np.degrees(direction)), float(np.degrees(zenith)),
                            float(distance), code=code, height=height, time=clock))  # fmt: skip

    names = [f"T{number}" for number in range(1, 5)]
    take(names, seen, "", 0.1)
    take([str(first + place) for place in range(len(hit))], hit, "WALL", 0.0)
    for _ in range(again):
        take(names, seen, "", 0.1)
    if faces == 2:
        aims = both_faces(aims, collimation, index)
    return Stand(name, HEIGHT, tuple(map(float, xyz)), tuple(aims))


def one_stand(**more):
    """One set-up, near the middle, that reads its targets again."""
    return [stand("1", (0.2, 0.1, 0.0), again=1, **more)]


def two_stands(**more):
    """Two set-ups that share four targets."""
    return [
        stand("1", (0.2, 0.1, 0.0), **more),
        stand("2", (-1.0, 1.2, 0.05), zero=1.1, first=1001, **more),
    ]


def base_job(folder, **settings):
    """The folder of a job without the tables that an import writes."""
    rows = [{"setup": "I", "direction_deg": 1.0, "zenith_deg": 90.0, "distance_m": 6.0}]
    write_folder(folder, hit_parts(rows, **settings))
    for name in ("setups", "wall_hits"):
        (folder / f"{name}.csv").unlink()
    return folder
