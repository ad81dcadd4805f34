"""Does anything say that all measured lengths are too long? Check readings, and control apart."""

from itertools import combinations

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import listed, message
from tankcal.surveys.checks import DISAGREE, LISTED

LENGTHS = ("distance", "horizontal distance", "slope distance")
LEAST_SD_M = 0.001  # of a distance between two points of control
LEAST_LENGTH_M = 0.5
SHOWN = 3


def check_readings_off(readings):
    """Problem rows of check readings that differ by more than their uncertainty allows.

    readings  `Reading` rows, those with check=True are looked at
    """
    problems = []
    for one in readings:
        if not one.check or not np.isfinite(one.w) or abs(one.w) <= DISAGREE:
            continue
        if one.kind not in LENGTHS or not one.value:
            continue
        text = message(
            "check_reading_off",
            "the check reading {reading} differs by {times:.1f} times its standard deviation from"
            " what the adjusted points say ({difference_ppm:+.0f} ppm of its value): the scale, or"
            " this reading?",
            reading=message(
                "length_between", "{kind} {ids}", kind=one.kind, ids="-".join(map(str, one.ids))
            ),
            times=abs(one.w),
            difference_ppm=1e6 * one.residual / one.value,
        )
        problems.append(Problem(one.file, text, one.row))
    return problems[:LISTED]


def scale_of_control(adjusted, readings, measurements):
    """A Problem row when the distances between points of control are not those that were given.

    What was set aside no longer holds the scale: the adjusted distances are compared with the given
    ones, and so is every length that was read between two points of control.
    """
    table = measurements.control
    if table is None:
        return []
    place = _plan(table)
    found = [*_adjusted(adjusted, place), *_read(readings, place, measurements)]
    off = [(ratio, names) for ratio, sd, names in found if abs(ratio) > DISAGREE * sd]
    signs = {np.sign(ratio) for ratio, _ in off}
    if not off or len(signs) > 1:
        return []
    pairs = list(dict.fromkeys("-".join(sorted(names)) for _, names in off))
    text = message(
        "control_scale",
        "the readings make the distances between points of control {scale_ppm:+.0f} ppm longer than"
        " given ({points}): {hint}",
        scale_ppm=1e6 * float(np.median([ratio for ratio, _ in off])),
        points=listed(pairs, SHOWN),
        hint=message("look_at_scale", "look at unit, correction and scale of the lengths measured"),
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


def _adjusted(adjusted, place):
    """(relative difference, its sd, names) of each pair: adjusted against given."""
    index = {name: i for i, name in enumerate(adjusted.survey.points)}
    for pair in combinations([name for name in place if name in index], 2):
        a, b = (np.array(place[name]) for name in pair)
        given = np.hypot(*(a - b)[:2])
        now = np.hypot(*np.diff(adjusted.xyz_m[[index[name] for name in pair], :2], axis=0)[0])
        if given > LEAST_LENGTH_M and np.isfinite(now):
            yield now / given - 1, np.hypot(LEAST_SD_M, np.hypot(a[2], b[2])) / given, pair


def _read(readings, place, measurements):
    """(relative difference, its sd, names) of each length read between two points of control."""
    station = {one.name: one.station for one in measurements.setups}
    for one in readings:
        if one.kind not in LENGTHS or one.check or one.unit != "m" or one.value < LEAST_LENGTH_M:
            continue
        names = tuple(station.get(name, name) for name in one.ids[:2])
        if len(names) == 2 and set(names) <= set(place) and np.isfinite(one.residual):
            yield -one.residual / one.value, one.sd / one.value, names
