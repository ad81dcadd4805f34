"""Wall with readings that name no point, and the test of each reading against the wall."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tankcal.adjust import noncentrality
from tankcal.geometry.field.blunders import ReadingTests, restricted_precision
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import free_design
from tankcal.pipeline.wall_readings import columns_of, shared_effects


@dataclass(frozen=True)
class ReadWall:
    """Wall with readings of tapes and reference lines, alone or in addition to points.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    zero_m : float
        Height of the table's zero above the bottom, m.
    readings : tuple of WallReading
        Adjusted readings: straps, then offsets. Check readings are not included.
    places : ndarray of int, shape (n,)
        Index of each reading among the readings of its file.
    tested : ReadingTests
        Test of each reading; sd_m is infinite for an uncontrolled reading.
    field : WallField
        Field estimated from the points, if any, and from the accepted readings.
    """

    joints_m: np.ndarray
    zero_m: float
    readings: tuple
    places: np.ndarray
    tested: ReadingTests
    field: WallField
    # Plate thickness, not in the field.
    inner_m: np.ndarray | float = field(default=0.0, kw_only=True)
    has_applied_inputs = False
    surveyed_as = "read"  # in addition to points; subclasses state their own kind

    def radius_at(self, course, level_m):
        """Mean radius of a course at a height above the table's zero, m."""
        low, high = self.joints_m[course], self.joints_m[course + 1]
        zeta = 2 * (level_m + self.zero_m - low) / (high - low) - 1
        inner = np.broadcast_to(self.inner_m, len(self.joints_m) - 1)[course]
        return float(self.field.outlines_at([zeta])[course, 0].mean() + inner)

    def tests_of(self, kind):
        """Tests of the readings of a kind.

        Returns
        -------
        w : ndarray
            Discrepancy from the other readings over its standard deviation; nan if uncontrolled.
        mdb_m : ndarray
            Minimal detectable bias of the radius, m; infinite if uncontrolled.
        accepted : ndarray of bool
        """
        is_of_kind, tested = self.are(kind), self.tested
        w = np.where(np.isfinite(tested.sd_m), tested.w, np.nan)
        return w[is_of_kind], noncentrality() * tested.sd_m[is_of_kind], tested.accepted[is_of_kind]

    @property
    def accepted(self):
        """Readings from which the field is estimated."""
        return [
            reading
            for reading, is_accepted in zip(self.readings, self.tested.accepted, strict=True)
            if is_accepted
        ]

    @cached_property
    def collimations(self):
        """{plummet: (kappa, standard uncertainty), rad}, adjusted together with the wall.

        A collimation without a prior is an unknown of the field. With a prior standard uncertainty
        u and a column c of derivatives,

            kappa = u^2 c' P y,   variance u^2 - u^4 c' P c.
        """
        collimations, accepted = {}, self.accepted
        # The last of `Sites.shared`.
        unknowns = columns_of([reading.free for reading in self.readings])
        for index, (kind, name) in enumerate(unknowns, start=-len(unknowns)):
            if kind == "collimation":
                values, covariance = self.field.shared
                collimations[name] = float(values[index]), float(np.sqrt(covariance[index, index]))
        precision, points = None, len(self.field.radius_m) - len(accepted)
        for (kind, name), (_, _, column) in shared_effects(accepted).items():
            if kind != "collimation":
                continue
            if precision is None:
                design = free_design(self.field.sites)[0]
                precision = restricted_precision(self.field.covariance_m2, design)
            u = next(
                reading.effects[kind, name][0]
                for reading in accepted
                if (kind, name) in reading.effects
            )
            # Arc seconds to radians; zeros for the readings of points, which precede these
            # readings.
            u, column = np.radians(u / 3600), np.pad(column, (points, 0))
            share = column @ precision @ column
            collimations[name] = (
                float(u * (column @ precision @ self.field.radius_m)),
                float(u * np.sqrt(max(1 - share, 0.0))),
            )
        return collimations

    def are(self, kind):
        """Mask (n,) of the readings of a kind."""
        return np.array([reading.of == kind for reading in self.readings], dtype=bool)


def detectable_m(wall, kind):
    """Minimal detectable bias of the readings of a kind, m; () for a wall without such tests."""
    read = wall if isinstance(wall, ReadWall) else getattr(wall, "read", None)
    return () if read is None else read.tests_of(kind)[1]
