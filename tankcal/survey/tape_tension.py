"""Effect of the pull on a tape: elastic strain, and sag of free spans.

    mean tension = pull (1 - exp(-m)) / m,   m = mu w, w half the angle that one pull wraps
    strain = (mean tension - F_cert) / (A E)
    sag of a free span = w^2 L^3 / (24 F^2),   w the weight per metre, F the tension there

Friction reduces the tension with the distance from the ends of the tape. The position of a span is
not recorded, so all positions are equally likely. 1 / F^2 is therefore the mean of exp(2 m s) /
pull^2 over s from 0 to 1, and its standard deviation enters the uncertainty.

Source: ISO 7507-1:2003; API MPMS 2.2A (methods); the sag is the first term of the catenary.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sag:
    """Excess of a reading caused by free spans.

    Attributes
    ----------
    excess_m : float
    by_friction_m : float
        Derivative by the relative coefficient of friction, m.
    place_share : float
        Relative standard deviation due to the unknown positions of the spans; 0 without friction.
    """

    excess_m: float = 0.0
    by_friction_m: float = 0.0
    place_share: float = 0.0


def mean_tension_n(pull_n, friction, pulls):
    """Mean tension of a tape round a tank, pulled at both ends, N.

        pull (1 - exp(-mu w)) / (mu w),   w half the angle that one pull wraps

    Parameters
    ----------
    pull_n : float
        Pull at the ends, N.
    friction : float
        Coefficient of friction mu.
    pulls : int
        Number of pulls round the tank.

    Returns
    -------
    float

    Examples
    --------
    >>> [round(float(mean_tension_n(1.0, mu, 1)), 3) for mu in (0.1, 0.3)]
    [0.858, 0.648]
    """
    exponent = friction * np.pi / pulls
    # expm1 avoids the cancellation of 1 - exp(-m) at small friction.
    return pull_n * (-np.expm1(-exponent) / exponent if exponent else 1.0)


def pull_of(strap, tape):
    """Pull of a reading, N: recorded, or that of the certificate; None: unknown."""
    return tape.tension_n if strap.tension_n is None else strap.tension_n


def strain_of(strap, tape):
    """Strain relative to the certificate, and its derivatives by relative pull and friction.

    Parameters
    ----------
    strap : Strap
    tape : Tape

    Returns
    -------
    tuple of (float, float, float)
        Zero if the pull or the stiffness is unknown.
    """
    pull = pull_of(strap, tape)
    if pull is None or not np.isfinite(tape.stiffness_n):
        return 0.0, 0.0, 0.0
    mean = mean_tension_n(pull, tape.friction, strap.pulls)
    exponent = tape.friction * np.pi / strap.pulls
    # d(mean)/d(ln mu) = pull exp(-m) - mean.
    by_friction = (pull * np.exp(-exponent) - mean) / tape.stiffness_n if exponent else 0.0
    return (mean - (tape.tension_n or 0.0)) / tape.stiffness_n, mean / tape.stiffness_n, by_friction


def sag_excess_m(span_m, weight_n_per_m, tension_n):
    """Length of a freely hanging tape minus its span, m.

        w^2 L^3 / (24 F^2)

    The ends are level. The neglected terms are (w L / F)^2 / 80 of the excess.

    Parameters
    ----------
    span_m : float
    weight_n_per_m : float
        Weight per metre, N/m.
    tension_n : float

    Returns
    -------
    float

    Examples
    --------
    >>> [round(1000 * sag_excess_m(span, 0.2, 50.0), 3) for span in (5, 10, 20)]
    [0.083, 0.667, 5.333]
    """
    return weight_n_per_m**2 * span_m**3 / (24 * tension_n**2)


def sag_of(strap, tape, obstructions):
    """Compute the `Sag` of the free spans of a reading.

    Parameters
    ----------
    strap : Strap
    tape : Tape
    obstructions : iterable of Obstruction
        Obstructions of other kinds are ignored.

    Returns
    -------
    Sag

    Raises
    ------
    ValueError
        If there is a span but neither reading nor certificate gives the pull.
    """
    spans = [span for span in obstructions if span.kind == "sag"]
    if not spans:
        return Sag()
    pull = pull_of(strap, tape)
    if pull is None:
        raise ValueError(f"free span of {strap.name!r}: expected the pull of its tape")
    at_pull = sum(
        span.count * sag_excess_m(span.span_m, tape.weight_n_per_m, pull) for span in spans
    )  # fmt: skip
    exponent = 2 * tape.friction * np.pi / strap.pulls
    more = _mean_exp(exponent)
    # Relative standard deviation of exp(2 m s) over s uniform in 0 to 1: sqrt(E[x^2] / E[x]^2 - 1).
    spread = np.sqrt(max(_mean_exp(2 * exponent) / more**2 - 1, 0.0))
    return Sag(at_pull * more, at_pull * exponent * _mean_exp_slope(exponent), float(spread))


def _mean_exp(x):
    """Mean of exp(x s) over s from 0 to 1."""
    return np.expm1(x) / x if x else 1.0


def _mean_exp_slope(x):
    """Derivative of `_mean_exp`: mean of s exp(x s) over s from 0 to 1."""
    # The closed form cancels near 0, so a series replaces it below 1e-3.
    return (np.exp(x) * (x - 1) + 1) / x**2 if x > 1e-3 else 0.5 + x / 3 + x**2 / 8
