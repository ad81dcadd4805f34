"""Analysis of the interior parameters of the cameras of a job or of a record.

Tests, components, predictions and rules need only the covariance matrix of the camera, which a
record contains. The effect of dropping a parameter on points and volume requires the job.

Effect of dropping parameters
-----------------------------
The dropped parameters are held at zero. The readings do not change: outliers remain rejected, and
no other reading is rejected. The results therefore differ only by the parameters, and an inadequate
model appears in sigma0 rather than in rejected readings. The points of the wall do not change.

`survey.adjust_survey` is not used, because it searches for outliers: a camera that lacks a
parameter would produce apparent outliers.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.calibration.influence.blocks import TopOfTank, TopVolume
from tankcal.calibration.interiors import (
    collect_interiors,
    read_interiors,
    read_photos,
    refuse_unknown,
    select_interiors,
)
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
from tankcal.camera.model import PARAMETERS
from tankcal.errors import InputError, Problem, SolutionError, TankcalError
from tankcal.messages import message
from tankcal.pipeline.chain import adjust_job
from tankcal.survey import Adjustment
from tankcal.survey.network import adjust
from tankcal.survey.network.datum import make_frame
from tankcal.survey.network.snooping import start_from_adjusted
from tankcal.survey.network_of_survey import gather
from tankcal.survey.results import causes_of


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
    if not job.network.photos:
        raise InputError(
            Problem(
                "job.toml",
                message("camera_none_to_judge", "no photographs: there is no camera to test"),
            )
        )
    photos = {item.name: item.camera for item in job.network.photos}
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


@dataclass(frozen=True)
class PointChanges:
    """Change of adjusted points between two adjustments; fixed coordinates have zero change.

    Attributes
    ----------
    count : int
        Number of points compared.
    rms_m, largest_m : float
        Root mean square and largest length of the changes, m.
    largest_point : str
        Point with the largest change.
    axis_rms_m, axis_largest_m : ndarray, shape (3,)
        Root mean square and largest magnitude of the changes of x, y and z, m.
    rms_sds, largest_sds : float
        Root mean square and largest change of a coordinate, in its standard deviations.
    largest_sds_point : str
        Point with the change `largest_sds`.
    """

    count: int
    rms_m: float
    largest_m: float
    largest_point: str
    axis_rms_m: np.ndarray
    axis_largest_m: np.ndarray
    rms_sds: float
    largest_sds: float
    largest_sds_point: str


@dataclass(frozen=True)
class Outcome:
    """Result of an adjustment without some parameters.

    Attributes
    ----------
    camera : str
        Name of the camera.
    names : tuple of str
        Names of the dropped parameters.
    failed : str or None
        Reason of a failure, or None.
    adjustment : survey.Adjustment or None
        Points, covariances and statistics, without readings; None if the adjustment failed.
    changes : PointChanges or None
        Change of the points by dropping the parameters; None if the adjustment failed.
    volume : TopVolume or None
        Volume, or None if there is no tank or the capacity cannot be computed.
    """

    camera: str
    names: tuple
    failed: str | None = None
    adjustment: Adjustment | None = None
    changes: PointChanges | None = None
    volume: TopVolume | None = None


class Dropping:
    """Repeated adjustments of a survey, each without some parameters.

    Parameters
    ----------
    job : job.Job
        Job with measurements.
    adjustment : survey.Adjustment
        Adjustment of the measurements with all parameters.

    Attributes
    ----------
    volume : TopVolume or None
        Volume with all parameters; None if there is no tank or the capacity cannot be computed.
    no_volume : str or None
        Reason why the volume cannot be computed.
    """

    def __init__(self, job, adjustment):
        self.job, self.adjustment = job, adjustment
        gathered = gather(job.measurements)
        survey = start_from_adjusted(adjustment.adjusted.survey, adjustment.adjusted)
        self._options = make_frame(survey, gathered, job.measurements.settings).options
        self._survey = replace(survey, cameras=_cameras_from_adjusted(adjustment.adjusted))
        self.volume, self.no_volume, self._top = None, None, TopOfTank(job)
        if job.tank is not None:
            try:
                self.volume = self._top.compute_volume(adjustment)
            except TankcalError as error:
                self.no_volume = str(error)

    def without(self, camera, names):
        """Return the Outcome of dropping the parameters `names` of a camera.

        A parameter with one value for the block is dropped from all cameras that share it. The
        principal distance c cannot be dropped.
        """
        try:
            adjusted = self.adjust_cameras(_drop_from_cameras(self._survey.cameras, camera, names))
            changes = compare_points(self.adjustment, adjusted)
        except SolutionError as error:
            return Outcome(camera, tuple(names), str(error))
        if self.volume is None:
            return Outcome(camera, tuple(names), None, adjusted, changes)
        try:
            volume = self._top.compute_volume(adjusted)
        except TankcalError as error:
            return Outcome(camera, tuple(names), str(error), adjusted, changes)
        return Outcome(camera, tuple(names), None, adjusted, changes, volume)

    def adjust_cameras(self, cameras):
        """Adjust the survey with other cameras (network.Camera), in the order of the survey.

        The returned survey.Adjustment contains points, covariances and statistics. Its readings,
        groups and warnings are empty.
        """
        adjusted = adjust(replace(self._survey, cameras=cameras), **self._options)
        base = self.adjustment
        scale = 1.0 if base.cov_scale == 1 else adjusted.scale("a_posteriori")
        is_known = np.flatnonzero(np.isfinite(adjusted.xyz_m).all(axis=1))
        return replace(
            base,
            adjusted=adjusted,
            there=is_known,
            readings=(),
            removed=(),
            groups=(),
            check_points=None,
            causes=causes_of(adjusted, is_known, scale),
            cov_scale=scale,
            rounds=1,
            warnings=(),
            doubts=(),
        )


def compare_points(before, after):
    """Compare the common points of two Adjustments, in standard deviations of the first."""
    places = {name: i for i, name in enumerate(after.names)}
    pairs = [(i, places[name]) for i, name in enumerate(before.names) if name in places]
    if not pairs:
        raise SolutionError(message("camera_no_point_left", "no point is left to compare"))
    here, there = np.array(pairs).T
    change = after.xyz_m[there] - before.xyz_m[here]
    sd = np.sqrt(np.maximum(np.einsum("nii->ni", before.covariance_m2[here]), 0.0))
    has_sd = sd > 0
    change = np.where(np.asarray(before.fixed)[here], 0.0, change)
    relative = np.abs(np.divide(change, sd, out=np.zeros_like(change), where=has_sd))
    size = np.linalg.norm(change, axis=1)
    far, worst = int(np.argmax(size)), int(np.argmax(relative.max(axis=1)))
    return PointChanges(
        count=len(pairs),
        rms_m=float(np.sqrt(np.mean(size**2))),
        largest_m=float(size[far]),
        largest_point=before.names[here[far]],
        axis_rms_m=np.sqrt(np.mean(change**2, axis=0)),
        axis_largest_m=np.abs(change).max(axis=0),
        rms_sds=float(np.sqrt(np.mean(relative[has_sd] ** 2))) if has_sd.any() else 0.0,
        largest_sds=float(relative.max()),
        largest_sds_point=before.names[here[worst]],
    )


def read_interior_after(outcome, interior):
    """Parameters of a set after an Outcome.

    Parameters
    ----------
    outcome : Outcome
        Adjustment without some parameters.
    interior : Interior
        Set of parameters in the adjustment with all parameters.

    Returns
    -------
    values : ndarray, shape (k,)
        Values of the kept parameters.
    names : tuple of str
        Names of the kept parameters.
    cofactors : ndarray, shape (k, k)
        Covariance matrix for sigma0 = 1.
    """
    adjusted = outcome.adjustment.adjusted
    names = [camera.name for camera in adjusted.survey.cameras]
    photos = adjusted.survey.photos
    if interior.photos is not None:
        photo = photos.names.index(interior.photos[0])
    else:
        photo = int(np.flatnonzero(photos.camera == names.index(interior.camera))[0])
    values, free, cofactors = adjusted.camera(photo)
    return np.array([values[name] for name in free]), tuple(free), np.asarray(cofactors)


def _cameras_from_adjusted(adjusted):
    """Set adjusted values as initial values of free parameters that a whole camera shares."""
    survey, cameras = adjusted.survey, []
    for number, camera in enumerate(survey.cameras):
        values, _, _ = adjusted.camera(int(np.flatnonzero(survey.photos.camera == number)[0]))
        start = [
            values[name] if scope in ("camera", "block") and state == "free" else value
            for name, scope, state, value in zip(
                PARAMETERS, camera.scope, camera.state, camera.values.tolist(), strict=True
            )
        ]
        cameras.append(replace(camera, values=np.array(start)))
    return tuple(cameras)


def _drop_from_cameras(cameras, name, parameters):
    """Switch off parameters of a camera, and in all cameras that share their values."""
    if "c" in parameters:
        raise ValueError("c cannot be dropped: a camera has a principal distance")
    dropped_camera = next(item for item in cameras if item.name == name)
    dropped_indices = [PARAMETERS.index(item) for item in parameters]
    new_cameras = []
    for camera in cameras:
        off = {
            k
            for k in dropped_indices
            if camera is dropped_camera or dropped_camera.scope[k] == camera.scope[k] == "block"
        }
        new_cameras.append(
            replace(
                camera,
                values=np.where([k in off for k in range(13)], 0.0, camera.values),
                scope=tuple("off" if k in off else s for k, s in enumerate(camera.scope)),
            )
        )
    return tuple(new_cameras)
