"""Test of the scale of measured lengths, from check readings and from distances of control."""

from itertools import combinations

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import list_some, message
from tankcal.survey.diagnosis.checks import DISAGREE, LISTED

LENGTHS = ("distance", "horizontal distance", "slope distance")
LEAST_SD_M = 0.001  # smallest sd of a distance between two control points
LEAST_LENGTH_M = 0.5
SHOWN = 3


def check_readings_off(readings):
    """Problem rows of check readings that differ by more than their uncertainty allows.

    Parameters
    ----------
    readings : Readings
        Only rows with check=True are tested.
    """
    problems = []
    w, value = readings.columns["w"], readings.columns["value"]
    off = readings.check & np.isfinite(w) & (np.abs(w) > DISAGREE) & (value != 0)
    for check_reading in readings.where(off & readings.are(*LENGTHS)):
        text = message(
            "check_reading_off",
            "the check reading {reading} differs by {times:.1f} times its standard deviation "
            "from the value that the adjusted points give ({difference_ppm:+.0f} ppm of its "
            "value): is the scale wrong, or this reading?",
            reading=message(
                "length_between",
                "{kind} {ids}",
                kind=check_reading.kind,
                ids="-".join(map(str, check_reading.ids)),
            ),
            times=abs(check_reading.w),
            difference_ppm=1e6 * check_reading.residual / check_reading.value,
        )
        problems.append(Problem(check_reading.file, text, check_reading.row))
    return problems[:LISTED]


def scale_of_control(adjusted, readings, measurements, cov_scale=1.0):
    """Problem row if distances between control points contradict the given coordinates.

    Rejected control no longer fixes the scale. The adjusted distances, and each length read between
    two control points, are compared with the given distances. Both standard deviations count, as a
    datum of one point or inner constraints fixes no distance.

    Parameters
    ----------
    adjusted : network.Adjusted
    readings : Readings
    measurements : Measurements
    cov_scale : float
        Variance factor of the covariances.

    Returns
    -------
    list of Problem
    """
    table = measurements.control
    if table is None:
        return []
    place = _plan(table)
    comparisons = [
        *_distance_differences(adjusted, place, cov_scale),
        *_read(readings, place, measurements),
    ]
    off = [(ratio, names) for ratio, sd, names in comparisons if abs(ratio) > DISAGREE * sd]
    # A scale error has the same sign everywhere.
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
    """{control point: (x, y, sd)} in the frame of the survey, where all are given."""
    rows = zip(table.point, table.xyz_m, table.sd_m, table.system, table.check, strict=True)
    return {
        name: (*xyz[:2], float(np.hypot(*sd[:2])))
        for name, xyz, sd, system, check in rows
        if system is None and not check and np.isfinite([*xyz[:2], *sd[:2]]).all()
    }


def _distance_differences(adjusted, place, cov_scale):
    """Yield (relative difference, its sd, names) of each pair: adjusted minus given distance.

    Where control holds the adjusted points both are correlated, so the sd is an upper bound.
    """
    index = {name: i for i, name in enumerate(adjusted.survey.points)}
    is_adjusted = np.isfinite(adjusted.xyz_m).all(axis=1)
    names = [name for name in place if name in index and is_adjusted[index[name]]]
    if len(names) < 2:
        return
    rows = [index[name] for name in names]
    covariance = cov_scale * adjusted.covariance_m2(rows)
    for i, j in combinations(range(len(names)), 2):
        a, b = (np.array(place[names[at]]) for at in (i, j))
        given_m = np.hypot(*(a - b)[:2])
        apart = np.diff(adjusted.xyz_m[[rows[i], rows[j]], :2], axis=0)[0]
        now = np.hypot(*apart)
        if given_m <= LEAST_LENGTH_M or now == 0:
            continue
        # Derivative of the distance: the unit vector, negative for the first point.
        along = np.concatenate([-apart, apart]) / now
        places = [3 * i, 3 * i + 1, 3 * j, 3 * j + 1]
        variance = along @ covariance[np.ix_(places, places)] @ along
        sd = np.sqrt(LEAST_SD_M**2 + a[2] ** 2 + b[2] ** 2 + max(variance, 0.0))
        yield now / given_m - 1, sd / given_m, (names[i], names[j])


def _read(readings, place, measurements):
    """Yield (relative difference, its sd, names) of each length read between two control points."""
    station = {length.name: length.station for length in measurements.setups}
    data = readings.columns
    is_length = readings.are(*LENGTHS) & (data["unit"] == "m")
    for length in readings.where(is_length & ~readings.check & ~(data["value"] < LEAST_LENGTH_M)):
        names = tuple(station.get(name, name) for name in length.ids[:2])
        if len(names) == 2 and set(names) <= set(place) and np.isfinite(length.residual):
            yield -length.residual / length.value, length.sd / length.value, names
