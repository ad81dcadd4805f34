"""The rings of a lying cylinder as a tape found them: radii, and what is uncertain of the wall.

A ring is a cylinder of the mean radius of its straps. What it does between them (taper, bulge), and
how far its bottom at the dip is from that mean, is in the doubt, as large as the components of
walls (`geometry.field`) say. A tape tells nothing of how a ring departs from a circle, so its size
is declared, and each wave cos(k a) of it moves the rows of the table: by itself, and by the bottom
that dips count from. A lying tank flattens by its own weight: half of the variance is taken as
that, wave 2 of all rings alike; the other half is spread as the components of walls are.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.geometry.field.components import COMPONENTS, OVALITY_MODES, mode_shares
from tankcal.geometry.field.estimate import LEVELS, gauss_heights
from tankcal.geometry.girth import perimeter_excess
from tankcal.messages import message
from tankcal.pipeline.strapped_wall import TapedWall, adjust_readings
from tankcal.pipeline.tanks.common import factor_of_unseen
from tankcal.pipeline.wall_readings import names_of, readings_of_straps
from tankcal.pipeline.wall_straps import AreaTerm, gauged_plates
from tankcal.quadrature import panels
from tankcal.survey.strapping import reduce_straps, tapes_used
from tankcal.tank.factors import Factor
from tankcal.tank.rings import WAVES

UPRIGHT_M = 7.5  # radius of the measured shell: smaller rings bulge less, as the root of R
FLATTENED = 0.5  # of the variance round a ring: by its own weight, on saddles
KIND_OF_WAVES = {"oval": "ovality", "seam": "seams"}


@dataclass(frozen=True)
class RingedWall(TapedWall):
    """The rings of a lying tank as strapped; their levels are places along the axis from A."""

    surveyed_as = "rings"

    def radius_sd_m(self, factors):
        """(rings,) standard deviation of the mean radii by `RingFeatures.factors`."""
        rings = len(self.joints_m) - 1
        return np.sqrt(sum(np.sum(factor.columns[:rings] ** 2, axis=1) for factor in factors))

    def features_at(self, dip_from_a_m):
        """`RingFeatures` of a tank that is dipped there."""
        return RingFeatures(self, dip_from_a_m)


class RingFeatures:
    """What a survey gives of rings: mean radii, the bottom at the dip, waves of each ring.

    Its columns have rows for `RingedTank`'s derivatives by ring_radii, dip_radius and ring_waves.

    Parameters
    ----------
    wall : RingedWall
    dip_from_a_m : float
    """

    def __init__(self, wall, dip_from_a_m):
        self._wall, self._rings = wall, len(wall.joints_m) - 1
        self._zero = min(
            max(int(np.searchsorted(wall.joints_m, dip_from_a_m, side="right")) - 1, 0),
            self._rings - 1,
        )
        low, high = wall.joints_m[self._zero], wall.joints_m[self._zero + 1]
        self._means = wall.field.means
        self._of_levels = self._from_levels(2 * (dip_from_a_m - low) / (high - low) - 1)

    def factors(self, job):
        """`Factor`s of what the tape leaves uncertain of them."""
        read = self._wall.factors(job, self._of_levels @ self._means.weights)
        return (*map(self._padded, read), *self._of_bulges(), *self._of_waves())

    def read_with(self):
        """{input: (features,) derivative by it}: a tape that has the temperature of the shell."""
        found = self._wall.read_with(self._of_levels @ self._means.weights)
        return {name: self._with_waves(column) for name, column in found.items()}

    def _from_levels(self, zeta):
        """(rings + 1, rings x LEVELS) mean radius of each ring, and how far the wall is from it at
        height zeta of the ring of the dip, by radii at the Gauss places.
        """
        share, nodes = panels([0.0, 1.0], LEVELS)[1], gauss_heights()
        found = np.kron(np.vstack([np.eye(self._rings), np.zeros(self._rings)]), share)
        others = [np.delete(nodes, j) for j in range(LEVELS)]
        through = [np.prod((zeta - k) / (one - k)) for one, k in zip(nodes, others, strict=True)]
        mine = slice(self._zero * LEVELS, (self._zero + 1) * LEVELS)
        found[-1, mine] = through - share
        return found

    def _with_waves(self, rows):
        """Rows of radii and of the dip's bottom, with those of waves, which no tape sees."""
        more = ((0, self._rings * len(WAVES)), *((0, 0),) * (np.ndim(rows) - 1))
        return np.pad(rows, more)

    def _padded(self, factor):
        return factor.mapped(self._with_waves)

    def _of_bulges(self):
        """A `Factor` of what the straps did not see of mean radii along the rings."""
        assumed = self._wall.field.amplitudes.assumed_share()
        chosen = [i for i, component in enumerate(COMPONENTS) if component.shape == "mean"]
        turn = self._of_levels
        parts = [turn @ self._means.unseen(i) @ turn.T for i in chosen]
        found = factor_of_unseen(
            "bulge", parts, [np.trace(part) for part in parts], assumed[chosen]
        )
        return (self._padded(found),) if found.columns.shape[1] else ()

    def _of_waves(self):
        """`Factor`s of the departures from a circle, of the declared size."""
        shape = self._wall.shape_sd_m
        if not shape:
            return
        shares = {
            one: (1 - FLATTENED) * size * shape**2 for one, size in _shares_of_waves().items()
        }
        radius = float(np.mean(self._wall.radius_m))
        orders = np.arange(2.0, OVALITY_MODES[-1] + 1)
        for name, kind in KIND_OF_WAVES.items():
            spectrum = mode_shares(orders, radius)[name]
            columns = [
                *self._waves(np.sqrt(shares[name, True] * spectrum), common=True),
                *self._waves(np.sqrt(shares[name, False] * spectrum), common=False),
            ]
            if name == "oval":  # a sd of cos 2a that is that of the radius, times the root of 2
                columns += self._waves(np.sqrt([2 * FLATTENED * shape**2]), common=True)
            yield Factor(kind, np.column_stack(columns), type="B", note="assumed")

    def _waves(self, sds_m, *, common):
        """Columns of waves of these sizes, of all rings together or of each its own; the shorter
        ones move the bottom at the dip alone.
        """
        count = self._rings + 1 + self._rings * len(WAVES)
        for k, sd in enumerate(sds_m[: len(WAVES)]):
            places = self._rings + 1 + np.arange(self._rings) * len(WAVES) + k
            for those in [places] if common else places[:, None]:
                column = np.zeros(count)
                column[those] = sd
                yield column
        if len(sds_m) > len(WAVES):
            column = np.zeros(count)
            column[self._rings] = np.sqrt(np.sum(sds_m[len(WAVES) :] ** 2))
            yield column


def _shares_of_waves():
    """{(shape, common): share of the variance round a wall}, by the medians of the components."""
    sizes = {(shape, common): 0.0 for shape in KIND_OF_WAVES for common in (True, False)}
    for component in COMPONENTS:
        if component.shape in KIND_OF_WAVES:
            sizes[component.shape, component.common] += component.median_m**2
    whole = sum(sizes.values())
    return {key: size / whole for key, size in sizes.items()}


def find_ringed_wall(job, progress, amplitudes=None):
    """`RingedWall` of a job whose rings a tape was put round.

    amplitudes  of the wall's components where they are known beforehand; None: the readings tell
    """
    straps = job.strapping
    progress(
        message(
            "strapping_rings",
            "reducing {count} readings of the tape to {rings} rings",
            count=len(straps.straps),
            rings=len(job.rings),
        )
    )
    read = [strap.reading_m for strap in straps.straps]
    nominal = float(np.median(read)) / (2 * np.pi)
    reduced = reduce_straps(straps, job.survey.shell_temperature_c, 2 * nominal)
    places = [i for i, reduced_strap in enumerate(reduced) if not reduced_strap.strap.check]
    term = AreaTerm(*perimeter_excess(straps.shape_sd_m, nominal))
    readings = readings_of_straps([reduced[i] for i in places], names_of(job.rings), term)
    joints = np.concatenate([[0.0], np.cumsum([ring.length_m for ring in job.rings])])
    readings, tested, field = adjust_readings(
        readings,
        (joints, 0.0, nominal),
        amplitudes,
        snooping=job.snooping,
        bulge_scale=min(np.sqrt(nominal / UPRIGHT_M), 1.0),
    )
    return RingedWall(
        joints_m=joints,
        zero_m=0.0,
        readings=tuple(readings),
        places=np.array(places),
        tested=tested,
        field=field,
        reduced=reduced,
        area_term=term,
        plate_sd_m=gauged_plates(job),
        tapes=tapes_used(straps),
        shape_sd_m=straps.shape_sd_m,
    )
