"""The part of the record on the adjustment of the survey and its quality."""

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
    cameras_of,
    depth_of,
    fiducials_of,
    image_readings_of,
    instruments_of,
    photos_of,
    point_results_of,
    precision_of,
    systems_of,
)
from tankcal.record.columns import ArrayColumns, plain_if_short
from tankcal.record.schema import Columns, Finite, Saved, fill_from, key
from tankcal.record.texts import Text, text_of
from tankcal.survey.results import DatumReport, GroupOfReadings, Reading, Readings

CONFIDENCE = 0.95  # of the global test and of the intervals of variance factors
CHECKABLE = 1.0  # least redundancy of a group whose variance factor is judged


@dataclass(frozen=True, kw_only=True)
class AdjustedReading(Reading):
    """A value of an observation: the keys of `Reading`; infinite or unknown values are null."""

    controlled: bool = key("whether other readings would show an error of it")


@dataclass(frozen=True, kw_only=True)
class AdjustedGroup(GroupOfReadings):
    """A group of readings: the keys of `GroupOfReadings`, and the 95 % interval of its factor."""

    factor_low: float | None = key("lower end of the interval of `factor`")
    factor_high: float | None = key("upper end")
    verdict: str = key("a code: as_declared, worse, better, hardly_controlled, not_controlled")


class HeldValue(Saved):
    """A value that is held exactly, and the result of its release."""

    kind: str = key("of observation")
    ids: list[str] = key("names")
    element: str = key('"x", "omega", ...')
    file: str = key("where it was read")
    row: int | None = key("of the file")
    unit: str = key("of value, change, sd and mdb")
    value: float = key("held value")
    released: float | None = key("value estimated from the other readings")
    change: float | None = key("released minus value")
    sd: float | None = key("of the change")
    w: float | None = key("change over its sd")
    mdb: float = key("minimal detectable bias")
    effect_m: float = key("of a bias of the size mdb on a point")
    controlled: bool = key("whether other readings would show an error of it")


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
    """A shared cause of uncertainty, named in the budget."""

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
    """The adjustment of the survey and its quality."""

    sigma0: float = key("a posteriori; null: no redundancy")
    observations: int = key("values adjusted")
    unknowns: int = key("number")
    redundancy: int = key("of the whole adjustment")
    iterations: int = key("of the last adjustment")
    rounds: int = key("number of adjustments in the search for blunders")
    chi2: float = key("v'Pv")
    chi2_bounds: list[float] | None = key("two-sided bounds of chi2; null: no redundancy")
    confidence: Finite = key("of these bounds")
    passed: bool | None = key("whether chi2 lies between them")
    cov_scale: float = key("factor of every covariance of the record: 1, or sigma0 squared")
    scale: str = key('"a_priori" or "a_posteriori"')
    snooping: bool = key("whether blunders were searched for")
    critical_w: float = key("value of |w| above which a reading is rejected")
    critical_tau: float | None = key("of tau")
    alpha: Finite = key("level of the tests of single readings")
    power: Finite = key("of these tests, for the mdb")
    datum: DatumReport = key("definition of the frame")
    groups: list[AdjustedGroup] = key("kinds of observations and instruments")
    held: list[HeldValue] = key("values held exactly: sd 0")
    removed: list[AdjustedReading] = key("readings rejected, the worst first")
    residuals: Annotated[dict, Columns(AdjustedReading)] | None = key(
        "all readings, a list for each key; null: they are in the file of `long_tables`"
    )
    cameras: list[AdjustedCamera] = key("sets of interior parameters")
    photos: list[AdjustedPhoto] = key("each photo")
    image_readings: ImageReadings | None = key("repeated readings; null: each point was read once")
    fiducials: list[FiducialTransformation] = key("photos read on a comparator")
    depth_of_field: DepthCorrection | None = key("null: not requested")
    instruments: list[AdjustedInstrument] = key("each instrument")
    systems: list[ControlSystem] = key("further systems of control")
    setups: list[AdjustedSetup] = key("each set-up")
    points: list[AdjustedPoint] | None = key(
        "in the order of `points` of the record; null: they are in the file of `long_tables`"
    )
    precision: PointPrecision | None = key("null: every point is fixed")
    check_points: CheckedPoints | None = key("null: there are none")
    causes: list[SharedCause] = key("common to several points")
    aside: list[str] = key("sentences: points that could not be adjusted, with the reason")
    left_out: list[Text] = key("these sentences with their codes")


def adjustment_of(adjustment, measurements=None):
    """Return the `AdjustmentRecord` of an `Adjustment`.

    `measurements` are the `survey.measurements.Measurements` of the adjustment, with settings and
    image formats.
    """
    from tankcal.survey.network.reliability import tau_limit

    settings = getattr(measurements, "settings", None)
    test = adjustment.adjusted.test(CONFIDENCE)
    dof = adjustment.redundancy
    held = adjustment.readings.where(adjustment.readings.hold)
    return fill_from(
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
        held=list(map(_make_held_value, held, _are_controlled(held).tolist())),
        removed=_list_rejected(Readings.of(adjustment.removed)),
        residuals=_columns(adjustment.readings),
        cameras=cameras_of(adjustment, measurements),
        photos=photos_of(adjustment),
        image_readings=image_readings_of(adjustment.repeats),
        fiducials=fiducials_of(getattr(measurements, "fiducials", ())),
        depth_of_field=depth_of(adjustment.depth),
        instruments=instruments_of(adjustment, measurements),
        systems=systems_of(adjustment),
        setups=[fill_from(AdjustedSetup, setup) for setup in getattr(measurements, "setups", ())],
        points=point_results_of(adjustment, measurements),
        precision=precision_of(adjustment),
        check_points=_check_points(adjustment.check_points),
        causes=[fill_from(SharedCause, cause) for cause in adjustment.causes],
        left_out=[text_of(sentence) for sentence in adjustment.aside],
    )


def _list_rejected(readings):
    """Return the `AdjustedReading` of each rejected reading."""
    rows = zip(readings, _are_controlled(readings).tolist(), strict=True)
    return [AdjustedReading(**vars(reading), controlled=controlled) for reading, controlled in rows]


def _columns(readings):
    """Return the columns of all readings, up to 200 000, with the keys of `AdjustedReading`."""
    arrays = readings.columns | {"controlled": _are_controlled(readings)}
    columns = {
        name: column.tolist() if column.dtype == object else column
        for name, column in arrays.items()
    }
    return plain_if_short(ArrayColumns(columns))


def _are_controlled(readings):
    """Return whether other readings would show an error of each reading or held value, (n,)."""
    columns = readings.columns
    of_readings = readings.check | (columns["redundancy"] > UNCONTROLLED)
    return np.where(readings.hold, np.isfinite(columns["mdb"]), of_readings)


def _make_held_value(reading, controlled):
    # mdb = delta0 sd for a value that is released: the others determine it with sd.
    sd = reading.mdb / noncentrality(ALPHA, POWER) if controlled else None
    return fill_from(
        HeldValue,
        reading,
        released=reading.value + reading.w * sd if controlled else None,
        change=reading.w * sd if controlled else None,
        sd=sd,
        w=reading.w if controlled else None,
        controlled=controlled,
    )


def _group(group):
    """Return the `AdjustedGroup` of a group, with the interval of true over declared sd."""
    low = high = None
    if group.redundancy > UNCONTROLLED and np.isfinite(group.factor):
        # factor^2 redundancy / (true factor)^2 has a chi-square distribution.
        tail = (1 - CONFIDENCE) / 2
        square = group.factor**2 * group.redundancy
        bounds = 2 * gammaincinv(group.redundancy / 2, [1 - tail, tail])
        low, high = (float(np.sqrt(square / bound)) if bound > 0 else None for bound in bounds)
    verdict = _judge_group(group, low, high)
    return AdjustedGroup(**vars(group), factor_low=low, factor_high=high, verdict=verdict)


def _judge_group(group, low, high):
    if low is None and high is None:
        return "not_controlled"
    if group.redundancy < CHECKABLE:
        return "hardly_controlled"
    if low > 1:
        return "worse"
    return "better" if high < 1 else "as_declared"


def _check_points(check):
    if check is None:
        return None
    rows = zip(check.names, check.difference_m, check.sd_m, strict=True)
    points = [
        CheckPoint(
            name,
            *difference,
            *sd,
            size_m=float(np.sqrt(np.nansum(np.square(difference)))),
            largest_w=_largest_w(difference, sd),
        )
        for name, difference, sd in rows
    ]
    return fill_from(CheckedPoints, check, points=points)


def _largest_w(difference, sd):
    """Return the largest difference over its sd; None if no sd is known."""
    known = np.isfinite(difference) & np.isfinite(sd) & (np.asarray(sd) > 0)
    return float(np.max(np.abs(difference[known] / sd[known]))) if known.any() else None
