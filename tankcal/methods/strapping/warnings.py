"""Warnings of a strapping: its tapes, and its circumferences.

Warnings about a strapping that are unlikely for a valid survey of a tank without defects.

The checks name a probable cause: exchanged courses, an inside circumference, or a single wrong
strap. Checks of the tapes and of their readings precede them, because they need no wall.
"""

from itertools import combinations

import numpy as np
from scipy.special import bdtrc, chdtrc, erf, pdtrc

from tankcal.adjust import CRITICAL, SD_OVER_MEDIAN
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.methods.base import accompanying_methods, completing_method
from tankcal.methods.moved_setups import precision_and_pull
from tankcal.pipeline.checks import limit_at, limits_of
from tankcal.pipeline.checks.size import (
    allowed_departure_m,
    check_side,
    departure_of_size,
    is_size_declared,
    nominal_radius_m,
)
from tankcal.pipeline.read_wall import FORMER
from tankcal.pipeline.wall_straps import course_apart, exchanged_courses
from tankcal.units import STANDARD_GRAVITY

TAPE_CHECKS_FILE, TAPES, COMPARED = "circumferences.csv", "instruments.toml", "tape_checks.csv"
FAHRENHEIT_K = 8.0  # largest difference from the shell of a temperature read as Fahrenheit
UNLIKE_K = 20.0  # difference of tape and shell temperatures that causes a warning
CERTIFIED_C = (0.0, 40.0)  # range of plausible temperatures in certificates
PULL = 2.0  # ratio of a pull to that of the certificate, either way, that causes a warning
UNITS_N = {"kgf": STANDARD_GRAVITY, "lbf": 4.4482216}
THICKNESS_M = (5e-5, 1.2e-3)  # range of plausible tape thicknesses
STIFFNESS_N = (1e5, 5e6)  # range of plausible tape stiffnesses: 0.5 to 25 mm2 of steel
BY_CHANCE = 0.02  # probability of as many equal repeats below which copying is suspected


def check_tapes(job, straps, strapping):
    """`Problem`s of the tapes of a strapping and of their readings, independent of the wall.

    Parameters
    ----------
    job : Job
    straps : object
        Readings as `reduced`, and the `tapes` used.
    strapping : survey.strapping.Strapping
        Strapping of the job.

    Returns
    -------
    tuple of Problem
    """
    return (
        *_check_temperatures(job, straps),
        *_check_shell_temperature(job, straps),
        *_check_pulls(straps),
        *_check_certificates(straps),
        *_check_comparisons(straps, strapping),
        *_find_copies([reduced_strap.strap for reduced_strap in straps.reduced]),
    )


def _check_temperatures(job, straps):
    """Problems of tape temperatures far from that of the shell."""
    shell = job.survey.shell_temperature_c
    for reduced_strap in straps.reduced:
        tape = reduced_strap.strap.temperature_c
        if tape is None or shell is None or abs(tape - shell) <= UNLIKE_K:
            continue
        celsius = (tape - 32) / 1.8
        if abs(celsius - shell) <= FAHRENHEIT_K:
            text = message(
                "tape_in_fahrenheit",
                "{tape:g} degrees Celsius of the tape, and {shell:g} of the shell: {celsius:.0f}"
                " would be near it; is it in Fahrenheit?",
                tape=tape,
                shell=shell,
                celsius=celsius,
            )
        else:
            text = message(
                "tape_unlike_shell",
                "{tape:g} degrees Celsius of the tape, and {shell:g} of the shell: a tape that"
                " lies on the shell has its temperature",
                tape=tape,
                shell=shell,
            )
        yield Problem(TAPE_CHECKS_FILE, text, reduced_strap.strap.row, "temperature_c")


def _check_shell_temperature(job, straps):
    """Problem of tapes far from the table's temperature if the shell temperature is not given."""
    temperatures = [reduced_strap.strap.temperature_c for reduced_strap in straps.reduced]
    temperatures = [value for value in temperatures if value is not None]
    base = job.table.reference_temperature_c
    is_given = job.survey.shell_temperature_c is not None or not job.switches.temperature
    if is_given or not temperatures:
        return
    tape = float(np.median(temperatures))
    if abs(tape - base) > limits_of("strapping")["shell_unlike_tape_k"]:
        text = message(
            "shell_temperature_of_tapes",
            "blank, so the shell is taken to be at the table's {base:g} degrees Celsius, but the"
            " tape was at {tape:g}: {ppm:+.0f} ppm of volume if the shell was so, too",
            base=base,
            tape=tape,
            ppm=-2e6 * job.material.expansion_per_k * (tape - base),
        )
        yield Problem("job.toml", text, column="survey.shell_temperature_c")


def _check_pulls(straps):
    """Problems of pulls unlike that of the certificate, once for each tape and pull."""
    certified, reported = {tape.name: tape.tension_n for tape, _ in straps.tapes}, set()
    for reduced_strap in straps.reduced:
        pull, of_tape = reduced_strap.strap.tension_n, certified.get(reduced_strap.strap.tape)
        if not (pull and of_tape) or 1 / PULL <= pull / of_tape <= PULL:
            continue
        if (reduced_strap.strap.tape, pull) in reported:
            continue
        reported.add((reduced_strap.strap.tape, pull))
        text = message(
            "pull_unlike_certificate",
            "{pull_n:g} N, and {certified_n:g} N in the certificate of {tape!r}: is one of them in"
            " {units}?",
            pull_n=pull,
            certified_n=of_tape,
            tape=reduced_strap.strap.tape,
            units=_units_near(pull, of_tape),
        )
        yield Problem(TAPE_CHECKS_FILE, text, reduced_strap.strap.row, "tension_n")


def _units_near(first_n, second_n):
    """Names of the units in which the smaller of two forces resembles the larger."""
    low, high = sorted((first_n, second_n))
    units = [name for name, size in UNITS_N.items() if 1 / PULL <= size * low / high <= PULL]
    return " / ".join(units or UNITS_N)


def _check_certificates(straps):
    """Problems of impossible certificates: temperature, thickness, section or correction."""
    for tape, _ in straps.tapes:
        temperature = tape.temperature_c
        if temperature is not None and not _is_within(temperature, CERTIFIED_C):
            celsius = (temperature - 32) / 1.8
            text = message(
                "certified_temperature_strange",
                "{found:g} degrees Celsius; certificates are for {low:g} to {high:g} ({celsius:.0f}"
                " if it is in Fahrenheit)",
                found=temperature,
                low=CERTIFIED_C[0],
                high=CERTIFIED_C[1],
                celsius=celsius,
            )
            yield Problem(TAPES, text, column=f"{tape.name}.certified_temperature_c")
        if not _is_within(tape.thickness_m, THICKNESS_M):
            text = message(
                "tape_thickness_strange",
                "{found_mm:g} mm; tapes are {low_mm:g} to {high_mm:g} mm thick",
                found_mm=1000 * tape.thickness_m,
                low_mm=1000 * THICKNESS_M[0],
                high_mm=1000 * THICKNESS_M[1],
            )
            yield Problem(TAPES, text, column=f"{tape.name}.thickness_mm")
        if np.isfinite(tape.stiffness_n) and not _is_within(tape.stiffness_n, STIFFNESS_N):
            text = message(
                "tape_stiffness_strange",
                "section_mm2 times e_gpa: 50 N stretch this tape by {found:.0f} ppm, others by"
                " {low:.0f} to {high:.0f} ppm",
                found=5e7 / tape.stiffness_n,
                low=5e7 / STIFFNESS_N[1],
                high=5e7 / STIFFNESS_N[0],
            )
            yield Problem(TAPES, text, column=f"{tape.name}.section_mm2")
        most_ppm = limits_of("strapping")["most_correction_ppm"]
        if abs(tape.correction) > most_ppm / 1e6:
            text = message(
                "tape_correction_strange",
                "{found_ppm:+.0f} ppm; a tape that passed a verification is off by no more than"
                " {most_ppm:.0f} ppm: is it that of another tape, a percentage, or in millimetres?",
                found_ppm=1e6 * tape.correction,
                most_ppm=most_ppm,
            )
            yield Problem(TAPES, text, column=f"{tape.name}.correction")
        else:
            yield from _check_whole_correction(tape, straps)


def _check_whole_correction(tape, straps):
    """Problem of the combined corrections of a tape, relative to the measured length."""
    readings_m = [
        reduced_strap.strap.reading_m
        for reduced_strap in straps.reduced
        if reduced_strap.strap.tape == tape.name
    ]
    length = float(np.median(readings_m))
    limit = limits_of("strapping")["class_ii"]
    most = (limit["mm"] + limit["mm_per_m"] * length) / 1000
    correction_m = tape.correction_m + tape.correction * length
    if tape.correction_m and abs(correction_m) > most:
        text = message(
            "tape_correction_mm_strange",
            "with correction {found_mm:+.1f} mm of the {length_m:.1f} m that were read; a tape that"
            " passed a verification is off by no more than {most_mm:.1f} mm: is it in another"
            " unit, or that of another tape?",
            found_mm=1000 * correction_m,
            length_m=length,
            most_mm=1000 * most,
        )
        yield Problem(TAPES, text, column=f"{tape.name}.correction_mm")


def _check_comparisons(straps, strapping):
    """Problem of comparisons with a master that differ beyond their standard deviations."""
    compared_tapes = [tape for tape, _ in straps.tapes if tape.master]
    comparisons = [comparison for comparison in strapping.comparisons if comparison.sd_m > 0]
    if not compared_tapes or len(comparisons) < 2:
        return
    differences = np.array(
        [comparison.master_m - comparison.working_m for comparison in comparisons]
    )
    length = np.array([comparison.working_m for comparison in comparisons])
    weight = (length / np.array([comparison.sd_m for comparison in comparisons])) ** 2
    # Weighted mean of the relative differences: a tape's error is proportional to length.
    scale = np.sum(weight * differences / length) / np.sum(weight)
    square = float(np.sum(weight * (differences / length - scale) ** 2))
    if chdtrc(len(comparisons) - 1, square) < limits_of("strapping")["comparisons_by_chance"]:
        residuals_mm = 1000 * (differences - scale * length)
        worst, least = (
            comparisons[int(np.argmax(residuals_mm))],
            comparisons[int(np.argmin(residuals_mm))],
        )
        text = message(
            "comparisons_apart",
            "{name!r} against its master: the comparisons {one!r} and {other!r} differ by"
            " {apart_mm:.1f} mm, with standard deviations of {sd_mm:g} mm: was one misread, or the"
            " tape overstretched between?",
            name=compared_tapes[0].name,
            one=" ".join(filter(None, (worst.level, worst.when))),
            other=" ".join(filter(None, (least.level, least.when))),
            apart_mm=float(np.ptp(residuals_mm)),
            sd_mm=1000 * float(np.median([comparison.sd_m for comparison in comparisons])),
        )
        yield Problem(COMPARED, text, column="working_m")


def _is_within(value, limits):
    return limits[0] <= value <= limits[1]


def _find_copies(straps):
    """Problems of readings equal to the last digit more often than chance permits.

    The readings may be of a single circumference, or all readings of a circumference may repeat
    those of another circumference.
    """
    by_name, digit = {}, _digit_m(straps)
    for strap in straps:
        by_name.setdefault(strap.name, []).append(strap)
    copies, chances = [], []
    for straps_of_name in by_name.values():
        for place, strap in enumerate(straps_of_name[1:], 1):
            equal = [
                earlier
                for earlier in straps_of_name[:place]
                if earlier.reading_m == strap.reading_m
            ]
            copies += [(equal[0], strap)] if equal else []
            chances.append(min(1.0, place * chance_of_equal(strap.sd_m, digit)))
    if copies and bdtrc(len(copies) - 1, len(chances), np.mean(chances)) < BY_CHANCE:
        yield from (_copy_problem(*pair) for pair in copies)
    yield from _check_copied_circumferences(tuple(by_name.values()), digit)


def _check_copied_circumferences(circumferences, digit_m):
    """Problems of circumferences (lists of straps) whose readings all equal those of another.

    Single readings are compared within their own course only.
    """
    chance_by_course = {
        same_course: chance_of_equal(max(spread_m, digit_m), digit_m)
        for same_course, spread_m in _spreads_m([straps[0] for straps in circumferences]).items()
    }
    copies, expected = [], 0.0
    for first, second in combinations(circumferences, 2):
        same_course = first[0].course == second[0].course
        if len(first) != len(second) or (len(first) == 1 and not same_course):
            continue
        expected += chance_by_course[same_course] * np.prod(
            [chance_of_equal(strap.sd_m, digit_m) for strap in first[1:]]
        )
        if [strap.reading_m for strap in first] == [strap.reading_m for strap in second]:
            copies.append(_copy_problem(first[0], second[0]))
    if copies and pdtrc(len(copies) - 1, expected) < BY_CHANCE:
        yield from copies


def _spreads_m(straps):
    """{True: standard deviation of circumferences within courses, False: of all}, m."""
    sd_of_all, by_course = float(np.std([strap.reading_m for strap in straps])), {}
    for strap in straps:
        by_course.setdefault(strap.course, []).append(strap.reading_m)
    free = len(straps) - len(by_course)
    squares = sum(len(readings) * np.var(readings) for readings in by_course.values())
    return {True: float(np.sqrt(squares / free)) if free else sd_of_all, False: sd_of_all}


def chance_of_equal(sd_m, digit_m):
    """Probability that two readings are equal after rounding.

    Parameters
    ----------
    sd_m : float
        Standard deviation of a reading, m.
    digit_m : float
        Unit to which a reading is rounded, m.

    Returns
    -------
    float
        Mean of max(0, 1 - abs(d) / digit) over the normally distributed difference d.

    Examples
    --------
    >>> round(chance_of_equal(0.5e-3, 0.1e-3), 3), round(chance_of_equal(0.5e-3, 1e-3), 2)
    (0.056, 0.49)
    """
    reach = digit_m / (np.sqrt(2) * sd_m)
    falls = np.sqrt(2 / np.pi) / reach * -np.expm1(-(reach**2) / 2)
    return float(erf(reach / np.sqrt(2)) - falls)


def _digit_m(straps):
    """Unit of the last digit in the readings, m."""
    decimals = max(len(f"{strap.reading_m:.6f}".rstrip("0").partition(".")[2]) for strap in straps)
    return 10.0**-decimals


def _copy_problem(first, second):
    """Problem of a reading that repeats another reading."""
    text = message(
        "reading_copied",
        "{reading_m:g} m again, as in row {row}, to the last digit: was it copied?",
        reading_m=second.reading_m,
        row=first.row,
    )
    return Problem(TAPE_CHECKS_FILE, text, second.row, "reading_m")


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
    precision, pull = precision_and_pull(wall.field, wall.field.covariance_m2, count)
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
    is_transferred = not all(method.measures_size for method in accompanying_methods(job))
    is_told = completing_method(job) is not None or is_size_declared(job)
    if not is_transferred or is_told or len(strapped) > 1:
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
