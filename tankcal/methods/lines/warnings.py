"""Warnings of reference lines: rejected offsets, moved lines, and insufficient readings.

Checks for reference lines with a common error in all their readings.

A scale read from its other end, a wrong sign or unit, or a plummet in contact with an obstacle
changes all readings of a line, or of all lines. The test of single readings cannot detect this.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.errors import Problem
from tankcal.geometry.outlines import harmonics
from tankcal.messages import message
from tankcal.pipeline.checks import limit_at, limits_of, repeat_factor
from tankcal.survey.reference_line import (
    collimation_by_faces,
    lean_of,
    level_names,
    levels_of,
    rises_of,
)
from tankcal.units import ARCSEC

# No construction steps inwards where plates are thicker: warn if the share of the plate step is
# below this value, by so many sds.
STEPS_IN, STEPS_IN_SDS = -0.4, 2.0
# Lines inside: the wall shows less than this share of the plate step, and is so many sds short of
# the whole step.
HARDLY, SURE_SDS = 0.25, 4.0
# Smallest number of courses for these tests, and smallest range of their plates, m.
FEWEST_COURSES, LEAST_STEP_M = 4, 1e-3
FEWEST_LINES = 6  # smallest number of lines for the test of a single line
# Largest rms of a line: as multiple of the median rms of all lines, and m.
APART, APART_M = 5.0, 6e-3
FILE, RULES = "offsets.csv", "reference_line"
UNLIKE_SDS = 3.0  # largest deviation of a collimation from its certificate, in sds
# Largest distance of the centre of a level from the straight axis, in m and in sds.
OFF_AXIS_M, OFF_AXIS_SDS = 0.01, 6.0
OFF_LEVEL_M = 0.003  # largest deviation of the radius of a strap from the levels of its course
WRITTEN_M = 5e-5  # half the last digit of a reported difference
# Critical value of the length of two slopes over their standard deviation: a chi-square with two
# degrees of freedom exceeds its square in 0.1 % of cases.
CRITICAL_LEAN = 3.72
VERTICALS = 1e-4  # sd of the difference between the verticals of plummet and points, m/m (20")
# Largest shares of rejected offsets, and of lines with a rejected offset.
MANY, MANY_LINES = 0.15, 0.5
FEWEST_LEVELS, FEWEST_ALIKE = 5, 4  # smallest numbers of levels, and of equal readings of two lines


# ---- reference lines with a common error


def check_scale(job):
    """Yield a warning of lines closer to the wall than is practicable."""
    least = limits_of(RULES)["least_offset_mm"] / 1000
    distances_m = [abs(offset.offset_m) for offset in job.lines.offsets]
    if max(distances_m) < least:
        text = message(
            "offsets_small",
            "the largest offset is {most_mm:g} mm; lines stand {least_mm:g} mm or more off the"
            " wall: are these centimetres or inches?",
            most_mm=1000 * max(distances_m),
            least_mm=1000 * least,
        )
        yield Problem(FILE, text, column="offset_mm")


def check_lines_apart(job, collimations):
    """Yield warnings of lines whose readings all differ from the circles of all other lines.

    Parameters
    ----------
    job : Job
    collimations : dict
        {plummet: (collimation, standard deviation), rad}.

    Yields
    ------
    Problem
    """
    departures = departures_of(
        job.lines, {name: estimate[0] for name, estimate in collimations.items()}
    )
    if len(departures) < FEWEST_LINES:
        return
    rms = {line: float(np.sqrt(np.mean(departure**2))) for line, departure in departures.items()}
    typical = float(np.median(list(rms.values())))
    for line, size in rms.items():
        if size > max(APART * typical, APART_M):
            text = message(
                "line_apart",
                "line {line!r} departs by {size_mm:.0f} mm (rms) from the circles of all others,"
                " these by {usual_mm:.1f} mm: did the plummet touch something or move, or was the"
                " scale read from its other end or in another unit?",
                line=line,
                size_mm=1000 * size,
                usual_mm=1000 * typical,
            )
            row = next((offset.row for offset in job.lines.offsets if offset.line == line), None)
            yield Problem(FILE, text, row=row, column="line")


def departures_of(lines, collimations):
    """Return the differences of the rises of each line from the circle through all other lines.

    Parameters
    ----------
    lines : ReferenceLines
    collimations : dict
        {plummet: collimation, rad}.

    Returns
    -------
    dict
        {line: (levels,) radial differences, relative to the reference level, m}.
    """
    used = [offset for offset in lines.offsets if not offset.check]
    departures = {}
    for level in rises_of(lines, used, collimations):
        if len(level) < FEWEST_LINES:
            continue
        rise = np.array([rise for _, rise, _ in level])
        design = harmonics([lines.lines[line].azimuth_rad for line, _, _ in level], 1)
        for place, (line, _, _) in enumerate(level):
            others = np.arange(len(level)) != place
            # A circle with a shifted centre is a constant and the first harmonic of the azimuth.
            fit = np.linalg.lstsq(design[others], rise[others], rcond=None)[0]
            departures.setdefault(line, []).append(rise[place] - design[place] @ fit)
    return {line: np.array(values) for line, values in departures.items()}


def check_sign(job, levels):
    """Yield warnings of lines with a wrong sign, according to the plates of the courses.

    Seen from outside, the wall steps outwards with thicker plates; seen from inside it does not,
    unless the plates are flush outside. If only one course was strapped, no other check detects a
    wrong sign.

    Parameters
    ----------
    job : Job
    levels : sequence of Level

    Yields
    ------
    Problem
    """
    reference = next(offset.course for offset in job.lines.offsets if offset.reference)
    rises = {reference: [0.0]}
    for level in levels:
        rises.setdefault(level.course, []).append(level.rise_m)
    courses = [course for course in job.courses if course.name in rises]
    plates = np.array([course.thickness_m + course.paint_m for course in courses])
    if len(courses) < FEWEST_COURSES or np.ptp(plates) < LEAST_STEP_M:
        return
    mean_rises = np.array([np.mean(rises[course.name]) for course in courses])
    steps = plates - plates.mean()
    # Regression of the rise of each course on its plate: 1 for plates flush inside, 0 for flush
    # outside.
    slope = float(mean_rises @ steps / (steps @ steps))
    residuals = mean_rises - mean_rises.mean() - slope * steps
    sd = float(np.sqrt(residuals @ residuals / (len(courses) - 2) / (steps @ steps)))
    if slope < STEPS_IN and slope < -STEPS_IN_SDS * sd:
        text = message(
            "lines_turned_about",
            "where the plates are thicker the wall comes out further in ({slope:+.1f} of their"
            " step, sd {sd:.1f}): was the scale read from its other end, is the sign of the offsets"
            " or the side of the lines the other one, are the levels those from the top down, or"
            " are the plates flush outside?",
            slope=slope,
            sd=sd,
        )
        yield Problem(FILE, text, column="offset_mm")
        return
    is_any_inside = any(line.inside for line in job.lines.lines.values())
    if slope < HARDLY and slope < 1 - SURE_SDS * sd and not is_any_inside:
        text = message(
            "lines_of_inside",
            "the wall does not come out with its plates ({slope:+.1f} of their step, sd {sd:.1f};"
            " +1 of plates that are flush inside): did the lines stand inside, or are the plates"
            " flush outside?",
            slope=slope,
            sd=sd,
        )
        yield Problem("lines.csv", text, column="side")


# ---- warnings of reference lines: rejected offsets, moved lines, and insufficient readings


def least_lines(circumference_m):
    """Return the recommended number of lines for a tank of given circumference in m."""
    return limit_at(RULES, "lines", "least", circumference_m)


def accepted_offsets(job, wall):
    """Return the offsets used for the wall."""
    places = wall.places[wall.are("offsets")]
    _, _, accepted = wall.tests_of("offsets")
    return [job.lines.offsets[i] for i in places[accepted]]


def levels_and_lean(job, wall):
    """Return `Level`s and `Lean` of the accepted offsets, with the adjusted collimations."""
    kappa = {name: estimate[0] for name, estimate in wall.collimations.items()}
    levels = levels_of(job.lines, accepted_offsets(job, wall), kappa)
    return levels, lean_of(job.lines, levels)


def check_lines(job, survey):
    """Return the warnings of the reference lines beside straps, or beside the points of a `Wall`.

    Parameters
    ----------
    job : Job
    survey : StrappedWall or Wall

    Returns
    -------
    tuple of Problem
    """
    is_of_points = survey.surveyed_as == "wall"
    wall = survey.read if is_of_points else survey
    levels, lean = levels_and_lean(job, wall)
    return (
        *_check_rejected(job, wall),
        *_check_moved_lines(job),
        *_check_copied_lines(job),
        *check_lines_apart(job, wall.collimations),
        *check_scale(job),
        *_check_numbers(job, wall),
        *_check_axis(job, levels, lean),
        *_check_scope(job, lean),
        *_check_plummets(job),
        *(check_leans(job, survey) if is_of_points else _check_straps(job, wall, levels)),
    )


@dataclass(frozen=True)
class LeanTest:
    """Comparison of the lean of lines with the lean of points.

    Attributes
    ----------
    of_lines, of_points : ndarray, shape (2,)
        Slope of the axis towards +x and +y.
    w : float
        Length of the difference over its standard deviation.
    mirrored_w : float
        The same with azimuths of lines taken as anticlockwise.
    sd : float
        Mean standard deviation of a component of the difference.
    """

    of_lines: np.ndarray
    of_points: np.ndarray
    w: float
    mirrored_w: float
    sd: float

    @property
    def turned_rad(self):
        """Clockwise angle from the lean of the lines to the lean of the points."""
        before, after = (np.arctan2(*slope) for slope in (self.of_lines, self.of_points))
        return float((after - before + np.pi) % (2 * np.pi) - np.pi)


def compare_leans(lean, shell):
    """Compare the `Lean` of lines with the lean of a `Shell`; None if either is unknown.

    The test quantity is w = sqrt(d' C^-1 d), with the difference d of both slopes. C is the sum of
    their covariances and VERTICALS squared.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from tankcal.survey.reference_line import Lean
    >>> points = dict(slope=(-3e-3, 1e-3), slope_cofactor=1e-8 * np.eye(2), tilt_known=True)
    >>> test = compare_leans(Lean(3e-3, 1e-3, 1e-4), SimpleNamespace(**points))
    >>> round(test.w, 1), round(test.mirrored_w, 1)
    (34.6, 0.0)
    """
    if not (shell.tilt_known and np.isfinite(lean.sd)):
        return None
    lines, points = np.array([lean.x, lean.y]), np.array(shell.slope)
    covariance = shell.slope_cofactor + (lean.sd**2 + VERTICALS**2) * np.eye(2)
    # Anticlockwise azimuths mirror the lean in x.
    differences = np.stack([points - lines, points - lines * [-1, 1]])
    w, mirrored = np.sqrt(
        np.sum(differences * np.linalg.solve(covariance, differences.T).T, axis=1)
    ).tolist()
    return LeanTest(lines, points, w, mirrored, float(np.sqrt(np.trace(covariance) / 2)))


def check_leans(job, wall):
    """Yield a warning of a `Wall` whose lines show another lean than its points."""
    test = compare_leans(levels_and_lean(job, wall.read)[1], wall.shell)
    if test is None or test.w <= CRITICAL_LEAN:
        return
    size_of_lines, size = np.hypot(*test.of_lines), np.hypot(*test.of_points)
    figures = {
        "lines": 1000 * size_of_lines,
        "to_lines": np.degrees(np.arctan2(*test.of_lines)) % 360,
        "points": 1000 * size,
        "to_points": np.degrees(np.arctan2(*test.of_points)) % 360,
        "w": test.w,
    }
    finding = message(
        "leans_differ",
        "the lines show a lean of {lines:.2f} mm/m towards {to_lines:.0f} deg, the points one of"
        " {points:.2f} mm/m towards {to_points:.0f} deg (w = {w:.1f})",
        **figures,
    )
    if test.mirrored_w <= CRITICAL_LEAN:
        cause = message(
            "leans_mirrored", "do the azimuths of the lines grow anticlockwise? Then both agree"
        )
    elif abs(size_of_lines - size) <= CRITICAL_LEAN * test.sd:
        cause = message(
            "leans_turned",
            "do the lines count from another azimuth? Turned by {turn:+.0f} deg both agree",
            turn=np.degrees(test.turned_rad),
        )
    else:
        cause = message("leans_unlike", "was the plummet, or the network, upright?")
    text = message("leans_with_cause", "{found}: {cause}", found=finding, cause=cause)
    yield Problem("lines.csv", text, column="azimuth_deg")


def _check_rejected(job, wall):
    """Warn of rejected offsets; if there are many, warn of their declared standard deviation."""
    places = wall.places[wall.are("offsets")]
    w, _, accepted = wall.tests_of("offsets")
    deviations_m = wall.tested.departure_m[wall.are("offsets")]
    offsets = [job.lines.offsets[place] for place in places]
    rejected = [offset for offset, is_kept in zip(offsets, accepted, strict=True) if not is_kept]
    share_of_lines = len({offset.line for offset in rejected}) / len(job.lines.lines)
    if len(rejected) > MANY * len(offsets) and share_of_lines > MANY_LINES:
        text = message(
            "many_offsets_set_aside",
            "{count} of {all} offsets, on {lines} lines, depart from what all others show by more"
            " than their standard deviations of {sd_mm:g} mm (median) allow, and were rejected: is"
            " s_mm too small, or in another unit?",
            count=len(rejected),
            all=len(offsets),
            lines=len({offset.line for offset in rejected}),
            sd_mm=1000 * float(np.median([offset.sd_m for offset in offsets])),
        )
        yield Problem(FILE, text, row=rejected[0].row, column="s_mm")
        return
    for place, statistic, is_kept, radial_m in zip(places, w, accepted, deviations_m, strict=True):
        if not is_kept:
            offset = job.lines.offsets[place]
            text = message(
                "offset_set_aside",
                "line {line!r} at {level_m:g} m: {away_mm:+.1f} mm of radius from what all others"
                " show, w = {w:.1f}; it was rejected",
                line=offset.line,
                level_m=offset.level_m,
                away_mm=1000 * radial_m,
                w=statistic,
            )
            yield Problem(FILE, text, row=offset.row, column="offset_mm")


def _check_moved_lines(job):
    """Warn of lines whose readings at the reference level differ: the instrument may have moved."""
    readings = {}
    for offset in job.lines.offsets:
        if offset.reference:
            readings.setdefault((offset.line, offset.face), []).append(offset)
    factor = repeat_factor(max(sum(len(group) - 1 for group in readings.values()), 1))
    for (line, _), repeats in readings.items():
        offsets_m = [offset.offset_m for offset in repeats]
        limit = limits_of(RULES)["reference_repeats_mm"] / 1000
        limit = max(limit, factor * max(offset.sd_m for offset in repeats)) + WRITTEN_M
        if max(offsets_m) - min(offsets_m) > limit:
            text = message(
                "line_moved",
                "the readings of line {line!r} at the reference level differ by {apart_mm:.1f} mm;"
                " expected at most {limit_mm:.1f} mm: did the instrument move?",
                line=line,
                apart_mm=1000 * (max(offsets_m) - min(offsets_m)),
                limit_mm=1000 * limit,
            )
            yield Problem(FILE, text, row=repeats[-1].row, column="offset_mm")


def _check_copied_lines(job):
    """Warn of lines with equal readings to the last digit."""
    readings = {}
    for offset in job.lines.offsets:
        readings.setdefault(offset.line, {})[
            round(offset.level_m, 3), offset.face, offset.reference
        ] = offset
    for (first, before), (second, after) in combinations(readings.items(), 2):
        common = before.keys() & after.keys()
        is_equal = all(before[place].offset_m == after[place].offset_m for place in common)
        if len(common) >= FEWEST_ALIKE and is_equal:
            text = message(
                "line_copied",
                "all {count} readings of line {second!r} are those of line {first!r}, to the last"
                " digit: were they copied?",
                count=len(common),
                second=second,
                first=first,
            )
            row = min(offset.row or 0 for offset in after.values()) or None
            yield Problem(FILE, text, row=row, column="line")


def _check_numbers(job, wall):
    """Warn of few lines, and of courses with a single level."""
    circumference = np.pi * job.tank.nominal_diameter_m
    least = least_lines(circumference)
    if len(job.lines.lines) < least:
        text = message(
            "few_lines",
            "{count} lines round {circumference_m:.0f} m; {least} or more are advised",
            count=len(job.lines.lines),
            circumference_m=circumference,
            least=least,
        )
        yield Problem("lines.csv", text, column="line")
    offsets = accepted_offsets(job, wall)
    levels = {}
    for offset, level in zip(offsets, level_names(offsets), strict=True):
        levels.setdefault(offset.course, set()).add(int(level))
    courses = [
        name
        for name, numbers in levels.items()
        if len(numbers) < limits_of(RULES)["levels_a_course"]
    ]
    if courses:
        text = message(
            "few_levels",
            "courses {courses}: one level; two are advised, else nothing shows how they taper",
            courses=", ".join(courses),
        )
        yield Problem(FILE, text, column="level_m")


def _check_axis(job, levels, lean):
    """Warn of a level whose centre is far from the axis through the centres of the others."""
    if len(levels) < FEWEST_LEVELS or not np.isfinite(lean.x):
        return
    heights = np.array([level.level_m for level in levels])
    centres = np.array([level.centre_m for level in levels])
    high, low = np.nonzero(heights[:, None] > heights)
    slopes = (centres[high] - centres[low]) / (heights[high] - heights[low])[:, None]
    slope = np.median(slopes, axis=0)  # median of all pairs (Theil 1950): robust against an outlier
    axis = np.median(centres, axis=0) + (heights - np.median(heights))[:, None] * slope
    distances = np.linalg.norm(centres - axis, axis=1)
    typical = SD_OVER_MEDIAN * float(np.median(distances))
    worst = int(np.argmax(distances))
    if distances[worst] > max(OFF_AXIS_M, OFF_AXIS_SDS * typical):
        level = levels[worst]
        text = message(
            "level_off_axis",
            "the centre of {level_m:g} m on course {course!r} stands {away_mm:.0f} mm off the axis"
            " through the others: are its readings those of another level?",
            level_m=level.level_m,
            course=level.course,
            away_mm=1000 * distances[worst],
        )
        yield Problem(FILE, text, column="level_m")


def _check_scope(job, lean):
    """Warn of a lean or a diameter outside the scope of the method."""
    lean_size, most = float(np.hypot(lean.x, lean.y)), limits_of(RULES)["most_lean"]
    if lean_size > most:
        text = message(
            "leans_too_much",
            "the shell leans by {lean:.1f} %; the method is meant for at most {most:g} %",
            lean=100 * lean_size,
            most=100 * most,
        )
        yield Problem(FILE, text, column="offset_mm")
    diameter, least = job.tank.nominal_diameter_m, limits_of(RULES)["least_diameter_m"]
    if diameter < least:
        text = message(
            "too_small_for_lines",
            "a diameter of {diameter:g} m; the method is meant for {least:g} m or more",
            diameter=diameter,
            least=least,
        )
        yield Problem("lines.csv", text)


def _check_plummets(job):
    """Warn of collimations, determined in two faces, that differ from the certificate."""
    used = [offset for offset in job.lines.offsets if not offset.check]
    for name, plummet in job.lines.plummets.items():
        collimation = collimation_by_faces(job.lines, used, name)
        u = plummet.u_collimation_rad
        if collimation is None or u is None:
            continue
        kappa, sd = collimation
        if abs(kappa) > UNLIKE_SDS * np.hypot(u, sd):
            text = message(
                "collimation_unlike_certificate",
                "its two faces tell a collimation of {kappa:+.1f} arcsec; its standard uncertainty"
                " is said to be {u:g}",
                kappa=kappa / ARCSEC,
                u=u / ARCSEC,
            )
            yield Problem("instruments.toml", text, column=f"{name}.u_collimation_arcsec")


def _check_straps(job, wall, levels):
    """Warn of straps that differ from the levels of their course by more than a bulge."""
    reference = next(offset for offset in job.lines.offsets if offset.reference)
    rises = {reference.course: [(reference.level_m, 0.0)]}
    for level in levels:
        rises.setdefault(level.course, []).append((level.level_m, level.rise_m))
    zeros = {}  # {course: [(radius at the reference level, strap)]}
    # The readings list straps first.
    for place, reading in zip(wall.straps.adjusted, wall.readings, strict=False):
        strap = wall.reduced[place].strap
        if strap.course in rises:
            nearest = min(rises[strap.course], key=lambda rise: abs(rise[0] - strap.level_m))
            zeros.setdefault(strap.course, []).append((reading.radius_m - nearest[1], strap))
    if not zeros:
        return
    course = reference.course if reference.course in zeros else next(iter(zeros))
    pairs_of_course = sorted(zeros.pop(course), key=lambda pair: pair[0])
    apart, (first, second) = (
        pairs_of_course[-1][0] - pairs_of_course[0][0],
        (pairs_of_course[0][1], pairs_of_course[-1][1]),
    )
    if apart > OFF_LEVEL_M and first.name != second.name:  # another check compares repeats
        text = message(
            "straps_apart_by_lines",
            "circumferences {first!r} and {second!r} of course {course!r} differ by {apart_mm:.1f}"
            " mm of radius beyond what the lines show between their levels: is one of them misread"
            " or over an obstruction?",
            first=first.name,
            second=second.name,
            course=course,
            apart_mm=1000 * apart,
        )
        yield Problem("circumferences.csv", text, row=second.row, column="reading_m")
    zero = np.mean([radius for radius, _ in pairs_of_course])
    for radius, strap in (pair for pairs in zeros.values() for pair in pairs):
        if abs(radius - zero) > OFF_LEVEL_M:
            text = message(
                "strap_against_lines",
                "circumference {name!r} gives a radius that is {away_mm:+.1f} mm off what the"
                " lines carry up from course {course!r}: is it misread, or is the side of the"
                " lines the other one?",
                name=strap.name,
                away_mm=1000 * (radius - zero),
                course=course,
            )
            yield Problem("circumferences.csv", text, row=strap.row, column="reading_m")
    if not zeros:
        yield from check_sign(job, levels)
