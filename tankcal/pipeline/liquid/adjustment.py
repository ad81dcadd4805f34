"""Adjustment of the metered runs of a job together with its geometry.

found = adjust_liquid(Geometry(job, survey))
body = join_body(found.known)

Volumes and columns are computed at the adjusted dips h + e, not at the dips as read (Gauss-Helmert
model):

    metered - T V(h + e0) + T A e0  =  T C z + T A e + ...,    V, A, C all at h + e0.

Columns at the dips as read would share their errors with the misclosures. For n steps with relative
standard uncertainty u, that would make the scale of the tank too small by n u^2.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.pipeline.liquid import (
    Known,
    Loaded,
    column_of,
    load_geometry,
    places_of,
    stack_columns,
)
from tankcal.tank.liquid import (
    Effect,
    Fill,
    LiquidAdjustment,
    ReadingEffects,
    ReducedSteps,
    RunEffect,
    adjust_steps,
    estimate_run_effect,
    fill_of,
    load_densities,
    reading_effects,
    reduce_steps,
)
from tankcal.uncertainty import Source, type_of

MOST_ROUNDS, SETTLED = 30, 1e-3  # largest number of steps of the sizes, and size of the last in sds
# Smallest decrease of chi-square by a step, and largest decrease that further steps may bring, both
# relative to chi-square over its degrees of freedom.
LEAST_GAIN, MOST_LEFT = 1e-7, 1e-2
HALVINGS = 12  # largest number of halvings of a step that leads to no tank or to a worse fit
ROUNDS = 6  # largest number of rounds over sizes, run effect and adjusted dips
# Largest changes in the last round: of the run effect, relative, and of a dip, in its sds.
RUN_SETTLED, DIPS_SETTLED = 0.01, 0.01
ROUNDING = 1e-9  # rounding error of chi-square
LOST = 1e-12  # smallest effect of readings, relative to the largest, that is kept
BOTTOM, FLEX, RUNS = "bottom_volume", "bottom_flex", "run_effect"
OUTSIDE_M = 0.001  # largest distance of a dip above or below the tank


@dataclass(frozen=True)
class LiquidFound:
    """Adjustment of metered runs with one geometry.

    Attributes
    ----------
    known : Known
    fill : Fill
        Steps between the dips.
    reduced : ReducedSteps
        Steps against the geometry with its adjusted sizes.
    loaded : Loaded
        Geometry under the calibrating liquid.
    readings : ReadingEffects
    adjusted : LiquidAdjustment
    run_effect : RunEffect
    before : ReducedSteps
        Steps against the geometry with its initial sizes.
    before_sd_m3 : ndarray, shape (n,)
        Standard deviations of the misclosures of `before`.
    misfit : float
        Chi-square of the misclosures with the sizes held, plus chi-square of the sizes.
    corrections_m : ndarray, shape (rows,)
        Corrections of the dips of all rows at which the geometry was computed; 0: as read.
    is_settled : bool
        True if no step of the sizes would improve the fit.
    """

    known: Known
    fill: Fill
    reduced: ReducedSteps
    loaded: Loaded
    readings: ReadingEffects
    adjusted: LiquidAdjustment
    run_effect: RunEffect
    before: ReducedSteps
    before_sd_m3: np.ndarray
    misfit: float
    corrections_m: np.ndarray
    is_settled: bool = True

    @property
    def adjusted_m(self):
        """Corrections (rows,) of the dips according to the adjustment, m; 0 for unused dips."""
        metering, corrections = self.known.geometry.job.liquid, np.zeros(len(self.corrections_m))
        effect = next(
            (group for group in self.adjusted.noise if group.kind == "dip_readings"), None
        )
        if effect is not None:
            rows = self.fill.dip_row
            corrections[rows] = metering.s_dip_m[rows] * self.adjusted.residuals(effect)[0]
        return corrections


def adjust_liquid(geometry):
    """Adjust the metered runs of a job together with a `Geometry`.

    Returns
    -------
    LiquidFound

    Raises
    ------
    InputError
        If a dip lies outside the tank, or if the runs do not determine the run effect.
    SolutionError
        If the steps cannot be adjusted.
    """
    fill = fill_of(geometry.job.liquid)
    if not len(fill):
        expected = message(
            "no_steps_by_liquid",
            "fewer than two levels count: no step was measured; expected two dips or more, or an "
            "empty start and a dip",
        )
        raise InputError(Problem(geometry.job.liquid.file, expected))
    latest = first = adjusted_at(geometry, fill, _run_effect)
    for _ in range(ROUNDS):
        # Sizes, run effect and adjusted dips depend on each other: iterate until none of them
        # changes.
        before, settled = latest, True
        if geometry.movable:
            latest = _move_sizes(latest, fill)
            settled = latest.is_settled
        latest = adjusted_at(latest.known.geometry, fill, _run_effect, latest.adjusted_m)
        latest = replace(latest, is_settled=settled)
        if _is_steady(before, latest):
            break
    if latest.is_settled:
        _refuse_dips_outside(latest.known.geometry, fill)
    return replace(latest, before=first.before, before_sd_m3=first.before_sd_m3)


def _is_steady(before, latest):
    """Whether a round changed neither the run effect nor the dips of the next round."""
    sd = latest.known.geometry.job.liquid.s_dip_m
    change_of_dips = np.abs(latest.adjusted_m - latest.corrections_m)
    change = abs(latest.run_effect.sd - before.run_effect.sd)
    is_same_run = change <= RUN_SETTLED * before.run_effect.sd
    return is_same_run and bool(np.all(change_of_dips <= DIPS_SETTLED * np.nan_to_num(sd)))


def _move_sizes(latest, fill):
    """Return the adjustment with the sizes at their estimates, by steps that never fit worse."""

    def same_run(*_):
        return latest.run_effect

    names = latest.known.geometry.movable
    for _ in range(MOST_ROUNDS):
        present = latest.known.geometry.moves
        targets, sd = _moves_of(latest, names)
        if max(abs(targets[name] - present.get(name, 0.0)) / sd[name] for name in names) < SETTLED:
            return latest
        improved = _search_step(latest, targets, fill, same_run)
        if improved is None or latest.misfit - improved.misfit < LEAST_GAIN * _spread(latest):
            break
        latest = improved
    # Decrease of chi-square that further linear steps could bring.
    possible_gain = latest.misfit - latest.adjusted.chi2
    return replace(latest, is_settled=bool(possible_gain < MOST_LEFT * _spread(latest)))


def _spread(adjustment):
    """Chi-square over its degrees of freedom, at least 1."""
    return max(adjustment.adjusted.chi2 / max(adjustment.adjusted.dof, 1), 1.0)


def _search_step(latest, targets, fill, run_effect):
    """Best `LiquidFound` between the present sizes and the targets, or None if all fit worse."""
    geometry, best = latest.known.geometry, None
    present = {name: geometry.moves.get(name, 0.0) for name in targets}
    # Halve the step until the fit gets worse again after an improvement.
    for share in (0.5**halving for halving in range(HALVINGS)):
        moves = {
            name: present[name] + share * (value - present[name]) for name, value in targets.items()
        }
        try:
            candidate = adjusted_at(
                geometry.moved_to(moves), fill, run_effect, latest.corrections_m
            )
        except SolutionError:  # no tank has these sizes
            continue
        if best is not None and candidate.misfit >= best.misfit:
            break
        if candidate.misfit <= latest.misfit * (1 + ROUNDING) + ROUNDING:
            best = candidate
    return best


def adjusted_at(geometry, fill, run_effect, corrections_m=None):
    """Adjust the runs with the geometry linearized at its present sizes.

    Parameters
    ----------
    geometry : Geometry
    fill : Fill
    run_effect : callable
        Function from (metering, misclosure, readings, effects) to a `RunEffect`.
    corrections_m : ndarray, shape (rows,), optional
        Corrections of the dips at which the geometry is computed; None: zero.

    Returns
    -------
    LiquidFound
    """
    metering = geometry.job.liquid
    if corrections_m is None:
        corrections_m = np.zeros(len(metering))
    densities = np.append(metering.density_kg_m3, load_densities(metering, fill))
    rows = fill.dip_row
    dips = metering.dip_m[rows] + corrections_m[rows]
    loaded = load_geometry(geometry, densities, dips, metering.shell_c[rows])
    reduced = reduce_steps(metering, fill, loaded.volume_m3, loaded.growth)
    linearization = loaded.volume_m3, loaded.area_m2 * loaded.growth, loaded.growth
    readings = reading_effects(metering, fill, reduced, *linearization)
    by_step = fill.differences(reduced.carried)
    sources = tuple(source.weighted(by_step) for source in loaded.sources)
    places = places_of(sources, geometry.job.inputs)
    moved_inputs = tuple(
        (places[name], geometry.moves.get(name, 0.0) / places[name].u) for name in geometry.movable
    )
    # The term T A e0 of the equation above: the dips are unknown about their values as read.
    held = reduced.misclosure_m3 + by_step @ (linearization[1] * corrections_m[rows])
    # Sizes already moved are unknowns about their initial values: restore their linear effect.
    misclosure = held.copy()
    for place, deviate in moved_inputs:
        misclosure += deviate * column_of(sources, place)
    effects = [Effect("geometry", stack_columns(sources, len(fill))), *readings.common]
    effects += _bottom_effects(geometry, metering, fill, loaded, by_step)
    by_density = by_step @ (loaded.by_density * metering.u_density_kg_m3)
    if np.any(by_density):
        effects.append(Effect("calibration_density", by_density[:, None]))
    run_result = run_effect(metering, misclosure, readings, effects)
    if run_result.sd > 0:
        effects.append(Effect(RUNS, readings.run_m3 * run_result.sd))
    adjusted = adjust_steps(misclosure, readings.noise, effects)
    known = [effect.columns for effect in (*readings.noise, *effects) if not effect.is_free]
    return LiquidFound(
        known=_results_for_body(
            geometry, (loaded, sources, moved_inputs), adjusted, (metering, fill, run_result)
        ),
        fill=fill,
        reduced=reduced,
        loaded=loaded,
        readings=readings,
        adjusted=adjusted,
        run_effect=run_result,
        before=reduced,
        before_sd_m3=np.sqrt(sum((columns**2).sum(axis=1) for columns in known)),
        misfit=_misfit(adjusted, held, moved_inputs),
        corrections_m=corrections_m,
    )


def _misfit(adjusted, misclosure, moved):
    """Chi-square of misclosures (n,) with the moved inputs held, plus their own chi-square."""
    if not moved:
        return adjusted.chi2
    geometry, *others = adjusted.effects
    # Inputs held at their values add no covariance to the misclosures; their deviates count. The
    # covariance without them is that of the columns times a root of I - P, P of the held inputs.
    rows = np.stack([place.row for place, _ in moved])
    shares, axes = np.linalg.eigh(np.eye(rows.shape[1]) - rows.T @ rows)
    kept = geometry.columns @ (axes * np.sqrt(np.maximum(shares, 0.0)))
    deviates = np.array([deviate for _, deviate in moved])
    fit = adjust_steps(misclosure, adjusted.noise, [replace(geometry, columns=kept), *others])
    return float(fit.chi2 + deviates @ deviates)


def _bottom_effects(geometry, metering, fill, loaded, by_step):
    """Effects of the bottom: its flexing, and the unknown volume below the first dip."""
    effects = []
    if metering.flex_sd_m3_per_m:
        head = by_step @ np.maximum(loaded.level_m, 0.0)
        effects.append(Effect(FLEX, metering.flex_sd_m3_per_m * head[:, None]))
    if bottom_is_free(geometry.job, fill):
        effects.append(Effect(BOTTOM, by_step.sum(axis=1)[:, None], is_free=True))
    return effects


def bottom_is_free(job, fill):
    """Whether a run from the empty tank alone determines the volume below the first dip.

    A surveyed bottom, or a declared cone or dish, determines this volume itself.
    """
    is_unknown = job.bottom.form in ("flat", "leaning") or not job.switches.bottom
    return job.tank.kind == "vertical" and is_unknown and bool(np.any(fill.from_empty))


def _run_effect(metering, misclosure, readings, effects):
    """`RunEffect` as declared, otherwise as estimated from the runs."""
    if metering.run_sd is not None:
        return RunEffect(metering.run_sd, np.inf, metering.run_sd)
    first = adjust_steps(misclosure, readings.noise, effects)
    estimated = estimate_run_effect(first.weight, misclosure, readings.run_m3)
    if estimated is None:
        expected = message(
            "run_effect_untold",
            "blank; expected by how much whole runs differ (0: not at all): the runs do not show "
            "it themselves",
        )
        raise InputError(Problem(SETTINGS_FILE, expected, column="liquid.run_ppm"))
    return estimated


def _results_for_body(geometry, geometry_parts, adjusted, liquid_parts):
    """`Known` of an adjustment, sufficient to compute any row."""
    loaded, sources, moved_inputs = geometry_parts
    metering, fill, run = liquid_parts
    place = adjusted.place("geometry")
    bottom, flex = adjusted.place(BOTTOM), adjusted.place(FLEX)
    has_bottom, has_flex = bottom.stop > bottom.start, flex.stop > flex.start
    by_flex = next(
        (effect.columns[:, 0] for effect in adjusted.effects if effect.kind == FLEX), None
    )
    sd = metering.flex_sd_m3_per_m
    return Known(
        geometry=geometry,
        z=adjusted.estimate[place],
        gain=adjusted.gain[place],
        sources=sources,
        liquid=_sources_of_liquid(adjusted, metering, fill, run),
        moved=moved_inputs,
        first_m=float(np.min(loaded.level_m)) if has_bottom else None,
        bottom_m3=float(adjusted.estimate[bottom][0]) if has_bottom else 0.0,
        bottom_gain=adjusted.gain[bottom][0] if has_bottom else None,
        flex=float(sd * adjusted.estimate[flex][0]) if has_flex else 0.0,
        flex_sd=sd if has_flex else 0.0,
        flex_gain=sd * adjusted.gain[flex][0] if has_flex else None,
        flex_column=by_flex,
        density_kg_m3=metering.density_kg_m3,
    )


def _sources_of_liquid(adjusted, metering, fill, run):
    """Sources of the uncertainty of the liquid itself, with columns by the misclosures."""
    sources = [
        Source(effect.kind, _reduce_columns(adjusted, effect.columns)) for effect in adjusted.noise
    ]
    for effect in adjusted.effects:
        if effect.kind == "meter_factor":
            sources += _meter_sources(effect, metering, fill)
        elif effect.kind == RUNS:
            sources.append(Source(RUNS, effect.columns, run.dof, type=type_of(run.dof)))
        elif effect.kind in COMMON:
            u, unit, value = COMMON[effect.kind](metering)
            sources.append(Source(effect.kind, effect.columns, u=u, unit=unit, estimate=value))
    return tuple(sources)


def _reduce_columns(adjusted, columns):
    """Columns (n, r) of readings, reduced to as many as affect the estimates."""
    names = [effect.kind for effect in adjusted.effects]
    places = [adjusted.place(kind) for kind in ("geometry", BOTTOM, FLEX) if kind in names]
    by_readings = np.vstack([adjusted.gain[place] for place in places]) @ columns
    # The singular vectors of the few rows of R' are those of by_readings = R' Q', turned by Q.
    basis, triangle = np.linalg.qr(by_readings.T)
    _, singular_values, turn = np.linalg.svd(triangle.T, full_matrices=False)
    rotation = turn @ basis.T
    return columns @ rotation[singular_values > LOST * np.max(singular_values, initial=0.0)].T


# Standard uncertainty, unit and estimate of common causes.
COMMON = {
    "dip_zero": lambda metering: (1000 * metering.u_dip_zero_m, "mm", 0.0),
    "liquid_expansion": lambda metering: (
        metering.u_expansion_per_k,
        "1/K",
        metering.expansion_per_k,
    ),
    "calibration_density": lambda metering: (
        metering.u_density_kg_m3,
        "kg/m3",
        metering.density_kg_m3,
    ),
}


def _meter_sources(effect, metering, fill):
    """One source per meter, from its certificate."""
    sources = []
    for name, column in zip(fill.meters, effect.columns.T, strict=True):
        meter = metering.meters[name]
        u, note = 1e6 * meter.u_factor, meter.certificate or name
        sources.append(Source("meter_factor", column[:, None], u=u, unit="ppm", note=note))
    return sources


def _moves_of(adjustment, names):
    """Total moves of inputs and their standard deviations, according to the adjustment.

    Both are dicts {input: value, SI}.
    """
    result, places = adjustment.adjusted, {}
    for place in places_of(adjustment.known.sources, adjustment.known.geometry.job.inputs).values():
        places[place.name] = place
    moves, sds = {}, {}
    geometry = result.effects[0].columns
    for name in names:
        place = places[name]
        moves[name] = float(place.u * (place.row @ adjustment.known.z))
        by_misclosures = geometry @ place.row
        # Posterior variance of the deviate: its prior variance less the part that the misclosures
        # determine.
        variance = max(
            float(place.row @ place.row - by_misclosures @ result.weight @ by_misclosures), 1e-12
        )
        sds[name] = place.u * np.sqrt(variance)
    return moves, sds


def _refuse_dips_outside(geometry, fill):
    """Raise InputError for dips above or below the tank."""
    metering, body = geometry.job.liquid, geometry.body()
    levels = metering.dip_m[fill.dip_row] + geometry.zero_m + geometry.shift_m
    low, high = body.lowest_m, body.highest_m
    problems = [
        Problem(
            metering.file,
            message(
                "dip_outside_filled",
                "found {dip:g}; expected {low:.4g} to {high:.4g} m, the dips of the tank",
                dip=float(metering.dip_m[row]),
                low=low - geometry.zero_m - geometry.shift_m,
                high=high - geometry.zero_m - geometry.shift_m,
            ),
            int(metering.row[row]),
            "dip_m",
        )
        for row, level in zip(fill.dip_row, levels, strict=True)
        if not low - OUTSIDE_M <= level <= high + OUTSIDE_M
    ]
    if problems:
        raise InputError(problems)
