"""Warnings about tapes and their readings: units, certificates and copied readings."""

from itertools import combinations

import numpy as np
from scipy.special import bdtrc, chdtrc, erf, pdtrc

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.checks.survey import limits_of
from tankcal.units import STANDARD_GRAVITY

FILE, TAPES, COMPARED = "circumferences.csv", "instruments.toml", "tape_checks.csv"
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
        *_of_copies([reduced_strap.strap for reduced_strap in straps.reduced]),
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
        yield Problem(FILE, text, reduced_strap.strap.row, "temperature_c")


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
        yield Problem(FILE, text, reduced_strap.strap.row, "tension_n")


def _units_near(first_n, second_n):
    """Names of the units in which the smaller of two forces resembles the larger."""
    low, high = sorted((first_n, second_n))
    units = [name for name, size in UNITS_N.items() if 1 / PULL <= size * low / high <= PULL]
    return " / ".join(units or UNITS_N)


def _check_certificates(straps):
    """Problems of impossible certificates: temperature, thickness, section or correction."""
    for tape, _ in straps.tapes:
        temperature = tape.temperature_c
        if temperature is not None and not _within(temperature, CERTIFIED_C):
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
        if not _within(tape.thickness_m, THICKNESS_M):
            text = message(
                "tape_thickness_strange",
                "{found_mm:g} mm; tapes are {low_mm:g} to {high_mm:g} mm thick",
                found_mm=1000 * tape.thickness_m,
                low_mm=1000 * THICKNESS_M[0],
                high_mm=1000 * THICKNESS_M[1],
            )
            yield Problem(TAPES, text, column=f"{tape.name}.thickness_mm")
        if np.isfinite(tape.stiffness_n) and not _within(tape.stiffness_n, STIFFNESS_N):
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


def _within(value, limits):
    return limits[0] <= value <= limits[1]


def _of_copies(straps):
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
        yield from (_copied(*pair) for pair in copies)
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
            copies.append(_copied(first[0], second[0]))
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


def _copied(first, second):
    """Problem of a reading that repeats another reading."""
    text = message(
        "reading_copied",
        "{reading_m:g} m again, as in row {row}, to the last digit: was it copied?",
        reading_m=second.reading_m,
        row=first.row,
    )
    return Problem(FILE, text, second.row, "reading_m")
