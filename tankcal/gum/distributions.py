"""Distributions of the inputs of a measurement, and exactly of their linear combination.

The distributions of inputs are symmetric about their mean. Each has `name`, `mean`, `sd`, `u`,
`dof`, `quantile(p)` and `characteristic(t)`. `standard`, `within` and `expanded` create a
distribution from the statement of a certificate.

    u    standard uncertainty for the law of propagation, with degrees of freedom `dof` (JCGM
    100:2008 G.4)
    sd   standard deviation of the distribution, used by Monte Carlo

u is always the declared value. It equals sd, except for Student's t with a declared scale. The
scale is s/sqrt(n) for n readings, not sqrt(dof/(dof - 2)) times this value, and u has the degrees
of freedom `dof`. For Student's t with a declared standard deviation, `dof` is only the shape. u is
then not an estimate, and `u_dof` is infinite.

Linear combination
------------------

Y = sum c_i (X_i - mean_i) of independent inputs has the characteristic function
phi(t) = prod phi_i(c_i t). Within a period P that contains (almost) the whole distribution:

    P(Y < y) = 1/2 + y/P + sum_k phi(w k) sin(w k y)/(pi k),   w = 2 pi/P

The series is exact if no probability lies outside P. For Student's t, a probability of 1e-10 lies
outside. The result serves as a reference for the law of propagation and for Monte Carlo.

Source: JCGM 100:2008 4.2, 4.3, G.3, G.4; JCGM 101:2008 5.4.5, 6.4, 9.2; Abate & Whitt 1992,
Queueing Systems 10, 5.
"""

from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
import scipy
from scipy.special import (
    gammainc,
    gammaincinv,
    gammaln,
    j0,
    kve,
    ndtri,
    sici,
)

from tankcal.errors import SolutionError
from tankcal.gum.coverage import coverage_factor, student_quantile
from tankcal.gum.inputs import Input


@dataclass(frozen=True)
class Distribution:
    """Base class: mean, and quantiles from the distance of a quantile from the mean.

    Attributes
    ----------
    mean : float
        Mean, in the unit of the input.
    dof : float
        Degrees of freedom of u in the law of propagation, a measure of the uncertainty of u itself
        (G.3). They affect the quantiles of Student's t only, as its shape.
    """

    mean: float = field(default=0.0, kw_only=True)
    dof: float = field(default=np.inf, kw_only=True)

    def __post_init__(self):
        if not self.dof > 0:
            raise ValueError(f"degrees of freedom {self.dof}: expected a number above 0, or inf")
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name != "dof" and not np.isfinite(value):
                raise ValueError(f"{item.name} {value}: expected a finite number")
            if item.name not in ("dof", "mean") and value < 0:
                raise ValueError(f"{item.name} {value}: expected 0 or more")

    @property
    def u(self):
        """Standard uncertainty for the law of propagation, in the unit of the input."""
        return self.sd

    @property
    def u_dof(self):
        """Degrees of freedom of u in the Welch-Satterthwaite formula."""
        return self.dof

    def quantile(self, p):
        """Values with probability p below them.

        Parameters
        ----------
        p : array_like, shape (...,)
            Probabilities in [0, 1].

        Returns
        -------
        ndarray, shape (...,)
            In the unit of the input.

        Raises
        ------
        ValueError
            For a probability outside [0, 1].
        """
        p = np.asarray(p, dtype=float)
        if not np.all((p >= 0) & (p <= 1)):
            raise ValueError("a probability is outside 0 to 1")
        if not self._width:
            return np.full(p.shape, self.mean)[()]
        # By symmetry, the smaller tail determines the distance; it is more precise near p = 1.
        distance = self._distance(np.minimum(p, 1 - p))
        return (self.mean + np.where(p < 0.5, -distance, distance))[()]

    def characteristic(self, t):
        """Characteristic function of X - mean, E cos(t (X - mean)).

        Parameters
        ----------
        t : array_like, shape (...,)
            Argument, in the inverse unit of the input.

        Returns
        -------
        ndarray, shape (...,)
        """
        t = np.abs(np.asarray(t, dtype=float)) * self._width
        is_small = t < 1e-9  # phi = 1 - (t sd)^2/2 rounds to 1
        return np.where(is_small, 1.0, self._transform(np.where(is_small, 1.0, t)))[()]


@dataclass(frozen=True)
class Normal(Distribution):
    """Normal distribution (JCGM 101 6.4.7).

    Attributes
    ----------
    sd : float
        Standard deviation, in the unit of the input.

    Examples
    --------
    >>> round(float(Normal(2.0, mean=10.0).quantile(0.975)), 2)
    13.92
    """

    name = "normal"

    sd: float

    @property
    def _width(self):
        return self.sd

    def _distance(self, tail):
        return -self.sd * ndtri(tail)

    def _transform(self, t):
        return np.exp(-(t**2) / 2)


@dataclass(frozen=True)
class StudentT(Distribution):
    """Scaled and shifted t distribution with finite `dof` (JCGM 101 6.4.9).

    Attributes
    ----------
    scale : float
        Scale, in the unit of the input.
    by_sd : bool
        True if the standard deviation was declared. u is then the standard deviation, and `dof` is
        only the shape.
    """

    name = "t"

    scale: float
    by_sd: bool = field(default=False, kw_only=True)

    def __post_init__(self):
        super().__post_init__()
        if not np.isfinite(self.dof):
            raise ValueError("Student's t: expected finite degrees of freedom (else: normal)")

    @property
    def u(self):
        """Scale (JCGM 100 4.2.3), or the standard deviation if it was declared."""
        return self.sd if self.by_sd else self.scale

    @property
    def u_dof(self):
        """Degrees of freedom; inf for a declared standard deviation, which is no estimate."""
        return np.inf if self.by_sd else self.dof

    @property
    def sd(self):
        """Standard deviation, scale sqrt(dof/(dof - 2)); inf for at most two degrees of freedom."""
        if self.dof <= 2:
            return np.inf if self.scale else 0.0
        return self.scale * np.sqrt(self.dof / (self.dof - 2))

    @property
    def _width(self):
        return self.scale

    def _distance(self, tail):
        # student_quantile is negative for the lower tail.
        return -self.scale * student_quantile(tail, self.dof)

    def _transform(self, t):
        half, root = self.dof / 2, np.sqrt(self.dof) * t
        if half > 25:  # K_half overflows
            return _scaled_bessel(half, root)
        # phi(t) = (sqrt(dof) t)^half K_half(sqrt(dof) t) / (Gamma(half) 2^(half - 1)), with
        # logarithms to avoid overflow; kve contains exp(root).
        power = half * np.log(root / 2) - root - gammaln(half)
        return 2 * np.exp(power) * kve(half, root)


@dataclass(frozen=True)
class _Bounded(Distribution):
    """Distribution within mean +- half_width; sd is half_width / sqrt(squared_ratio)."""

    half_width: float

    @property
    def sd(self):
        """Standard deviation, half_width / sqrt(squared_ratio)."""
        return self.half_width / np.sqrt(self.squared_ratio)

    @property
    def _width(self):
        return self.half_width


@dataclass(frozen=True)
class Rectangular(_Bounded):
    """Rectangular distribution within mean +- half_width (JCGM 101 6.4.2).

    Attributes
    ----------
    half_width : float
        a, in the unit of the input: u = a / sqrt(3).

    Examples
    --------
    >>> round(float(Rectangular(3.0).u), 4)
    1.7321
    """

    name = "rectangular"

    squared_ratio = 3.0

    def _distance(self, tail):
        # Linear distribution function: tail = (1 - distance/a)/2.
        return self.half_width * (1 - 2 * tail)

    def _transform(self, t):
        return np.sin(t) / t


@dataclass(frozen=True)
class Triangular(_Bounded):
    """Triangular distribution within mean +- half_width (JCGM 101 6.4.5).

    Attributes
    ----------
    half_width : float
        a, in the unit of the input: u = a / sqrt(6).

    Examples
    --------
    >>> round(float(Triangular(3.0).u), 4)
    1.2247
    """

    name = "triangular"

    squared_ratio = 6.0

    def _distance(self, tail):
        # tail = (1 - distance/a)^2/2.
        return self.half_width * (1 - np.sqrt(2 * tail))

    def _transform(self, t):
        # Sum of two rectangular distributions of half the width.
        return (np.sin(t / 2) / (t / 2)) ** 2


@dataclass(frozen=True)
class UShaped(_Bounded):
    """U-shaped (arc sine) distribution within mean +- half_width (JCGM 101 6.4.6).

    It is the distribution of a sine with unknown phase.

    Attributes
    ----------
    half_width : float
        a, in the unit of the input: u = a / sqrt(2).

    Examples
    --------
    >>> round(float(UShaped(3.0).u), 4)
    2.1213
    """

    name = "u-shaped"

    squared_ratio = 2.0

    def _distance(self, tail):
        # Projection of a uniform phase.
        return self.half_width * np.cos(np.pi * tail)

    def _transform(self, t):
        # Bessel function of order 0 (integral over the phase).
        return j0(t)


@dataclass(frozen=True)
class CurvilinearTrapezoid(Distribution):
    """Rectangular distribution with an inexact half-width w +- d (JCGM 101 6.4.3).

        sd = sqrt(w^2/3 + d^2/9);  density ln((w + d)/max(|x|, w - d))/(4 d) within |x| < w + d

    Attributes
    ----------
    middle_half_width : float
        w, (b - a)/2 in JCGM 101.
    inexactness : float
        d, above 0 and below w.
    """

    name = "curvilinear trapezoid"

    middle_half_width: float
    inexactness: float

    def __post_init__(self):
        super().__post_init__()
        if not 0 < self.inexactness < self.middle_half_width:
            raise ValueError(
                f"limits of a half-width {self.middle_half_width} +- {self.inexactness}: expected"
                " 0 < inexactness < half-width"
            )

    @property
    def sd(self):
        """Standard deviation, including the inexactness of the limits."""
        return np.sqrt(self.middle_half_width**2 / 3 + self.inexactness**2 / 9)

    @property
    def half_width(self):
        """Outermost limit, w + d."""
        return self.middle_half_width + self.inexactness

    @property
    def _relative(self):
        """Inner limit and d, both divided by the outermost limit."""
        relative = self.inexactness / self.half_width
        return 1 - 2 * relative, relative

    @property
    def _width(self):
        return self.half_width

    def _distance(self, tail):
        inner, relative = self._relative
        # Within the inner limit, the density is constant.
        plateau = -np.log1p(-2 * relative)
        flat = (0.5 - tail) * 4 * relative / plateau
        # Beyond the inner limit: tail = P(2, y)/(4 relative), with |x| = outermost exp(-y).
        tail_area = np.minimum(4 * relative * tail, gammainc(2, plateau))
        return self.half_width * np.where(flat < inner, flat, np.exp(-gammaincinv(2, tail_area)))

    def _transform(self, t):
        # The sine integral is the transform of the logarithmic density.
        inner, relative = self._relative
        return (sici(t)[0] - sici(inner * t)[0]) / (2 * relative * t)


FAMILIES = {"rectangular": Rectangular, "triangular": Triangular, "u-shaped": UShaped}
NAMES = ("normal", *FAMILIES, "t", "curvilinear trapezoid")


def standard(u, name="normal", *, dof=np.inf, mean=0.0, u_is="scale"):
    """Distribution with a given name and standard uncertainty.

    Parameters
    ----------
    u : float
        Standard uncertainty, in the unit of the input.
    name : str, optional
        normal, rectangular, triangular, u-shaped or t. A normal distribution with finite degrees of
        freedom becomes Student's t (JCGM 101 6.4.9.7), because u was estimated from readings.
    dof : float, optional
        Degrees of freedom of u.
    mean : float, optional
        Estimate of the input.
    u_is : str, optional
        Meaning of u for Student's t: "scale", or "sd" (more than two degrees of freedom).

    Returns
    -------
    Distribution

    Raises
    ------
    ValueError
        For an unknown name, a negative or non-finite u, or dof not above 0.

    Examples
    --------
    >>> standard(0.5, "rectangular").half_width.round(4)
    np.float64(0.866)
    """
    if u_is not in ("scale", "sd"):
        raise ValueError(f"u is its {u_is!r}: expected 'scale' or 'sd'")
    if name in FAMILIES:
        family = FAMILIES[name]
        return family(u * np.sqrt(family.squared_ratio), mean=mean, dof=dof)
    if name == "normal" and np.isinf(dof) and dof > 0:
        return Normal(u, mean=mean)
    if name not in ("normal", "t"):
        raise ValueError(f"distribution {name!r}: expected one of {', '.join(NAMES[:-1])}")
    if u_is == "sd" and not dof > 2:
        raise ValueError(f"Student's t with {dof} degrees of freedom has no standard deviation")
    if u_is == "sd":
        # scale = sd sqrt((dof - 2)/dof).
        return StudentT(u * np.sqrt(1 - 2 / dof), mean=mean, dof=dof, by_sd=True)
    return StudentT(u, mean=mean, dof=dof)


def within(half_width, name="rectangular", *, mean=0.0, dof=np.inf, inexactness=0.0):
    """Distribution between mean - half_width and mean + half_width.

    Parameters
    ----------
    half_width : float
        Half-width, in the unit of the input.
    name : str, optional
        rectangular, triangular or u-shaped.
    mean : float, optional
        Estimate of the input.
    dof : float, optional
        Degrees of freedom of u.
    inexactness : float, optional
        Largest error of the half-width of a rectangular distribution, which only Monte Carlo
        considers. For the law of propagation, `dof` has the equivalent meaning (JCGM 100 G.4.2).

    Returns
    -------
    Distribution

    Raises
    ------
    ValueError
        For a name without limits, or a negative or non-finite half-width.

    Examples
    --------
    >>> round(float(within(0.3).u), 4)
    0.1732
    """
    if name not in FAMILIES:
        raise ValueError(f"distribution {name!r} has no limits: expected {', '.join(FAMILIES)}")
    if not inexactness:
        return FAMILIES[name](half_width, mean=mean, dof=dof)
    if name != "rectangular":
        raise ValueError(f"inexact limits of a {name} distribution: expected rectangular")
    return CurvilinearTrapezoid(half_width, inexactness, mean=mean, dof=dof)


def expanded(U, *, k=None, probability=None, dof=np.inf, mean=0.0):
    """Distribution behind an expanded uncertainty U, with u = U/k (JCGM 100 4.3.3).

    Parameters
    ----------
    U : float
        Expanded uncertainty, in the unit of the input.
    k : float, optional
        Coverage factor stated by the certificate.
    probability : float, optional
        Coverage probability, instead of k; k then follows from Student's t (JCGM 101 6.4.9.7).
    dof : float, optional
        Degrees of freedom stated by the certificate; infinite for a normal distribution.
    mean : float, optional
        Estimate of the input.

    Returns
    -------
    Distribution

    Raises
    ------
    ValueError
        Unless exactly one of k and probability is given, with k above 0.

    Examples
    --------
    >>> expanded(0.2, k=2.0).u
    0.1
    """
    if (k is None) == (probability is None):
        raise ValueError("an expanded uncertainty needs its k or its coverage probability")
    if k is None:
        if not dof > 0:
            raise ValueError(f"degrees of freedom {dof}: expected a number above 0, or inf")
        k = float(coverage_factor(probability, dof))
    if not 0 < k < np.inf:
        raise ValueError(f"coverage factor {k}: expected above 0")
    # JCGM 100 4.3.3: the standard uncertainty is U/k.
    return standard(U / k, dof=dof, mean=mean)


def vector(name, estimates, u, unit="", *, dof=np.inf, type="A", note=""):
    """Inputs "name 1", "name 2", ... of one family, such as the coordinates of points.

    Parameters
    ----------
    name : str
        Name of the family.
    estimates, u : array_like, shape (p,)
        Estimates and standard uncertainties in `unit`; normal, or t for finite dof.
    unit : str, optional
        Unit.
    dof : float, optional
        Degrees of freedom of each u.
    type : str, optional
        Type of evaluation, "A" or "B".
    note : str, optional
        Note for the budget.

    Returns
    -------
    list of Input
    """
    pairs = enumerate(zip(estimates, u, strict=True), 1)
    return [
        Input(f"{name} {i}", standard(s, dof=dof, mean=x), unit, type, family=name, note=note)
        for i, (x, s) in pairs
    ]


def _scaled_bessel(order, x):
    """2 (x/2)^order K_order(x) / Gamma(order) by Debye's expansion; 1 at x = 0.

    Source: DLMF 10.41.4.
    """
    squared = (x / order) ** 2
    s = np.sqrt(1 + squared)
    # s - 1 without cancellation.
    excess = squared / (1 + s)
    power = order * (np.log1p(excess / 2) - excess) - np.log(s) / 2
    # The quotient of the two expansions replaces the Gamma function.
    return np.exp(power) * _debye(order, 1 / s) / _debye(order, 1.0)


def _debye(order, p):
    """Debye's expansion in 1/order, up to the third term."""
    first = p * (3 - 5 * p**2) / 24
    second = p**2 * (81 - 462 * p**2 + 385 * p**4) / 1152
    third = p**3 * (30375 - 369603 * p**2 + 765765 * p**4 - 425425 * p**6) / 414720
    return 1 - first / order + second / order**2 - third / order**3


_OUTSIDE = 1e-10  # largest probability outside the period
_MOST_TERMS = 2**21  # largest number of terms of the series
_SMALL = 1e-12  # term of the series below which the remainder is neglected


class Combination:
    """Linear combination of independent inputs.

    Parameters
    ----------
    distributions : sequence of Distribution, length n
        Distributions of the inputs, of tankcal.gum.distributions.
    coefficients : array_like, shape (n,), optional
        Coefficients; None: all one.

    Attributes
    ----------
    mean, sd : float
        Mean and standard deviation.

    Raises
    ------
    ValueError
        If all inputs are constant.

    Examples
    --------
    The sum of two rectangular inputs is triangular:

    >>> from tankcal.gum import within
    >>> total = Combination([within(1.0), within(1.0)])
    >>> round(total.cdf(1.0), 6)
    0.875
    """

    def __init__(self, distributions, coefficients=None):
        self.distributions = tuple(distributions)
        ones = np.ones(len(self.distributions))
        self.coefficients = ones if coefficients is None else np.asarray(coefficients, dtype=float)
        pairs = list(zip(self.coefficients, self.distributions, strict=True))
        self.mean = float(sum(c * distribution.mean for c, distribution in pairs))
        self.sd = float(np.sqrt(sum((c * distribution.sd) ** 2 for c, distribution in pairs)))
        self._pairs = [(c, distribution) for c, distribution in pairs if c and distribution.u]
        if not self._pairs:
            raise ValueError("a combination of constants has no distribution")

    def cdf(self, y):
        """Probability of a value below y (float)."""
        y = float(y) - self.mean
        if abs(y) >= self._reach:
            return float(y > 0)
        # w k y, with the period P twice the reach.
        angles = 2 * np.pi / (2 * self._reach) * y * np.arange(1, len(self._terms) + 1)
        return float(0.5 + y / (2 * self._reach) + self._terms @ np.sin(angles))

    def quantile(self, p):
        """Value with probability p below it.

        Parameters
        ----------
        p : float
            Probability, 1e-9 to 1 - 1e-9.

        Returns
        -------
        float

        Raises
        ------
        ValueError
            For a probability outside this range.
        """
        if not 1e-9 < p < 1 - 1e-9:
            raise ValueError(f"probability {p}: expected between 1e-9 and 1 - 1e-9")
        ends = self.mean - self._reach, self.mean + self._reach
        return scipy.optimize.brentq(
            lambda y: self.cdf(y) - p, *ends, xtol=1e-13 * self._reach, rtol=1e-14
        )

    def half_width(self, probability):
        """Half-width of the symmetric interval with a given coverage probability.

        The interval about the mean is also the shortest interval.
        """
        return self.quantile((1 + probability) / 2) - self.mean

    @cached_property
    def _reach(self):
        """Half the period: at most a probability of 1e-10 lies farther from the mean."""
        # Bounded inputs have an exact reach; otherwise quantiles share the probability outside.
        farthest = [
            abs(c) * (distribution.quantile(1.0) - distribution.mean)
            for c, distribution in self._pairs
        ]
        if not np.all(np.isfinite(farthest)):
            probability = 1 - _OUTSIDE / len(self._pairs)
            farthest = [
                abs(c) * (distribution.quantile(probability) - distribution.mean)
                for c, distribution in self._pairs
            ]
        return float(np.sum(farthest))

    @cached_property
    def _terms(self):
        """Terms phi(w k)/(pi k) of the series; raises SolutionError if they decrease too slowly."""
        count = 2**10
        while count <= _MOST_TERMS:
            k = np.arange(1, count + 1)
            terms = 1 / (np.pi * k)
            for c, distribution in self._pairs:
                terms = terms * distribution.characteristic(c * np.pi / self._reach * k)
            # The last quarter represents the neglected terms, because single terms may vanish by
            # chance.
            if np.abs(terms[-count // 4 :]).max() < _SMALL:
                return terms
            count *= 4
        raise SolutionError("the distribution of this combination has too sharp edges or tails")
