"""Walls with seams that hardly more than a column of points meets, and fittings that look alike.

    scene = make_scene(rng, "seams")          # or "fittings", "both", "plain"
    scene.wall, scene.survey, scene.hit       # hit: the points on a fitting

Rings of even points, so that what runs up the wall is met by the same columns of all rings. Half of
what is there stands on such a column, the rest anywhere. No criterion of the package is in it:
seams are those of `generated_seams`, fittings are round or flat and stand 20 to 200 mm before the
wall by their crest: pipes up the whole shell, ladders, and brackets 0.4 m tall every 2 to 4 m.
"""

from dataclasses import dataclass, replace

import numpy as np
from generated_seams import SHAPES, Ladder, Pipe, Seam, on_seams, put_before, wall_of
from generated_walls import FULL_TURN, GeneratedWall, Survey, _arc, survey

KINDS = ("seams", "fittings", "both", "plain")


@dataclass(frozen=True)
class Brackets:
    """Flat plates one above another: `tall_m` of every `every_m`, 0.15 m wide."""

    azimuth: float
    off_m: float
    every_m: float
    tall_m: float = 0.4


@dataclass(frozen=True)
class Scene:
    """A wall, its survey, what is on it, and (n,) points that hit a fitting."""

    wall: GeneratedWall
    survey: Survey
    seams: list
    things: list
    hit: np.ndarray

    @property
    def on_seams(self):
        """(n,) points where a seam departs by 13 mm or more."""
        found = np.zeros(len(self.hit), dtype=bool)
        for seam in self.seams:
            least = min(0.013 / abs(seam.depth_m), 1.0)
            found |= on_seams(self.survey, self.wall, [seam], least)
        return found & ~self.hit


def make_scene(rng, kind, *, points=None, rings=None, inside=True):
    """A `Scene`; R 6.5 to 15 m, 5 to 8 courses of 1.8 m, noise of 1 mm."""
    points = int(rng.choice([24, 36, 48, 72])) if points is None else points
    rings = int(rng.integers(1, 4)) if rings is None else rings
    radius, courses = np.exp(rng.uniform(*np.log([6.5, 15.0]))), int(rng.integers(5, 9))
    phase = rng.uniform(0, FULL_TURN)

    def place():
        column = phase + FULL_TURN / points * rng.integers(points)
        return (column if rng.random() < 0.5 else rng.uniform(0, FULL_TURN)) % FULL_TURN

    seams, things = [], []
    if kind in ("seams", "both"):
        seams = [_seam(rng, place(), courses) for _ in range(rng.integers(1, 3))]
    if kind in ("fittings", "both"):
        things = [_thing(rng, place()) for _ in range(rng.integers(1, 3))]
    wall = wall_of(seams, radius_m=radius, courses=courses, course_m=1.8)
    measured = _on_columns(survey(rng, wall, rings=rings, points=points, noise_m=1e-3), wall, phase)
    measured = replace(
        measured,
        radius_m=wall.radius_at(measured.course, measured.zeta, measured.azimuth_rad)
        + 1e-3 * rng.normal(size=len(measured.zeta)),
    )
    flat = [one for one in things if isinstance(one, Brackets)]
    round_ones = [one for one in things if not isinstance(one, Brackets)]
    found, hit = put_before(rng, measured, wall, round_ones, inside=inside)
    found, more = _behind(found, wall, flat, hit, inside=inside)
    return Scene(wall, found, seams, things, hit | more)


def _on_columns(measured, wall, phase):
    """The survey turned so that its columns stand at the phase."""
    turn = phase - measured.azimuth_rad[0]
    return replace(measured, azimuth_rad=(measured.azimuth_rad + turn) % FULL_TURN)


def _seam(rng, azimuth, courses):
    depth = rng.choice([-1, -1, -1, 1]) * rng.uniform(0.010, 0.060)
    width = np.exp(rng.uniform(*np.log([0.2, 2.0])))
    course = None if rng.random() < 0.5 else int(rng.integers(courses))
    return Seam(azimuth, depth, width, str(rng.choice(list(SHAPES))), course)


def _thing(rng, azimuth):
    crest = rng.uniform(0.020, 0.200)
    what = rng.choice(["pipe", "ladder", "brackets"])
    if what == "pipe":
        across = min(rng.uniform(0.02, 0.10), crest)
        return Pipe(azimuth, crest - across, across)
    if what == "ladder":
        return Ladder(azimuth + 0.0, crest)
    return Brackets(azimuth, crest, rng.uniform(2.0, 4.0))


def _behind(measured, wall, plates, hit, *, inside):
    off = np.zeros(len(measured.radius_m))
    height = (measured.course + (measured.zeta + 1) / 2) * wall.course_m
    for one in plates:
        near = np.abs(_arc(wall, measured.azimuth_rad, one.azimuth)) < 0.075
        off = np.where(near & (height % one.every_m < one.tall_m) & ~hit, one.off_m, off)
    sign = -1.0 if inside else 1.0
    return replace(measured, radius_m=measured.radius_m + sign * off), off > 0
