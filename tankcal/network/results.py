"""The adjusted survey: points, photos, cameras, their covariance, and what the residuals say."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.stats

from tankcal.camera import PARAMETERS
from tankcal.network.reliability import residuals_of
from tankcal.rotations import angle_derivatives, angles_of


@dataclass(frozen=True)
class GlobalTest:
    """Is the scatter what the standard deviations say?

    chi2    v'Pv                    dof          degrees of freedom
    low     lower bound of chi2     high         upper bound (inf and 0 for one-sided tests)
    passed  chi2 lies between them  confidence   of the test
    """

    chi2: float
    dof: int
    low: float
    high: float
    confidence: float

    @property
    def passed(self):
        """True when chi2 lies within the bounds."""
        return self.low <= self.chi2 <= self.high


def global_test(chi2, dof, confidence=0.95, sides=2):
    """Test of v'Pv against the chi-square distribution, two-sided or (sides=1) upper."""
    tail = (1 - confidence) / sides
    low = scipy.stats.chi2.ppf(tail, dof) if sides == 2 else 0.0
    return GlobalTest(chi2, dof, float(low), float(scipy.stats.chi2.isf(tail, dof)), confidence)


@dataclass(frozen=True)
class Adjusted:
    """An adjusted Survey. Covariances are a-priori scaled (variance factor 1) unless said.

    survey    as it was handed in
    problem   the Problem that was solved
    solution  tankcal.gauss_markov.Solution
    """

    survey: object
    problem: object
    solution: object

    @property
    def sigma0(self):
        """A-posteriori root of the variance factor; nan when nothing is redundant."""
        return float(np.sqrt(self.solution.variance_factor))

    @property
    def dof(self):
        """Degrees of freedom."""
        return self.solution.dof

    @property
    def xyz_m(self):
        """(points, 3) adjusted coordinates; nan for points that were set aside."""
        return self.problem.centre_m + np.where(self._aside[:, None], np.nan, self._state.xyz_m)

    @property
    def _state(self):
        return self.solution.state

    @property
    def _aside(self):
        return np.array([bool(why) for why in self.problem.set_aside], dtype=bool)

    def covariance_m2(self, points=None):
        """Full covariance (3k, 3k) of chosen points (numbers), of all when None; fixed ones: 0."""
        columns = self.problem.layout.points
        columns = (columns if points is None else columns[np.asarray(points)]).ravel()
        if (columns >= 0).all():
            return self.solution.cofactors(columns)
        whole = np.zeros((len(columns), len(columns)))
        free = np.flatnonzero(columns >= 0)
        whole[np.ix_(free, free)] = self.solution.cofactors(columns[free])
        return whole

    @cached_property
    def point_covariances_m2(self):
        """(points, 3, 3) covariance of each point; fixed coordinates: 0."""
        columns, nr = self.problem.layout.points, self.problem.model.reduced
        whole = np.zeros((len(columns), 3, 3))
        last = self.problem.eliminated
        whole[last] = self.solution.block_cofactors[(columns[last, 0] - nr) // 3]
        rest = np.flatnonzero(~last)
        if len(rest):
            whole[rest] = self._small_blocks(columns[rest])
        return whole

    def _small_blocks(self, columns):
        """Covariances (n, k, k) of small groups (n, k) of reduced unknowns."""
        pair = columns[:, :, None], columns[:, None, :]
        found = self.solution.reduced_blocks(columns)
        return np.where((pair[0] >= 0) & (pair[1] >= 0), found, 0.0)

    @property
    def point_sd_m(self):
        """(points, 3) standard deviations."""
        return np.sqrt(np.einsum("nii->ni", self.point_covariances_m2))

    @cached_property
    def photos(self):
        """(xyz_m (n, 3), angles_rad (n, 3), covariance (n, 6, 6)) of the photos.

        The angles are omega, phi, kappa; the covariance is that of x, y, z, omega, phi, kappa.
        """
        rotation = self._state.rotation
        q = self._small_blocks(self.problem.layout.photos)
        turn = np.zeros((len(q), 6, 6))
        turn[:, :3, :3] = np.eye(3)
        turn[:, 3:, 3:] = angle_derivatives(rotation)
        covariance = turn @ q @ turn.transpose(0, 2, 1)
        return self.problem.centre_m + self._state.photo_xyz_m, angles_of(rotation), covariance

    def camera(self, photo=0):
        """{parameter: value} and covariance (k, k) of those adjusted, as a photo has them."""
        places = self.problem.interior_of[photo]
        values = dict(zip(PARAMETERS, self._state.interior[places].tolist(), strict=True))
        columns = self.problem.layout.interior[places]
        names = tuple(name for name, column in zip(PARAMETERS, columns, strict=True) if column >= 0)
        return values, names, self.solution.cofactors(columns[columns >= 0])

    @cached_property
    def residuals(self):
        """A tuple of Residuals, one for each group of observations (alpha 0.001, power 0.80)."""
        return residuals_of(self.problem, self.solution)

    def test(self, confidence=0.95, sides=2):
        """The GlobalTest of the whole adjustment."""
        return global_test(self.solution.chi2, self.dof, confidence, sides)
