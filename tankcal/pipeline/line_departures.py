"""Reference lines that are wrong as a whole: no reading of them departs from its neighbours.

A scale that was read from its other end, a sign, a unit, a plummet that touched something: the
readings of a line, or of all lines, hang together, and the test of single readings is blind.
"""

import numpy as np

from tankcal.errors import Problem
from tankcal.geometry.form import harmonics
from tankcal.messages import message
from tankcal.pipeline.survey_limits import limits_of
from tankcal.survey.reference_line import rises_of

FILE, RULES = "offsets.csv", "reference_line"
STEPS_IN, STEPS_IN_SDS = -0.4, 2.0  # of a plate's step that the wall steps in: no build does
HARDLY, SURE_SDS = (
    0.25,
    4.0,
)  # of a step that shows outside, and sds that it is short of a whole one
FEWEST_COURSES, LEAST_STEP_M = 4, 1e-3  # whose plates tell that, and by how much these differ
FEWEST_LINES = 6  # of which one is told from the others
APART, APART_M = 5.0, 6e-3  # times the rms of most lines, and at least: a line that is apart


def check_scale(job):
    """`Problem`s of lines that stand nearer to the wall than anybody can work."""
    least = limits_of(RULES)["least_offset_mm"] / 1000
    read = [abs(one.offset_m) for one in job.lines.offsets]
    if max(read) < least:
        text = message(
            "offsets_small",
            "the largest offset is {most_mm:g} mm; lines stand {least_mm:g} mm or more off the"
            " wall: are these centimetres or inches?",
            most_mm=1000 * max(read),
            least_mm=1000 * least,
        )
        yield Problem(FILE, text, column="offset_mm")


def check_lines_apart(job, collimations):
    """`Problem`s of lines whose readings depart together from the circles of all other lines.

    collimations  {plummet: (kappa, sd), rad}
    """
    departures = departures_of(job.lines, {name: one[0] for name, one in collimations.items()})
    if len(departures) < FEWEST_LINES:
        return
    rms = {line: float(np.sqrt(np.mean(each**2))) for line, each in departures.items()}
    usual = float(np.median(list(rms.values())))
    for line, size in rms.items():
        if size > max(APART * usual, APART_M):
            text = message(
                "line_apart",
                "line {line!r} departs by {size_mm:.0f} mm (rms) from the circles of all others,"
                " these by {usual_mm:.1f} mm: did the plummet touch something or move, or was the"
                " scale read from its other end or in another unit?",
                line=line,
                size_mm=1000 * size,
                usual_mm=1000 * usual,
            )
            row = next((one.row for one in job.lines.offsets if one.line == line), None)
            yield Problem(FILE, text, row=row, column="line")


def departures_of(given, collimations):
    """By how much the rise of each line departs from the circle through those of all others.

    Parameters
    ----------
    given : ReferenceLines
    collimations : dict
        {plummet: kappa, rad}.

    Returns
    -------
    dict
        {line: (levels,) radial departures over the reference level, m}.
    """
    used = [one for one in given.offsets if not one.check]
    found = {}
    for level in rises_of(given, used, collimations):
        if len(level) < FEWEST_LINES:
            continue
        rise = np.array([rise for _, rise, _ in level])
        design = harmonics([given.lines[line].azimuth_rad for line, _, _ in level], 1)
        for place, (line, _, _) in enumerate(level):
            others = np.arange(len(level)) != place
            fit = np.linalg.lstsq(design[others], rise[others], rcond=None)[0]
            found.setdefault(line, []).append(rise[place] - design[place] @ fit)
    return {line: np.array(each) for line, each in found.items()}


def check_sign(job, levels):
    """`Problem`s of lines that make the wall narrower where its plates are thicker: a wrong sign.

    Seen from outside the wall steps out with its plates, from inside it does not, unless they are
    flush outside. Nothing else tells the sign where one course alone was strapped.
    """
    reference = next(one.course for one in job.lines.offsets if one.reference)
    rises = {reference: [0.0]}
    for one in levels:
        rises.setdefault(one.course, []).append(one.rise_m)
    known = [one for one in job.courses if one.name in rises]
    plates = np.array([one.thickness_m + one.paint_m for one in known])
    if len(known) < FEWEST_COURSES or np.ptp(plates) < LEAST_STEP_M:
        return
    risen = np.array([np.mean(rises[one.name]) for one in known])
    steps = plates - plates.mean()
    slope = float(risen @ steps / (steps @ steps))
    left = risen - risen.mean() - slope * steps
    sd = float(np.sqrt(left @ left / (len(known) - 2) / (steps @ steps)))
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
    elif slope < HARDLY and slope < 1 - SURE_SDS * sd and not _any_inside(job):
        text = message(
            "lines_of_inside",
            "the wall does not come out with its plates ({slope:+.1f} of their step, sd {sd:.1f};"
            " +1 of plates that are flush inside): did the lines stand inside, or are the plates"
            " flush outside?",
            slope=slope,
            sd=sd,
        )
        yield Problem("lines.csv", text, column="side")


def _any_inside(job):
    return any(line.inside for line in job.lines.lines.values())
