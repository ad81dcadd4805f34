"""Prior knowledge of walls: components of the departure from a cylinder, and their amplitudes.

The radius of a wall at azimuth a and height zeta of a course (-1 at its bottom, +1 at its top) is

    r = rho + x sin a + y cos a + sum over components of f(a, zeta),

with rho free for each course, and x and y free for each ring of points. A component is a random
field of covariance

    variance * c(a - a') * h(zeta, zeta'),  c(0) = 1,  the mean of h(zeta, zeta) over a course = 1,

so that its amplitude, the root of its variance, is its rms departure. A component is either common
to all courses or independent in each course. The survey determines the amplitudes in part. Their
prior is a normal distribution of the logarithm of the variance, with the median from `median_m` and
the standard deviation `log_sd`. The logarithms of the components are correlated: a shell that is
rough in one component is more likely rough in another (`log_covariance`).

Settlement is the exception: its h depends on the height t above the foot of the whole shell (0 to
1). A foundation that settles unevenly by u cos k a bends an open shell without stretching it. The
radius then changes by

    k^2 z / R * u cos k a,

which grows in proportion to the height z, so h(t, t') = 3 t t', of mean 1 over the shell. The
amplitudes u of a foundation decrease with k and the factor k^2 increases, so the low modes have
equal variances. The stiffness of the shell in bending limits short waves. Their variances decrease
as 1 / (1 + (k / 6)^4) up to mode 12. A spectrum that ends at mode 6 assigned a higher mode to other
components, and its extrapolation into a gap of the points was wrong by more than 2 U. The absence
of stretching follows from w_k = k v_k and v_k' = k u_k / R of the radial, circumferential and
vertical displacements w, v, u of mode k.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.geometry.outlines import multiples
from tankcal.units import FULL_TURN

OVALITY_MODES = np.arange(2.0, 37.0)
OVALITY_WEIGHTS = OVALITY_MODES**-3 / np.sum(OVALITY_MODES**-3)
SEAM_LENGTH_M = 0.4  # length of the flank of a seam along the arc
WELD_LENGTH_M = 0.2  # length of the flank of a peak at a weld, whose total width is 0.8 m
SETTLEMENT_MODES = np.arange(2.0, 13.0)
SETTLEMENT_FALL = 1 / (1 + (SETTLEMENT_MODES / 6) ** 4)  # a foundation bends little in short waves
SETTLEMENT_WEIGHTS = SETTLEMENT_FALL / np.sum(SETTLEMENT_FALL)
JOINT_LENGTHS = (0.1, 0.25)  # decay lengths of drawn-in joints, in halves of a course
LOCAL_LENGTH = 0.5  # correlation length of dents in height, in halves of a course
BELL, BELL_SD = 1.0, 0.4  # profile of a plate: 0 for a parabola, 1 for clamped joints; and its sd
WORKMANSHIP = 0.05  # correlation of the log variances of any two components of a shell
SHRINKAGE = 0.09  # additional correlation of two components due to welds: joints and seams

_LEVEL = (1,)
KINDS = ("bulge", "ovality", "seams")
ROUND_SHAPES = ("oval", "settled", "seam")  # shapes with waves along the perimeter
LARGEST_QUOTIENT = 110.0  # largest b for which exp(2 pi b) does not overflow
PIECE = 1 << 14  # correlations in one array operation
NOT_AROUND = 15.0  # b above which the correlation over half a turn is rounding, exp(-15 pi)


@dataclass(frozen=True)
class Heights:
    """Heights of n places on a shell.

    Attributes
    ----------
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    up : ndarray, shape (n,)
        Height above the foot of the shell, as a fraction of the height of the shell, 0 to 1.
    """

    zeta: np.ndarray
    up: np.ndarray

    def __getitem__(self, chosen):
        return Heights(self.zeta[chosen], self.up[chosen])

    @classmethod
    def within(cls, span, zeta):
        """Return `Heights` for zeta (n,) in courses with bottoms and tops (2,) or (n, 2)."""
        bottom, top = np.transpose(span)
        return cls(zeta, bottom + (np.asarray(zeta) + 1) / 2 * (top - bottom))


@dataclass(frozen=True)
class Component:
    """Component of the departure of a wall from a cylinder.

    Attributes
    ----------
    name : str
    kind : str
        Name in an uncertainty budget.
    shape : str
        Form along the azimuth: "mean" (constant: the mean radius), "oval" (mode k of variance k^-3,
        from 2 on), "settled" (SETTLEMENT_MODES), "seam" (the spectrum (1 + (k SEAM_LENGTH_M /
        R)^2)^-2 from mode 2 on, cusps) or "weld" (a narrow seam at each vertical weld of known
        azimuth; its amplitude is that of the peak).
    common : bool
        Whether the component is common to all courses.
    orders : tuple of float, str
        Form over the height. A tuple contains variances of the Legendre polynomials 0, 1, ..., up
        to a factor. "plate": the profiles of `plate_profiles`; "joints": the profiles of
        `joint_profiles`; "local": the covariance exp(-|zeta - zeta'| / LOCAL_LENGTH); "growing":
        proportional to the height above the foot of the shell.
    median_m, log_sd : float
        Median of the amplitude, m, and standard deviation of the logarithm of the variance.
    declared_as : str
        Input of an uncertainty budget that replaces the component, if declared.
    """

    name: str
    kind: str
    shape: str
    common: bool
    orders: tuple | str
    median_m: float
    log_sd: float
    declared_as: str = ""

    def height_columns(self, heights):
        """Return columns (n, r) A with A A' = h at `Heights`; undefined for local components."""
        if self.orders == "growing":
            return np.sqrt(3.0) * heights.up[:, None]
        if self.orders == "joints":
            return joint_profiles(heights.zeta)
        if self.orders == "plate":
            return plate_profiles(heights.zeta)
        orders_used, scale = self._scales
        return legendre(heights.zeta, orders_used[-1])[:, orders_used] * scale

    @cached_property
    def _scales(self):
        """Return the orders with non-zero variance and the roots of their variances."""
        weights = np.array(self.orders, dtype=float)
        # The mean square of the Legendre polynomial n over a course is 1 / (2 n + 1).
        weights = weights / np.sum(weights / (2 * np.arange(len(weights)) + 1))
        nonzero = np.flatnonzero(weights)
        return nonzero, np.sqrt(weights[nonzero])

    def columns(self, waves, heights):
        """Return columns (n, k) A with A A' = covariance, for the shapes mean, oval and settled.

        waves  {shape: (n, 2 modes)} of `wave_columns`
        """
        profiles = self.height_columns(heights)
        if self.shape == "mean":
            return profiles
        # A product of covariances has the products of all pairs of columns.
        return (waves[self.shape][:, :, None] * profiles[:, None]).reshape(len(profiles), -1)

    @property
    def is_level(self):
        """Whether the component is constant over the height of a course."""
        return self.orders == _LEVEL

    def height_covariance(self, heights, other):
        """Return h (n, m) between `Heights` (n,) and (m,)."""
        if self.orders == "local":
            return _dent_covariance(np.subtract.outer(heights.zeta, other.zeta))
        return self.height_columns(heights) @ self.height_columns(other).T

    def height_between(self, heights, other):
        """Return h (n,) between each of the `Heights` (n,) and its partner in `other` (n,)."""
        if self.orders == "local":
            return _dent_covariance(heights.zeta - other.zeta)
        return np.sum(self.height_columns(heights) * self.height_columns(other), axis=1)


_FREE = (0, 0, *(order**-2.0 for order in range(2, 7)))
_LINEAR = (0, 1)
# Median rms in metres and standard deviation of ln(variance). Pages print exp(log_sd / 2), the
# factor of the rms. The sizes were varied until walls of one draw held and the rings of the real
# shell agreed with all of its points: docs/studies/wall-model.md. The
# other draws of tests/pipeline/test_coverage_of_walls.py judge them.
COMPONENTS = (
    Component("common bulge", "bulge", "mean", True, "plate", 1.05e-3, 1.0, "barrel"),
    Component("drawn-in joints", "bulge", "mean", True, "joints", 0.85e-3, 1.0, "barrel"),
    Component("own bulge", "bulge", "mean", False, _FREE, 0.62e-3, 1.0, "barrel"),
    Component("common taper", "bulge", "mean", True, _LINEAR, 0.2e-3, 2.0, "taper"),
    Component("own taper", "bulge", "mean", False, _LINEAR, 0.45e-3, 1.5, "taper"),
    Component("common ovality", "ovality", "oval", True, _LEVEL, 4e-3, 2.0),
    Component("own ovality", "ovality", "oval", False, _LEVEL, 2e-3, 2.0),
    Component("turning ovality", "ovality", "oval", False, _LINEAR, 1e-3, 2.0),
    Component("common seams", "seams", "seam", True, _LEVEL, 2.5e-3, 1.2),
    Component("own seams", "seams", "seam", False, _LEVEL, 2e-3, 1.2),
    Component("dents", "seams", "seam", False, "local", 2e-3, 1.2),
    Component("peaking", "seams", "weld", True, _LEVEL, 3e-3, 1.2),
    Component("own peaks", "seams", "weld", False, _LEVEL, 2e-3, 1.2),
    Component("settlement", "ovality", "settled", True, "growing", 1.5e-3, 2.0),
)


def log_covariance(smoothed=False):
    """Return the prior covariance (components, components) of the logarithms of the variances.

    Poor rolling and fitting of plates makes a shell rough in all components. Weld shrinkage causes
    both peaking at vertical welds and banding at girth welds. Settlement is due to the foundation
    and independent of the plates.

    With `smoothed`, the logarithms are independent. Limb measurements, which bridge the valleys of
    a wall, and set-ups tied only by the wall show every wall smoother than it is. In such surveys,
    the size of a component carries no information on another component.
    """
    log_sd = np.array([component.log_sd for component in COMPONENTS])
    if smoothed:
        return np.diag(log_sd**2)
    welded = np.array(
        [component.kind == "seams" or component.orders == "joints" for component in COMPONENTS]
    )
    plate_related = np.array([component.shape != "settled" for component in COMPONENTS])
    correlation = np.outer(plate_related, plate_related) * (
        WORKMANSHIP + SHRINKAGE * np.outer(welded, welded)
    )
    np.fill_diagonal(correlation, 1.0)
    return correlation * np.outer(log_sd, log_sd)


def _dent_covariance(difference):
    """Return h of a dent for a difference of heights."""
    return np.exp(-np.abs(difference) / LOCAL_LENGTH)


def legendre(zeta, highest):
    """Return Legendre polynomials (n, highest + 1) of orders 0 to highest."""
    zeta = np.asarray(zeta, dtype=float)
    polynomials = np.ones((len(zeta), highest + 1))
    polynomials[:, 1:2] = zeta[:, None]
    for n in range(2, highest + 1):
        # Bonnet's recursion: n P_n = (2 n - 1) x P_(n-1) - (n - 1) P_(n-2).
        polynomials[:, n] = (2 - 1 / n) * zeta * polynomials[:, n - 1] - (1 - 1 / n) * polynomials[
            :, n - 2
        ]
    return polynomials


def plate_profiles(zeta):
    """Return columns (n, 2) A with A A' = h of a plate that bulges between its joints.

    A plate with freely rotating joints is nearly a parabola, p = 1 - zeta^2; a plate with clamped
    joints is b = (1 - zeta^2)^2. The bulge is p + t (b - p), with t distributed about BELL with the
    standard deviation BELL_SD. Without their means over the course, p = -2/3 P2 and b = -16/21 P2 +
    8/35 P4.
    """
    hinged, clamped = np.array([-2 / 3, 0.0]), np.array([-16 / 21, 8 / 35])  # of P2 and P4
    shapes = np.array([hinged + BELL * (clamped - hinged), BELL_SD * (clamped - hinged)])
    # Scale to a mean h of one: the mean squares of P2 and P4 are 1/5 and 1/9.
    shapes /= np.sqrt(np.sum(shapes**2 @ [1 / 5, 1 / 9]))
    return legendre(zeta, 4)[:, [2, 4]] @ shapes.T


def joint_profiles(zeta):
    """Return columns (n, 2) A with A A' = h of a plate that is drawn in near its joints.

    Each column is exp(-(1 - |zeta|) / w) less its mean, scaled to a mean square of one half, with w
    from JOINT_LENGTHS. The deformation due to a girth weld decays over about sqrt(R t) / 1.3 for a
    plate of thickness t (the edge effect of a cylinder): 0.1 m for a small tank, 0.3 m for a large
    tank.

    Source: Timoshenko & Woinowsky-Krieger 1959, section 114.
    """
    w = np.array(JOINT_LENGTHS)
    # Mean and variance over the course of exp(-s / w), s from 0 to 1.
    mean = w * (1 - np.exp(-1 / w))
    square = w / 2 * (1 - np.exp(-2 / w)) - mean**2
    from_joint = (1 - np.abs(np.asarray(zeta, dtype=float)))[:, None]
    return (np.exp(-from_joint / w) - mean) / np.sqrt(len(w) * square)


def wave_columns(azimuth_rad):
    """Return {"oval", "settled": columns (n, 2 modes) A with A A' = c}.

    Mode k has the variance k^-3 for k = 2..36 ("oval"), or SETTLEMENT_WEIGHTS ("settled"). The
    azimuth nan denotes the mean of a full turn, to which no mode contributes.
    """
    cosines, sines = multiples(azimuth_rad, int(OVALITY_MODES[-1]))
    columns = {}
    for shape, weights in (("oval", OVALITY_WEIGHTS), ("settled", SETTLEMENT_WEIGHTS)):
        modes = slice(1, 1 + len(weights))  # from k = 2 on
        waves = np.hstack([cosines[:, modes], sines[:, modes]]) * np.tile(np.sqrt(weights), 2)
        waves[~np.isfinite(azimuth_rad)] = 0.0
        columns[shape] = waves
    return columns


def seam_correlation(difference_rad, radius_m, length_m=SEAM_LENGTH_M):
    """Return c for azimuth differences: sum over k >= 2 of (1 + (k/k0)^2)^-2, over its value at 0.

    k0 = R / length_m. All modes are summed in closed form::

        sum over all k of exp(i k x) / (k^2 + b^2)^2
            = pi / (2 b^2) (C / b - (pi - x) S + pi C coth(pi b)),  0 <= x <= pi,
        C = cosh(b (pi - x)) / sinh(pi b),  S = sinh(b (pi - x)) / sinh(pi b),

    and modes 0 and 1 are subtracted.

    Parameters
    ----------
    difference_rad : array_like
        Azimuth differences, rad.
    radius_m : float
        Radius of the wall, m.
    length_m : float
        Length of the flank of a seam along the arc, m.

    Returns
    -------
    ndarray
        Same shape as `difference_rad`.
    """
    b = radius_m / length_m
    x = np.asarray(difference_rad, dtype=float)
    # Mode 0 contributes b^-4, modes +1 and -1 together 2 cos x / (1 + b^2)^2.
    total = _all_modes(x, b) - b**-4 - 2 * np.cos(x) / (1 + b**2) ** 2
    return total / _seam_sum(b)


def _correlate_seams(azimuth_rad, other_rad, radius_m):
    """Return `seam_correlation` (n, m) between azimuths, in blocks that fit the processor cache.

    exp(-b x) is a quotient of exp(b a), so only one exponential for each azimuth is required. For
    azimuths with themselves, half of the matrix is computed and mirrored.
    """
    b = radius_m / SEAM_LENGTH_M
    first, second = azimuth_rad % FULL_TURN - np.pi, other_rad % FULL_TURN - np.pi
    if b > LARGEST_QUOTIENT:
        return seam_correlation(np.subtract.outer(first, second), radius_m)
    turn, at_once = np.exp(-b * FULL_TURN), max(1, PIECE // max(len(second), 1))
    scale, near_by, far_by = _mode_terms(b, turn)
    scale /= _seam_sum(b)
    grows, falls = np.exp(b * second), np.exp(-b * second)
    # Modes 0 and 1 as products of columns: cos(a - a') = cos a cos a' + sin a sin a'.
    low_modes = [np.stack([np.ones(len(a)), np.cos(a), np.sin(a)], axis=1) for a in (first, second)]
    low_modes[0] *= np.array([b**-4, *2 * [2 / (1 + b**2) ** 2]]) / _seam_sum(b)
    correlations, mirrored = np.empty((len(first), len(second))), azimuth_rad is other_rad
    for start in range(0, len(first), at_once):
        rows, columns = slice(start, start + at_once), slice(start if mirrored else 0, None)
        azimuths = first[rows]
        x = np.abs(np.subtract.outer(azimuths, second[columns]))
        np.minimum(x, FULL_TURN - x, out=x)
        quotient = np.multiply.outer(np.exp(b * azimuths), falls[columns])
        inverse_quotient = np.multiply.outer(np.exp(-b * azimuths), grows[columns])
        # The smaller of exp(+-b (a - a')) is the direct way; the other way round has the factor
        # exp(-2 pi b).
        direct, indirect = (
            np.minimum(quotient, inverse_quotient),
            np.maximum(quotient, inverse_quotient, out=quotient),
        )
        indirect *= turn
        np.maximum(direct, indirect, out=direct)
        if b < NOT_AROUND:
            far_term = turn / direct
            far_term *= far_by - x
        else:
            far_term = 0.0
        x += near_by
        direct *= x
        direct += far_term
        direct *= scale
        np.subtract(
            direct, low_modes[0][rows] @ low_modes[1][columns].T, out=correlations[rows, columns]
        )
        if mirrored:
            correlations[columns, rows] = correlations[rows, columns].T
    return correlations


def weld_columns(azimuth_rad, welds_rad, radius_m):
    """Return peaks (n, w) of height one and flank length WELD_LENGTH_M at the welds.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        nan, the mean of a full turn, gives 0.
    welds_rad : ndarray, shape (w,)
    radius_m : float
        Radius of the wall, m.

    Returns
    -------
    ndarray, shape (n, w)
        c(a - weld).
    """
    differences = np.subtract.outer(azimuth_rad, welds_rad)
    return np.nan_to_num(seam_correlation(differences, radius_m, WELD_LENGTH_M))


def mode_shares(modes, radius_m):
    """Return {"oval", "settled", "seam": variances (k,) of cosine and sine of each mode}.

    The variances of all modes of a shape sum to one.
    """
    b = radius_m / SEAM_LENGTH_M
    return {
        "oval": np.where(modes <= OVALITY_MODES[-1], modes**-3 / np.sum(OVALITY_MODES**-3), 0.0),
        "settled": np.interp(modes, SETTLEMENT_MODES, SETTLEMENT_WEIGHTS, right=0.0),
        "seam": 2 / (modes**2 + b**2) ** 2 / _seam_sum(b),
    }


def _seam_sum(b):
    """Return the sum over |k| >= 2 of (k^2 + b^2)^-2."""
    return _all_modes(np.zeros(1), b)[0] - b**-4 - 2 / (1 + b**2) ** 2


def _all_modes(x, b):
    """Return the sum over all k of exp(i k x) / (k^2 + b^2)^2 (see `seam_correlation`)."""
    x = np.abs(x)
    if np.max(x, initial=0.0) > FULL_TURN:
        x = x % FULL_TURN
    x = np.minimum(x, FULL_TURN - x)
    turn = np.exp(-b * FULL_TURN)
    scale, near_by, far_by = _mode_terms(b, turn)
    near_term = np.exp(-b * x)
    total = near_term * (near_by + x)
    if b < NOT_AROUND:  # otherwise the term of the other way round is rounding
        far_term = turn / near_term
        total += far_term * (far_by - x)
    return scale * total


def _mode_terms(b, turn):
    """Return the factor of the sum of all modes, and the constants added to +x and -x."""
    coth = np.pi * (1 + turn) / (1 - turn)
    return np.pi / (2 * b**2 * (1 - turn)), 1 / b + coth - np.pi, 1 / b + coth + np.pi


def azimuth_correlations(azimuth_rad, other_rad, radius_m):
    """Return {shape: c (n, m)} between azimuths (n,) and (m,).

    The azimuth nan denotes the mean of a full turn, to which no wave contributes.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
    other_rad : ndarray, shape (m,)
    radius_m : float
        Radius of the wall, m.

    Returns
    -------
    dict of str to ndarray, shape (n, m)
        Keys "mean", "oval", "settled" and "seam".
    """
    seams = seam_correlations(azimuth_rad, other_rad, radius_m)
    waves, others = wave_columns(azimuth_rad), wave_columns(other_rad)
    products = {shape: waves[shape] @ others[shape].T for shape in waves}
    return {"mean": np.broadcast_to(1.0, seams.shape), **products, "seam": seams}


def seam_correlations(azimuth_rad, other_rad, radius_m):
    """Return c (n, m) of "seam" between azimuths, as in `azimuth_correlations`.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
    other_rad : ndarray, shape (m,)
    radius_m : float
        Radius of the wall, m.

    Returns
    -------
    ndarray, shape (n, m)
    """
    first = np.nan_to_num(azimuth_rad)
    second = first if other_rad is azimuth_rad else np.nan_to_num(other_rad)
    correlations = _correlate_seams(first, second, radius_m)
    correlations[~np.isfinite(azimuth_rad)] = 0.0
    correlations[:, ~np.isfinite(other_rad)] = 0.0
    return correlations
