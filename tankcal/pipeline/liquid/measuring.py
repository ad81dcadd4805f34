"""Calibration by liquid: its adjustment with the geometry, and its results.

Calibration by liquid in a job: its steps, its results, and the body of the printed table.

measured = measure_by_liquid(job, survey)
measured.body                                  body of the table
result = measured.result(levels_m)             `LiquidResult` at the rows of the table
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import gammaincc

from tankcal.adjust import noncentrality
from tankcal.errors import InputError, SolutionError
from tankcal.messages import join_with_or, message
from tankcal.pipeline.liquid import filled_range_m, geometry_alone, geometry_beside, join_body
from tankcal.pipeline.liquid.adjustment import (
    BOTTOM,
    FLEX,
    RUNS,
    LiquidFound,
    adjust_liquid,
    adjusted_at,
)
from tankcal.pipeline.tanks import Correction, body_of, filled_with, zero_height
from tankcal.tank.liquid import (
    Alternative,
    Verdict,
    as_fahrenheit,
    batch_sd_m3,
    fill_of,
    name_causes,
    reduce_steps,
    swapped,
)
from tankcal.uncertainty import combine


@dataclass(frozen=True)
class BesideTable:
    """Volumes at the rows of the printed table, according to one kind of information.

    Attributes
    ----------
    kind : {"geometry", "liquid", "joint"}
    volume_m3, u_m3, U_m3 : ndarray, shape (rows,)
        Volume, its standard and expanded uncertainty; nan where liquid alone has no dips.
    """

    kind: str
    volume_m3: np.ndarray
    u_m3: np.ndarray
    U_m3: np.ndarray


@dataclass(frozen=True)
class LiquidSteps:
    """Steps between used dips, arrays of shape (n,); volumes in m3.

    Attributes
    ----------
    row : ndarray of int
        Input row at the end of the step.
    run, meter : tuple of str
    from_dip_m, to_dip_m : ndarray
        Dips before and after the step; nan: from the empty tank.
    indicated_m3 : ndarray
        Indication of the meter.
    by_factor_m3, by_meter_temperature_m3, by_shell_m3, by_tank_temperature_m3, by_head_m3 : ndarray
        Corrections of the indication to the reference temperature and the liquid of the table.
    reference_m3 : ndarray
        Sum of the indication and its corrections.
    misclosure_m3, misclosure_sd_m3, misclosure_w : ndarray
        Liquid less geometry before the adjustment, its standard deviation, and their ratio.
    residual_m3 : ndarray
        Volume missing from the batch according to the joint adjustment.
    sd_m3, redundancy, w : ndarray
        Standard deviation of the batch before the adjustment, its redundancy, and its test
        quantity.
    detectable_m3 : ndarray
        Smallest error of the batch that the test would detect; inf: none.
    """

    row: np.ndarray
    run: tuple
    meter: tuple
    from_dip_m: np.ndarray
    to_dip_m: np.ndarray
    indicated_m3: np.ndarray
    by_factor_m3: np.ndarray
    by_meter_temperature_m3: np.ndarray
    by_shell_m3: np.ndarray
    by_tank_temperature_m3: np.ndarray
    by_head_m3: np.ndarray
    reference_m3: np.ndarray
    misclosure_m3: np.ndarray
    misclosure_sd_m3: np.ndarray
    misclosure_w: np.ndarray
    residual_m3: np.ndarray
    sd_m3: np.ndarray
    redundancy: np.ndarray
    w: np.ndarray
    detectable_m3: np.ndarray

    @property
    def sd(self):
        """Standard deviation of each batch, m3."""
        return self.sd_m3


@dataclass(frozen=True)
class LiquidDips:
    """Used dips, arrays of shape (d,).

    Attributes
    ----------
    row : ndarray of int
        Input row.
    run : tuple of str
    dip_m : ndarray
        Dip as read.
    residual_m : ndarray
        Correction to add to the dip.
    sd_m, redundancy, w : ndarray
        Standard deviation before the adjustment, redundancy and test quantity.
    """

    row: np.ndarray
    run: tuple
    dip_m: np.ndarray
    residual_m: np.ndarray
    sd_m: np.ndarray
    redundancy: np.ndarray
    w: np.ndarray

    @property
    def sd(self):
        """Standard deviation of each dip, m."""
        return self.sd_m


@dataclass(frozen=True)
class LiquidChecks:
    """Dips that are only compared, arrays of shape (c,).

    Attributes
    ----------
    row : ndarray of int
        Input row.
    run : tuple of str
    dip_m : ndarray
        Dip as read.
    difference_m, sd_m, w : ndarray
        Reading less prediction by all used readings, its standard deviation, and their ratio.
    """

    row: np.ndarray
    run: tuple
    dip_m: np.ndarray
    difference_m: np.ndarray
    sd_m: np.ndarray
    w: np.ndarray


@dataclass(frozen=True)
class Estimate:
    """A quantity with its value and standard uncertainty before and after the adjustment."""

    name: str
    before: float
    u_before: float
    after: float
    u_after: float


@dataclass(frozen=True)
class LiquidResult:
    """Results of metered runs and geometry of a tank, as an entry of `Result.surveys`.

    Attributes
    ----------
    certified : {"joint", "liquid", "geometry"}
        Basis of the printed table.
    steps : LiquidSteps
    dips : LiquidDips
    checks : LiquidChecks or None
        Dips that are only compared; None: there are none.
    runs : tuple of Estimate
        Effect of each run, relative.
    run_sd, run_dof : float
        Standard deviation of the run effect, relative, and its degrees of freedom (inf: declared).
    factors : tuple of Estimate
        Factor of each meter.
    bottom_flex : Estimate or None
        Flexing of the bottom, m3 per metre of head.
    bottom_m3 : Estimate or None
        Volume below the first dip beyond the volume by geometry; None: geometry determines it.
    sizes : tuple of Estimate
        Moves of inputs of the geometry by liquid, in SI.
    chi2, dof, probability : float
        Chi-square of all misclosures, its degrees of freedom, and the probability of a larger
        value.
    detectable_radius_m : float or None
        Smallest offset of all radii that the liquid would detect; None: without meaning.
    causes : tuple of Verdict
        Possible causes of the misclosures, the likeliest first; causes with `is_named` are
        reported.
    filled_m : tuple of (float, float)
        Lowest and highest used dip.
    tables : dict of {str: BesideTable}
        "geometry", "liquid" (None if liquid alone does not determine the tank) and "joint".
    """

    certified: str
    steps: LiquidSteps
    dips: LiquidDips
    checks: LiquidChecks | None
    runs: tuple[Estimate, ...]
    run_sd: float
    run_dof: float
    factors: tuple[Estimate, ...]
    bottom_flex: Estimate | None
    bottom_m3: Estimate | None
    sizes: tuple[Estimate, ...]
    chi2: float
    dof: int
    probability: float
    detectable_radius_m: float | None
    causes: tuple[Verdict, ...]
    filled_m: tuple[float, float]
    tables: dict[str, BesideTable]

    surveyed_as = "liquid"


def beside_table(kind, body, levels_m, probability, known=None):
    """Compute the `BesideTable` of a body.

    Parameters
    ----------
    kind : str
        "geometry", "liquid" or "joint".
    body : Body
    levels_m : array_like, shape (rows,)
        Levels of the rows.
    probability : float
        Coverage probability of U.
    known : ndarray of bool, shape (rows,), optional
        Rows with information; None: all rows.
    """
    levels = np.asarray(levels_m, dtype=float)
    known = np.full(len(levels), True) if known is None else known
    columns = {name: np.full(len(levels), np.nan) for name in ("volume_m3", "u_m3", "U_m3")}
    inside = np.clip(levels[known], body.lowest_m, body.highest_m)
    if len(inside):
        combined = combine(body.sources(inside), len(inside))
        columns["volume_m3"][known] = body.volume_m3(inside)
        columns["u_m3"][known] = combined.u
        columns["U_m3"][known] = combined.expanded(probability)
    return BesideTable(kind, **columns)


BALANCE = "balance"  # code of the principle: conservation of mass
BY_LIQUID = message("by_liquid", "adjusted together with the metered volumes")
OF_NO_WEIGHT_M = 1.0  # standard deviation of a dip without weight, m
# Causes that change all volumes: the effect of an undetectable size of them is reported.
CONTROLLED = ("meter", "leak")
MOST_TOLD = 3  # largest number of kinds of causes in a sentence
# Largest plausible errors: relative, of a meter factor; in m, of a zero, a dip or a radius.
MOST_FACTOR, MOST_LENGTH_M = 0.1, 0.5


@dataclass(frozen=True)
class Measured:
    """A tank measured by liquid, before its table is computed.

    Attributes
    ----------
    job : Job
    survey : object
    joint : LiquidFound
        Adjustment of geometry and liquid together.
    alone : LiquidFound or None
        Adjustment of liquid alone; None if it does not determine the tank.
    """

    job: object
    survey: object
    joint: LiquidFound
    alone: LiquidFound | None

    @cached_property
    def joint_body(self):
        """`JointBody` of geometry and liquid."""
        return join_body(self.joint.known)

    @cached_property
    def body_alone(self):
        """`JointBody` of liquid alone; None if it does not determine the tank."""
        return self.alone and join_body(self.alone.known)

    @property
    def body(self):
        """`Body` of the printed table."""
        basis = self.job.liquid.certified
        if basis == "geometry":
            return body_of(self.job, self.survey)
        return self.body_alone if basis == "liquid" else self.joint_body

    def body_for(self, density_kg_m3):
        """Return the `Body` of the printed table for a liquid of another density."""
        basis = self.job.liquid.certified
        if basis == "geometry":
            return body_of(filled_with(self.job, density_kg_m3), self.survey)
        printed = self.alone if basis == "liquid" else self.joint
        return join_body(printed.known, density_kg_m3)

    def correction(self, corrections, gross_m3, top_m3):
        """Return the `Correction` at the top row: the rest after all other corrections.

        Parameters
        ----------
        corrections : tuple of Correction
        gross_m3, top_m3 : float
            Volume at the top row without any correction, and according to the table.

        Returns
        -------
        Correction or None
            None if the table is that of the geometry.
        """
        if self.job.liquid.certified == "geometry":
            return None
        sum_m3 = sum(
            correction.size_m3
            for correction in corrections
            if correction.applied and correction.code != "tilt"
        )
        size = top_m3 - gross_m3 - sum_m3
        return Correction("liquid", True, size, 100 * size / gross_m3, BY_LIQUID, BALANCE)

    def result(self, levels_m):
        """Return the `LiquidResult` at the rows of a table."""
        return _compute_result(self, np.asarray(levels_m, dtype=float))


def measure_by_liquid(job, survey):
    """Return the `Measured` tank of a job with metered runs.

    Raises
    ------
    InputError, SolutionError
        As `liquid.adjustment.adjust_liquid`.
    """
    joint = _require_convergence(adjust_liquid(geometry_beside(job, survey)))
    try:
        alone = _require_convergence(adjust_liquid(geometry_alone(job, survey)))
    except (SolutionError, InputError):
        if job.liquid.certified == "liquid":
            raise
        alone = None
    return Measured(job, survey, joint, alone)


def _require_convergence(adjustment):
    """Return an adjustment that converged, otherwise raise SolutionError with the likely cause."""
    if adjustment.is_settled:
        return adjustment
    verdicts = [
        verdict
        for verdict in name_causes(adjustment.adjusted, alternatives_of(adjustment))
        if verdict.is_named
    ]
    if not verdicts:
        raise SolutionError(
            message(
                "liquid_does_not_settle",
                "the sizes of the tank do not settle with the runs by liquid: check the sizes in "
                "job.toml, their uncertainty, and the units of volumes and dips",
            )
        )
    raise SolutionError(
        message(
            "liquid_does_not_settle_because",
            "the sizes of the tank do not settle with the runs by liquid; the likeliest cause is "
            "{cause}",
            cause=causes_in_words(verdicts),
        )
    )


def _compute_result(measured, levels):
    """`LiquidResult` of a measured tank at given levels."""
    job, adjustment = measured.job, measured.joint
    adjusted, run_effect = adjustment.adjusted, adjustment.run_effect
    tables = _compute_tables(measured, levels)
    causes = _add_reliability(
        measured, name_causes(adjusted, alternatives_of(adjustment)), tables, levels
    )
    radius_verdict = next((verdict for verdict in causes if verdict.cause.kind == "radii"), None)
    detectable = (
        radius_verdict.detectable
        if radius_verdict and np.isfinite(radius_verdict.detectable)
        else None
    )
    return LiquidResult(
        certified=job.liquid.certified,
        steps=_list_steps(adjustment),
        dips=_list_dips(adjustment),
        checks=_compare_dips(adjustment),
        runs=_estimate_runs(adjustment),
        run_sd=run_effect.sd,
        run_dof=run_effect.dof,
        factors=_estimate_factors(adjustment),
        bottom_flex=_estimate_of_effect(adjustment, FLEX, adjustment.known.flex_sd),
        bottom_m3=_estimate_of_effect(adjustment, BOTTOM, 1.0, is_free=True),
        sizes=_estimate_sizes(adjustment),
        chi2=adjusted.chi2,
        dof=adjusted.dof,
        probability=float(gammaincc(adjusted.dof / 2, adjusted.chi2 / 2)) if adjusted.dof else 1.0,
        detectable_radius_m=detectable,
        causes=causes,
        filled_m=filled_range_m(job.liquid),
        tables=tables,
    )


def _add_reliability(measured, causes, tables, levels):
    """Add `undetected_U` to each `Verdict`: effect of an undetectable error on the table, in U."""
    basis = measured.job.liquid.certified
    if basis == "geometry":  # readings of the liquid do not change this table
        return causes
    body, U = measured.body, tables[basis].U_m3
    known = np.isfinite(U) & (U > 0)
    # The effect of an error is its smallest detectable size, times its column, times the
    # sensitivity of the volumes to the misclosures.
    by_y = body.by_misclosures(np.clip(levels[known], body.lowest_m, body.highest_m))

    def undetected(verdict):
        if verdict.cause.kind not in CONTROLLED or not np.any(known):
            return None
        if not np.isfinite(verdict.detectable):
            return np.inf
        return float(verdict.detectable * np.max(np.abs(by_y @ verdict.cause.column) / U[known]))

    return tuple(replace(verdict, undetected_U=undetected(verdict)) for verdict in causes)


def _compute_tables(measured, levels):
    """Tables by geometry, by liquid alone and by both."""
    job, probability = measured.job, measured.job.table.coverage_probability
    low, high = filled_range_m(job.liquid)
    dips = levels - zero_height(job, measured.survey)
    # Liquid alone gives volumes only between its lowest and highest dips.
    is_filled = (dips >= low - 1e-9) & (dips <= high + 1e-9)
    liquid = measured.body_alone
    if liquid is not None:
        liquid = beside_table("liquid", liquid, levels, probability, is_filled)
    geometry = measured.joint.known.geometry.moved_to({}).body()
    return {
        "geometry": beside_table("geometry", geometry, levels, probability),
        "liquid": liquid,
        "joint": beside_table("joint", measured.joint_body, levels, probability),
    }


def _list_steps(adjustment):
    """`LiquidSteps` of an adjustment."""
    metering, fill, before = (
        adjustment.known.geometry.job.liquid,
        adjustment.fill,
        adjustment.before,
    )
    rows = metering.row[fill.dip_row]
    dips = metering.dip_m[fill.dip_row]
    by_head = _head_corrections(adjustment)
    sd = batch_sd_m3(metering, fill)
    # An error of one batch changes its own misclosure only: the column of a unit vector.
    error, sd_of_error, w = adjustment.adjusted.test(-np.eye(len(fill)))
    return LiquidSteps(
        row=rows[fill.end],
        run=tuple(fill.runs[i] for i in fill.run),
        meter=tuple(metering.meter[fill.dip_row[i]] for i in fill.end),
        from_dip_m=np.where(fill.from_empty, np.nan, dips[fill.start]),
        to_dip_m=dips[fill.end],
        indicated_m3=before.indicated_m3,
        by_factor_m3=before.by_factor_m3,
        by_meter_temperature_m3=before.by_meter_temperature_m3,
        by_shell_m3=before.by_shell_m3,
        by_tank_temperature_m3=before.by_tank_temperature_m3,
        by_head_m3=by_head,
        reference_m3=before.increment_m3 + by_head,
        misclosure_m3=before.misclosure_m3,
        misclosure_sd_m3=adjustment.before_sd_m3,
        misclosure_w=before.misclosure_m3 / adjustment.before_sd_m3,
        # The redundancy is the variance of the batch over the variance of its estimated error.
        residual_m3=error * (sd / sd_of_error) ** 2,
        sd_m3=sd,
        redundancy=(sd / sd_of_error) ** 2,
        w=w,
        detectable_m3=noncentrality() * sd_of_error,
    )


def _head_corrections(adjustment):
    """Change (n,) of the increments by geometry, from the calibrating liquid to the table's."""
    geometry, fill = adjustment.known.geometry, adjustment.fill
    volumes = geometry.body().volume_m3(adjustment.loaded.level_m)
    return fill.differences() @ (volumes - adjustment.loaded.volume_m3)


def _list_dips(adjustment):
    """`LiquidDips` of an adjustment."""
    metering, fill = adjustment.known.geometry.job.liquid, adjustment.fill
    rows = fill.dip_row
    sd = metering.s_dip_m[rows]
    effect = next(
        (group for group in adjustment.adjusted.noise if group.kind == "dip_readings"), None
    )
    zeros = np.zeros(len(rows))
    deviates, redundancy, w = zeros, zeros, zeros
    if effect is not None:
        deviates, redundancy, w = adjustment.adjusted.residuals(effect)
    return LiquidDips(
        row=metering.row[rows],
        run=tuple(metering.run[i] for i in rows),
        dip_m=metering.dip_m[rows],
        residual_m=deviates * sd,
        sd_m=sd,
        redundancy=redundancy,
        w=w,
    )


def _compare_dips(adjustment):
    """`LiquidChecks` of dips that are only compared.

    A dip without weight in an adjustment gets the residual it would have as a check.
    """
    geometry = adjustment.known.geometry
    metering = geometry.job.liquid
    compared = ~metering.used & np.isfinite(metering.dip_m)
    if not np.any(compared):
        return None
    with_checks = replace(
        metering,
        used=np.full(len(metering), True),
        s_dip_m=np.where(compared, OF_NO_WEIGHT_M, metering.s_dip_m),
    )
    geometry = replace(geometry, job=replace(geometry.job, liquid=with_checks))
    repeated = adjusted_at(
        geometry, fill_of(with_checks), lambda *_: adjustment.run_effect, adjustment.corrections_m
    )
    effect = next(group for group in repeated.adjusted.noise if group.kind == "dip_readings")
    deviates, redundancy, _ = repeated.adjusted.residuals(effect)
    is_check = compared[repeated.fill.dip_row]
    places = repeated.fill.dip_row[is_check]
    # The residual has the uncertainty of the predicted dip; add the uncertainty of the reading.
    sd_of_prediction = OF_NO_WEIGHT_M * np.sqrt(np.maximum(1 - redundancy[is_check], 0.0))
    sd = np.hypot(sd_of_prediction, metering.s_dip_m[places])
    difference = -OF_NO_WEIGHT_M * deviates[is_check]
    return LiquidChecks(
        row=metering.row[places],
        run=tuple(metering.run[i] for i in places),
        dip_m=metering.dip_m[places],
        difference_m=difference,
        sd_m=sd,
        w=difference / sd,
    )


def _estimate_runs(adjustment):
    """Estimates of the effects of the runs, relative."""
    place, run_effect = adjustment.adjusted.place(RUNS), adjustment.run_effect
    if place.stop == place.start:
        return tuple(Estimate(name, 0.0, 0.0, 0.0, 0.0) for name in adjustment.fill.runs)
    pairs = zip(adjustment.adjusted.estimate[place], adjustment.adjusted.sd[place], strict=True)
    return tuple(
        Estimate(name, 0.0, run_effect.sd, float(run_effect.sd * z), float(run_effect.sd * sd))
        for name, (z, sd) in zip(adjustment.fill.runs, pairs, strict=True)
    )


def _estimate_factors(adjustment):
    """Estimates of the meter factors."""
    metering, place = (
        adjustment.known.geometry.job.liquid,
        adjustment.adjusted.place("meter_factor"),
    )
    z, sd = adjustment.adjusted.estimate[place], adjustment.adjusted.sd[place]
    estimates = []
    for number, name in enumerate(adjustment.fill.meters):
        meter = metering.meters[name]
        after, sd_left = (z[number], sd[number]) if len(z) else (0.0, 1.0)
        estimates.append(
            Estimate(
                name,
                meter.factor,
                meter.u_factor * meter.factor,
                float(meter.factor * (1 + meter.u_factor * after)),
                float(meter.u_factor * meter.factor * sd_left),
            )
        )
    return tuple(estimates)


def _estimate_of_effect(adjustment, kind, u, *, is_free=False):
    """Estimate of a single effect, or None if it is not in the adjustment."""
    place = adjustment.adjusted.place(kind)
    if place.stop == place.start:
        return None
    z, sd = adjustment.adjusted.estimate[place][0], adjustment.adjusted.sd[place][0]
    return Estimate(kind, 0.0, np.inf if is_free else u, float(u * z), float(u * sd))


def _estimate_sizes(adjustment):
    """Estimates of moved inputs, with their standard uncertainties."""
    adjusted, estimates = adjustment.adjusted, []
    columns = adjusted.effects[0].columns
    for place, deviate in adjustment.known.moved:
        seen = columns @ place.row
        # Posterior variance of the deviate: its prior variance less the part that the misclosures
        # determine.
        variance = float(place.row @ place.row - seen @ adjusted.weight @ seen)
        u = place.u * np.sqrt(max(variance, 0.0))
        estimates.append(Estimate(place.name, 0.0, place.u, float(place.u * deviate), float(u)))
    return tuple(estimates)


# ---- possible causes of the misclosures between liquid and geometry, as columns for tests


def alternatives_of(adjustment):
    """Return the possible causes of the misclosures of adjusted runs.

    The causes are meter, radii, dip zero, single dips and batches, leak, bottom, and temperatures.

    Parameters
    ----------
    adjustment : LiquidFound

    Returns
    -------
    tuple of Alternative
    """
    geometry, fill, reduced = adjustment.known.geometry, adjustment.fill, adjustment.reduced
    metering, loaded = geometry.job.liquid, adjustment.loaded
    over = fill.differences(reduced.carried)
    rows = metering.row[fill.dip_row]
    area = over.toarray() * loaded.area_m2
    causes = [
        Alternative("meter", column, name, most=MOST_FACTOR)
        for name, column in zip(fill.meters, _meter_columns(metering, fill, reduced), strict=True)
    ]
    length = {"unit": "m", "most": MOST_LENGTH_M}
    causes.append(Alternative("radii", over @ loaded.by_offset, **length))
    causes.append(Alternative("dip_zero", area.sum(axis=1), **length))
    causes += [Alternative("dip", column, int(row), **length)
             for row, column in zip(rows, area.T, strict=True)]  # fmt: skip
    filled = float(np.sum(np.abs(reduced.metered_m3)))
    causes += [Alternative("batch", column, int(row), "m3", most=filled)
             for row, column in zip(rows[fill.end], -np.eye(len(fill)), strict=True)]  # fmt: skip
    causes += _leak_causes(metering, fill)
    empty = fill.from_empty.astype(float)
    causes.append(Alternative("bottom", empty, unit="m3", most=filled))
    causes += _temperature_causes(metering, fill, loaded, reduced)
    return tuple(
        cause for cause in causes if np.any(cause.column) and np.all(np.isfinite(cause.column))
    )


def _meter_columns(metering, fill, reduced):
    """Effect (n,) of each meter factor on the misclosures."""
    meters = np.array(metering.meter)
    return [-fill.sum_rows(reduced.by_row_m3, meters == name) for name in fill.meters]


def _leak_causes(metering, fill):
    """Leaks of a valve at a steady rate, in all runs and in each run.

    The rate is in m3/h if all rows have times, otherwise in m3 per step.
    """
    hours = _step_hours(metering, fill)
    leaks = [Alternative("leak", hours, None, "m3/h" if _is_timed(metering) else "m3")]
    if len(fill.runs) > 1:
        leaks += [
            Alternative("leak", np.where(fill.run == number, hours, 0.0), name, leaks[0].unit)
            for number, name in enumerate(fill.runs)
        ]
    return leaks


def _is_timed(metering):
    """Whether all rows have a time."""
    return all(time is not None for time in metering.time)


def _step_hours(metering, fill):
    """Duration of each step, h, shape (n,); 1 without times."""
    if not _is_timed(metering):
        return np.ones(len(fill))
    moments = np.array(metering.time, dtype="datetime64[s]").astype(float) / 3600
    starts = {}
    for place, run in enumerate(metering.run):
        starts.setdefault(run, moments[place])
    first = np.array([starts[fill.runs[run]] for run in fill.run])
    ends = moments[fill.dip_row]
    # A step from the empty tank begins at the first row of its run.
    before = np.where(fill.from_empty, first, ends[fill.start])
    return ends[fill.end] - before


def _temperature_causes(metering, fill, loaded, reduced):
    """Confused temperatures: in degrees Fahrenheit, or of meter and tank exchanged."""
    causes = []
    for kind, rows in (("fahrenheit", as_fahrenheit(metering)), ("swapped", swapped(metering))):
        changed = reduce_steps(rows, fill, loaded.volume_m3, loaded.growth)
        column = reduced.misclosure_m3 - changed.misclosure_m3
        causes.append(Alternative(kind, column, unit="", is_whole=True))
    return causes


def causes_in_words(named):
    """Return named causes in one sentence: the likeliest of each kind.

    Parameters
    ----------
    named : sequence of Verdict
        Verdicts, the likeliest first.

    Returns
    -------
    Message
    """
    by_kind = {}
    for verdict in named:
        by_kind.setdefault(verdict.cause.kind, verdict)
    return join_with_or([_cause(verdict) for verdict in list(by_kind.values())[:MOST_TOLD]])


def _cause(verdict):
    """A cause in words, with its size."""
    size, name = verdict.size, verdict.cause.of
    match verdict.cause.kind:
        case "meter":
            return message("cause_meter", "the factor of meter {name}, off by {size:+.3f} %",
                           name=name, size=-100 * size)  # fmt: skip
        case "radii":
            return message("cause_radii", "the radii of the geometry, off by {size:+.1f} mm",
                           size=-1000 * size)  # fmt: skip
        case "dip_zero":
            return message("cause_dip_zero", "the zero of all dips, off by {size:+.1f} mm",
                           size=-1000 * size)  # fmt: skip
        case "dip":
            return message("cause_dip", "the dip of row {row}, off by {size:+.1f} mm",
                           row=name, size=-1000 * size)  # fmt: skip
        case "batch":
            return message("cause_batch", "the batch of row {row}, which lacks {size:+.3f} m3: is "
                           "a batch missing, or counted twice?", row=name, size=size)  # fmt: skip
        case "bottom":
            return message("cause_bottom", "the volume of the bottom, off by {size:+.3f} m3",
                           size=-size)  # fmt: skip
        case "leak":
            return message("cause_leak", "a valve that passes, {size:+.3f} {unit}", size=size,
                           unit=leak_unit(verdict.cause))  # fmt: skip
        case "fahrenheit":
            return message("cause_fahrenheit", "temperatures in degrees Fahrenheit")
    return message("cause_swapped", "temperatures at the meter and in the tank that changed places")


def is_steady_leak(verdict):
    """Whether a `Verdict` is about a leak in all runs."""
    return verdict.cause.kind == "leak" and verdict.cause.of is None


def leak_unit(cause):
    """Return the unit of the size of a leak for a message."""
    return cause.unit if cause.unit != "m3" else message("m3_a_step", "m3 a step")
