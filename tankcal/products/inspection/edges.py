"""Edge settlement of the bottom along radial lines, with bulges and dents.

Two straight lines through the readings meet at the break-over point x. With the radius R of the
shell, the width of the settled edge is R - x, and its drop is

    B = z(x) - z(R) = -m (R - x),    m the slope of the outer line

A bulge rises above the line of the bottom, inside of the break-over point. Its radius is half of
its length along the profile. A single profile shows neither the highest place of the bulge nor the
circle inscribed in it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from scipy import sparse

from tankcal.adjust import ALPHA, SD_OVER_MEDIAN
from tankcal.gum.conformity import severity
from tankcal.gum.coverage import coverage_factor
from tankcal.messages import message
from tankcal.products.inspection.levelling import LEAST_READINGS
from tankcal.products.inspection.rules import PROBABILITY, Figure, largest_drop_mm
from tankcal.record.inspection import EdgeProfile, InspectionLimit

FAR_FROM_SHELL_M = 0.3  # distance of the last reading from the shell that causes a warning
WIDEST_EDGE, WIDEST_EDGE_M = 0.3, 3.0  # largest width of an edge: share of the radius, and metres
MOST_BULGES = 3  # largest number of bulges that are rejected from a profile
ZONE = 3.0  # width of the zone that the bent line is fitted in, over the largest width of an edge
BEYOND_SHELL = 1.02  # largest valid radius over the shell's radius; more is another unit or tank
LEAST_IN_BULGE = 3  # readings; a narrower bulge cannot be distinguished from an outlier
ON_BOTTOM = 3.0  # robust standard deviations; a reading with a larger residual is on a bulge
MOST_ENDS = 60  # largest number of readings that define trial lines and ends of trial bulges
ROUNDING = 1e-24  # rounding error of a sum of squares, as a share of the readings' squares
SIGNIFICANT = 2.0  # least height of a bulge in units of its u


@dataclass(frozen=True)
class Break:
    """The bent line through a profile.

    Attributes
    ----------
    radius_m, z_m : float
        Radius and elevation of the break-over point, m.
    inner, outer : float
        Slopes dz/dr inside and outside of the break-over point.
    cofactor : ndarray, shape (4, 4)
        Covariance of (z, inner, outer, radius), with z and radius in m.
    dof : float
        Degrees of freedom of the covariance; inf if standard deviations were given.
    """

    radius_m: float
    z_m: float
    inner: float
    outer: float
    cofactor: np.ndarray
    dof: float

    def drop(self, shell_radius_m):
        """Drop B of the edge at the shell and its standard uncertainty, m."""
        width = shell_radius_m - self.radius_m
        # dB/d(outer) = -width and dB/d(radius) = outer.
        gradient = np.array([0.0, 0.0, -width, self.outer])
        return -self.outer * width, float(np.sqrt(gradient @ self.cofactor @ gradient))


def bent_line(r, unknowns):
    """Elevations of a bent line at the radii r, and their Jacobian.

    Parameters
    ----------
    r : ndarray, shape (n,)
        Radii, m.
    unknowns : sequence of 4 float
        Elevation of the bend, inner slope, outer slope and radius of the bend.

    Returns
    -------
    ndarray, shape (n,)
        Elevations, m.
    ndarray, shape (n, 4)
        Derivatives of the elevations with respect to the unknowns.

    Examples
    --------
    >>> bent_line(np.array([1.0, 2.0, 3.0]), (0.5, 0.0, -0.1, 2.0))[0].round(3).tolist()
    [0.5, 0.5, 0.4]
    """
    z, inner, outer, x = unknowns
    inside = r < x
    distance = r - x
    slope = np.where(inside, inner, outer)
    columns = [
        np.ones(len(r)),
        np.where(inside, distance, 0.0),
        np.where(inside, 0.0, distance),
        -slope,
    ]
    return z + slope * distance, np.column_stack(columns)


def find_break(r, z, sd, shell_radius_m):
    """Find the break-over point of a profile.

    The point is searched for within `widest_edge` of the shell. The fit uses the readings within
    three times this distance. Readings on a bulge are rejected, because the flank of a bulge is no
    break (`select_beside_bulge`). If the residuals exceed the standard deviations, the
    covariance is scaled by the residuals.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
        Ascending radii and elevations, m.
    sd : ndarray, shape (n,), or None
        Standard deviations of the elevations, m; None if they follow from the residuals.
    shell_radius_m : float
        Radius of the shell, m.

    Returns
    -------
    Break or None
        None if the edge does not bend down significantly (0.1 %).
    """
    widest = widest_edge(shell_radius_m)
    near = r >= shell_radius_m - ZONE * widest
    r, z = r[near], z[near]
    weights = np.ones(len(r)) if sd is None else 1.0 / sd[near]
    best = _best_bend(r, z, weights, shell_radius_m - widest)
    # A profile may have several bulges; each round rejects the most significant bulge.
    for _ in range(MOST_BULGES):
        beside = best and select_beside_bulge(r, z, weights, best[0], shell_radius_m - widest)
        if beside is None:
            break
        r, z, weights = r[beside], z[beside], weights[beside]
        best = _best_bend(r, z, weights, shell_radius_m - widest)
    if best is None:
        return None
    squares, unknowns = best
    straight = _squares(np.column_stack([np.ones(len(r)), r]), z, weights)[1]
    dof, gained = len(r) - 4, straight - squares
    # The bend must be downwards, and better than rounding.
    if unknowns[2] >= unknowns[1] or gained <= 1e-9 * straight:
        return None
    residual_variance = squares / dof
    # The bent line has two unknowns more than the straight line: chi-squared test with the given
    # standard deviations, F test with the residuals.
    if sd is not None and residual_variance <= 1:
        factor, chance = 1.0, scipy.stats.chi2.sf(gained, 2)
    else:
        factor, chance = (
            residual_variance,
            scipy.stats.f.sf(gained / 2 / max(residual_variance, 1e-12 * gained), 2, dof),
        )
    if chance > ALPHA:
        return None
    jacobian = bent_line(r, unknowns)[1] * weights[:, None]
    cofactor = factor * np.linalg.inv(jacobian.T @ jacobian)
    z_break, inner, outer, x = map(float, unknowns)
    return Break(x, z_break, inner, outer, cofactor, float(dof) if sd is None else np.inf)


def _best_bend(r, z, weights, least_radius):
    """Sum of squares and unknowns of the best line that bends at `least_radius` or beyond."""
    if len(r) < LEAST_READINGS:
        return None
    bends = [bend for bend in _bends(r, z, weights) if bend[1][3] >= least_radius]
    return min(bends, key=lambda bend: bend[0], default=None)


def widest_edge(shell_radius_m):
    """Largest width of a settled edge, m: 3 m, or 0.3 of the radius of a small tank."""
    return min(WIDEST_EDGE_M, WIDEST_EDGE * shell_radius_m)


def _squares(columns, z, weights):
    """Unknowns and weighted sum of squared residuals of a linear fit."""
    unknowns = np.linalg.lstsq(columns * weights[:, None], z * weights, rcond=None)[0]
    return unknowns, float(np.sum(((columns @ unknowns - z) * weights) ** 2))


def _bends(r, z, weights):
    """Sum of squares and unknowns of the best line that bends at or after each inner reading.

    Between two readings, the two lines are fitted independently. If they do not meet in this
    interval, the best bend is at a reading.
    """
    columns = np.column_stack([np.ones(len(r)), r])
    for k in range(1, len(r) - 1):
        distance = r - r[k]
        bent = np.column_stack([np.ones(len(r)), np.minimum(distance, 0), np.maximum(distance, 0)])
        unknowns, squares = _squares(bent, z, weights)
        yield squares, (*unknowns, r[k])
        if k > len(r) - 3:
            continue
        parts = slice(k + 1), slice(k + 1, None)
        (inner, inner_squares), (outer, outer_squares) = (
            _squares(columns[i], z[i], weights[i]) for i in parts
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            x = (inner[0] - outer[0]) / (outer[1] - inner[1])
        if r[k] < x < r[k + 1]:
            yield inner_squares + outer_squares, (inner[0] + inner[1] * x, inner[1], outer[1], x)


# ---- figures and saved profiles


def assess_edges(lines, shell_radius_m, edge, bulge, *, file, log):
    """Compute the edge profile of each radial line, and the figures of edge and bulge.

    Parameters
    ----------
    lines : tuple of RadialLine
        Levelled profiles.
    shell_radius_m : float
        Radius of the shell, m.
    edge, bulge : EdgeLimits, BulgeLimits
        Limits of the rule.
    file : str
        Name of edge_profiles.csv.
    log : Log
        Receives warnings, and problems of lines that do not belong to this tank.

    Returns
    -------
    list of EdgeProfile
        One profile for each line.
    list of Figure
        The edge settlement, and the largest bulge if there is a bulge.
    """
    problem_count = len(log.problems)
    for line in lines:
        _check_reach(line, shell_radius_m, file, log)
    if len(log.problems) > problem_count or not lines:
        return [], []
    breaks = [find_break(item.radius_m, item.z_m, item.sd_m, shell_radius_m) for item in lines]
    profiles = [
        _profile(line, bend, shell_radius_m, edge) for line, bend in zip(lines, breaks, strict=True)
    ]
    figures = [_edge_figure(lines, profiles, breaks, edge), _bulge_figure(lines, breaks, bulge)]
    return profiles, [item for item in figures if item is not None]


def _check_reach(line, shell_radius_m, file, log):
    """Report lines that go beyond the shell, end far from it or have few readings near it."""
    last = float(line.radius_m[-1])
    if last > BEYOND_SHELL * shell_radius_m:
        text = message("edge_beyond_shell", "the line at {azimuth:g} degrees goes to {last:.4g} m,"
                       " beyond the shell at {shell:.4g} m; expected radii of this tank, in"
                       " metres", azimuth=line.azimuth_deg, last=last,
                       shell=shell_radius_m)  # fmt: skip
        log.problem(file, text, line.row, "radius_m")
    elif last < shell_radius_m - FAR_FROM_SHELL_M:
        text = message("edge_far_from_shell", "the line at {azimuth:g} degrees ends {gap:.3g} m"
                       " inside of the shell: to there its last slope is carried on",
                       azimuth=line.azimuth_deg, gap=shell_radius_m - last)  # fmt: skip
        log.warning(file, text, line.row, "radius_m")
    zone = ZONE * widest_edge(shell_radius_m)
    near = int(np.count_nonzero(line.radius_m >= shell_radius_m - zone))
    if near < LEAST_READINGS:
        text = message("edge_few_near_shell", "the line at {azimuth:g} degrees has {count} readings"
                       " within {zone:.3g} m of the shell; fewer than {least} do not tell where"
                       " its edge bends", azimuth=line.azimuth_deg, count=near, zone=zone,
                       least=LEAST_READINGS)  # fmt: skip
        log.warning(file, text, line.row, "radius_m")


def _profile(line, bend, shell_radius_m, edge):
    """The `EdgeProfile` of one line."""
    measured = {
        "azimuth_deg": line.azimuth_deg,
        "radius_m": line.radius_m.tolist(),
        "z_mm": (1000 * line.z_m).tolist(),
    }
    if bend is None:
        undetermined = dict.fromkeys(("break_radius_m", "width_m", "drop_mm", "U_mm", "limit_mm"))
        return EdgeProfile(**measured, **undetermined)
    width = shell_radius_m - bend.radius_m
    drop, u = bend.drop(shell_radius_m)
    return EdgeProfile(
        **measured,
        break_radius_m=bend.radius_m,
        width_m=width,
        drop_mm=1000 * drop,
        U_mm=1000 * u * float(coverage_factor(PROBABILITY, bend.dof)),
        limit_mm=largest_drop_mm(edge, width, 2 * shell_radius_m, line.weld_deg),
    )


def _edge_figure(lines, profiles, breaks, edge):
    """Figure of the line that decides the check of the edge settlement."""
    with_break = [i for i, profile in enumerate(profiles) if profile.drop_mm is not None]
    place = {"code": "edge_settlement", "unit": "mm", "used": len(profiles)}
    if not with_break:
        return Figure(value=None, U=None, k=None, dof=0.0, limit=None, remark="no_break", **place)
    limited = [i for i in with_break if profiles[i].limit_mm is not None]
    worst = max(
        limited or with_break,
        key=lambda i: severity(profiles[i].drop_mm, profiles[i].U_mm, profiles[i].limit_mm),
    )
    profile, bend = profiles[worst], breaks[worst]
    limit = None
    if profile.limit_mm is not None:
        limit = InspectionLimit("edge_settlement", profile.limit_mm, edge.clause, edge.verified)
    return Figure(
        value=profile.drop_mm,
        U=profile.U_mm,
        k=float(coverage_factor(PROBABILITY, bend.dof)),
        dof=bend.dof,
        limit=limit,
        azimuth_deg=profile.azimuth_deg,
        remark="edge_by_curves" if edge.curves else "edge_by_width",
        remark_values={
            "width_m": profile.width_m,
            "weld_deg": lines[worst].weld_deg,
            "below_inner_line_mm": profile.drop_mm + 1000 * bend.inner * profile.width_m,
        },
        **place,
    )


def _bulge_figure(lines, breaks, bulge):
    """Figure of the largest bulge or dent inside of the break-over points, or None."""
    ratio = bulge.height_per_radius_mm_m
    bulges = []
    for line, bend in zip(lines, breaks, strict=True):
        inside = line.radius_m <= (np.inf if bend is None else bend.radius_m)
        sd = None if line.sd_m is None else line.sd_m[inside]
        largest = find_bulge(line.radius_m[inside], line.z_m[inside], sd, ratio)
        if largest is not None:
            bulges.append((line, largest))
    if not bulges:
        return None
    normal = float(coverage_factor(PROBABILITY, np.inf))
    line, largest = max(bulges, key=lambda two: _bulge_severity(two[1], normal, ratio))
    k = normal if np.isfinite(largest.u_m) else None
    limit = None
    if ratio is not None:
        value = ratio * largest.half_length_m
        limit = InspectionLimit("bottom_bulge", value, bulge.clause, bulge.verified)
    return Figure(
        code="bottom_bulge",
        unit="mm",
        value=1000 * largest.height_m,
        U=None if k is None else 1000 * k * largest.u_m,
        k=k,
        dof=0.0 if k is None else np.inf,
        limit=limit,
        azimuth_deg=line.azimuth_deg,
        used=len(bulges),
        remark="bulge_place",
        remark_values={"radius_m": largest.radius_m, "half_length_m": largest.half_length_m},
    )


def _bulge_severity(bulge, k, ratio):
    """Sort key of a bulge, see `verdict.severity`; `ratio` is the limit, mm per m half length."""
    limit = None if ratio is None else ratio * bulge.half_length_m
    U = 1000 * k * bulge.u_m if np.isfinite(bulge.u_m) else None
    return severity(1000 * bulge.height_m, U, limit)


@dataclass(frozen=True)
class Bulge:
    """A bulge or dent in the line of the bottom.

    Attributes
    ----------
    radius_m : float
        Distance of its highest or lowest reading from the tank's centre, m.
    height_m, u_m : float
        Height, positive upwards, and its standard uncertainty, nan if unknown, m.
    half_length_m : float
        Half of its length along the profile, m.
    """

    radius_m: float
    height_m: float
    u_m: float
    half_length_m: float


def find_bulge(r, z, sd, height_per_radius=None):
    """Find the largest bulge or dent of a profile.

    The line of the bottom is the line of least absolute deviations through the readings on the
    bottom (`select_bottom_readings`). A bulge over less than half of the profile does not move this
    line. A bulge extends between two crossings of the profile with this line.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
        Ascending radii and elevations inside of the break-over point, m.
    sd : ndarray, shape (n,), or None
        Standard deviations of the elevations, m; None if unknown.
    height_per_radius : float, optional
        Limit of the height over the half length. If given, the bulge with the largest ratio is
        returned, else the highest bulge.

    Returns
    -------
    Bulge or None
        None if no three consecutive readings on one side of the line deviate from it significantly.

    Examples
    --------
    >>> r, z = np.arange(8.0), np.array([0.0, 0.0, 0.0, 0.02, 0.03, 0.02, 0.0, 0.0])
    >>> bulge = find_bulge(r, z, None)
    >>> bulge.height_m, bulge.half_length_m
    (0.03, 2.0)
    """
    if len(r) < LEAST_READINGS:
        return None
    flat = select_bottom_readings(r, z, sd)
    deviation = z - _line_of_least_deviations(r, z, flat)
    deviation[np.abs(deviation) < 1e-9] = 0.0  # rounding of the solver
    # Runs of readings on one side of the line; each change of sign starts a run.
    starts = np.flatnonzero(np.diff(np.sign(deviation), prepend=np.nan))
    bulges = []
    for i, j in pairwise((*starts, len(r))):
        if j - i < LEAST_IN_BULGE or deviation[i] == 0:
            continue
        place = i + int(np.argmax(np.abs(deviation[i:j])))
        # u of the reading and of the line below it. The variance of a line of least absolute
        # deviations is pi / 2 times the variance of the least-squares line.
        beside = r[flat] - r[flat].mean()
        leverage = 1 / len(beside) + (r[place] - r[flat].mean()) ** 2 / np.sum(beside**2)
        u = np.nan if sd is None else float(sd[place] * np.sqrt(1 + np.pi / 2 * leverage))
        if np.isnan(u) or abs(deviation[place]) > SIGNIFICANT * u:
            half = (_crossing(r, deviation, j - 1, j) - _crossing(r, deviation, i, i - 1)) / 2
            bulges.append(Bulge(float(r[place]), float(deviation[place]), u, float(half)))
    if height_per_radius is None:
        return max(bulges, key=lambda bulge: abs(bulge.height_m), default=None)
    return max(bulges, key=lambda bulge: abs(bulge.height_m) / bulge.half_length_m, default=None)


def select_bottom_readings(r, z, sd):
    """Select the readings of a profile that are on the bottom, not on a bulge.

    Of all lines through two readings, the line with the least median deviation is used. The
    readings near this line are selected. A line of least absolute deviations would not suffice: a
    bulge at one end of a profile tilts it, even if the bulge covers only a third of the readings.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
        Ascending radii and elevations, m.
    sd : ndarray, shape (n,), or None
        Standard deviations of the elevations, m; None if unknown.

    Returns
    -------
    ndarray of bool, shape (n,)
        At least half of the readings are selected.

    References
    ----------
    Rousseeuw P. J. (1984), Least median of squares regression; its scale by Rousseeuw & Leroy
    (1987), Robust regression and outlier detection, 5.1.

    Examples
    --------
    >>> z = np.array([0, 0.01, 0.02, 0.03, 0.09, 0.09])
    >>> select_bottom_readings(np.arange(6.0), z, None).tolist()
    [True, True, True, True, False, False]
    """
    trial = np.unique(np.linspace(0, len(r) - 1, min(len(r), MOST_ENDS)).round().astype(int))
    i, j = (trial[index] for index in np.triu_indices(len(trial), 1))
    slopes = (z[j] - z[i]) / (r[j] - r[i])
    deviations = np.abs(z - z[i, None] - slopes[:, None] * (r - r[i, None]))
    medians = np.median(deviations, axis=1)
    best = int(np.argmin(medians))
    # Robust scale with the correction for small samples, Rousseeuw & Leroy 5.1.
    scale = SD_OVER_MEDIAN * (1 + 5 / (len(r) - 2)) * medians[best]
    scale = np.maximum(scale, 0.0 if sd is None else sd)
    return deviations[best] <= np.maximum(ON_BOTTOM * scale, 1e-9)


def select_beside_bulge(r, z, weights, squares, least_radius):
    """Select the readings of a bent profile that are outside of its bulge or dent.

    A bulge is a run of readings inside of the bend that deviates from two straight lines. Each run
    is tested by the F test of a mean shift of each of its readings. The most significant run is the
    bulge, if its significance is below 0.1 % divided by the number of runs tested.

    Parameters
    ----------
    r, z, weights : ndarray, shape (n,)
        Ascending radii, elevations, and inverse standard deviations or ones.
    squares : float
        Weighted sum of squared residuals of the best bent line through all readings.
    least_radius : float
        Smallest radius at which the two lines may meet.

    Returns
    -------
    ndarray of bool, shape (n,), or None
        None if there is no bulge.

    References
    ----------
    Cook R. D. & Weisberg S. (1982), Residuals and influence in regression, 2.2.2: mean shifts,
    with Bonferroni's bound.

    Examples
    --------
    >>> r = np.arange(16.0)
    >>> z = np.maximum(r - 12, 0) * -0.05 + np.where((r > 5) & (r < 9), 0.04, 0.0)
    >>> np.flatnonzero(~select_beside_bulge(r, z, np.ones(16), 0.002, 10.0)).tolist()
    [6, 7, 8]
    """
    count = len(r)
    most = min(count // 2, count - LEAST_READINGS)
    ends = np.unique(np.linspace(0, count, min(count + 1, MOST_ENDS)).round().astype(int))
    i, j = (ends[inner] for inner in np.triu_indices(len(ends), 1))
    fits = (j - i >= LEAST_IN_BULGE) & (j - i <= most)
    i, j = i[fits, None], j[fits, None]
    outer = np.arange(LEAST_IN_BULGE, count - 1)  # the first reading outside of the bend
    # Prefix sums give each line without a fit of its own: the inner line without the run i to j,
    # and the outer line.
    parts = _sums(r, z, weights)
    inner, outer_line = _lines(parts[outer] - parts[j] + parts[i]), _lines(parts[-1] - parts[outer])
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (inner[0] - outer_line[0]) / (outer_line[1] - inner[1]) + r.mean()
    inside = outer - (j - i)  # readings of the inner line
    beyond = r[np.minimum(outer + 1, count - 1)]
    meets = (x >= np.minimum(r[i], r[outer - 2])) & (x <= beyond) & (x >= least_radius)
    allowed = (j <= outer) & (inside >= LEAST_IN_BULGE) & meets
    if not allowed.any() or squares <= ROUNDING * np.sum((weights * z) ** 2):
        return None
    remaining = np.where(allowed, np.maximum(inner[2] + outer_line[2], 1e-9 * squares), np.inf).min(
        axis=1
    )
    size, dof = j[:, 0] - i[:, 0], count - (j - i)[:, 0] - 4
    gained = np.maximum(squares - remaining, 0.0)
    chance = np.where(
        np.isfinite(remaining),
        scipy.stats.f.logsf(gained / size / (remaining / dof), size, dof),
        0.0,
    )
    best = int(np.lexsort((size, chance))[0])
    # Bonferroni's bound for the number of runs tested.
    if chance[best] > np.log(ALPHA / len(chance)):
        return None
    at = np.arange(count)
    return (at < i[best]) | (at >= j[best])


def _sums(r, z, weights):
    """Prefix sums (n + 1, 6) of w^2 (1, r, z, rr, rz, zz), with r and z about their means."""
    r, z = r - r.mean(), z - z.mean()
    columns = np.column_stack([np.ones(len(r)), r, z, r * r, r * z, z * z])
    return np.concatenate([np.zeros((1, 6)), np.cumsum(columns * weights[:, None] ** 2, axis=0)])


def _lines(sums):
    """Level at 0, slope and residual sum of squares of lines, from differences of `_sums`."""
    w, wr, wz, wrr, wrz, wzz = np.moveaxis(sums, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rr, rz, zz = wrr - wr * wr / w, wrz - wr * wz / w, wzz - wz * wz / w
        slope = rz / rr
        return (wz - slope * wr) / w, slope, np.maximum(zz - slope * rz, 0.0)


def _line_of_least_deviations(r, z, flat):
    """Elevations (n,) of the line of least absolute deviations through the readings `flat`."""
    count, centre, level = int(flat.sum()), r[flat].mean(), z[flat].mean()
    columns = sparse.csr_array(np.column_stack([np.ones(count), r[flat] - centre]))
    # Linear program: each residual is the difference of two non-negative unknowns, of least sum.
    eye = sparse.eye_array(count)
    solution = scipy.optimize.linprog(
        np.concatenate([np.zeros(2), np.ones(2 * count)]),
        A_eq=sparse.hstack([columns, eye, -eye]),
        b_eq=z[flat] - level,
        bounds=[(None, None)] * 2 + [(0, None)] * (2 * count),
    )
    return level + solution.x[0] + solution.x[1] * (r - centre)


def _crossing(r, deviation, last, beyond):
    """Radius of the zero of the deviation between two readings, or the end of the profile."""
    if not 0 <= beyond < len(r):
        return r[last]
    share = deviation[last] / (deviation[last] - deviation[beyond])
    return r[last] + share * (r[beyond] - r[last])
