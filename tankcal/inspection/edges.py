"""The bottom along radial lines: where its edge bends down, and by how much.

Two straight lines through the readings meet at the break-over point x. The edge is R - x wide, R
being the shell's radius, and drops by

    B = z(x) - z(R) = -m (R - x),    m the slope of the outer line

What bulges inside of there is found by `bulges`.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.adjust import ALPHA
from tankcal.gum.coverage import coverage_factor
from tankcal.inspection.bulges import beside_a_bulge, find_bulge
from tankcal.inspection.figures import PROBABILITY, Figure
from tankcal.inspection.levelling import LEAST_READINGS
from tankcal.inspection.settlement_limits import largest_drop_mm
from tankcal.inspection.verdict import gravity
from tankcal.messages import message
from tankcal.record.inspection import EdgeProfile, InspectionLimit

FAR_FROM_SHELL_M = 0.3  # of the last reading: from there to the shell the line is carried on
WIDEST_EDGE, WIDEST_EDGE_M = 0.3, 3.0  # of the radius, and in all
MOST_BULGES = 3  # of a profile that are rejected
ZONE = 3.0  # times that: the readings that the bent line goes through
BEYOND_SHELL = 1.02  # of the shell's radius: farther out is another unit, or another tank


@dataclass(frozen=True)
class Break:
    """The bent line through a profile.

    Attributes
    ----------
    radius_m, z_m : float
        Of the break-over point.
    inner, outer : float
        Slopes dz/dr inside and outside of it.
    cofactor : ndarray, shape (4, 4)
        Covariance of (z, inner, outer, radius), m2 and so on.
    dof : float
        Of it; inf where standard deviations were given.
    """

    radius_m: float
    z_m: float
    inner: float
    outer: float
    cofactor: np.ndarray
    dof: float

    def drop(self, shell_radius_m):
        """(B, its standard uncertainty) at the shell, m."""
        width = shell_radius_m - self.radius_m
        gradient = np.array([0.0, 0.0, -width, self.outer])
        return -self.outer * width, float(np.sqrt(gradient @ self.cofactor @ gradient))


def bent_line(r, unknowns):
    """(z (n,), Jacobian (n, 4)) of a line that bends, by its (z, inner, outer, radius).

    Examples
    --------
    >>> bent_line(np.array([1.0, 2.0, 3.0]), (0.5, 0.0, -0.1, 2.0))[0].round(3).tolist()
    [0.5, 0.5, 0.4]
    """
    z, inner, outer, x = unknowns
    inside = r < x
    off = r - x
    slope = np.where(inside, inner, outer)
    columns = [np.ones(len(r)), np.where(inside, off, 0.0), np.where(inside, 0.0, off), -slope]
    return z + slope * off, np.column_stack(columns)


def find_break(r, z, sd, shell_radius_m):
    """The break-over point of a profile, or None: its edge does not bend down (at 0.1 %).

    Sought within `widest_edge` of the shell, by the readings within three times that, but those
    of a bulge: its flank is no break (`bulges.beside_a_bulge`). What the bent line leaves of them
    counts where it is more than their standard deviations.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
        Rising radii and elevations, m.
    sd : ndarray, shape (n,), or None
        Standard deviations; None: by what the bent line leaves.
    shell_radius_m : float

    Returns
    -------
    Break or None
    """
    widest = widest_edge(shell_radius_m)
    near = r >= shell_radius_m - ZONE * widest
    r, z = r[near], z[near]
    weights = np.ones(len(r)) if sd is None else 1.0 / sd[near]
    best = _best_bend(r, z, weights, shell_radius_m - widest)
    for _ in range(MOST_BULGES):
        beside = best and beside_a_bulge(r, z, weights, best[0], shell_radius_m - widest)
        if beside is None:
            break
        r, z, weights = r[beside], z[beside], weights[beside]
        best = _best_bend(r, z, weights, shell_radius_m - widest)
    if best is None:
        return None
    squares, unknowns = best
    straight = _squares(np.column_stack([np.ones(len(r)), r]), z, weights)[1]
    dof, gained = len(r) - 4, straight - squares
    if unknowns[2] >= unknowns[1] or gained <= 1e-9 * straight:
        return None
    left = squares / dof
    if sd is not None and left <= 1:
        factor, chance = 1.0, scipy.stats.chi2.sf(gained, 2)
    else:
        factor, chance = left, scipy.stats.f.sf(gained / 2 / max(left, 1e-12 * gained), 2, dof)
    if chance > ALPHA:
        return None
    jacobian = bent_line(r, unknowns)[1] * weights[:, None]
    cofactor = factor * np.linalg.inv(jacobian.T @ jacobian)
    z_break, inner, outer, x = map(float, unknowns)
    return Break(x, z_break, inner, outer, cofactor, float(dof) if sd is None else np.inf)


def _best_bend(r, z, weights, least_radius):
    """(sum of squares, unknowns) of the best line that bends there or farther out, or None."""
    if len(r) < LEAST_READINGS:
        return None
    bends = [one for one in _bends(r, z, weights) if one[1][3] >= least_radius]
    return min(bends, key=lambda one: one[0], default=None)


def widest_edge(shell_radius_m):
    """Widest edge of a bottom that is looked for, m: 3 m, of small tanks 0.3 of the radius."""
    return min(WIDEST_EDGE_M, WIDEST_EDGE * shell_radius_m)


def _squares(columns, z, weights):
    """(unknowns, weighed sum of squares) of a linear fit."""
    unknowns = np.linalg.lstsq(columns * weights[:, None], z * weights, rcond=None)[0]
    return unknowns, float(np.sum(((columns @ unknowns - z) * weights) ** 2))


def _bends(r, z, weights):
    """(sum of squares, unknowns) of the best line that bends at or after each inner reading.

    Between two readings the two lines are free of each other; where they do not meet there, the
    best bend is at a reading.
    """
    columns = np.column_stack([np.ones(len(r)), r])
    for k in range(1, len(r) - 1):
        off = r - r[k]
        bent = np.column_stack([np.ones(len(r)), np.minimum(off, 0), np.maximum(off, 0)])
        unknowns, squares = _squares(bent, z, weights)
        yield squares, (*unknowns, r[k])
        if k > len(r) - 3:
            continue
        parts = slice(k + 1), slice(k + 1, None)
        (one, left), (two, right) = (_squares(columns[i], z[i], weights[i]) for i in parts)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = (one[0] - two[0]) / (two[1] - one[1])
        if r[k] < x < r[k + 1]:
            yield left + right, (one[0] + one[1] * x, one[1], two[1], x)


# ---- what is judged, and what is saved


def assess_edges(lines, shell_radius_m, edge, bulge, *, file, log):
    """EdgeProfile of each radial line, and the figures that are judged.

    Parameters
    ----------
    lines : tuple of RadialLine
    shell_radius_m : float
    edge, bulge : EdgeLimits, BulgeLimits
    file : str
        Name of edge_profiles.csv.
    log : Log
        Takes warnings, and problems of lines that are not of this tank.

    Returns
    -------
    list of EdgeProfile, list of Figure
    """
    before = len(log.problems)
    for line in lines:
        _check_reach(line, shell_radius_m, file, log)
    if len(log.problems) > before or not lines:
        return [], []
    breaks = [find_break(one.radius_m, one.z_m, one.sd_m, shell_radius_m) for one in lines]
    profiles = [
        _profile(line, found, shell_radius_m, edge)
        for line, found in zip(lines, breaks, strict=True)
    ]
    figures = [_edge_figure(lines, profiles, breaks, edge), _bulge_figure(lines, breaks, bulge)]
    return profiles, [one for one in figures if one is not None]


def _check_reach(line, shell_radius_m, file, log):
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


def _profile(line, found, shell_radius_m, edge):
    """The `EdgeProfile` of one line."""
    given = {
        "azimuth_deg": line.azimuth_deg,
        "radius_m": line.radius_m.tolist(),
        "z_mm": (1000 * line.z_m).tolist(),
    }
    if found is None:
        nothing = dict.fromkeys(("break_radius_m", "width_m", "drop_mm", "U_mm", "limit_mm"))
        return EdgeProfile(**given, **nothing)
    width = shell_radius_m - found.radius_m
    drop, u = found.drop(shell_radius_m)
    return EdgeProfile(
        **given,
        break_radius_m=found.radius_m,
        width_m=width,
        drop_mm=1000 * drop,
        U_mm=1000 * u * float(coverage_factor(PROBABILITY, found.dof)),
        limit_mm=largest_drop_mm(edge, width, 2 * shell_radius_m, line.weld_deg),
    )


def _edge_figure(lines, profiles, breaks, edge):
    """Figure of the line whose drop is nearest its limit, or the largest."""
    with_break = [i for i, one in enumerate(profiles) if one.drop_mm is not None]
    place = {"code": "edge_settlement", "unit": "mm", "used": len(profiles)}
    if not with_break:
        return Figure(value=None, U=None, k=None, dof=0.0, limit=None, remark="no_break", **place)
    limited = [i for i in with_break if profiles[i].limit_mm is not None]
    worst = max(limited or with_break, key=lambda i: _gravity(profiles[i]))
    one, found = profiles[worst], breaks[worst]
    limit = None
    if one.limit_mm is not None:
        limit = InspectionLimit("edge_settlement", one.limit_mm, edge.clause, edge.verified)
    return Figure(
        value=one.drop_mm,
        U=one.U_mm,
        k=float(coverage_factor(PROBABILITY, found.dof)),
        dof=found.dof,
        limit=limit,
        azimuth_deg=one.azimuth_deg,
        remark="edge_by_curves" if edge.curves else "edge_by_width",
        remark_values={
            "width_m": one.width_m,
            "weld_deg": lines[worst].weld_deg,
            "below_inner_line_mm": one.drop_mm + 1000 * found.inner * one.width_m,
        },
        **place,
    )


def _gravity(profile):
    return gravity(profile.drop_mm, profile.U_mm, profile.limit_mm)


def _bulge_figure(lines, breaks, bulge):
    """Figure of the largest bulge or dent inside of the break-over points; None: there is none."""
    ratio = bulge.height_per_radius_mm_m
    found = []
    for line, bend in zip(lines, breaks, strict=True):
        inside = line.radius_m <= (np.inf if bend is None else bend.radius_m)
        sd = None if line.sd_m is None else line.sd_m[inside]
        one = find_bulge(line.radius_m[inside], line.z_m[inside], sd, ratio)
        if one is not None:
            found.append((line, one))
    if not found:
        return None
    normal = float(coverage_factor(PROBABILITY, np.inf))
    line, one = max(found, key=lambda two: _gravity_of_bulge(two[1], normal, ratio))
    k = normal if np.isfinite(one.u_m) else None
    limit = None
    if ratio is not None:
        value = ratio * one.half_length_m
        limit = InspectionLimit("bottom_bulge", value, bulge.clause, bulge.verified)
    return Figure(
        code="bottom_bulge",
        unit="mm",
        value=1000 * one.height_m,
        U=None if k is None else 1000 * k * one.u_m,
        k=k,
        dof=0.0 if k is None else np.inf,
        limit=limit,
        azimuth_deg=line.azimuth_deg,
        used=len(found),
        remark="bulge_place",
        remark_values={"radius_m": one.radius_m, "half_length_m": one.half_length_m},
    )


def _gravity_of_bulge(bulge, k, ratio):
    """`gravity` of a bulge in mm; ratio  limit of its height, mm per metre of its half length."""
    limit = None if ratio is None else ratio * bulge.half_length_m
    U = 1000 * k * bulge.u_m if np.isfinite(bulge.u_m) else None
    return gravity(1000 * bulge.height_m, U, limit)
