"""Whether the GUM interval of each row stands beside Monte Carlo (JCGM 101:2008 clause 8)."""

from dataclasses import dataclass

import numpy as np

from tankcal.gum.monte_carlo.goal import numerical_tolerance
from tankcal.uncertainty import coverage_factor


@dataclass(frozen=True)
class Verdict:
    """The comparison of both intervals, each (rows,), in the rows' unit.

    d_low, d_high  |GUM end - Monte Carlo end| (8.1)
    tolerance      numerical tolerance of the GUM's u with the digits asked for; nan where u is 0
    validated      both differences are within the tolerance; exact rows (u = 0) are
    sure           two standard errors of the Monte Carlo ends would not change the verdict
    low, high      the interval that counts: the GUM's where it is validated, else Monte Carlo's
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
    value, u, dof  (rows,) of the law of propagation; digits  of u that count (7.9.2)
    shortest       compare with the shortest intervals instead of the symmetric ones
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
