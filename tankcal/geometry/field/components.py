"""What is known of a wall before it is measured: its components, and how large each may be.

The radius of a wall at azimuth a and height zeta of a course (-1 at its bottom, +1 at its top) is

    r = rho + x sin a + y cos a + sum over components of f(a, zeta),

rho free for each course, x and y for each ring of points. A component is a random field of
covariance

    variance * c(a - a') * h(zeta, zeta'),  c(0) = 1,  the mean of h(zeta, zeta) over a course = 1,

so that its amplitude, the root of its variance, is the rms departure that it makes. It is the same
in all courses, or each course has its own. How large it is a survey tells in part; before it, the
logarithm of the variance is normal: about that of `median_m`, with `log_sd`, and a shell that is
large in one is more likely large in another (`log_covariance`).

Settlement is the exception: its h depends on the height t above the foot of the whole shell (0 to
1). A foundation that settles unevenly by u cos k a bends an open shell without stretching it. The
radius then changes by

    k^2 z / R * u cos k a,

which grows in proportion to the height z, so h(t, t') = 3 t t', of mean 1 over the shell. The
amplitudes u of a foundation fall with k and the factor k^2 grows, so modes 2 to 6 have equal
variances. That the shell is not stretched follows from w_k = k v_k and v_k' = k u_k / R of the
radial, circumferential and vertical displacements w, v, u of mode k.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.geometry.form import multiples
from tankcal.geometry.outlines import FULL_TURN

OVALITY_MODES = np.arange(2.0, 37.0)
OVALITY_WEIGHTS = OVALITY_MODES**-3 / np.sum(OVALITY_MODES**-3)
SEAM_LENGTH_M = 0.4  # along the arc, of a seam's flank
WELD_LENGTH_M = 0.2  # the same of a peak at a weld, which is 0.8 m wide in all
SETTLEMENT_MODES = np.arange(2.0, 7.0)
SETTLEMENT_WEIGHTS = np.full(len(SETTLEMENT_MODES), 1 / len(SETTLEMENT_MODES))
JOINT_LENGTHS = (0.1, 0.25)  # of half a course: how far a joint draws the plate in
LOCAL_LENGTH = 0.5  # of half a course: height over which a dent is lost
BELL, BELL_SD = 1.0, 0.4  # of the way from a parabola to a plate whose joints do not turn
WORKMANSHIP = 0.05  # correlation of the sizes of any two components of a shell
SHRINKAGE = 0.09  # the same, besides, of two that its welds make: joints and seams

_LEVEL = (1,)
KINDS = ("bulge", "ovality", "seams")
ROUND_SHAPES = ("oval", "settled", "seam")  # waves round the wall, random at every azimuth
LARGEST_QUOTIENT = 110.0  # b of which exp(2 pi b) is still a number
PIECE = 1 << 14  # correlations at once
NOT_AROUND = 15.0  # exp(-15 pi) is rounding: of a seam that short nothing is left half a turn away


@dataclass(frozen=True)
class Heights:
    """Heights of n places on a shell.

    Attributes
    ----------
    zeta : ndarray, shape (n,)
        Within the course, -1 at its bottom to +1 at its top.
    up : ndarray, shape (n,)
        Above the foot of the shell, as a part of its height, 0 to 1.
    """

    zeta: np.ndarray
    up: np.ndarray

    def __getitem__(self, chosen):
        return Heights(self.zeta[chosen], self.up[chosen])

    @classmethod
    def within(cls, span, zeta):
        """Heights zeta (n,) of courses between bottoms and tops (2,) or (n, 2) of the shell."""
        low, high = np.transpose(span)
        return cls(zeta, low + (np.asarray(zeta) + 1) / 2 * (high - low))


@dataclass(frozen=True)
class Component:
    """One way in which a wall departs from a cylinder.

    Attributes
    ----------
    name : str
    kind : str
        Its name in a budget.
    shape : str
        Along the azimuth: "mean" (none: the mean radius), "oval" (mode k of variance k^-3, from 2
        on), "settled" (modes 2 to 6 of equal variance), "seam" (the spectrum (1 + (k SEAM_LENGTH_M
        / R)^2)^-2 from mode 2 on, cusps) or "weld" (a narrow seam at each vertical weld whose
        azimuth is known; its amplitude is the peak's).
    common : bool
        The same in all courses.
    orders : tuple of float, str
        Variances of the Legendre polynomials 0, 1, ... in the height, up to a factor; "plate": of
        the profiles of `plate_profiles`; "joints": of those of `joint_profiles`; "local": the
        covariance exp(-|zeta - zeta'| / LOCAL_LENGTH); "growing": in proportion to the height above
        the foot of the shell.
    median_m, log_sd : float
        Median of its amplitude, m, and standard deviation of the logarithm of its variance.
    declared_as : str
        Input of an uncertainty budget that stands for it, where somebody declares that.
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
        """(n, r) columns whose products are h at `Heights`; not of a component that is local."""
        if self.orders == "growing":
            return np.sqrt(3.0) * heights.up[:, None]
        if self.orders == "joints":
            return joint_profiles(heights.zeta)
        if self.orders == "plate":
            return plate_profiles(heights.zeta)
        used, scale = self._scales
        return legendre(heights.zeta, used[-1])[:, used] * scale

    @cached_property
    def _scales(self):
        """Orders that have a variance, and its roots, so that the mean of h is one."""
        weights = np.array(self.orders, dtype=float)
        weights = weights / np.sum(weights / (2 * np.arange(len(weights)) + 1))
        used = np.flatnonzero(weights)
        return used, np.sqrt(weights[used])

    def columns(self, waves, heights):
        """(n, k) columns whose products are the covariance, of a mean, an oval or a settlement.

        waves  {shape: (n, 2 modes)} of `wave_columns`
        """
        up = self.height_columns(heights)
        if self.shape == "mean":
            return up
        return (waves[self.shape][:, :, None] * up[:, None]).reshape(len(up), -1)

    @property
    def is_level(self):
        """The same at all heights of a course."""
        return self.orders == _LEVEL

    def height_covariance(self, heights, other):
        """(n, m) h between `Heights` (n,) and (m,)."""
        if self.orders == "local":
            return _fading(np.subtract.outer(heights.zeta, other.zeta))
        return self.height_columns(heights) @ self.height_columns(other).T

    def height_between(self, heights, other):
        """(n,) h between each of the `Heights` (n,) and its partner in the other (n,)."""
        if self.orders == "local":
            return _fading(heights.zeta - other.zeta)
        return np.sum(self.height_columns(heights) * self.height_columns(other), axis=1)


_FREE = (0, 0, *(order**-2.0 for order in range(2, 7)))
_LINEAR = (0, 1)
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
    """(components, components) of the logarithms of the variances, before the survey.

    Plates that are badly rolled and fitted leave a shell that is rough in every way; what welds
    draw in when they shrink is peaking at the vertical and banding at the girth ones. Settlement is
    due to the foundation, and is independent of the plates. But limbs,
    which pass over its valleys, and set-ups that nothing but the wall ties show every wall smoother
    than it is: of those (smoothed True) no size tells of another.
    """
    log_sd = np.array([one.log_sd for one in COMPONENTS])
    if smoothed:
        return np.diag(log_sd**2)
    welded = np.array([one.kind == "seams" or one.orders == "joints" for one in COMPONENTS])
    of_plates = np.array([one.shape != "settled" for one in COMPONENTS])
    alike = np.outer(of_plates, of_plates) * (WORKMANSHIP + SHRINKAGE * np.outer(welded, welded))
    np.fill_diagonal(alike, 1.0)
    return alike * np.outer(log_sd, log_sd)


def _fading(apart):
    """h of a dent between heights so far apart."""
    return np.exp(-np.abs(apart) / LOCAL_LENGTH)


def legendre(zeta, highest):
    """(n, highest + 1) Legendre polynomials of order 0 to the highest."""
    zeta = np.asarray(zeta, dtype=float)
    found = np.ones((len(zeta), highest + 1))
    found[:, 1:2] = zeta[:, None]
    for n in range(2, highest + 1):
        found[:, n] = (2 - 1 / n) * zeta * found[:, n - 1] - (1 - 1 / n) * found[:, n - 2]
    return found


def plate_profiles(zeta):
    """(n, 2) columns whose products are h of a plate that bulges between its joints.

    A plate whose joints turn freely is nearly a parabola, p = 1 - zeta^2; one whose joints do not,
    b = (1 - zeta^2)^2. What bulges is p + t (b - p), t about BELL with the standard deviation
    BELL_SD. Less the mean over the course, p = -2/3 P2 and b = -16/21 P2 + 8/35 P4.
    """
    free, held = np.array([-2 / 3, 0.0]), np.array([-16 / 21, 8 / 35])  # of P2 and P4
    shapes = np.array([free + BELL * (held - free), BELL_SD * (held - free)])
    shapes /= np.sqrt(np.sum(shapes**2 @ [1 / 5, 1 / 9]))
    return legendre(zeta, 4)[:, [2, 4]] @ shapes.T


def joint_profiles(zeta):
    """(n, 2) columns whose products are h of a plate that its joints draw in, near them.

    Each is exp(-(1 - |zeta|) / w) less its mean, of mean square a half; w of JOINT_LENGTHS, for
    what a girth weld draws in is lost over about sqrt(R t) / 1.3 of a plate t thick (the edge
    effect of a cylinder): 0.1 m of a small tank, 0.3 m of a large one.

    Source: Timoshenko & Woinowsky-Krieger 1959, section 114.
    """
    w = np.array(JOINT_LENGTHS)
    mean = w * (1 - np.exp(-1 / w))
    square = w / 2 * (1 - np.exp(-2 / w)) - mean**2
    below = (1 - np.abs(np.asarray(zeta, dtype=float)))[:, None]
    return (np.exp(-below / w) - mean) / np.sqrt(len(w) * square)


def wave_columns(azimuth_rad):
    """{"oval", "settled": (n, 2 modes) columns whose products are c}.

    Mode k has the variance k^-3, k = 2..36; modes 2 to 6 have equal ones. nan: the mean of a whole
    turn, which has none of them.
    """
    cosines, sines = multiples(azimuth_rad, int(OVALITY_MODES[-1]))
    found = {}
    for shape, weights in (("oval", OVALITY_WEIGHTS), ("settled", SETTLEMENT_WEIGHTS)):
        modes = slice(1, 1 + len(weights))  # from k = 2 on
        waves = np.hstack([cosines[:, modes], sines[:, modes]]) * np.tile(np.sqrt(weights), 2)
        waves[~np.isfinite(azimuth_rad)] = 0.0
        found[shape] = waves
    return found


def seam_correlation(difference_rad, radius_m, length_m=SEAM_LENGTH_M):
    """c of an azimuth difference on a wall of that radius: sum over k >= 2 of (1 + (k/k0)^2)^-2.

    k0 = R / length_m; all modes are summed in closed form,

        sum over all k of exp(i k x) / (k^2 + b^2)^2
            = pi / (2 b^2) (C / b - (pi - x) S + pi C coth(pi b)),  0 <= x <= pi,
        C = cosh(b (pi - x)) / sinh(pi b),  S = sinh(b (pi - x)) / sinh(pi b),

    and modes 0 and 1 are taken off.
    """
    b = radius_m / length_m
    x = np.asarray(difference_rad, dtype=float)
    found = _all_modes(x, b) - b**-4 - 2 * np.cos(x) / (1 + b**2) ** 2
    return found / _seam_sum(b)


def _seams_between(azimuth_rad, other_rad, radius_m):
    """(n, m) `seam_correlation` between azimuths, in pieces of rows that a processor keeps at hand.

    exp(-b x) is a quotient of exp(b a), so that there are no more exponentials than azimuths. Of
    azimuths with themselves one half is computed, and mirrored.
    """
    b = radius_m / SEAM_LENGTH_M
    first, second = azimuth_rad % FULL_TURN - np.pi, other_rad % FULL_TURN - np.pi
    if b > LARGEST_QUOTIENT:
        return seam_correlation(np.subtract.outer(first, second), radius_m)
    turn, at_once = np.exp(-b * FULL_TURN), max(1, PIECE // max(len(second), 1))
    scale, near_by, far_by = _of_modes(b, turn)
    scale /= _seam_sum(b)
    grows, falls = np.exp(b * second), np.exp(-b * second)
    low = [np.stack([np.ones(len(a)), np.cos(a), np.sin(a)], axis=1) for a in (first, second)]
    low[0] *= np.array([b**-4, *2 * [2 / (1 + b**2) ** 2]]) / _seam_sum(b)
    found, mirrored = np.empty((len(first), len(second))), azimuth_rad is other_rad
    for start in range(0, len(first), at_once):
        rows, to = slice(start, start + at_once), slice(start if mirrored else 0, None)
        here = first[rows]
        x = np.abs(np.subtract.outer(here, second[to]))
        np.minimum(x, FULL_TURN - x, out=x)
        one = np.multiply.outer(np.exp(b * here), falls[to])
        other = np.multiply.outer(np.exp(-b * here), grows[to])
        near, around = np.minimum(one, other), np.maximum(one, other, out=one)
        around *= turn  # the same along the other way
        np.maximum(near, around, out=near)
        if b < NOT_AROUND:
            far = turn / near
            far *= far_by - x
        else:
            far = 0.0
        x += near_by
        near *= x
        near += far
        near *= scale
        np.subtract(near, low[0][rows] @ low[1][to].T, out=found[rows, to])
        if mirrored:
            found[to, rows] = found[rows, to].T
    return found


def weld_columns(azimuth_rad, welds_rad, radius_m):
    """(n, w) a seam of WELD_LENGTH_M at each weld, of peak one: c(a - weld); 0 of a whole turn."""
    away = np.subtract.outer(azimuth_rad, welds_rad)
    return np.nan_to_num(seam_correlation(away, radius_m, WELD_LENGTH_M))


def mode_shares(modes, radius_m):
    """{"oval", "settled", "seam": (k,) variance of cosine and sine of each mode, from 2 on}.

    All modes of a shape add up to one.
    """
    b = radius_m / SEAM_LENGTH_M
    return {
        "oval": np.where(modes <= OVALITY_MODES[-1], modes**-3 / np.sum(OVALITY_MODES**-3), 0.0),
        "settled": np.where(modes <= SETTLEMENT_MODES[-1], SETTLEMENT_WEIGHTS[0], 0.0),
        "seam": 2 / (modes**2 + b**2) ** 2 / _seam_sum(b),
    }


def _seam_sum(b):
    """Sum over |k| >= 2 of (k^2 + b^2)^-2."""
    return _all_modes(np.zeros(1), b)[0] - b**-4 - 2 / (1 + b**2) ** 2


def _all_modes(x, b):
    x = np.abs(x)
    if np.max(x, initial=0.0) > FULL_TURN:
        x = x % FULL_TURN
    x = np.minimum(x, FULL_TURN - x)
    turn = np.exp(-b * FULL_TURN)
    scale, near_by, far_by = _of_modes(b, turn)
    near = np.exp(-b * x)
    found = near * (near_by + x)
    if b < NOT_AROUND:  # else nothing comes from the other way around
        far = turn / near
        found += far * (far_by - x)
    return scale * found


def _of_modes(b, turn):
    """Factor of the sum of all modes, and what stands beside x along the near and the far way."""
    coth = np.pi * (1 + turn) / (1 - turn)
    return np.pi / (2 * b**2 * (1 - turn)), 1 / b + coth - np.pi, 1 / b + coth + np.pi


def azimuth_correlations(azimuth_rad, other_rad, radius_m):
    """{shape: (n, m) c} between azimuths (n,) and (m,); nan: a whole turn.

    The mean of a whole turn has none of the waves around it.
    """
    seams = seam_correlations(azimuth_rad, other_rad, radius_m)
    waves, others = wave_columns(azimuth_rad), wave_columns(other_rad)
    products = {shape: waves[shape] @ others[shape].T for shape in waves}
    return {"mean": np.broadcast_to(1.0, seams.shape), **products, "seam": seams}


def seam_correlations(azimuth_rad, other_rad, radius_m):
    """(n, m) c of "seam", as `azimuth_correlations` gives it."""
    known = np.nan_to_num(azimuth_rad)
    other = known if other_rad is azimuth_rad else np.nan_to_num(other_rad)
    found = _seams_between(known, other, radius_m)
    found[~np.isfinite(azimuth_rad)] = 0.0
    found[:, ~np.isfinite(other_rad)] = 0.0
    return found
