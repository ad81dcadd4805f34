"""Comparison of check readings, check points and unused control with the adjustment.

The scale of measured lengths is tested by check readings and by distances between control points.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import list_some, message
from tankcal.survey.network.quality import compare_left_out
from tankcal.survey.observations import ImageCoordinates
from tankcal.survey.results import CheckPoints, Reading

DISAGREE = 4.0  # standard deviations by which a check point may differ
LISTED = 10  # check points listed in warnings
# Test of the scale
LENGTHS = ("distance", "horizontal distance", "slope distance")
LEAST_SD_M = 0.001  # smallest sd of a distance between two control points
LEAST_LENGTH_M = 0.5
SHOWN = 3


def check_readings(adjusted, checks, cov_scale):
    """Reading rows (check=True) of observations left out of the adjustment.

    Parameters
    ----------
    adjusted : network.Adjusted
    checks : iterable of Observations
    cov_scale : float
        Variance factor of the covariances.

    Returns
    -------
    list of Reading
    """
    readings = []
    for observations in checks:
        parts = (
            _split_by_form(adjusted, observations)
            if isinstance(observations, ImageCoordinates)
            else [observations]
        )
        for part in parts:
            readings += _reading_rows(adjusted, part, cov_scale)
    return readings


def find_disagreeing_checks(check_points, table):
    """Problem rows of check points that differ more than their uncertainty allows.

    Parameters
    ----------
    found : CheckPoints or None
    table : KnownPoints or None
        Contents of check.csv.

    Returns
    -------
    list of Problem
    """
    problems = []
    if check_points is None or table is None:
        return problems
    for name, difference, sd in zip(
        check_points.names, check_points.difference_m, check_points.sd_m, strict=True
    ):
        with np.errstate(divide="ignore", invalid="ignore"):
            # An sd of 0 gives no test.
            away = np.nan_to_num(np.abs(difference) / sd, posinf=0.0)
        if name in table.point and away.max() > DISAGREE:
            k = int(away.argmax())
            text = message(
                "check_point_off",
                "{axis} of {point} differs by {difference_mm:+.1f} mm from the adjusted point,"
                " {times:.1f} times its standard deviation of {sd_mm:.1f} mm",
                axis="xyz"[k],
                point=name,
                difference_mm=1e3 * difference[k],
                times=away[k],
                sd_mm=1e3 * sd[k],
            )
            row = table.rows[table.point.index(name)] if table.rows else None
            problems.append(Problem(table.file, text, row, f"{'xyz'[k]}_m"))
    return problems[:LISTED]


def _reading_rows(adjusted, observations, cov_scale):
    """Reading rows of one table, without observations of points that are not adjusted."""
    ties = [np.asarray(getattr(observations, name)) for name in observations.ties]
    is_adjusted = np.isfinite(adjusted.xyz_m[np.array(ties)]).all(axis=(0, 2))
    observations = observations.taken(is_adjusted)
    if not len(observations):
        return []
    result = compare_left_out(adjusted, observations)
    sd = np.reshape(observations.sd, result.difference.shape)
    # The variance factor applies to the adjusted part; the variance of the reading keeps its scale.
    spread = np.sqrt(sd**2 + cov_scale * np.maximum(result.sd**2 - sd**2, 0.0))
    value = np.reshape(observations.value, sd.shape)
    trace, nan = observations.trace, float("nan")
    return [
        Reading(
            observations.kind, trace.ids[i], name, trace.file, trace.rows[i], 1, observations.unit,
            float(value[i, k]), float(result.difference[i, k]), float(sd[i, k]), 1.0,
            float(result.difference[i, k] / spread[i, k]), nan, nan, nan, False, True,
        )
        for i in range(len(observations))
        for k, name in enumerate(trace.element[i])
    ]  # fmt: skip


def _split_by_form(adjusted, images):
    """Yield the ImageCoordinates of each form of camera, as the solver requires."""
    table, spare = adjusted.problem.interior_of, adjusted.problem.layout.interior.size - 1
    active = np.flatnonzero((table < spare).any(axis=0))
    for form, rows in adjusted.survey.by_form(images):
        yield replace(images.taken(rows), form=form, active=active, interior_of=table)


def check_points(adjusted, measurements, known, acting, cov_scale):
    """Compare check.csv, check rows of control.csv and unused control with the adjustment.

    Parameters
    ----------
    adjusted : network.Adjusted
    measurements : Measurements
    known : Known
    acting : ndarray of bool, shape (points, 3)
        Control coordinates that were adjusted.
    cov_scale : float
        Variance factor of the covariances.

    Returns
    -------
    CheckPoints or None
        None: no check point.
    """
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    is_adjusted = np.isfinite(adjusted.xyz_m).all(axis=1)
    rows = {}
    for table in (measurements.check, measurements.control):
        for name, xyz, sd in _check_rows(table, only_checks=table is measurements.control):
            if name in number and is_adjusted[number[name]]:
                rows[name] = xyz, sd
    idle = np.isfinite(known.sd_m) & ~acting
    for i in np.flatnonzero(idle.any(axis=1) & is_adjusted):
        xyz = np.where(idle[i], known.xyz_m[i], np.nan)
        rows.setdefault(adjusted.survey.points[i], (xyz, known.sd_m[i]))
    if not rows:
        return None
    points = np.array([number[name] for name in rows])
    xyz, sd = (np.array([row[k] for row in rows.values()]) for k in (0, 1))
    difference = adjusted.xyz_m[points] - xyz
    # Check coordinates are independent of the adjustment, so the variances add.
    variance = cov_scale * np.einsum("nii->ni", adjusted.point_covariances_m2[points])
    size = np.sqrt(np.nansum(difference**2, axis=1))
    return CheckPoints(
        names=tuple(rows),
        difference_m=difference,
        sd_m=np.sqrt(variance + np.nan_to_num(sd) ** 2),
        r_xyz_m=float(np.sqrt(np.mean(size**2))),
        largest_m=float(size.max()),
        mean_m=float(size.mean()),
    )


def _check_rows(table, only_checks):
    """Yield name, coordinates and standard deviations of rows in the frame of the survey."""
    if table is None:
        return
    systems = table.system or (None,) * len(table.point)
    for name, system, check, xyz, sd in zip(
        table.point, systems, table.check, table.xyz_m, table.sd_m, strict=True
    ):
        if system is None and (check or not only_checks) and np.isfinite(xyz).any():
            yield name, np.asarray(xyz, dtype=float), np.asarray(sd, dtype=float)


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
