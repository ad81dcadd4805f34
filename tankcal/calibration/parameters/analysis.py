"""Analysis of the interior parameters of the cameras of a job or of a record.

Tests, components, predictions and rules need only the covariance matrix of the camera, which a
record contains. The effect of dropping a parameter on points and volume requires the job.
"""

from dataclasses import replace

import numpy as np

from tankcal.calibration.interiors import (
    collect_interiors,
    read_interiors,
    read_photos,
    refuse_unknown,
    select_interiors,
)
from tankcal.calibration.parameters.dropping import Dropping, read_interior_after
from tankcal.calibration.parameters.judgement import (
    Choices,
    Statistics,
    add_joint_trial,
    advise,
    advise_together,
    find_adjusted_rows,
    hold_back_worst,
    judge_parameters,
    remove_joint_trial,
)
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.chain import adjust_job


def analyse_record(record, choices=None, *, camera=None, photo=None):
    """Analyse each set of interior parameters of a record, without new adjustments.

    Parameters
    ----------
    record : dict
        Content of record.json.
    choices : Choices, optional
        Choices of the user.
    camera, photo : str, optional
        Names of a camera and a photo to which the analysis is restricted.

    Returns
    -------
    tuple of CameraParameters

    Raises
    ------
    InputError
        If the record contains no adjustment with cameras, no adjusted parameter, or no such camera
        or photo.
    """
    interiors = read_interiors(record)
    if camera is not None or photo is not None:
        interiors = select_interiors(interiors, read_photos(record), camera, photo)
    return _judge_all(interiors, _read_statistics(record), choices or Choices(), "record.json")


def _read_statistics(record):
    """Read the Statistics of a record; raise InputError if they are missing or invalid."""
    adjustment = record["adjustment"]
    try:
        sigma0 = adjustment["sigma0"]
        statistics = Statistics(
            sigma0=np.nan if sigma0 is None else float(sigma0),
            dof=int(adjustment["redundancy"]),
            cov_scale=float(adjustment["cov_scale"]),
            groups=[
                tuple(group[key] for key in ("kind", "name", "count", "redundancy", "rms"))
                for group in adjustment["groups"]
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
    """Analyse each set of interior parameters of a job.

    Parameters
    ----------
    job : tankcal.job.Job
        Loaded job.
    choices : Choices, optional
        Choices of the user.
    camera, photo : str, optional
        Names of a camera and a photo to which the analysis is restricted.
    adjustment : survey.Adjustment, optional
        Adjustment of job.measurements, if it is already known.
    dropping : bool, optional
        Whether the survey is adjusted again without each candidate parameter.
    progress : callable, optional
        Called as progress(text, done, total) before each adjustment.

    Returns
    -------
    tuple of CameraParameters

    Raises
    ------
    InputError
        If the job has no photographs, no adjusted parameters, or no such camera or photo.
    SolutionError
        If the survey cannot be adjusted.
    """
    progress = progress or (lambda text, done, total: None)
    if job.measurements is None or not job.measurements.photos:
        raise InputError(
            Problem(
                "job.toml",
                message("camera_none_to_judge", "no photographs: there is no camera to test"),
            )
        )
    photos = {item.name: item.camera for item in job.measurements.photos}
    refuse_unknown(photos, camera, photo)
    if adjustment is None:
        progress(message("camera_adjusting_all", "adjusting the survey with all parameters"), 0, 1)
        adjustment = adjust_job(job)
    groups = [(g.kind, g.name, g.count, g.redundancy, g.rms) for g in adjustment.groups]
    statistics = Statistics(adjustment.sigma0, adjustment.redundancy, adjustment.cov_scale, groups)
    interiors = collect_interiors(adjustment, job.measurements)
    interiors = select_interiors(interiors, photos, camera, photo)
    analyses = _judge_all(interiors, statistics, choices or Choices(), "cameras.toml", source="job")
    return _run_trials(analyses, job, adjustment, progress) if dropping else analyses


def _judge_all(interiors, statistics, choices, file, source="record"):
    """Analyse all sets with adjusted parameters; raise InputError if there are none."""
    judged = [interior for interior in interiors if len(find_adjusted_rows(interior))]
    if not judged:
        text = message(
            "camera_nothing_adjusted",
            "no parameter of any camera is adjusted: there is nothing to test",
        )
        raise InputError(Problem(file, text))
    try:
        return tuple(judge_parameters(interior, statistics, choices, source) for interior in judged)
    except ValueError as error:
        raise InputError(Problem(file, error.args[0])) from error


def _run_trials(analyses, job, adjustment, progress):
    """Adjust the survey without the parameters of each trial, and update the recommendations."""
    outcomes, total = {}, 1 + sum(len(remove_joint_trial(analysis).trials) for analysis in analyses)
    progress(message("camera_volume_all", "computing the volume with all parameters"), 0, total)
    dropping = Dropping(job, adjustment)

    def run_stage(stage):
        """Change the trials by `stage`, run the new trials, and update the recommendations."""
        staged = tuple(stage(analysis) for analysis in analyses)
        for analysis in staged:
            for trial in analysis.trials:
                key = analysis.interior.camera, trial.names
                if key not in outcomes:
                    done = len(outcomes) + 1
                    text = message(
                        "camera_adjusting_without",
                        "adjusting without {parameters} of {camera}",
                        parameters=" ".join(trial.names),
                        camera=key[0],
                    )
                    progress(text, done, max(done, total))
                    outcomes[key] = dropping.without(*key)
        return tuple(
            advise(_add_outcomes(analysis, outcomes, adjustment, dropping)) for analysis in staged
        )

    # First drop parameters singly or in groups, then all that are recommended together. While
    # these change the product, hold back one more parameter.
    analyses = run_stage(remove_joint_trial)
    analyses = run_stage(add_joint_trial)
    while any(
        fewer is not analysis
        for fewer, analysis in zip(map(hold_back_worst, analyses), analyses, strict=True)
    ):
        analyses = tuple(advise(hold_back_worst(analysis)) for analysis in analyses)
        analyses = run_stage(add_joint_trial)
    progress("done", total, total)
    return tuple(advise_together(analysis) for analysis in analyses)


def _add_outcomes(analysis, outcomes, adjustment, dropping):
    """Add the outcomes of the trials to a CameraParameters."""
    trials = []
    for trial in analysis.trials:
        outcome, after = outcomes[analysis.interior.camera, trial.names], None
        if outcome.adjustment is not None:
            values, names, cofactors = read_interior_after(outcome, analysis.interior)
            factor = adjustment.sigma0**2 if analysis.scale == "a_posteriori" else 1.0
            after = names, values, factor * cofactors
        trials.append(replace(trial, outcome=outcome, after=after))
    return replace(analysis, trials=tuple(trials), base=(dropping.volume, dropping.no_volume))
