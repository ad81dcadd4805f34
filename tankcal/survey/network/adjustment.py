"""Adjustment of a network survey: from observations to adjusted points with their covariance.

Unknowns that are determined only formally, with standard deviations beyond the linear model, are
refused or named.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri, gammaincinv

from tankcal.camera.model import PARAMETERS
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import angle_derivatives, angles_of
from tankcal.messages import message
from tankcal.solver import UndeterminedError, linearise, solve
from tankcal.solver.effects import responses
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.datum import add_inner_constraints, datum_defect_sentence, null_space
from tankcal.survey.network.reliability import residuals_of
from tankcal.survey.observations import KnownUnknowns, PlumbLines

WORTHLESS = 0.1  # sd over the principal distance, or over the extent of the survey
HANGING = 0.03  # see datum.UNFELT: a survey held so weakly may be held by noise alone


def adjust(survey, *, datum="control", over=None, photo=None, tolerance=1e-4, max_iterations=100):
    """Least squares adjustment of all observations of a survey.

    Parameters
    ----------
    survey : Survey
    datum : str
        "control": known points and photos must fix the datum; "inner": free network, in which the
        points keep their positions on average.
    over : ndarray of int, shape (k,), optional
        Points in the inner constraints; None: all.
    photo : int, optional
        Photo in the inner constraints in place of points.
    tolerance : float
        Of the last step, see tankcal.solver.solve.
    max_iterations : int

    Returns
    -------
    Adjusted

    Raises
    ------
    SolutionError
        If unknowns or the datum are undetermined (the message names them), or if the iteration does
        not converge.
    """
    problem = _assemble_in_datum(survey, datum, over, photo)
    return _adjust_problem(
        survey,
        problem,
        datum,
        lambda: solve(
            problem.model, problem.state, tolerance=tolerance, max_iterations=max_iterations
        ),
    )


def predict(survey, *, datum="control", over=None, photo=None):
    """Predict the result of `adjust` before the measurement.

    Derivatives are taken at the start values without a step, so observed values do not matter.
    Covariances, redundancy numbers and minimal detectable biases are valid; residuals and sigma0
    have no meaning. Arguments and errors are those of `adjust`.

    Parameters
    ----------
    survey : Survey
    datum, over, photo
        See `adjust`.

    Returns
    -------
    Adjusted
    """
    problem = _assemble_in_datum(survey, datum, over, photo)
    return _adjust_problem(survey, problem, datum, lambda: linearise(problem.model, problem.state))


def _assemble_in_datum(survey, datum, over, photo):
    """The Problem of a survey, with inner constraints where requested and needed."""
    problem = assemble(survey)
    if datum == "inner":
        free = null_space(problem)
        return add_inner_constraints(problem, over, free, photo) if free.shape[1] else problem
    if any(
        isinstance(observations_of_table, PlumbLines)
        for observations_of_table in survey.observations
    ):
        # A plumb line that is not exactly vertical would hide a datum defect from the solver.
        _refuse_defect(problem)
    return problem


def _adjust_problem(survey, problem, datum, solved):
    """The Adjusted of a Problem solved by `solved`; failures are explained in words."""
    try:
        solution = solved()
    except UndeterminedError:
        if datum != "inner":
            _refuse_defect(problem)
        raise
    except SolutionError as error:
        text = message(
            "and_hanging",
            "{error}{datum}",
            error=error.args[0],
            datum="" if datum == "inner" else weak_datum_sentence(problem),
        )
        raise SolutionError(text) from error
    if survey.photos is not None:
        refuse_worthless_cameras(survey, problem, solution)
    # Averaged readings count as if adjusted one by one: add their scatter about the means.
    chi2, dof = _scatter_of_repeats(problem)
    if dof:
        solution = replace(solution, chi2=solution.chi2 + chi2, rows=solution.rows + dof)
    return Adjusted(survey, problem, solution)


def _scatter_of_repeats(problem):
    """Chi-square of repeated readings about their means, and its degrees of freedom."""
    total = np.zeros(2)
    for observations_of_group in problem.observations:
        if observations_of_group.trace is not None:
            total += [
                observations_of_group.in_use @ part for part in observations_of_group.trace.repeated
            ]
    return float(total[0]), round(total[1])


def _refuse_defect(problem):
    """Raise SolutionError, in words, if the datum has a defect."""
    free = null_space(problem)
    if free.shape[1]:
        raise SolutionError(datum_defect_sentence(free, problem))


def refuse_worthless_cameras(survey, problem, solution):
    """Raise SolutionError if the network does not determine a principal distance c."""
    first = {}
    for photo, column in enumerate(problem.layout.interior[problem.interior_of[:, 0]].tolist()):
        first.setdefault(column, photo)
    columns = sorted(column for column in first if column >= 0)
    if not columns:
        return
    photo = [first[column] for column in columns]
    unit = np.zeros((problem.model.reduced, len(columns)))
    unit[columns, np.arange(len(columns))] = 1.0
    # With N = L L', the variance of an unknown is the squared norm of L^-1 e.
    sd = np.sqrt(np.sum(solution.cofactor.factor.whitened(unit) ** 2, axis=0))
    value = solution.unknowns.interior[problem.interior_of[photo, 0]]
    for i in np.flatnonzero(~(sd < WORTHLESS * np.abs(value)))[:1]:
        camera = survey.cameras[survey.photos.camera[photo[i]]].name
        raise SolutionError(
            message(
                "c_not_determined",
                "c of {camera} is not determined: its sd would be {sd:.2g} mm; c and the distances "
                "of the photos can hardly be told apart: fix c or give it a standard deviation, or "
                "add photos from nearer, from further away or at an angle",
                camera=camera,
                sd=sd[i],
            )
        )


def find_hardly_determined(adjusted):
    """Sentences on points with a standard deviation above a tenth of the extent of the survey.

    The extent is four times the median distance of the points from their median position, which a
    diverging point does not enlarge.
    """
    sd, xyz = np.max(adjusted.point_sd_m, axis=1), adjusted.xyz_m
    adjusted_points = xyz[np.isfinite(xyz).all(axis=1)]
    extent = 4 * np.median(
        np.linalg.norm(adjusted_points - np.median(adjusted_points, axis=0), axis=1)
    )
    return tuple(
        message(
            "hardly_determined",
            "point {point} is hardly determined (sd {sd_m:.2g} m)",
            point=adjusted.survey.points[i],
            sd_m=sd[i],
        )
        for i in np.flatnonzero(sd > WORTHLESS * extent)
    )


def weak_datum_sentence(problem):
    """Sentence on a datum that is almost undetermined, or ""."""
    free = null_space(problem, HANGING)
    return f"; {datum_defect_sentence(free, problem)}" if free.shape[1] else ""


# ---- adjusted survey


def correlations(covariance):
    """Correlation matrix of a covariance (k, k); 0 where a variance is 0, 1 in the diagonal."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    # An infinite divisor turns rows without variance into zeros.
    size = np.where(sd > 0, sd, np.inf)
    matrix = covariance / np.outer(size, size)
    np.fill_diagonal(matrix, 1.0)
    return matrix


@dataclass(frozen=True)
class GlobalTest:
    """Test whether the scatter agrees with the standard deviations.

    Attributes
    ----------
    chi2 : float
        v'Pv.
    dof : int
        Degrees of freedom.
    low, high : float
        Bounds of chi2 (0 or inf for one-sided tests).
    confidence : float
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
    """Test v'Pv against the chi-square distribution, two-sided or (sides=1) upper.

    Parameters
    ----------
    chi2 : float
    dof : int
    confidence : float
    sides : int

    Returns
    -------
    GlobalTest
    """
    tail = (1 - confidence) / sides
    low = 2 * gammaincinv(dof / 2, tail) if sides == 2 else 0.0
    return GlobalTest(chi2, dof, float(low), float(chdtri(dof, tail)), confidence)


@dataclass(frozen=True)
class Adjusted:
    """An adjusted Survey. All covariances are a priori, with variance factor 1.

    The capacity table uses the a priori covariance from the declared standard deviations, whatever
    the value of sigma0. The report states sigma0 and the global test beside it. Only if the user
    requests scale "a_posteriori", all covariances are multiplied by `scale("a_posteriori")`, sigma0
    squared, with dof degrees of freedom. The smaller or larger of the two is never selected, and no
    part of the covariances is scaled separately. A failed test questions observations or standard
    deviations; the remedy is variance components or data snooping, not a factor.

    Attributes
    ----------
    survey : Survey
        Input of the adjustment.
    problem : Problem
        Problem that was solved.
    solution : tankcal.adjust.Adjustment
        Its rows and chi2 include the scatter of repeated readings.
    """

    survey: object
    problem: object
    solution: object

    @property
    def sigma0(self):
        """A posteriori root of the variance factor; nan without redundancy."""
        return self.solution.sigma0

    @property
    def chi2(self):
        """v'Pv, including the scatter of repeated readings about their means."""
        return self.solution.chi2

    @property
    def dof(self):
        """Degrees of freedom, including those of repeated readings."""
        return self.solution.dof

    def scale(self, choice="a_priori"):
        """Variance factor of all covariances: 1 for "a_priori", sigma0^2 for "a_posteriori".

        Raises
        ------
        SolutionError
            For "a_posteriori" without redundancy.
        ValueError
            For another choice.
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
        """Adjusted coordinates (points, 3); nan for points that were not adjusted."""
        return self.problem.centre_m + np.where(
            self.problem.aside[:, None], np.nan, self._state.xyz_m
        )

    @property
    def _state(self):
        return self.solution.unknowns

    def effect_of_known_m(self, of, index):
        """Change (3 points,) of all coordinates by one standard deviation of a weighted unknown.

        If the a priori value is larger by its sd, the adjusted coordinates change by this column.
        column column' is the contribution of the unknown to their covariance. It is zero for fixed
        and free unknowns.

        Parameters
        ----------
        of : str
            As in KnownUnknowns: "scale", "offset_m" (of instruments), "interior", "orientation_rad"
            or "system_scale".
        index : int
            Index in that field: the number of the instrument; for "interior"
            problem.interior_of[photo, number of the parameter].

        Returns
        -------
        ndarray, shape (3 points,)
            x, y, z of the first point, then of the next.
        """
        problem, solution = self.problem, self.solution
        columns = problem.layout.points.ravel()
        effect = np.zeros(len(columns))
        for number, group_of_known in enumerate(problem.observations):
            if not isinstance(group_of_known, KnownUnknowns) or group_of_known.of != of:
                continue
            for row in np.flatnonzero(group_of_known.index == index):
                group = problem.model.groups[number].columns[row : row + 1]
                jac = solution.cofactor.jacobians[number][row : row + 1]
                # Response of all unknowns to a unit error of the whitened row, that is to one sd.
                _, response = next(responses(solution.cofactor, group, jac))
                effect += np.append(response[:, 0], 0.0)[columns]
        return effect

    def covariance_m2(self, points=None):
        """Covariance (3k, 3k) of points by number, of all when None; 0 for fixed coordinates."""
        columns = self.problem.layout.points
        return self._cofactors(
            (columns if points is None else columns[np.asarray(points, int)]).ravel()
        )

    def covariance_of_points(self, points):
        """`PointCovariance` of points by number; exact, see `solver.Cofactors.point_covariance`."""
        columns = self.problem.layout.points[np.asarray(points, dtype=int)]
        return self.solution.cofactor.point_covariance(columns)

    def joint_covariance(self, points, **nuisances):
        """Covariance of points and of shared unknowns; 0 for fixed ones.

        Parameters
        ----------
        points : sequence of int, length k
        **nuisances : sequence of int
            Numbers of the unknowns of each name of NUISANCES.

        Returns
        -------
        ndarray
            x, y, z of each point first, then the shared unknowns in the order of the keywords.
        """
        layout = self.problem.layout
        columns = [layout.points[np.asarray(points, dtype=int)].ravel()]
        columns += [layout.nuisance[of][np.asarray(at, dtype=int)] for of, at in nuisances.items()]
        return self._cofactors(np.concatenate(columns))

    def nuisance(self, of):
        """Values (k,) of the unknowns of a name of NUISANCES."""
        return self._state.nuisance[of]

    def _cofactors(self, columns):
        """Cofactors (k, k) of unknowns, 0 for fixed ones."""
        if (columns >= 0).all():
            return self.solution.cofactor.among(columns)
        cofactors = np.zeros((len(columns), len(columns)))
        free = np.flatnonzero(columns >= 0)
        cofactors[np.ix_(free, free)] = self.solution.cofactor.among(columns[free])
        return cofactors

    @cached_property
    def point_covariances_m2(self):
        """Covariance (points, 3, 3) of each point; 0 for fixed coordinates."""
        columns, nr = self.problem.layout.points, self.problem.model.reduced
        covariances = np.zeros((len(columns), 3, 3))
        last = self.problem.eliminated
        # Eliminated points have their covariance as a block of the solver; the others need a
        # solution.
        covariances[last] = self.solution.cofactor.block_cofactors[(columns[last, 0] - nr) // 3]
        rest = np.flatnonzero(~last)
        if len(rest):
            covariances[rest] = self._small_blocks(columns[rest])
        return covariances

    def _small_blocks(self, columns):
        """Covariances (n, k, k) of small groups (n, k) of reduced unknowns."""
        pair = columns[:, :, None], columns[:, None, :]
        cofactors = self.solution.cofactor.reduced_blocks(columns)
        # Column -1 marks a fixed unknown, whose variance is 0.
        return np.where((pair[0] >= 0) & (pair[1] >= 0), cofactors, 0.0)

    @property
    def point_sd_m(self):
        """Standard deviations (points, 3), m."""
        return np.sqrt(np.maximum(np.einsum("nii->ni", self.point_covariances_m2), 0.0))

    @cached_property
    def photos(self):
        """Positions (n, 3), m, angles (n, 3), rad, and covariance (n, 6, 6) of the photos.

        The angles are omega, phi, kappa; the covariance refers to x, y, z, omega, phi, kappa.
        """
        rotation = self._state.rotation
        q = self._small_blocks(self.problem.layout.photos)
        turn = np.zeros((len(q), 6, 6))
        turn[:, :3, :3] = np.eye(3)
        # The unknowns are small rotations; the users' angles need their derivatives.
        turn[:, 3:, 3:] = angle_derivatives(rotation)
        covariance = turn @ q @ turn.transpose(0, 2, 1)
        return self.problem.centre_m + self._state.photo_xyz_m, angles_of(rotation), covariance

    def camera(self, photo=0):
        """Interior parameters of a photo: {parameter: value}, names of adjusted ones, their
        covariance (k, k)."""
        places = self.problem.interior_of[photo]
        values = dict(zip(PARAMETERS, self._state.interior[places].tolist(), strict=True))
        columns = self.problem.layout.interior[places]
        names = tuple(name for name, column in zip(PARAMETERS, columns, strict=True) if column >= 0)
        return values, names, self.solution.cofactor.among(columns[columns >= 0])

    @cached_property
    def residuals(self):
        """Residuals of each group of observations (alpha 0.001, power 0.80), as a tuple."""
        return residuals_of(self.problem, self.solution)

    def test(self, confidence=0.95, sides=2):
        """The GlobalTest of the adjustment."""
        return global_test(self.chi2, self.dof, confidence, sides)
