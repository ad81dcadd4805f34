"""Warnings of reference lines: offsets that were rejected, lines that moved, too few of them."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.line_departures import check_lines_apart, check_scale, check_sign
from tankcal.pipeline.survey_limits import limit_at, limits_of, repeat_factor
from tankcal.survey.reference_line import (
    ARCSEC,
    collimation_by_faces,
    lean_of,
    level_names,
    levels_of,
)

FILE, RULES = "offsets.csv", "reference_line"
UNLIKE_SDS = 3.0  # of a collimation, from what its certificate says
OFF_AXIS_M, OFF_AXIS_SDS = 0.01, 6.0  # of a level's centre, from the straight axis
OFF_LEVEL_M = 0.003  # of a strap's radius, from the levels of its course
SCALE_OF_MEDIAN = 1.4826
WRITTEN_M = 5e-5  # half the last digit that is said of a difference
CRITICAL_LEAN = 3.72  # of two slopes together: a chi-square of two exceeds it in 0.1 %
VERTICALS = 1e-4  # m/m: how alike the verticals of a plummet and of the points are, 20"
MANY, MANY_LINES = 0.15, 0.5  # of the offsets, and of the lines with one of them, rejected
FEWEST_LEVELS, FEWEST_ALIKE = 5, 4  # to tell a level, or a copied line, from the others


def least_lines(circumference_m):
    """How many lines a tank of that circumference should have."""
    return limit_at(RULES, "lines", "least", circumference_m)


def accepted_offsets(job, wall):
    """Offsets that the wall was taken from."""
    places = wall.places[wall.are("offsets")]
    _, _, accepted = wall.tests_of("offsets")
    return [job.lines.offsets[i] for i in places[accepted]]


def levels_and_lean(job, wall):
    """`Level`s and `Lean` of the accepted offsets, with the adjusted collimations."""
    kappa = {name: one[0] for name, one in wall.collimations.items()}
    levels = levels_of(job.lines, accepted_offsets(job, wall), kappa)
    return levels, lean_of(job.lines, levels)


def check_lines(job, wall):
    """`Problem`s of the reference lines of a wall; none where there are no lines."""
    if job.lines is None:
        return ()
    levels, lean = levels_and_lean(job, wall)
    return (
        *_set_aside(job, wall),
        *_moved(job),
        *_copied(job),
        *check_lines_apart(job, wall.collimations),
        *check_scale(job),
        *_too_few(job, wall),
        *_off_axis(job, levels, lean),
        *_of_scope(job, lean),
        *_of_plummets(job),
        *(_of_straps(job, wall, levels) if wall.surveyed_as == "strapped" else ()),
    )


@dataclass(frozen=True)
class LeanTest:
    """The lean that lines show against the lean of the points.

    Attributes
    ----------
    of_lines, of_points : ndarray, shape (2,)
        Slope of the axis towards +x and +y.
    w : float
        Length of the difference over its standard deviation.
    mirrored_w : float
        The same with azimuths of lines that grow anticlockwise.
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
        """Angle from the lean of the lines to that of the points, clockwise."""
        before, after = (np.arctan2(*one) for one in (self.of_lines, self.of_points))
        return float((after - before + np.pi) % (2 * np.pi) - np.pi)


def compare_leans(lean, shell):
    """`LeanTest` of the `Lean` of lines against that of a `Shell`; None: one is not known.

    w = sqrt(d' C^-1 d) of the difference d of both slopes; C is the sum of their covariances and
    VERTICALS squared.

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
    spread = shell.slope_cofactor + (lean.sd**2 + VERTICALS**2) * np.eye(2)
    away = np.stack([points - lines, points - lines * [-1, 1]])
    w, mirrored = np.sqrt(np.sum(away * np.linalg.solve(spread, away.T).T, axis=1)).tolist()
    return LeanTest(lines, points, w, mirrored, float(np.sqrt(np.trace(spread) / 2)))


def check_leans(job, wall):
    """`Problem`s of a `Wall` whose lines lean otherwise than its points."""
    if job.lines is None:
        return
    test = compare_leans(levels_and_lean(job, wall.read)[1], wall.shell)
    if test is None or test.w <= CRITICAL_LEAN:
        return
    size_of_lines, size = np.hypot(*test.of_lines), np.hypot(*test.of_points)
    told = {
        "lines": 1000 * size_of_lines,
        "to_lines": np.degrees(np.arctan2(*test.of_lines)) % 360,
        "points": 1000 * size,
        "to_points": np.degrees(np.arctan2(*test.of_points)) % 360,
        "w": test.w,
    }
    found = message(
        "leans_differ",
        "the lines show a lean of {lines:.2f} mm/m towards {to_lines:.0f} deg, the points one of"
        " {points:.2f} mm/m towards {to_points:.0f} deg (w = {w:.1f})",
        **told,
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
    text = message("leans_with_cause", "{found}: {cause}", found=found, cause=cause)
    yield Problem("lines.csv", text, column="azimuth_deg")


def _set_aside(job, wall):
    places = wall.places[wall.are("offsets")]
    w, _, accepted = wall.tests_of("offsets")
    away = wall.tested.departure_m[wall.are("offsets")]
    read = [job.lines.offsets[place] for place in places]
    lost = [one for one, kept in zip(read, accepted, strict=True) if not kept]
    share_of_lines = len({one.line for one in lost}) / len(job.lines.lines)
    if len(lost) > MANY * len(read) and share_of_lines > MANY_LINES:
        text = message(
            "many_offsets_set_aside",
            "{count} of {all} offsets, on {lines} lines, depart from what all others show by more"
            " than their standard deviations of {sd_mm:g} mm (median) allow, and were rejected: is"
            " s_mm too small, or in another unit?",
            count=len(lost),
            all=len(read),
            lines=len({one.line for one in lost}),
            sd_mm=1000 * float(np.median([one.sd_m for one in read])),
        )
        yield Problem(FILE, text, row=lost[0].row, column="s_mm")
        return
    for place, of_w, kept, by_m in zip(places, w, accepted, away, strict=True):
        if not kept:
            one = job.lines.offsets[place]
            text = message(
                "offset_set_aside",
                "line {line!r} at {level_m:g} m: {away_mm:+.1f} mm of radius from what all others"
                " show, w = {w:.1f}; it was rejected",
                line=one.line,
                level_m=one.level_m,
                away_mm=1000 * by_m,
                w=of_w,
            )
            yield Problem(FILE, text, row=one.row, column="offset_mm")


def _moved(job):
    """Lines whose readings at the reference level differ: the instrument was moved between."""
    seen = {}
    for one in job.lines.offsets:
        if one.reference:
            seen.setdefault((one.line, one.face), []).append(one)
    factor = repeat_factor(max(sum(len(one) - 1 for one in seen.values()), 1))
    for (line, _), several in seen.items():
        found = [one.offset_m for one in several]
        limit = limits_of(RULES)["reference_repeats_mm"] / 1000
        limit = max(limit, factor * max(one.sd_m for one in several)) + WRITTEN_M
        if max(found) - min(found) > limit:
            text = message(
                "line_moved",
                "the readings of line {line!r} at the reference level differ by {apart_mm:.1f} mm;"
                " expected at most {limit_mm:.1f} mm: did the instrument move?",
                line=line,
                apart_mm=1000 * (max(found) - min(found)),
                limit_mm=1000 * limit,
            )
            yield Problem(FILE, text, row=several[-1].row, column="offset_mm")


def _copied(job):
    """Lines of equal readings, to the last digit."""
    read = {}
    for one in job.lines.offsets:
        read.setdefault(one.line, {})[round(one.level_m, 3), one.face, one.reference] = one
    for (first, before), (second, after) in combinations(read.items(), 2):
        both = before.keys() & after.keys()
        alike = all(before[place].offset_m == after[place].offset_m for place in both)
        if len(both) >= FEWEST_ALIKE and alike:
            text = message(
                "line_copied",
                "all {count} readings of line {second!r} are those of line {first!r}, to the last"
                " digit: were they copied?",
                count=len(both),
                second=second,
                first=first,
            )
            row = min(one.row or 0 for one in after.values()) or None
            yield Problem(FILE, text, row=row, column="line")


def _too_few(job, wall):
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
    used = accepted_offsets(job, wall)
    levels = {}
    for one, level in zip(used, level_names(used), strict=True):
        levels.setdefault(one.course, set()).add(int(level))
    few = [
        name for name, those in levels.items() if len(those) < limits_of(RULES)["levels_a_course"]
    ]
    if few:
        text = message(
            "few_levels",
            "courses {courses}: one level; two are advised, else nothing shows how they taper",
            courses=", ".join(few),
        )
        yield Problem(FILE, text, column="level_m")


def _off_axis(job, levels, lean):
    """A level whose centre stands far off the axis through those of the others."""
    if len(levels) < FEWEST_LEVELS or not np.isfinite(lean.x):
        return
    heights = np.array([one.level_m for one in levels])
    centres = np.array([one.centre_m for one in levels])
    high, low = np.nonzero(heights[:, None] > heights)
    slopes = (centres[high] - centres[low]) / (heights[high] - heights[low])[:, None]
    slope = np.median(slopes, axis=0)  # Theil 1950: of all pairs, so that one level bends nothing
    axis = np.median(centres, axis=0) + (heights - np.median(heights))[:, None] * slope
    away = np.linalg.norm(centres - axis, axis=1)
    usual = SCALE_OF_MEDIAN * float(np.median(away))
    worst = int(np.argmax(away))
    if away[worst] > max(OFF_AXIS_M, OFF_AXIS_SDS * usual):
        one = levels[worst]
        text = message(
            "level_off_axis",
            "the centre of {level_m:g} m on course {course!r} stands {away_mm:.0f} mm off the axis"
            " through the others: are its readings those of another level?",
            level_m=one.level_m,
            course=one.course,
            away_mm=1000 * away[worst],
        )
        yield Problem(FILE, text, column="level_m")


def _of_scope(job, lean):
    size, most = float(np.hypot(lean.x, lean.y)), limits_of(RULES)["most_lean"]
    if size > most:
        text = message(
            "leans_too_much",
            "the shell leans by {lean:.1f} %; the method is meant for at most {most:g} %",
            lean=100 * size,
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


def _of_plummets(job):
    """Collimations by both faces that are not what the certificate says."""
    used = [one for one in job.lines.offsets if not one.check]
    for name, plummet in job.lines.plummets.items():
        found = collimation_by_faces(job.lines, used, name)
        u = plummet.u_collimation_rad
        if found is None or u is None:
            continue
        kappa, sd = found
        if abs(kappa) > UNLIKE_SDS * np.hypot(u, sd):
            text = message(
                "collimation_unlike_certificate",
                "its two faces tell a collimation of {kappa:+.1f} arcsec; its standard uncertainty"
                " is said to be {u:g}",
                kappa=kappa / ARCSEC,
                u=u / ARCSEC,
            )
            yield Problem("instruments.toml", text, column=f"{name}.u_collimation_arcsec")


def _of_straps(job, wall, levels):
    """Straps that the lines contradict: unlike the levels of their course by more than a bulge."""
    reference = next(one for one in job.lines.offsets if one.reference)
    risen = {reference.course: [(reference.level_m, 0.0)]}
    for one in levels:
        risen.setdefault(one.course, []).append((one.level_m, one.rise_m))
    zeros = {}  # radius at the reference level, by each strap
    for place, reading in zip(
        wall.straps.adjusted, wall.readings, strict=False
    ):  # straps come first
        strap = wall.reduced[place].strap
        if strap.course in risen:
            nearest = min(risen[strap.course], key=lambda one: abs(one[0] - strap.level_m))
            zeros.setdefault(strap.course, []).append((reading.radius_m - nearest[1], strap))
    if not zeros:
        return
    course = reference.course if reference.course in zeros else next(iter(zeros))
    own = sorted(zeros.pop(course), key=lambda one: one[0])
    apart, (first, second) = own[-1][0] - own[0][0], (own[0][1], own[-1][1])
    if apart > OFF_LEVEL_M and first.name != second.name:  # of repeats another check tells
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
    zero = np.mean([radius for radius, _ in own])
    for radius, strap in (one for those in zeros.values() for one in those):
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
