"""Which parameters belong to a camera: all that a job, or a record of it, says about that.

Tests, components, predictions and rules need only the covariance of the camera, which a record
keeps. What dropping a parameter does to points and volume needs the job.
"""

from dataclasses import replace

import numpy as np

from tankcal.calibration.interiors import (
    interiors_in,
    interiors_of,
    photos_in,
    refuse_unknown,
    select_interiors,
)
from tankcal.calibration.parameters.dropping import Dropping, interior_after
from tankcal.calibration.parameters.findings import Choices, Statistics
from tankcal.calibration.parameters.judgement import (
    add_joint_trial,
    adjusted_rows,
    advise,
    advise_together,
    hold_one_back,
    judge_parameters,
    remove_joint_trial,
)
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.chain import adjust_job


def analyse_record(record, choices=None, *, camera=None, photo=None):
    """Analyse the interior parameters of a record, one result for each set; without dropping.

    Parameters
    ----------
    record : dict
        A record as read.
    choices : Choices, optional
        What the user decides.
    camera, photo : str, optional
        Names, to have the sets of these only.

    Returns
    -------
    tuple of CameraParameters

    Raises
    ------
    InputError
        Where it is no record of an adjustment with cameras, holds no parameter that was adjusted,
        or no such camera or photo.
    """
    interiors = interiors_in(record)
    if camera is not None or photo is not None:
        interiors = select_interiors(interiors, photos_in(record), camera, photo)
    return _of_all(interiors, _statistics_in(record), choices or Choices(), "record.json")


def _statistics_in(record):
    """The Statistics of a record; InputError where they are missing or no numbers."""
    found = record["adjustment"]
    try:
        sigma0 = found["sigma0"]
        statistics = Statistics(
            sigma0=np.nan if sigma0 is None else float(sigma0),
            dof=int(found["redundancy"]),
            cov_scale=float(found["cov_scale"]),
            groups=[
                tuple(one[key] for key in ("kind", "name", "count", "redundancy", "rms"))
                for one in found["groups"]
            ],
        )
    except (KeyError, TypeError, ValueError) as error:
        text = message(
            "camera_statistics_unreadable",
            "the statistics of the adjustment cannot be read: {error}",
            error=error,
        )
        raise InputError(Problem("record.json", text, None, "adjustment")) from error
    if not statistics.cov_scale > 0:
        text = message(
            "camera_cov_scale",
            "found cov_scale {found:g}, expected a factor above 0",
            found=statistics.cov_scale,
        )
        raise InputError(Problem("record.json", text, None, "adjustment.cov_scale"))
    return statistics


def analyse_job(
    job, choices=None, *, camera=None, photo=None, adjustment=None, dropping=True, progress=None
):
    """Analyse the interior parameters of a job, one result for each set.

    Parameters
    ----------
    job : tankcal.job.Job
        A loaded job.
    choices : Choices, optional
        What the user decides.
    camera, photo : str, optional
        Names, to have the sets of these only.
    adjustment : survey.Adjustment, optional
        Of job.measurements, where it is at hand.
    dropping : bool, optional
        Whether the survey is adjusted again without each candidate.
    progress : callable, optional
        progress(text, done, total) is called as the work goes on.

    Returns
    -------
    tuple of CameraParameters

    Raises
    ------
    InputError
        For a job without photographs, without adjusted parameters or without such a camera or
        photo.
    SolutionError
        When the survey cannot be adjusted.
    """
    progress = progress or (lambda text, done, total: None)
    if job.measurements is None or not job.measurements.photos:
        raise InputError(
            Problem(
                "job.toml",
                message("camera_none_to_judge", "no photographs: there is no camera to test"),
            )
        )
    photos = {one.name: one.camera for one in job.measurements.photos}
    refuse_unknown(photos, camera, photo)
    if adjustment is None:
        progress(message("camera_adjusting_all", "adjusting the survey with all parameters"), 0, 1)
        adjustment = adjust_job(job)
    groups = [(g.kind, g.name, g.count, g.redundancy, g.rms) for g in adjustment.groups]
    statistics = Statistics(adjustment.sigma0, adjustment.redundancy, adjustment.cov_scale, groups)
    interiors = interiors_of(adjustment, job.measurements)
    interiors = select_interiors(interiors, photos, camera, photo)
    found = _of_all(interiors, statistics, choices or Choices(), "cameras.toml", source="job")
    return _with_outcomes(found, job, adjustment, progress) if dropping else found


def _of_all(interiors, statistics, choices, file, source="record"):
    judged = [one for one in interiors if len(adjusted_rows(one))]
    if not judged:
        text = message(
            "camera_nothing_adjusted",
            "no parameter of any camera is adjusted: there is nothing to test",
        )
        raise InputError(Problem(file, text))
    try:
        return tuple(judge_parameters(one, statistics, choices, source) for one in judged)
    except ValueError as error:
        raise InputError(Problem(file, error.args[0])) from error


def _with_outcomes(found, job, adjustment, progress):
    """All CameraParameters with each of their trials adjusted again, then what they advise."""
    outcomes, total = {}, 1 + sum(len(remove_joint_trial(one).trials) for one in found)
    progress(message("camera_volume_all", "computing the volume with all parameters"), 0, total)
    again = Dropping(job, adjustment)

    def tried(stage):
        staged = tuple(stage(one) for one in found)
        for one in staged:
            for trial in one.trials:
                key = one.interior.camera, trial.names
                if key not in outcomes:
                    done = len(outcomes) + 1
                    told = message(
                        "camera_adjusting_without",
                        "adjusting without {parameters} of {camera}",
                        parameters=" ".join(trial.names),
                        camera=key[0],
                    )
                    progress(told, done, max(done, total))
                    outcomes[key] = again.without(*key)
        return tuple(advise(_tried(one, outcomes, adjustment, again)) for one in staged)

    found = tried(remove_joint_trial)
    found = tried(add_joint_trial)
    while any(
        fewer is not one for fewer, one in zip(map(hold_one_back, found), found, strict=True)
    ):
        found = tuple(advise(hold_one_back(one)) for one in found)
        found = tried(add_joint_trial)
    progress("done", total, total)
    return tuple(advise_together(one) for one in found)


def _tried(found, outcomes, adjustment, again):
    """The CameraParameters with what came out of its trials."""
    trials = []
    for trial in found.trials:
        outcome, after = outcomes[found.interior.camera, trial.names], None
        if outcome.adjustment is not None:
            values, names, cofactors = interior_after(outcome, found.interior)
            factor = adjustment.sigma0**2 if found.scale == "a_posteriori" else 1.0
            after = names, values, factor * cofactors
        trials.append(replace(trial, outcome=outcome, after=after))
    return replace(found, trials=tuple(trials), base=(again.volume, again.no_volume))
