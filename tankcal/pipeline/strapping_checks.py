"""Warnings of a strapping: what a sound crew on a sound tank hardly brings home.

Causes are named where one fits: courses exchanged, a reading of the inside, a strap that is off by
itself. What the tapes and their readings say of themselves: `tape_checks`.
"""

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.compared_courses import course_apart, exchanged_courses
from tankcal.pipeline.cross_checks import check_side, is_size_declared
from tankcal.pipeline.moved_setups import tested
from tankcal.pipeline.nominal_size import allowed_departure_m, departure_of_size, nominal_radius_m
from tankcal.pipeline.survey_limits import limit_at, limits_of
from tankcal.pipeline.tape_checks import check_tapes
from tankcal.pipeline.wall_readings import FORMER

FILE = "circumferences.csv"
FLUSH, LEAST_STEP_M = 0.5, 1e-3  # of a step of plates that the outside shows; that shows it
SHORT_BY_PLATES = 0.5, 1.5  # of a plate: so short of the nominal radius
SURELY_FLUSH, SURELY_SHORT_BY_PLATES = 0.25, (0.75, 1.25)  # not plates whose middles are flush
FAR_REPEATS = 5  # limits of repeats by which a course is far from all others, at least
FAR_LIMITS = 10  # limits of repeats from which a reading is grossly wrong: 5 mm of radius
FARTHEST_M = 1.0  # sd of a departure that something controls
APART_SDS, SCALE_OF_MEDIAN = 6.0, 1.4826  # of differences within a course


def limit_of_repeats(circumference_m, table="repeats"):
    """By how much repeats of such a circumference may differ, m.

    table  of the rule file: "repeats", or "repeats_lying"
    """
    return limit_at("strapping", table, "limit_mm", circumference_m) / 1000


def check_strapped(job, wall):
    """`Problem`s of a wall that straps alone, or straps and lines, show."""
    straps = wall.straps
    return (
        *check_tapes(job, straps),
        *check_repeats(straps),
        *_of_pairs(job, straps),
        *(_of_courses(job, straps) if job.radii is None else ()),  # else not all were strapped
        *_of_first_course(job, straps),
        *_of_one_course(job, straps),
        *_uncontrolled(job, wall),
    )


def check_straps_beside_points(job, wall):
    """`Problem`s of straps round a `Wall` that points show."""
    straps = wall.straps
    return (
        *check_tapes(job, straps),
        *check_repeats(straps),
        *_of_contradicted(straps, strapped_together(wall)),
    )


def strapped_together(wall):
    """Circumferences of a `Wall` whose repeats all depart from its points and all other straps.

    Repeats vouch for each other, so that no single one of them departs. With P the precision of the
    readings y without what is free, and a that is 1 for those of one circumference, they are by
    a' P y / a' P a of radius off what the others show, sqrt(a' P a) times that of its standard
    deviations (Cook & Weisberg 1982).

    Returns
    -------
    dict
        {place among the readings of the file of the first of them: (w, departure_m)}.
    """
    straps, names = wall.straps, {}
    kept = straps.adjusted[straps.accepted]
    for at, place in enumerate(kept, len(wall.field.radius_m) - len(wall.readings)):
        names.setdefault(straps.reduced[place].strap.name, []).append((at, place))
    repeated = [each for each in names.values() if len(each) > 1]
    if not repeated:
        return {}
    every = len(wall.field.radius_m)
    precision, pull = tested(wall.field, wall.field.covariance_m2, every)
    found = {}
    for each in repeated:
        at = [one for one, _ in each]
        weight = precision[np.ix_(at, at)].sum()
        if weight > 1 / FARTHEST_M**2:  # else no other controls them
            departure = pull[at].sum() / weight
            found[each[0][1]] = float(departure * np.sqrt(weight)), float(departure)
    return found


def _of_contradicted(straps, together):
    """Straps that depart from what the points and all other straps show.

    together  as `strapped_together` found them
    """
    apart = {}
    for place, (w, departure) in together.items():
        one = straps.reduced[place]
        miss = abs(departure) * straps.per_radius
        if abs(w) > CRITICAL and miss > limit_of_repeats(one.circumference_m):
            apart[one.strap.name] = place, True, w, departure
    tests = zip(straps.adjusted, straps.accepted, straps.w, straps.departure_m, strict=True)
    single = [
        (place, accepted, w, departure)
        for place, accepted, w, departure in tests
        if abs(w) > CRITICAL and not (accepted and straps.reduced[place].strap.name in apart)
    ]
    for place, accepted, w, departure in (*apart.values(), *single):
        one = straps.reduced[place]
        name, course, size = one.strap.name, one.strap.course, abs(w)
        miss = 1000 * departure * straps.per_radius
        template = (
            "circumference {name!r} of course {course!r} is {miss_mm:+.1f} mm from what the points"
            " and all other straps show (w = {w:.1f}): which of them is wrong?"
        )
        far = abs(miss) > 1000 * FAR_LIMITS * limit_of_repeats(one.circumference_m)
        if accepted and far:
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
        yield _problem(text, one.strap)


def _problem(text, strap=None, column="reading_m"):
    return Problem(FILE, text, row=None if strap is None else strap.row, column=column)


def check_repeats(straps, table="repeats"):
    """`Problem`s of repeats that differ by more than they may; table as in `limit_of_repeats`."""
    by_name = {}
    for reduced_strap in straps.reduced:
        by_name.setdefault(reduced_strap.strap.name, []).append(reduced_strap)
    for name, several in by_name.items():
        if len(several) < 2:
            continue
        found = [one.circumference_m for one in several]
        limit, apart = limit_of_repeats(found[0], table), max(found) - min(found)
        if apart > limit:
            template = (
                "the readings of circumference {name!r} differ by {apart_mm:.1f} mm; expected at"
                " most {limit_mm:g} mm"
            )
            mm, most = 1000 * apart, 1000 * limit
            if apart > FAR_LIMITS * limit:
                text = message("repeats_far", template, name=name, apart_mm=mm, limit_mm=most)
            else:
                text = message("repeats_apart", template, name=name, apart_mm=mm, limit_mm=most)
            yield _problem(text, several[int(np.argmax(found))].strap)


def _of_pairs(job, straps):
    """A strap that stands far from the others of its course, further than courses taper."""
    for size, one, count, usual in straps_apart([course.name for course in job.courses], straps):
        template = (
            "the {count} straps of course {course!r} differ by {apart_mm:.1f} mm, those of"
            " other courses by {usual_mm:.1f} mm: is one of them misread, over an obstruction"
            " or not level?"
        )
        course, apart, least = one.strap.course, 1000 * size, 1000 * usual
        if size > FAR_LIMITS * limit_of_repeats(one.circumference_m):
            text = message(
                "strap_far", template, count=count, course=course, apart_mm=apart, usual_mm=least
            )
        else:
            text = message(
                "strap_apart", template, count=count, course=course, apart_mm=apart, usual_mm=least
            )
        yield _problem(text, one.strap)


def straps_apart(names, straps):
    """(size m, `Reduced`, count, usual m) of straps far from the others of their course or ring.

    names  of the courses or rings
    """
    adjusted = [straps.reduced[i] for i in straps.adjusted]
    apart = []
    for name in names:
        own = [one for one in adjusted if one.strap.course == name]
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
            yield size, one, count, usual


def _of_courses(job, straps):
    """Inside radii against the nominal one, and pairs of courses that fit better exchanged."""
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
    both = [i for i, name in enumerate(names) if name in strapped]  # lines tell the others
    exchanged = exchanged_courses(straps.radius_m, plates, both)
    far = {
        name: radius - median
        for name, radius in zip(names, inside, strict=True)
        if abs(radius - median) > share
    }
    if not far and exchanged is None:
        far = _far_from_others(straps, names, inside)
    for name, away in far.items():
        template = (
            "course {name!r} comes out {miss_mm:+.1f} mm of radius from the others: did its straps"
            " lie over an obstruction, or is its plate another one?"
        )
        if abs(away) > share / 2:
            text = message("strapped_course_far", template, name=name, miss_mm=1000 * away)
        else:
            text = message("strapped_course_apart", template, name=name, miss_mm=1000 * away)
        yield _problem(text, column="course")
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


def _far_from_others(straps, names, inside_m):
    """{name: its radius over that of the others, m} of a course that stands apart, further than
    a strap of it from its other straps, which is told by itself.
    """
    least = FAR_REPEATS * limit_of_repeats(float(np.median(straps.circumference_m)))
    found = course_apart(inside_m, least / straps.per_radius)
    told = {one.strap.course for _, one, _, _ in straps_apart(names, straps)}
    return {} if found is None or names[found[0]] in told else {names[found[0]]: found[1]}


def _slope_and_shortness(job, straps, plates_m):
    """Step of the outside over that of the plates, and shortness of the nominal radius in plates.

    The slope is 1 where plates are flush inside, 0 of circumferences of the inside and of plates
    that are flush outside; inf where the steps do not show it.
    """
    plate = float(np.median(plates_m))
    short = job.tank.nominal_diameter_m / 2 - float(np.median(straps.radius_m - plates_m))
    short = short / plate if plate > 0 else 0.0
    strapped = {reduced_strap.strap.course for reduced_strap in straps.reduced}
    if len(strapped) < len(plates_m) or np.ptp(plates_m) < LEAST_STEP_M:
        return np.inf, short
    if job.diameter_is is not None:  # `check_side` looks to the plate
        return np.inf, short
    steps = plates_m - plates_m.mean()
    return float(straps.radius_m @ steps / (steps @ steps)), short


def _of_first_course(job, straps):
    """Its inside diameter against the drawing's, and its circumference against the one declared."""
    course = job.courses[0]
    plate = course.thickness_m + course.paint_m
    yield from check_side(job, 2 * (straps.radius_m[0] - plate), plate, 0.0)
    found = straps.circumference_m[0]
    declared = job.circumference_m
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


def _of_one_course(job, straps):
    """A tank whose size the straps of one course alone tell: lines tell the others from it."""
    strapped = {reduced_strap.strap.course for reduced_strap in straps.reduced}
    if job.lines is None or job.radii is not None or len(strapped) > 1 or is_size_declared(job):
        return
    text = message(
        "size_told_by_one_course",
        "blank, and nothing but the straps of course {course!r} tells how large the tank is: one"
        " that lies over a manhole would not show; strap another course, or say what the nominal"
        " diameter is on the drawing",
        course=strapped.pop(),
    )
    yield Problem("job.toml", text, column="checks.diameter_is")


def _uncontrolled(job, wall):
    """Courses of one reading alone: a blunder in it nothing would show."""
    alone = read_once([course.name for course in job.courses], wall)
    if alone:
        yield _problem(
            message(
                "controlled_by_nothing",
                "courses {courses}: a single reading, which nothing controls; a second strap would",
                courses=", ".join(alone),
            ),
            column="course",
        )


def read_once(names, wall):
    """Those of the courses or rings that a single reading tells."""
    read = [reading.course for reading in wall.accepted if reading.of != FORMER]
    counts = np.bincount(read, minlength=len(names))
    return [name for name, count in zip(names, counts, strict=True) if count == 1]
