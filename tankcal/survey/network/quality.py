"""How good the points are: ellipsoids, mean sds, proportional precision, accuracy at check points.

Source: Silva 1995 (5-20); methods of the error ellipsoid: Mikhail & Ackermann 1976, ch. 11.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri, gammaincinv

from tankcal.solver.effects import variances


def ellipsoid_factor(probability, dof=np.inf):
    """Semi-axes in sds of the ellipsoid that holds a point with a probability (3 dimensions).

    sqrt(chi2(p; 3)), or sqrt(3 F(p; 3, dof)) when the variance factor was estimated; 2.50, 2.80,
    3.37 for 90, 95, 99 %; the standard ellipsoid, factor 1, holds 20 %.
    """
    if np.isinf(dof):
        return float(np.sqrt(2 * gammaincinv(1.5, probability)))
    return float(np.sqrt(3 * fdtri(3, dof, probability)))


def ellipsoids(covariances_m2, probability=0.95, dof=np.inf):
    """Semi-axes (n, 3), m, largest first, and directions (n, 3, 3), one column for each.

    Parameters
    ----------
    covariances_m2 : ndarray, shape (n, 3, 3)
        Of n points, m2.
    """
    values, vectors = np.linalg.eigh(covariances_m2)
    axes = np.sqrt(np.maximum(values[:, ::-1], 0.0)) * ellipsoid_factor(probability, dof)
    return axes, vectors[:, :, ::-1]


@dataclass(frozen=True)
class Precision:
    """Precision of all points together, m.

    mean_sd_m       sqrt(trace / 3n)             axis_sd_m   (3,) the same along x, y, z
    spherical_sd_m  (n,) (sx + sy + sz) / 3      quadratic_sd_m  (n,) sqrt(sx2 + sy2 + sz2)
    range_m         (3,) largest minus smallest sd along x, y, z
    proportional    largest distance of the points over mean_sd_m: precision 1 : this
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

    difference_m  (n, 3) adjusted minus known       r_xyz_m    sqrt(mean of squared magnitudes)
    largest_m     largest magnitude                 mean_m     mean magnitude
    normalised    (n, 3) differences in their own sds
    """

    difference_m: np.ndarray
    r_xyz_m: float
    largest_m: float
    mean_m: float
    normalised: np.ndarray


def accuracy(adjusted, points, xyz_m, sd_m):
    """Accuracy of an Adjusted at check points (k,) with known coordinates (k, 3) and sds (k, 3)."""
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
class Compared:
    """Observations that were not adjusted, against the adjusted survey.

    difference  (n, m) computed minus observed      sd  (n, m) of it, both sides counted
    w           (n, m) their ratio; 0 where nothing is uncertain
    """

    difference: np.ndarray
    sd: np.ndarray
    w: np.ndarray


def compare_left_out(adjusted, observations):
    """Compare observations (coordinates relative to the survey's frame) that were left out.

    Parameters
    ----------
    observations : tankcal.survey.observations
        Between points of the adjusted survey.
    """
    problem, state = adjusted.problem, adjusted.solution.unknowns
    one = problem.relative(observations)
    computed, derivatives = one.computed(state, True)
    variance = np.reshape(np.square(one.sd), computed.shape).astype(float)
    variance += variances(adjusted.solution.cofactor, one.columns(problem.layout), derivatives)
    difference = one.difference(computed)
    sd = np.sqrt(variance)
    w = np.divide(difference, sd, out=np.zeros_like(sd), where=sd > 0)
    return Compared(difference, sd, w)


@dataclass(frozen=True)
class Component:
    """Is a group of observations as good as declared?

    kind        in words             source      see Residuals
    redundancy  of the group         factor      sqrt of v'Pv over redundancy: true sd over declared
    factor_sd   of it, if the declared sd is right: 1 / sqrt(2 redundancy)
    """

    kind: str
    source: object
    redundancy: float
    factor: float
    factor_sd: float


def components(residuals):
    """A Component for each group of an adjustment's residuals, one step of Foerstner's estimate."""
    found = []
    for table in residuals:
        used = np.broadcast_to(table.used[:, None], table.residual.shape)
        redundancy = float(table.redundancy[used].sum())
        if redundancy < 1e-6:
            continue
        square = float(np.sum(table.part_of_chi2[used]))
        found.append(
            Component(
                table.kind,
                table.source,
                redundancy,
                float(np.sqrt(max(square, 0.0) / redundancy)),
                float(1 / np.sqrt(2 * redundancy)),
            )
        )
    return tuple(found)


def estimate_variance_components(survey, adjust, *, rounds=20, tolerance=0.01):
    """Variance components, iterated: each group's sds times its factor until all factors are 1.

    survey  Survey                    adjust  function Survey -> Adjusted

    Returns the Adjusted and {source: factor} by which the declared sds were multiplied.
    """
    total = {}
    for _ in range(rounds):
        adjusted = adjust(survey)
        found = [c for c in components(adjusted.residuals) if c.source != "known beforehand"]
        merged = {}
        for c in found:  # several cameras' image points are one group
            square, redundancy = merged.get(c.source, (0.0, 0.0))
            merged[c.source] = (
                square + c.factor**2 * c.redundancy,
                redundancy + c.redundancy,
            )
        factors = {
            source: float(np.sqrt(square / redundancy))
            for source, (square, redundancy) in merged.items()
            if redundancy > 1 and square > 0  # residuals of 0 say nothing of an sd
        }
        for source, factor in factors.items():
            total[source] = total.get(source, 1.0) * factor
        if all(abs(factor - 1) < tolerance for factor in factors.values()):
            break
        survey = survey.with_sds(factors)
    return adjusted, total
