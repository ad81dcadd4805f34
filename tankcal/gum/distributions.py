"""The named distributions of an input of a measurement, all of them symmetric about their mean.

Each has `name`, `mean`, `sd`, `u`, `dof`, `quantile(p)` and `characteristic(t)`; make one of what a
certificate says with `standard`, `within` or `expanded`.

    u    what the law of propagation uses, with the degrees of freedom `dof` (JCGM 100:2008 G.4)
    sd   the standard deviation of the distribution, which Monte Carlo draws from

Both are the same but for Student's t of which the scale is declared: its u is s/sqrt(n) of n
readings, not sqrt(dof/(dof - 2)) times as much, and u itself is unsure by its dof. Of a t that is
declared by its standard deviation, u is that: dof is its shape only, and u is not unsure, so
that `u_dof` is infinite. u is what was declared, always.
Source: JCGM 100:2008 4.2, 4.3, G.3, G.4; JCGM 101:2008 6.4.
"""

from dataclasses import dataclass, field, fields

import numpy as np
from scipy.special import (
    gammainc,
    gammaincinv,
    gammaln,
    j0,
    kve,
    ndtri,
    sici,
)

from tankcal.gum.coverage import coverage_factor, student_quantile
from tankcal.gum.inputs import Input


@dataclass(frozen=True)
class Distribution:
    """What all have: mean (unit of the input) and quantiles from those of the centred half.

    Attributes
    ----------
    dof : float
        Degrees of freedom of u in the law of propagation; how unsure u itself is (G.3). It changes
        no quantile, except Student's t, whose shape it is.
    """

    mean: float = field(default=0.0, kw_only=True)
    dof: float = field(default=np.inf, kw_only=True)

    def __post_init__(self):
        if not self.dof > 0:
            raise ValueError(f"degrees of freedom {self.dof}: expected a number above 0, or inf")
        for one in fields(self):
            value = getattr(self, one.name)
            if one.name != "dof" and not np.isfinite(value):
                raise ValueError(f"{one.name} {value}: expected a finite number")
            if one.name not in ("dof", "mean") and value < 0:
                raise ValueError(f"{one.name} {value}: expected 0 or more")

    @property
    def u(self):
        """Standard uncertainty for the law of propagation, in the unit of the input."""
        return self.sd

    @property
    def u_dof(self):
        """Degrees of freedom of u in the formula of Welch-Satterthwaite."""
        return self.dof

    def quantile(self, p):
        """Values below which the input lies with probability p, of any shape, each in [0, 1].

        Raises ValueError for a p outside of it.
        """
        p = np.asarray(p, dtype=float)
        if not np.all((p >= 0) & (p <= 1)):
            raise ValueError("a probability is outside 0 to 1")
        if not self._width:
            return np.full(p.shape, self.mean)[()]
        distance = self._distance(np.minimum(p, 1 - p))
        return (self.mean + np.where(p < 0.5, -distance, distance))[()]

    def characteristic(self, t):
        """E cos(t (X - mean)), of any shape of t: the characteristic function of X - mean."""
        t = np.abs(np.asarray(t, dtype=float)) * self._width
        near = t < 1e-9  # there it is 1 - (t sd)^2/2, equal to 1
        return np.where(near, 1.0, self._transform(np.where(near, 1.0, t)))[()]


@dataclass(frozen=True)
class Normal(Distribution):
    """Gaussian (JCGM 101 6.4.7).

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
    """Scaled and shifted t with `dof` degrees of freedom, finite (JCGM 101 6.4.9).

    Attributes
    ----------
    by_sd : bool
        Declared by its standard deviation: that is u then, and dof is the shape alone.
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
        """The scale, as JCGM 100 4.2.3 has it; the standard deviation where that was declared."""
        return self.sd if self.by_sd else self.scale

    @property
    def u_dof(self):
        """The dof; inf of a declared standard deviation, which is not an estimate."""
        return np.inf if self.by_sd else self.dof

    @property
    def sd(self):
        """scale sqrt(dof/(dof - 2)); inf for two degrees of freedom or fewer."""
        if self.dof <= 2:
            return np.inf if self.scale else 0.0
        return self.scale * np.sqrt(self.dof / (self.dof - 2))

    @property
    def _width(self):
        return self.scale

    def _distance(self, tail):
        return -self.scale * student_quantile(tail, self.dof)

    def _transform(self, t):
        half, root = self.dof / 2, np.sqrt(self.dof) * t
        if half > 25:  # where Bessel's function leaves the range of numbers
            return _bessel_of_large_order(half, root)
        power = half * np.log(root / 2) - root - gammaln(half)
        return 2 * np.exp(power) * kve(half, root)


@dataclass(frozen=True)
class _Bounded(Distribution):
    """Within mean +- half_width; sd is half_width / ratio."""

    half_width: float

    @property
    def sd(self):
        """Standard deviation, half_width over the square root of the family's ratio."""
        return self.half_width / np.sqrt(self.squared_ratio)

    @property
    def _width(self):
        return self.half_width


@dataclass(frozen=True)
class Rectangular(_Bounded):
    """Anywhere within mean +- half_width, equally likely (JCGM 101 6.4.2).

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
        return self.half_width * (1 - 2 * tail)

    def _transform(self, t):
        return np.sin(t) / t


@dataclass(frozen=True)
class Triangular(_Bounded):
    """Within mean +- half_width, most likely the mean (JCGM 101 6.4.5).

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
        return self.half_width * (1 - np.sqrt(2 * tail))

    def _transform(self, t):
        return (np.sin(t / 2) / (t / 2)) ** 2


@dataclass(frozen=True)
class UShaped(_Bounded):
    """Arc sine: a sine of unknown phase, mean +- half_width (JCGM 101 6.4.6).

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
        return self.half_width * np.cos(np.pi * tail)

    def _transform(self, t):
        return j0(t)


@dataclass(frozen=True)
class CurvilinearTrapezoid(Distribution):
    """Rectangular whose half-width w is itself known only to +- d (JCGM 101 6.4.3).

    sd = sqrt(w^2/3 + d^2/9);  density ln((w + d)/max(|x|, w - d))/(4 d) within |x| < w + d

    Attributes
    ----------
    middle_half_width : float
        w, (b - a)/2 there.
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
        """Standard deviation, with the inexactness of the limits in it."""
        return np.sqrt(self.middle_half_width**2 / 3 + self.inexactness**2 / 9)

    @property
    def half_width(self):
        """w + d, the outermost limit."""
        return self.middle_half_width + self.inexactness

    @property
    def _relative(self):
        """(inner limit, d), both by the outermost limit."""
        relative = self.inexactness / self.half_width
        return 1 - 2 * relative, relative

    @property
    def _width(self):
        return self.half_width

    def _distance(self, tail):
        inner, relative = self._relative
        plateau = -np.log1p(-2 * relative)
        flat = (0.5 - tail) * 4 * relative / plateau
        # beyond the inner limit tail = P(2, y)/(4 relative) with |x| = outermost exp(-y)
        within = np.minimum(4 * relative * tail, gammainc(2, plateau))
        return self.half_width * np.where(flat < inner, flat, np.exp(-gammaincinv(2, within)))

    def _transform(self, t):
        inner, relative = self._relative
        return (sici(t)[0] - sici(inner * t)[0]) / (2 * relative * t)


FAMILIES = {"rectangular": Rectangular, "triangular": Triangular, "u-shaped": UShaped}
NAMES = ("normal", *FAMILIES, "t", "curvilinear trapezoid")


def standard(u, name="normal", *, dof=np.inf, mean=0.0, u_is="scale"):
    """The distribution called `name` of standard uncertainty u, the unit of the input.

    Parameters
    ----------
    name : optional
        One of normal, rectangular, triangular, u-shaped, t. A normal with finite degrees of freedom
        is Student's t (JCGM 101 6.4.9.7): u was estimated from the readings.
    u_is : optional
        What u is of Student's t: its "scale", or its "sd" (more than two degrees of freedom).

    Raises
    ------
    ValueError
        For another name, a negative or non-finite u, dof not above 0.
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
        return StudentT(u * np.sqrt(1 - 2 / dof), mean=mean, dof=dof, by_sd=True)
    return StudentT(u, mean=mean, dof=dof)


def within(half_width, name="rectangular", *, mean=0.0, dof=np.inf, inexactness=0.0):
    """The distribution called `name` between mean - half_width and mean + half_width.

    Parameters
    ----------
    inexactness : optional
        Of a rectangular one: the half-width itself is known to +- this much only, which Monte Carlo
        sees; dof say the same to the law of propagation (JCGM 100 G.4.2).

    Raises
    ------
    ValueError
        For a name without limits, a negative or non-finite half-width.
    """
    if name not in FAMILIES:
        raise ValueError(f"distribution {name!r} has no limits: expected {', '.join(FAMILIES)}")
    if not inexactness:
        return FAMILIES[name](half_width, mean=mean, dof=dof)
    if name != "rectangular":
        raise ValueError(f"inexact limits of a {name} distribution: expected rectangular")
    return CurvilinearTrapezoid(half_width, inexactness, mean=mean, dof=dof)


def expanded(U, *, k=None, probability=None, dof=np.inf, mean=0.0):
    """The distribution behind an expanded uncertainty U: u = U/k (JCGM 100 4.3.3).

    Parameters
    ----------
    k : optional
        The coverage factor that the certificate states, or.
    probability : optional
        Its coverage probability: k of Student's t (JCGM 101 6.4.9.7).
    dof : optional
        Degrees of freedom that the certificate states; infinite gives a normal.

    Raises
    ------
    ValueError
        Unless exactly one of k and probability is given, k above 0.
    """
    if (k is None) == (probability is None):
        raise ValueError("an expanded uncertainty needs its k or its coverage probability")
    if k is None:
        if not dof > 0:
            raise ValueError(f"degrees of freedom {dof}: expected a number above 0, or inf")
        k = float(coverage_factor(probability, dof))
    if not 0 < k < np.inf:
        raise ValueError(f"coverage factor {k}: expected above 0")
    return standard(U / k, dof=dof, mean=mean)


def vector(name, estimates, u, unit="", *, dof=np.inf, type="A", note=""):
    """Inputs "name 1", "name 2", ... of one family: coordinates of points, say.

    Parameters
    ----------
    estimates, u : ndarray, shape (p,)
        In `unit`, normal, or t when dof is finite.
    """
    pairs = enumerate(zip(estimates, u, strict=True), 1)
    return [
        Input(f"{name} {i}", standard(s, dof=dof, mean=x), unit, type, family=name, note=note)
        for i, (x, s) in pairs
    ]


def _bessel_of_large_order(order, x):
    """2 (x/2)^order K_order(x) / Gamma(order), Debye's expansion (DLMF 10.41.4), 1 at x = 0."""
    squared = (x / order) ** 2
    s = np.sqrt(1 + squared)
    excess = squared / (1 + s)  # s - 1
    power = order * (np.log1p(excess / 2) - excess) - np.log(s) / 2
    return np.exp(power) * _debye(order, 1 / s) / _debye(order, 1.0)


def _debye(order, p):
    first = p * (3 - 5 * p**2) / 24
    second = p**2 * (81 - 462 * p**2 + 385 * p**4) / 1152
    third = p**3 * (30375 - 369603 * p**2 + 765765 * p**4 - 425425 * p**6) / 414720
    return 1 - first / order + second / order**2 - third / order**3
