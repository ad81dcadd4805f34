"""What runs of liquid would add to a geometry: U of rows and differences, causes, reliability."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.adjust import noncentrality
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.liquid_alone import filled_range_m
from tankcal.pipeline.liquid_body import join_body
from tankcal.planning.given import PLAN_FILE
from tankcal.uncertainty import combine

LEAST_SHARE = 0.01  # of the u of a cause: liquid that tells less of it tells nothing
UNCONTROLLED = 1e-4  # redundancy
SAME_M = 1e-6
OF_INSTRUMENTS = "instrument"  # kinds of causes that a note names the instrument of


@dataclass(frozen=True)
class DipOutlook:
    """What is foreseen of the volume below a dip.

    Attributes
    ----------
    dip_m : float
        From the table's zero, m.
    volume_m3 : float
        Below it.
    U_geometry_m3 : float
        Expanded uncertainty by geometry alone, as it is surveyed or declared, m3.
    U_liquid_m3 : float or None
        By liquid alone; None: beyond its dips, or liquid alone does not tell the tank.
    U_m3 : float
        By both.
    """

    dip_m: float
    volume_m3: float
    U_geometry_m3: float
    U_liquid_m3: float | None
    U_m3: float


@dataclass(frozen=True)
class DifferenceOutlook:
    """What is foreseen of the volume between two dips: a delivery.

    Attributes
    ----------
    low_m, high_m : float
        Its dips, m.
    volume_m3 : float
        Between them.
    U_geometry_m3 : float
        As of `DipOutlook`.
    U_m3 : float
        By geometry and liquid.
    """

    low_m: float
    high_m: float
    volume_m3: float
    U_geometry_m3: float
    U_m3: float


@dataclass(frozen=True)
class CauseOutlook:
    """A cause that liquid tells something of, or a meter.

    Attributes
    ----------
    kind : str
        As in the budget of a table.
    name : str
        Of the meter or the instrument; "": it is of all.
    unit : str
        Of both.
    u_before : float
        Standard uncertainty.
    u_after : float
        The same with liquid.
    """

    kind: str
    name: str
    unit: str
    u_before: float
    u_after: float


@dataclass(frozen=True)
class LiquidReadings:
    """How well batches, or dips, control one another.

    Attributes
    ----------
    kind : str
        "batches" or "dips".
    count : int
        How many.
    uncontrolled : int
        Of these, those that nothing else controls.
    redundancy : float
        Mean part of an error that shows.
    detectable : float or None
        Largest of the smallest errors that the test finds, m3 of batches, m of dips; None: all are
        uncontrolled.
    """

    kind: str
    count: int
    uncontrolled: int
    redundancy: float
    detectable: float | None


@dataclass(frozen=True)
class FillingOutlook:
    """What runs of liquid would give, before anybody fills the tank.

    Attributes
    ----------
    runs, batches : int
        How many.
    dips : tuple of DipOutlook
    differences : tuple of DifferenceOutlook
        Between neighbouring ones of these dips.
    causes : tuple of CauseOutlook
    readings : tuple of LiquidReadings
    redundancy : int
        Steps less what only they tell: degrees of freedom of their test together.
    detectable_radius_m : float or None
        Smallest offset of all radii of the geometry that liquid would show, m.
    run_sd : float
        Run effect, relative.
    run_dof : float or None
        Its degrees of freedom; None: it is declared.
    """

    runs: int
    batches: int
    dips: tuple[DipOutlook, ...]
    differences: tuple[DifferenceOutlook, ...]
    causes: tuple[CauseOutlook, ...]
    readings: tuple[LiquidReadings, ...]
    redundancy: int
    detectable_radius_m: float | None
    run_sd: float
    run_dof: float | None


def outlook_of_filling(plan, measured, result, made):
    """`FillingOutlook` of a WallPlan.

    Parameters
    ----------
    plan : WallPlan
    measured : Measured
    result : LiquidResult
    made : ComputedTable
    """
    dips = _dips_of(plan, made)
    bodies = _bodies(measured)
    rows = _rows(plan, bodies, dips, made)
    dof = result.run_dof
    return FillingOutlook(
        runs=len(plan.design.runs),
        batches=len(result.steps.row),
        dips=rows,
        differences=_differences(bodies, dips, made),
        causes=_causes(measured.joint),
        readings=_readings(result),
        redundancy=result.dof,
        detectable_radius_m=None if plan.design.is_metered_alone else result.detectable_radius_m,
        run_sd=result.run_sd,
        run_dof=float(dof) if np.isfinite(dof) else None,
    )


def _dips_of(plan, made):
    """Dips that are listed: those that the plan names, else those of the runs and the full tank."""
    if plan.dips_m:
        return np.array(plan.dips_m)
    filled = np.clip(filled_range_m(plan.job.liquid), made.table.height_m[0], made.top_m)
    return np.unique(np.round([*filled, made.top_m], 4))


def refuse_other_dips(dips_m, made):
    """Raise InputError for dips that a `ComputedTable` does not have."""
    low, top = float(made.table.height_m[0]), made.top_m
    beyond = [dip for dip in dips_m if not low - SAME_M <= dip <= top + SAME_M]
    if beyond:
        expected = message(
            "plan_dips_beyond",
            "found {dip:g}; expected {low:.4g} to {high:.4g} m, the dips of the table",
            dip=beyond[0],
            low=low,
            high=top,
        )
        raise InputError(Problem(PLAN_FILE, expected, None, "filling.dips_m"))


def _bodies(measured):
    """{"geometry", "liquid", "joint": Body}; None: liquid alone does not tell the tank."""
    joint = measured.joint.known
    return {
        "geometry": joint.geometry.moved_to({}).body(),
        "liquid": None if measured.alone is None else join_body(measured.alone.known),
        "joint": join_body(joint),
    }


def _expanded(body, levels, made, weights=None):
    """(n,) U of volumes at levels, or of sums of them with weights."""
    levels = np.clip(levels, body.lowest_m, body.highest_m)
    sources = body.sources(levels)
    if weights is not None:
        sources = [one.weighted(weights) for one in sources]
    return combine(sources, len(levels if weights is None else weights)).expanded(
        made.table.probability
    )


def _rows(plan, bodies, dips, made):
    levels = dips + made.zero_m
    low, high = filled_range_m(plan.job.liquid)
    inside = (dips >= low - SAME_M) & (dips <= high + SAME_M)
    found = {
        name: np.full(len(dips), np.nan) if body is None else _expanded(body, levels, made)
        for name, body in bodies.items()
    }
    liquid = np.where(inside, found["liquid"], np.nan)
    volumes = bodies["joint"].volume_m3(np.clip(levels, None, bodies["joint"].highest_m))
    columns = (dips, volumes, found["geometry"], liquid, found["joint"])
    return tuple(
        DipOutlook(float(dip), float(volume), float(by_geometry), _or_none(alone), float(U))
        for dip, volume, by_geometry, alone, U in zip(*columns, strict=True)
    )


def _differences(bodies, dips, made):
    if len(dips) < 2:
        return ()
    levels, over = dips + made.zero_m, np.diff(np.eye(len(dips)), axis=0)
    joint, geometry = bodies["joint"], bodies["geometry"]
    volumes = over @ joint.volume_m3(np.clip(levels, None, joint.highest_m))
    before, expanded = (_expanded(body, levels, made, over) for body in (geometry, joint))
    columns = (pairwise(dips), volumes, before, expanded)
    return tuple(
        DifferenceOutlook(float(low), float(high), float(volume), float(by_geometry), float(U))
        for (low, high), volume, by_geometry, U in zip(*columns, strict=True)
    )


def _or_none(number):
    return float(number) if np.isfinite(number) else None


def _causes(found):
    """Meters, and all other causes of one number that liquid tells something of."""
    adjusted, fill = found.adjusted, found.fill
    metering = found.known.geometry.job.liquid
    told = []
    columns = dict(zip(fill.meters, _columns(adjusted, "meter_factor", len(fill.meters)),
                       strict=True))  # fmt: skip
    for name in fill.meters:
        u = 1e6 * metering.meters[name].u_factor
        told.append(
            CauseOutlook("meter_factor", name, "ppm", u, u * _left(adjusted, columns[name]))
        )
    of_geometry = [one for one in found.known.sources if not one.parts]
    of_liquid = [one for one in found.known.liquid if one.kind != "meter_factor"]
    for one in (*of_geometry, *of_liquid):
        if one.u and one.unit and one.columns_m3.shape[1] == 1:
            left = _left(adjusted, one.columns_m3[:, 0])
            if left < 1 - LEAST_SHARE:
                name, u = one.note if one.kind.startswith(OF_INSTRUMENTS) else "", float(one.u)
                told.append(CauseOutlook(one.kind, name, one.unit, u, u * left))
    return tuple(told)


def _columns(adjusted, kind, count):
    for one in adjusted.effects:
        if one.kind == kind:
            return one.columns.T
    return [None] * count


def _left(adjusted, column):
    """Which part of its u a cause keeps; column (n,): what one u of it adds to the misclosures."""
    if column is None:
        return 1.0
    return float(np.sqrt(max(1.0 - column @ adjusted.weight @ column, 0.0)))


def _readings(result):
    delta, found = noncentrality(), []
    for kind, one in (("batches", result.steps), ("dips", result.dips)):
        shows = one.redundancy > UNCONTROLLED
        detectable = None
        if shows.any():
            detectable = float(np.max(delta * one.sd[shows] / np.sqrt(one.redundancy[shows])))
        mean = float(np.mean(one.redundancy)) if len(shows) else 0.0
        found.append(LiquidReadings(kind, len(shows), int(np.sum(~shows)), mean, detectable))
    return tuple(found)
