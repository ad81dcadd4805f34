"""Scans against each other where they overlap: is their registration as good as declared?"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import scipy.linalg
from scipy.special import chdtrc, chdtri

from tankcal.adjust import ALPHA
from tankcal.messages import message
from tankcal.survey.beams import shared_by_beams

REGISTRATION = "registration"  # kind of the causes that are poses
STEP_M = 1.0  # along the normal of a surface
FEWEST_CELLS = 20  # in common, before two scans are compared
MOST_CELLS = 150  # of an overlap that are compared
LEAST_M = 2e-4  # cells of two scans may differ so much without a reason that a scan knows
STEEP_DEG = 60.0  # of incidence, beyond which no pair of scans is compared
STEEPEST_DEG = 80.0  # of all scans together: four set-ups outside overlap at 70 degrees and more
RANK = 0.05  # of the largest direction: a smaller one the overlap does not tell
MOST_ROWS = 1200  # differences of all overlaps that are tested together
LEVEL = 0.01  # of that test; at 0.001 it misses a third of registrations twice too large
LEAST_TOLD = 1.0  # variance over that of the noise, of a direction that shows the registration


@dataclass(frozen=True)
class Overlap:
    """Two scans where both show the wall.

    Attributes
    ----------
    scans : tuple of int
    cells : int
    mean_m : float
        By how much the second has the wall further out.
    apart_m : float
        Root mean square of what a shift between them explains of their differences.
    w : float
        Of that against registration, offset and incidence: as |w| of one reading.
    is_apart : bool
        Whether the registration does not explain it.
    """

    scans: tuple
    cells: int
    mean_m: float
    apart_m: float
    w: float
    is_apart: bool


@dataclass(frozen=True)
class RegistrationTest:
    """All differences between overlapping scans against their registration.

    Attributes
    ----------
    chi2 : float
        Of those combinations of the registration that exceed the noise of the differences.
    dof : int
        Number of these combinations.
    """

    chi2: float
    dof: int

    @property
    def limit(self):
        """Critical value of chi2 at `LEVEL`."""
        return float(chdtri(self.dof, LEVEL))

    @property
    def factor(self):
        """By how much the differences exceed their standard deviation (rms)."""
        return float(np.sqrt(self.chi2 / self.dof))


@dataclass(frozen=True)
class _Differences:
    """Distances of the wall in one scan less those in another, in m of `count` common cells.

    Attributes
    ----------
    pair : tuple of int
    count : int
    apart_m, noise_m2 : ndarray, shape (m,)
        Differences, and their variance by independent noise.
    normal : ndarray, shape (m, 3)
    incidence_deg : ndarray, shape (m,)
        The larger of the two.
    registration : ndarray, shape (m, r)
        Standard deviations of the differences by the causes of the registration.
    others : dict of (str, str) to ndarray, shape (m,)
        By any other cause that the scans share: its name and kind.
    """

    pair: tuple
    count: int
    apart_m: np.ndarray
    noise_m2: np.ndarray
    normal: np.ndarray
    incidence_deg: np.ndarray
    registration: np.ndarray
    others: dict

    @property
    def least_m2(self):
        """(m,) variances by which scans differ throughout an overlap without a known reason.

        No number of cells divides them; they grow with the footprint of an oblique beam.
        """
        return len(self.apart_m) * (LEAST_M / np.cos(np.radians(self.incidence_deg))) ** 2

    def some(self, chosen):
        """The differences of some cells: a mask or a slice."""
        rows = ("apart_m", "noise_m2", "normal", "incidence_deg", "registration")
        others = {key: column[chosen] for key, column in self.others.items()}
        return replace(self, others=others, **{key: getattr(self, key)[chosen] for key in rows})

    @property
    def covariance_m2(self):
        """(m, m) covariance of the differences."""
        shared = np.column_stack([self.registration, *self.others.values()])
        return shared @ shared.T + np.diag(self.noise_m2)


def overlaps_of(job, cells, registration):
    """`Overlap` of each pair of scans that show enough cells of the same side in common.

    Parameters
    ----------
    job : Job
    cells : CloudWall
    registration : Registration
    """
    square = [
        one.some(one.incidence_deg <= STEEP_DEG) for one in _differences(job, cells, registration)
    ]
    return tuple(_overlap(one) for one in square if len(one.apart_m) >= FEWEST_CELLS)


def overlap_test(job, cells, registration):
    """`RegistrationTest` of all overlaps together; None where no overlap shows the registration.

    A pair of scans tests few directions; a registration that is twice as bad as declared shows in
    all of them. The differences are whitened by noise and all that is no registration. Of the
    singular directions of the registration's columns those that exceed the noise are tested.
    """
    every = _differences(job, cells, registration)
    step = -(-sum(len(one.apart_m) for one in every) // MOST_ROWS)
    if not step:
        return None
    every = [one.some(slice(None, None, step)) for one in every]
    apart = np.concatenate([one.apart_m for one in every])
    moved = np.vstack([one.registration for one in every])
    variance = np.diag(np.concatenate([one.noise_m2 + one.least_m2 for one in every]))
    for key in dict.fromkeys(key for one in every for key in one.others):
        parts = [one.others.get(key, np.zeros(len(one.apart_m))) for one in every]
        column = np.concatenate(parts)
        variance += np.outer(column, column)
    lower = np.linalg.cholesky(variance)
    moved, apart = (scipy.linalg.solve_triangular(lower, one, lower=True) for one in (moved, apart))
    directions, size, _ = np.linalg.svd(moved, full_matrices=False)
    shown = size > LEAST_TOLD
    if not shown.any():
        return None
    values = directions[:, shown].T @ apart
    chi2 = float(np.sum(values**2 / (1 + size[shown] ** 2)))
    return RegistrationTest(chi2, int(np.count_nonzero(shown)))


def scans_apart(job, overlap):
    """Message that two scans differ by more than their registration allows."""
    names = [job.clouds.scans[scan].name for scan in overlap.scans]
    return message(
        "scans_apart",
        "scans {one!r} and {other!r} are {apart_mm:.1f} mm apart where both show the wall"
        " (|w| = {w:.1f}), more than their registration and their scanners allow: did one"
        " move, or is a standard deviation too small?",
        one=names[0],
        other=names[1],
        apart_mm=1000 * overlap.apart_m,
        w=overlap.w,
    )


def normals_of(surface, xyz_m):
    """(n, 3) unit vectors outwards, square to a surface of cells at places (n, 3)."""
    u, turn, distance = surface.places(np.array(xyz_m))
    away = surface.points(u, turn, distance + STEP_M) - surface.points(u, turn, distance)
    return away / np.linalg.norm(away, axis=1, keepdims=True)


def _differences(job, cells, registration):
    """`_Differences` of each pair of scans that show enough cells of the same side in common."""
    found = []
    for pair in combinations(range(len(cells.sides)), 2):
        if cells.sides[pair[0]] != cells.sides[pair[1]]:
            continue
        common = np.argwhere(np.all(cells.is_wall[list(pair)], axis=0))
        if len(common) >= FEWEST_CELLS:
            step = -(-len(common) // MOST_CELLS)
            one = _differences_of(job, cells, registration, pair, common[::step], len(common))
            if one is not None:
                found.append(one)
    return found


def _differences_of(job, cells, registration, pair, chosen, count):
    """`_Differences` of two scans in some cells (n, 2); None: the beams met too few squarely."""
    surface = cells.surface
    row, column = chosen.T
    at = cells.along_m[pair[0], row, column], cells.turn_rad[pair[0], row, column]
    radius = np.array([cells.radius_m[scan, row, column] for scan in pair])
    xyz = np.vstack([surface.points(*at, one - surface.radius_m) for one in radius])
    normal, n = normals_of(surface, xyz), len(chosen)
    shared = shared_by_beams(xyz, np.repeat(pair, n), normal, registration, job.clouds.tools)
    incidence = np.degrees(np.arccos(shared.cosine)).reshape(2, n).max(axis=0)
    steep = incidence > STEEPEST_DEG
    if np.count_nonzero(~steep) < FEWEST_CELLS:
        return None

    def difference(cause):
        outwards = np.sum(normal * cause.column_m.reshape(-1, 3), axis=1)
        return (outwards[n:] - outwards[:n])[~steep]

    moved = [difference(one) for one in shared.causes if one.what == REGISTRATION]
    others = [one for one in shared.causes if one.what != REGISTRATION]
    variances = [cells.sd_m[scan, row, column] ** 2 for scan in pair]
    return _Differences(
        pair,
        count,
        (radius[1] - radius[0])[~steep],
        sum(variances)[~steep],
        normal[:n][~steep],
        incidence[~steep],
        np.reshape(moved, (len(moved), -1)).T if moved else np.zeros((n - steep.sum(), 0)),
        {(one.name, one.what): difference(one) for one in others},
    )


def _overlap(found):
    """`Overlap` of two scans by the differences of their cells, with all that these share.

    Differences d = e . (shift of the one against the other, and a constant) + noise, e the normal.
    """
    design = np.column_stack([found.normal, np.ones(len(found.normal))])
    u, size, _ = np.linalg.svd(design, full_matrices=False)
    told = u[:, size > RANK * size[0]]
    values, count = told.T @ found.apart_m, len(found.apart_m)
    spread = told.T @ found.covariance_m2 @ told + count * LEAST_M**2 * np.eye(told.shape[1])
    test = float(values @ np.linalg.solve(spread, values))
    return Overlap(
        found.pair,
        found.count,
        float(found.apart_m.mean()),
        float(np.sqrt(values @ values / count)),
        float(np.sqrt(chdtri(1, max(chdtrc(told.shape[1], test), 1e-300)))),
        test > chdtri(told.shape[1], ALPHA),
    )
