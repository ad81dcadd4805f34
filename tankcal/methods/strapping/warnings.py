"""Warnings about a strapping that are unlikely for a valid survey of a tank without defects.

The checks name a probable cause: exchanged courses, an inside circumference, or a single wrong
strap. Checks of the tapes and of their readings are in `tape_warnings`.
"""

import numpy as np

from tankcal.adjust import CRITICAL, SD_OVER_MEDIAN
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.methods.base import completing_method
from tankcal.methods.moved_setups import tested
from tankcal.methods.strapping.tape_warnings import check_tapes
from tankcal.pipeline.checks.size import (
    allowed_departure_m,
    check_side,
    departure_of_size,
    is_size_declared,
    nominal_radius_m,
)
from tankcal.pipeline.checks.survey import limit_at, limits_of
from tankcal.pipeline.read_wall import FORMER
from tankcal.pipeline.taped_wall import course_apart, exchanged_courses

FILE = "circumferences.csv"
# Largest slope that suggests plates not flush inside; smallest range of plates that shows it.
FLUSH, LEAST_STEP_M = 0.5, 1e-3
SHORT_BY_PLATES = 0.5, 1.5  # range of the shortfall from the nominal radius, in plates
# Narrower limits of both, which exclude plates with flush centre lines.
SURELY_FLUSH, SURELY_SHORT_BY_PLATES = 0.25, (0.75, 1.25)
FAR_REPEATS = 5  # least discrepancy of a course from the others, in limits of repeats
FAR_LIMITS = 10  # discrepancy of a gross error, in limits of repeats: 5 mm of radius
FARTHEST_M = 1.0  # largest standard deviation of a controlled discrepancy
APART_SDS = 6.0  # limit of the range of the readings within a course, in standard deviations


def limit_of_repeats(circumference_m, table="repeats"):
    """Largest accepted difference between repeats of a circumference, m.

    Parameters
    ----------
    circumference_m : float
    table : str
        Table of the rule file: "repeats" or "repeats_lying".
    """
    return limit_at("strapping", table, "limit_mm", circumference_m) / 1000


def check_strapping(job, wall):
    """`Problem`s of straps: of the wall that they determine, or beside the points of a `Wall`."""
    straps = getattr(wall, "straps", None)
    if straps is None or job.tank.kind != "vertical":
        return ()
    of_tapes = (*check_tapes(job, straps, job.strapping), *check_repeats(straps))
    if wall.surveyed_as == "wall":
        return (*of_tapes, *_check_contradictions(straps, strapped_together(wall)))
    return (
        *of_tapes,
        *_check_pairs(job, straps),
        *(_check_courses(job, straps) if completing_method(job) is None else ()),
        *_check_first_course(job, straps),
        *_check_single_course(job, straps),
        *_check_uncontrolled(job, wall),
    )


def strapped_together(wall):
    """Circumferences of a `Wall` whose repeats jointly contradict its points and the other straps.

    Repeats support each other, so that no single repeat appears discrepant. Let P be the reduced
    weight matrix of the readings y, with the free parameters eliminated. Let a be 1 for the
    readings of one circumference and 0 elsewhere. Their radius differs from the other readings by
    a' P y / a' P a. The test statistic w is this difference times sqrt(a' P a) (Cook & Weisberg
    1982).

    Returns
    -------
    dict
        {index in the file of the first repeat: (w, departure_m)}.
    """
    straps, names = wall.straps, {}
    adjusted = straps.adjusted[straps.accepted]
    for index, place in enumerate(adjusted, len(wall.field.radius_m) - len(wall.readings)):
        names.setdefault(straps.reduced[place].strap.name, []).append((index, place))
    repeated = [repeats for repeats in names.values() if len(repeats) > 1]
    if not repeated:
        return {}
    count = len(wall.field.radius_m)
    precision, pull = tested(wall.field, wall.field.covariance_m2, count)
    discrepant = {}
    for repeats in repeated:
        index = [number for number, _ in repeats]
        weight = precision[np.ix_(index, index)].sum()
        if weight > 1 / FARTHEST_M**2:  # otherwise uncontrolled
            departure = pull[index].sum() / weight
            discrepant[repeats[0][1]] = float(departure * np.sqrt(weight)), float(departure)
    return discrepant


def _check_contradictions(straps, together):
    """Problems of straps that contradict the points and the other straps.

    Parameters
    ----------
    straps : Straps
    together : dict
        Result of `strapped_together`.
    """
    jointly = {}
    for place, (w, departure) in together.items():
        strap = straps.reduced[place]
        miss = abs(departure) * straps.per_radius
        if abs(w) > CRITICAL and miss > limit_of_repeats(strap.circumference_m):
            jointly[strap.strap.name] = place, True, w, departure
    tests = zip(straps.adjusted, straps.accepted, straps.w, straps.departure_m, strict=True)
    single = [
        (place, accepted, w, departure)
        for place, accepted, w, departure in tests
        if abs(w) > CRITICAL and not (accepted and straps.reduced[place].strap.name in jointly)
    ]
    for place, accepted, w, departure in (*jointly.values(), *single):
        strap = straps.reduced[place]
        name, course, size = strap.strap.name, strap.strap.course, abs(w)
        miss = 1000 * departure * straps.per_radius
        template = (
            "circumference {name!r} of course {course!r} is {miss_mm:+.1f} mm from what the points"
            " and all other straps show (w = {w:.1f}): which of them is wrong?"
        )
        is_far = abs(miss) > 1000 * FAR_LIMITS * limit_of_repeats(strap.circumference_m)
        if accepted and is_far:
            text = message(
                "strap_contradicts_far", template, name=name, course=course, miss_mm=miss, w=size
            )
        elif accepted:
            text = message(
                "strap_contradicts", template, name=name, course=course, miss_mm=miss, w=size
            )
        else:
            text = message(
                "strap_set_aside",
                "circumference {name!r} of course {course!r} is {miss_mm:+.1f} mm from what the"
                " points and all other straps show (w = {w:.1f}) and was rejected",
                name=name,
                course=course,
                miss_mm=miss,
                w=size,
            )
        yield _problem(text, strap.strap)


def _problem(text, strap=None, column="reading_m"):
    return Problem(FILE, text, row=None if strap is None else strap.row, column=column)


def check_repeats(straps, table="repeats"):
    """`Problem`s of repeats with too large differences; `table` as in `limit_of_repeats`."""
    by_name = {}
    for reduced_strap in straps.reduced:
        by_name.setdefault(reduced_strap.strap.name, []).append(reduced_strap)
    for name, repeats in by_name.items():
        if len(repeats) < 2:
            continue
        lengths_m = [repeat.circumference_m for repeat in repeats]
        limit, range_m = limit_of_repeats(lengths_m[0], table), max(lengths_m) - min(lengths_m)
        if range_m > limit:
            template = (
                "the readings of circumference {name!r} differ by {apart_mm:.1f} mm; expected at"
                " most {limit_mm:g} mm"
            )
            mm, most = 1000 * range_m, 1000 * limit
            if range_m > FAR_LIMITS * limit:
                text = message("repeats_far", template, name=name, apart_mm=mm, limit_mm=most)
            else:
                text = message("repeats_apart", template, name=name, apart_mm=mm, limit_mm=most)
            yield _problem(text, repeats[int(np.argmax(lengths_m))].strap)


def _check_pairs(job, straps):
    """Problems of straps that differ from the other straps of their course by more than taper."""
    for size, reduced_strap, count, typical in straps_apart(
        [course.name for course in job.courses], straps
    ):
        template = (
            "the {count} straps of course {course!r} differ by {apart_mm:.1f} mm, those of"
            " other courses by {usual_mm:.1f} mm: is one of them misread, over an obstruction"
            " or not level?"
        )
        course, apart_mm, least = reduced_strap.strap.course, 1000 * size, 1000 * typical
        if size > FAR_LIMITS * limit_of_repeats(reduced_strap.circumference_m):
            text = message(
                "strap_far", template, count=count, course=course, apart_mm=apart_mm, usual_mm=least
            )
        else:
            text = message(
                "strap_apart",
                template,
                count=count,
                course=course,
                apart_mm=apart_mm,
                usual_mm=least,
            )
        yield _problem(text, reduced_strap.strap)


def straps_apart(names, straps):
    """Yield straps that differ from the other straps of their course or ring.

    Yields
    ------
    (float, Reduced, int, float)
        Range of the circumferences, m, most discrepant strap, number of levels, and typical range
        of the other courses, m.
    """
    adjusted = [straps.reduced[i] for i in straps.adjusted]
    ranges = []
    for name in names:
        straps_of_course = [
            reduced_strap for reduced_strap in adjusted if reduced_strap.strap.course == name
        ]
        levels = {reduced_strap.strap.level_m for reduced_strap in straps_of_course}
        if len(levels) > 1:
            lengths_m = np.array(
                [reduced_strap.circumference_m for reduced_strap in straps_of_course]
            )
            deviations = lengths_m - np.median(lengths_m)
            ranges.append(
                (
                    np.ptp(lengths_m),
                    straps_of_course[int(np.argmax(np.abs(deviations)))],
                    len(levels),
                )
            )
    if len(ranges) < 3:
        return
    typical = SD_OVER_MEDIAN * float(np.median([size for size, _, _ in ranges]))
    for size, reduced_strap, count in ranges:
        if size > max(APART_SDS * typical, 2 * limit_of_repeats(reduced_strap.circumference_m)):
            yield size, reduced_strap, count, typical


def _check_courses(job, straps):
    """Problems of inside radii that differ from the drawing, and of exchanged courses."""
    plates = np.array([course.thickness_m + course.paint_m for course in job.courses])
    inside, names = straps.radius_m - plates, [course.name for course in job.courses]
    nominal, median = nominal_radius_m(job, float(plates[0])), float(np.median(inside))
    slope, short = _slope_and_shortness(job, straps, plates)
    low, high = SHORT_BY_PLATES
    steps_inside = slope < FLUSH and low < short < high
    if abs(median - nominal) > allowed_departure_m(job) or steps_inside:
        miss, plate = 1000 * (median - nominal), float(np.median(plates))
        template = (
            "the courses come out {miss_mm:+.0f} mm of radius from the nominal one, about their"
            " plates: is the nominal diameter that of the outside, or are the circumferences those"
            " of the inside?"
        )
        low, high = SURELY_SHORT_BY_PLATES
        if slope < SURELY_FLUSH and low < short < high:
            text = message("circumference_of_inside", template, miss_mm=miss)
        elif departure_of_size(job, median, plate) and not steps_inside:
            text = message(
                "strapped_unlike_nominal",
                "the courses come out {miss_mm:+.0f} mm of radius from the nominal one",
                miss_mm=miss,
            )
        else:
            text = message("courses_short_by_plates", template, miss_mm=miss)
        yield _problem(text)
    share = limits_of("nominal_size")["share"] * nominal
    strapped = {reduced_strap.strap.course for reduced_strap in straps.reduced}
    # Lines determine the other courses.
    strapped_courses = [i for i, name in enumerate(names) if name in strapped]
    exchanged = exchanged_courses(straps.radius_m, plates, strapped_courses)
    discrepant = {
        name: radius - median
        for name, radius in zip(names, inside, strict=True)
        if abs(radius - median) > share
    }
    if not discrepant and exchanged is None:
        discrepant = _far_from_others(straps, names, inside)
    for name, deviation in discrepant.items():
        template = (
            "course {name!r} comes out {miss_mm:+.1f} mm of radius from the others: did its straps"
            " lie over an obstruction, or is its plate another one?"
        )
        if abs(deviation) > share / 2:
            text = message("strapped_course_far", template, name=name, miss_mm=1000 * deviation)
        else:
            text = message("strapped_course_apart", template, name=name, miss_mm=1000 * deviation)
        yield _problem(text, column="course")
    if exchanged is not None:
        lower, upper, sum_m, steps = exchanged
        text = message(
            "courses_exchanged",
            "with the readings of courses {one!r} and {other!r} exchanged the steps between"
            " courses would add up to {left_mm:.1f} mm in place of {steps_mm:.1f} mm: are"
            " they mixed up?",
            one=names[lower],
            other=names[upper],
            left_mm=1000 * sum_m,
            steps_mm=1000 * steps,
        )
        yield _problem(text, column="course")


def _far_from_others(straps, names, inside_m):
    """{name: difference from the other radii, m} of a course that differs most.

    A course with a discrepant strap is omitted, because `_of_pairs` reports the strap.
    """
    least = FAR_REPEATS * limit_of_repeats(float(np.median(straps.circumference_m)))
    discrepant = course_apart(inside_m, least / straps.per_radius)
    reported = {strap.strap.course for _, strap, _, _ in straps_apart(names, straps)}
    return (
        {}
        if discrepant is None or names[discrepant[0]] in reported
        else {names[discrepant[0]]: discrepant[1]}
    )


def _slope_and_shortness(job, straps, plates_m):
    """Ratio of outside steps to plate steps, and shortfall from the nominal radius in plates.

    The ratio is 1 for plates flush inside. It is 0 for inside circumferences and for plates flush
    outside. It is inf if the steps do not determine it.
    """
    plate = float(np.median(plates_m))
    short = job.tank.nominal_diameter_m / 2 - float(np.median(straps.radius_m - plates_m))
    short = short / plate if plate > 0 else 0.0
    strapped = {reduced_strap.strap.course for reduced_strap in straps.reduced}
    if len(strapped) < len(plates_m) or np.ptp(plates_m) < LEAST_STEP_M:
        return np.inf, short
    if job.diameter_is is not None:  # `check_side` tests the plate
        return np.inf, short
    steps = plates_m - plates_m.mean()
    return float(straps.radius_m @ steps / (steps @ steps)), short


def _check_first_course(job, straps):
    """Problems of the first course against the drawing and the declared circumference."""
    course = job.courses[0]
    plate = course.thickness_m + course.paint_m
    yield from check_side(job, 2 * (straps.radius_m[0] - plate), plate, 0.0)
    measured = straps.circumference_m[0]
    declared = job.circumference_m
    if declared is not None and abs(measured - declared) > limit_of_repeats(measured):
        yield Problem(
            "job.toml",
            message(
                "strapped_unlike_declared",
                "{declared_m:.4f} m, and {found_m:.4f} m by circumferences.csv: they differ by"
                " {miss_mm:+.0f} mm",
                declared_m=declared,
                found_m=measured,
                miss_mm=1000 * (measured - declared),
            ),
            column="checks.circumference_m",
        )


def _check_single_course(job, straps):
    """Problem of a tank whose size depends on the straps of a single course.

    The other courses are determined relative to this course by reference lines.
    """
    strapped = {reduced_strap.strap.course for reduced_strap in straps.reduced}
    is_completed = completing_method(job) is not None
    if job.lines is None or is_completed or len(strapped) > 1 or is_size_declared(job):
        return
    text = message(
        "size_told_by_one_course",
        "blank, and nothing but the straps of course {course!r} tells how large the tank is: one"
        " that lies over a manhole would not show; strap another course, or say what the nominal"
        " diameter is on the drawing",
        course=strapped.pop(),
    )
    yield Problem("job.toml", text, column="checks.diameter_is")


def _check_uncontrolled(job, wall):
    """Problem of courses with a single reading, in which no other reading reveals a blunder."""
    single = read_once([course.name for course in job.courses], wall)
    if single:
        yield _problem(
            message(
                "controlled_by_nothing",
                "courses {courses}: a single reading, which nothing controls; a second strap would",
                courses=", ".join(single),
            ),
            column="course",
        )


def read_once(names, wall):
    """Names of the courses or rings with a single accepted reading."""
    courses = [reading.course for reading in wall.accepted if reading.of != FORMER]
    counts = np.bincount(courses, minlength=len(names))
    return [name for name, count in zip(names, counts, strict=True) if count == 1]
