"""Metered runs of a job adjusted with its geometry: what liquid and geometry make of the tank.

found = adjust_liquid(Geometry(job, survey))
body = join_body(found.known)

Volumes and columns are taken at the adjusted dips h + e, not at the dips as read (Gauss-Helmert):

    metered - T V(h + e0) + T A e0  =  T C z + T A e + ...,    V, A, C all at h + e0.

Columns at the dips as read share their errors with the misclosures. With many steps that makes the
scale of the tank too small by n u^2, n steps and u its relative standard uncertainty.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.pipeline.liquid_body import Known
from tankcal.pipeline.liquid_geometry import (
    Loaded,
    column_of,
    load_geometry,
    places_of,
    stacked,
)
from tankcal.tank.liquid import (
    Effect,
    Fill,
    LiquidAdjustment,
    Reduced,
    RunEffect,
    adjust_steps,
    estimate_run_effect,
    fill_of,
    reading_effects,
    reduce_steps,
)
from tankcal.tank.liquid.readings import ReadingEffects
from tankcal.tank.liquid.reduction import load_densities
from tankcal.uncertainty import Source

MOST_ROUNDS, SETTLED = 30, 1e-3  # steps to the joint values; the last, in sds
LEAST_GAIN, MOST_LEFT = 1e-7, 1e-2  # of a fit: by a step, and by all that could follow
HALVINGS = 12  # of a step that leads to no tank, or to a worse fit
ROUNDS = 6  # of the sizes, the run effect and the adjusted dips in turn
RUN_SETTLED, DIPS_SETTLED = 0.01, 0.01  # last change: relative; in sds of a dip
ROUNDING = 1e-9  # of a fit
LOST = 1e-12  # of the largest effect of readings: less is none
BOTTOM, FLEX, RUNS = "bottom_volume", "bottom_flex", "run_effect"
OUTSIDE_M = 0.001  # that a dip may stand above or below the tank


@dataclass(frozen=True)
class LiquidFound:
    """Metered runs, adjusted with one geometry.

    Attributes
    ----------
    known : Known
    fill : Fill
    reduced : Reduced
        Against the geometry, its sizes where liquid has them.
    loaded : Loaded
    readings : ReadingEffects
    adjusted : LiquidAdjustment
    run_effect : RunEffect
    before : Reduced
        Against the geometry as it was before; before_sd_m3 (n,) of its misclosures.
    corrections_m : ndarray, shape (rows,)
        Of the dips of all rows, at which the geometry was taken; 0: as read.
    misfit : float
        Chi-square with the sizes held where they are, and of the sizes.
    is_settled : bool
        Whether no step of the sizes would make a better fit.
    """

    known: Known
    fill: Fill
    reduced: Reduced
    loaded: Loaded
    readings: ReadingEffects
    adjusted: LiquidAdjustment
    run_effect: RunEffect
    before: Reduced
    before_sd_m3: np.ndarray
    misfit: float
    corrections_m: np.ndarray
    is_settled: bool = True

    @property
    def adjusted_m(self):
        """(rows,) corrections of the dips that the adjustment asks for; 0 where none counts."""
        metering, found = self.known.geometry.job.liquid, np.zeros(len(self.corrections_m))
        effect = next((one for one in self.adjusted.noise if one.kind == "dip_readings"), None)
        if effect is not None:
            rows = self.fill.dip_row
            found[rows] = metering.s_dip_m[rows] * self.adjusted.residuals(effect)[0]
        return found


def adjust_liquid(geometry):
    """`LiquidFound` of the metered runs of a job beside a `Geometry`.

    Raises
    ------
    InputError
        For dips outside the tank, and for a run effect that nothing tells.
    SolutionError
        When steps cannot be adjusted.
    """
    fill = fill_of(geometry.job.liquid)
    if not len(fill):
        expected = message(
            "no_steps_by_liquid",
            "fewer than two levels count: no step was measured; expected two dips or more, or an "
            "empty start and a dip",
        )
        raise InputError(Problem(geometry.job.liquid.file, expected))
    found = first = adjusted_at(geometry, fill, _run_effect)
    for _ in range(ROUNDS):
        before, settled = found, True
        if geometry.movable:
            found = _settled(found, fill)
            settled = found.is_settled
        found = adjusted_at(found.known.geometry, fill, _run_effect, found.adjusted_m)
        found = replace(found, is_settled=settled)
        if _is_steady(before, found):
            break
    if found.is_settled:
        _refuse_dips_outside(found.known.geometry, fill)
    return replace(found, before=first.before, before_sd_m3=first.before_sd_m3)


def _is_steady(before, found):
    """Whether a round changed neither the run effect nor the dips that the next one would take."""
    sd = found.known.geometry.job.liquid.s_dip_m
    moved = np.abs(found.adjusted_m - found.corrections_m)
    change = abs(found.run_effect.sd - before.run_effect.sd)
    is_same_run = change <= RUN_SETTLED * before.run_effect.sd
    return is_same_run and bool(np.all(moved <= DIPS_SETTLED * np.nan_to_num(sd)))


def _settled(found, fill):
    """The same with the sizes where liquid has them, by steps that never fit worse."""

    def same_run(*_):
        return found.run_effect

    names = found.known.geometry.movable
    for _ in range(MOST_ROUNDS):
        at = found.known.geometry.moves
        wanted, sd = _moves_of(found, names)
        if max(abs(wanted[name] - at.get(name, 0.0)) / sd[name] for name in names) < SETTLED:
            return found
        better = _better(found, wanted, fill, same_run)
        if better is None or found.misfit - better.misfit < LEAST_GAIN * _spread(found):
            break
        found = better
    left = found.misfit - found.adjusted.chi2
    return replace(found, is_settled=bool(left < MOST_LEFT * _spread(found)))


def _spread(found):
    """Chi-square over its degrees of freedom, 1 or more."""
    return max(found.adjusted.chi2 / max(found.adjusted.dof, 1), 1.0)


def _better(found, wanted, fill, run_effect):
    """The best `LiquidFound` on the way to what is wanted; None: nothing there fits better."""
    geometry, best = found.known.geometry, None
    at = {name: geometry.moves.get(name, 0.0) for name in wanted}
    for share in (0.5**halving for halving in range(HALVINGS)):
        moves = {name: at[name] + share * (value - at[name]) for name, value in wanted.items()}
        try:
            one = adjusted_at(geometry.moved_to(moves), fill, run_effect, found.corrections_m)
        except SolutionError:  # no such tank
            continue
        if best is not None and one.misfit >= best.misfit:
            break
        if one.misfit <= found.misfit * (1 + ROUNDING) + ROUNDING:
            best = one
    return best


def adjusted_at(geometry, fill, run_effect, corrections_m=None):
    """`LiquidFound` with the geometry linear where it is now, at dips with corrections (rows,)."""
    metering = geometry.job.liquid
    if corrections_m is None:
        corrections_m = np.zeros(len(metering))
    densities = np.append(metering.density_kg_m3, load_densities(metering, fill))
    rows = fill.dip_row
    dips = metering.dip_m[rows] + corrections_m[rows]
    loaded = load_geometry(geometry, densities, dips, metering.shell_c[rows])
    reduced = reduce_steps(metering, fill, loaded.volume_m3, loaded.growth)
    about = loaded.volume_m3, loaded.area_m2 * loaded.growth, loaded.growth
    readings = reading_effects(metering, fill, reduced, *about)
    over = fill.differences(reduced.carried)
    sources = tuple(one.weighted(over) for one in loaded.sources)
    places = places_of(sources, geometry.job.inputs)
    moved = tuple(
        (places[name], geometry.moves.get(name, 0.0) / places[name].u) for name in geometry.movable
    )
    held = reduced.misclosure_m3 + over @ (about[1] * corrections_m[rows])
    misclosure = held.copy()
    for place, deviate in moved:
        misclosure += deviate * column_of(sources, place)
    effects = [Effect("geometry", stacked(sources, len(fill))), *readings.common]
    effects += _of_the_bottom(geometry, metering, fill, loaded, over)
    by_density = over @ (loaded.by_density * metering.u_density_kg_m3)
    if np.any(by_density):
        effects.append(Effect("calibration_density", by_density[:, None]))
    run = run_effect(metering, misclosure, readings, effects)
    if run.sd > 0:
        effects.append(Effect(RUNS, readings.run_m3 * run.sd))
    adjusted = adjust_steps(misclosure, readings.noise, effects)
    every = [one.columns for one in (*readings.noise, *effects) if not one.is_free]
    return LiquidFound(
        known=_known(geometry, (loaded, sources, moved), adjusted, (metering, fill, run)),
        fill=fill,
        reduced=reduced,
        loaded=loaded,
        readings=readings,
        adjusted=adjusted,
        run_effect=run,
        before=reduced,
        before_sd_m3=np.linalg.norm(np.hstack(every), axis=1),
        misfit=_misfit(adjusted, held, sources, moved),
        corrections_m=corrections_m,
    )


def _misfit(adjusted, misclosure, sources, moved):
    """Chi-square of misclosures (n,) with the moved inputs held where they are, and of these."""
    if not moved:
        return adjusted.chi2
    held = np.stack([column_of(sources, place) for place, _ in moved], axis=1)
    every = [one.columns for one in (*adjusted.noise, *adjusted.effects)]
    whole = np.hstack(every)
    covariance = whole @ whole.T - held @ held.T
    deviates = np.array([deviate for _, deviate in moved])
    fit = misclosure @ np.linalg.solve(covariance, misclosure)
    return float(fit + deviates @ deviates)


def _of_the_bottom(geometry, metering, fill, loaded, over):
    """What lies below the first dip, where no geometry tells it, and what the bottom gives."""
    found = []
    if metering.flex_sd_m3_per_m:
        head = over @ np.maximum(loaded.level_m, 0.0)
        found.append(Effect(FLEX, metering.flex_sd_m3_per_m * head[:, None]))
    if bottom_is_free(geometry.job, fill):
        found.append(Effect(BOTTOM, over.sum(axis=1, keepdims=True), is_free=True))
    return found


def bottom_is_free(job, fill):
    """Whether a run from the empty tank measures what lies below the first dip, and nothing else.

    A bottom that was surveyed, or is declared as a cone or a dish, says that itself.
    """
    untold = job.bottom.form in ("flat", "leaning") or not job.switches.bottom
    return job.tank.kind == "vertical" and untold and bool(np.any(fill.from_empty))


def _run_effect(metering, misclosure, readings, effects):
    """`RunEffect` as declared, else as the runs show it."""
    if metering.run_sd is not None:
        return RunEffect(metering.run_sd, np.inf, metering.run_sd)
    without = adjust_steps(misclosure, readings.noise, effects)
    found = estimate_run_effect(without.weight, misclosure, readings.run_m3)
    if found is None:
        expected = message(
            "run_effect_untold",
            "blank; expected by how much whole runs differ (0: not at all): the runs do not show "
            "it themselves",
        )
        raise InputError(Problem(SETTINGS_FILE, expected, column="liquid.run_ppm"))
    return found


def _known(geometry, of_geometry, adjusted, of_liquid):
    loaded, sources, moved = of_geometry
    metering, fill, run = of_liquid
    place = adjusted.place("geometry")
    bottom, flex = adjusted.place(BOTTOM), adjusted.place(FLEX)
    has_bottom, has_flex = bottom.stop > bottom.start, flex.stop > flex.start
    by_flex = next((one.columns[:, 0] for one in adjusted.effects if one.kind == FLEX), None)
    sd = metering.flex_sd_m3_per_m
    return Known(
        geometry=geometry,
        z=adjusted.estimate[place],
        gain=adjusted.gain[place],
        sources=sources,
        liquid=_sources_of_liquid(adjusted, metering, fill, run),
        moved=moved,
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
    """Sources of what liquid itself leaves uncertain, columns by the misclosures."""
    found = [Source(one.kind, _telling(adjusted, one.columns), type="B") for one in adjusted.noise]
    for one in adjusted.effects:
        if one.kind == "meter_factor":
            found += _of_meters(one, metering, fill)
        elif one.kind == RUNS:
            kind = "B" if np.isinf(run.dof) else "A"
            found.append(Source(RUNS, one.columns, run.dof, type=kind))
        elif one.kind in COMMON:
            u, unit, value = COMMON[one.kind](metering)
            found.append(Source(one.kind, one.columns, u=u, unit=unit, type="B", estimate=value))
    return tuple(found)


def _telling(adjusted, columns):
    """(n, r) the same readings in as few columns as any estimate can tell apart."""
    names = [one.kind for one in adjusted.effects]
    used = [adjusted.place(kind) for kind in ("geometry", BOTTOM, FLEX) if kind in names]
    seen = np.vstack([adjusted.gain[place] for place in used]) @ columns
    _, size, turn = np.linalg.svd(seen, full_matrices=False)
    return columns @ turn[size > LOST * np.max(size, initial=0.0)].T


COMMON = {
    "dip_zero": lambda one: (1000 * one.u_dip_zero_m, "mm", 0.0),
    "liquid_expansion": lambda one: (one.u_expansion_per_k, "1/K", one.expansion_per_k),
    "calibration_density": lambda one: (one.u_density_kg_m3, "kg/m3", one.density_kg_m3),
}


def _of_meters(effect, metering, fill):
    found = []
    for name, column in zip(fill.meters, effect.columns.T, strict=True):
        meter = metering.meters[name]
        u, note = 1e6 * meter.u_factor, meter.certificate or name
        found.append(Source("meter_factor", column[:, None], u=u, unit="ppm", type="B", note=note))
    return found


def _moves_of(found, names):
    """({input: its move in all}, {input: sd}) that the adjustment asks for, SI."""
    adjusted, places = found.adjusted, {}
    for place in places_of(found.known.sources, found.known.geometry.job.inputs).values():
        places[place.name] = place
    wanted, sds = {}, {}
    geometry = adjusted.effects[0].columns
    for name in names:
        place = places[name]
        wanted[name] = float(place.u * (place.row @ found.known.z))
        seen = geometry @ place.row
        left = max(float(place.row @ place.row - seen @ adjusted.weight @ seen), 1e-12)
        sds[name] = place.u * np.sqrt(left)
    return wanted, sds


def _refuse_dips_outside(geometry, fill):
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
