"""Settlement of each epoch and between two: the plane, what is out of it, and what is judged.

Three figures answer the same question, for the limit of S grows with the square of the spacing: S
with all points, S with a subset spaced as the text asks, and the curvature, which no spacing
changes. Each figure estimates the true value: the bias of the largest reading of many, and of R2,
is removed by extrapolation to errors of 0 (`tankcal.inspection.extrapolation`).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.gum.coverage import coverage_factor
from tankcal.inspection.epochs import Epoch, differences, is_within_noise, warn_of_points
from tankcal.inspection.extrapolation import Estimate, Statistic, estimate, simulate_errors
from tankcal.inspection.figures import PROBABILITY, Figure
from tankcal.inspection.out_of_plane import (
    Curvature,
    Neighbours,
    Plane,
    between_neighbours,
    curvature_rows,
    explained_share,
    fit_plane,
    largest_curvature_of,
    spaced_subset,
)
from tankcal.inspection.settlement_limits import largest_curvature
from tankcal.messages import message
from tankcal.record.inspection import Settlement, SettlementPoint

SAME_TANK = 1.25  # ratio of two diameters that are of one tank


@dataclass(frozen=True)
class Largest:
    """The S that is nearest its limit (or the largest, where there is none), and its limit.

    Attributes
    ----------
    place : int
        Of the point, among all.
    S_m, u_m : float
        Reading with its sign; standard uncertainty, nan: not known.
    limit_m : float or None
    true : Estimate or None
        Of the largest true |S|, at the limit of this place, m; None: no u is known.
    """

    place: int
    S_m: float
    u_m: float
    limit_m: float | None
    true: Estimate | None


@dataclass(frozen=True)
class Assessed:
    """What settlement of one epoch, or between two, comes to, in m.

    Attributes
    ----------
    epoch : Epoch
    dof, k : float
        Of all uncertainties; 0 and nan: none is known.
    plane : Plane
    r2, u_r2 : float
    true_r2 : Estimate or None
    all_points, subset : Neighbours
    S_m, u_S_m : ndarray, shape (n,)
        Of all points.
    largest, largest_of_subset, largest_by_arc : Largest
        Of all points, of the subset, and of all by the limit that has no strength in it.
    limits_m : ndarray, shape (n,), or None
        Of S of all points.
    curvature : Curvature
    u_curvature_per_m : float
    true_curvature : Estimate or None
    curvature_limit_per_m : float or None
    """

    epoch: Epoch
    dof: float
    k: float
    plane: Plane
    r2: float
    u_r2: float
    true_r2: Estimate | None
    all_points: Neighbours
    subset: Neighbours
    S_m: np.ndarray
    u_S_m: np.ndarray
    largest: Largest
    largest_of_subset: Largest
    largest_by_arc: Largest | None
    limits_m: np.ndarray | None
    curvature: Curvature
    u_curvature_per_m: float
    true_curvature: Estimate | None
    curvature_limit_per_m: float | None

    @property
    def label(self):
        """Name of the epoch, or "later - earlier"."""
        one = self.epoch
        return one.name if one.since is None else f"{one.name} - {one.since}"


def assess_settlement(levelling, strength, limits, log):
    """Settlement of every epoch and of their differences, and the figures that are judged.

    Each epoch stands against the first, and the last against the one before it.

    Parameters
    ----------
    levelling : Levelling
    strength : Strength
        Diameter, height and steel of the tank.
    limits : SettlementLimits
    log : Log
        Takes warnings, and a problem where the points are those of another tank.

    Returns
    -------
    list of Settlement, list of Figure
    """
    radius_m, told = levelling.radius_m, strength.diameter_m / 2
    if radius_m is not None and not 1 / SAME_TANK < radius_m / told < SAME_TANK:
        text = message("levels_other_tank", "the circle through the points has the radius"
                       " {radius:.4g} m, but the tank has {told:.4g} m; expected points of this"
                       " tank, in metres", radius=radius_m, told=told)  # fmt: skip
        log.problem(levelling.file, text, None, "x_m")
        return [], []
    for epoch in levelling.epochs:
        warn_of_points(epoch, levelling.file, strength.diameter_m, limits, log)
    epochs = [*levelling.epochs, *differences(levelling, log)]
    assessed = [assess(one, levelling.dof, strength, limits) for one in epochs]
    figures = [figure for one in assessed for figure in figures_of(one, limits)]
    return [settlement_of(one, strength, levelling.sd_known) for one in assessed], figures


def assess(epoch, dof, strength, limits):
    """`Assessed` of an Epoch; dof is of its uncertainties, 0: none is known."""
    azimuth, z, radius_m = epoch.azimuth_rad, epoch.z_m, strength.diameter_m / 2
    variance = np.full(len(z), np.nan) if not dof else epoch.u_m**2
    plane = fit_plane(azimuth, z)
    r2, gradient = explained_share(z, plane.residual_m)
    chosen = spaced_subset(
        azimuth,
        plane.residual_m,
        radius_m,
        arc_m=limits.subset_arc_m,
        least=limits.least_points,
    )
    every, subset = (between_neighbours(azimuth, radius_m, one) for one in (None, chosen))
    most = largest_curvature(limits, strength)
    S, u_S = _out_of_plane(every, plane, variance)
    every_limit, subset_limit = (
        None if most is None else one.limits_m(most) for one in (every, subset)
    )
    by_arc = None if limits.de_beer is None else every.arc_m / limits.de_beer
    highest = min(limits.highest_harmonic or len(z) // 4, (len(z) - 1) // 2)
    curvature = largest_curvature_of(azimuth, z, radius_m, highest)
    bends = curvature_rows(azimuth, radius_m, highest, curvature.azimuth_rad)
    errors = simulate_errors(azimuth, z, epoch.u_m) if dof else None

    def true_value(statistic, reading):
        return None if errors is None else estimate(statistic, z, reading, errors)

    def largest_of(neighbours, limits_m):
        return _largest(neighbours, plane, variance, limits_m, true_value)

    largest = largest_of(every, every_limit)
    is_whole = len(subset.places) == len(every.places)  # the same points: not simulated twice
    return Assessed(
        epoch=epoch,
        dof=dof,
        k=float(coverage_factor(PROBABILITY, dof)) if dof else np.nan,
        plane=plane,
        r2=r2,
        u_r2=_u(gradient, variance),
        true_r2=true_value(_share_statistic(plane), r2),
        all_points=every,
        subset=subset,
        S_m=S,
        u_S_m=u_S,
        largest=largest,
        largest_of_subset=largest if is_whole else largest_of(subset, subset_limit),
        largest_by_arc=None if by_arc is None else largest_of(every, by_arc),
        limits_m=every_limit,
        curvature=curvature,
        u_curvature_per_m=_u(curvature.gradient, variance),
        true_curvature=true_value(Statistic(bends, _largest_size), curvature.per_m),
        curvature_limit_per_m=most,
    )


def _out_of_plane(neighbours, plane, variance):
    """(S, its standard uncertainty) of the points of some neighbours."""
    rows = neighbours.operator @ plane.residual_operator
    return neighbours.operator @ plane.residual_m, np.sqrt(rows**2 @ variance)


def _u(gradient, variance):
    return float(np.sqrt(gradient**2 @ variance))


def _largest_size(values):
    """(...) largest |value| of the last axis of (..., m)."""
    return np.max(np.abs(values), axis=-1)


def _share_statistic(plane):
    """`Statistic` of R2: the operator holds what is out of the plane, then what is out of level."""
    count = len(plane.residual_m)
    level = np.eye(count) - 1 / count

    def share(values):
        left, scatter = (np.sum(one**2, axis=-1) for one in np.split(values, 2, axis=-1))
        return np.where(scatter > 0, 1 - left / np.where(scatter > 0, scatter, 1.0), 1.0)

    return Statistic(np.concatenate([plane.residual_operator, level]), share, most=1.0)


def _largest(neighbours, plane, variance, limits_m, true_value):
    S, u = _out_of_plane(neighbours, plane, variance)
    limits = np.ones(len(S)) if limits_m is None else limits_m
    at = int(np.argmax(np.abs(S) / limits))
    # Compare the points by their shares of the limits, and return to m at the limit of this place.
    rows = (neighbours.operator @ plane.residual_operator) * (limits[at] / limits)[:, None]
    return Largest(
        place=int(neighbours.places[at]),
        S_m=float(S[at]),
        u_m=float(u[at]),
        limit_m=None if limits_m is None else float(limits_m[at]),
        true=true_value(Statistic(rows, _largest_size), float(abs(S[at]))),
    )


# ---- what is judged, and what is saved


def figures_of(assessed, limits):
    """Figures of one Assessed, in the order of the papers."""
    every, subset = assessed.all_points, assessed.subset
    found = [_r2_figure(assessed, limits)]
    for code, one, used in (
        ("settlement_all", assessed.largest, len(every.places)),
        ("settlement_subset", assessed.largest_of_subset, len(subset.places)),
    ):
        value = None if one.limit_m is None else 1000 * one.limit_m
        limit = limits.limit(code, value)
        found.append(_S_figure(code, assessed, one, limit, used))
    curvature = assessed.curvature
    found.append(
        _figure(
            assessed,
            code="settlement_curvature",
            unit="1/m",
            reading=curvature.per_m,
            u=assessed.u_curvature_per_m,
            true=assessed.true_curvature,
            limit=limits.limit("settlement_curvature", assessed.curvature_limit_per_m),
            azimuth_deg=float(np.degrees(curvature.azimuth_rad)),
            used=len(every.places),
            remark="up_to_harmonic",
            remark_values={"highest": curvature.highest},
        )
    )
    if assessed.largest_by_arc is not None:
        one = assessed.largest_by_arc
        limit = limits.limit("settlement_de_beer", 1000 * one.limit_m, limits.de_beer_clause)
        found.append(_S_figure("settlement_de_beer", assessed, one, limit, len(every.places)))
    return found


def _figure(assessed, *, reading, u, true, **given):
    """`Figure` of a reading and of the estimate of its true value; without a u the reading."""
    if true is None:
        found = {"value": reading, "U": None, "k": None}
    else:
        value = float(np.copysign(true.value, reading))
        found = {"value": value, "U": assessed.k * true.u, "k": assessed.k,
                 "reading": reading, "U_reading": assessed.k * u}  # fmt: skip
    return Figure(
        **found,
        dof=assessed.dof,
        epoch=assessed.label,
        **given,
    )


def _S_figure(code, assessed, largest, limit, used):
    return _figure(
        assessed,
        code=code,
        unit="mm",
        reading=1000 * largest.S_m,
        u=1000 * largest.u_m,
        true=None if largest.true is None else largest.true.times(1000),
        limit=limit,
        azimuth_deg=float(np.degrees(assessed.epoch.azimuth_rad[largest.place])),
        used=used,
        remark="no_strength" if limit is None else None,
    )


def _r2_figure(assessed, limits):
    """R2, not determined where the elevations are level but for their errors."""
    noise = is_within_noise(assessed.epoch, assessed.dof)
    return _figure(
        assessed,
        code="settlement_cosine",
        unit="",
        reading=None if noise else assessed.r2,
        u=assessed.u_r2,
        true=None if noise else assessed.true_r2,
        limit=limits.limit("settlement_cosine", limits.least_r2),
        at_least=True,
        used=len(assessed.epoch.points),
        remark="within_noise" if noise else None,
    )


def settlement_of(assessed, strength, sd_known):
    """The `Settlement` of one Assessed, as it is saved."""
    plane, epoch, k = assessed.plane, assessed.epoch, assessed.k
    turn = np.pi * strength.diameter_m
    variance = epoch.u_m**2 if assessed.dof else np.full(len(epoch.z_m), np.nan)
    curvature = assessed.curvature
    return Settlement(
        epoch=epoch.name,
        since=epoch.since,
        a_mm=1000 * plane.a_m,
        p_mm=1000 * plane.p_m,
        q_mm=1000 * plane.q_m,
        b_mm=1000 * plane.b_m,
        U_b_mm=_known(1000 * k * _u(plane.b_gradient(), variance)),
        highest_azimuth_deg=float(np.degrees(plane.highest_rad)),
        tilt_mm_per_m=1000 * plane.b_m / (strength.diameter_m / 2),
        R2=assessed.r2,
        sd_known=sd_known,
        arc_m=turn / len(epoch.points),
        limit_mm=_in_mm(assessed.largest.limit_m),
        limit_half_mm=_in_mm(limit_of_every_second(assessed)),
        subset_arc_m=turn / len(assessed.subset.places),
        subset_limit_mm=_in_mm(assessed.largest_of_subset.limit_m),
        harmonics=curvature.highest,
        curvature_per_m=curvature.per_m,
        U_curvature_per_m=_known(k * assessed.u_curvature_per_m),
        curvature_limit_per_m=assessed.curvature_limit_per_m,
        points=[_point(assessed, i) for i in range(len(epoch.points))],
    )


def limit_of_every_second(assessed):
    """Limit of S where it is nearest its own, from the neighbours next but one; m or None."""
    most, every, at = assessed.curvature_limit_per_m, assessed.all_points, assessed.largest.place
    if most is None:
        return None
    before = every.before_m[at] + every.before_m[at - 1]
    after = every.after_m[at] + every.after_m[(at + 1) % len(every.places)]
    return most * before * after / 2


def _point(assessed, i):
    epoch, plane, k = assessed.epoch, assessed.plane, assessed.k
    limits = assessed.limits_m
    return SettlementPoint(
        point=epoch.points[i],
        azimuth_deg=float(np.degrees(epoch.azimuth_rad[i])),
        z_mm=1000 * float(epoch.z_m[i]),
        s_mm=_known(1000 * epoch.u_m[i]),
        fitted_mm=1000 * float(plane.fitted_m[i]),
        U_i_mm=1000 * float(plane.residual_m[i]),
        S_i_mm=1000 * float(assessed.S_m[i]),
        U_S_mm=_known(1000 * k * assessed.u_S_m[i]),
        in_subset=i in assessed.subset.places,
        limit_mm=None if limits is None else 1000 * float(limits[i]),
    )


def _known(value):
    return float(value) if np.isfinite(value) else None


def _in_mm(value_m):
    return None if value_m is None else float(1000 * value_m)
