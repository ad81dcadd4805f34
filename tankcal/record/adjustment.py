"""The part of the record that says how the survey was adjusted, and how good that is."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import gammaincinv

from tankcal.adjust import ALPHA, CRITICAL, POWER, UNCONTROLLED, noncentrality
from tankcal.record.adjusted import (
    AdjustedCamera,
    AdjustedInstrument,
    AdjustedPhoto,
    AdjustedPoint,
    ControlSystem,
    DepthCorrection,
    FiducialTransformation,
    ImageReadings,
    PointPrecision,
    adjusted_points_of,
    cameras_of,
    depth_of,
    fiducials_of,
    image_readings_of,
    instruments_of,
    photos_of,
    precision_of,
    systems_of,
)
from tankcal.record.columns import ArrayColumns, plain_if_short
from tankcal.record.schema import Columns, Finite, Saved, filled_from, key
from tankcal.record.texts import Text, text_of
from tankcal.survey.results import DatumReport, GroupOfReadings, Reading, Readings

CONFIDENCE = 0.95  # of the global test and of the intervals of variance factors
CHECKABLE = 1.0  # a group with less redundancy says next to nothing about its variance


@dataclass(frozen=True, kw_only=True)
class AdjustedReading(Reading):
    """A value of an observation: the keys of `Reading`; what is infinite or not known is null."""

    controlled: bool = key("whether others would show an error of it")


@dataclass(frozen=True, kw_only=True)
class AdjustedGroup(GroupOfReadings):
    """Is a group as good as declared? The keys of `GroupOfReadings`, and the 95 % interval."""

    factor_low: float | None = key("lower end of the interval of `factor`")
    factor_high: float | None = key("upper end")
    verdict: str = key("a code: as_declared, worse, better, hardly_controlled, not_controlled")


class HeldValue(Saved):
    """A value that holds exactly, and what its release would say of it."""

    kind: str = key("of observation")
    ids: list[str] = key("names")
    element: str = key('"x", "omega", ...')
    file: str = key("where it was read")
    row: int | None = key("of the file")
    unit: str = key("of value, change, sd and mdb")
    value: float = key("that is held")
    released: float | None = key("value that the others give")
    change: float | None = key("released minus value")
    sd: float | None = key("of the change")
    w: float | None = key("change over its sd")
    mdb: float = key("minimal detectable bias")
    effect_m: float = key("of such a bias on a point")
    controlled: bool = key("whether others would show an error of it")


class CheckPoint(Saved):
    """A check point: adjusted minus known."""

    point: str = key("name")
    dx_m: float = key("adjusted minus known")
    dy_m: float = key("adjusted minus known")
    dz_m: float = key("adjusted minus known")
    sx_m: float = key("sd of the difference")
    sy_m: float = key("sd of the difference")
    sz_m: float = key("sd of the difference")
    size_m: float = key("of the difference")
    largest_w: float | None = key("largest difference over its sd")


class CheckedPoints(Saved):
    """Check points against the adjustment."""

    points: list[CheckPoint] = key("each of them")
    r_xyz_m: float = key("root of the mean squared magnitude")
    largest_m: float = key("magnitude")
    mean_m: float = key("magnitude")


class SharedCause(Saved):
    """A shared cause of uncertainty that the budget names."""

    name: str = key("of the instrument")
    what: str = key('"instrument_scale" or "instrument_offset"')
    u: float = key("standard uncertainty")
    unit: str = key("ppm or mm")


class AdjustedSetup(Saved):
    """A set-up of an instrument on a station."""

    setup: str = key("name", of="name")
    station: str = key("name")
    instrument: str | None = key("name")
    height_m: float | None = key("of the instrument")


class AdjustmentRecord(Saved):
    """How the survey was adjusted, and how good that is."""

    sigma0: float = key("a posteriori; null: nothing is redundant")
    observations: int = key("values adjusted")
    unknowns: int = key("number")
    redundancy: int = key("of the whole")
    iterations: int = key("of the last adjustment")
    rounds: int = key("adjustments that the search for blunders took")
    chi2: float = key("v'Pv")
    chi2_bounds: list[float] | None = key("two-sided bounds of chi2; null: nothing is redundant")
    confidence: Finite = key("of these bounds")
    passed: bool | None = key("whether chi2 lies between them")
    cov_scale: float = key("factor of every covariance of the record: 1, or sigma0 squared")
    scale: str = key('"a_priori" or "a_posteriori"')
    snooping: bool = key("whether blunders were searched for")
    critical_w: float = key("beyond which a reading is rejected")
    critical_tau: float | None = key("of tau")
    alpha: Finite = key("level of the tests of single readings")
    power: Finite = key("of these tests, for the mdb")
    datum: DatumReport = key("what holds the frame")
    groups: list[AdjustedGroup] = key("kinds of observations and instruments")
    held: list[HeldValue] = key("values that hold exactly: sd 0")
    removed: list[AdjustedReading] = key("readings rejected, the worst first")
    residuals: Annotated[dict, Columns(AdjustedReading)] | None = key(
        "all readings, a list for each key; null: they are in the file of `long_tables`"
    )
    cameras: list[AdjustedCamera] = key("sets of interior parameters")
    photos: list[AdjustedPhoto] = key("each photo")
    image_readings: ImageReadings | None = key("repeated readings; null: each point was read once")
    fiducials: list[FiducialTransformation] = key("photos read on a comparator")
    depth_of_field: DepthCorrection | None = key("null: not asked for")
    instruments: list[AdjustedInstrument] = key("each instrument")
    systems: list[ControlSystem] = key("further systems of control")
    setups: list[AdjustedSetup] = key("each set-up")
    points: list[AdjustedPoint] | None = key(
        "in the order of `points` of the record; null: they are in the file of `long_tables`"
    )
    precision: PointPrecision | None = key("null: every point is fixed")
    check_points: CheckedPoints | None = key("null: there are none")
    causes: list[SharedCause] = key("that points have in common")
    aside: list[str] = key("sentences: points that could not be adjusted, and why")
    left_out: list[Text] = key("the same with their codes")


def adjustment_of(adjustment, measurements=None):
    """The `AdjustmentRecord` of an `Adjustment`.

    measurements  `job.Measurements` that it was made from: settings, formats of the images
    """
    from tankcal.survey.network.reliability import tau_limit

    settings = getattr(measurements, "settings", None)
    test = adjustment.adjusted.test(CONFIDENCE)
    dof = adjustment.redundancy
    return filled_from(
        AdjustmentRecord,
        adjustment,
        chi2=test.chi2,
        chi2_bounds=[test.low, test.high] if dof > 0 else None,
        confidence=CONFIDENCE,
        passed=bool(test.passed) if dof > 0 else None,
        scale=getattr(settings, "scale", "a_priori"),
        snooping=getattr(settings, "snooping", True),
        critical_w=CRITICAL,
        critical_tau=tau_limit(ALPHA, dof) if dof > 1 else None,
        alpha=ALPHA,
        power=POWER,
        groups=[_group(group) for group in adjustment.groups],
        held=_held(adjustment.readings),
        removed=_removed(Readings.of(adjustment.removed)),
        residuals=_columns(adjustment.readings),
        cameras=cameras_of(adjustment, measurements),
        photos=photos_of(adjustment),
        image_readings=image_readings_of(adjustment.repeats),
        fiducials=fiducials_of(getattr(measurements, "fiducials", ())),
        depth_of_field=depth_of(adjustment.depth),
        instruments=instruments_of(adjustment, measurements),
        systems=systems_of(adjustment),
        setups=[filled_from(AdjustedSetup, one) for one in getattr(measurements, "setups", ())],
        points=adjusted_points_of(adjustment, measurements),
        precision=precision_of(adjustment),
        check_points=_check_points(adjustment.check_points),
        causes=[filled_from(SharedCause, cause) for cause in adjustment.causes],
        left_out=[text_of(one) for one in adjustment.aside],
    )


def _removed(readings):
    """The `AdjustedReading` of each reading that was rejected."""
    rows = zip(readings, _controlled(readings).tolist(), strict=True)
    return [AdjustedReading(**vars(one), controlled=controlled) for one, controlled in rows]


def _columns(readings):
    """The columns of all readings, as `AdjustedReading` has them; there may be 200 000."""
    found = readings.columns | {"controlled": _controlled(readings)}
    columns = {
        name: column.tolist() if column.dtype == object else column
        for name, column in found.items()
    }
    return plain_if_short(ArrayColumns(columns))


def _controlled(readings):
    """(n,) whether others would show an error of readings, or of values that are held."""
    found = readings.columns
    of_others = readings.check | (found["redundancy"] > UNCONTROLLED)
    return np.where(readings.hold, np.isfinite(found["mdb"]), of_others)


def _held(readings):
    """The `HeldValue` of each value that holds exactly."""
    held = readings.where(readings.hold)
    return list(map(_held_value, held, _controlled(held).tolist()))


def _held_value(reading, controlled):
    sd = reading.mdb / noncentrality(ALPHA, POWER) if controlled else None
    return filled_from(
        HeldValue,
        reading,
        released=reading.value + reading.w * sd if controlled else None,
        change=reading.w * sd if controlled else None,
        sd=sd,
        w=reading.w if controlled else None,
        controlled=controlled,
    )


def _group(group):
    """The `AdjustedGroup` of a group: with the interval of its true sd over the declared one."""
    low = high = None
    if group.redundancy > UNCONTROLLED and np.isfinite(group.factor):
        tail = (1 - CONFIDENCE) / 2
        square = group.factor**2 * group.redundancy
        bounds = 2 * gammaincinv(group.redundancy / 2, [1 - tail, tail])
        low, high = (float(np.sqrt(square / one)) if one > 0 else None for one in bounds)
    verdict = _verdict(group, low, high)
    return AdjustedGroup(**vars(group), factor_low=low, factor_high=high, verdict=verdict)


def _verdict(group, low, high):
    if low is None and high is None:
        return "not_controlled"
    if group.redundancy < CHECKABLE:
        return "hardly_controlled"
    if low > 1:
        return "worse"
    return "better" if high < 1 else "as_declared"


def _check_points(found):
    if found is None:
        return None
    rows = zip(found.names, found.difference_m, found.sd_m, strict=True)
    points = [
        CheckPoint(
            name,
            *difference,
            *sd,
            size_m=float(np.sqrt(np.nansum(np.square(difference)))),
            largest_w=_largest(difference, sd),
        )
        for name, difference, sd in rows
    ]
    return filled_from(CheckedPoints, found, points=points)


def _largest(difference, sd):
    """Largest difference in its own sds; None where no sd is known."""
    known = np.isfinite(difference) & np.isfinite(sd) & (np.asarray(sd) > 0)
    return float(np.max(np.abs(difference[known] / sd[known]))) if known.any() else None
