"""Deviation of a level gauge from hand dips at several levels, by least squares.

With the indication G and the dip L above the dip plate, the deviation is a straight line, plus the
movement h of the gauge where the shell carries it:

    G - L = a + b (L - L_m) + h(L) + e

The slope has two causes that dips alone cannot separate: the scale of the gauge, and a still pipe
that leans by the angle t. Along such a pipe, the distance from the top is longer by 1/cos t - 1, so
a leaning pipe adds s(t) = 1/cos t - 1 to the slope.

Errors of the tape are common to all levels. They are columns of the factor F of the covariance

    C = D + F F',     D = diag(u_dip^2/m + u_gauge^2 + r^2/12)

with m dips at a level and the resolution r. A gauge at rest repeats its friction and its rounding,
so that repeats reduce the error of the dips only. The estimate is best linear unbiased.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from tankcal.adjust import adjust
from tankcal.gum.components import Source, combine
from tankcal.gum.coverage import coverage_factor

LEAST_LEVELS = 3  # of a line with a check
SCATTER_DOF = 8  # of a declared repeatability that is known to about 25 % (GUM G.4.2)
LEAST_PROBABILITY = 0.05  # of the scatter of the residuals; below it, only the residuals count


@dataclass(frozen=True)
class Dips:
    """Mean readings at n levels, and their errors.

    Attributes
    ----------
    level_m, gauge_m : ndarray, shape (n,)
        Corrected dip above the dip plate, and indication of the gauge.
    movement_m : ndarray, shape (n,)
        Movement h of the gauge by the liquid head; 0 where the gauge corrects it.
    u_scatter_m : ndarray, shape (n,)
        Standard uncertainty of the independent errors of each difference.
    shared : dict
        {source: column (n,)}: errors of the difference G - L that are common to all levels, each
        for one standard uncertainty.
    """

    level_m: np.ndarray
    gauge_m: np.ndarray
    movement_m: np.ndarray
    u_scatter_m: np.ndarray
    shared: dict

    @property
    def deviation_m(self):
        """Deviation of the gauge at each level, G - L."""
        return self.gauge_m - self.level_m


@dataclass(frozen=True)
class KnownSlope:
    """Slope from the certificate of the gauge and the plumb of the pipe, for too few levels.

    Attributes
    ----------
    value, u : float
        Slope, and its standard uncertainty.
    """

    value: float
    u: float


@dataclass(frozen=True)
class Line:
    """Estimated line, and the sources of its uncertainty.

    Attributes
    ----------
    mean_level_m : float
        L_m, the level at which offset and slope are nearly independent.
    unknowns : ndarray, shape (2,)
        Offset a at L_m, m, and slope b.
    sources : tuple of Source
        Columns with the rows of `unknowns`; u, degrees of freedom and U follow by `combine`.
    residuals_m : ndarray, shape (n,)
        Estimated less observed deviation.
    w : ndarray, shape (n,)
        Residuals over their standard deviations; nan without redundancy.
    sigma0 : float
        Standard deviation of the residuals over its declared value; nan without redundancy.
    probability : float
        Probability of a larger scatter if the declared repeatability is correct.
    dof : int
        Degrees of freedom of the residuals.
    scatter_factor : float
        Factor of the declared repeatability in all uncertainties.
    is_scatter_estimated : bool
        The residuals alone determine the scatter, because they contradict the declaration.
    is_slope_estimated : bool
        False: the slope is a declared value.
    """

    mean_level_m: float
    unknowns: np.ndarray
    sources: tuple
    residuals_m: np.ndarray
    w: np.ndarray
    sigma0: float
    probability: float
    dof: int
    scatter_factor: float
    is_scatter_estimated: bool
    is_slope_estimated: bool

    def at(self, level_m, movement_m):
        """Deviations at (k,) levels with the movements h there.

        Returns
        -------
        deviation_m : ndarray, shape (k,)
        sources : tuple of Source
            With a row for each level.
        """
        rows = np.column_stack([np.ones(len(level_m)), level_m - self.mean_level_m])
        sources = []
        for source in self.sources:
            source = source.weighted(rows)
            if source.kind == "movement":  # this error acts on h at this level
                columns = source.columns_m3 + np.atleast_2d(movement_m).T * source.estimate
                source = replace(source, columns_m3=columns)
            sources.append(source)
        return rows @ self.unknowns + movement_m, tuple(sources)


def fit_line(dips, known_slope=None, movement_share=0.0):
    """Estimate the line of a gauge.

    Parameters
    ----------
    dips : Dips
    known_slope : KnownSlope, optional
        Slope in place of an estimate; None: it is estimated from at least three levels.
    movement_share : float, optional
        Relative standard uncertainty of the movement h.

    Returns
    -------
    Line

    Raises
    ------
    SolutionError
        If all levels are equal.

    Examples
    --------
    Three levels with a deviation of 2 mm and a slope of 0.5 mm/m:

    >>> level = np.array([2.0, 6.0, 10.0])
    >>> gauge = level + 0.002 + 0.0005 * (level - 6)
    >>> dips = Dips(level, gauge, 0 * level, np.full(3, 0.001), {"tape offset": np.full(3, 5e-4)})
    >>> line = fit_line(dips)
    >>> (1000 * line.unknowns).round(6).tolist()
    [2.0, 0.5]
    """
    shared = dict(dips.shared)
    if movement_share and dips.movement_m.any():
        # The model subtracts h from the observed deviations.
        shared["movement"] = -movement_share * dips.movement_m
    observed = dips.deviation_m - dips.movement_m
    mean = float(np.average(dips.level_m, weights=dips.u_scatter_m**-2))
    lever = dips.level_m - mean
    rows = np.column_stack([np.ones_like(lever), lever])
    if known_slope is not None:
        observed, rows = observed - known_slope.value * lever, rows[:, :1]
        shared["gauge scale"] = -known_slope.u * lever
    factor = np.column_stack([*shared.values(), np.zeros_like(lever)])
    covariance = np.diag(dips.u_scatter_m**2) + factor @ factor.T
    result = adjust(lambda x, l: (rows @ x - l, rows, None), np.zeros(rows.shape[1]), observed,
                    covariance)  # fmt: skip
    # x = K l, so that each source keeps its own columns.
    estimator = result.cofactor @ np.linalg.solve(covariance, rows).T
    unknowns = np.append(result.unknowns, [] if known_slope is None else known_slope.value)
    if known_slope is not None:
        estimator = np.vstack([estimator, np.zeros_like(lever)])
    factor_of_scatter, scatter_dof, is_estimated = _scatter(result)
    probability = chdtrc(result.dof, result.chi2) if result.dof > 0 else np.nan
    scatter = Source(
        "scatter", factor_of_scatter * estimator * dips.u_scatter_m, scatter_dof, type="A"
    )
    sources = [scatter]
    for kind, column in shared.items():
        columns = (estimator @ column)[:, None]
        if kind == "gauge scale":  # the slope itself is declared
            columns = columns + np.array([[0.0], [known_slope.u]])
        share = movement_share if kind == "movement" else None
        sources.append(Source(kind, columns, estimate=share))
    sd = np.sqrt(np.clip(np.diag(covariance - rows @ result.cofactor @ rows.T), 0, None))
    has_check = sd > 1e-9 * np.sqrt(np.diag(covariance))
    w = np.full(len(sd), np.nan)
    w[has_check] = result.residuals[has_check] / sd[has_check]
    return Line(
        mean,
        unknowns,
        tuple(sources),
        result.residuals,
        w,
        result.sigma0,
        float(probability),
        result.dof,
        factor_of_scatter,
        is_estimated,
        known_slope is None,
    )


def _scatter(result):
    """(factor of the declared scatter, its degrees of freedom, whether residuals alone count).

    The declared variance has SCATTER_DOF degrees of freedom and is pooled with the residuals. If
    the residuals contradict it, they replace it.
    """
    dof = result.dof
    if dof <= 0:
        return 1.0, float(SCATTER_DOF), False
    if chdtrc(dof, result.chi2) < LEAST_PROBABILITY:
        return float(np.sqrt(result.chi2 / dof)), float(dof), True
    pooled = (SCATTER_DOF + result.chi2) / (SCATTER_DOF + dof)
    return float(np.sqrt(pooled)), float(SCATTER_DOF + dof), False


def sources_of_dips(dips, line):
    """Sources of the observed deviation at each level, with the scatter of the fit."""
    scatter = next(source for source in line.sources if source.kind == "scatter")
    u = line.scatter_factor * dips.u_scatter_m
    return (
        replace(scatter, columns_m3=np.diag(u)),
        *(Source(kind, column[:, None]) for kind, column in dips.shared.items()),
    )


def slope_of_tilt(tilt_rad, u_rad):
    """Slope by a leaning pipe, 1/cos t - 1, and its standard uncertainty.

    Parameters
    ----------
    tilt_rad, u_rad : float
        Measured angle off the plumb, and its standard uncertainty.

    Returns
    -------
    slope, u : float
        With the terms of second order, which are the only ones at t = 0.

    Examples
    --------
    10 m along a pipe that leans by 2 degrees are 6.1 mm too long:

    >>> round(10_000 * slope_of_tilt(np.radians(2), 0)[0], 1)
    6.1
    """
    # Second derivative of 1/cos t: (1 + sin^2 t) / cos^3 t.
    bend = (1 + np.sin(tilt_rad) ** 2) / np.cos(tilt_rad) ** 3
    slope = 1 / np.cos(tilt_rad) - 1 + bend * u_rad**2 / 2
    first = np.sin(tilt_rad) / np.cos(tilt_rad) ** 2 * u_rad
    return float(slope), float(np.hypot(first, bend * u_rad**2 / np.sqrt(2)))


def tilt_of_slope(slope):
    """Angle of a pipe that explains a slope, rad; 0 for a negative slope.

    Examples
    --------
    >>> round(float(np.degrees(tilt_of_slope(slope_of_tilt(np.radians(1.5), 0)[0]))), 6)
    1.5
    """
    return float(np.arccos(1 / (1 + slope))) if slope > 0 else 0.0


def expand(sources, probability):
    """(u, U, effective degrees of freedom, k) of each row of the sources."""
    combined = combine(sources, len(sources[0].columns_m3))
    k = coverage_factor(probability, combined.effective_dof)
    return combined.u, k * combined.u, combined.effective_dof, k
