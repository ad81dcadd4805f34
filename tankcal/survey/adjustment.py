"""Adjustment of a survey, and prediction of the covariance of a planned survey.

Adjustment of a survey: from the measurements as read to points with their covariance.

Correction of image points for the depth of their objects: an outer iteration of the adjustment.

Adjusted points and photos give the depth of each image point, and the depth gives the distortion
there (tankcal.camera.model). The image points are corrected to the plane of focus and adjusted
again until the correction no longer changes.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.camera.model import PARAMETERS, UNITS, refer_to_focus
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.diagnosis.blunders import (
    SOME,
    count_set_aside,
    find_one_sided_losses,
    find_swapped_control,
    find_undecided_outliers,
    gross_readings,
    search_blunders,
)
from tankcal.survey.diagnosis.diagnoses import (
    MIRROR,
    check_points,
    check_readings,
    check_readings_off,
    diagnose,
    find_disagreeing_checks,
    names_alike,
    same_place,
    scale_of_control,
)
from tankcal.survey.diagnosis.misread_files import (
    find_strained_control,
    likely_mistake,
    photos_that_do_not_fit,
    wrong_control,
    wrongly_held,
)
from tankcal.survey.network import Adjusted, predict
from tankcal.survey.network.adjustment import find_hardly_determined
from tankcal.survey.network.datum import Frame, make_frame
from tankcal.survey.network.reliability import HELD, UNCONTROLLED, reactions
from tankcal.survey.network.survey import IMAGES
from tankcal.survey.network_of_survey import GatheredSurvey, find_point_row, gather, held_trace
from tankcal.survey.observations import NUISANCES
from tankcal.survey.results import (
    Adjustment,
    DepthOfField,
    GroupOfReadings,
    Reading,
    Readings,
    causes_of,
)
from tankcal.survey.start.single_points import SeveralPlacesError
from tankcal.survey.start_values import (
    add_start_values,
    finish_start_values,
    mirrored_targets,
    start_like,
)

SUSPICIOUS = 4.0  # sigma0 above which whole files are suspected
SEVERAL = 0.05  # share of rejected values above which whole files are suspected
SPARED = 2  # fewer rejected values that make a held coordinate the suspect
NOISELESS = 1e-6  # sigma0 caused by rounding alone; measured values scatter more
TRIED = 25  # iterations allowed for a trial adjustment of a supposed mistake
# these files come first in the list of readings
FILES = ("image_points.csv", "photos.csv", "control.csv")
CLOSE_MM = 1e-6  # change of the correction regarded as none
MOST_ROUNDS = 20  # adjustments before the iteration is abandoned
NEAREST = 2.0  # focal lengths: an object nearer than that has no image


def adjust_survey(measurements, progress=None):
    """Adjust all measurements made on site.

    Parameters
    ----------
    measurements : Measurements
        Checked tables of the survey.
    progress : callable, optional
        progress(text) is called before each step.

    Returns
    -------
    Adjustment

    Raises
    ------
    InputError
        If an input is contradictory or incomplete.
    SolutionError
        If the survey does not determine the unknowns. The message names a likely cause where the
        search for mistakes identifies one.
    """
    progress = progress or (lambda text: None)

    def adjusted(measured, like):
        return _adjust(measured, progress, like=like)

    try:
        result, measurements, depth = adjust_in_depth(measurements, adjusted, progress)
    except SolutionError as error:
        if not measurements.settings.explain or isinstance(error, SeveralPlacesError):
            raise
        progress(message("looking_for_faults", "looking for mistakes in the input"))
        causes = _why_not(measurements, str(error))
        if not causes:
            raise
        raise SolutionError(*error.args, *(cause.text for cause in causes)) from error
    # Diagnoses follow the last round of the depth correction only: intermediate rounds are not
    # reported.
    progress(message("judging_residuals", "testing the residuals"))
    return replace(_complete(*result, measurements), depth=depth)


def _adjust(measurements, progress, snooping=None, most=100, like=None):
    """Adjust measurements with a search for blunders.

    Parameters
    ----------
    measurements : Measurements
    progress : callable
    snooping : bool, optional
        Overrides settings.snooping.
    most : int
        Largest number of iterations.
    like : network.Adjusted, optional
        A similar adjustment, which supplies the start values.

    Returns
    -------
    tuple of (SearchResult, GatheredSurvey, Frame)
    """
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
    survey = None if like is None else start_like(like, gathered, measurements)
    survey = survey or add_start_values(gathered, measurements)
    # Exchanged names show at the start values, where the residuals are still large; the adjustment
    # would spread them over all points.
    swapped = find_swapped_control(survey, gathered.known)
    if swapped:
        raise SolutionError("\n".join(map(str, swapped)))
    frame = make_frame(survey, gathered, measurements.settings)
    progress(
        message(
            "adjusting",
            "adjusting {count} observations",
            count=sum(len(table) * table.rows for table in frame.survey.tables.values()),
        )
    )
    is_snooping = measurements.settings.snooping if snooping is None else snooping
    gross = gross_readings(frame.survey) if is_snooping else None
    options = {**frame.options, "max_iterations": most}
    return search_blunders(frame.survey, options, gross), gathered, frame


def _adjust_trial(measurements, snooping=False, like=None):
    """Adjust trial measurements; return network.Adjusted and GatheredSurvey."""
    search, gathered, _ = _adjust(measurements, lambda text: None, snooping, TRIED, like)
    return search.adjusted, gathered


def _why_not(measurements, message):
    """Return Problem rows with likely reasons for a failed adjustment, most specific first."""
    # These messages already name their cause.
    if "datum defect" in message or MIRROR in message:
        return []
    photo_problems = photos_that_do_not_fit(measurements, message, _adjust_trial)
    return (
        photo_problems
        or likely_mistake(measurements, np.inf, _adjust_trial, message)
        or wrong_control(measurements, np.inf, _adjust_trial)[0]
    )


def _complete(search, gathered, frame, measurements):
    """Assemble the Adjustment from the adjusted network, its diagnoses and its covariance scale."""
    adjusted = search.adjusted
    scale, warnings = _cov_scale(adjusted, measurements.settings)
    warnings = [*gathered.warnings, *frame.warnings, *search.warnings, *warnings]
    # Residuals of held coordinates are reactions: they test control that has no redundancy.
    held = reactions(adjusted.problem, adjusted.solution, frame.tested & ~gathered.idle)
    of_held = held_trace(gathered.known, adjusted.survey.points)
    readings, groups = readings_of(adjusted, held.residuals(adjusted.problem), of_held)
    # A rejected reading whose point is lost appears in no table of residuals; it is listed
    # separately.
    gone = gone_with_their_points(adjusted, search.removed)
    removed = sorted([*readings.where(readings.removed), *gone], key=lambda one: -abs(one.w))
    checks = check_readings(adjusted, gathered.checks, scale)
    readings = _sort_readings(Readings.joined([readings, Readings.of([*gone, *checks])]))
    there = np.flatnonzero(np.isfinite(adjusted.xyz_m).all(axis=1))
    late = {i: why for i, why in enumerate(adjusted.problem.set_aside) if why}
    survey = adjusted.survey
    warnings += [
        _lost_point_problem(measurements, survey.points[i], why) for i, why in late.items()
    ]
    warnings += [
        _kept_reading_problem(needed, survey) for needed in search.needed if needed.w > CRITICAL
    ]
    diagnoses = _diagnoses(adjusted, readings, groups, gathered, measurements)
    doubts = _causes(adjusted, readings, gathered, measurements, diagnoses)
    # If the whole survey is in doubt, outliers in readings say little; only control is examined
    # further.
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
    # Points that hold the datum are no independent check. With datum = control, all weighted and
    # fixed control holds it.
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


def _kept_reading_problem(one, survey):
    """Problem of a reading that disagrees but cannot be removed."""
    trace = survey.table(one.source).trace
    text = message(
        "disagreeing_but_kept",
        "reading {reading} disagrees with the others (w = {w:.1f}), but was kept: without it "
        "some unknowns would not be determined",
        reading="-".join(trace.ids[one.row]),
        w=one.w,
    )
    return Problem(trace.file, text, trace.rows[one.row])


def _lost_point_problem(measurements, name, why):
    """Problem of a point that the search for blunders left with too few readings."""
    file, row = find_point_row(measurements, name)
    text = message("left_after_search", "{why} left after the search for blunders", why=why)
    return Problem(file, text, row)


def _diagnoses(adjusted, readings, groups, gathered, measurements):
    """Problem rows: mistakes in the input that the adjusted values indicate."""
    problems = diagnose(adjusted, readings, groups, gathered.known)
    problems += names_alike(gathered.lost, adjusted.survey.points) + same_place(adjusted)
    problems += [
        Problem("job.toml", text, None, "adjustment") for text in find_hardly_determined(adjusted)
    ]
    problems += mirrored_targets(adjusted.xyz_m, adjusted.survey.points, measurements)
    return problems


def _causes(adjusted, readings, gathered, measurements, diagnoses):
    """Problem rows: mistakes that affect the whole survey rather than single readings."""
    if not measurements.settings.explain:
        return []
    gone = count_set_aside(adjusted.survey)
    one_sided = find_one_sided_losses(readings, gathered.known)
    if not (one_sided or adjusted.sigma0 > SUSPICIOUS or gone > SOME * len(readings)):
        return find_strained_control(readings, gathered.known)
    # Trials start from this solution, which is close to theirs.
    close, sigma0 = partial(_adjust_trial, like=adjusted), adjusted.sigma0
    # The search for blunders lowers sigma0. The test needs sigma0 of all readings, so it adjusts
    # again without snooping.
    if gone:
        try:
            sigma0 = close(measurements)[0].sigma0
        except SolutionError:
            sigma0 = np.inf
    bad = one_sided or adjusted.sigma0 > SUSPICIOUS or gone > SEVERAL * len(readings)
    bad = (
        bad and sigma0 > SUSPICIOUS and not any(MIRROR in problem.expected for problem in diagnoses)
    )
    # A mirror image has its own diagnosis; trials of other mistakes cannot remove it.
    misread = likely_mistake(measurements, sigma0, _adjust_trial) if bad else []
    if misread:
        raise SolutionError("\n".join(["the readings do not fit together", *map(str, misread)]))
    control, left = wrong_control(measurements, gone, close)
    problems = wrongly_held(measurements, sigma0, gone, close) + control + one_sided
    # If one wrong held coordinate explains more outliers than SPARED, the program must not choose
    # between coordinate and readings.
    if gone - left >= SPARED:
        text = message(
            "held_or_readings",
            "the search for blunders would set {gone} values aside, but at most {left} if a "
            "held coordinate is wrong instead: correct that coordinate or leave its standard "
            "deviation blank, or mark the readings use = check if they are the wrong ones",
            gone=gone,
            left=left,
        )
        raise SolutionError("\n".join(map(str, [text, *problems])))
    return problems + (find_strained_control(readings, gathered.known) if not control else [])


def _sort_readings(readings):
    """Sort readings by file, then by row."""
    places = readings.columns["file"].tolist()
    # Images and control come first, as in the report; the other files follow in alphabetical order.
    files = set(places)
    files = [name_of_file for name_of_file in FILES if name_of_file in files] + sorted(
        files - set(FILES)
    )
    rank = {name: i for i, name in enumerate(files)}
    rank_of_row = np.array([rank[file] for file in places])
    row = np.array([-1 if row is None else row for row in readings.columns["row"].tolist()])
    return readings.where(np.lexsort((row, rank_of_row)))


def _cov_scale(adjusted, settings):
    """Return the variance factor of the reported covariances and a list of Problem."""
    if settings.scale != "a_posteriori":
        return 1.0, []
    if adjusted.dof > 0 and adjusted.sigma0 > NOISELESS:
        return adjusted.sigma0**2, []
    text = message(
        "nothing_redundant", "no observation is redundant: covariances keep the a-priori scale"
    )
    # Zero residuals come from computed input; sigma0 = 0 would give zero uncertainty.
    if adjusted.dof > 0:
        text = message(
            "nothing_scatters",
            "all residuals are zero (sigma0 = {sigma0:.1g}): they do not show how good the "
            "readings are, so covariances keep the a-priori scale",
            sigma0=adjusted.sigma0,
        )
    return 1.0, [Problem("job.toml", text, None, "adjustment.scale")]


# ---- correction of image points for the depth of their objects


def adjust_in_depth(measurements, adjust, progress):
    """Adjust a survey with image points corrected for depth.

    The correction requires settings.depth_of_field and a camera with a lens.

    Parameters
    ----------
    measurements : Measurements
    adjust : callable
        adjust(measurements, like) returns (SearchResult, ...); like is a similar network.Adjusted
        or None.
    progress : callable
        progress(text) is called before each round.

    Returns
    -------
    tuple
        Result of `adjust`, the corrected Measurements, and DepthOfField or None.

    Raises
    ------
    SolutionError
        If the corrections do not converge.
    """
    result = adjust(measurements, None)
    lenses = {setup.camera.name: setup for setup in measurements.cameras if setup.lens is not None}
    if not (measurements.settings.depth_of_field and lenses and measurements.image_points):
        return result, measurements, None
    original, current = measurements.image_points, measurements
    for rounds in range(1, MOST_ROUNDS + 1):
        # Always correct the original readings: correcting corrected ones would accumulate.
        corrected, left = _correct_for_depth(original, result[0].adjusted, lenses)
        change = float(np.abs(corrected - current.image_points.xy_mm).max(initial=0.0))
        if change < CLOSE_MM:
            size = corrected - original.xy_mm
            largest, rms = np.abs(size).max(initial=0.0), np.sqrt(np.mean(size**2))
            return result, current, DepthOfField(rounds, change, float(largest), float(rms), left)
        progress(
            message(
                "focusing",
                "correcting image points for their depth: round {rounds}, {change:.3g} um",
                rounds=rounds,
                change=1000.0 * change,
            )
        )
        current = replace(measurements, image_points=replace(original, xy_mm=corrected))
        result = adjust(current, result[0].adjusted)
    raise SolutionError(
        message(
            "focus_unsteady",
            "the corrections for the depth of field still change by {change:.3g} um after "
            "{rounds} adjustments: adjustment.depth_of_field",
            change=1000.0 * change,
            rounds=MOST_ROUNDS,
        )
    )


def _correct_for_depth(images, adjusted, lenses):
    """Return image points (n, 2) in focus, and the number of points without a usable depth."""
    survey, problem, state = adjusted.survey, adjusted.problem, adjusted.solution.unknowns
    points = {name: i for i, name in enumerate(survey.points)}
    photos = {name: i for i, name in enumerate(survey.photos.names)}
    point = np.array([points.get(name, -1) for name in images.point], dtype=int)
    photo = np.array([photos.get(name, -1) for name in images.photo], dtype=int)
    centre = problem.centre_m + state.photo_xyz_m
    away = adjusted.xyz_m[point] - centre[photo]
    # Depth along the optical axis (third row of the rotation), in mm; the camera looks towards -z.
    depth = -1000 * np.einsum("nk,nk->n", state.rotation[photo, 2], away)
    depth[(point < 0) | (photo < 0)] = np.nan
    corrected, left = images.xy_mm.copy(), 0
    camera = np.array([camera_of_survey.name for camera_of_survey in survey.cameras], dtype=object)[
        survey.photos.camera
    ]
    for name, setup in lenses.items():
        indices = np.flatnonzero((camera[photo] == name) & np.isfinite(depth))
        # An object nearer than two focal lengths has no sharp image, so the correction is
        # undefined.
        near = depth[indices] <= NEAREST * setup.lens.focal_length_mm
        left, indices = left + int(near.sum()), indices[~near]
        interior = state.interior[problem.interior_of[photo[indices]]]
        corrected[indices] = refer_to_focus(
            images.xy_mm[indices], depth[indices], interior, setup.camera.form, setup.lens
        )
    return corrected, left


# ---- readings after the adjustment


def readings_of(adjusted, held, held_trace):
    """Return the readings in the order of the tables, and a GroupOfReadings for each kind and name.

    Parameters
    ----------
    adjusted : network.Adjusted
    held : network.Residuals
        Residuals of held coordinates; they are not observed, so they belong to no group.
    held_trace : Trace

    Returns
    -------
    readings : Readings
    groups : tuple of GroupOfReadings
    """
    parts_of_readings, groups = [], {}
    for number, table in enumerate((*adjusted.residuals, held)):
        if table.source == "known beforehand":
            known_unknowns = adjusted.problem.observations[number]
            trace = _KnownTrace(*_known_names(adjusted, known_unknowns))
            value = known_unknowns.value
        else:
            trace, value = _trace_and_values(adjusted.survey, table, held_trace)
        if not len(table.rows):
            continue
        rows = table.rows.tolist()
        units = _units(table, trace)
        value = np.reshape(value, table.residual.shape)
        parts_of_readings.append(_readings_of_table(table, value, trace, units, adjusted.sigma0))
        if table.source == HELD:
            continue
        # Images and control are grouped by name and unit, as a camera mixes mm and rad.
        names, units = _objects(trace.group[i] for i in rows), _objects(units)
        for name, unit in dict.fromkeys(zip(names, units, strict=True)):
            is_in_group = (names == name) & (units == unit)
            groups.setdefault((table.kind, name, unit), []).append((table, is_in_group))
    return Readings.joined(parts_of_readings), tuple(
        _group(*key, parts, adjusted.survey) for key, parts in groups.items()
    )


def gone_with_their_points(adjusted, removed):
    """Reading rows of rejected observations whose points are no longer adjusted.

    Returns
    -------
    list of Reading
        Residuals are nan and mdb is infinite: without the point they are undefined.
    """
    survey = adjusted.survey
    listed = {(table.source, row) for table in adjusted.residuals for row in table.rows.tolist()}
    nan, inf, rejected = float("nan"), float("inf"), []
    for item in removed:
        observed = survey.table(item.source)
        if (item.source, item.row) in listed or observed is None:
            continue
        trace = observed.trace
        value, sd = (
            np.atleast_1d(observed.value[item.row]),
            np.atleast_1d(observed.sd[item.row]),
        )
        for k, name in enumerate(trace.element[item.row]):
            rejected.append(
                Reading(
                    item.kind, trace.ids[item.row], name, trace.file, trace.rows[item.row],
                    int(trace.repeats[item.row]), observed.unit, float(value[k]), nan, float(sd[k]),
                    0.0, float(item.w), nan, inf, inf, True,
                )
            )  # fmt: skip
    return rejected


def _trace_and_values(survey, table, held_trace):
    """Trace and observed values of a table of residuals."""
    if table.source == HELD:
        return held_trace, survey.xyz_m.ravel()[table.rows]
    observations = survey.table(table.source)
    return observations.trace, observations.value[table.rows]


def _readings_of_table(table, value, trace, units, sigma0):
    """Readings of a table of residuals, one for each value."""
    rows, width = table.rows.tolist(), value.shape[1]
    tau = table.w / sigma0 if sigma0 > 0 else np.full_like(table.w, np.nan)
    numbers = {
        "value": value, "residual": table.residual, "sd": table.sd,
        "redundancy": table.redundancy, "w": table.w, "tau": tau, "mdb": table.mdb,
        "effect_m": table.effect_m,
    }  # fmt: skip

    def repeated(values):
        return np.repeat(_objects(values), width)

    return Readings(
        {
            "kind": repeated([table.kind] * len(rows)),
            "ids": repeated(trace.ids[i] for i in rows),
            "element": _objects(name for i in rows for name in trace.element[i]),
            "file": repeated([trace.file] * len(rows)),
            "row": repeated(trace.rows[i] for i in rows),
            "repeats": repeated(trace.repeats[i] for i in rows).astype(int),
            "unit": repeated(units),
            **{name: np.ravel(column).astype(float) for name, column in numbers.items()},
            "removed": np.repeat(~table.used, width),
            "check": np.zeros(width * len(rows), dtype=bool),
        }
    )


def _objects(values):
    """Array (n,) of objects, including tuples."""
    return np.fromiter(values, dtype=object)


def _units(table, trace):
    """Unit of each observation, length n; elements of a photo and weighted unknowns have mixed
    units."""
    if isinstance(trace, _KnownTrace):
        return trace.units
    if table.unit != "m or rad":
        return [table.unit] * len(table.rows)
    return ["m" if trace.element[i][0] in "xyz" else "rad" for i in table.rows.tolist()]


class _KnownTrace:
    """A Trace of weighted unknowns, which have no row in a file and a unit each."""

    def __init__(self, ids, elements, units, file):
        self.file, self.ids, self.element = file, ids, [(element,) for element in elements]
        self.rows, self.repeats, self.units = [None] * len(ids), [1] * len(ids), units
        self.group = [names[0] for names in ids]


def _known_names(adjusted, known_unknowns):
    """Names, elements, units and file of weighted unknowns."""
    survey, index = adjusted.survey, np.asarray(known_unknowns.index).tolist()
    if known_unknowns.of in NUISANCES:
        of, owners = NUISANCES[known_unknowns.of], survey.nuisances[known_unknowns.of].owners
        names = [(owners[i],) for i in index]
        return names, [of.element] * len(index), [of.unit] * len(index), of.file
    table, names, elements, units = adjusted.problem.interior_of, [], [], []
    for place in index:
        # Several photos may share a parameter; the first one identifies its camera.
        photos, parameters = np.nonzero(table == place)
        camera = survey.cameras[survey.photos.camera[photos[0]]]
        of_photo = camera.scope[parameters[0]] == "photo"
        names.append((camera.name, survey.photos.names[photos[0]]) if of_photo else (camera.name,))
        elements.append(PARAMETERS[parameters[0]])
        units.append(UNITS[elements[-1]])
    return names, elements, units, "cameras.toml"


def _group(kind, name, unit, parts, survey):
    """The GroupOfReadings of parts (table, mask of its rows)."""
    used = [mask_of_part & table.used for table, mask_of_part in parts]
    scatter = np.zeros(2)
    for (table, _), mask_of_part in zip(parts, used, strict=True):
        observations = survey.table(table.source)
        if observations is not None:
            # The scatter of averaged readings adds their chi-square and their degrees of freedom.
            scatter += [
                part[table.rows[mask_of_part]].sum() for part in observations.trace.repeated
            ]
    residual, sd, share, parts_of_chi2 = (
        np.concatenate(
            [
                getattr(table, field)[mask].ravel()
                for (table, _), mask in zip(parts, used, strict=True)
            ]
        )
        for field in ("residual", "sd", "redundancy", "part_of_chi2")
    )
    count = sum(int(mask_of_part.sum()) * table.residual.shape[1] for table, mask_of_part in parts)
    redundancy = float(share.sum() + scatter[1])
    factor = factor_sd = np.nan
    weighs = sd > 0  # exactly held values have neither residual nor redundancy
    if redundancy > UNCONTROLLED and weighs.any():
        # Variance component: v'Pv of the group over its redundancy (Foerstner's estimate).
        square = np.sum(parts_of_chi2[weighs]) + scatter[0]
        factor = float(np.sqrt(max(square, 0.0) / redundancy))
        factor_sd = float(1.0 / np.sqrt(2.0 * redundancy))
    rms = float(np.sqrt(np.mean(residual**2))) if len(residual) else np.nan
    low, high = (float(sd.min()), float(sd.max())) if len(sd) else (None, None)
    return GroupOfReadings(
        kind, name, unit, len(residual), count - len(residual), redundancy, factor, factor_sd,
        rms, low, high,
    )  # fmt: skip


@dataclass(frozen=True)
class Nominal:
    """Planned positions.

    Attributes
    ----------
    points : dict
        {name: (3,) coordinates, m}, including the set-ups.
    photos : dict
        {name: ((3,) projection centre, m, (3, 3) rotation)}.
    """

    points: dict
    photos: dict


@dataclass(frozen=True)
class Predicted:
    """Prediction of a survey.

    Attributes
    ----------
    adjusted : Adjusted
        network.Adjusted at the nominal values; its residuals and sigma0 have no meaning.
    gathered : GatheredSurvey
        Its `aside` lists points that cannot be determined.
    frame : Frame
        Datum of the survey.
    """

    adjusted: Adjusted
    gathered: GatheredSurvey
    frame: Frame


def predict_survey(measurements, nominal):
    """Predict the adjustment of a planned survey; observed values are ignored.

    Parameters
    ----------
    measurements : Measurements
    nominal : Nominal
        Planned positions.

    Returns
    -------
    Predicted

    Raises
    ------
    InputError
        If a point or photo has no nominal position.
    SolutionError
        If the survey does not determine the unknowns.
    """
    gathered = gather(measurements)
    if not gathered.survey.points:
        raise InputError(
            Problem(
                "plan.toml", message("no_observations_planned", "the survey has no observations")
            )
        )
    survey = finish_start_values(place_at_nominal(gathered.survey, nominal), gathered, measurements)
    frame = make_frame(survey, gathered, measurements.settings)
    return Predicted(predict(frame.survey, **frame.options), gathered, frame)


def place_at_nominal(survey, nominal):
    """Return a network survey with nominal values as start values."""
    photos = survey.photos
    missing = [name for name in survey.points if name not in nominal.points]
    missing += [
        name_of_photo
        for name_of_photo in (photos.names if photos else ())
        if name_of_photo not in nominal.photos
    ]
    if missing:
        expected = f"no nominal place is known of {', '.join(missing[:5])}"
        raise InputError(Problem("plan.toml", expected))
    xyz = np.array([nominal.points[name] for name in survey.points], dtype=float)
    changes = {"xyz_m": xyz, "sets": np.zeros(len(survey.sets))}
    if photos is not None:
        places = [nominal.photos[name] for name in photos.names]
        changes["photos"] = replace(
            photos,
            xyz_m=np.array([xyz for xyz, _ in places], dtype=float),
            rotation=np.array([rotation for _, rotation in places], dtype=float),
        )
    return replace(survey, **changes)
