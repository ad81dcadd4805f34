"""Quality of points: ellipsoids, mean standard deviations, relative precision, check points.

Source: Silva 1995 (5-20); methods of the error ellipsoid: Mikhail & Ackermann 1976, ch. 11.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri, gammaincinv

from tankcal.solver.effects import variances


def ellipsoid_factor(probability, dof=np.inf):
    """Ratio of the semi-axes of a confidence ellipsoid to the standard deviations (3 dimensions).

    sqrt(chi2(p; 3)), or sqrt(3 F(p; 3, dof)) with an estimated variance factor. The factor is 2.50,
    2.80, 3.37 for 90, 95, 99 %; the standard ellipsoid, factor 1, has a probability of 20 %.
    """
    # Known variance factor: chi-square; estimated: F distribution.
    if np.isinf(dof):
        return float(np.sqrt(2 * gammaincinv(1.5, probability)))
    return float(np.sqrt(3 * fdtri(3, dof, probability)))


def ellipsoids(covariances_m2, probability=0.95, dof=np.inf):
    """Confidence ellipsoids of points.

    Parameters
    ----------
    covariances_m2 : ndarray, shape (n, 3, 3)
    probability : float
    dof : float
        Degrees of freedom of the variance factor.

    Returns
    -------
    axes : ndarray, shape (n, 3)
        Semi-axes, m, largest first.
    directions : ndarray, shape (n, 3, 3)
        One column for each axis.
    """
    values, vectors = np.linalg.eigh(covariances_m2)
    # Rounding may give tiny negative eigenvalues.
    axes = np.sqrt(np.maximum(values[:, ::-1], 0.0)) * ellipsoid_factor(probability, dof)
    return axes, vectors[:, :, ::-1]


@dataclass(frozen=True)
class Precision:
    """Precision of all points together, m.

    Attributes
    ----------
    mean_sd_m : float
        sqrt(trace / 3n).
    axis_sd_m : ndarray, shape (3,)
        Root mean variance along x, y, z.
    spherical_sd_m : ndarray, shape (n,)
        (sx + sy + sz) / 3.
    quadratic_sd_m : ndarray, shape (n,)
        sqrt(sx2 + sy2 + sz2).
    range_m : ndarray, shape (3,)
        Largest minus smallest sd along x, y, z.
    proportional : float
        Extent of the points over mean_sd_m: relative precision 1 : proportional.
    """

    mean_sd_m: float
    axis_sd_m: np.ndarray
    spherical_sd_m: np.ndarray
    quadratic_sd_m: np.ndarray
    range_m: np.ndarray
    proportional: float


def precision(xyz_m, covariances_m2):
    """Precision of points (n, 3) with covariances (n, 3, 3)."""
    variance = np.einsum("nii->ni", covariances_m2)
    sd = np.sqrt(variance)
    mean = float(np.sqrt(variance.mean()))
    extent = float(np.linalg.norm(np.ptp(xyz_m, axis=0)))
    return Precision(
        mean_sd_m=mean,
        axis_sd_m=np.sqrt(variance.mean(axis=0)),
        spherical_sd_m=sd.mean(axis=1),
        quadratic_sd_m=np.sqrt(variance.sum(axis=1)),
        range_m=np.ptp(sd, axis=0),
        proportional=extent / mean if mean > 0 else np.inf,
    )


@dataclass(frozen=True)
class Accuracy:
    """Differences at check points, m.

    Attributes
    ----------
    difference_m : ndarray, shape (n, 3)
        Adjusted minus known.
    r_xyz_m : float
        Root mean square magnitude.
    largest_m, mean_m : float
        Largest and mean magnitude.
    normalised : ndarray, shape (n, 3)
        Differences over their standard deviations.
    """

    difference_m: np.ndarray
    r_xyz_m: float
    largest_m: float
    mean_m: float
    normalised: np.ndarray


def accuracy(adjusted, points, xyz_m, sd_m):
    """Compute the Accuracy at check points.

    Parameters
    ----------
    adjusted : Adjusted
    points : ndarray of int, shape (k,)
    xyz_m, sd_m : ndarray, shape (k, 3)
        Known coordinates and their standard deviations.
    """
    difference = adjusted.xyz_m[points] - xyz_m
    size = np.linalg.norm(difference, axis=1)
    variance = np.einsum("nii->ni", adjusted.point_covariances_m2[points]) + np.square(sd_m)
    return Accuracy(
        difference_m=difference,
        r_xyz_m=float(np.sqrt(np.mean(size**2))),
        largest_m=float(size.max()),
        mean_m=float(size.mean()),
        normalised=difference / np.sqrt(variance),
    )


@dataclass(frozen=True)
class ComparedObservations:
    """Observations left out of the adjustment, compared with the adjusted survey.

    Attributes
    ----------
    difference : ndarray, shape (n, m)
        Computed minus observed.
    sd : ndarray, shape (n, m)
        Standard deviation of the difference, both parts included.
    w : ndarray, shape (n, m)
        Difference over sd; 0 where the sd is 0.
    """

    difference: np.ndarray
    sd: np.ndarray
    w: np.ndarray


def compare_left_out(adjusted, observations):
    """Compare observations left out of the adjustment with the adjusted survey.

    Parameters
    ----------
    adjusted : Adjusted
    observations : Observations
        Between adjusted points, in the frame of the survey.

    Returns
    -------
    ComparedObservations
    """
    problem, state = adjusted.problem, adjusted.solution.unknowns
    relative_observations = problem.relative(observations)
    computed, derivatives = relative_observations.computed(state, True)
    variance = np.reshape(np.square(relative_observations.sd), computed.shape).astype(float)
    # The observation was not adjusted, so it is independent of the adjusted unknowns.
    variance += variances(
        adjusted.solution.cofactor, relative_observations.columns(problem.layout), derivatives
    )
    difference = relative_observations.difference(computed)
    sd = np.sqrt(variance)
    w = np.divide(difference, sd, out=np.zeros_like(sd), where=sd > 0)
    return ComparedObservations(difference, sd, w)


@dataclass(frozen=True)
class Component:
    """Variance component of a group of observations.

    Attributes
    ----------
    kind : str
    source : object
        See Residuals.
    redundancy : float
    factor : float
        sqrt of v'Pv over redundancy: estimated over declared standard deviation.
    factor_sd : float
        Standard deviation of the factor if the declared sd holds: 1 / sqrt(2 redundancy).
    """

    kind: str
    source: object
    redundancy: float
    factor: float
    factor_sd: float


def components(residuals):
    """Component of each group of residuals: one step of Foerstner's estimate."""
    estimates = []
    for table in residuals:
        used = np.broadcast_to(table.used[:, None], table.residual.shape)
        redundancy = float(table.redundancy[used].sum())
        if redundancy < 1e-6:
            continue
        square = float(np.sum(table.part_of_chi2[used]))
        estimates.append(
            Component(
                table.kind,
                table.source,
                redundancy,
                float(np.sqrt(max(square, 0.0) / redundancy)),
                float(1 / np.sqrt(2 * redundancy)),
            )
        )
    return tuple(estimates)


def estimate_variance_components(survey, adjust, *, rounds=20, tolerance=0.01):
    """Estimate variance components iteratively.

    The standard deviations of each group are multiplied by its factor until all factors are 1.

    Parameters
    ----------
    survey : Survey
    adjust : callable
        adjust(survey) returns an Adjusted.
    rounds : int
    tolerance : float
        Largest difference of a factor from 1 at convergence.

    Returns
    -------
    adjusted : Adjusted
    factors : dict
        {source: factor} by which the declared standard deviations were multiplied.
    """
    total = {}
    for _ in range(rounds):
        adjusted = adjust(survey)
        groups = [c for c in components(adjusted.residuals) if c.source != "known beforehand"]
        merged = {}
        for c in groups:  # image points of several cameras are one group
            square, redundancy = merged.get(c.source, (0.0, 0.0))
            merged[c.source] = (
                square + c.factor**2 * c.redundancy,
                redundancy + c.redundancy,
            )
        factors = {
            source: float(np.sqrt(square / redundancy))
            for source, (square, redundancy) in merged.items()
            if redundancy > 1 and square > 0  # zero residuals give no estimate
        }
        for source, factor in factors.items():
            total[source] = total.get(source, 1.0) * factor
        # The factors multiply until the declared standard deviations agree with the residuals.
        if all(abs(factor - 1) < tolerance for factor in factors.values()):
            break
        survey = survey.with_sds(factors)
    return adjusted, total
