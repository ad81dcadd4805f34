"""What only the adjustment can tell: likely causes of what does not fit, in sentences.

Each diagnosis is a Problem that is warned of; none of them changes a number.
"""

from collections import defaultdict
from dataclasses import replace

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.survey.start.photographs import sights_of
from tankcal.survey.start.resection import resect

MISPLACED = message("misplaced_point", "a misplaced decimal point")
FACTORS = (
    (1000.0, message("millimetres_as_metres", "millimetres given as metres")),
    (1 / 0.3048, message("feet_as_metres", "feet given as metres")),
    (100.0, message("centimetres_as_metres", "centimetres given as metres")),
    (0.001, message("kilometres_as_metres", "kilometres given as metres")),
    (
        0.3048,
        message("feet_twice", "metres that were converted from feet once too often"),
    ),
    (10.0, MISPLACED),
    (0.1, MISPLACED),
)
CLOSE = 0.003  # relative: how well such a factor must explain a distance
SWAPPED = 0.05  # what a swap may leave of the plan distance between given and adjusted
GON = (
    (0.9, message("gon_as_degrees", "gon read as degrees")),
    (1 / 0.9, message("degrees_as_gon", "degrees read as gon")),
)
LEFT = 0.05  # what the factor may leave of the scatter of a station's angles
TOLD = 10  # diagnoses of one kind that are listed
TRIMMED = 0.97  # sigma0 that a search for blunders at 0.1 % alone may leave of 1 (it takes 0.6 %)
LOST = 0.2  # share of a photo's points set aside, above which the photo itself is doubted
MIRRORED = 0.2  # share of its error that a photo may keep when it is mirrored


def diagnose(adjusted, readings, groups, known):
    """Problem rows for everything that is found.

    adjusted  network.Adjusted            readings  Readings, those set aside among them
    groups    GroupOfReadings             known     Known control
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
    """Says so when the global test fails, with the groups that are the likely cause."""
    if adjusted.dof < 1:
        return []
    test = adjusted.test()
    large = test.chi2 > test.high
    if test.passed or (not large and adjusted.sigma0 > TRIMMED):
        return []
    off = [
        one
        for one in groups
        if one.redundancy > 1 and (one.factor - 1) * (1 if large else -1) > 3 * one.factor_sd
    ]
    off.sort(key=lambda one: -abs(np.log(max(one.factor, 1e-9))))
    text, cause = _verdict(adjusted.sigma0, test, large), _cause(off[:4], large)
    if cause:
        text = message("test_and_cause", "{test}; {cause}", test=text, cause=cause)
    return [Problem("job.toml", text, None, "adjustment")]


def _verdict(sigma0, test, large):
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
    """The groups whose standard deviations explain a failed test; None: nothing to be said."""
    groups = [_group(one) for one in off]
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


def _group(one):
    if one.name:
        return message(
            "named_group",
            "{group} {of_group} ({factor:.2g} times)",
            group=one.kind,
            of_group=one.name,
            factor=one.factor,
        )
    template = "{group} ({factor:.2g} times)"
    return message("whole_group", template, group=one.kind, factor=one.factor)


def find_swapped_points(names, xyz_m, known, sd_m=0.0):
    """Problem rows for control points that lie where they were given with x and y exchanged.

    names (n,), xyz_m (n, 3) where they are, to sd_m (an addition to that of control)
    """
    number = {name: i for i, name in enumerate(names)}
    found = []
    for name, row in known.row.items():
        given, here = known.xyz_m[number[name]], xyz_m[number[name]]
        sd = np.nan_to_num(known.sd_m[number[name]])[:2].max() + sd_m
        away = np.hypot(*(here - given)[:2])
        back = np.hypot(here[0] - given[1], here[1] - given[0])
        if away > max(10 * sd, 1e-3) and back < SWAPPED * away:
            text = message(
                "point_swapped",
                "point {point} lies {away_m:.3f} m from where it was given, and {back_m:.3f} m from"
                " there with x and y exchanged: x and y seem to be swapped",
                point=name,
                away_m=away,
                back_m=back,
            )
            found.append(Problem("control.csv", text, row, "x_m"))
    return found[:TOLD]


def wrong_distances(doubtful):
    """Distances that a wrong unit or a misplaced decimal point explains."""
    found = []
    for one in doubtful:
        computed = one.value + one.residual
        if one.kind != "distance" or not computed > 0:
            continue
        for factor, what in FACTORS:
            if abs(one.value / computed / factor - 1) < CLOSE:
                text = message(
                    "wrong_distance",
                    "distance {distance} is {value_m:.4f} m where {computed_m:.4f} m was expected:"
                    " it looks like {what}",
                    distance="-".join(one.ids),
                    value_m=one.value,
                    computed_m=computed,
                    what=what,
                )
                found.append(Problem(one.file, text, one.row))
                break
    return found[:TOLD]


def wrong_angles(readings, doubtful):
    """Stations whose angles in one file fit once gon and degrees are exchanged."""
    stations = {(one.file, one.ids[0]) for one in doubtful if one.unit == "rad" and one.row}
    members = defaultdict(list)
    files = np.isin(readings.columns["file"], list({file for file, _ in stations}))
    there = np.isfinite(readings.columns["residual"])
    for one in readings.where(files & there & ~readings.check):
        if (one.file, one.ids[0]) in stations:
            members[one.file, one.ids[0]].append(one)
    found = []
    for (file, station), mine in members.items():
        free = mine[0].kind == "direction"
        gone = [one for one in mine if one.removed]
        mine = gone if len(gone) > 1 + free else mine
        value = np.array([one.value for one in mine])
        computed = value + np.array([one.residual for one in mine])
        now = _scatter(computed - value, free)
        for factor, what in GON:
            turns = value + 2 * np.pi * np.arange(2)[:, None]
            if len(mine) > 1 + free and _least(computed, factor * turns, free) < LEFT * now:
                text = message(
                    "angles_from_station",
                    "the angles from {station} fit if they are {what}",
                    station=station,
                    what=what,
                )
                found.append(Problem(file, text, mine[0].row))
                break
    return found[:TOLD]


def _scatter(difference, free):
    """Root mean square of angles, about their mean direction when that is free."""
    turned = np.exp(1j * difference)
    middle = turned.mean() if free else 1.0
    return float(np.sqrt(np.mean(np.angle(turned * np.conj(middle)) ** 2)))


def _least(computed, choices, free):
    """Scatter with the better of two readings of each angle (with and without a whole turn)."""
    difference = computed - choices
    best = difference[0]
    for _ in range(3):
        middle = np.angle(np.median(np.cos(best)) + 1j * np.median(np.sin(best))) if free else 0.0
        away = np.abs(np.angle(np.exp(1j * (difference - middle))))
        best = np.where(away[0] <= away[1], difference[0], difference[1])
    return _scatter(best, free)


def mirrored_photos(adjusted):
    """Photos of which most points were set aside, and that fit when they are mirrored."""
    images = adjusted.survey.image_points
    if images is None or images.use is None:
        return []
    n = len(adjusted.survey.photos.names)
    lost = np.bincount(images.photo, weights=images.use == 0, minlength=n)
    doubtful = np.flatnonzero(lost > LOST * np.bincount(images.photo, minlength=n))
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
    """The Problem of a photo that fits once it is mirrored."""
    text = message("photo_mirrored", "photo {photo}: {why}", photo=name, why=MIRROR)
    return Problem("image_points.csv", text)


def is_photo_mirrored(adjusted, photo):
    """Whether the points of a photo fit the adjusted ones better when it is mirrored."""
    whole = adjusted.survey
    images = whole.image_points
    survey = replace(whole, image_points=replace(images, use=None))
    sight = sights_of(survey)[photo]
    there = np.isfinite(adjusted.xyz_m[sight.point]).all(axis=1)
    return mirrored_fits(adjusted.xyz_m[sight.point[there]], sight.ideal[there])


def mirrored_fits(xyz_m, ideal):
    """Whether a pose from points (n, 3) seen at (n, 2) fits far better in the mirrored image."""
    if len(xyz_m) < 5:
        return False
    rng = np.random.default_rng(0)
    as_is, turned = resect(xyz_m, ideal, rng), resect(xyz_m, ideal * [-1, 1], rng)
    if turned is None:
        return False
    return as_is is None or turned.error < MIRRORED * as_is.error
