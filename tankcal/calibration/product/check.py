"""Is a product good enough? Bias, precision and classes from differences at check points.

With n differences d of mean m and standard deviation s along one axis:

    bias        t = m / s sqrt(n)                  against t(n-1, alpha/2), two-sided
    precision   chi2 = (n-1) s^2 / sigma^2         against chi2(n-1, alpha), upper
    RMSE        sqrt(sum(d^2) / n)                 less m where the bias is significant
    class       a share (90 %) of the points within the tolerance (PEC), and RMSE within the
                standard error (EP)

In plan the size of a difference is sqrt(dx^2 + dy^2), its RMSE sqrt(RMSE_x^2 + RMSE_y^2), and
sigma_x = sigma_y = EP / sqrt(2); in height sigma = EP.
Source: Pessoa 2017 (20-29, tables 1, 2); Merchant 1982; Galo & Camargo 1994.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, stdtrit

from tankcal.calibration.product.limits import LimitTable

ALPHA = 0.05  # two-sided: t(8) = 2.306, as Pessoa 2017 has it for nine points
AXES = ("x", "y", "z")
PART_OF = {"x": "plan", "y": "plan", "z": "height"}
FEWEST = 3  # points of a class: one or two say nothing of the others
FEW = 10  # points below which 90 % of them are all of them
ADVISED = 20  # points of a test of accuracy: NSSDA, FGDC-STD-007.3-1998
ROUNDING = 1e-12


@dataclass(frozen=True)
class Precision:
    """Whether the scatter along an axis is within an expected standard deviation.

    Attributes
    ----------
    axis : str
        The axis.
    sigma_m : float
        The expected standard deviation, m.
    chi2, limit : float or None
        (n-1) s^2/sigma^2 and its upper quantile; None with fewer than 2.
    passed : bool or None
        Is it within? None with fewer than 2.
    """

    axis: str
    sigma_m: float
    chi2: float | None
    limit: float | None
    passed: bool | None


@dataclass(frozen=True)
class AxisCheck:
    """Differences along one axis.

    Attributes
    ----------
    axis, part : str
        The axis, and the part it belongs to.
    n : int
        Number of points.
    mean_m, sd_m : float or None
        m; None with no point, with fewer than two.
    t, t_limit : float or None
        Student's t of the mean and its two-sided limit; None with fewer than two, t None too where
        nothing scatters.
    biased : bool or None
        The mean is significant; None: cannot be said.
    rmse_m, rmse_unbiased_m : float or None
        As they are, and less the mean, where it is significant, m.
    largest_m, largest_point
        Largest magnitude, m, and its point.
    precision : Precision or None
        Against an expected sd; None: none was given.
    """

    axis: str
    part: str
    n: int
    mean_m: float | None
    sd_m: float | None
    t: float | None
    t_limit: float | None
    biased: bool | None
    rmse_m: float | None
    rmse_unbiased_m: float | None
    largest_m: float | None
    largest_point: str | None
    precision: Precision | None = None

    @property
    def bias_m(self):
        """What is taken off: the mean where it is significant, else 0."""
        return self.mean_m if self.biased else 0.0


@dataclass(frozen=True)
class PartCheck:
    """Differences of the plan (x and y together) or of the height, m.

    n  points with all axes of the part       size_m  (n,) magnitudes, size_unbiased_m  (n,) less
    the significant means
    """

    part: str
    n: int
    size_m: np.ndarray
    size_unbiased_m: np.ndarray

    @property
    def rmse_m(self):
        """Root of the mean squared magnitude, as the differences are."""
        return _rms(self.size_m)

    @property
    def rmse_unbiased_m(self):
        """The same less the significant means."""
        return _rms(self.size_unbiased_m)


@dataclass(frozen=True)
class Reached:
    """Whether a class is reached: points within the tolerance, their share, RMSE, and both rules.

    why  () or some of "share_too_small", "rmse_too_large"
    """

    within: int
    share: float
    rmse_m: float
    reached: bool
    why: tuple[str, ...]


@dataclass(frozen=True)
class Verdict:
    """One class of one scale: as the differences are, and less the significant means.

    precision  Precision of each axis of the part against the class
    precise    all of them passed; None: cannot be said
    """

    part: str
    scale: str
    grade: str
    tolerance_m: float
    sd_m: float
    n: int
    as_is: Reached
    unbiased: Reached
    precision: tuple[Precision, ...]

    @property
    def precise(self):
        """Whether every axis passed the test of precision; None: cannot be said."""
        passed = [one.passed for one in self.precision]
        return None if None in passed else all(passed)


@dataclass(frozen=True)
class ProductCheck:
    """What differences at check points say of a product.

    names         (n,) points                   axes   k of "x", "y", "z"
    difference_m  (n, k) product minus truth; nan: not known
    alpha         of the tests of bias and precision
    checks        AxisCheck of each axis        parts  PartCheck of "plan", "height" where known
    table         LimitTable or None            verdicts  tuple of Verdict, in its order
    notes         tuple of (code, number): "no_points", "few_points", "share_means_all" ...
    """

    names: tuple
    axes: tuple
    difference_m: np.ndarray
    alpha: float
    checks: tuple[AxisCheck, ...]
    parts: tuple[PartCheck, ...]
    table: LimitTable | None
    verdicts: tuple[Verdict, ...]
    notes: tuple[tuple[str, float], ...]

    def best(self, part, scale, unbiased=False):
        """Name of the best class that a scale reaches; None: none of them."""
        for one in self.verdicts:
            if (one.part, one.scale) == (part, scale):
                found = one.unbiased if unbiased else one.as_is
                if found.reached:
                    return one.grade
        return None


def check_product(
    difference_m, axes=AXES, *, names=None, limits=None, alpha=ALPHA, expected_sd_m=None
):
    """Check a product by its differences from the truth.

    Parameters
    ----------
    difference_m : array_like, shape (n, k)
        Product minus truth, m; nan where not known.
    axes : sequence of k str, optional
        Of "x", "y", "z": x and y are the plan, z is the height.
    names : sequence of n str, optional
        Of the points; None: their numbers from 1 on.
    limits : LimitTable, optional
        None: no classes.
    alpha : float, optional
        Significance level of the tests.
    expected_sd_m : array_like, shape (k,), optional
        Standard deviations that the precision of each axis is tested against, m.

    Returns
    -------
    ProductCheck

    Raises
    ------
    ValueError
        For other axes, shapes, levels, or infinite differences.

    Examples
    --------
    >>> (height,) = check_product([[0.01], [0.02], [0.03]], ["z"]).checks
    >>> round(height.t, 3), round(height.t_limit, 3), height.biased
    (3.464, 4.303, False)
    """
    d = np.asarray(difference_m, dtype=float).reshape(-1, len(axes))
    names = tuple(str(i + 1) for i in range(len(d))) if names is None else tuple(names)
    _refuse(d, axes, names, alpha, expected_sd_m)
    sigma = (None,) * len(axes) if expected_sd_m is None else expected_sd_m
    checks = tuple(
        _axis(axis, column, names, alpha, sd)
        for axis, column, sd in zip(axes, d.T, sigma, strict=True)
    )
    parts = tuple(
        part for name in ("plan", "height") if (part := _part(name, d, axes, checks)) is not None
    )
    verdicts = () if limits is None else _verdicts(limits, checks, parts, alpha)
    return ProductCheck(
        names=names,
        axes=tuple(axes),
        difference_m=d,
        alpha=alpha,
        checks=checks,
        parts=parts,
        table=limits,
        verdicts=verdicts,
        notes=_notes(limits, checks, parts),
    )


def t_limit(n, alpha=ALPHA):
    """Two-sided limit of Student's t of the mean of n differences: t(n-1, 1 - alpha/2)."""
    return float(stdtrit(n - 1, 1 - alpha / 2))


def chi2_limit(n, alpha=ALPHA):
    """Upper limit of (n-1) s^2/sigma^2 of n differences: chi2(n-1, 1 - alpha)."""
    return float(chdtri(n - 1, alpha))


def _refuse(d, axes, names, alpha, expected_sd_m):
    known = [axis for axis in axes if axis in AXES]
    if not axes or len(known) != len(set(axes)) or len(set(axes)) != len(axes):
        raise ValueError(f"found axes {axes!r}; expected some of x, y, z, each once")
    if len(names) != len(d):
        raise ValueError(f"found {len(names)} names of {len(d)} points; expected one for each")
    if np.isinf(d).any():
        raise ValueError("found an infinite difference; expected numbers")
    if not 0 < alpha < 1:
        raise ValueError(f"found alpha = {alpha!r}; expected a number between 0 and 1")
    if expected_sd_m is not None and (
        len(expected_sd_m) != len(axes) or not all(np.isfinite(s) and s > 0 for s in expected_sd_m)
    ):
        raise ValueError("expected a standard deviation above 0 for each axis")


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def _axis(axis, column, names, alpha, expected_sd_m):
    """The AxisCheck of differences (n,) along an axis."""
    there = np.flatnonzero(np.isfinite(column))
    d, n = column[there], len(there)
    if not n:
        return AxisCheck(axis, PART_OF[axis], 0, *(None,) * 9)
    mean, worst = float(d.mean()), there[np.abs(d).argmax()]
    sd = t = limit = biased = None
    if n > 1:
        sd, limit = float(d.std(ddof=1)), t_limit(n, alpha)
        if sd > ROUNDING * abs(mean):
            t = mean / sd * np.sqrt(n)
        biased = bool(mean != 0 if t is None else abs(t) > limit)
    precision = None
    if expected_sd_m is not None:
        precision = _precision(axis, sd, n, float(expected_sd_m), alpha)
    return AxisCheck(
        axis=axis, part=PART_OF[axis], n=n, mean_m=mean, sd_m=sd, t=None if t is None else float(t),
        t_limit=limit, biased=biased, rmse_m=_rms(d), rmse_unbiased_m=_rms(d - mean * bool(biased)),
        largest_m=float(np.abs(column[worst])), largest_point=names[worst], precision=precision,
    )  # fmt: skip


def _precision(axis, sd_m, n, sigma_m, alpha):
    if sd_m is None:
        return Precision(axis, sigma_m, None, None, None)
    chi2, limit = (n - 1) * (sd_m / sigma_m) ** 2, chi2_limit(n, alpha)
    return Precision(axis, sigma_m, float(chi2), limit, bool(chi2 <= limit))


def _part(name, d, axes, checks):
    """The PartCheck of the plan or the height; None where an axis of it is missing."""
    wanted = [axis for axis in AXES if PART_OF[axis] == name]
    if not all(axis in axes for axis in wanted):
        return None
    columns = [axes.index(axis) for axis in wanted]
    own = d[:, columns]
    own = own[np.isfinite(own).all(axis=1)]
    if not len(own):
        return None
    bias = np.array([checks[k].bias_m for k in columns])
    size, unbiased = (np.linalg.norm(a, axis=1) for a in (own, own - bias))
    return PartCheck(name, len(own), size, unbiased)


def _verdicts(table, checks, parts, alpha):
    """A Verdict for each limit of a part that is known."""
    known = {part.part: part for part in parts}
    return tuple(
        _verdict(limit, table.share, known[limit.part], checks, alpha)
        for limit in table.limits
        if limit.part in known
    )


def _verdict(limit, share, part, checks, alpha):
    own = [one for one in checks if one.part == limit.part]
    sigma = limit.sd_m / np.sqrt(len(own))
    return Verdict(
        part=limit.part,
        scale=limit.scale,
        grade=limit.grade,
        tolerance_m=limit.tolerance_m,
        sd_m=limit.sd_m,
        n=part.n,
        as_is=_reached(part.size_m, limit, share),
        unbiased=_reached(part.size_unbiased_m, limit, share),
        precision=tuple(_precision(one.axis, one.sd_m, one.n, float(sigma), alpha) for one in own),
    )


def _reached(size_m, limit, share):
    """The Reached of magnitudes (n,)."""
    within, rmse = int(np.sum(size_m <= limit.tolerance_m)), _rms(size_m)
    enough, small = within >= share * len(size_m) - ROUNDING * len(size_m), rmse <= limit.sd_m
    rules = (
        ("too_few_points", len(size_m) >= FEWEST),
        ("share_too_small", enough),
        ("rmse_too_large", small),
    )
    why = tuple(code for code, kept in rules if not kept)
    return Reached(within, within / len(size_m), rmse, not why, why)


def _notes(table, checks, parts):
    """(code, number) of what limits what can be said."""
    notes, fewest = [], min(one.n for one in checks)
    if fewest == 0:
        notes += [("axis_without_points", AXES.index(one.axis)) for one in checks if not one.n]
    if fewest < 2:
        notes.append(("no_tests", fewest))
    if fewest < ADVISED:
        notes.append(("few_points", fewest))
    if table is not None:
        known = {part.part: part.n for part in parts}
        if any(n < FEW for n in known.values()):
            notes.append(("share_means_all", min(known.values())))
        wanted = dict.fromkeys(limit.part for limit in table.limits)
        notes += [(f"no_{part}", 0) for part in wanted if part not in known]
    return tuple(notes)
