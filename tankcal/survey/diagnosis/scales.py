"""Does anything say that all measured lengths are too long? Check readings, and control apart."""

from itertools import combinations

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import list_some, message
from tankcal.survey.diagnosis.checks import DISAGREE, LISTED

LENGTHS = ("distance", "horizontal distance", "slope distance")
LEAST_SD_M = 0.001  # of a distance between two points of control
LEAST_LENGTH_M = 0.5
SHOWN = 3


def check_readings_off(readings):
    """Problem rows of check readings that differ by more than their uncertainty allows.

    readings  Readings, those with check=True are looked at
    """
    problems = []
    w, value = readings.columns["w"], readings.columns["value"]
    off = readings.check & np.isfinite(w) & (np.abs(w) > DISAGREE) & (value != 0)
    for one in readings.where(off & readings.are(*LENGTHS)):
        text = message(
            "check_reading_off",
            "the check reading {reading} differs by {times:.1f} times its standard deviation "
            "from the value that the adjusted points give ({difference_ppm:+.0f} ppm of its "
            "value): is the scale wrong, or this reading?",
            reading=message(
                "length_between", "{kind} {ids}", kind=one.kind, ids="-".join(map(str, one.ids))
            ),
            times=abs(one.w),
            difference_ppm=1e6 * one.residual / one.value,
        )
        problems.append(Problem(one.file, text, one.row))
    return problems[:LISTED]


def scale_of_control(adjusted, readings, measurements, cov_scale=1.0):
    """A Problem row when the distances between points of control are not those that were given.

    What was set aside no longer holds the scale: the adjusted distances are compared with the given
    ones, and so is every length that was read between two points of control. A difference counts
    against the sds of both sides: a datum of one point, or of inner constraints, holds no distance.
    """
    table = measurements.control
    if table is None:
        return []
    place = _plan(table)
    found = [*_adjusted(adjusted, place, cov_scale), *_read(readings, place, measurements)]
    off = [(ratio, names) for ratio, sd, names in found if abs(ratio) > DISAGREE * sd]
    signs = {np.sign(ratio) for ratio, _ in off}
    if not off or len(signs) > 1:
        return []
    pairs = list(dict.fromkeys("-".join(sorted(names)) for _, names in off))
    text = message(
        "control_scale",
        "the readings make the distances between points of control {scale_ppm:+.1f} ppm longer than"
        " given ({points}): {hint}",
        scale_ppm=1e6 * float(np.median([ratio for ratio, _ in off])),
        points=list_some(pairs, SHOWN),
        hint=message("look_at_scale", "check unit, correction and scale of the measured lengths"),
    )
    return [Problem(table.file, text)]


def _plan(table):
    """{point of control: (x, y, sd)} where both are given, in the frame of the survey."""
    rows = zip(table.point, table.xyz_m, table.sd_m, table.system, table.check, strict=True)
    return {
        name: (*xyz[:2], float(np.hypot(*sd[:2])))
        for name, xyz, sd, system, check in rows
        if system is None and not check and np.isfinite([*xyz[:2], *sd[:2]]).all()
    }


def _adjusted(adjusted, place, cov_scale):
    """(relative difference, its sd, names) of each pair: adjusted against given.

    The sd is too large where the points of control hold the adjusted ones, for the two are then
    correlated: what is told is told on the safe side.
    """
    index = {name: i for i, name in enumerate(adjusted.survey.points)}
    there = np.isfinite(adjusted.xyz_m).all(axis=1)
    names = [name for name in place if name in index and there[index[name]]]
    if len(names) < 2:
        return
    rows = [index[name] for name in names]
    covariance = cov_scale * adjusted.covariance_m2(rows)
    for i, j in combinations(range(len(names)), 2):
        a, b = (np.array(place[names[at]]) for at in (i, j))
        given = np.hypot(*(a - b)[:2])
        apart = np.diff(adjusted.xyz_m[[rows[i], rows[j]], :2], axis=0)[0]
        now = np.hypot(*apart)
        if given <= LEAST_LENGTH_M or now == 0:
            continue
        along = np.concatenate([-apart, apart]) / now
        places = [3 * i, 3 * i + 1, 3 * j, 3 * j + 1]
        variance = along @ covariance[np.ix_(places, places)] @ along
        sd = np.sqrt(LEAST_SD_M**2 + a[2] ** 2 + b[2] ** 2 + max(variance, 0.0))
        yield now / given - 1, sd / given, (names[i], names[j])


def _read(readings, place, measurements):
    """(relative difference, its sd, names) of each length read between two points of control."""
    station = {one.name: one.station for one in measurements.setups}
    found = readings.columns
    is_length = readings.are(*LENGTHS) & (found["unit"] == "m")
    for one in readings.where(is_length & ~readings.check & ~(found["value"] < LEAST_LENGTH_M)):
        names = tuple(station.get(name, name) for name in one.ids[:2])
        if len(names) == 2 and set(names) <= set(place) and np.isfinite(one.residual):
            yield -one.residual / one.value, one.sd / one.value, names
