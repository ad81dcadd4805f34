"""Checks for reference lines with a common error in all their readings.

A scale read from its other end, a wrong sign or unit, or a plummet in contact with an obstacle
changes all readings of a line, or of all lines. The test of single readings cannot detect this.
"""

import numpy as np

from tankcal.errors import Problem
from tankcal.geometry.outlines import harmonics
from tankcal.messages import message
from tankcal.pipeline.checks.instruments import limits_of
from tankcal.survey.reference_line import rises_of

FILE, RULES = "offsets.csv", "reference_line"
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
