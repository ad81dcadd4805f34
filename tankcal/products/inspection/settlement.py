"""Settlement of each epoch and between two epochs: tilted plane, out-of-plane part and figures.

The limit of S grows with the square of the spacing of the points. Three figures therefore describe
the out-of-plane settlement: S of all points, S of a subset with the spacing that the rule requires,
and the curvature, which is independent of the spacing. Each figure estimates the true value. The
bias of the largest reading and of R2 is removed by extrapolation to errors of 0
(`tankcal.products.inspection.out_of_plane`).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.gum.coverage import coverage_factor
from tankcal.messages import message
from tankcal.products.inspection.levelling import (
    Epoch,
    find_differences,
    is_within_noise,
    warn_about_points,
)
from tankcal.products.inspection.out_of_plane import (
    Curvature,
    Estimate,
    Neighbours,
    Plane,
    Statistic,
    curvature_rows,
    estimate_statistic,
    find_largest_curvature,
    find_neighbours,
    fit_plane,
    r_squared,
    select_subset,
    simulate_errors,
)
from tankcal.products.inspection.rules import PROBABILITY, Figure, compute_curvature_limit
from tankcal.record.inspection import Settlement, SettlementPoint

SAME_TANK = 1.25  # largest ratio of two radii of the same tank


@dataclass(frozen=True)
class Largest:
    """The S with the largest ratio to its limit, or the largest S without limits.

    Attributes
    ----------
    place : int
        Index of the point among all points.
    S_m, u_m : float
        Reading with its sign, and standard uncertainty, nan if unknown, m.
    limit_m : float or None
        Limit of |S| at this point, m.
    true : Estimate or None
        Estimate of the largest true |S|, converted to the limit of this point, m; None if no u is
        known.
    """

    place: int
    S_m: float
    u_m: float
    limit_m: float | None
    true: Estimate | None


@dataclass(frozen=True)
class SettlementResult:
    """Computed settlement of one epoch, or between two epochs, in m.

    Attributes
    ----------
    epoch : Epoch
        Epoch or difference of two epochs.
    dof, k : float
        Degrees of freedom and coverage factor of all uncertainties; 0 and nan if unknown.
    plane : Plane
        Tilted plane.
    r2, u_r2 : float
        R2 of the readings and its standard uncertainty.
    true_r2 : Estimate or None
        Estimate of the true R2.
    all_points, subset : Neighbours
        All points, and the subset with the spacing of the rule.
    S_m, u_S_m : ndarray, shape (n,)
        S of all points and its standard uncertainty.
    largest, largest_of_subset, largest_by_arc : Largest
        Largest S of all points, of the subset, and of all points with the limit that does not
        depend on the strength of the steel.
    limits_m : ndarray, shape (n,), or None
        Limits of |S| of all points.
    curvature : Curvature
        Largest curvature of the readings.
    u_curvature_per_m : float
        Standard uncertainty of the largest curvature, 1/m.
    true_curvature : Estimate or None
        Estimate of the largest true curvature, 1/m.
    curvature_limit_per_m : float or None
        Limit of the curvature, 1/m.
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
        epoch = self.epoch
        return epoch.name if epoch.since is None else f"{epoch.name} - {epoch.since}"


def assess_settlement(levelling, strength, limits, log):
    """Compute the settlement of all epochs and of their differences, and the figures.

    Each later epoch is compared with the first epoch, and the last epoch also with the previous
    epoch.

    Parameters
    ----------
    levelling : Levelling
        Epochs of settlement.csv.
    strength : Strength
        Diameter, height and steel of the tank.
    limits : SettlementLimits
        Limits of the rule.
    log : Log
        Receives warnings, and a problem if the points belong to another tank.

    Returns
    -------
    list of Settlement
        One item for each epoch, then for each difference.
    list of Figure
        Figures in the same order.
    """
    radius_m, told = levelling.radius_m, strength.diameter_m / 2
    if radius_m is not None and not 1 / SAME_TANK < radius_m / told < SAME_TANK:
        text = message("levels_other_tank", "the circle through the points has the radius"
                       " {radius:.4g} m, but the tank has {told:.4g} m; expected points of this"
                       " tank, in metres", radius=radius_m, told=told)  # fmt: skip
        log.problem(levelling.file, text, None, "x_m")
        return [], []
    for epoch in levelling.epochs:
        warn_about_points(epoch, levelling.file, strength.diameter_m, limits, log)
    epochs = [*levelling.epochs, *find_differences(levelling, log)]
    assessed = [assess(item, levelling.dof, strength, limits) for item in epochs]
    figures = [figure for item in assessed for figure in settlement_figures(item, limits)]
    return [make_settlement(item, strength, levelling.sd_known) for item in assessed], figures


def assess(epoch, dof, strength, limits):
    """Compute the settlement of an epoch or of a difference.

    Parameters
    ----------
    epoch : Epoch
        Elevations, m.
    dof : float
        Degrees of freedom of their standard uncertainties; 0 if these are unknown.
    strength : Strength
        Diameter, height and steel of the tank.
    limits : SettlementLimits
        Limits of the rule.

    Returns
    -------
    SettlementResult
    """
    azimuth, z, radius_m = epoch.azimuth_rad, epoch.z_m, strength.diameter_m / 2
    variance = np.full(len(z), np.nan) if not dof else epoch.u_m**2
    plane = fit_plane(azimuth, z)
    r2, gradient = r_squared(z, plane.residual_m)
    chosen = select_subset(
        azimuth,
        plane.residual_m,
        radius_m,
        arc_m=limits.subset_arc_m,
        least=limits.least_points,
    )
    every, subset = (find_neighbours(azimuth, radius_m, points) for points in (None, chosen))
    curvature_limit = compute_curvature_limit(limits, strength)
    S, u_S = _compute_S(every, plane, variance)
    every_limit, subset_limit = (
        None if curvature_limit is None else points.limits_m(curvature_limit)
        for points in (every, subset)
    )
    by_arc = None if limits.de_beer is None else every.arc_m / limits.de_beer
    # Harmonics up to h have 2 h + 1 unknowns, which must not exceed the number of points.
    highest = min(limits.highest_harmonic or len(z) // 4, (len(z) - 1) // 2)
    curvature = find_largest_curvature(azimuth, z, radius_m, highest)
    curvature_map = curvature_rows(azimuth, radius_m, highest, curvature.azimuth_rad)
    errors = simulate_errors(azimuth, z, epoch.u_m) if dof else None

    def true_value(statistic, reading):
        """Estimate of the true statistic, or None without uncertainties."""
        return None if errors is None else estimate_statistic(statistic, z, reading, errors)

    def largest_of(neighbours, limits_m):
        """`Largest` of the points of `neighbours`."""
        return _largest(neighbours, plane, variance, limits_m, true_value)

    largest = largest_of(every, every_limit)
    is_whole = len(subset.places) == len(every.places)  # avoids a second simulation
    return SettlementResult(
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
        true_curvature=true_value(Statistic(curvature_map, _largest_size), curvature.per_m),
        curvature_limit_per_m=curvature_limit,
    )


def _compute_S(neighbours, plane, variance):
    """S of the points of `neighbours` and its standard uncertainty, m."""
    rows = neighbours.operator @ plane.residual_operator
    return neighbours.operator @ plane.residual_m, np.sqrt(rows**2 @ variance)


def _u(gradient, variance):
    """Standard uncertainty of a function of independent elevations with these variances."""
    return float(np.sqrt(gradient**2 @ variance))


def _largest_size(values):
    """Largest |value| along the last axis, from shape (..., m) to (...)."""
    return np.max(np.abs(values), axis=-1)


def _share_statistic(plane):
    """`Statistic` of R2; its operator stacks the residuals and the deviations from the mean."""
    count = len(plane.residual_m)
    level = np.eye(count) - 1 / count

    def share(values):
        """R2 of stacked residuals and deviations; 1 for level points."""
        residual_squares, scatter = (
            np.sum(part**2, axis=-1) for part in np.split(values, 2, axis=-1)
        )
        return np.where(
            scatter > 0, 1 - residual_squares / np.where(scatter > 0, scatter, 1.0), 1.0
        )

    return Statistic(np.concatenate([plane.residual_operator, level]), share, most=1.0)


def _largest(neighbours, plane, variance, limits_m, true_value):
    """`Largest` of the points of `neighbours`."""
    S, u = _compute_S(neighbours, plane, variance)
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


# ---- figures and saved settlements


def settlement_figures(assessed, limits):
    """Figures of an `SettlementResult`, in the order of the report."""
    every, subset = assessed.all_points, assessed.subset
    figures = [_r2_figure(assessed, limits)]
    for code, largest, used in (
        ("settlement_all", assessed.largest, len(every.places)),
        ("settlement_subset", assessed.largest_of_subset, len(subset.places)),
    ):
        limit_mm = None if largest.limit_m is None else 1000 * largest.limit_m
        limit = limits.limit(code, limit_mm)
        figures.append(_S_figure(code, assessed, largest, limit, used))
    curvature = assessed.curvature
    figures.append(
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
        largest = assessed.largest_by_arc
        limit = limits.limit("settlement_de_beer", 1000 * largest.limit_m, limits.de_beer_clause)
        figures.append(_S_figure("settlement_de_beer", assessed, largest, limit, len(every.places)))
    return figures


def _figure(assessed, *, reading, u, true, **given):
    """`Figure` of the estimate of a true value, or of the reading if no u is known."""
    if true is None:
        values = {"value": reading, "U": None, "k": None}
    else:
        value = float(np.copysign(true.value, reading))
        values = {"value": value, "U": assessed.k * true.u, "k": assessed.k,
                 "reading": reading, "U_reading": assessed.k * u}  # fmt: skip
    return Figure(
        **values,
        dof=assessed.dof,
        epoch=assessed.label,
        **given,
    )


def _S_figure(code, assessed, largest, limit, used):
    """`Figure` of a largest S, in mm."""
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
    """`Figure` of R2, not determined if the elevations are level within their uncertainties."""
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


def make_settlement(assessed, strength, sd_known):
    """Build the `Settlement` of the record.

    Parameters
    ----------
    assessed : SettlementResult
        Computed settlement.
    strength : Strength
        Diameter of the tank, m.
    sd_known : bool
        Whether s_mm was given.
    """
    plane, epoch, k = assessed.plane, assessed.epoch, assessed.k
    circumference_m = np.pi * strength.diameter_m
    variance = epoch.u_m**2 if assessed.dof else np.full(len(epoch.z_m), np.nan)
    curvature = assessed.curvature
    return Settlement(
        epoch=epoch.name,
        since=epoch.since,
        a_mm=1000 * plane.a_m,
        p_mm=1000 * plane.p_m,
        q_mm=1000 * plane.q_m,
        b_mm=1000 * plane.b_m,
        U_b_mm=_finite_or_none(1000 * k * _u(plane.b_gradient(), variance)),
        highest_azimuth_deg=float(np.degrees(plane.highest_rad)),
        tilt_mm_per_m=1000 * plane.b_m / (strength.diameter_m / 2),
        R2=assessed.r2,
        sd_known=sd_known,
        arc_m=circumference_m / len(epoch.points),
        limit_mm=_mm_or_none(assessed.largest.limit_m),
        limit_half_mm=_mm_or_none(limit_of_every_second(assessed)),
        subset_arc_m=circumference_m / len(assessed.subset.places),
        subset_limit_mm=_mm_or_none(assessed.largest_of_subset.limit_m),
        harmonics=curvature.highest,
        curvature_per_m=curvature.per_m,
        U_curvature_per_m=_finite_or_none(k * assessed.u_curvature_per_m),
        curvature_limit_per_m=assessed.curvature_limit_per_m,
        points=[_point(assessed, i) for i in range(len(epoch.points))],
    )


def limit_of_every_second(assessed):
    """Limit of the largest S for neighbours at twice the spacing, m, or None without a limit."""
    curvature_limit, every, place = (
        assessed.curvature_limit_per_m,
        assessed.all_points,
        assessed.largest.place,
    )
    if curvature_limit is None:
        return None
    before = every.before_m[place] + every.before_m[place - 1]
    after = every.after_m[place] + every.after_m[(place + 1) % len(every.places)]
    return curvature_limit * before * after / 2


def _point(assessed, i):
    """`SettlementPoint` of point i."""
    epoch, plane, k = assessed.epoch, assessed.plane, assessed.k
    limits = assessed.limits_m
    return SettlementPoint(
        point=epoch.points[i],
        azimuth_deg=float(np.degrees(epoch.azimuth_rad[i])),
        z_mm=1000 * float(epoch.z_m[i]),
        s_mm=_finite_or_none(1000 * epoch.u_m[i]),
        fitted_mm=1000 * float(plane.fitted_m[i]),
        U_i_mm=1000 * float(plane.residual_m[i]),
        S_i_mm=1000 * float(assessed.S_m[i]),
        U_S_mm=_finite_or_none(1000 * k * assessed.u_S_m[i]),
        in_subset=i in assessed.subset.places,
        limit_mm=None if limits is None else 1000 * float(limits[i]),
    )


def _finite_or_none(value):
    """Value as float, or None if it is not finite."""
    return float(value) if np.isfinite(value) else None


def _mm_or_none(value_m):
    """Value in mm, or None for None."""
    return None if value_m is None else float(1000 * value_m)
