"""Accuracy of a product from check points: bias, precision and classes by a table of limits.

The table is that of the Brazilian standard, which is included, or a TOML file:

    [table]
    name = "PEC-PCD"
    source = "where the numbers were read"
    verified = false
    remark = "..."
    share = 0.90

    [plan.1000]
    A = {tolerance_m = 0.28, sd_m = 0.17}
    B = {tolerance_m = 0.50, sd_m = 0.30}

    [height.1000]
    A = {tolerance_m = 0.50, sd_m = 0.33}

The classes are listed from the best to the worst.

For n differences d with mean m and standard deviation s along one axis:

    bias        t = m / s sqrt(n)                  against t(n-1, alpha/2), two-sided
    precision   chi2 = (n-1) s^2 / sigma^2         against chi2(n-1, alpha), upper
    RMSE        sqrt(sum(d^2) / n)                 without m if the bias is significant
    class       a share (90 %) of the points within the tolerance (PEC), and RMSE within the
                standard error (EP)

In plan the size of a difference is sqrt(dx^2 + dy^2), its RMSE sqrt(RMSE_x^2 + RMSE_y^2), and
sigma_x = sigma_y = EP / sqrt(2); in height sigma = EP.
Source: Pessoa 2017 (20-29, tables 1, 2); Merchant 1982; Galo & Camargo 1994.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import chdtri, stdtrit

from tankcal.errors import InputError, Problem
from tankcal.job.entries import read_setting
from tankcal.job.fields import Field
from tankcal.job.folder import read_toml
from tankcal.job.tables import Log, nearest, read_bytes
from tankcal.messages import message
from tankcal.text.shipped import shipped_folder

PARTS = ("plan", "height")
SHIPPED = "pec_pcd"
MAX_BYTES = 1_000_000
_TABLE = {
    field.name: field
    for field in (
        Field("name", "text", message("limits_note_name", "name of the table"), required=True),
        Field(
            "source",
            "text",
            message("limits_note_source", "where its numbers were published"),
            required=True,
        ),
        Field("verified", "flag", "whether they were read in the legal or technical text itself"),
        Field("remark", "text", "anything that is to stand beside it"),
        Field("share", "number", "share of the points within the tolerance", low=0, high=1),
    )
}
_LIMIT = {
    name: Field(name, "number", note, required=True, low=0, high=1e5, above_low=True)
    for name, note in (("tolerance_m", "tolerance"), ("sd_m", "standard error"))
}
_DEFAULT_SHARE = 0.9


@dataclass(frozen=True)
class Limit:
    """Limits of one class of one scale.

    Attributes
    ----------
    part : str
        "plan" or "height".
    scale : str
        Name of the scale in the file, such as "1000".
    grade : str
        Name of the class.
    tolerance_m : float
        Tolerance for a share of the points (PEC), m.
    sd_m : float
        Largest RMSE (EP), m; in plan of both coordinates together.
    """

    part: str
    scale: str
    grade: str
    tolerance_m: float
    sd_m: float


@dataclass(frozen=True)
class LimitTable:
    """Table of limits by part and scale, the best class first.

    Attributes
    ----------
    name, source, remark : str
        Name, source and remark of the table.
    limits : tuple of Limit
        Limits in the order of the file.
    share : float
        Share of the points that must lie within the tolerance, 0 to 1.
    verified : bool or None
        Whether the numbers were read in the legal or technical text itself; None if not stated.
    code : str or None
        Code of a table that is part of tankcal, or None for a file of the user.
    """

    name: str
    source: str
    limits: tuple[Limit, ...]
    share: float = _DEFAULT_SHARE
    verified: bool | None = None
    remark: str = ""
    code: str | None = None


def limits_of_scale(table, scale):
    """Restrict a table to the limits of one scale.

    Parameters
    ----------
    table : LimitTable
        Table of limits.
    scale : float
        Denominator of the scale.

    Returns
    -------
    LimitTable

    Raises
    ------
    InputError
        If the table has no such scale.

    Examples
    --------
    >>> limits_of_scale(shipped_limits(), 2000).limits[0]
    Limit(part='plan', scale='2000', grade='A', tolerance_m=0.56, sd_m=0.34)
    """
    name = f"{scale:g}"
    chosen = tuple(limit for limit in table.limits if limit.scale == name)
    if not chosen:
        known = ", ".join(dict.fromkeys(limit.scale for limit in table.limits))
        raise InputError(
            Problem(
                table.name,
                message(
                    "limits_no_scale",
                    "found no scale {scale}; expected one of {known}",
                    scale=name,
                    known=known,
                ),
            )
        )
    return replace(table, limits=chosen)


def shipped_limits(name=SHIPPED):
    """Read a table of limits of tankcal: "pec_pcd", the Brazilian standard of digital maps.

    Parameters
    ----------
    name : str, optional
        Name of the table.

    Returns
    -------
    LimitTable

    Examples
    --------
    >>> shipped_limits().name
    'PEC-PCD'
    """
    folder = shipped_folder("calibration/product/limit_tables")
    return replace(read_limits(folder / f"{name}.toml"), code=name)


def read_limits(path):
    """Read a table of limits from a TOML file.

    Returns
    -------
    LimitTable

    Raises
    ------
    InputError
        If the file is invalid; the error lists all problems.
    """
    path, log = Path(path), Log()
    data = read_bytes(path, log, MAX_BYTES)
    settings = None
    if data is not None:
        settings, sections = read_toml(path.name, data, log)
    log.stop_if_problems()
    given = settings.pop("table", {})
    values = _read_values(path.name, "table", _TABLE, given, sections.get("table"), log)
    limits = _read_limit_sections(path.name, settings, sections, log)
    log.stop_if_problems()
    return LimitTable(
        name=values["name"],
        source=values["source"],
        limits=limits,
        share=_DEFAULT_SHARE if values["share"] is None else values["share"],
        verified=values["verified"],
        remark=values["remark"] or "",
    )


def _read_values(file, section, fields, given, row, log):
    """Return {key: value or None} of a section; problems are added to the log."""
    for key in given.keys() - fields.keys():
        known = ", ".join(fields)
        expected = message(
            "limits_unknown_key",
            "unknown key; expected {known}{hint}",
            known=known,
            hint=nearest(key, fields),
        )
        log.problem(file, expected, given[key].row or row, f"{section}.{key}")
    values = {
        name: read_setting(
            file, f"{section}.{name}", field, given.get(name), None, log, field.required, row
        )
        for name, field in fields.items()
    }
    if values.get("share") == 0:
        log.problem(
            file,
            message("limits_no_share", "found 0; expected a share above 0, at most 1"),
            row,
            "table.share",
        )
    return values


def _read_limit_sections(file, settings, sections, log):
    """Read the limits of all sections such as plan.1000.A, in the order of the file."""
    limits = []
    for section, entries in settings.items():
        part, _, rest = section.partition(".")
        scale, _, grade = rest.partition(".")
        row = sections.get(section)
        if part not in PARTS:
            hint = nearest(part, PARTS)
            expected = message(
                "limits_unknown_section",
                "unknown section; expected [table], [plan.SCALE] or [height.SCALE]{hint}",
                hint=hint,
            )
            log.problem(file, expected, row, f"[{section}]")
        elif grade and "." not in grade:
            values = _read_values(file, section, _LIMIT, entries, row, log)
            if None not in values.values():
                limits.append(Limit(part, scale, grade, **values))
        elif entries:
            expected = message(
                "limits_no_classes",
                "expected classes such as A = {{tolerance_m = 0.28, sd_m = 0.17}}",
            )
            log.problem(file, expected, row, f"[{section}]")
    if not (limits or log.problems):
        log.problem(
            file, message("limits_none", "no limits; expected sections such as [plan.1000]")
        )
    _log_disorder(file, limits, sections, log)
    return tuple(limits)


def _log_disorder(file, limits, sections, log):
    """Add a problem to the log for each class with smaller limits than the class before it."""
    before = {}
    for limit in limits:
        place = limit.part, limit.scale
        last = before.get(place, (-math.inf, -math.inf))
        now = limit.tolerance_m, limit.sd_m
        if now[0] < last[0] or now[1] < last[1]:
            section = f"{limit.part}.{limit.scale}.{limit.grade}"
            expected = message(
                "limits_disorder", "smaller than the class before it; expected the best class first"
            )
            log.problem(file, expected, sections.get(section), section)
        before[place] = now


ALPHA = 0.05  # significance level, two-sided: t(8) = 2.306, as in Pessoa 2017 for nine points
AXES = ("x", "y", "z")
PART_OF = {"x": "plan", "y": "plan", "z": "height"}
FEWEST = 3  # least number of points for a class
FEW = 10  # number of points below which 90 % of the points means all points
ADVISED = 20  # least number of points of a test of accuracy: NSSDA, FGDC-STD-007.3-1998
ROUNDING = 1e-12  # relative tolerance for rounding errors


@dataclass(frozen=True)
class Precision:
    """Test whether the scatter along an axis agrees with an expected standard deviation.

    Attributes
    ----------
    axis : str
        "x", "y" or "z".
    sigma_m : float
        Expected standard deviation, m.
    chi2, limit : float or None
        Statistic (n-1) s^2/sigma^2 and its upper quantile; None for fewer than two points.
    passed : bool or None
        Whether chi2 is at most the limit; None for fewer than two points.
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
        Axis ("x", "y" or "z") and its part ("plan" or "height").
    n : int
        Number of points.
    mean_m, sd_m : float or None
        Mean and standard deviation, m; None without points, and for fewer than two points.
    t, t_limit : float or None
        Student's t of the mean and its two-sided limit; None for fewer than two points. t is also
        None without scatter.
    biased : bool or None
        Whether the mean is significant; None for fewer than two points.
    rmse_m, rmse_unbiased_m : float or None
        RMSE of the differences, and RMSE without a significant mean, m.
    largest_m, largest_point : float, str or None
        Largest magnitude, m, and its point.
    precision : Precision or None
        Test against an expected standard deviation, if given.
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
        """Mean if it is significant, else 0, m."""
        return self.mean_m if self.biased else 0.0


@dataclass(frozen=True)
class PartCheck:
    """Differences of the plan (x and y together) or of the height.

    Attributes
    ----------
    part : str
        "plan" or "height".
    n : int
        Number of points with all axes of the part.
    size_m, size_unbiased_m : ndarray, shape (n,)
        Magnitudes of the differences, with and without significant means, m.
    """

    part: str
    n: int
    size_m: np.ndarray
    size_unbiased_m: np.ndarray

    @property
    def rmse_m(self):
        """Root mean square of the magnitudes, m."""
        return _rms(self.size_m)

    @property
    def rmse_unbiased_m(self):
        """Root mean square of the magnitudes without significant means, m."""
        return _rms(self.size_unbiased_m)


@dataclass(frozen=True)
class Reached:
    """Result for one class: points within the tolerance, their share, RMSE, and the decision.

    `why` contains the reasons of a failure: "too_few_points", "share_too_small", "rmse_too_large".
    """

    within: int
    share: float
    rmse_m: float
    reached: bool
    why: tuple[str, ...]


@dataclass(frozen=True)
class Verdict:
    """Result for one class of one scale, with and without significant means.

    Attributes
    ----------
    part, scale, grade : str
        Part, scale and name of the class.
    tolerance_m, sd_m : float
        Tolerance and standard error of the class, m.
    n : int
        Number of points.
    as_is, unbiased : Reached
        Result with the differences, and without significant means.
    precision : tuple of Precision
        Test of each axis of the part against the class.
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
        """Whether every axis passed the test of precision; None if a test is not possible."""
        passed = [test.passed for test in self.precision]
        return None if None in passed else all(passed)


@dataclass(frozen=True)
class ProductCheck:
    """Accuracy of a product from differences at check points.

    Attributes
    ----------
    names : tuple of str
        Names of the n points.
    axes : tuple of str
        The k axes, from "x", "y", "z".
    difference_m : ndarray, shape (n, k)
        Product minus reference, m; nan if it is not known.
    alpha : float
        Significance level of the tests of bias and precision.
    checks : tuple of AxisCheck
        Result for each axis.
    parts : tuple of PartCheck
        Result for "plan" and "height", if their axes are known.
    table : LimitTable or None
        Table of limits.
    verdicts : tuple of Verdict
        Result for each limit of the table.
    notes : tuple of (str, float)
        Codes and numbers of limitations, such as "few_points" or "share_means_all".
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
        """Name of the best class reached for a part and scale, or None."""
        for verdict in self.verdicts:
            if (verdict.part, verdict.scale) == (part, scale):
                result = verdict.unbiased if unbiased else verdict.as_is
                if result.reached:
                    return verdict.grade
        return None


def check_product(
    difference_m, axes=AXES, *, names=None, limits=None, alpha=ALPHA, expected_sd_m=None
):
    """Check a product by its differences from reference values.

    Parameters
    ----------
    difference_m : array_like, shape (n, k)
        Product minus reference, m; nan if it is not known.
    axes : sequence of k str, optional
        Some of "x", "y", "z". x and y form the plan; z is the height.
    names : sequence of n str, optional
        Names of the points; by default their numbers from 1.
    limits : LimitTable, optional
        Table of limits; by default no classes are tested.
    alpha : float, optional
        Significance level of the tests.
    expected_sd_m : array_like, shape (k,), optional
        Expected standard deviations for the test of precision of each axis, m.

    Returns
    -------
    ProductCheck

    Raises
    ------
    ValueError
        If axes, shapes or level are invalid, or if a difference is infinite.

    Examples
    --------
    >>> (height,) = check_product([[0.01], [0.02], [0.03]], ["z"]).checks
    >>> round(height.t, 3), round(height.t_limit, 3), height.biased
    (3.464, 4.303, False)
    """
    d = np.asarray(difference_m, dtype=float).reshape(-1, len(axes))
    names = tuple(str(i + 1) for i in range(len(d))) if names is None else tuple(names)
    _check_arguments(d, axes, names, alpha, expected_sd_m)
    sigma = (None,) * len(axes) if expected_sd_m is None else expected_sd_m
    checks = tuple(
        _check_axis(axis, column, names, alpha, sd)
        for axis, column, sd in zip(axes, d.T, sigma, strict=True)
    )
    parts = tuple(
        part
        for name in ("plan", "height")
        if (part := _check_part(name, d, axes, checks)) is not None
    )
    known = {part.part: part for part in parts}
    verdicts = (
        ()
        if limits is None
        else tuple(
            _make_verdict(limit, limits.share, known[limit.part], checks, alpha)
            for limit in limits.limits
            if limit.part in known
        )
    )
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


def _check_arguments(d, axes, names, alpha, expected_sd_m):
    """Raise ValueError for invalid arguments of `check_product`."""
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


def _check_axis(axis, column, names, alpha, expected_sd_m):
    """Check the differences (n,) along one axis."""
    known = np.flatnonzero(np.isfinite(column))
    d, n = column[known], len(known)
    if not n:
        return AxisCheck(axis, PART_OF[axis], 0, *(None,) * 9)
    mean, worst = float(d.mean()), known[np.abs(d).argmax()]
    sd = t = limit = biased = None
    if n > 1:
        sd, limit = float(d.std(ddof=1)), t_limit(n, alpha)
        if sd > ROUNDING * abs(mean):
            t = mean / sd * np.sqrt(n)
        biased = bool(mean != 0 if t is None else abs(t) > limit)
    precision = None
    if expected_sd_m is not None:
        precision = _test_precision(axis, sd, n, float(expected_sd_m), alpha)
    return AxisCheck(
        axis=axis, part=PART_OF[axis], n=n, mean_m=mean, sd_m=sd, t=None if t is None else float(t),
        t_limit=limit, biased=biased, rmse_m=_rms(d), rmse_unbiased_m=_rms(d - mean * bool(biased)),
        largest_m=float(np.abs(column[worst])), largest_point=names[worst], precision=precision,
    )  # fmt: skip


def _test_precision(axis, sd_m, n, sigma_m, alpha):
    """Test a standard deviation of n differences against the expected one, sigma_m."""
    if sd_m is None:
        return Precision(axis, sigma_m, None, None, None)
    chi2, limit = (n - 1) * (sd_m / sigma_m) ** 2, chi2_limit(n, alpha)
    return Precision(axis, sigma_m, float(chi2), limit, bool(chi2 <= limit))


def _check_part(name, d, axes, checks):
    """Check the plan or the height; None if an axis or all points are missing."""
    wanted = [axis for axis in AXES if PART_OF[axis] == name]
    if not all(axis in axes for axis in wanted):
        return None
    columns = [axes.index(axis) for axis in wanted]
    values = d[:, columns]
    values = values[np.isfinite(values).all(axis=1)]
    if not len(values):
        return None
    bias = np.array([checks[k].bias_m for k in columns])
    size, unbiased = (np.linalg.norm(a, axis=1) for a in (values, values - bias))
    return PartCheck(name, len(values), size, unbiased)


def _make_verdict(limit, share, part, checks, alpha):
    """Create the Verdict of a limit; `share` of the points must be within its tolerance."""
    part_checks = [axis_check for axis_check in checks if axis_check.part == limit.part]
    # The standard error of the plan applies to both coordinates together.
    sigma = limit.sd_m / np.sqrt(len(part_checks))
    return Verdict(
        part=limit.part,
        scale=limit.scale,
        grade=limit.grade,
        tolerance_m=limit.tolerance_m,
        sd_m=limit.sd_m,
        n=part.n,
        as_is=_compare_with_limit(part.size_m, limit, share),
        unbiased=_compare_with_limit(part.size_unbiased_m, limit, share),
        precision=tuple(
            _test_precision(axis_check.axis, axis_check.sd_m, axis_check.n, float(sigma), alpha)
            for axis_check in part_checks
        ),
    )


def _compare_with_limit(size_m, limit, share):
    """Compare magnitudes (n,) with a limit."""
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
    """Return (code, number) of the limitations of the result."""
    notes, fewest = [], min(axis_check.n for axis_check in checks)
    if fewest == 0:
        notes += [
            ("axis_without_points", AXES.index(axis_check.axis))
            for axis_check in checks
            if not axis_check.n
        ]
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
