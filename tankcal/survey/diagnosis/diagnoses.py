"""Likely causes of misfits in sentences, and points with two names.

Likely causes of misfits, derived from the adjustment, in sentences.

Each diagnosis is a warning; no diagnosis changes a number.
"""

import re
from collections import defaultdict
from dataclasses import replace

import numpy as np
import scipy
from scipy.special import chdtri

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.survey.start.photographs import resect, sights_of
from tankcal.units import FOOT_M

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
