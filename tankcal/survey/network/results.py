"""The adjusted survey: points, photos, cameras, their covariance, and what the residuals say."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtri, gammaincinv

from tankcal.camera.model import PARAMETERS
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import angle_derivatives, angles_of
from tankcal.messages import message
from tankcal.solver.effects import responses
from tankcal.survey.network.reliability import residuals_of
from tankcal.survey.observations import KnownUnknowns


def correlations(covariance):
    """Correlation matrix of a covariance (k, k); 0 where a variance is 0, 1 in the diagonal."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size = np.where(sd > 0, sd, np.inf)
    found = covariance / np.outer(size, size)
    np.fill_diagonal(found, 1.0)
    return found


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
    low = 2 * gammaincinv(dof / 2, tail) if sides == 2 else 0.0
    return GlobalTest(chi2, dof, float(low), float(chdtri(dof, tail)), confidence)


@dataclass(frozen=True)
class Adjusted:
    """An adjusted Survey. All covariances here are a priori: of variance factor 1.

    One rule for their scale: what goes on to the capacity table is the covariance a priori, from
    the declared sds, whatever sigma0 came out; the report shows sigma0 and the global test beside
    it. Only where the user asks for scale "a_posteriori" everything is multiplied by
    `scale("a_posteriori")`, sigma0 squared, and dof go with it. Never the smaller or larger of the
    two, never a part of the covariances: a test that is not passed is a doubt about observations or
    sds, to be cleared there (variance components, data snooping) and not by a factor.

    Attributes
    ----------
    survey : Survey
        As it was handed in.
    problem : Problem
        The one that was solved.
    solution : tankcal.adjust.Adjustment
        Its rows and chi2 with the scatter of repeated readings.
    """

    survey: object
    problem: object
    solution: object

    @property
    def sigma0(self):
        """A-posteriori root of the variance factor; nan when nothing is redundant."""
        return self.solution.sigma0

    @property
    def chi2(self):
        """v'Pv, with the scatter of repeated readings about their means."""
        return self.solution.chi2

    @property
    def dof(self):
        """Degrees of freedom, those of repeated readings among them."""
        return self.solution.dof

    def scale(self, choice="a_priori"):
        """What all covariances are multiplied by: 1 for "a_priori", sigma0^2 for "a_posteriori".

        Raises SolutionError when nothing is redundant: there is no a-posteriori factor then.
        """
        if choice == "a_priori":
            return 1.0
        if choice != "a_posteriori":
            raise ValueError(f"scale {choice!r}: a_priori or a_posteriori")
        if self.dof < 1:
            raise SolutionError(
                message(
                    "no_variance_factor",
                    "no a-posteriori variance factor: no observation is redundant",
                )
            )
        return float(self.solution.variance_factor)

    @property
    def xyz_m(self):
        """(points, 3) adjusted coordinates; nan for points that were set aside."""
        return self.problem.centre_m + np.where(
            self.problem.aside[:, None], np.nan, self._state.xyz_m
        )

    @property
    def _state(self):
        return self.solution.unknowns

    def effect_of_known_m(self, of, index):
        """Change (3 points,) of all coordinates by one sd of an unknown known beforehand.

        of     as KnownUnknowns: "scale", "offset_m" (of instruments), "interior", "orientation_rad"
               or "system_scale"
        index  place in that field: the number of the instrument; for "interior"
               problem.interior_of[photo, number of the parameter]

        x, y, z of the first point, then of the next. With the value known beforehand larger by its
        sd, the adjusted coordinates are larger by this; column column' is its part of their
        covariance. Zeros for an unknown that was not weighted (fixed ones, free ones).
        """
        problem, solution = self.problem, self.solution
        columns = problem.layout.points.ravel()
        found = np.zeros(len(columns))
        for number, one in enumerate(problem.observations):
            if not isinstance(one, KnownUnknowns) or one.of != of:
                continue
            for row in np.flatnonzero(one.index == index):
                group = problem.model.groups[number].columns[row : row + 1]
                jac = solution.cofactor.jacobians[number][row : row + 1]
                _, response = next(responses(solution.cofactor, group, jac))
                found += np.append(response[:, 0], 0.0)[columns]
        return found

    def covariance_m2(self, points=None):
        """Full covariance (3k, 3k) of chosen points (numbers), of all when None; fixed ones: 0."""
        columns = self.problem.layout.points
        return self._cofactors((columns if points is None else columns[np.asarray(points)]).ravel())

    def joint_covariance(self, points, **nuisances):
        """Covariance of points and of unknowns that observations share; fixed ones: 0.

        points     numbers (k,)
        nuisances  numbers of each wanted name of NUISANCES, in the order of the keywords

        First x, y, z of each point, then the others.
        """
        layout = self.problem.layout
        columns = [layout.points[np.asarray(points, dtype=int)].ravel()]
        columns += [layout.nuisance[of][np.asarray(at, dtype=int)] for of, at in nuisances.items()]
        return self._cofactors(np.concatenate(columns))

    def nuisance(self, of):
        """(k,) values of the unknowns of a name of NUISANCES."""
        return self._state.nuisance[of]

    def _cofactors(self, columns):
        """Cofactors (k, k) of unknowns, 0 for those that are fixed."""
        if (columns >= 0).all():
            return self.solution.cofactor.among(columns)
        whole = np.zeros((len(columns), len(columns)))
        free = np.flatnonzero(columns >= 0)
        whole[np.ix_(free, free)] = self.solution.cofactor.among(columns[free])
        return whole

    @cached_property
    def point_covariances_m2(self):
        """(points, 3, 3) covariance of each point; fixed coordinates: 0."""
        columns, nr = self.problem.layout.points, self.problem.model.reduced
        whole = np.zeros((len(columns), 3, 3))
        last = self.problem.eliminated
        whole[last] = self.solution.cofactor.block_cofactors[(columns[last, 0] - nr) // 3]
        rest = np.flatnonzero(~last)
        if len(rest):
            whole[rest] = self._small_blocks(columns[rest])
        return whole

    def _small_blocks(self, columns):
        """Covariances (n, k, k) of small groups (n, k) of reduced unknowns."""
        pair = columns[:, :, None], columns[:, None, :]
        found = self.solution.cofactor.reduced_blocks(columns)
        return np.where((pair[0] >= 0) & (pair[1] >= 0), found, 0.0)

    @property
    def point_sd_m(self):
        """(points, 3) standard deviations."""
        return np.sqrt(np.maximum(np.einsum("nii->ni", self.point_covariances_m2), 0.0))

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
        return values, names, self.solution.cofactor.among(columns[columns >= 0])

    @cached_property
    def residuals(self):
        """A tuple of Residuals, one for each group of observations (alpha 0.001, power 0.80)."""
        return residuals_of(self.problem, self.solution)

    def test(self, confidence=0.95, sides=2):
        """The GlobalTest of the whole adjustment."""
        return global_test(self.chi2, self.dof, confidence, sides)
