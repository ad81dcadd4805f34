"""What the pull of a tape does: it stretches the tape, and keeps it from hanging where it is free.

    mean tension = pull (1 - exp(-m)) / m,   m = mu w, w half the angle that one pull wraps
    strain = (mean tension - F_cert) / (A E)
    sag of a free span = w^2 L^3 / (24 F^2),   w the weight of a metre, F the tension there

Friction takes from the pull on the way round. Nobody says how far from its ends a span is: all
places are as likely, so 1 / F^2 is the mean of exp(2 m s) / pull^2 over s from 0 to 1, and is
unsure by the standard deviation of that.

Source: ISO 7507-1:2003; API MPMS 2.2A (methods); the sag is the first term of the catenary's.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sag:
    """By how much free spans make a reading too long.

    Attributes
    ----------
    excess_m : float
    by_friction_m : float
        Its derivative by the relative coefficient of friction, m.
    place_share : float
        Relative standard deviation by the places of the spans in their pull; 0 without friction.
    """

    excess_m: float = 0.0
    by_friction_m: float = 0.0
    place_share: float = 0.0


def mean_tension_n(pull_n, friction, pulls):
    """Mean tension round a tank of a tape pulled at both ends, in some pulls.

    pull (1 - exp(-mu w)) / (mu w), w half the angle that one pull wraps.

    Examples
    --------
    >>> [round(float(mean_tension_n(1.0, mu, 1)), 3) for mu in (0.1, 0.3)]
    [0.858, 0.648]
    """
    lost = friction * np.pi / pulls
    return pull_n * (-np.expm1(-lost) / lost if lost else 1.0)


def pull_of(strap, tape):
    """Pull of a reading, N: its own, or that of the certificate; None: nobody says."""
    return tape.tension_n if strap.tension_n is None else strap.tension_n


def strain_of(strap, tape):
    """Strain over that of the certificate, and its derivatives by relative pull and friction.

    Parameters
    ----------
    strap : Strap
    tape : Tape
    """
    pull = pull_of(strap, tape)
    if pull is None or not np.isfinite(tape.stiffness_n):
        return 0.0, 0.0, 0.0
    mean = mean_tension_n(pull, tape.friction, strap.pulls)
    lost = tape.friction * np.pi / strap.pulls
    by_friction = (pull * np.exp(-lost) - mean) / tape.stiffness_n if lost else 0.0
    return (mean - (tape.tension_n or 0.0)) / tape.stiffness_n, mean / tape.stiffness_n, by_friction


def sag_excess_m(span_m, weight_n_per_m, tension_n):
    """By how much a tape that hangs free over a span is longer than the span, m.

    w^2 L^3 / (24 F^2), of a tape whose ends are level; what is left out is (w L / F)^2 / 80 of it.

    Examples
    --------
    >>> [round(1000 * sag_excess_m(span, 0.2, 50.0), 3) for span in (5, 10, 20)]
    [0.083, 0.667, 5.333]
    """
    return weight_n_per_m**2 * span_m**3 / (24 * tension_n**2)


def sag_of(strap, tape, obstructions):
    """`Sag` of the free spans among the obstructions of a reading.

    Parameters
    ----------
    strap : Strap
        Its pull, or that of the certificate, must be known where there is a span.
    tape : Tape
    obstructions : iterable of Obstruction
        Those of other kinds are left alone.
    """
    spans = [one for one in obstructions if one.kind == "sag"]
    if not spans:
        return Sag()
    pull = pull_of(strap, tape)
    if pull is None:
        raise ValueError(f"free span of {strap.name!r}: expected the pull of its tape")
    at_pull = sum(
        one.count * sag_excess_m(one.span_m, tape.weight_n_per_m, pull) for one in spans
    )  # fmt: skip
    lost = 2 * tape.friction * np.pi / strap.pulls
    more = _mean_exp(lost)
    spread = np.sqrt(max(_mean_exp(2 * lost) / more**2 - 1, 0.0))
    return Sag(at_pull * more, at_pull * lost * _mean_exp_slope(lost), float(spread))


def _mean_exp(x):
    """Mean of exp(x s) over s from 0 to 1."""
    return np.expm1(x) / x if x else 1.0


def _mean_exp_slope(x):
    """Its derivative: mean of s exp(x s)."""
    return (np.exp(x) * (x - 1) + 1) / x**2 if x > 1e-3 else 0.5 + x / 3 + x**2 / 8
