"""What a simulation is to reach, what it found, and whether the GUM interval stands beside it.

Source: JCGM 101:2008 7.6, 7.7, 7.9.2 (numerical tolerance), 7.9.4 (batches), 8 (validation).
"""

from dataclasses import dataclass, fields

import numpy as np
from scipy.special import ndtri

from tankcal.errors import ProgramError
from tankcal.gum.coverage import coverage_factor

NAMES = ("value", "u", "low", "high", "shortest_low", "shortest_high")
SAFETY = 1.3  # a standard error from ten batches is itself known to a quarter


@dataclass(frozen=True)
class Goal:
    """When to stop.

    Attributes
    ----------
    probability : float
        Of the intervals.
    digits : int
        Significant digits of u that count (n_dig of JCGM 101 7.9.2).
    fraction : float
        Of the numerical tolerance that two standard errors may take; 0.2 for a verdict on the GUM
        interval (8.2). The ends of the shortest interval may take all of it.
    plain_draws : int
        No standard error of u and of the symmetric ends is to exceed that of so many plain draws;
        also the most that are drawn where nothing helps.
    memory : int
        Bytes that the draws and rows held at once may take.
    seed : int
        Of all draws.
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
    """Half of the last of the significant digits of u (JCGM 101 7.9.2).

    Parameters
    ----------
    u : array_like, shape (rows,)
    digits : int, optional
        Significant digits that count.

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
    sound = np.isfinite(u) & (u > 0)
    size = np.where(sound, u, 1.0)
    exponent = np.floor(np.log10(size)) - digits + 1
    exponent += np.rint(size / 10.0**exponent) >= 10**digits  # 0.0996 is written 0.10
    return np.where(sound, 0.5 * 10.0**exponent, np.nan)


@dataclass(frozen=True)
class Simulation:
    """Estimates of every row, each (rows,) in the rows' unit, and the standard error of each.

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
    reached : ndarray, shape (rows,)
        Whether two standard errors are within what the goal allows.
    draws : ndarray, shape (rows,)
        Evaluations of the model that stand behind a row.
    controlled : ndarray, shape (rows,)
        Whether the linear part served as control variate.
    probability : float
        Of the intervals.
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
        """{name: (rows,)} everything that stands for each row."""
        named = ((one.name, getattr(self, one.name)) for one in fields(self))
        return {name: values for name, values in named if name != "probability"}


def allowed_errors(goal, estimates):
    """(6, rows) standard errors that meet the numerical tolerance; inf where nothing varies."""
    limit = np.tile(goal.fraction * _tolerance(goal, estimates) / 2, (6, 1))
    limit[4:] /= goal.fraction  # where the shortest interval lies is ill determined by nature
    return np.where(np.isfinite(limit), limit, np.inf)


def may_stop(goal, estimates, errors, plain):
    """(rows,) whether draws may stop: errors meet the tolerance and those of plain draws.

    plain  (3, rows) standard errors that a single plain draw would have, of u and both ends
    """
    met = (SAFETY * errors <= allowed_errors(goal, estimates)) | ~np.isfinite(estimates)
    return np.all(met, axis=0) & as_good_as_plain(goal, estimates, errors, plain)


def as_good_as_plain(goal, estimates, errors, plain):
    """(rows,) whether u and both ends are as well known as from the plain draws of the goal."""
    limit = plain / np.sqrt(goal.plain_draws)
    return np.all((SAFETY * errors[1:4] <= limit) | ~np.isfinite(estimates[1:4]), axis=0)


def simulation(goal, estimates, errors, draws, controlled):
    """The result, complete. estimates, errors  (6, rows) in the order of NAMES.

    Raises ProgramError for an interval without ends or with its ends the wrong way round.
    """
    low, high = estimates[2::2], estimates[3::2]
    astray = np.flatnonzero(~np.all(low <= high, axis=0))
    if len(astray):
        row = astray[0]
        raise ProgramError(
            f"Monte Carlo gives row {row + 1} the intervals {low[0, row]:g} to {high[0, row]:g} "
            f"and {low[1, row]:g} to {high[1, row]:g}"
        )
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
    """That of u; where u is infinite, that of the width of the interval by that of a normal."""
    u, low, high = estimates[1:4]
    spread = (high - low) / (-2 * ndtri(goal.tail))
    return numerical_tolerance(np.where(np.isfinite(u), u, spread), goal.digits)


@dataclass(frozen=True)
class Verdict:
    """The comparison of both intervals, each (rows,), in the rows' unit.

    Attributes
    ----------
    d_low, d_high : ndarray
        |GUM end - Monte Carlo end| (8.1).
    tolerance : ndarray
        Numerical tolerance of the GUM's u with the digits asked for; nan where u is 0.
    validated : ndarray
        Both differences are within the tolerance; exact rows (u = 0) are.
    sure : ndarray
        Two standard errors of the Monte Carlo ends would not change the verdict.
    low, high : ndarray
        The interval that counts: the GUM's where it is validated, else Monte Carlo's.
    """

    d_low: np.ndarray
    d_high: np.ndarray
    tolerance: np.ndarray
    validated: np.ndarray
    sure: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def stated(self, value, U):
        """(rows,) the expanded uncertainty to state: U of the law of propagation where validated.

        Else the larger distance of the ends of Monte Carlo's interval from the value.
        """
        farthest = np.maximum(self.high - value, value - self.low)
        return np.where(self.validated, U, farthest)


def verdict(found, value, u, dof=np.inf, *, digits=2, shortest=False):
    """Judge the GUM intervals value +- k u against a Simulation.

    d = |value -+ k u - y|, validated where d <= tolerance at both ends; k of Student's t for dof

    Parameters
    ----------
    value, u, dof : ndarray, shape (rows,)
        Of the law of propagation.
    digits : optional
        Of u that count (7.9.2).
    shortest : optional
        Compare with the shortest intervals instead of the symmetric ones.
    """
    value, u = np.asarray(value, dtype=float), np.asarray(u, dtype=float)
    half = coverage_factor(found.probability, dof) * u
    low, high = (found.shortest_low, found.shortest_high) if shortest else (found.low, found.high)
    pair = (found.se_shortest_low, found.se_shortest_high)
    errors = pair if shortest else (found.se_low, found.se_high)
    tolerance = numerical_tolerance(u, digits)
    differences = np.abs(value - half - low), np.abs(value + half - high)
    allowed = np.where(np.isfinite(tolerance), tolerance, 0.0)
    validated = np.all([d <= allowed for d in differences], axis=0)
    pairs = list(zip(differences, errors, strict=True))
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
