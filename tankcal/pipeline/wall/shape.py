"""Shape of an upright wall for an inspection: radii about the level centres, and plumb.

At each surveyed level, and 0.3 m above the bottom, the shape is the inside radius r about the
centre of that level. Between levels l and m, along the generatrix at azimuth t with direction n, it
is

    r_m(t) - r_l(t) + n(t) . (c_m - c_l),

with c the centres of the levels. All values have one covariance, from the survey and from form that
the survey did not see. Common plates, offsets and scales therefore cancel in differences.

Measured radii are used as read, other radii are estimated. Plate, paint and the head of the liquid
during the survey are subtracted.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from tankcal.geometry.field.components import COMPONENTS, KINDS
from tankcal.geometry.field.estimate import FieldValues, Spots
from tankcal.geometry.outlines import radii_square_to_axis
from tankcal.methods.base import completing_method
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.tanks.vertical import bearing_inputs, insets_of
from tankcal.pipeline.wall.surveyed import Wall
from tankcal.tank.hydrostatics import LiquidHead
from tankcal.uncertainty import Source, combine, declared_source, group_correlated
from tankcal.units import FOOT_M, FULL_TURN

LOW_M = FOOT_M  # height of the low radii: one foot above the bottom weld
SAME_LEVEL_M = 0.05  # largest height difference of equal levels
# Largest number of measured azimuths of a level; number after thinning.
MOST_AZIMUTHS, EVEN_AZIMUTHS = 72, 36
LEAST_HEIGHT = 0.2  # least distance of two levels for a plumb, relative to the course height
NEAR_M = 0.1  # largest distance from the wall of a point that may be a dent
SAME_PLACE_M = 0.1  # largest distance along the arc of a reading from its generatrix
LEAST_U_M = 1e-9  # lower bound of a standard uncertainty, against rounding


@dataclass(frozen=True)
class Level:
    """A horizontal section of the wall.

    Attributes
    ----------
    height_m : float
        Height above the bottom of the shell, m.
    course : int
        Index of the course, from 0.
    zeta : float
        Relative height within the course, -1 to 1.
    azimuth_rad : ndarray, shape (a,)
        Azimuths in ascending order, of the readings if these lie on one level.
    ring : int
        Ring of the field; -1 if no points have this height, so that the centre is unknown.
    site : ndarray of int, shape (a,)
        Reading of the field at each azimuth; -1 if the radius is estimated.
    is_low : bool
        Whether the low radii are judged at this level.
    """

    height_m: float
    course: int
    zeta: float
    azimuth_rad: np.ndarray
    ring: int
    site: np.ndarray
    is_low: bool = False


@dataclass(frozen=True)
class Figures:
    """Values with standard uncertainties and degrees of freedom, three arrays of one shape."""

    value_m: np.ndarray
    u_m: np.ndarray
    dof: np.ndarray

    def part(self, start, end):
        """The figures of some rows."""
        return Figures(self.value_m[start:end], self.u_m[start:end], self.dof[start:end])


class ShapeBase:
    """Radii at spots, then centres, of the wall of a job, with their uncertainty.

    Parameters
    ----------
    job : Job
    wall : Wall
    levels : sequence of Level
    plumbed : list of int
        Indices of the levels that have a centre.
    pairs : sequence of (int, int)
        Levels to be compared along the generatrices of the first.
    """

    def __init__(self, job, wall, levels, plumbed, pairs):
        self._job, self._wall, self._levels = job, wall, levels
        self._place, spots = {}, []
        for i, spot_level in enumerate(levels):
            for angle, site in zip(spot_level.azimuth_rad, spot_level.site, strict=True):
                self._add(spots, i, angle, site)
        for low, high in pairs:
            for angle in levels[low].azimuth_rad:
                self._add(spots, high, angle, self._reading_near(levels[high], angle))
        self._count = len(spots)
        self._centre_of = {i: number for number, i in enumerate(plumbed)}
        level_of_spot, angle, site = map(np.array, zip(*spots, strict=True))
        self._site = site
        sites = wall.field.sites
        zeta = np.array([level.zeta for level in levels])[level_of_spot]
        spots = Spots(
            course=np.array([level.course for level in levels])[level_of_spot],
            zeta=np.where(site >= 0, sites.zeta[site], zeta),
            azimuth_rad=np.where(site >= 0, sites.azimuth_rad[site], angle),
            site=site,
        )
        rings = [(levels[i].ring, levels[i].zeta) for i in plumbed]
        self._found = FieldValues(wall.field, spots, rings)
        self._height_m = np.array([level.height_m for level in levels])[level_of_spot]
        inset = np.array(insets_of(job, job.switches))[spots.course]
        self._head_m, self.state = self._widening()
        self._surveyed = self._found.value_m.copy()
        # Radii of the field are square to the axis; these are radii of horizontal sections.
        self._surveyed[: self._count] /= radii_square_to_axis(spots.azimuth_rad, 1.0, self._slope)
        self._value_m = self._surveyed.copy()
        self._value_m[: self._count] += self._head_m - inset
        self._sources = self._causes()

    def _add(self, spots, level, angle, site):
        """Add a spot of a level at an azimuth, unless present, with its reading if there is one."""
        if (level, float(angle)) not in self._place:
            self._place[level, float(angle)] = len(spots)
            spots.append((level, float(angle), int(site)))

    def _reading_near(self, level, angle):
        """Reading of a level on a generatrix, or -1 without such a reading."""
        difference = np.abs((level.azimuth_rad - angle + np.pi) % FULL_TURN - np.pi)
        nearest = int(np.argmin(difference))
        is_near = difference[nearest] * self._wall.field.nominal_m <= SAME_PLACE_M
        return level.site[nearest] if is_near else -1

    def _widening(self):
        """Increase (p,) of the radii when the survey's liquid is removed, m, and the state."""
        job = self._job
        is_loaded = job.survey.liquid_density_kg_m3 and job.survey.liquid_level_m
        if not (is_loaded and job.switches.head):
            return np.zeros(self._count), "as_found"
        body = body_of(job, self._wall, uncertain=False)
        head = next(part for part in body.parts if isinstance(part, LiquidHead))
        return head.with_density(0.0).widening_m(self._height_m, 0.0), "unloaded"

    def centre(self, level):
        """Position (x, y) of the centre of a level in the frame of the survey, m."""
        chosen, wall = self._levels[level], self._wall
        column = self._count + 2 * self._centre_of[level]
        height_above = chosen.height_m - wall.sections[chosen.ring].group.height_m
        return (
            wall.origins_m[chosen.ring]
            + self._surveyed[column : column + 2]
            + height_above * self._slope
        )

    def radii(self, level, azimuth):
        """Rows (a, f) that select the radii of a level."""
        rows = np.zeros((len(azimuth), len(self._value_m)))
        spots = [self._place[level, float(angle)] for angle in azimuth]
        rows[np.arange(len(azimuth)), spots] = 1.0
        return rows

    def plumb(self, low, high):
        """Rows (g, f) of the deviations of one level from the plumb of another."""
        azimuth = self._levels[low].azimuth_rad
        direction = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
        rows = self.radii(high, azimuth) - self.radii(low, azimuth)
        for level, sign in ((high, 1.0), (low, -1.0)):
            column = self._count + 2 * self._centre_of[level]
            rows[:, column : column + 2] += sign * direction
        return rows

    def is_read(self, low, high):
        """Mask (g,) of the generatrices on which both levels have readings."""
        pairs = [[self._site[self._place[i, float(angle)]] for i in (low, high)]
                 for angle in self._levels[low].azimuth_rad]  # fmt: skip
        return np.all(np.array(pairs) >= 0, axis=1)

    def axis(self, low, high):
        """Rows (3, f) of x and y between the centres of two levels, and of their distance."""
        rows = np.zeros((3, len(self._value_m)))
        for level, sign in ((high, 1.0), (low, -1.0)):
            column = self._count + 2 * self._centre_of[level]
            rows[:2, column : column + 2] += sign * np.eye(2)
        between = self.centre(high) - self.centre(low)
        distance = np.hypot(*between)
        # The distance changes only by displacements along the line between the centres.
        rows[2] = (between / distance if distance > 0 else np.array([1.0, 0.0])) @ rows[:2]
        return rows

    def figures(self, rows):
        """`Figures` of rows (r, f) with few nonzero elements each."""
        rows = scipy.sparse.csr_array(rows)
        value = rows @ self._value_m
        value += rows[:, self._count :] @ self._origins()
        unseen = self._found.undetermined_variances(rows)
        kinds = np.array([component.kind for component in COMPONENTS])
        variances = [unseen[kinds == kind].sum(axis=0) for kind in KINDS]
        parts = [Source("", np.sqrt(np.maximum(variance, 0.0))[:, None]) for variance in variances]
        by_survey = [cause.mapped(lambda columns: rows @ columns) for cause in self._sources]
        combined = combine([*by_survey, *parts], len(value))
        return Figures(value, np.maximum(combined.u, LEAST_U_M), combined.effective_dof)

    def _origins(self):
        """Reference points (2c,) of the centres in the frame of the survey, m."""
        origins = [
            self.centre(i) - self._surveyed[self._count + 2 * c : self._count + 2 * c + 2]
            for i, c in self._centre_of.items()
        ]
        return np.concatenate(origins) if origins else np.zeros(0)

    def _causes(self):
        """`Source`s of the uncertainty from the survey and from declared inputs."""
        job, wall = self._job, self._wall
        factors = wall.factors(job, self._found.weights)
        derivatives = self._derivatives()
        declared = {
            declared_input.name: declared_source(declared_input, derivatives[declared_input.name])
            for declared_input in job.inputs
            if declared_input.name in derivatives and declared_input.name not in wall.without_inputs
        }
        survey = [factor.source(factor.columns) for factor in factors]
        return [*survey, *group_correlated(declared, job.correlations)]

    def _derivatives(self):
        """{input: derivative (f,) of the radii and centres}."""
        job, count = self._job, self._count
        is_radius = np.arange(len(self._value_m)) < count
        derivatives = {"offset": 1.0 * is_radius, "scale": np.where(is_radius, self._surveyed, 0.0)}
        bearing, outside = bearing_inputs(job, job.switches), job.survey.side == "outside"
        for name in ("plate_thickness", "paint"):
            if name in bearing:
                derivatives[name] = -float(outside) * is_radius
        for name, column in self._wall.read_with(self._found.weights).items():
            if name in bearing:
                derivatives[name] = derivatives.get(name, 0.0) + column
        for name, column in self._derivatives_of_head().items():
            full = np.append(column, np.zeros(len(self._value_m) - count))
            derivatives[name] = derivatives.get(name, 0.0) + full
        return derivatives

    def _derivatives_of_head(self):
        """{input: derivative (p,) of the subtracted head}.

        The head is K rho (h - z), with K proportional to 1 / (E t).
        """
        if self.state == "as_found":
            return {}
        job, head = self._job, self._head_m
        plate = np.array([course.thickness_m for course in job.courses])
        course = np.searchsorted(self._wall.joints_m[1:-1], self._height_m, side="right")
        above = job.survey.liquid_level_m + job.datum.plate_level_m - self._height_m
        return {
            "youngs_modulus": -head / job.material.e_pa,
            "plate_thickness": -head / plate[course],
            "survey_density": head / job.survey.liquid_density_kg_m3,
            "survey_level": np.where(above > 0, head / np.maximum(above, 1e-9), 0.0),
        }

    @property
    def _slope(self):
        return np.array(self._wall.shell.slope)


@dataclass(frozen=True)
class Plumb:
    """Deviations of the upper of two levels from the plumb, outwards positive, by azimuth.

    Attributes
    ----------
    low, high : int
        Indices of the levels in the `WallShape`.
    azimuth_rad : ndarray, shape (g,)
    is_read : ndarray of bool, shape (g,)
        Whether both ends were measured; otherwise at least one end is estimated from neighbours.
    figures : Figures
        Deviations with their uncertainty.
    """

    low: int
    high: int
    azimuth_rad: np.ndarray
    is_read: np.ndarray
    figures: Figures


@dataclass(frozen=True)
class SetAside:
    """Rejected point near the wall: a fitting, a mistake or a dent.

    Attributes
    ----------
    point : str
        Name.
    height_m, azimuth_rad : float
        Height above the bottom of the shell, m, and azimuth about the axis.
    residual_m : float
        Outward distance from the wall of the accepted points, m.
    """

    point: str
    height_m: float
    azimuth_rad: float
    residual_m: float


@dataclass(frozen=True)
class WallShape:
    """Shape of a wall for an inspection.

    Attributes
    ----------
    set_aside : tuple of SetAside
        Rejected points near the wall.
    state : str
        "as_found": loaded as during the survey; "unloaded": without the head of the survey's
        liquid.
    levels : tuple of Level
        From the bottom up.
    radii : tuple of Figures
        Inside radii of each level about its centre, at its azimuths.
    centres_m : tuple
        (x, y) of each level in the frame of the survey; None if unknown.
    plumbs : tuple of Plumb
        Each level with a centre against the lowest such level; () for fewer than two.
    axis : Figures or None
        x and y of the highest centre minus the lowest, then the length of this difference.
    courses : tuple of Plumb
        Highest against lowest level of each course with two levels sufficiently far apart.
    """

    set_aside: tuple[SetAside, ...]
    state: str
    levels: tuple[Level, ...]
    radii: tuple[Figures, ...]
    centres_m: tuple
    plumbs: tuple[Plumb, ...]
    axis: Figures | None
    courses: tuple[Plumb, ...]


def wall_shape_of(job, wall):
    """`WallShape` of a job's wall; None unless the wall was surveyed by points."""
    if not isinstance(wall, Wall) or completing_method(job) is not None:
        return None
    levels = _levels(job, wall)
    plumbed = [i for i, level in enumerate(levels) if level.ring >= 0]
    pairs = [(plumbed[0], upper) for upper in plumbed[1:]]
    of_courses = _pairs_of_courses(wall, levels, plumbed)
    base = ShapeBase(job, wall, levels, plumbed, (*pairs, *of_courses))
    rows = [base.radii(i, level.azimuth_rad) for i, level in enumerate(levels)]
    rows += [base.plumb(*pair) for pair in (*pairs, *of_courses)]
    if pairs:
        rows.append(base.axis(*pairs[-1]))
    all_figures = base.figures(np.vstack(rows))
    ends = np.cumsum([0, *map(len, rows)])
    figures = [all_figures.part(*pair) for pair in pairwise(ends)]
    radii, differences = figures[: len(levels)], figures[len(levels) :]
    plumbs = [
        Plumb(low, high, levels[low].azimuth_rad, base.is_read(low, high), part)
        for (low, high), part in zip((*pairs, *of_courses), differences, strict=False)
    ]
    return WallShape(
        tuple(_set_aside(job, wall)),
        base.state,
        levels,
        tuple(radii),
        tuple(base.centre(i) if i in plumbed else None for i in range(len(levels))),
        tuple(plumbs[: len(pairs)]),
        differences[-1] if pairs else None,
        tuple(plumbs[len(pairs) :]),
    )


def _set_aside(job, wall):
    """Rejected points near the wall."""
    shell, xyz = wall.shell, job.points.xyz_m
    is_near = (shell.reason != "") & (np.abs(shell.residual_m) <= NEAR_M)
    for i in np.flatnonzero(is_near):
        axis = np.array(shell.axis_m) + (xyz[i, 2] - shell.z_m) * np.array(shell.slope)
        x, y = xyz[i, :2] - axis
        yield SetAside(
            job.points.names[i],
            float(xyz[i, 2] - job.datum.bottom_z_m),
            float(np.arctan2(x, y) % FULL_TURN),
            float(shell.residual_m[i]),
        )


def _levels(job, wall):
    """Levels of the sections, and the low level; an inclined section has two levels."""
    levels = []
    for ring, section in enumerate(wall.sections):
        group, sites_of_ring = section.group, _readings_of(wall.field.sites, ring)
        azimuth = wall.field.sites.azimuth_rad[sites_of_ring] % FULL_TURN
        if group.degree == 0:
            height, zeta = group.height_m, float(group.zeta(group.height_m))
            levels.append(Level(height, group.course, zeta, azimuth, ring, sites_of_ring))
            continue
        points = wall.accepted[group.members]
        heights = job.points.xyz_m[points, 2] - job.datum.bottom_z_m
        for height_m in np.quantile(heights, [0.1, 0.9]).tolist():
            zeta = float(group.zeta(height_m))
            levels.append(
                Level(height_m, group.course, zeta, azimuth, ring, np.full(len(sites_of_ring), -1))
            )
    levels.sort(key=lambda level: level.height_m)
    return _with_low(levels, wall.joints_m[1])


def _with_low(levels, top_m):
    """Levels with the low level marked, or added; `top_m` is the top of the first course."""
    place = min(range(len(levels)), key=lambda i: abs(levels[i].height_m - LOW_M))
    nearest = levels[place]
    if abs(nearest.height_m - LOW_M) <= SAME_LEVEL_M:
        levels[place] = replace(nearest, is_low=True)
    elif top_m > LOW_M:
        low = replace(
            levels[0],
            height_m=LOW_M,
            course=0,
            zeta=2 * LOW_M / top_m - 1,
            ring=-1,
            site=np.full(len(levels[0].site), -1),
            is_low=True,
        )
        levels = sorted([*levels, low], key=lambda level: level.height_m)
    return tuple(levels)


def _readings_of(sites, ring):
    """Readings of a ring by azimuth, thinned to an even spacing if numerous."""
    of_ring = np.flatnonzero(sites.ring == ring)
    azimuth = sites.azimuth_rad[of_ring] % FULL_TURN
    of_ring = of_ring[np.argsort(azimuth, kind="stable")]
    if len(of_ring) <= MOST_AZIMUTHS:
        return of_ring
    targets = np.arange(EVEN_AZIMUTHS) * FULL_TURN / EVEN_AZIMUTHS
    distance = np.abs((np.sort(azimuth)[:, None] - targets + np.pi) % FULL_TURN - np.pi)
    return of_ring[np.unique(np.argmin(distance, axis=0))]


def _pairs_of_courses(wall, levels, plumbed):
    """(Lowest, highest) level of each course in which two levels are sufficiently far apart."""
    pairs = []
    for course, height in enumerate(np.diff(wall.joints_m)):
        of_course = [i for i in plumbed if levels[i].course == course]
        if (
            of_course
            and levels[of_course[-1]].height_m - levels[of_course[0]].height_m
            >= LEAST_HEIGHT * height
        ):
            pairs.append((of_course[0], of_course[-1]))
    return pairs
