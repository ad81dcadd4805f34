"""Checks of an adjusted survey, and likely causes of its misfits in sentences.

Check readings, check points and unused control are compared with the adjustment. The scale of
measured lengths is tested by check readings and by distances between control points. Each diagnosis
is a warning, also of a point with two names; no diagnosis changes a number.
"""

import re
from collections import defaultdict
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy
from scipy.special import chdtri

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.messages import list_some, message
from tankcal.survey.network.quality import compare_left_out
from tankcal.survey.observations import ImageCoordinates
from tankcal.survey.results import CheckPoints, Reading
from tankcal.survey.start.photographs import resect, sights_of
from tankcal.units import FOOT_M

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


LEVEL = 0.001  # significance level of the test whether two points coincide
RARELY = 3  # largest number of rays or readings of the suspected point
NEAR = 6.0  # search radius in median standard deviations
CLOSE = 0.05  # largest search radius as a share of the extent of the survey
TRIED = 2000  # pairs tested, the nearest first
TOLD = 10


def normalize_name(name):
    """Reduce a name to lower case without spaces, marks and leading zeros; O as 0, I and l as 1."""
    plain = re.sub(r"[^0-9a-z]", "", str(name).lower().replace("o", "0"))
    return re.sub(r"(?<!\d)0+(?=\d)", "", plain.translate(str.maketrans("il", "11")))


def image_point_label(photo, point):
    """Label of an image point in messages."""
    return message("point_in_photo", "point {point} in photo {photo}", point=point, photo=photo)


def names_alike(aside, names):
    """Problem rows for points that were not adjusted and whose name resembles another.

    Parameters
    ----------
    aside : dict
        {name: file} of these points.
    names : sequence of str
        Names of the adjusted points.
    """
    known = {}
    for name in names:
        known.setdefault(normalize_name(name), name)
    return [
        Problem(
            file,
            message(
                "is_it",
                "point {point} could not be adjusted: is it {other}?",
                point=name,
                other=known[normalize_name(name)],
            ),
        )
        for name, file in aside.items()
        if known.get(normalize_name(name), name) != name
    ][:TOLD]


def same_place(adjusted):
    """Problem rows for pairs of points that coincide within their standard deviations.

    The points never occur in the same photo or from the same station, and one of them was rarely
    observed. A survey with standard deviations that are large relative to its extent is not tested.
    """
    survey, xyz, problems = adjusted.survey, adjusted.xyz_m, []
    adjusted_points = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    if len(adjusted_points) < 2:
        return problems
    size = np.sqrt(np.einsum("nii->n", adjusted.point_covariances_m2[adjusted_points]))
    reach = NEAR * max(float(np.median(size)), 1e-6)
    if reach > CLOSE * np.linalg.norm(np.ptp(xyz[adjusted_points], axis=0)):
        return problems
    pairs = scipy.spatial.cKDTree(xyz[adjusted_points]).query_pairs(reach, output_type="ndarray")
    pairs = adjusted_points[pairs]
    views = _views(survey)
    count = np.array([len(views_of_point) for views_of_point in views])
    # Order each pair so that the less observed point comes first.
    pairs = np.take_along_axis(pairs, np.argsort(count[pairs], axis=1, kind="stable"), axis=1)
    pairs = pairs[count[pairs[:, 0]] <= RARELY]
    apart = np.linalg.norm(xyz[pairs[:, 0]] - xyz[pairs[:, 1]], axis=1)
    for i in np.argsort(apart, kind="stable")[:TRIED]:
        few, many = pairs[i].tolist()
        # A photo or station that shows both proves that they differ.
        if {view for view, _ in views[few]} & {view for view, _ in views[many]}:
            continue
        if not _together(adjusted, xyz[few] - xyz[many], few, many):
            continue
        text = message(
            "two_names",
            "points {point} and {other} lie {apart_mm:.1f} mm apart, within their standard"
            " deviations, and no photo or station shows both: one point under two names?",
            point=survey.points[few],
            other=survey.points[many],
            apart_mm=1e3 * apart[i],
        )
        problems.append(Problem("job.toml", text))
        if len(problems) == TOLD:
            break
    return problems


def _together(adjusted, difference, a, b):
    """Whether two points coincide within their covariance (chi-square test, 3 degrees of freedom).

    Parameters
    ----------
    adjusted : network.Adjusted
    difference : ndarray, shape (3,)
    a, b : int
        Numbers of the points.
    """
    q = adjusted.covariance_m2([a, b])
    # Covariance of the difference, including the correlation of the points.
    q = q[:3, :3] + q[3:, 3:] - q[:3, 3:] - q[3:, :3]
    floor = 1e-12 * np.eye(3)
    return difference @ np.linalg.solve(q + floor, difference) < chdtri(3, LEVEL)


def _views(survey):
    """For each point, the (view, number) pairs that show it: photos, and stations with their
    table."""
    views = [[] for _ in survey.points]
    images = survey.image_points
    if images is not None:
        for point, photo in zip(images.point.tolist(), images.photo.tolist(), strict=True):
            views[point].append((("photo", photo), 0))
    for number, table in enumerate(survey.observations):
        if not hasattr(table, "start"):
            continue
        ends = [getattr(table, name).tolist() for name in ("end", "origin") if name in table.ties]
        for end in ends:
            for point, start in zip(end, table.start.tolist(), strict=True):
                views[point].append((("station", start), number))
                views[start].append((("station", start), number))
    return views


MISPLACED = message("misplaced_point", "a misplaced decimal point")
FACTORS = (
    (1000.0, message("millimetres_as_metres", "millimetres given as metres")),
    (1 / FOOT_M, message("feet_as_metres", "feet given as metres")),
    (100.0, message("centimetres_as_metres", "centimetres given as metres")),
    (0.001, message("kilometres_as_metres", "kilometres given as metres")),
    (
        FOOT_M,
        message("feet_twice", "metres that were converted from feet once too often"),
    ),
    (10.0, MISPLACED),
    (0.1, MISPLACED),
)
FACTOR_TOLERANCE = 0.003  # relative accuracy with which a factor must explain a distance
# largest remaining share of the plan distance between given and adjusted after a swap
SWAPPED = 0.05
GON = (
    (0.9, message("gon_as_degrees", "gon read as degrees")),
    (1 / 0.9, message("degrees_as_gon", "degrees read as gon")),
)
LEFT = 0.05  # largest remaining share of the scatter of a station's angles after the factor
TRIMMED = 0.97  # sigma0 to which data snooping at 0.1 % alone may reduce 1 (it removes 0.6 %)
LOST = 0.2  # share of a photo's points rejected, above which the photo is suspected
MIRRORED = 0.2  # largest remaining share of the error of a mirrored photo


def diagnose(adjusted, readings, groups, known):
    """Collect all diagnoses of an adjusted survey.

    Parameters
    ----------
    adjusted : network.Adjusted
    readings : Readings
        Including rejected readings.
    groups : sequence of GroupOfReadings
    known : Known

    Returns
    -------
    list of Problem
    """
    doubtful = list(readings.where(readings.removed | (np.abs(readings.columns["w"]) > CRITICAL)))
    return [
        *failed_test(adjusted, groups),
        *find_swapped_points(adjusted.survey.points, adjusted.xyz_m, known),
        *wrong_distances(doubtful),
        *wrong_angles(readings, doubtful),
        *mirrored_photos(adjusted),
    ]


def failed_test(adjusted, groups):
    """Report a failed global test, with the groups that are the likely cause."""
    if adjusted.dof < 1:
        return []
    test = adjusted.test()
    # A small chi-square is not reported if data snooping alone explains it.
    large = test.chi2 > test.high
    if test.passed or (not large and adjusted.sigma0 > TRIMMED):
        return []
    # Groups whose factor differs from 1 by three standard deviations in the direction of the
    # failure.
    off = [
        group
        for group in groups
        if group.redundancy > 1 and (group.factor - 1) * (1 if large else -1) > 3 * group.factor_sd
    ]
    off.sort(key=lambda group: -abs(np.log(max(group.factor, 1e-9))))
    text, cause = _verdict(adjusted.sigma0, test, large), _cause(off[:4], large)
    if cause:
        text = message("test_and_cause", "{test}; {cause}", test=text, cause=cause)
    return [Problem("job.toml", text, None, "adjustment")]


def _verdict(sigma0, test, large):
    """Sentence with the result of the global test."""
    if large:
        return message(
            "test_above",
            "the global test fails: sigma0 = {sigma0:.3g}, chi-square {chi2:.1f} is above"
            " {bound:.1f} for {dof} degrees of freedom",
            sigma0=sigma0,
            chi2=test.chi2,
            bound=test.high,
            dof=test.dof,
        )
    return message(
        "test_below",
        "the global test fails: sigma0 = {sigma0:.3g}, chi-square {chi2:.1f} is below {bound:.1f}"
        " for {dof} degrees of freedom",
        sigma0=sigma0,
        chi2=test.chi2,
        bound=test.low,
        dof=test.dof,
    )


def _cause(off, large):
    """Groups whose standard deviations explain a failed test; None: no statement."""
    groups = [_group(group) for group in off]
    if groups and large:
        template = "standard deviations declared too small: {groups}"
        return message("sds_too_small", template, groups=groups)
    if groups:
        template = "standard deviations declared too large: {groups}"
        return message("sds_too_large", template, groups=groups)
    if large:
        return message(
            "no_group_explains",
            "no single group of observations explains it: look for blunders, or for a model "
            "that does not fit",
        )
    return None


def _group(readings):
    """A group with its factor, in words."""
    if readings.name:
        return message(
            "named_group",
            "{group} {of_group} ({factor:.2g} times)",
            group=readings.kind,
            of_group=readings.name,
            factor=readings.factor,
        )
    template = "{group} ({factor:.2g} times)"
    return message("whole_group", template, group=readings.kind, factor=readings.factor)


def find_swapped_points(names, xyz_m, known, sd_m=0.0):
    """Problem rows for control points that fit their coordinates with x and y exchanged.

    Parameters
    ----------
    names : sequence of str, length n
    xyz_m : ndarray, shape (n, 3)
        Computed positions.
    known : Known
    sd_m : float
        Standard deviation of the computed positions, added to that of control.

    Returns
    -------
    list of Problem
    """
    number = {name: i for i, name in enumerate(names)}
    problems = []
    for name, row in known.row.items():
        control_m, here = known.xyz_m[number[name]], xyz_m[number[name]]
        sd = np.nan_to_num(known.sd_m[number[name]])[:2].max() + sd_m
        away = np.hypot(*(here - control_m)[:2])
        back = np.hypot(here[0] - control_m[1], here[1] - control_m[0])
        # Significantly off, and the exchange removes nearly all of the difference.
        if away > max(10 * sd, 1e-3) and back < SWAPPED * away:
            text = message(
                "point_swapped",
                "point {point} lies {away_m:.3f} m from where it was given, and {back_m:.3f} m from"
                " there with x and y exchanged: x and y seem to be swapped",
                point=name,
                away_m=away,
                back_m=back,
            )
            problems.append(Problem("control.csv", text, row, "x_m"))
    return problems[:TOLD]


def wrong_distances(doubtful):
    """Problem rows for distances explained by a wrong unit or a misplaced decimal point."""
    problems = []
    for reading in doubtful:
        computed = reading.value + reading.residual
        if reading.kind != "distance" or not computed > 0:
            continue
        for factor, what in FACTORS:
            if abs(reading.value / computed / factor - 1) < FACTOR_TOLERANCE:
                text = message(
                    "wrong_distance",
                    "distance {distance} is {value_m:.4f} m where {computed_m:.4f} m was expected:"
                    " it looks like {what}",
                    distance="-".join(reading.ids),
                    value_m=reading.value,
                    computed_m=computed,
                    what=what,
                )
                problems.append(Problem(reading.file, text, reading.row))
                break
    return problems[:TOLD]


def wrong_angles(readings, doubtful):
    """Problem rows for stations whose angles in one file fit after exchanging gon and degrees."""
    stations = {
        (reading.file, reading.ids[0])
        for reading in doubtful
        if reading.unit == "rad" and reading.row
    }
    members = defaultdict(list)
    files = np.isin(readings.columns["file"], list({file for file, _ in stations}))
    has_residual = np.isfinite(readings.columns["residual"])
    for reading in readings.where(files & has_residual & ~readings.check):
        if (reading.file, reading.ids[0]) in stations:
            members[reading.file, reading.ids[0]].append(reading)
    problems = []
    for (file, station), angles in members.items():
        # Directions have an unknown orientation, so one more reading is needed.
        free = angles[0].kind == "direction"
        rejected = [reading for reading in angles if reading.removed]
        # Rejected readings show the factor best; the others may belong to the correct unit.
        angles = rejected if len(rejected) > 1 + free else angles
        value = np.array([reading.value for reading in angles])
        computed = value + np.array([reading.residual for reading in angles])
        now = _scatter(computed - value, free)
        for factor, what in GON:
            # Reduction to one turn hides whether the true value was a turn larger.
            turns = value + 2 * np.pi * np.arange(2)[:, None]
            if len(angles) > 1 + free and _least(computed, factor * turns, free) < LEFT * now:
                text = message(
                    "angles_from_station",
                    "the angles from {station} fit if they are {what}",
                    station=station,
                    what=what,
                )
                problems.append(Problem(file, text, angles[0].row))
                break
    return problems[:TOLD]


def _scatter(difference, free):
    """Root mean square of angles, relative to their mean direction if the orientation is free."""
    turned = np.exp(1j * difference)
    middle = turned.mean() if free else 1.0
    return float(np.sqrt(np.mean(np.angle(turned * np.conj(middle)) ** 2)))


def _least(computed, choices, free):
    """Scatter with the better of two values of each angle (with and without a full turn)."""
    difference = computed - choices
    best = difference[0]
    for _ in range(3):
        # Alternate between the median direction and the choice of turns.
        middle = np.angle(np.median(np.cos(best)) + 1j * np.median(np.sin(best))) if free else 0.0
        away = np.abs(np.angle(np.exp(1j * (difference - middle))))
        best = np.where(away[0] <= away[1], difference[0], difference[1])
    return _scatter(best, free)


def mirrored_photos(adjusted):
    """Problem rows for photos with many rejected points that fit after mirroring."""
    images = adjusted.survey.image_points
    if images is None or images.use is None:
        return []
    n = len(adjusted.survey.photos.names)
    rejected = np.bincount(images.photo, weights=images.use == 0, minlength=n)
    doubtful = np.flatnonzero(rejected > LOST * np.bincount(images.photo, minlength=n))
    return [
        mirrored_photo(adjusted.survey.photos.names[i])
        for i in doubtful
        if is_photo_mirrored(adjusted, i)
    ]


MIRROR = message(
    "image_mirrored",
    "its image points fit if the image is mirrored: x and y seem to be swapped, or one of "
    "them counted the wrong way round",
)


def mirrored_photo(name):
    """Problem of a photo that fits after mirroring."""
    text = message("photo_mirrored", "photo {photo}: {why}", photo=name, why=MIRROR)
    return Problem("image_points.csv", text)


def is_photo_mirrored(adjusted, photo):
    """Whether the points of a photo fit the adjusted points better after mirroring."""
    full_survey = adjusted.survey
    images = full_survey.image_points
    survey = replace(full_survey, image_points=replace(images, use=None))
    sight = sights_of(survey)[photo]
    is_adjusted = np.isfinite(adjusted.xyz_m[sight.point]).all(axis=1)
    return mirrored_fits(adjusted.xyz_m[sight.point[is_adjusted]], sight.ideal[is_adjusted])


def mirrored_fits(xyz_m, ideal):
    """Whether the mirrored image of points fits a pose far better.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
    ideal : ndarray, shape (n, 2)
        Ideal image points over c.
    """
    if len(xyz_m) < 5:
        return False
    # A fixed seed makes the diagnosis reproducible.
    rng = np.random.default_rng(0)
    as_is, turned = resect(xyz_m, ideal, rng), resect(xyz_m, ideal * [-1, 1], rng)
    if turned is None:
        return False
    return as_is is None or turned.error < MIRRORED * as_is.error
