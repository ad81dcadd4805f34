"""What all figures of a wall's shape are sums of: radii at spots and centres, with one covariance.

Radii that were read count as they were read, the others are estimated; plate and paint are taken
off, and the head of the survey's liquid.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.geometry.field.components import COMPONENTS, KINDS
from tankcal.geometry.field.values import FieldValues, Spots
from tankcal.geometry.outlines import FULL_TURN, radii_square_to_axis
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.tanks.vertical import bearing_inputs, insets_of
from tankcal.tank.hydrostatics import LiquidHead
from tankcal.uncertainty import Source, combine, declared_source, group_correlated

SAME_PLACE_M = 0.1  # along the arc: a reading as near as that to a generatrix is on it
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


class ShapeBase:
    """Radii at spots, then centres, of a job's wall, with their uncertainty.

    Parameters
    ----------
    job : Job
    wall : Wall
    levels : sequence of Level
    plumbed : list of int
        Which of them have a centre.
    pairs : sequence of (int, int)
        Levels that are compared along the generatrices of the first.
    """

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
        zeta = np.array([level.zeta for level in levels])[at]
        spots = Spots(
            course=np.array([level.course for level in levels])[at],
            zeta=np.where(site >= 0, sites.zeta[site], zeta),
            azimuth_rad=np.where(site >= 0, sites.azimuth_rad[site], angle),
            site=site,
        )
        rings = [(levels[i].ring, levels[i].zeta) for i in plumbed]
        self._found = FieldValues(wall.field, spots, rings)
        self._height_m = np.array([level.height_m for level in levels])[at]
        inset = np.array(insets_of(job, job.switches))[spots.course]
        self._head_m, self.state = self._widening()
        self._surveyed = self._found.value_m.copy()
        # the field has no ellipse of the lean; these are radii of horizontal sections
        self._surveyed[: self._count] /= radii_square_to_axis(spots.azimuth_rad, 1.0, self._slope)
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
        """`Figures` of rows (r, f), each of which is of a few places."""
        rows = scipy.sparse.csr_array(rows)
        value = rows @ self._value_m
        value += rows[:, self._count :] @ self._origins()
        unseen = self._found.unseen_of(rows)
        kinds = np.array([component.kind for component in COMPONENTS])
        variances = [unseen[kinds == kind].sum(axis=0) for kind in KINDS]
        parts = [Source("", np.sqrt(np.maximum(variance, 0.0))[:, None]) for variance in variances]
        by_survey = [cause.mapped(lambda columns: rows @ columns) for cause in self._sources]
        told = combine([*by_survey, *parts], len(value))
        return Figures(value, np.maximum(told.u, LEAST_U_M), told.effective_dof)

    def _origins(self):
        """(2 c,) what the centres count from, in the frame of the survey."""
        found = [
            self.centre(i) - self._surveyed[self._count + 2 * c : self._count + 2 * c + 2]
            for i, c in self._centre_of.items()
        ]
        return np.concatenate(found) if found else np.zeros(0)

    def _causes(self):
        """`Source`s of what the survey leaves uncertain, and of what was declared."""
        job, wall = self._job, self._wall
        factors = wall.factors(job, self._found.weights)
        by = self._derivatives()
        declared = {
            declared_input.name: declared_source(declared_input, by[declared_input.name])
            for declared_input in job.inputs
            if declared_input.name in by and declared_input.name not in wall.without_inputs
        }
        survey = [factor.source(factor.columns) for factor in factors]
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
        """{input: (p,) derivative of the head taken off}: K rho (h - z), K as 1 / (E t)."""
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
