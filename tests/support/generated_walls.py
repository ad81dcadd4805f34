"""Walls of upright tanks that are no model of the package, and surveys of them.

    wall = make_wall(rng, "coil", radius_m=7.6, courses=8)
    job = job_of(wall, survey(rng, wall, rings=2, points=24, noise_m=0.001), given=True)
    wall.volume_below(heights)

A wall is R + sum of A_i(azimuth) H_i(zeta) in each course, so that its areas are quadratic forms of
a Gram matrix made by dense quadrature. Every wall bulges between its joints (one sign in all
courses), for every welded shell does: between a parabola and a bell that is level at its joints,
as the surveyed wall has it (Legendre orders 2 and 4 of -3.85 +- 0.39 and 1.23 +- 0.41 mm, a bell of
5 mm has -3.8 and 1.5). The families, with magnitudes as that wall, tolerances of API 650 or
judgement have them:

coil    one to four seams up the whole shell, 5 to 40 mm, 0.3 to 1 m wide, most of them valleys
brick   plates in brick pattern: peaking of 2 to 12 mm at vertical, banding of 1 to 8 mm at girth
        welds
dents   3 to 10 dents, 0.5 to 4 m wide, 5 to 30 mm; ovality that grows with the height
buckle  one or two buckles of 20 to 80 mm over a course, rings drawn in by 1 to 6 mm
chord   plates of another curvature: parabolas between the vertical welds, of -10 to 10 mm
rough   one to three valleys up the whole shell, and on every metre of each course a cusp of 2 to
        6 mm (rms), up the whole course or a part of it: as rough as the surveyed wall
"""

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.polynomial.legendre import leggauss

import tankcal
from tankcal.survey.points import Points

FAMILIES = ("coil", "brick", "dents", "buckle", "chord", "rough")
FULL_TURN, ARC_M, FEWEST = 2 * np.pi, 0.02, 4096  # of the quadrature of areas
LEAN = (0.001, -0.0007)


@dataclass
class GeneratedWall:
    """A wall of courses of one height.

    terms  for each course a list of pairs of functions, of the azimuth and of zeta
    """

    radius_m: float
    courses: int
    course_m: float
    terms: list = field(default_factory=list)
    grams: dict = field(default_factory=dict)

    def __post_init__(self):
        self.terms = [[(np.ones_like, np.zeros_like)] for _ in range(self.courses)]

    @property
    def height_m(self):
        """Of the whole shell."""
        return self.courses * self.course_m

    def add(self, course, around, up):
        """Add around(azimuth) up(zeta) to a course."""
        self.terms[course].append((around, up))

    def add_to_all(self, around, up_z):
        """Add around(azimuth) up_z(height above the foot) to the whole shell."""
        for course in range(self.courses):
            foot = course * self.course_m
            self.add(course, around, lambda s, foot=foot: up_z(foot + self.course_m * (s + 1) / 2))

    def radius_at(self, course, zeta, azimuth):
        """(n,) radii at (n,) places."""
        found = np.full(len(azimuth), self.radius_m)
        for one in np.unique(course):
            mine = course == one
            for around, up in self.terms[one]:
                found[mine] += around(azimuth[mine]) * up(zeta[mine])
        return found

    def areas(self, course, zeta):
        """(k,) areas of the horizontal cuts at heights (k,) of a course."""
        sums, gram = self._moments(course)
        up = np.array([one(zeta) for _, one in self.terms[course]])
        square = np.einsum("ik,ij,jk->k", up, gram, up) / 2
        return np.pi * self.radius_m**2 + self.radius_m * (sums @ up) + square

    def _moments(self, course):
        if course not in self.grams:
            count = max(FEWEST, int(FULL_TURN * self.radius_m / ARC_M))
            azimuth = FULL_TURN * (np.arange(count) + 0.5) / count
            around = np.array([one(azimuth) for one, _ in self.terms[course]])
            step = FULL_TURN / count
            self.grams[course] = around.sum(axis=1) * step, around @ around.T * step
        return self.grams[course]

    def volume_below(self, heights_m):
        """(rows,) true volumes below heights above the foot."""
        full = np.cumsum([0.0, *(self._part(course, 1.0) for course in range(self.courses))])
        found = []
        for height in heights_m:
            course = min(int(height / self.course_m), self.courses - 1)
            part = 2 * (height / self.course_m - course) - 1
            found.append(full[course] + self._part(course, part))
        return np.array(found)

    def _part(self, course, top):
        """Volume of a course from its foot to zeta = top."""
        node, weight = leggauss(16)
        middle, total = (top - 1) / 2, 0.0
        for low, high in ((-1.0, middle), (middle, top)):
            zeta = (low + high) / 2 + (high - low) / 2 * node
            total += (high - low) / 2 * weight @ self.areas(course, zeta)
        return total * self.course_m / 2


def make_wall(rng, family, *, radius_m, courses, bulge=True):
    """A `GeneratedWall` of a family; bulge False: its courses bulge only as the family does."""
    wall = GeneratedWall(radius_m, courses, rng.uniform(1.5, 2.5))
    _MAKERS[family](rng, wall)
    if bulge:
        size, bell = rng.uniform(1e-3, 8e-3), rng.uniform()
        for course in range(courses):
            own = size * (1 + 0.2 * rng.normal())

            def up(s, own=own):
                return own * (bell * (1 + np.cos(np.pi * s)) / 2 + (1 - bell) * (1 - s**2))

            wall.add(course, np.ones_like, up)
    for course in range(courses):
        step = 1e-3 * rng.normal()
        wall.add(course, np.ones_like, lambda s, step=step: step + 0 * s)
    return wall


def _arc(wall, azimuth, at):
    away = azimuth - at
    return wall.radius_m * (away - FULL_TURN * np.round(away / FULL_TURN))


def _cap(wall, at, half_m):
    """Function of the azimuth: a smooth cap of this half width."""

    def around(azimuth):
        part = np.clip(_arc(wall, azimuth, at) / half_m, -1, 1)
        return np.cos(np.pi / 2 * part) ** 2

    return around


def _cusps(wall, places, sizes, length_m):
    """Function of the azimuth: flanks that fall as exp(-arc / length)."""

    def around(azimuth):
        found = np.zeros(len(azimuth))
        for at, size in zip(places, sizes, strict=True):
            found += size * np.exp(-np.abs(_arc(wall, azimuth, at)) / length_m)
        return found

    return around


def _ovality(rng, wall, typical_m, growth=None):
    """Modes 2 to 8, that turn and change slowly with the height, or grow to the top."""
    top = wall.height_m
    for k in range(2, 9):
        size = typical_m * np.exp(0.5 * rng.normal()) * k**-0.3
        phase = rng.uniform(0, FULL_TURN)
        bends = 0.4 * size * rng.normal(), 0.3 * size * rng.normal(), rng.uniform(1, 2)

        def first(a, k=k, phase=phase):
            return np.cos(k * a - phase)

        def second(a, k=k, phase=phase):
            return np.sin(k * a - phase)

        def steady(z, size=size, bends=bends):
            return size + bends[0] * (2 * z / top - 1)

        def turning(z, bends=bends):
            return bends[1] * ((2 * z / top - 1) ** 2 - 1 / 3)

        def growing(z, size=size, bends=bends):
            return size * (growth + (1 - growth) * (z / top) ** bends[2])

        wall.add_to_all(first, steady if growth is None else growing)
        if growth is None:
            wall.add_to_all(second, turning)


def _coil(rng, wall):
    _ovality(rng, wall, rng.uniform(1e-3, 4e-3))
    sign = rng.choice([-1, -1, -1, 1])
    for _ in range(rng.integers(1, 5)):
        at, size = rng.uniform(0, FULL_TURN), sign * rng.uniform(5e-3, 40e-3)
        part, phase = rng.uniform(0, 0.3), rng.uniform(0, FULL_TURN)

        def up(z, part=part, phase=phase):
            return 1 + part * np.sin(FULL_TURN * z / wall.height_m + phase)

        wall.add_to_all(_cusps(wall, [at], [size], rng.uniform(0.3, 1.0) / 4), up)
    rise = rng.uniform(-4e-3, 4e-3)
    wall.add_to_all(np.ones_like, lambda z: rise * (2 * z / wall.height_m - 1))


def _brick(rng, wall):
    _ovality(rng, wall, rng.uniform(0.5e-3, 3e-3))
    plates = max(2, round(FULL_TURN * wall.radius_m / rng.uniform(6, 12)))
    peak, flank = rng.choice([-1, 1]) * rng.uniform(2e-3, 12e-3), rng.uniform(0.2, 0.6)
    length, start = rng.uniform(0.1, 0.3), rng.uniform(0, FULL_TURN)
    joints = rng.uniform(1e-3, 8e-3) * (1 + 0.25 * rng.normal(size=wall.courses + 1))
    joints[[0, -1]] = 0.0  # no girth weld at foot and top
    for course in range(wall.courses):
        places = np.arange(plates) + 0.5 * (course % 2) + 0.03 * rng.normal(size=plates)
        sizes = peak * (1 + 0.4 * rng.normal(size=plates))
        around = _cusps(wall, start + FULL_TURN / plates * places, sizes, flank)
        wall.add(course, around, lambda s: 1 - 0.25 * s**2)

        def drawn_in(s, low=joints[course], high=joints[course + 1]):
            half = wall.course_m / 2 / length
            return -low * np.exp(-(1 + s) * half) - high * np.exp(-(1 - s) * half)

        wall.add(course, np.ones_like, drawn_in)


def _dents(rng, wall):
    tolerance = np.interp(wall.radius_m, [6, 22.5, 37.5], [0.013, 0.019, 0.025])
    _ovality(rng, wall, tolerance / 6 * rng.uniform(0.2, 1), rng.uniform(0.2, 0.5))
    for _ in range(rng.integers(3, 11)):
        size = rng.choice([-1, -1, -1, -1, 1]) * rng.uniform(5e-3, 30e-3)
        at, half = rng.uniform(0, wall.height_m), rng.uniform(0.25, 1.25)

        def up(z, size=size, at=at, half=half):
            return size * np.cos(np.pi / 2 * np.clip((z - at) / half, -1, 1)) ** 2

        wall.add_to_all(_cap(wall, rng.uniform(0, FULL_TURN), rng.uniform(0.25, 2)), up)


def _buckle(rng, wall):
    _ovality(rng, wall, rng.uniform(0.3e-3, 1.5e-3))
    for _ in range(rng.integers(1, 3)):
        size = -rng.uniform(20e-3, 80e-3)
        around = _cap(wall, rng.uniform(0, FULL_TURN), rng.uniform(0.5, 2))
        course = int(rng.integers(wall.courses))
        wall.add(course, around, lambda s, size=size: size * np.cos(np.pi / 2 * s) ** 2)
    for _ in range(rng.integers(1, 4)):
        at, size, half = rng.uniform(0, wall.height_m), rng.uniform(1e-3, 6e-3), rng.uniform(0.3, 1)

        def up(z, at=at, size=size, half=half):
            return -size * np.exp(-2 * ((z - at) / half) ** 2)

        wall.add_to_all(np.ones_like, up)


def _chord(rng, wall):
    _ovality(rng, wall, rng.uniform(0.3e-3, 2e-3))
    plates = max(2, round(FULL_TURN * wall.radius_m / rng.uniform(6, 12)))
    mean, scatter = rng.uniform(-10e-3, 10e-3), rng.uniform(1e-3, 5e-3)
    start = rng.uniform(0, FULL_TURN)

    def plates_of(course):
        sagittas = mean + scatter * rng.normal(size=plates)
        shift = start + FULL_TURN / plates * 0.5 * (course % 2)

        def around(azimuth):
            place = np.mod(azimuth - shift, FULL_TURN) / FULL_TURN * plates
            plate = np.minimum(place.astype(int), plates - 1)
            return sagittas[plate] * (1 - (2 * (place - plate) - 1) ** 2) - 2 / 3 * mean

        return around

    own = [plates_of(course) for course in range(wall.courses)]
    for course in range(wall.courses):  # half of the neighbour's form at each joint
        low, high = 0.5 * (course > 0), 0.5 * (course < wall.courses - 1)

        def up(s, low=low, high=high):
            return 1 - low * np.clip(-s, 0, 1) ** 3 - high * np.clip(s, 0, 1) ** 3

        wall.add(course, own[course], up)
        if course:
            wall.add(course, own[course - 1], lambda s: 0.5 * np.clip(-s, 0, 1) ** 3)
        if course < wall.courses - 1:
            wall.add(course, own[course + 1], lambda s: 0.5 * np.clip(s, 0, 1) ** 3)


def _rough(rng, wall):
    _ovality(rng, wall, rng.uniform(0.5e-3, 3e-3))
    for _ in range(rng.integers(1, 4)):
        at, size = rng.uniform(0, FULL_TURN), -rng.uniform(10e-3, 40e-3)
        wall.add_to_all(_cusps(wall, [at], [size], rng.uniform(0.2, 0.4)), np.ones_like)
    size = rng.uniform(2e-3, 6e-3)
    for course in range(wall.courses):
        for at, half in ((0.0, 1e3), (-0.6, 0.5), (0.0, 0.5), (0.6, 0.5)):  # of half the course

            def up(s, at=at, half=half):
                return np.exp(-(((s - at) / half) ** 2))

            wall.add(course, _cusps_everywhere(rng, wall, size, 0.3), up)


def _cusps_everywhere(rng, wall, size_m, length_m):
    """Function of the azimuth: a cusp of either sign on every metre, straight over 0.05 m."""
    count = round(FULL_TURN * wall.radius_m / 0.05)
    grid = FULL_TURN / count * np.arange(count)
    sizes = np.zeros(count)
    np.add.at(sizes, rng.integers(count, size=count // 20), size_m * rng.normal(size=count // 20))
    flanks = np.exp(-np.abs(_arc(wall, grid, 0.0)) / length_m)
    radii = np.fft.irfft(np.fft.rfft(sizes) * np.fft.rfft(flanks), count)
    return lambda azimuth: np.interp(azimuth, grid, radii, period=FULL_TURN)


_MAKERS = {
    "coil": _coil,
    "brick": _brick,
    "dents": _dents,
    "buckle": _buckle,
    "chord": _chord,
    "rough": _rough,
}
RINGS = {1: ((0.5,), (0.2,), (0.8,)), 2: ((0.2, 0.8), (0.25, 0.75)), 3: ((0.15, 0.5, 0.85),)}


@dataclass(frozen=True)
class Survey:
    """Where a wall was measured, and the radii: (n,) each."""

    course: np.ndarray
    zeta: np.ndarray
    azimuth_rad: np.ndarray
    radius_m: np.ndarray
    noise_m: float


def survey(rng, wall, *, rings, points, noise_m, layout="even"):
    """A `Survey` of rings in each course: even, anywhere ("free") or with a gap up to 60 deg."""
    choice = RINGS[rings][rng.integers(len(RINGS[rings]))]
    base = FULL_TURN * np.arange(points) / points + rng.uniform(0, FULL_TURN)
    if layout == "gap":
        gap = np.radians(rng.uniform(20, 60))
        base = (
            rng.uniform(0, FULL_TURN) + gap + (FULL_TURN - gap) * (np.arange(points) + 0.5) / points
        )
    places = []
    for course in range(wall.courses):
        for part in choice:
            azimuth, zeta = base, np.full(points, 2 * part - 1)
            if layout == "free":
                jitter = rng.uniform(-0.35, 0.35, points) * FULL_TURN / points
                azimuth = base + rng.uniform(0, FULL_TURN) + jitter
                zeta = np.clip(zeta + rng.uniform(-0.1, 0.1, points), -0.95, 0.95)
            places.append((np.full(points, course), zeta, azimuth % FULL_TURN))
    course, zeta, azimuth = map(np.concatenate, zip(*places, strict=True))
    radius = wall.radius_at(course, zeta, azimuth) + noise_m * rng.normal(size=len(zeta))
    return Survey(course, zeta, azimuth, radius, noise_m)


@cache
def _any_job(folder):
    from job_builder import write_job

    return tankcal.load(write_job(folder))


def job_of(wall, measured, folder, *, given=True):
    """A Job of a survey of a wall that leans; its points with their sd, or without.

    folder  of an empty job, written once
    """
    job = _any_job(folder)
    z = (measured.course + (measured.zeta + 1) / 2) * wall.course_m
    radius, azimuth = measured.radius_m, measured.azimuth_rad
    xyz = np.column_stack([radius * np.sin(azimuth) + LEAN[0] * z,
                           radius * np.cos(azimuth) + LEAN[1] * z, z])  # fmt: skip
    count, along = len(z), wall.course_m * np.hypot(1, np.hypot(*LEAN))
    nothing = ("",) * count
    points = Points(
        names=tuple(f"P{i}" for i in range(count)),
        xyz_m=xyz,
        sd_m=np.full((count, 3), measured.noise_m) if given else None,
        covariance_m2=None,
        section=nothing,
        generatrix=nothing,
        rows=(None,) * count,
    )
    course = replace(job.courses[0], height_m=along, thickness_m=0.0, paint_m=0.0)
    return replace(
        job,
        points=points,
        courses=tuple(replace(course, name=str(i + 1)) for i in range(wall.courses)),
        inputs=(),
        tank=replace(job.tank, nominal_diameter_m=2 * wall.radius_m, nominal_height_m=None),
        datum=replace(job.datum, bottom_z_m=0.0),
        survey=replace(job.survey, side="inside"),
    )
