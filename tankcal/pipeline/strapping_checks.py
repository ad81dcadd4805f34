"""Warnings of a strapping: what a sound crew on a sound tank hardly brings home.

Causes are named where one fits: courses exchanged, a reading of the inside, a strap that is off by
itself. What the tapes and their readings say of themselves: `tape_checks`.
"""

from itertools import combinations

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.cross_checks import check_side
from tankcal.pipeline.survey_limits import limit_at
from tankcal.pipeline.tape_checks import check_tapes
from tankcal.pipeline.wall_readings import FORMER

FILE = "circumferences.csv"
NOMINAL_SHARE = 1 / 500  # of the radius: a course that departs by more from the nominal one
FLUSH, LEAST_STEP_M = 0.5, 1e-3  # of a step of plates that the outside shows; that shows it
SHORT_BY_PLATES = 0.5, 1.5  # of a plate: so short of the nominal radius
EXCHANGED_SHARE, EXCHANGED_M = 0.4, 1.5e-3  # of the steps between courses: left, and saved
BY_CHANCE = 0.05  # of sound courses that scatter as much so many look so much better, at most
DRAWS = 1000  # of sound shells
APART_SDS, SCALE_OF_MEDIAN = 6.0, 1.4826  # of differences within a course


def limit_of_repeats(circumference_m):
    """By how much repeats of such a circumference may differ, m."""
    return limit_at("strapping", "repeats", "limit_mm", circumference_m) / 1000


def check_strapped(job, wall):
    """`Problem`s of a wall that straps alone, or straps and lines, show."""
    straps = wall.straps
    return (
        *check_tapes(job, straps),
        *check_repeats(straps.reduced),
        *_of_pairs(job, straps),
        *(_of_courses(job, straps) if job.radii is None else ()),  # else not all were strapped
        *_of_first_course(job, straps),
        *_uncontrolled(job, wall),
    )


def check_straps_beside_points(job, straps):
    """`Problem`s of straps round a wall that points show."""
    return (
        *check_tapes(job, straps),
        *check_repeats(straps.reduced),
        *_of_contradicted(straps),
    )


def _of_contradicted(straps):
    """Straps that depart from what the points and all other straps show."""
    tests = zip(straps.adjusted, straps.accepted, straps.w, straps.departure_m, strict=True)
    for place, accepted, w, departure in tests:
        if not abs(w) > CRITICAL:
            continue
        one = straps.reduced[place]
        named = {
            "name": one.strap.name,
            "course": one.strap.course,
            "miss_mm": 1000 * departure * straps.per_radius,
            "w": abs(w),
        }
        if accepted:
            text = message(
                "strap_contradicts",
                "circumference {name!r} of course {course!r} is {miss_mm:+.1f} mm from what the"
                " points and all other straps show (w = {w:.1f}): which of them is wrong?",
                **named,
            )
        else:
            text = message(
                "strap_set_aside",
                "circumference {name!r} of course {course!r} is {miss_mm:+.1f} mm from what the"
                " points and all other straps show (w = {w:.1f}) and was set aside",
                **named,
            )
        yield _problem(text, one.strap)


def _problem(text, strap=None, column="reading_m"):
    return Problem(FILE, text, row=None if strap is None else strap.row, column=column)


def check_repeats(reduced):
    """`Problem`s of repeats that differ by more than they may."""
    by_name = {}
    for one in reduced:
        by_name.setdefault(one.strap.name, []).append(one)
    for name, several in by_name.items():
        if len(several) < 2:
            continue
        found = [one.circumference_m for one in several]
        limit = limit_of_repeats(found[0])
        if max(found) - min(found) > limit:
            text = message(
                "repeats_apart",
                "the readings of circumference {name!r} differ by {apart_mm:.1f} mm; expected at"
                " most {limit_mm:g} mm",
                name=name,
                apart_mm=1000 * (max(found) - min(found)),
                limit_mm=1000 * limit,
            )
            yield _problem(text, several[int(np.argmax(found))].strap)


def _of_pairs(job, straps):
    """A strap that stands far from the others of its course, further than courses taper."""
    adjusted = [straps.reduced[i] for i in straps.adjusted]
    apart = []
    for course in job.courses:
        own = [one for one in adjusted if one.strap.course == course.name]
        levels = {one.strap.level_m for one in own}
        if len(levels) > 1:
            found = np.array([one.circumference_m for one in own])
            away = found - np.median(found)
            apart.append((np.ptp(found), own[int(np.argmax(np.abs(away)))], len(levels)))
    if len(apart) < 3:
        return
    usual = SCALE_OF_MEDIAN * float(np.median([size for size, _, _ in apart]))
    for size, one, count in apart:
        if size > max(APART_SDS * usual, 2 * limit_of_repeats(one.circumference_m)):
            text = message(
                "strap_apart",
                "the {count} straps of course {course!r} differ by {apart_mm:.1f} mm, those of"
                " other courses by {usual_mm:.1f} mm: is one of them misread, over an obstruction"
                " or not level?",
                count=count,
                course=one.strap.course,
                apart_mm=1000 * size,
                usual_mm=1000 * usual,
            )
            yield _problem(text, one.strap)


def _of_courses(job, straps):
    """Inside radii against the nominal one, and pairs of courses that fit better exchanged."""
    plates = np.array([course.thickness_m + course.paint_m for course in job.courses])
    inside, names = straps.radius_m - plates, [course.name for course in job.courses]
    nominal = job.tank.nominal_diameter_m / 2
    median = float(np.median(inside))
    steps_inside = _steps_inside(job, straps, plates)
    if abs(median - nominal) > NOMINAL_SHARE * nominal or steps_inside:
        by_plates = abs(median + np.median(plates) - nominal) < abs(median - nominal) / 4
        if by_plates or steps_inside:
            text = message(
                "circumference_of_inside",
                "the courses come out {miss_mm:+.0f} mm of radius from the nominal one, about"
                " their plates: is the nominal diameter that of the outside, or are the"
                " circumferences those of the inside?",
                miss_mm=1000 * (median - nominal),
            )
        else:
            text = message(
                "strapped_unlike_nominal",
                "the courses come out {miss_mm:+.0f} mm of radius from the nominal one",
                miss_mm=1000 * (median - nominal),
            )
        yield _problem(text)
    for name, radius in zip(names, inside, strict=True):
        if abs(radius - median) > NOMINAL_SHARE * nominal:
            text = message(
                "strapped_course_apart",
                "course {name!r} comes out {miss_mm:+.1f} mm of radius from the others",
                name=name,
                miss_mm=1000 * (radius - median),
            )
            yield _problem(text, column="course")
    strapped = {one.strap.course for one in straps.reduced}
    both = [i for i, name in enumerate(names) if name in strapped]  # lines tell the others
    exchanged = exchanged_courses(straps.radius_m, plates, both)
    if exchanged is not None:
        one, other, left, steps = exchanged
        text = message(
            "courses_exchanged",
            "with the readings of courses {one!r} and {other!r} exchanged the steps between"
            " courses would add up to {left_mm:.1f} mm in place of {steps_mm:.1f} mm: are"
            " they mixed up?",
            one=names[one],
            other=names[other],
            left_mm=1000 * left,
            steps_mm=1000 * steps,
        )
        yield _problem(text, column="course")


def exchanged_courses(outside_m, plates_m, both):
    """The pair of courses that look exchanged, by the steps between neighbouring courses.

    Parameters
    ----------
    outside_m, plates_m : ndarray, shape (courses,)
        Radius of the outside, and plate with paint.
    both : sequence of int
        Courses that may be exchanged.

    Returns
    -------
    (int, int, float, float) or None
        The pair, the sum of the steps with it exchanged, and as it is, m; None: too little is
        saved, or courses whose inside radii scatter as much look so much better exchanged by
        chance in over one of twenty shells.

    Examples
    --------
    >>> plates = np.array([10, 9, 8, 7, 6.3, 6.3]) / 1000
    >>> inside = 6.5 + np.array([0.1, -0.2, 0.2, 0.0, -0.1, 0.1]) / 1000
    >>> exchanged_courses((inside + plates)[[0, 4, 2, 3, 1, 5]], plates, range(6))[:2]
    (1, 4)
    """
    if len(both) < 2:
        return None
    inside = outside_m - plates_m
    steps = float(_steps(inside))
    left, pairs = _steps_exchanged(outside_m, plates_m, both)
    best = int(np.argmin(left))
    if left[best] >= EXCHANGED_SHARE * steps or steps - left[best] <= EXCHANGED_M:
        return None
    sound = np.random.default_rng(0).normal(size=(DRAWS, len(inside))) * np.std(inside, ddof=1)
    shares = np.min(_steps_exchanged(sound + plates_m, plates_m, both)[0], axis=-1) / _steps(sound)
    if np.mean(shares <= left[best] / steps) > BY_CHANCE:
        return None
    return *pairs[best], float(left[best]), steps


def _steps_exchanged(outside_m, plates_m, both):
    """(..., k) steps between courses with each pair of them exchanged, and the pairs."""
    pairs, left = list(combinations(both, 2)), []
    for i, k in pairs:
        turned = outside_m.copy()
        turned[..., [i, k]] = outside_m[..., [k, i]]
        left.append(_steps(turned - plates_m))
    return np.stack(left, axis=-1), pairs


def _steps_inside(job, straps, plates_m):
    """Whether the courses are short of the nominal radius by about their plates, and the outside
    does not step with these: circumferences of the inside, or plates that are flush outside.
    """
    strapped = {one.strap.course for one in straps.reduced}
    if len(strapped) < len(plates_m) or np.ptp(plates_m) < LEAST_STEP_M:
        return False
    if job.diameter_is is not None:  # `check_side` looks to the plate
        return False
    steps = plates_m - plates_m.mean()
    slope = straps.radius_m @ steps / (steps @ steps)  # 1 where they are flush inside
    short = job.tank.nominal_diameter_m / 2 - float(np.median(straps.radius_m - plates_m))
    low, high = SHORT_BY_PLATES
    return slope < FLUSH and low < short / float(np.median(plates_m)) < high


def _of_first_course(job, straps):
    """Its inside diameter against the drawing's, and its circumference against the one declared."""
    course = job.courses[0]
    plate = course.thickness_m + course.paint_m
    yield from check_side(job, 2 * (straps.radius_m[0] - plate), plate, 0.0)
    found, declared = straps.circumference_m[0], job.circumference_m
    if declared is not None and abs(found - declared) > limit_of_repeats(found):
        yield Problem(
            "job.toml",
            message(
                "strapped_unlike_declared",
                "{declared_m:.4f} m, and {found_m:.4f} m by circumferences.csv: they differ by"
                " {miss_mm:+.0f} mm",
                declared_m=declared,
                found_m=found,
                miss_mm=1000 * (found - declared),
            ),
            column="checks.circumference_m",
        )


def _steps(radii_m):
    """(...) sum of the steps between neighbouring courses, of radii (..., courses)."""
    return np.abs(np.diff(radii_m, axis=-1)).sum(axis=-1)


def _uncontrolled(job, wall):
    """Courses of one reading alone: a blunder in it nothing would show."""
    read = [one.course for one in wall.accepted if one.of != FORMER]
    counts = np.bincount(read, minlength=len(job.courses))
    alone = [course.name for course, count in zip(job.courses, counts, strict=True) if count == 1]
    if alone:
        yield _problem(
            message(
                "controlled_by_nothing",
                "courses {courses}: a single reading, which nothing controls; a second strap would",
                courses=", ".join(alone),
            ),
            column="course",
        )
