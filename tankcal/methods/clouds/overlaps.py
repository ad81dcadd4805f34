"""Comparison of overlapping scans: test of the declared uncertainty of their registration."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import scipy.linalg
from scipy.special import chdtrc, chdtri

from tankcal.adjust import ALPHA
from tankcal.messages import message
from tankcal.survey.beams import shared_by_beams

REGISTRATION = "registration"  # kind of the causes that are poses
STEP_M = 1.0  # step along the normal of a surface
FEWEST_CELLS = 20  # smallest number of common cells for a comparison of two scans
MOST_CELLS = 150  # largest number of compared cells of an overlap
LEAST_M = 2e-4  # standard deviation of differences without a known cause, m
STEEP_DEG = 60.0  # largest incidence in the comparison of a pair of scans
# Largest incidence in the test of all overlaps: four set-ups outside overlap at 70 degrees and
# more.
STEEPEST_DEG = 80.0
RANK = 0.05  # smallest singular value, relative to the largest, that an overlap determines
MOST_ROWS = 1200  # largest number of differences in the test of all overlaps
# Significance level of this test; at 0.001 it misses a third of registrations twice too large.
LEVEL = 0.01
# Smallest singular value of the whitened registration that is tested: as large as the noise.
LEAST_TOLD = 1.0


@dataclass(frozen=True)
class Overlap:
    """Comparison of two scans where both show the wall.

    Attributes
    ----------
    scans : tuple of int
        Numbers of the two scans.
    cells : int
        Number of common cells.
    mean_m : float
        Mean distance of the wall in the second scan outside the wall in the first scan.
    apart_m : float
        Root mean square of the part of the differences that a shift between the scans explains.
    w : float
        Test quantity of this part against registration, offset and incidence, equivalent to |w| of
        a single reading.
    is_apart : bool
        True if the registration does not explain the differences.
    """

    scans: tuple
    cells: int
    mean_m: float
    apart_m: float
    w: float
    is_apart: bool


@dataclass(frozen=True)
class RegistrationTest:
    """Test of the registration by all differences between overlapping scans.

    Attributes
    ----------
    chi2 : float
        Chi-square of the combinations of the registration that exceed the noise of the differences.
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
        """Root mean square ratio of the differences to their standard deviation."""
        return float(np.sqrt(self.chi2 / self.dof))


@dataclass(frozen=True)
class _Differences:
    """Differences between the walls in two scans in m common cells.

    Attributes
    ----------
    pair : tuple of int
        Numbers of the two scans.
    count : int
        Number of all common cells.
    apart_m, noise_m2 : ndarray, shape (m,)
        Wall of the second scan less wall of the first scan, outwards, and the variance of this
        difference due to independent noise.
    normal : ndarray, shape (m, 3)
        Unit normals of the wall, outwards.
    incidence_deg : ndarray, shape (m,)
        The larger angle of incidence of the two beams.
    registration : ndarray, shape (m, r)
        Standard deviations of the differences due to the causes of the registration.
    others : dict of (str, str) to ndarray, shape (m,)
        The same for any other cause that the scans share, by its name and kind.
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
        """Variances (m,) of differences without a known cause, which are constant over an overlap.

        The number of cells does not reduce them. They grow with the footprint of an oblique beam.
        """
        return len(self.apart_m) * (LEAST_M / np.cos(np.radians(self.incidence_deg))) ** 2

    def some(self, chosen):
        """Return the differences of selected cells; chosen: a mask or a slice."""
        rows = ("apart_m", "noise_m2", "normal", "incidence_deg", "registration")
        others = {key: column[chosen] for key, column in self.others.items()}
        return replace(self, others=others, **{key: getattr(self, key)[chosen] for key in rows})

    @property
    def covariance_m2(self):
        """Covariance of the differences, shape (m, m)."""
        shared = np.column_stack([self.registration, *self.others.values()])
        return shared @ shared.T + np.diag(self.noise_m2)


def overlaps_of(job, cells, registration):
    """Compare all pairs of scans that show enough cells of the same side in common.

    Parameters
    ----------
    job : Job
    cells : CloudWall
    registration : Registration

    Returns
    -------
    tuple of Overlap
    """
    pairs = [
        pair.some(pair.incidence_deg <= STEEP_DEG)
        for pair in _differences(job, cells, registration)
    ]
    return tuple(_overlap(pair) for pair in pairs if len(pair.apart_m) >= FEWEST_CELLS)


def overlap_test(job, cells, registration):
    """Test the registration by all overlaps together.

    A pair of scans tests few directions. A registration with twice the declared uncertainty shows
    in all overlaps. The differences are whitened by their covariance without the registration. The
    singular directions of the registration that exceed the noise are tested.

    Parameters
    ----------
    job : Job
    cells : CloudWall
    registration : Registration

    Returns
    -------
    RegistrationTest or None
        None if no overlap shows the registration.
    """
    pairs = _differences(job, cells, registration)
    step = -(-sum(len(pair.apart_m) for pair in pairs) // MOST_ROWS)
    if not step:
        return None
    pairs = [pair.some(slice(None, None, step)) for pair in pairs]
    differences = np.concatenate([pair.apart_m for pair in pairs])
    by_registration = np.vstack([pair.registration for pair in pairs])
    variance = np.diag(np.concatenate([pair.noise_m2 + pair.least_m2 for pair in pairs]))
    for key in dict.fromkeys(key for pair in pairs for key in pair.others):
        # A cause shared by several overlaps correlates their differences: one column over all of
        # them.
        parts = [pair.others.get(key, np.zeros(len(pair.apart_m))) for pair in pairs]
        column = np.concatenate(parts)
        variance += np.outer(column, column)
    # Whitening by the Cholesky factor makes the noise of all combinations 1.
    lower = np.linalg.cholesky(variance)
    by_registration, differences = (
        scipy.linalg.solve_triangular(lower, column, lower=True)
        for column in (by_registration, differences)
    )
    directions, singular_values, _ = np.linalg.svd(by_registration, full_matrices=False)
    is_tested = singular_values > LEAST_TOLD
    if not is_tested.any():
        return None
    values = directions[:, is_tested].T @ differences
    # In whitened coordinates a direction has variance 1 from the noise and size squared from the
    # registration.
    chi2 = float(np.sum(values**2 / (1 + singular_values[is_tested] ** 2)))
    return RegistrationTest(chi2, int(np.count_nonzero(is_tested)))


def scans_apart(job, overlap):
    """Return the message that two scans differ by more than their registration allows."""
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
    """Return the outward unit normals of a surface of cells at given places, shape (n, 3)."""
    u, turn, distance = surface.places(np.array(xyz_m))
    away = surface.points(u, turn, distance + STEP_M) - surface.points(u, turn, distance)
    return away / np.linalg.norm(away, axis=1, keepdims=True)


def _differences(job, cells, registration):
    """`_Differences` of each pair of scans that show enough cells of the same side in common."""
    differences = []
    for pair in combinations(range(len(cells.sides)), 2):
        if cells.sides[pair[0]] != cells.sides[pair[1]]:
            continue
        common = np.argwhere(np.all(cells.is_wall[list(pair)], axis=0))
        if len(common) >= FEWEST_CELLS:
            step = -(-len(common) // MOST_CELLS)
            comparison = _compare_scans(job, cells, registration, pair, common[::step], len(common))
            if comparison is not None:
                differences.append(comparison)
    return differences


def _compare_scans(job, cells, registration, pair, chosen, count):
    """Differences between two scans in selected cells.

    Parameters
    ----------
    job : Job
    cells : CloudWall
    registration : Registration
    pair : tuple of int
        Numbers of the scans.
    chosen : ndarray of int, shape (n, 2)
        Row and column of each cell.
    count : int
        Number of all common cells.

    Returns
    -------
    _Differences or None
        None if too few cells remain below the largest incidence.
    """
    surface = cells.surface
    row, column = chosen.T
    at = cells.along_m[pair[0], row, column], cells.turn_rad[pair[0], row, column]
    radius = np.array([cells.radius_m[scan, row, column] for scan in pair])
    xyz = np.vstack([surface.points(*at, distance - surface.radius_m) for distance in radius])
    normal, n = normals_of(surface, xyz), len(chosen)
    shared = shared_by_beams(xyz, np.repeat(pair, n), normal, registration, job.clouds.tools)
    # The beam with the larger incidence limits the accuracy of a difference.
    incidence = np.degrees(np.arccos(shared.cosine)).reshape(2, n).max(axis=0)
    is_steep = incidence > STEEPEST_DEG
    if np.count_nonzero(~is_steep) < FEWEST_CELLS:
        return None

    def difference(cause):
        outwards = np.sum(normal * cause.column_m.reshape(-1, 3), axis=1)
        return (outwards[n:] - outwards[:n])[~is_steep]

    by_registration = [difference(cause) for cause in shared.causes if cause.what == REGISTRATION]
    others = [cause for cause in shared.causes if cause.what != REGISTRATION]
    variances = [cells.sd_m[scan, row, column] ** 2 for scan in pair]
    return _Differences(
        pair,
        count,
        (radius[1] - radius[0])[~is_steep],
        sum(variances)[~is_steep],
        normal[:n][~is_steep],
        incidence[~is_steep],
        np.reshape(by_registration, (len(by_registration), -1)).T
        if by_registration
        else np.zeros((n - is_steep.sum(), 0)),
        {(cause.name, cause.what): difference(cause) for cause in others},
    )


def _overlap(differences):
    """`Overlap` of two scans from the differences of their cells.

    Model: d = n . s + c + noise, with the normal n, the shift s between the scans and a constant c.
    """
    design = np.column_stack([differences.normal, np.ones(len(differences.normal))])
    u, singular_values, _ = np.linalg.svd(design, full_matrices=False)
    # Keep the combinations of shift and constant that the cells determine.
    directions = u[:, singular_values > RANK * singular_values[0]]
    values, count = directions.T @ differences.apart_m, len(differences.apart_m)
    # Covariance of these combinations; unexplained differences do not average out over the cells.
    spread = directions.T @ differences.covariance_m2 @ directions + count * LEAST_M**2 * np.eye(
        directions.shape[1]
    )
    test = float(values @ np.linalg.solve(spread, values))
    return Overlap(
        differences.pair,
        differences.count,
        float(differences.apart_m.mean()),
        float(np.sqrt(values @ values / count)),
        # Express the chi-square as |w| of a single reading with the same probability.
        float(np.sqrt(chdtri(1, max(chdtrc(directions.shape[1], test), 1e-300)))),
        test > chdtri(directions.shape[1], ALPHA),
    )
