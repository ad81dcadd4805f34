"""Reference lines: offsets of a wall from vertical lines of sight round it, level by level.

A line j at azimuth t is vertical except for the collimation kappa of its plummet. With dz the
height above the reference level, R_i(t) the radius of level i about the axis of that level, and D_j
a constant of the line,

    outside:  o_ij = D_j - R_i(t) + kappa dz,      inside:  o_ij = D_j + R_i(t) - kappa dz.

In face 2 (rotated by half a turn) the plummet leans the opposite way: -kappa. A circle whose centre
is displaced by e has R(t) = rho + e . n(t) - (e x n(t))^2 / (2 rho). The mean over evenly spaced
lines therefore eliminates lean and shape:

    rho_i = rho_0 + mean(o_0j - o_ij) + kappa dz  (outside; inside both signs change).

Source: ISO 7507-2; API MPMS 2.2B (method).
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.geometry.outlines import harmonics
from tankcal.messages import message
from tankcal.units import ARCSEC as ARCSEC  # for callers, who state angles in arc seconds

SAME_LEVEL_M = 0.02  # largest difference of heights regarded as one level
FEWEST_LINES = 4  # lines per level: three for radius and centre, and one redundant
MOST_OFFSETS = 2000  # largest number of readings of one tank


def too_many_offsets(count):
    """Message about more offsets than can be used."""
    return message(
        "too_many_offsets",
        "{count} offsets; expected at most {most}",
        count=count,
        most=MOST_OFFSETS,
    )


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
        Whether the line is inside the tank.
    row : int or None
        Row of the file.
    """

    name: str
    azimuth_rad: float
    instrument: str
    inside: bool = False
    row: int | None = None


@dataclass(frozen=True)
class Offset:
    """Offset of the wall from a line, read on a trolley.

    Attributes
    ----------
    line, course : str
    level_m : float
        Height above the zero of the table.
    offset_m, sd_m : float
    face : int
        1 or 2.
    reference : bool
        Whether it was read at the reference level.
    check : bool
        True: compared only.
    row : int or None
        Row of the file.
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
    """An instrument that defines vertical lines, with the scale of its readings.

    Attributes
    ----------
    name : str
    correction : float
        True length = reading (1 + correction).
    u_scale : float
        Relative standard uncertainty of the scale.
    u_collimation_rad : float or None
        Standard uncertainty of the collimation; None: estimated from both faces.
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
        """Return the `Line` of an offset, and the `Plummet` of the line."""
        line = self.lines[offset.line]
        return line, self.plummets[line.instrument]

    @property
    def reference_m(self):
        """Mean height of the reference level, m."""
        return float(np.mean([offset.level_m for offset in self.offsets if offset.reference]))

    def radial_m(self, offset):
        """Radius of the wall minus the constant of the line, from an offset, m."""
        line, plummet = self.of(offset)
        size = offset.offset_m * (1 + plummet.correction)
        # Outside, a larger offset means a smaller radius.
        return size if line.inside else -size

    def by_collimation_m(self, offset):
        """Derivative of `radial_m` by the collimation, m/rad."""
        upwards = offset.level_m - self.reference_m
        # In face 2 the plummet leans the opposite way.
        return upwards if offset.face == 2 else -upwards


@dataclass(frozen=True)
class Level:
    """Radius and centre estimated from the readings of one level alone.

    Attributes
    ----------
    course : str
    level_m : float
    lines : int
        Number of lines read at the level.
    rise_m : float
        Mean radius minus that of the reference level, m.
    centre_m : tuple of float
        x and y of its centre relative to the centre of the reference level, m.
    """

    course: str
    level_m: float
    lines: int
    rise_m: float
    centre_m: tuple[float, float]


@dataclass(frozen=True)
class Lean:
    """Slope of the axis towards +x and +y, m/m, and its standard uncertainty; nan: unknown."""

    x: float
    y: float
    sd: float


def courses_with_radius(seen, strapped, read):
    """Set of the courses with a known radius: from points, a tape, or by transfer along lines.

    A line transfers the radius of one of its courses to all its other courses.

    Parameters
    ----------
    seen, strapped, read : set
        Courses with points, with straps, with offsets from reference lines.

    Returns
    -------
    set

    Examples
    --------
    >>> sorted(courses_with_radius({1}, {4}, {1, 2, 3}))
    [1, 2, 3, 4]
    >>> sorted(courses_with_radius({1}, set(), {2, 3}))
    [1]
    """
    with_radius = set(seen) | set(strapped)
    return with_radius | set(read) if with_radius & set(read) else with_radius


def level_names(offsets):
    """Number (n,) of the level of each offset; heights of a course within SAME_LEVEL_M are one."""
    levels, numbers = [], []
    for offset in offsets:
        matches = (
            number
            for number, (course, level_m) in enumerate(levels)
            if course == offset.course and abs(level_m - offset.level_m) <= SAME_LEVEL_M
        )
        number = next(matches, None)
        if number is None:
            number = len(levels)
            levels.append((offset.course, offset.level_m))
        numbers.append(number)
    return np.array(numbers, dtype=int)


def levels_of(reference_lines, offsets, collimations):
    """Estimate each level except the reference by arithmetic that a reader can repeat.

    Parameters
    ----------
    given : ReferenceLines
    offsets : sequence of Offset
        Accepted offsets.
    collimations : dict
        {plummet: kappa, rad}.

    Returns
    -------
    tuple of Level
        From the bottom up; levels with too few lines are omitted.
    """
    rises = rises_of(reference_lines, offsets, collimations)
    # Three lines determine radius and centre.
    levels = [
        _level(reference_lines, rises_of_level)
        for rises_of_level in rises
        if len(rises_of_level) >= FEWEST_LINES - 1
    ]
    return tuple(sorted(levels, key=lambda level: level.level_m))


def rises_of(reference_lines, offsets, collimations):
    """Rises of the wall over the reference level, by level and line.

    Parameters
    ----------
    given : ReferenceLines
    offsets : sequence of Offset
    collimations : dict
        {plummet: kappa, rad}.

    Returns
    -------
    tuple of list
        For each level except the reference [(line, rise over the reference of the line in m, first
        offset there)].
    """
    by_line, values = {}, {}
    for offset, number in zip(offsets, level_names(offsets), strict=True):
        kappa = collimations.get(reference_lines.of(offset)[0].instrument, 0.0)
        radial = reference_lines.radial_m(offset) - kappa * reference_lines.by_collimation_m(offset)
        if offset.reference:
            by_line.setdefault(offset.line, []).append(radial)
        else:
            values.setdefault((number, offset.line), []).append((radial, offset))
    rises = {}
    for (number, line), readings in values.items():
        if line in by_line:
            # The constant D_j of the line cancels in the difference from its reference.
            rise = np.mean([radial for radial, _ in readings]) - np.mean(by_line[line])
            rises.setdefault(number, []).append((line, rise, readings[0][1]))
    return tuple(rises.values())


def _level(reference_lines, rises_of_level):
    """Fit mean radius and centre of a level to its rises."""
    azimuth = np.array([reference_lines.lines[line].azimuth_rad for line, _, _ in rises_of_level])
    rises = np.array([rise for _, rise, _ in rises_of_level])
    # Rise = mean + y cos t + x sin t; azimuths are clockwise from +y.
    mean, y, x = np.linalg.lstsq(harmonics(azimuth, 1), rises, rcond=None)[0]
    level_m = float(np.mean([offset.level_m for _, _, offset in rises_of_level]))
    return Level(
        rises_of_level[0][2].course, level_m, len(rises_of_level), float(mean), (float(x), float(y))
    )


def lean_of(reference_lines, levels):
    """Fit a straight axis to the centres of all levels.

    Parameters
    ----------
    given : ReferenceLines
    levels : sequence of Level

    Returns
    -------
    Lean
        Its uncertainty comes from the scatter of the centres; two levels leave it undetermined.
    """
    heights = np.array([reference_lines.reference_m, *(level.level_m for level in levels)])
    centres = np.array([(0.0, 0.0), *(level.centre_m for level in levels)])
    # Heights relative to their mean decouple slope and intercept.
    design = np.column_stack([np.ones(len(heights)), heights - heights.mean()])
    spread = float(np.sum(design[:, 1] ** 2))
    if not spread:
        return Lean(np.nan, np.nan, np.nan)
    coefficients = np.linalg.lstsq(design, centres, rcond=None)[0]
    # Two coordinates per centre; each axis estimates intercept and slope.
    dof = 2 * (len(heights) - 2)
    if not dof:
        return Lean(*map(float, coefficients[1]), np.nan)
    scatter = np.sum((centres - design @ coefficients) ** 2) / dof
    return Lean(*map(float, coefficients[1]), float(np.sqrt(scatter / spread)))


def collimation_by_faces(reference_lines, offsets, instrument):
    """Estimate the collimation of a plummet from the differences of its two faces.

    kappa = sum d dz / (2 sum dz^2) over the places read in both faces, with d the difference of the
    outside offsets; u = s / sqrt(2 N sum dz^2) with s the standard deviation of a reading.

    Parameters
    ----------
    given : ReferenceLines
    offsets : sequence of Offset
    instrument : str
        Name of the plummet.

    Returns
    -------
    tuple of (float, float) or None
        kappa and its standard deviation, rad; None: no place was read in both faces.

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
    for offset, number in zip(offsets, level_names(offsets), strict=True):
        if reference_lines.lines[offset.line].instrument == instrument:
            faces = places.setdefault((offset.line, number), ([], []))
            faces[offset.face - 1].append(offset)
    numerator = denominator = 0.0
    for pair in places.values():
        if not all(pair):
            continue
        # The difference of the faces depends on kappa only: radius and line constant cancel.
        difference = np.diff(
            [np.mean([reference_lines.radial_m(offset) for offset in face]) for face in pair]
        )[0]
        derivative = np.diff(
            [
                np.mean([reference_lines.by_collimation_m(offset) for offset in face])
                for face in pair
            ]
        )[0]
        # Inverse variance of the difference of the two means.
        weight = 1 / sum(np.mean([offset.sd_m**2 for offset in face]) / len(face) for face in pair)
        numerator += weight * derivative * difference
        denominator += weight * derivative**2
    return (float(numerator / denominator), float(denominator**-0.5)) if denominator else None
