"""Influence of a calibration: adjustments of one block with each of several calibrations.

Each calibration replaces the camera of the job in three ways: fixed; weighted by its standard
deviations (correlations are not known); and free, as initial values only. Outliers are searched
once, in the reference run with the settings of the job, and excluded from all runs. All volumes use
the points of the wall that the reference accepted. Differences therefore result from the
calibration and not from the observations.

Source: Pessoa 2017.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tankcal.calibration.capacity_at_top import TopOfTank, TopVolume
from tankcal.calibration.influence.blocks import (
    Block,
    PhotoChanges,
    PositionChanges,
    compare_blocks,
    make_block,
)
from tankcal.calibration.influence.exchange import (
    FILE,
    STATES,
    add_pixel_size,
    can_be_weighted,
    exchange_calibration,
    leave_out_readings,
    refuse_unsuitable,
    select_camera,
    select_free_parameters,
)
from tankcal.calibration.product.check import ALPHA
from tankcal.errors import TankcalError
from tankcal.messages import message
from tankcal.pipeline.chain import adjust_job

REFERENCE = "reference"
REASON_LINES = 3  # number of lines kept of the reason why there is no volume
EXPECTED_ERRORS = (TankcalError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Run:
    """One adjustment of the block.

    Attributes
    ----------
    label : str
        Name of the run.
    calibration, state : str or None
        Calibration and its state; None for the reference, with the calibration of the job.
    outcome : str
        "adjusted", "failed" or "skipped".
    message : str or None
        Reason of a failure.
    skipped : str
        Code of the reason for skipping the run, or "".
    held : tuple of str
        Parameters fixed for lack of a standard deviation in a run "weighted".
    block : Block or None
        Results; None unless adjusted.
    volume : TopVolume or None
        Volume; None without a tank or after a failure.
    volume_failed : str or None
        Reason why the volume cannot be computed.
    """

    label: str
    calibration: str | None
    state: str | None
    outcome: str
    message: str | None = None
    skipped: str = ""
    held: tuple = ()
    block: Block | None = None
    volume: TopVolume | None = None
    volume_failed: str | None = None


@dataclass(frozen=True)
class Pair:
    """Differences between two runs, other minus one.

    Attributes
    ----------
    one, other : int
        Indices of the runs.
    points, photos : PositionChanges, PhotoChanges
        Differences of points and photos.
    aligned : int
        Number of motions that the observations do not determine, removed from the differences.
    volume_m3, volume_percent : float or None
        Difference of the capacities at the top, m3, and in % of the capacity of `one`.
    """

    one: int
    other: int
    points: PositionChanges
    photos: PhotoChanges
    aligned: int
    volume_m3: float | None
    volume_percent: float | None


@dataclass(frozen=True)
class Influence:
    """Adjustments of a block with all calibrations.

    Attributes
    ----------
    camera : str
        Name of the camera that was replaced.
    states, calibrations : tuple of str
        States and names of the calibrations.
    searched : bool
        Whether outliers were searched in the reference.
    removed : tuple of surveys.Reading
        Readings rejected in the reference and excluded from all runs.
    free : tuple of str
        Names of the parameters adjusted in runs "free".
    runs : tuple of Run
        Runs, the reference first.
    pairs : tuple of Pair
        Differences between the adjusted runs.
    """

    camera: str
    states: tuple[str, ...]
    calibrations: tuple[str, ...]
    searched: bool
    removed: tuple
    free: tuple[str, ...]
    runs: tuple[Run, ...]
    pairs: tuple[Pair, ...]


def influence(
    job,
    calibrations,
    states=STATES,
    camera=None,
    progress=None,
    *,
    alpha=ALPHA,
    volume=True,
    file=FILE,
):
    """Compute the influence of calibrations on the block of a job, and on its tank, if any.

    A failed run is part of the result, with its message.

    Parameters
    ----------
    job : tankcal.job.Job
        Loaded job.
    calibrations : sequence of job.CameraSetup
        Calibrations from tankcal.job.calibrations.read_cameras.
    states : sequence of str, optional
        Some of "fixed", "weighted", "free".
    camera : str, optional
        Name of the camera of the job to replace; by default its only camera.
    progress : callable, optional
        Called as progress(text, done, total) before each run and at the end.
    alpha : float, optional
        Significance level of the tests at check points.
    volume : bool, optional
        Whether volumes are computed. Use False for a job that was loaded only for its adjustment,
        without bottom, deadwood and uncertainties.
    file : str, optional
        Name of the file of the calibrations in messages.

    Returns
    -------
    Influence

    Raises
    ------
    InputError
        If the job has no photographs, if the camera is not uniquely named, or if a calibration has
        another format or pixel size.
    ValueError
        If a state is unknown.
    """
    states = tuple(dict.fromkeys(states))
    if not states or set(states) - set(STATES):
        raise ValueError(f"found states {states!r}; expected some of {', '.join(STATES)}")
    calibrations = tuple(calibrations)
    setup = select_camera(job, camera)
    refuse_unsuitable(setup, calibrations, file)
    calibrations = tuple(add_pixel_size(item, calibrations) for item in calibrations)
    free = select_free_parameters(setup, calibrations)
    progress = progress or (lambda text, done, total: None)
    total = 1 + len(calibrations) * len(states)
    progress(message("camera_reference_run", "reference"), 0, total)
    top = TopOfTank(job) if volume and _has_tank(job) else None
    reference, removed = _run_reference(job, add_pixel_size(setup, calibrations), alpha, top)
    common = leave_out_readings(job.measurements, removed)
    runs = [reference]
    for item in calibrations:
        for state in states:
            progress(
                message("camera_run", "{name}, {state}", name=item.camera.name, state=state),
                len(runs),
                total,
            )
            runs.append(_run_calibration(job, common, setup, item, state, free, alpha, top))
    progress(message("camera_runs_done", "done"), total, total)
    adjusted = [number for number, run in enumerate(runs) if run.block is not None]
    return Influence(
        camera=setup.camera.name,
        states=states,
        calibrations=tuple(item.camera.name for item in calibrations),
        searched=job.measurements.settings.snooping,
        removed=removed,
        free=free,
        runs=tuple(runs),
        pairs=tuple(_make_pair(i, j, runs[i], runs[j]) for i, j in combinations(adjusted, 2)),
    )


def _run_reference(job, setup, alpha, top):
    """Adjust with the settings of the job; return the Run and the rejected readings.

    If readings are rejected, the run is repeated without them, as all other runs.
    """
    initial = Run(REFERENCE, None, None, "failed")
    result, adjustment = _adjust_and_record(job, setup, alpha, initial, top)
    if adjustment is None or not adjustment.removed:
        return result, ()
    repeated = replace(job, measurements=leave_out_readings(job.measurements, adjustment.removed))
    result, _ = _adjust_and_record(repeated, setup, alpha, initial, top)
    return result, adjustment.removed


def _run_calibration(job, common, setup, calibration, state, free, alpha, top):
    """Adjust with another calibration of the camera; return the Run."""
    name = calibration.camera.name
    label = f"{name}, {state}"
    if state == "weighted" and not can_be_weighted(calibration):
        return Run(label, name, state, "skipped", skipped="no_sds")
    changed, new_setup, held = exchange_calibration(common, setup, calibration, state, free)
    initial = Run(label, name, state, "failed", held=held)
    return _adjust_and_record(replace(job, measurements=changed), new_setup, alpha, initial, top)[0]


def _adjust_and_record(job, setup, alpha, initial, top):
    """Adjust a job and add the results to a Run; return the Run and the Adjustment or None.

    `top` is a TopOfTank, or None if no volumes are computed.
    """
    try:
        adjustment = adjust_job(job)
    except EXPECTED_ERRORS as error:
        return replace(initial, message=str(error)), None
    volume = failed = None
    if top is not None:
        try:
            volume = top.compute_volume(adjustment)
        except EXPECTED_ERRORS as error:
            failed = "; ".join(str(error).splitlines()[:REASON_LINES])
    result = replace(
        initial,
        outcome="adjusted",
        block=make_block(adjustment, setup, alpha),
        volume=volume,
        volume_failed=failed,
    )
    return result, adjustment


def _has_tank(job):
    """Whether a job contains a complete tank, not only its survey."""
    parts = (job.tank, job.survey, job.datum, job.table)
    shell = job.courses or job.horizontal or job.sphere or job.mesh
    return None not in parts and bool(shell)


def _make_pair(i, j, first, second):
    """Create the Pair of two adjusted runs with the numbers i and j."""
    points, photos, aligned = compare_blocks(first.block, second.block)
    volume = percent = None
    if first.volume is not None and second.volume is not None:
        volume = second.volume.value_m3 - first.volume.value_m3
        percent = 100 * volume / first.volume.value_m3
    return Pair(i, j, points, photos, aligned, volume, percent)
