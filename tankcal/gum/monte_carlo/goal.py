"""Goal and result of a simulation, and validation of the GUM interval.

Source: JCGM 101:2008 7.6, 7.7, 7.9.2 (numerical tolerance), 7.9.4 (batches), 8 (validation).
"""

from dataclasses import dataclass, fields

import numpy as np
from scipy.special import ndtri

from tankcal.errors import ProgramError
from tankcal.gum.coverage import coverage_factor

NAMES = ("value", "u", "low", "high", "shortest_low", "shortest_high")
SAFETY = 1.3  # factor of a standard error from ten batches, which is uncertain by a quarter


@dataclass(frozen=True)
class Goal:
    """Stopping rule of a simulation.

    Attributes
    ----------
    probability : float
        Coverage probability of the intervals.
    digits : int
        Significant digits of u (n_dig of JCGM 101 7.9.2).
    fraction : float
        Limit of two standard errors, relative to the numerical tolerance. For the validation of a
        GUM interval it is 0.2 (8.2). For the ends of the shortest interval, the limit is the whole
        tolerance.
    plain_draws : int
        Number of plain draws whose standard errors of u and of the symmetric ends must be reached.
        It is also the largest number of draws if the linear part gives no improvement.
    memory : int
        Largest memory of simultaneous draws and rows, in bytes.
    seed : int
        Seed of all draws.

    Raises
    ------
    ValueError
        For values outside their range.
    """

    probability: float = 0.95
    digits: int = 2
    fraction: float = 0.2
    plain_draws: int = 1_000_000
    memory: int = 256_000_000
    seed: int = 20080101

    def __post_init__(self):
        if not 0 < self.probability < 1:
            raise ValueError(f"coverage probability {self.probability}: expected between 0 and 1")
        if self.digits < 1 or self.plain_draws < 1 or not self.fraction > 0:
            raise ValueError("digits, draws and fraction of the tolerance: expected above 0")

    @property
    def tail(self):
        """Probability beyond each end of the symmetric interval."""
        return (1 - self.probability) / 2


def numerical_tolerance(u, digits=2):
    """Numerical tolerance: half of the last significant digit of u (JCGM 101 7.9.2).

    Parameters
    ----------
    u : array_like, shape (rows,)
        Standard uncertainty.
    digits : int, optional
        Number of significant digits.

    Returns
    -------
    ndarray, shape (rows,)
        In the unit of u; nan for 0, inf and nan.

    Examples
    --------
    >>> numerical_tolerance([0.0123, 45.6]).tolist()
    [0.0005, 0.5]
    """
    u = np.atleast_1d(np.asarray(u, dtype=float))
    is_positive = np.isfinite(u) & (u > 0)
    size = np.where(is_positive, u, 1.0)
    # Exponent of the last significant digit; rounding can add a digit.
    exponent = np.floor(np.log10(size)) - digits + 1
    exponent += np.rint(size / 10.0**exponent) >= 10**digits  # 0.0996 is rounded to 0.10
    return np.where(is_positive, 0.5 * 10.0**exponent, np.nan)


@dataclass(frozen=True)
class Simulation:
    """Estimates of every row, each (rows,) in the unit of the row, with standard errors.

    Attributes
    ----------
    value, u : ndarray
        Mean and standard deviation.
    low, high : ndarray
        Probabilistically symmetric interval (JCGM 101 7.7.2).
    shortest_low, shortest_high : ndarray
        Shortest interval (7.7.3, 7.7.4).
    se_value, se_u, se_low, se_high, se_shortest_low, se_shortest_high : ndarray
        Standard errors, from independent batches.
    tolerance : ndarray
        Numerical tolerance of u (7.9.2).
    reached : ndarray of bool
        True if two standard errors are within the limits of the goal.
    draws : ndarray of int
        Number of evaluations of the model.
    controlled : ndarray of bool
        True if the linear part served as control variate.
    probability : float
        Coverage probability of the intervals.
    """

    value: np.ndarray
    u: np.ndarray
    low: np.ndarray
    high: np.ndarray
    shortest_low: np.ndarray
    shortest_high: np.ndarray
    se_value: np.ndarray
    se_u: np.ndarray
    se_low: np.ndarray
    se_high: np.ndarray
    se_shortest_low: np.ndarray
    se_shortest_high: np.ndarray
    tolerance: np.ndarray
    reached: np.ndarray
    draws: np.ndarray
    controlled: np.ndarray
    probability: float

    @property
    def by_volume(self):
        """All arrays with an element for each row, by name."""
        pairs = ((item.name, getattr(self, item.name)) for item in fields(self))
        return {name: values for name, values in pairs if name != "probability"}


def allowed_errors(goal, estimates):
    """Largest standard errors (6, rows) within the numerical tolerance; inf without variation."""
    limit = np.tile(goal.fraction * _tolerance(goal, estimates) / 2, (6, 1))
    # The position of the shortest interval is ill-determined, since its length is near a minimum.
    limit[4:] /= goal.fraction
    return np.where(np.isfinite(limit), limit, np.inf)


def may_stop(goal, estimates, errors, plain):
    """Whether the draws of each row (rows,) may stop.

    Parameters
    ----------
    goal : Goal
        The goal.
    estimates, errors : ndarray, shape (6, rows)
        Estimates and standard errors in the order of NAMES.
    plain : ndarray, shape (3, rows)
        Standard errors of u and of both ends for a single plain draw.

    Returns
    -------
    ndarray of bool, shape (rows,)
        True if the errors meet the tolerance and the errors of the plain draws of the goal.
    """
    met = (SAFETY * errors <= allowed_errors(goal, estimates)) | ~np.isfinite(estimates)
    return np.all(met, axis=0) & as_good_as_plain(goal, estimates, errors, plain)


def as_good_as_plain(goal, estimates, errors, plain):
    """Whether u and both ends (rows,) are as precise as with the plain draws of the goal."""
    limit = plain / np.sqrt(goal.plain_draws)
    return np.all((SAFETY * errors[1:4] <= limit) | ~np.isfinite(estimates[1:4]), axis=0)


def simulation(goal, estimates, errors, draws, controlled):
    """Assemble the result.

    Parameters
    ----------
    goal : Goal
        The goal.
    estimates, errors : ndarray, shape (6, rows)
        Estimates and standard errors in the order of NAMES.
    draws, controlled : ndarray, shape (rows,)
        Number of draws, and use of the control variate.

    Returns
    -------
    Simulation

    Raises
    ------
    ProgramError
        For an interval with nan ends or with its ends in the wrong order.
    """
    low, high = estimates[2::2], estimates[3::2]
    astray = np.flatnonzero(~np.all(low <= high, axis=0))
    if len(astray):
        row = astray[0]
        raise ProgramError(
            f"Monte Carlo gives row {row + 1} the intervals {low[0, row]:g} to {high[0, row]:g} "
            f"and {low[1, row]:g} to {high[1, row]:g}"
        )
    # Unlike `may_stop`, the result uses the standard errors without the safety factor.
    met = (errors <= allowed_errors(goal, estimates)) | ~np.isfinite(estimates)
    values = dict(zip(NAMES, estimates, strict=True))
    deviations = {f"se_{name}": se for name, se in zip(NAMES, errors, strict=True)}
    return Simulation(
        **values,
        **deviations,
        tolerance=_tolerance(goal, estimates),
        reached=np.all(met, axis=0),
        draws=draws,
        controlled=controlled,
        probability=goal.probability,
    )


def _tolerance(goal, estimates):
    """Numerical tolerance of u; for an infinite u, derived from the width of the interval."""
    # u is infinite for Student's t with two degrees of freedom or fewer.
    u, low, high = estimates[1:4]
    # Standard deviation of a normal distribution with an interval of equal width.
    spread = (high - low) / (-2 * ndtri(goal.tail))
    return numerical_tolerance(np.where(np.isfinite(u), u, spread), goal.digits)


@dataclass(frozen=True)
class Verdict:
    """Comparison of the GUM interval with Monte Carlo, each (rows,) in the unit of the row.

    Attributes
    ----------
    d_low, d_high : ndarray
        |GUM end - Monte Carlo end| (8.1).
    tolerance : ndarray
        Numerical tolerance of u of the GUM; nan for u = 0.
    validated : ndarray of bool
        True if both differences are within the tolerance, and for exact rows (u = 0).
    sure : ndarray of bool
        True if two standard errors of the Monte Carlo ends would not change the verdict.
    low, high : ndarray
        Interval to state: of the GUM if validated, else of Monte Carlo.
    """

    d_low: np.ndarray
    d_high: np.ndarray
    tolerance: np.ndarray
    validated: np.ndarray
    sure: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def stated(self, value, U):
        """Expanded uncertainty (rows,) to state.

        Parameters
        ----------
        value, U : ndarray, shape (rows,)
            Value and expanded uncertainty of the law of propagation.

        Returns
        -------
        ndarray, shape (rows,)
            U if validated, else the larger distance of the ends of the Monte Carlo interval from
            the value.
        """
        # The interval of Monte Carlo may be asymmetric about the value.
        farthest = np.maximum(self.high - value, value - self.low)
        return np.where(self.validated, U, farthest)


def verdict(result, value, u, dof=np.inf, *, digits=2, shortest=False):
    """Validate the GUM intervals value +- k u against a Simulation (JCGM 101 8).

    Parameters
    ----------
    result : Simulation
        Result of the simulation.
    value, u, dof : array_like, shape (rows,)
        Value, standard uncertainty and degrees of freedom of the law of propagation.
    digits : int, optional
        Significant digits of u (7.9.2).
    shortest : bool, optional
        If True, compare with the shortest intervals instead of the symmetric intervals.

    Returns
    -------
    Verdict

    Notes
    -----
    d = |value -+ k u - y|, validated if d <= tolerance at both ends; k of Student's t for `dof`.
    """
    value, u = np.asarray(value, dtype=float), np.asarray(u, dtype=float)
    half = coverage_factor(result.probability, dof) * u
    low, high = (
        (result.shortest_low, result.shortest_high) if shortest else (result.low, result.high)
    )
    pair = (result.se_shortest_low, result.se_shortest_high)
    errors = pair if shortest else (result.se_low, result.se_high)
    tolerance = numerical_tolerance(u, digits)
    differences = np.abs(value - half - low), np.abs(value + half - high)
    # For u = 0 the tolerance is nan, and only an exact agreement is valid.
    allowed = np.where(np.isfinite(tolerance), tolerance, 0.0)
    validated = np.all([d <= allowed for d in differences], axis=0)
    pairs = list(zip(differences, errors, strict=True))
    # The verdict is sure if the differences, changed by two standard errors, give no other verdict.
    surely = np.all([d + 2 * se <= allowed for d, se in pairs], axis=0)
    surely_not = np.any([d - 2 * se > allowed for d, se in pairs], axis=0)
    return Verdict(
        *differences,
        tolerance,
        validated,
        np.where(validated, surely, surely_not),
        np.where(validated, value - half, low),
        np.where(validated, value + half, high),
    )
