"""The shape of an upright wall for an inspection: radii about the own centres, and the plumb.

At the levels that were surveyed, and 0.3 m above the bottom, the inside radius r about the own
centre of the level; between levels l and m, along the generatrix of azimuth t with n its direction,

    r_m(t) - r_l(t) + n(t) . (c_m - c_l),

c the centres of the levels. All with one covariance, by what the survey leaves uncertain and by
what it did not see of the wall, so that plates, offsets and scales drop out of differences.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.field.components import COMPONENTS, KINDS
from tankcal.geometry.field.values import FieldValues, Spots
from tankcal.geometry.outlines import FULL_TURN
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.tanks.vertical import bearing_inputs, insets_of
from tankcal.pipeline.wall import Wall
from tankcal.tank.hydrostatics import LiquidHead
from tankcal.uncertainty import Source, combine, declared_source, group_correlated

SAME_PLACE_M = 0.1  # along the arc: a reading as near as that to a generatrix is on it
LOW_M = 0.3048  # a foot above the bottom weld, where the low radii are judged
SAME_LEVEL_M = 0.05  # a level as near as that to another is the same
MOST_AZIMUTHS, EVEN_AZIMUTHS = 72, 36  # of a level as measured; of one with more points
LEAST_HEIGHT = 0.2  # of a course: levels nearer than that tell nothing of its plumb
NEAR_M = 0.1  # from the wall: what stands there may be a dent
LEAST_U_M = 1e-9  # of a value: rounding


@dataclass(frozen=True)
class Level:
    """A horizontal section of the wall.

    Attributes
    ----------
    height_m : float
        Above the bottom of the shell.
    course : int
        From 0 on.
    zeta : float
        Height within its course, -1 to 1.
    azimuth_rad : ndarray, shape (a,)
        Ascending: of its readings where they are level.
    ring : int
        Of the field; -1: no points have this height, and its centre is not known.
    site : ndarray of int, shape (a,)
        Reading of the field at each azimuth; -1: the radius there is estimated.
    is_low : bool
        Whether it is the one whose low radii are judged.
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
    """Values with their uncertainty: value_m, u_m, dof, each of the same shape."""

    value_m: np.ndarray
    u_m: np.ndarray
    dof: np.ndarray

    def part(self, start, end):
        """Those of some rows."""
        return Figures(self.value_m[start:end], self.u_m[start:end], self.dof[start:end])


@dataclass(frozen=True)
class Plumb:
    """Departures of the upper of two levels from the plumb, outwards positive, by azimuth.

    low, high : int
        Which of the levels of the `WallShape`.
    azimuth_rad : ndarray, shape (g,)
    is_read : ndarray of bool, shape (g,)
        Whether there is a reading at both ends; else at least one end is estimated by its
        neighbours.
    """

    low: int
    high: int
    azimuth_rad: np.ndarray
    is_read: np.ndarray
    figures: Figures


@dataclass(frozen=True)
class SetAside:
    """A point near the wall that was not taken for it: of a fitting, a slip, or a dent.

    Attributes
    ----------
    point : str
        Name.
    height_m, azimuth_rad : float
        Where: above the bottom of the shell, about the axis.
    residual_m : float
        Outwards from the wall as all other points show it.
    """

    point: str
    height_m: float
    azimuth_rad: float
    residual_m: float


@dataclass(frozen=True)
class WallShape:
    """What an inspection asks of a wall.

    Attributes
    ----------
    set_aside : tuple of SetAside
        Points near the wall that were not taken for it.
    state : str
        "as_found": loaded as it was surveyed; "unloaded": the head of the survey's liquid taken
        off.
    levels : tuple of Level
        From the bottom up.
    radii : tuple of Figures
        Of each level at its azimuths: inside, about its own centre.
    centres_m : tuple
        (x, y) of each level in the frame of the survey; None where it is not known.
    plumbs : tuple of Plumb
        Of each level with a centre against the lowest of these; (): fewer than two.
    axis : Figures or None
        x and y of the highest centre less the lowest, then its length.
    courses : tuple of Plumb
        Of each course with two levels far enough apart, its highest against its lowest.
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
    """The `WallShape` of a job's wall; None where no wall of points was surveyed."""
    if not isinstance(wall, Wall) or job.radii is not None:
        return None
    levels = _levels(job, wall)
    plumbed = [i for i, one in enumerate(levels) if _has_centre(wall, one)]
    pairs = [(plumbed[0], one) for one in plumbed[1:]]
    of_courses = _pairs_of_courses(wall, levels, plumbed)
    base = _Base(job, wall, levels, plumbed, (*pairs, *of_courses))
    rows = [base.radii(i, one.azimuth_rad) for i, one in enumerate(levels)]
    rows += [base.plumb(*pair) for pair in (*pairs, *of_courses)]
    if pairs:
        rows.append(base.axis(*pairs[-1]))
    whole = base.figures(np.vstack(rows))
    ends = np.cumsum([0, *map(len, rows)])
    found = [whole.part(*pair) for pair in zip(ends[:-1], ends[1:], strict=True)]
    radii, others = found[: len(levels)], found[len(levels) :]
    plumbs = [
        Plumb(low, high, levels[low].azimuth_rad, base.is_read(low, high), part)
        for (low, high), part in zip((*pairs, *of_courses), others, strict=False)
    ]
    return WallShape(
        tuple(_set_aside(job, wall)),
        base.state,
        levels,
        tuple(radii),
        tuple(base.centre(i) if i in plumbed else None for i in range(len(levels))),
        tuple(plumbs[: len(pairs)]),
        others[-1] if pairs else None,
        tuple(plumbs[len(pairs) :]),
    )


def _set_aside(job, wall):
    """Points near the wall that were not taken for it."""
    shell, xyz = wall.shell, job.points.xyz_m
    near = (shell.reason != "") & (np.abs(shell.residual_m) <= NEAR_M)
    for i in np.flatnonzero(near):
        axis = np.array(shell.axis_m) + (xyz[i, 2] - shell.z_m) * np.array(shell.slope)
        x, y = xyz[i, :2] - axis
        yield SetAside(
            job.points.names[i],
            float(xyz[i, 2] - job.datum.bottom_z_m),
            float(np.arctan2(x, y) % FULL_TURN),
            float(shell.residual_m[i]),
        )


def _levels(job, wall):
    """Levels of the sections, and the low one; a section that is not level has two."""
    found = []
    for ring, section in enumerate(wall.sections):
        group, chosen = section.group, _readings_of(wall.field.sites, ring)
        azimuth = wall.field.sites.azimuth_rad[chosen] % FULL_TURN
        if group.degree == 0:
            height, zeta = group.height_m, float(group.zeta(group.height_m))
            found.append(Level(height, group.course, zeta, azimuth, ring, chosen))
            continue
        points = wall.accepted[group.members]
        heights = job.points.xyz_m[points, 2] - job.datum.bottom_z_m
        for one in np.quantile(heights, [0.1, 0.9]).tolist():
            zeta = float(group.zeta(one))
            found.append(Level(one, group.course, zeta, azimuth, ring, np.full(len(chosen), -1)))
    found.sort(key=lambda one: one.height_m)
    return _with_low(found, wall.joints_m[1])


def _with_low(levels, top_m):
    """The levels with the low one marked, or added where none is near; first course to top_m."""
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
        levels = sorted([*levels, low], key=lambda one: one.height_m)
    return tuple(levels)


def _readings_of(sites, ring):
    """Readings of a ring by azimuth; of many some that are about evenly spread."""
    own = np.flatnonzero(sites.ring == ring)
    azimuth = sites.azimuth_rad[own] % FULL_TURN
    own = own[np.argsort(azimuth, kind="stable")]
    if len(own) <= MOST_AZIMUTHS:
        return own
    even = np.arange(EVEN_AZIMUTHS) * FULL_TURN / EVEN_AZIMUTHS
    away = np.abs((np.sort(azimuth)[:, None] - even + np.pi) % FULL_TURN - np.pi)
    return own[np.unique(np.argmin(away, axis=0))]


def _has_centre(wall, level):
    plumbed = wall.field.plumbed
    return level.ring >= 0 and (plumbed is None or level.ring < plumbed)


def _pairs_of_courses(wall, levels, plumbed):
    """(lowest, highest) level of each course in which two stand far enough apart."""
    pairs = []
    for course, tall in enumerate(np.diff(wall.joints_m)):
        own = [i for i in plumbed if levels[i].course == course]
        if own and levels[own[-1]].height_m - levels[own[0]].height_m >= LEAST_HEIGHT * tall:
            pairs.append((own[0], own[-1]))
    return pairs


class _Base:
    """What all figures are sums of: radii at spots, then centres, with their uncertainty."""

    def __init__(self, job, wall, levels, plumbed, pairs):
        self._job, self._wall, self._levels = job, wall, levels
        self._place, spots = {}, []
        for i, one in enumerate(levels):
            for angle, site in zip(one.azimuth_rad, one.site, strict=True):
                self._add(spots, i, angle, site)
        for low, high in pairs:
            for angle in levels[low].azimuth_rad:
                self._add(spots, high, angle, self._reading_near(levels[high], angle))
        self._count = len(spots)
        self._centre_of = {i: number for number, i in enumerate(plumbed)}
        at, angle, site = map(np.array, zip(*spots, strict=True))
        self._site = site
        sites = wall.field.sites
        zeta = np.array([one.zeta for one in levels])[at]
        spots = Spots(
            course=np.array([one.course for one in levels])[at],
            zeta=np.where(site >= 0, sites.zeta[site], zeta),
            azimuth_rad=np.where(site >= 0, sites.azimuth_rad[site], angle),
            site=site,
        )
        rings = [(levels[i].ring, levels[i].zeta) for i in plumbed]
        self._found = FieldValues(wall.field, spots, rings)
        self._height_m = np.array([one.height_m for one in levels])[at]
        inset = np.array(insets_of(job, job.switches))[spots.course]
        self._head_m, self.state = self._widening()
        self._surveyed = self._found.value_m.copy()
        self._value_m = self._surveyed.copy()
        self._value_m[: self._count] += self._head_m - inset
        self._sources = self._causes()

    def _add(self, spots, level, angle, site):
        """A spot of a level at an azimuth, once; as read where there is a reading."""
        if (level, float(angle)) not in self._place:
            self._place[level, float(angle)] = len(spots)
            spots.append((level, float(angle), int(site)))

    def _reading_near(self, level, angle):
        """The reading of a level that is on a generatrix; -1: none."""
        away = np.abs((level.azimuth_rad - angle + np.pi) % FULL_TURN - np.pi)
        nearest = int(np.argmin(away))
        is_near = away[nearest] * self._wall.field.nominal_m <= SAME_PLACE_M
        return level.site[nearest] if is_near else -1

    def _widening(self):
        """(p,) what taking off the liquid of the survey adds to the radii, and the state."""
        job = self._job
        is_loaded = job.survey.liquid_density_kg_m3 and job.survey.liquid_level_m
        if not (is_loaded and job.switches.head):
            return np.zeros(self._count), "as_found"
        body = body_of(job, self._wall, uncertain=False)
        head = next(part for part in body.parts if isinstance(part, LiquidHead))
        return head.with_density(0.0).widening_m(self._height_m, 0.0), "unloaded"

    def centre(self, level):
        """(x, y) of the centre of a level in the frame of the survey."""
        one, wall = self._levels[level], self._wall
        at = self._count + 2 * self._centre_of[level]
        up = one.height_m - wall.sections[one.ring].group.height_m
        return wall.origins_m[one.ring] + self._surveyed[at : at + 2] + up * self._slope

    def radii(self, level, azimuth):
        """(a, f) rows of the radii of a level."""
        found = np.zeros((len(azimuth), len(self._value_m)))
        places = [self._place[level, float(angle)] for angle in azimuth]
        found[np.arange(len(azimuth)), places] = 1.0
        return found

    def plumb(self, low, high):
        """(g, f) rows of the departures of one level from the plumb of another."""
        azimuth = self._levels[low].azimuth_rad
        turn = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
        found = self.radii(high, azimuth) - self.radii(low, azimuth)
        for level, sign in ((high, 1.0), (low, -1.0)):
            at = self._count + 2 * self._centre_of[level]
            found[:, at : at + 2] += sign * turn
        return found

    def is_read(self, low, high):
        """(g,) whether two levels have readings on the generatrices of the lower one."""
        pairs = [[self._site[self._place[i, float(angle)]] for i in (low, high)]
                 for angle in self._levels[low].azimuth_rad]  # fmt: skip
        return np.all(np.array(pairs) >= 0, axis=1)

    def axis(self, low, high):
        """(3, f) rows of x and y between the centres of two levels, and along their direction."""
        found = np.zeros((3, len(self._value_m)))
        for level, sign in ((high, 1.0), (low, -1.0)):
            at = self._count + 2 * self._centre_of[level]
            found[:2, at : at + 2] += sign * np.eye(2)
        apart = self.centre(high) - self.centre(low)
        away = np.hypot(*apart)
        found[2] = (apart / away if away > 0 else np.array([1.0, 0.0])) @ found[:2]
        return found

    def figures(self, rows):
        """`Figures` of rows (r, f)."""
        value = rows @ self._value_m
        value += rows[:, self._count :] @ self._origins()
        variances = [np.einsum("ij,jk,ik->i", rows, one, rows, optimize=True)
                     for one in self._unseen()]  # fmt: skip
        parts = [Source("", np.sqrt(np.maximum(one, 0.0))[:, None]) for one in variances]
        by_survey = [one.mapped(lambda columns: rows @ columns) for one in self._sources]
        told = combine([*by_survey, *parts], len(rows))
        return Figures(value, np.maximum(told.u, LEAST_U_M), told.effective_dof)

    def _origins(self):
        """(2 c,) what the centres count from, in the frame of the survey."""
        found = [
            self.centre(i) - self._surveyed[self._count + 2 * c : self._count + 2 * c + 2]
            for i, c in self._centre_of.items()
        ]
        return np.concatenate(found) if found else np.zeros(0)

    def _unseen(self):
        """Covariance (f, f) of what was not seen of the wall, of each kind of component."""
        inflation = self._wall.field.amplitudes.inflation()
        for kind in KINDS:
            chosen = [i for i, one in enumerate(COMPONENTS) if one.kind == kind]
            yield sum(inflation[i] * self._found.unseen(i) for i in chosen)

    def _causes(self):
        """`Source`s of what the survey leaves uncertain, and of what was declared."""
        job, wall = self._job, self._wall
        factors = wall.factors(job, self._found.weights)
        by = self._derivatives()
        declared = {
            one.name: declared_source(one, by[one.name])
            for one in job.inputs
            if one.name in by and one.name not in wall.without_inputs
        }
        survey = [one.source(one.columns) for one in factors]
        return [*survey, *group_correlated(declared, job.correlations)]

    def _derivatives(self):
        """{input: (f,) derivative of the radii and centres by it}."""
        job, count = self._job, self._count
        is_radius = np.arange(len(self._value_m)) < count
        found = {"offset": 1.0 * is_radius, "scale": np.where(is_radius, self._surveyed, 0.0)}
        bearing, outside = bearing_inputs(job, job.switches), job.survey.side == "outside"
        for name in ("plate_thickness", "paint"):
            if name in bearing:
                found[name] = -float(outside) * is_radius
        for name, column in self._wall.read_with(self._found.weights).items():
            if name in bearing:
                found[name] = found.get(name, 0.0) + column
        for name, column in self._by_head().items():
            full = np.append(column, np.zeros(len(self._value_m) - count))
            found[name] = found.get(name, 0.0) + full
        return found

    def _by_head(self):
        """{input: (p,) derivative of the head that was taken off}: K rho (h - z), K as 1 / (E t)."""
        if self.state == "as_found":
            return {}
        job, head = self._job, self._head_m
        plate = np.array([one.thickness_m for one in job.courses])
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
