"""Computation of a job: from the checked job to the wall, the parts of the tank and the table."""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job import Job
from tankcal.messages import message
from tankcal.methods.base import given_methods, supplement_of
from tankcal.pipeline.checks.survey import incomplete_certificate, open_questions
from tankcal.pipeline.overruling_effects import effect_of, warn_of_overrulings
from tankcal.pipeline.result import Result
from tankcal.pipeline.simulation import SIMULATING, gum_intervals, simulate_table
from tankcal.pipeline.surveying import adjust_decided, find_survey, locate_in_book
from tankcal.pipeline.table import (
    check_table,
    compute_table,
    pairs_to_simulate,
    statements,
    verdict_of,
)
from tankcal.pipeline.tanks import body_of, corrections_of, filled_with, gross_at_top
from tankcal.tank.capacity import refuse_falling
from tankcal.tank.dips import proportional_parts

if TYPE_CHECKING:
    from tankcal.survey import Adjustment

MILLIMETRE, PARTS = 0.001, 10  # m; parts of a table step of 10 mm, for proportional parts
PARTS_OF_U, PARTS_M3 = 0.05, 0.0005  # largest error of proportional parts: share of U, or m3
UNBOUNDED_U_M3 = 1e12  # replaces an infinite U


def run(
    job: Job,
    progress: Callable[[str], None] | None = None,
    *,
    part_progress: Callable[[str, int, int], None] | None = None,
    simulated: bool | None = None,
    cluster: int | str | None = None,
) -> Result:
    """Compute a job: adjusted points, wall and axis, parts of the tank, table with covariance.

    Parameters
    ----------
    job : Job
        Job from `tankcal.load`.
    progress : callable, optional
        Called with a line of text at the start of each step.
    part_progress : callable, optional
        Called with (text, done, total) during a long step.
    simulated : bool, optional
        Whether the table is also simulated by Monte Carlo; None: according to the job. A table
        without any uncertainty is never simulated.
    cluster : int or str, optional
        Processes that read point clouds. None: this process; an integer: number of local workers;
        "local": as many as this machine has cores; "auto": local workers for large clouds; an
        address: the scheduler of a dask cluster. The result does not depend on it.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If a course has too few points, if clouds cannot be read, or if a cluster does not answer.
    SolutionError
        If the survey does not determine the points, the vertical or the scale, or if the points
        show no wall.
    TypeError
        If `job` is not a `Job`.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"))
    >>> print(result.at(9.5))
    1249.7 m3, U = 1.5 m3 (k = 1.96)
    """
    _require_job(job, "run")
    with _problems_placed(job):
        return _run(job, progress or (lambda text: None), part_progress, simulated, cluster)


def _run(job, progress, part_progress, simulated, cluster):
    """`Result` of a job; parameters as `run`."""
    if job.tank is None:
        raise InputError(
            Problem(
                "job.toml",
                message("no_tank", "the job has no tank: only its survey can be adjusted"),
            )
        )
    original_job = job
    survey_result = find_survey(job, progress, cluster=cluster, part_progress=part_progress)
    job, survey, adjustment = survey_result.job, survey_result.survey, survey_result.adjustment
    # The table may be that of a supplement, such as metered liquid, which is adjusted first.
    method, supplement = supplement_of(job), None
    if method is not None:
        supplement = method.supplement(job, survey, progress)
    tabulation = compute_table(job, survey, progress, supplement and supplement.body)
    body, zero, table = tabulation.body, tabulation.zero_m, tabulation.table
    # Effect of overruled readings on the volume and the level of the top row.
    top = float(table.volume_m3[-1]), float(tabulation.levels_m[-1])
    overruled = effect_of(original_job, survey_result, *top, progress)
    progress(message("stating", "stating volumes and deliveries"))
    stated = statements(job, table, tabulation.straightness.largest_m3)
    simulation = None
    # The intervals of the law of propagation hold unless a simulation replaces them.
    intervals = gum_intervals(table.volume_m3, table.u_m3, table.U_m3)
    is_simulated = job.table.monte_carlo if simulated is None else simulated
    if is_simulated and table.sources:
        progress(SIMULATING)
        pairs = pairs_to_simulate(stated, job, body, table)
        simulation = simulate_table(job, survey, body, zero, table, pairs, progress=part_progress)
        intervals = simulation.intervals(table)
    supplemented = supplement and supplement.result(tabulation.levels_m)
    by_method = (
        method.correction_tables(job, survey, body, table, part_progress)
        for method in given_methods(job)
    )
    ship = next((tables for tables in by_method if tables is not None), None)
    return Result(
        job=job,
        surveys=_surveys_by_kind(survey, supplemented),
        body=body,
        zero_m=zero,
        table=table,
        straightness=tabulation.straightness,
        proportional_parts=_proportional_parts(job, tabulation, intervals.U_m3),
        corrections=_list_corrections(job, survey, tabulation, supplement),
        by_density=_volumes_by_density(job, survey, tabulation.levels_m, zero, supplement),
        on_high_legs=_table_on_high_legs(job, survey),
        stated=stated,
        simulation=simulation,
        intervals=intervals,
        rule=verdict_of(job, body, table, intervals, simulation),
        warnings=_collect_warnings(
            job,
            adjustment,
            survey_result.sighting,
            survey,
            tabulation,
            supplemented,
            overruled,
        ),
        adjustment=adjustment,
        sights=survey_result.sights,
        ship=ship,
        overrulings=overruled,
    )


def _surveys_by_kind(survey, supplemented):
    """Surveys by `surveyed_as`, with a survey of some courses that it completes."""
    surveys = (survey, getattr(survey, "surveyed", None), supplemented)
    return {found.surveyed_as: found for found in surveys if found is not None}


def _collect_warnings(job, adjustment, sighting, survey, tabulation, supplemented, overruled):
    """All warnings of a job, each with its place in the input."""
    adjustment_warnings = of_supplement = ()
    if adjustment is not None:
        questions = open_questions(job, adjustment.datum, adjustment.causes)
        adjustment_warnings = (*adjustment.warnings, *questions, *_base_warnings(job, adjustment))
    if supplemented is not None:
        of_supplement = supplement_of(job).warnings(job, supplemented)
    warnings = (
        *job.warnings,
        *adjustment_warnings,
        *warn_of_overrulings(job, overruled),
        *check_table(job, survey, tabulation, sighting),
        *of_supplement,
        *incomplete_certificate(job),
    )
    return locate_in_book(job, warnings)


def _base_warnings(job, adjustment):
    """Warnings of the bases measured by stadia."""
    from tankcal.pipeline.checks.survey import check_bases, check_rejected_bases

    rejected = check_rejected_bases(job.measurements, adjustment.readings)
    return (*check_bases(job.measurements), *rejected)


@contextmanager
def _problems_placed(job):
    """Add the place in the input to the problems of an InputError."""
    try:
        yield
    except InputError as error:
        raise InputError(locate_in_book(job, error.problems)) from error


def adjust_job(job: Job, progress: Callable[[str], None] | None = None) -> "Adjustment":
    """Adjust the survey of a job, with or without a tank.

    Parameters
    ----------
    job : Job
        Job from `tankcal.load`; `tankcal.load(path, only="adjustment")` for a job without a tank.
    progress : callable, optional
        Called with a line of text at the start of each step.

    Returns
    -------
    survey.Adjustment

    Raises
    ------
    InputError
        If the job has no measurements.
    SolutionError
        If the measurements do not determine the points.
    TypeError
        If `job` is not a `Job`.

    Examples
    --------
    >>> import tankcal
    >>> survey = tankcal.load("examples/total-station", only="adjustment")
    >>> adjusted = tankcal.adjust_job(survey)
    >>> len(adjusted.names), adjusted.xyz_m.shape == (len(adjusted.names), 3)
    (167, True)
    """
    _require_job(job, "adjust_job")
    if not job.has_network:
        raise InputError(
            Problem(
                "job.toml",
                message(
                    "no_measurements", "the job has no measurements: there is nothing to adjust"
                ),
            )
        )
    with _problems_placed(job):
        adjustment = adjust_decided(job, progress or (lambda text: None))
    warnings = (*adjustment.warnings, *_base_warnings(job, adjustment))
    return replace(adjustment, warnings=locate_in_book(job, warnings))


def _require_job(job, name):
    """Raise TypeError if `job` is not a `Job`; name: the function that was called."""
    if not isinstance(job, Job):
        raise TypeError(f"found {type(job).__name__}; expected a Job: {name}(tankcal.load(path))")


def _proportional_parts(job, tabulation, U_m3):
    """Proportional parts of a centimetre table, if their error is a small part of U.

    Only vertical tanks have proportional parts; other tanks give ().
    """
    spec = job.table
    is_centimetres = spec.step_m is not None and abs(spec.step_m - PARTS * MILLIMETRE) <= 1e-9
    if job.tank.kind != "vertical" or not is_centimetres:
        return ()
    # Interpolation must not cross a break of the volume curve: each part ends at a breakpoint.
    edges = np.unique(np.round([0.0, *tabulation.breakpoints_m, tabulation.top_m], 3))
    allowed = np.maximum(PARTS_OF_U * np.minimum(U_m3, UNBOUNDED_U_M3), PARTS_M3)

    def bound_m3(dips_m):
        return np.interp(dips_m, tabulation.table.height_m, allowed)

    return proportional_parts(tabulation.volume_m3, edges, spec.step_m, PARTS, bound_m3)


def _list_corrections(job, survey, tabulation, supplement):
    """Corrections of the table; the effect of a supplement is the last."""
    corrections = corrections_of(job, survey, tabulation.over_m)
    if supplement is None:
        return corrections
    gross = gross_at_top(job, survey, tabulation.over_m)
    top = float(tabulation.table.volume_m3[-1])
    by_supplement = supplement.correction(corrections, gross, top)
    return corrections if by_supplement is None else (*corrections, by_supplement)


def _table_on_high_legs(job, survey):
    """`Capacity` with the legs of a floating roof in their high position, or None."""
    roof = job.roof
    if roof is None or not job.switches.roof or roof.high_critical_bottom_m is None:
        return None
    raised = replace(
        roof,
        critical_bottom_m=roof.high_critical_bottom_m,
        critical_top_m=roof.high_critical_top_m,
    )
    return compute_table(replace(job, roof=raised), survey).table


def _volumes_by_density(job, survey, levels, zero_m, supplement):
    """Volumes at the rows of the table for each further density of the liquid.

    Density changes the liquid head and the draught of a floating roof.
    """
    volumes = {}
    for density in job.table.other_densities_kg_m3:
        filled = filled_with(job, density)
        if supplement is None:
            body = body_of(filled, survey, uncertain=False)
        else:
            body = supplement.body_for(density)
        volumes[density] = body.volume_m3(levels)
        refuse_falling(filled, body, zero_m, levels - zero_m, volumes[density])
    return volumes
