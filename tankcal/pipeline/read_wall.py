"""Readings of a wall that name no point, and what the wall says of each of them."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tankcal.adjust import noncentrality
from tankcal.geometry.field.blunders import Tested, restricted_precision
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import free_design
from tankcal.pipeline.wall_readings import columns_of, shared_effects


@dataclass(frozen=True)
class ReadWall:
    """A wall as a tape and reference lines read it, alone or beside points.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    zero_m : float
        Of the table's zero above it.
    readings : tuple of WallReading
        That the wall was asked for: straps, then offsets; those that are only compared are not
        among them.
    places : ndarray of int, shape (n,)
        Of each of these among the readings of its file.
    tested : Tested
        What became of each; an infinite sd_m of those that no other reading controls.
    field : WallField
        Known from points, if there are any, and from those that were accepted after them.
    """

    joints_m: np.ndarray
    zero_m: float
    readings: tuple
    places: np.ndarray
    tested: Tested
    field: WallField
    inner_m: np.ndarray | float = field(default=0.0, kw_only=True)  # of plates: not in the field
    surveyed_as = "read"  # beside points; what was read alone says what it is

    def radius_at(self, course, level_m):
        """Mean radius at a height above the table's zero of a course, m."""
        low, high = self.joints_m[course], self.joints_m[course + 1]
        zeta = 2 * (level_m + self.zero_m - low) / (high - low) - 1
        inner = np.broadcast_to(self.inner_m, len(self.joints_m) - 1)[course]
        return float(self.field.outlines_at([zeta])[course, 0].mean() + inner)

    def tests_of(self, kind):
        """(w, mdb_m, accepted) of each reading of a kind.

        w         its departure from what all others show over its sd; nan: no other controls it
        mdb_m     the smallest blunder of its radius, m, that this test finds; inf of such
        """
        chosen, tested = self.are(kind), self.tested
        w = np.where(np.isfinite(tested.sd_m), tested.w, np.nan)
        return w[chosen], noncentrality() * tested.sd_m[chosen], tested.accepted[chosen]

    @property
    def accepted(self):
        """The readings that the field is known from."""
        return [one for one, kept in zip(self.readings, self.tested.accepted, strict=True) if kept]

    @cached_property
    def collimations(self):
        """{plummet: (kappa, its standard uncertainty), rad}, as adjusted with the wall.

        One that nothing bound is an unknown; of one with a given uncertainty u, of column c,

            kappa = u^2 c' P y,   variance u^2 - u^4 c' P c.
        """
        found, used = {}, self.accepted
        unknowns = columns_of(
            [reading.free for reading in self.readings]
        )  # the last of `Sites.shared`
        for place, (kind, name) in enumerate(unknowns, start=-len(unknowns)):
            if kind == "collimation":
                values, covariance = self.field.shared
                found[name] = float(values[place]), float(np.sqrt(covariance[place, place]))
        precision, points = None, len(self.field.radius_m) - len(used)
        for (kind, name), (_, _, column) in shared_effects(used).items():
            if kind != "collimation":
                continue
            if precision is None:
                design = free_design(self.field.sites)[0]
                precision = restricted_precision(self.field.covariance_m2, design)
            u = next(
                reading.effects[kind, name][0]
                for reading in used
                if (kind, name) in reading.effects
            )
            u, column = np.radians(u / 3600), np.pad(column, (points, 0))
            share = column @ precision @ column
            found[name] = (
                float(u * (column @ precision @ self.field.radius_m)),
                float(u * np.sqrt(max(1 - share, 0.0))),
            )
        return found

    def are(self, kind):
        """(n,) which readings are of a kind."""
        return np.array([reading.of == kind for reading in self.readings], dtype=bool)
