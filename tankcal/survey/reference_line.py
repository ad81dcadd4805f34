"""Reference lines: offsets of a wall from vertical lines of sight round it, level by level.

A line j at azimuth t stands upright but for the collimation kappa of its plummet. With dz the
height above the reference level, R_i(t) the radius of level i about the axis of that level, and
D_j a constant of the line,

    outside:  o_ij = D_j - R_i(t) + kappa dz,      inside:  o_ij = D_j + R_i(t) - kappa dz.

Turned by half a turn (face 2) the plummet leans the other way: -kappa. A circle whose centre is
off by e has R(t) = rho + e . n(t) - (e x n(t))^2 / (2 rho), so that the mean over even lines takes
out lean and shape:

    rho_i = rho_0 + mean(o_0j - o_ij) + kappa dz  (outside; inside both signs turn).

Source: ISO 7507-2; API MPMS 2.2B (method).
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.geometry.form import harmonics
from tankcal.geometry.outlines import FULL_TURN

ARCSEC = FULL_TURN / 1_296_000
SAME_LEVEL_M = 0.02  # heights that are read as one level
FEWEST_LINES = 4  # of a level: its radius, its centre, and one that controls them


@dataclass(frozen=True)
class Line:
    """A vertical line of sight.

    Attributes
    ----------
    name : str
    azimuth_rad : float
    instrument : str
        Name of a `Plummet`.
    inside : bool
        Whether it stands in the tank.
    row : int or None
        In its file.
    """

    name: str
    azimuth_rad: float
    instrument: str
    inside: bool = False
    row: int | None = None


@dataclass(frozen=True)
class Offset:
    """The wall's offset from a line, as read by a trolley.

    Attributes
    ----------
    line, course : str
    level_m : float
        Above the table's zero.
    offset_m, sd_m : float
    face : int
        1 or 2.
    reference : bool
        Whether it was read at the reference level.
    check : bool
        Only compared.
    row : int or None
        In its file.
    """

    line: str
    course: str
    level_m: float
    offset_m: float
    sd_m: float
    face: int = 1
    reference: bool = False
    check: bool = False
    row: int | None = None


@dataclass(frozen=True)
class Plummet:
    """An instrument that makes upright lines, and the scale that is read from it.

    Attributes
    ----------
    name : str
    correction : float
        True length = reading (1 + correction).
    u_scale : float
        Standard uncertainty of that, relative.
    u_collimation_rad : float or None
        Of the collimation; None: both faces tell it.
    certificate : str
    """

    name: str
    correction: float = 0.0
    u_scale: float = 0.0
    u_collimation_rad: float | None = None
    certificate: str = ""


@dataclass(frozen=True)
class ReferenceLines:
    """Lines of sight round a tank, and the offsets of its wall from them.

    Attributes
    ----------
    lines : dict
        {name: Line}.
    offsets : tuple of Offset
        In the order of the file.
    plummets : dict
        {name: Plummet}.
    """

    lines: dict
    offsets: tuple[Offset, ...]
    plummets: dict = field(default_factory=dict)

    def of(self, offset):
        """The `Line` that an offset was read from, and its `Plummet`."""
        line = self.lines[offset.line]
        return line, self.plummets[line.instrument]

    @property
    def reference_m(self):
        """Mean height of the reference level."""
        return float(np.mean([one.level_m for one in self.offsets if one.reference]))

    def radial_m(self, offset):
        """What an offset says of the radius of the wall but for the constant of its line, m."""
        line, plummet = self.of(offset)
        size = offset.offset_m * (1 + plummet.correction)
        return size if line.inside else -size

    def by_collimation_m(self, offset):
        """Derivative of `radial_m` by the collimation, m per radian."""
        upwards = offset.level_m - self.reference_m
        return upwards if offset.face == 2 else -upwards


@dataclass(frozen=True)
class Level:
    """What the readings of one level say by themselves.

    Attributes
    ----------
    course : str
    level_m : float
    lines : int
        That read it.
    rise_m : float
        Mean radius less that of the reference level, m.
    centre_m : tuple of float
        x and y of its centre, from that of the reference level.
    """

    course: str
    level_m: float
    lines: int
    rise_m: float
    centre_m: tuple[float, float]


@dataclass(frozen=True)
class Lean:
    """Slope of the axis, m/m towards +x and +y, and its standard uncertainty; nan: not known."""

    x: float
    y: float
    sd: float


def courses_told(seen, strapped, read):
    """Set of the courses whose radius is told: by points, by a tape, or carried there by lines.

    A line carries the radius of each course that it reads to all others, so that one of them is
    enough.

    Parameters
    ----------
    seen, strapped, read : set
        Courses with points, with straps, with offsets from reference lines.

    Examples
    --------
    >>> sorted(courses_told({1}, {4}, {1, 2, 3}))
    [1, 2, 3, 4]
    >>> sorted(courses_told({1}, set(), {2, 3}))
    [1]
    """
    told = set(seen) | set(strapped)
    return told | set(read) if told & set(read) else told


def level_names(offsets):
    """(n,) number of the level of each offset: those of a course within SAME_LEVEL_M are one."""
    levels, numbers = [], []
    for one in offsets:
        known = (
            number
            for number, (course, level_m) in enumerate(levels)
            if course == one.course and abs(level_m - one.level_m) <= SAME_LEVEL_M
        )
        number = next(known, None)
        if number is None:
            number = len(levels)
            levels.append((one.course, one.level_m))
        numbers.append(number)
    return np.array(numbers, dtype=int)


def levels_of(given, offsets, collimations):
    """`Level` of every level but the reference, by arithmetic that a reader can repeat.

    Parameters
    ----------
    given : ReferenceLines
    offsets : sequence of Offset
        Those that are believed.
    collimations : dict
        {plummet: kappa, rad}.
    """
    rises = rises_of(given, offsets, collimations)
    levels = [_level(given, read) for read in rises if len(read) >= FEWEST_LINES - 1]
    return tuple(sorted(levels, key=lambda one: one.level_m))


def rises_of(given, offsets, collimations):
    """Of each level but the reference [(line, rise over its reference, first offset there)], m.

    given, offsets, collimations  as of `levels_of`
    """
    by_line, values = {}, {}
    for one, number in zip(offsets, level_names(offsets), strict=True):
        kappa = collimations.get(given.of(one)[0].instrument, 0.0)
        radial = given.radial_m(one) - kappa * given.by_collimation_m(one)
        if one.reference:
            by_line.setdefault(one.line, []).append(radial)
        else:
            values.setdefault((number, one.line), []).append((radial, one))
    found = {}
    for (number, line), read in values.items():
        if line in by_line:
            rise = np.mean([radial for radial, _ in read]) - np.mean(by_line[line])
            found.setdefault(number, []).append((line, rise, read[0][1]))
    return tuple(found.values())


def _level(given, read):
    azimuth = np.array([given.lines[line].azimuth_rad for line, _, _ in read])
    rises = np.array([rise for _, rise, _ in read])
    mean, y, x = np.linalg.lstsq(harmonics(azimuth, 1), rises, rcond=None)[0]
    level_m = float(np.mean([one.level_m for _, _, one in read]))
    return Level(read[0][2].course, level_m, len(read), float(mean), (float(x), float(y)))


def lean_of(given, levels):
    """`Lean` of the straight axis through the centres of all levels.

    Its uncertainty comes from the scatter of the centres about it: of two levels there is none.
    """
    heights = np.array([given.reference_m, *(one.level_m for one in levels)])
    centres = np.array([(0.0, 0.0), *(one.centre_m for one in levels)])
    design = np.column_stack([np.ones(len(heights)), heights - heights.mean()])
    spread = float(np.sum(design[:, 1] ** 2))
    if not spread:
        return Lean(np.nan, np.nan, np.nan)
    found = np.linalg.lstsq(design, centres, rcond=None)[0]
    free = 2 * (len(heights) - 2)
    if not free:
        return Lean(*map(float, found[1]), np.nan)
    scatter = np.sum((centres - design @ found) ** 2) / free
    return Lean(*map(float, found[1]), float(np.sqrt(scatter / spread)))


def collimation_by_faces(given, offsets, instrument):
    """(kappa, its sd) of a plummet by the differences of its two faces alone, rad; None: one face.

    kappa = sum d dz / (2 sum dz^2) over the places read on both faces, d the difference of the
    offsets outside; u = s / sqrt(2 N sum dz^2) with s the sd of a reading.

    Examples
    --------
    >>> lines = {"1": Line("1", 0.0, "P")}
    >>> read = [Offset("1", "1", 0.0, 0.2, 5e-4, 1, True), Offset("1", "1", 10.0, 0.2003, 5e-4, 1),
    ...         Offset("1", "1", 10.0, 0.1997, 5e-4, 2)]
    >>> given = ReferenceLines(lines, tuple(read), {"P": Plummet("P")})
    >>> kappa, sd = collimation_by_faces(given, read, "P")
    >>> round(kappa / ARCSEC, 2), round(sd / ARCSEC, 2)
    (6.19, 7.29)
    """
    places = {}
    for one, number in zip(offsets, level_names(offsets), strict=True):
        if given.lines[one.line].instrument == instrument:
            faces = places.setdefault((one.line, number), ([], []))
            faces[one.face - 1].append(one)
    top = bottom = 0.0
    for both in places.values():
        if not all(both):
            continue
        apart = np.diff([np.mean([given.radial_m(one) for one in face]) for face in both])[0]
        by = np.diff([np.mean([given.by_collimation_m(one) for one in face]) for face in both])[0]
        weight = 1 / sum(np.mean([one.sd_m**2 for one in face]) / len(face) for face in both)
        top += weight * by * apart
        bottom += weight * by**2
    return (float(top / bottom), float(bottom**-0.5)) if bottom else None
