"""The part of the record that says how the survey was adjusted, and how good that is."""

from dataclasses import asdict, fields

import numpy as np
from scipy.special import gammaincinv

from tankcal.messages import as_plain
from tankcal.record.adjusted import (
    adjusted_points_of,
    cameras_of,
    instruments_of,
    photos_of,
    precision_of,
    systems_of,
)
from tankcal.record.images import depth_of, fiducials_of, image_readings_of
from tankcal.survey.network.reliability import UNCONTROLLED, noncentrality, tau_limit
from tankcal.survey.network.snooping import CRITICAL
from tankcal.survey.results import Reading

CONFIDENCE = 0.95  # of the global test and of the intervals of variance factors
ALPHA, POWER = 0.001, 0.80  # of the tests of single readings
CHECKABLE = 1.0  # a group with less redundancy says next to nothing about its variance


def adjustment_of(adjustment, measurements=None):
    """Statistics, groups, readings, instruments, cameras, photos, points of an `Adjustment`.

    measurements  `job.Measurements` that it was made from: settings, formats of the images
    """
    settings = getattr(measurements, "settings", None)
    return {
        **_statistics(adjustment, settings),
        "datum": _datum(adjustment.datum),
        "groups": [_group(group) for group in adjustment.groups],
        "held": [_held(reading) for reading in adjustment.readings if _holds(reading)],
        "removed": [_reading(reading) for reading in adjustment.removed],
        "residuals": _columns(adjustment.readings),
        "cameras": cameras_of(adjustment, measurements),
        "photos": photos_of(adjustment),
        "image_readings": image_readings_of(adjustment.repeats),
        "fiducials": fiducials_of(getattr(measurements, "fiducials", ())),
        "depth_of_field": depth_of(adjustment.depth),
        "instruments": instruments_of(adjustment, measurements),
        "systems": systems_of(adjustment),
        "setups": [
            {
                "setup": one.name,
                "station": one.station,
                "instrument": one.instrument,
                "height_m": one.height_m,
            }
            for one in getattr(measurements, "setups", ())
        ],
        "points": adjusted_points_of(adjustment, measurements),
        "precision": precision_of(adjustment),
        "check_points": _check_points(adjustment.check_points),
        "causes": [
            {"name": cause.name, "what": cause.what, "u": cause.u, "unit": cause.unit}
            for cause in adjustment.causes
        ],
        "aside": list(adjustment.aside),
        "left_out": [{"text": str(one), **as_plain(one)} for one in adjustment.aside],
    }


def _datum(datum):
    said = as_plain(datum.words)
    return {**asdict(datum), "words_code": said["code"], "words_values": said["values"]}


def _statistics(adjustment, settings):
    test = adjustment.adjusted.test(CONFIDENCE)
    redundant = adjustment.redundancy > 0
    return {
        "sigma0": adjustment.sigma0,
        "observations": adjustment.observations,
        "unknowns": adjustment.unknowns,
        "redundancy": adjustment.redundancy,
        "iterations": adjustment.iterations,
        "rounds": adjustment.rounds,
        "chi2": test.chi2,
        "chi2_bounds": [test.low, test.high] if redundant else None,
        "confidence": CONFIDENCE,
        "passed": bool(test.passed) if redundant else None,
        "cov_scale": adjustment.cov_scale,
        "scale": getattr(settings, "scale", "a_priori"),
        "snooping": getattr(settings, "snooping", True),
        "critical_w": CRITICAL,
        "critical_tau": tau_limit(ALPHA, adjustment.redundancy)
        if adjustment.redundancy > 1
        else None,
        "alpha": ALPHA,
        "power": POWER,
    }


def _reading(reading):
    """One reading; what is infinite (nothing controls it) is null in the record."""
    row = asdict(reading)
    row["ids"] = list(reading.ids)
    row["controlled"] = _controlled(reading)
    return row


def _columns(readings):
    """{key: values} of all readings, the keys being those of `_reading`; there may be 200 000."""
    columns = {one.name: [getattr(r, one.name) for r in readings] for one in fields(Reading)}
    columns["ids"] = [list(names) for names in columns["ids"]]
    columns["controlled"] = [_controlled(reading) for reading in readings]
    return columns


def _controlled(reading):
    """Whether others would show an error of a reading, or of a value that is held."""
    if _holds(reading):
        return bool(np.isfinite(reading.mdb))
    return bool(reading.check or reading.redundancy > UNCONTROLLED)


def _holds(reading):
    """Whether a value holds exactly: it has neither residual nor redundancy, but a reaction."""
    return reading.sd == 0 and not (reading.check or reading.removed)


def _held(reading):
    """What the release of a value that is held would say of it."""
    controlled = _controlled(reading)
    sd = reading.mdb / noncentrality(ALPHA, POWER) if controlled else None
    return {
        "kind": reading.kind,
        "ids": list(reading.ids),
        "element": reading.element,
        "file": reading.file,
        "row": reading.row,
        "unit": reading.unit,
        "value": reading.value,
        "released": reading.value + reading.w * sd if controlled else None,
        "change": reading.w * sd if controlled else None,
        "sd": sd,
        "w": reading.w if controlled else None,
        "mdb": reading.mdb,
        "effect_m": reading.effect_m,
        "controlled": controlled,
    }


def _group(group):
    """A group with the 95 % interval of its true sd over the declared one, and what follows."""
    row = asdict(group)
    low = high = None
    if group.redundancy > UNCONTROLLED and np.isfinite(group.factor):
        tail = (1 - CONFIDENCE) / 2
        square = group.factor**2 * group.redundancy
        bounds = 2 * gammaincinv(group.redundancy / 2, [1 - tail, tail])
        low, high = (float(np.sqrt(square / one)) if one > 0 else None for one in bounds)
    return {
        **row,
        "factor_low": low,
        "factor_high": high,
        "verdict": _verdict(group, low, high),
    }


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
    axes = ("x", "y", "z")
    return {
        "points": [
            {
                "point": name,
                **{f"d{axis}_m": value for axis, value in zip(axes, difference, strict=True)},
                **{f"s{axis}_m": value for axis, value in zip(axes, sd, strict=True)},
                "size_m": float(np.sqrt(np.nansum(np.square(difference)))),
                "largest_w": _largest(difference, sd),
            }
            for name, difference, sd in zip(
                found.names, found.difference_m, found.sd_m, strict=True
            )
        ],
        "r_xyz_m": found.r_xyz_m,
        "largest_m": found.largest_m,
        "mean_m": found.mean_m,
    }


def _largest(difference, sd):
    """Largest difference in its own sds; None where no sd is known."""
    known = np.isfinite(difference) & np.isfinite(sd) & (np.asarray(sd) > 0)
    return float(np.max(np.abs(difference[known] / sd[known]))) if known.any() else None
