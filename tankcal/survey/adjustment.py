"""A survey adjusted: from the measurements as they were read to points with their covariance."""

from dataclasses import replace
from functools import partial

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.causes import causes_of
from tankcal.survey.datum import make_frame
from tankcal.survey.depth import adjust_in_depth
from tankcal.survey.diagnosis.blunders import gross_readings, search_blunders, swapped_at_start
from tankcal.survey.diagnosis.checks import check_points, check_readings, find_disagreeing_checks
from tankcal.survey.diagnosis.diagnoses import MIRROR, diagnose
from tankcal.survey.diagnosis.double_names import names_alike, same_place
from tankcal.survey.diagnosis.fixed_datum_check import strained, wrong_control, wrongly_held
from tankcal.survey.diagnosis.misread_files import likely_mistake, photos_that_do_not_fit
from tankcal.survey.diagnosis.outlier_attribution import (
    SOME,
    count_set_aside,
    find_one_sided_losses,
    find_undecided_outliers,
)
from tankcal.survey.diagnosis.scales import check_readings_off, scale_of_control
from tankcal.survey.network.reactions import reactions
from tankcal.survey.network.soundness import find_hardly_determined
from tankcal.survey.network.survey import IMAGES
from tankcal.survey.network_of_survey import gather, held_trace, named_in
from tankcal.survey.results import Adjustment, Readings
from tankcal.survey.rows import gone_with_their_points, readings_of
from tankcal.survey.start.unstarted import SeveralPlacesError
from tankcal.survey.start_values import add_start_values, mirrored_targets, started_like

SUSPICIOUS = 4.0  # sigma0 above which whole files are doubted
SEVERAL = 0.05  # share of the values set aside, above which they are as well
SPARED = 2  # values fewer set aside, from which a held coordinate is doubted and not they
NOISELESS = 1e-6  # sigma0 of rounding alone: what was measured scatters more
TRIED = 25  # iterations of a survey that is only supposed
FILES = ("image_points.csv", "photos.csv", "control.csv")  # first in the list of readings


def adjust_survey(measurements, progress=None):
    """Adjust everything that was measured on site: the Adjustment of job.Measurements.

    Parameters
    ----------
    progress : optional
        progress(text) is called with what is being done.

    Raises
    ------
    InputError
        For what cannot be meant.
    SolutionError
        In words, with a likely cause where one is found, when the survey does not determine what is
        asked for.
    """
    progress = progress or (lambda text: None)

    def adjusted(measured, like):
        return _adjusted(measured, progress, like=like)

    try:
        found, measurements, depth = adjust_in_depth(measurements, adjusted, progress)
    except SolutionError as error:
        if not measurements.settings.explain or isinstance(error, SeveralPlacesError):
            raise
        progress(message("looking_for_faults", "looking for mistakes in the input"))
        told = _why_not(measurements, str(error))
        if not told:
            raise
        raise SolutionError(*error.args, *(one.text for one in told)) from error
    progress(message("judging_residuals", "testing the residuals"))
    return replace(_complete(*found, measurements), depth=depth)


def _adjusted(measurements, progress, snooping=None, most=100, like=None):
    """Searched, Gathered and Frame of measurements; like: network.Adjusted that is close to it."""
    gathered = gather(measurements)
    if not gathered.survey.points:
        nothing = message("nothing_observed", "the survey has no observations to adjust")
        raise InputError([Problem("job.toml", nothing), *gathered.warnings])
    progress(
        message(
            "finding_starts",
            "finding approximate values of {count} points",
            count=len(gathered.survey.points),
        )
    )
    survey = None if like is None else started_like(like, gathered, measurements)
    survey = survey or add_start_values(gathered, measurements)
    swapped = swapped_at_start(survey, gathered.known)
    if swapped:
        raise SolutionError("\n".join(map(str, swapped)))
    frame = make_frame(survey, gathered, measurements.settings)
    progress(message("adjusting", "adjusting {count} observations", count=_count(frame.survey)))
    wanted = measurements.settings.snooping if snooping is None else snooping
    gross = gross_readings(frame.survey) if wanted else None
    options = {**frame.options, "max_iterations": most}
    return search_blunders(frame.survey, options, gross), gathered, frame


def _tried(measurements, snooping=False, like=None):
    """network.Adjusted and Gathered of measurements that are only supposed."""
    search, gathered, _ = _adjusted(measurements, lambda text: None, snooping, TRIED, like)
    return search.adjusted, gathered


def _why_not(measurements, message):
    """Problem rows that may explain why a survey could not be adjusted."""
    if "datum defect" in message or MIRROR in message:
        return []
    lost = photos_that_do_not_fit(measurements, message, _tried)
    return (
        lost
        or likely_mistake(measurements, np.inf, _tried, message)
        or wrong_control(measurements, np.inf, _tried)[0]
    )


def _count(survey):
    return sum(len(one) * one.rows for one in survey.tables.values())


def _complete(search, gathered, frame, measurements):
    """The Adjustment of what was adjusted."""
    adjusted = search.adjusted
    scale, warnings = _cov_scale(adjusted, measurements.settings)
    warnings = [*gathered.warnings, *frame.warnings, *search.warnings, *warnings]
    held = reactions(adjusted.problem, adjusted.solution, frame.tested & ~gathered.idle)
    of_held = held_trace(gathered.known, adjusted.survey.points)
    readings, groups = readings_of(adjusted, held.residuals(adjusted.problem), of_held)
    gone = gone_with_their_points(adjusted, search.removed)
    removed = sorted([*readings.where(readings.removed), *gone], key=lambda one: -abs(one.w))
    checks = check_readings(adjusted, gathered.checks, scale)
    readings = _in_order(Readings.joined([readings, Readings.of([*gone, *checks])]))
    there = np.flatnonzero(np.isfinite(adjusted.xyz_m).all(axis=1))
    late = {i: why for i, why in enumerate(adjusted.problem.set_aside) if why}
    warnings += [_lost(measurements, adjusted.survey.points[i], why) for i, why in late.items()]
    warnings += [_kept(one, adjusted.survey) for one in search.needed if one.w > CRITICAL]
    diagnoses = _diagnoses(adjusted, readings, groups, gathered, measurements)
    doubts = _causes(adjusted, readings, gathered, measurements, diagnoses)
    rays, others = [], [one for one in search.removed if one.source != IMAGES]
    if doubts:
        others = [one for one in others if one.kind.startswith("control coordinate")]
    else:
        of_images = [one for one in search.removed if one.source == IMAGES]
        rays = find_undecided_outliers(
            adjusted, of_images, held, of_held
        )  # one more or less: a warning
    doubts += find_undecided_outliers(adjusted, others, held, of_held)
    warnings = [*doubts, *warnings, *diagnoses, *rays]
    known = gathered.known
    acting = frame.held
    if measurements.settings.datum == "control":
        acting = np.isfinite(known.xyz_m) & np.isfinite(known.sd_m)
    checked = check_points(adjusted, measurements, known, acting, scale)
    warnings += find_disagreeing_checks(checked, measurements.check)
    warnings += check_readings_off(readings)
    warnings += scale_of_control(adjusted, readings, measurements, scale)
    return Adjustment(
        adjusted=adjusted,
        there=there,
        aside=(*gathered.aside, *late.values()),
        readings=readings,
        removed=tuple(removed),
        groups=groups,
        datum=frame.report,
        check_points=checked,
        causes=causes_of(adjusted, there, scale),
        cov_scale=scale,
        rounds=search.rounds,
        warnings=tuple(dict.fromkeys(warnings)),
        doubts=tuple(doubts),
        repeats=gathered.repeats,
    )


def _kept(one, survey):
    """Problem of a reading that disagrees, but cannot be spared."""
    trace = survey.table(one.source).trace
    text = message(
        "disagreeing_but_kept",
        "reading {reading} disagrees with the others (w = {w:.1f}), but was kept: without it "
        "some unknowns would not be determined",
        reading="-".join(trace.ids[one.row]),
        w=one.w,
    )
    return Problem(trace.file, text, trace.rows[one.row])


def _lost(measurements, name, why):
    """Problem of a point that the search for blunders left with too few readings."""
    file, row = named_in(measurements, name)
    text = message("left_after_search", "{why} left after the search for blunders", why=why)
    return Problem(file, text, row)


def _diagnoses(adjusted, readings, groups, gathered, measurements):
    """Problem rows: what the result says about mistakes in the input."""
    found = diagnose(adjusted, readings, groups, gathered.known)
    found += names_alike(gathered.lost, adjusted.survey.points) + same_place(adjusted)
    found += [
        Problem("job.toml", text, None, "adjustment") for text in find_hardly_determined(adjusted)
    ]
    found += mirrored_targets(adjusted.xyz_m, adjusted.survey.points, measurements)
    return found


def _causes(adjusted, readings, gathered, measurements, diagnoses):
    """Problem rows: what is wrong with the whole rather than with single readings."""
    if not measurements.settings.explain:
        return []
    gone = count_set_aside(adjusted.survey)
    told = find_one_sided_losses(readings, gathered.known)
    if not (told or adjusted.sigma0 > SUSPICIOUS or gone > SOME * len(readings)):
        return strained(readings, gathered.known)
    close, sigma0 = partial(_tried, like=adjusted), adjusted.sigma0
    if gone:
        try:
            sigma0 = close(measurements)[0].sigma0
        except SolutionError:
            sigma0 = np.inf
    bad = told or adjusted.sigma0 > SUSPICIOUS or gone > SEVERAL * len(readings)
    bad = bad and sigma0 > SUSPICIOUS and not any(MIRROR in one.expected for one in diagnoses)
    misread = likely_mistake(measurements, sigma0, _tried) if bad else []
    if misread:
        raise SolutionError("\n".join(["the readings do not fit together", *map(str, misread)]))
    control, left = wrong_control(measurements, gone, close)
    found = wrongly_held(measurements, sigma0, gone, close) + control + told
    if gone - left >= SPARED:
        text = message(
            "held_or_readings",
            "the search for blunders would set {gone} values aside, but at most {left} if a "
            "held coordinate is wrong instead: correct that coordinate or leave its standard "
            "deviation blank, or mark the readings use = check if they are the wrong ones",
            gone=gone,
            left=left,
        )
        raise SolutionError("\n".join(map(str, [text, *found])))
    return found + (strained(readings, gathered.known) if not control else [])


def _in_order(readings):
    """Readings by file, then row, in the order in which they stand there."""
    places = readings.columns["file"].tolist()
    files = set(places)
    files = [one for one in FILES if one in files] + sorted(files - set(FILES))
    rank = {name: i for i, name in enumerate(files)}
    of = np.array([rank[file] for file in places])
    row = np.array([-1 if row is None else row for row in readings.columns["row"].tolist()])
    return readings.where(np.lexsort((row, of)))


def _cov_scale(adjusted, settings):
    """Variance factor of the covariances that go on, and what is to be said about it."""
    if settings.scale != "a_posteriori":
        return 1.0, []
    if adjusted.dof > 0 and adjusted.sigma0 > NOISELESS:
        return adjusted.sigma0**2, []
    text = message(
        "nothing_redundant", "no observation is redundant: covariances keep the a-priori scale"
    )
    if adjusted.dof > 0:
        text = message(
            "nothing_scatters",
            "all residuals are zero (sigma0 = {sigma0:.1g}): they do not show how good the "
            "readings are, so covariances keep the a-priori scale",
            sigma0=adjusted.sigma0,
        )
    return 1.0, [Problem("job.toml", text, None, "adjustment.scale")]
