"""What does a wrong calibration do? The same block with each of several calibrations.

Every calibration replaces the job's camera three times: fixed, weighted by its standard deviations
(its correlations are not known), and free, where it gives start values only. Blunders are searched
once, in the reference (the job's own settings): what is rejected there is left out of all runs, no
run searches again, and all volumes go through the points of the wall that the reference accepted.
So differences come from the calibration and not from the observations.
Source: Pessoa 2017.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tankcal.calibration.capacity_at_top import TopOfTank, TopVolume
from tankcal.calibration.influence.blocks import Block, Moved, PhotosMoved, block_of, differences
from tankcal.calibration.influence.exchange import (
    FILE,
    STATES,
    can_be_weighted,
    counted_in,
    exchange_calibration,
    free_parameters,
    leave_out_readings,
    refuse_others,
    select_camera,
)
from tankcal.calibration.product.check import ALPHA
from tankcal.errors import TankcalError
from tankcal.messages import message
from tankcal.pipeline.chain import adjust_job

REFERENCE = "reference"
TOLD = 3  # lines of why there is no volume
BAD_END = (TankcalError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Run:
    """One adjustment of the block.

    calibration, state  None for the reference, which has the job's own
    outcome        "adjusted", "failed" or "skipped"
    message        why it failed, in words    skipped  code why it was left out, or ""
    held           parameters held for want of an sd, in a run "weighted"
    block          None unless adjusted
    volume         None without a tank, or where `volume_failed` says why there is none
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
    """Two runs, by their numbers: other minus one.

    aligned         ways of the datum that nothing observes, taken out of the differences
    volume_m3       difference of the capacities at the top, volume_percent of that of `one`; None
    """

    one: int
    other: int
    points: Moved
    photos: PhotosMoved
    aligned: int
    volume_m3: float | None
    volume_percent: float | None


@dataclass(frozen=True)
class Influence:
    """The block with all calibrations.

    camera    name of the camera that was replaced
    searched  whether blunders were searched in the reference
    removed   tuple of surveys.Reading rejected there, and left out of all runs
    free      names of the parameters that runs "free" adjust
    runs      tuple of Run, the reference first      pairs  tuple of Pair of those adjusted
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
    """Influence of calibrations on the block of a job, and on its tank if it has one.

    A run that fails is a result with its message.

    Parameters
    ----------
    job : tankcal.job.Job
        A loaded job.
    calibrations : tuple of job.CameraSetup
        As tankcal.job.calibrations.read_cameras gives them.
    states : sequence of str, optional
        Which of "fixed", "weighted", "free".
    camera : str, optional
        Name of the job's camera that is replaced; None: its only one.
    progress : callable, optional
        progress(text, done, total) is called before each run and at the end.
    alpha : float, optional
        Level of the tests at check points.
    volume : bool, optional
        False for a job that was loaded for its adjustment only: it may have courses, but no
        bottom, deadwood or uncertainties, so its volume would be another one.
    file : str, optional
        What messages call the place where the calibrations stand.

    Returns
    -------
    Influence

    Raises
    ------
    InputError
        For a job without photographs, a camera that is not named, calibrations of another format
        or pixel.
    ValueError
        For other states.
    """
    states = tuple(dict.fromkeys(states))
    if not states or set(states) - set(STATES):
        raise ValueError(f"found states {states!r}; expected some of {', '.join(STATES)}")
    calibrations = tuple(calibrations)
    setup = select_camera(job, camera)
    refuse_others(setup, calibrations, file)
    calibrations = tuple(counted_in(one, calibrations) for one in calibrations)
    free = free_parameters(setup, calibrations)
    progress = progress or (lambda text, done, total: None)
    total = 1 + len(calibrations) * len(states)
    progress(message("camera_reference_run", "reference"), 0, total)
    top = TopOfTank(job) if volume and _is_whole(job) else None
    reference, removed = _reference(job, counted_in(setup, calibrations), alpha, top)
    common = leave_out_readings(job.measurements, removed)
    runs = [reference]
    for one in calibrations:
        for state in states:
            progress(
                message("camera_run", "{name}, {state}", name=one.camera.name, state=state),
                len(runs),
                total,
            )
            runs.append(_run(job, common, setup, one, state, free, alpha, top))
    progress(message("camera_runs_done", "done"), total, total)
    return Influence(
        camera=setup.camera.name,
        states=states,
        calibrations=tuple(one.camera.name for one in calibrations),
        searched=job.measurements.settings.snooping,
        removed=removed,
        free=free,
        runs=tuple(runs),
        pairs=_pairs(runs),
    )


def _reference(job, setup, alpha, top):
    """The Run with the job's own settings, and the readings that its search rejected."""
    begun = Run(REFERENCE, None, None, "failed")
    found, adjustment = _adjusted(job, setup, alpha, begun, top)
    if adjustment is None or not adjustment.removed:
        return found, ()
    again = replace(job, measurements=leave_out_readings(job.measurements, adjustment.removed))
    found, _ = _adjusted(again, setup, alpha, begun, top)
    return found, adjustment.removed


def _run(job, common, setup, calibration, state, free, alpha, top):
    """The Run with another calibration of the camera."""
    name = calibration.camera.name
    label = f"{name}, {state}"
    if state == "weighted" and not can_be_weighted(calibration):
        return Run(label, name, state, "skipped", skipped="no_sds")
    changed, own, held = exchange_calibration(common, setup, calibration, state, free)
    begun = Run(label, name, state, "failed", held=held)
    return _adjusted(replace(job, measurements=changed), own, alpha, begun, top)[0]


def _adjusted(job, setup, alpha, begun, top):
    """A Run with what came out of a job, and its survey.Adjustment; None where it failed.

    top  capacity_at_top.TopOfTank, or None: no volumes
    """
    try:
        adjustment = adjust_job(job)
    except BAD_END as error:
        return replace(begun, message=str(error)), None
    volume = failed = None
    if top is not None:
        try:
            volume = top.of(adjustment)
        except BAD_END as error:
            failed = "; ".join(str(error).splitlines()[:TOLD])
    ended = replace(
        begun,
        outcome="adjusted",
        block=block_of(adjustment, setup, alpha),
        volume=volume,
        volume_failed=failed,
    )
    return ended, adjustment


def _is_whole(job):
    """Whether a job has all of a tank, rather than its survey only."""
    parts = (job.tank, job.survey, job.datum, job.table)
    shell = job.courses or job.horizontal or job.sphere or job.mesh
    return None not in parts and bool(shell)


def _pairs(runs):
    """A Pair for each two runs that were adjusted."""
    numbers = [i for i, one in enumerate(runs) if one.block is not None]
    return tuple(_pair(i, j, runs[i], runs[j]) for i, j in combinations(numbers, 2))


def _pair(i, j, one, other):
    points, photos, aligned = differences(one.block, other.block)
    volume = percent = None
    if one.volume is not None and other.volume is not None:
        volume = other.volume.value_m3 - one.volume.value_m3
        percent = 100 * volume / one.volume.value_m3
    return Pair(i, j, points, photos, aligned, volume, percent)
