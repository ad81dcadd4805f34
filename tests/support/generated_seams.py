"""Narrow seams of a wall in scans of it, and things that stand before a wall and are as narrow.

    seam = Seam(azimuth=1.0, depth_m=-0.04, width_m=0.4, shape="cosine")
    wall = wall_of([seam], radius_m=7.5)
    scan = scan_of(rng, wall, points=20_000, noise_m=0.001)
    scan = put_before(rng, scan, wall, [Pipe(azimuth=2.0, off_m=0.05, diameter_m=0.06)])

No criterion of the package is in these shapes: seams are cos^2, cusps with straight flanks, or flat
bottoms with flanks of a quarter of the width. Points hit a pipe on its side towards the scanner;
brackets hold it every 2.5 m, and one point in twenty on its edges lies between it and the wall.
"""

from dataclasses import dataclass, replace

import numpy as np
from generated_walls import FULL_TURN, GeneratedWall, Survey, _arc

SHAPES = {
    "cosine": lambda part: np.cos(np.pi / 2 * part) ** 2,
    "cusp": lambda part: 1 - part,
    "flat": lambda part: np.clip(2 * (1 - part), 0, 1),
}
BRACKETS_M, BRACKET_M, EDGE = 2.5, 0.06, 0.05


@dataclass(frozen=True)
class Seam:
    """A valley (depth below 0) or a ridge: up the whole shell, or over one course."""

    azimuth: float
    depth_m: float
    width_m: float
    shape: str = "cosine"
    course: int | None = None

    def part(self, wall, azimuth):
        """(n,) share of the depth at azimuths."""
        away = np.abs(_arc(wall, azimuth, self.azimuth)) / (self.width_m / 2)
        return np.where(away < 1, SHAPES[self.shape](np.minimum(away, 1)), 0.0)


@dataclass(frozen=True)
class Pipe:
    """A round pipe up the whole shell; `leans_m`: along the arc, from bottom to top."""

    azimuth: float
    off_m: float
    diameter_m: float
    brackets: bool = True
    leans_m: float = 0.0


@dataclass(frozen=True)
class Ladder:
    """Two flat bars of 60 mm, 0.5 m apart, and rungs every 0.3 m."""

    azimuth: float
    off_m: float


def wall_of(seams, *, radius_m=7.5, courses=6, course_m=2.0, oval_m=0.003, bulge_m=0.003):
    """A `GeneratedWall` with seams."""
    wall = GeneratedWall(radius_m, courses, course_m)
    for course in range(courses):
        wall.add(course, np.ones_like, lambda s: bulge_m * (1 - s**2))
    for k in (2, 3, 5):
        wall.add_to_all(lambda a, k=k: oval_m / k * np.cos(k * a + k), np.ones_like)
    for seam in seams:
        chosen = range(courses) if seam.course is None else [seam.course]
        for course in chosen:
            wall.add(
                course,
                lambda a, seam=seam: seam.part(wall, a),
                lambda s, seam=seam: seam.depth_m + 0 * s,
            )
    return wall


def scan_of(rng, wall, *, points, noise_m):
    """A `Survey` of points anywhere on a wall."""
    course, zeta = rng.integers(0, wall.courses, points), rng.uniform(-0.97, 0.97, points)
    azimuth = rng.uniform(0, FULL_TURN, points)
    radius = wall.radius_at(course, zeta, azimuth) + noise_m * rng.normal(size=points)
    return Survey(course, zeta, azimuth, radius, noise_m)


def on_seams(survey, wall, seams, least=0.15):
    """(n,) points of a survey that lie where a seam has so much of its depth at least."""
    found = np.zeros(len(survey.radius_m), dtype=bool)
    for seam in seams:
        mine = seam.part(wall, survey.azimuth_rad) >= least
        found |= mine & ((seam.course is None) | (survey.course == seam.course))
    return found


def put_before(rng, survey, wall, things, *, inside=False):
    """The survey with what stands before the wall, and (n,) points that hit it."""
    off = np.zeros(len(survey.radius_m))
    height = (survey.course + (survey.zeta + 1) / 2) * wall.course_m
    for one in things:
        arc = _arc(wall, survey.azimuth_rad, one.azimuth)
        own = _of_pipe(rng, arc, height, one, wall.height_m) if isinstance(one, Pipe) else (
            _of_ladder(arc, height, one)
        )  # fmt: skip
        off = np.maximum(off, own)
    sign = -1.0 if inside else 1.0
    return replace(survey, radius_m=survey.radius_m + sign * off), off > 0


def _of_pipe(rng, arc, height, pipe, top_m):
    """(n,) m before the wall; 0: the point is of the wall."""
    half = pipe.diameter_m / 2
    arc = arc - pipe.leans_m * (height / top_m - 0.5)
    across = np.abs(arc) / half
    off = np.where(across < 1, pipe.off_m + half * (1 + np.sqrt(np.maximum(1 - across**2, 0))), 0)
    edge = (across > 0.9) & (across < 1.1) & (rng.uniform(size=len(arc)) < EDGE)
    held = (height % BRACKETS_M < BRACKET_M) & (across >= 1) & (np.abs(arc) < half + 0.05)
    between = edge | (held & pipe.brackets)
    return np.where(between, rng.uniform(0, pipe.off_m + half, len(arc)), off)


def _of_ladder(arc, height, ladder):
    bar = np.abs(np.abs(arc) - 0.25) < 0.03
    rung = (np.abs(arc) < 0.25) & (height % 0.3 < 0.02)
    return np.where(bar | rung, ladder.off_m, 0.0)
