"""The main job on one screen: a checked job in; wall, parts and the capacity table out."""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job import Job
from tankcal.messages import message
from tankcal.pipeline.corrections import correction_by_liquid, corrections_of, gross_at_top
from tankcal.pipeline.liquid_geometry import filled_with
from tankcal.pipeline.overruling import effect_of, warn_of_overrulings
from tankcal.pipeline.result import Result
from tankcal.pipeline.simulation import gum_intervals, simulate_table
from tankcal.pipeline.simulation.table import SIMULATING
from tankcal.pipeline.statements import pairs_to_simulate, statements, verdict_of
from tankcal.pipeline.survey_warnings import incomplete_certificate, open_questions
from tankcal.pipeline.surveying import adjust_decided, find_survey, is_surveyed_as, placed
from tankcal.pipeline.table import check_table, compute_table
from tankcal.pipeline.tanks import body_of
from tankcal.tank.dips import proportional_parts
from tankcal.tank.falling_capacity import refuse_falling

if TYPE_CHECKING:
    from tankcal.survey import Adjustment

MILLIMETRE, PARTS = 0.001, 10  # of a step of the tables that proportional parts are for
PARTS_OF_U, PARTS_M3 = 0.05, 0.0005  # error of proportional parts: a share of U, or half a litre
VAST_M3 = 1e12  # stands for a U without end


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
        Of `tankcal.load`.
    progress : callable, optional
        Called with a line of text as each step begins.
    part_progress : callable, optional
        Called with (text, done, total) while a long step goes on.
    simulated : bool, optional
        Whether the table is simulated, too; None: as the job says. One without any uncertainty
        never is.
    cluster : int or str, optional
        Who reads clouds: None, this process; a number of workers on this machine; "local", as
        many as it has cores; "auto", these where it pays; the address of a scheduler of dask.
        The result is the same.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        When a course is left with too few points, when clouds cannot be read, or when a cluster
        does not answer.
    SolutionError
        When the survey does not determine the points, the vertical or the scale, or when there is
        no wall.
    TypeError
        For anything but a `Job`.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"))
    >>> print(result.at(9.5))
    1249.8 m3, U = 1.5 m3 (k = 1.96)
    """
    _refuse_other(job, "run")
    with _telling(job):
        return _run(job, progress or (lambda text: None), part_progress, simulated, cluster)


def _run(job, progress, part_progress, simulated, cluster):
    if job.tank is None:
        raise InputError(
            Problem(
                "job.toml",
                message("no_tank", "the job has no tank: only its survey can be adjusted"),
            )
        )
    given = job
    found = find_survey(job, progress, cluster=cluster, part_progress=part_progress)
    job, survey, adjustment = found.job, found.survey, found.adjustment
    surveyed = _by_kind(survey)
    measured = None
    if job.liquid is not None:
        from tankcal.pipeline.liquid import measure_by_liquid

        progress(message("adjusting_liquid", "adjusting the runs by liquid with the geometry"))
        measured = measure_by_liquid(job, survey)
    made = compute_table(job, survey, progress, measured and measured.body)
    body, zero, table = made.body, made.zero_m, made.table
    top = float(table.volume_m3[-1]), float(made.levels_m[-1])
    overruled = effect_of(given, found, *top, progress)
    progress(message("stating", "stating volumes and deliveries"))
    stated = statements(job, table, made.straightness.largest_m3)
    simulation = None
    intervals = gum_intervals(table.volume_m3, table.u_m3, table.U_m3)
    wanted = job.table.monte_carlo if simulated is None else simulated
    if wanted and table.sources:
        progress(SIMULATING)
        pairs = pairs_to_simulate(stated, job, body, table)
        simulation = simulate_table(job, survey, body, zero, table, pairs, progress=part_progress)
        intervals = simulation.intervals(table)
    liquid = measured and measured.result(made.levels_m)
    ship = None
    if job.ship is not None:
        from tankcal.pipeline.ship import ship_tables

        ship = ship_tables(job, survey, body, table, progress=part_progress)
    return Result(
        job=job,
        wall=surveyed.get("wall"),
        scan=surveyed.get("scan"),
        body=body,
        zero_m=zero,
        table=table,
        straightness=made.straightness,
        proportional_parts=_parts(job, made, intervals.U_m3),
        corrections=_corrections(job, survey, made, liquid),
        by_density=_by_density(job, survey, made.levels_m, zero, measured),
        stated=stated,
        simulation=simulation,
        intervals=intervals,
        rule=verdict_of(job, body, table, intervals, simulation),
        warnings=_warnings(
            job,
            adjustment,
            found.sighting or found.touching or found.clouded,
            survey,
            made,
            liquid,
            overruled,
        ),
        adjustment=adjustment,
        strapped=surveyed.get("strapped"),
        sighting=found.sighting,
        touching=found.touching,
        clouded=found.clouded,
        liquid=liquid,
        nominal=surveyed.get("nominal"),
        radii=surveyed.get("radii"),
        rings=surveyed.get("rings"),
        ship=ship,
        circles=surveyed.get("circles"),
        overrulings=overruled,
    )


def _by_kind(survey):
    """{kind: what was surveyed}; beside declared radii what was measured again of them."""
    both = (survey, survey.surveyed if is_surveyed_as(survey, "radii") else None)
    return {one.surveyed_as: one for one in both if one is not None}


def _warnings(job, adjustment, sighting, survey, made, liquid, overruled):
    of_survey, of_liquid = (), ()
    if adjustment is not None:
        left_open = open_questions(job, adjustment.datum, adjustment.causes)
        of_survey = (*adjustment.warnings, *left_open, *_warnings_of_bases(job, adjustment))
    if liquid is not None:
        from tankcal.pipeline.liquid_checks import check_liquid_result

        of_liquid = check_liquid_result(job, liquid)
    warnings = (
        *job.warnings,
        *of_survey,
        *warn_of_overrulings(job, overruled),
        *check_table(job, survey, made, sighting),
        *of_liquid,
        *incomplete_certificate(job),
    )
    return placed(job, warnings)


def _warnings_of_bases(job, adjustment):
    from tankcal.pipeline.stadia_checks import check_bases, check_rejected_bases

    rejected = check_rejected_bases(job.measurements, adjustment.readings)
    return (*check_bases(job.measurements), *rejected)


@contextmanager
def _telling(job):
    try:
        yield
    except InputError as error:
        raise InputError(placed(job, error.problems)) from error


def adjust_job(job: Job, progress: Callable[[str], None] | None = None) -> "Adjustment":
    """Adjust the survey of a job, whether it has a tank or not.

    Parameters
    ----------
    job : Job
        Of `tankcal.load`; `tankcal.load(path, only="adjustment")` for one without a tank.
    progress : callable, optional
        Called with a line of text as each step begins.

    Returns
    -------
    survey.Adjustment

    Raises
    ------
    InputError
        When nothing was measured.
    SolutionError
        When the measurements do not determine the points.
    TypeError
        For anything but a `Job`.

    Examples
    --------
    >>> import tankcal
    >>> survey = tankcal.load("examples/total-station", only="adjustment")
    >>> adjusted = tankcal.adjust_job(survey)
    >>> len(adjusted.names), adjusted.xyz_m.shape == (len(adjusted.names), 3)
    (167, True)
    """
    _refuse_other(job, "adjust_job")
    if job.measurements is None:
        raise InputError(
            Problem(
                "job.toml",
                message(
                    "no_measurements", "the job has no measurements: there is nothing to adjust"
                ),
            )
        )
    with _telling(job):
        adjustment = adjust_decided(job, progress or (lambda text: None))
    warnings = (*adjustment.warnings, *_warnings_of_bases(job, adjustment))
    return replace(adjustment, warnings=placed(job, warnings))


def _refuse_other(job, name):
    if not isinstance(job, Job):
        raise TypeError(f"found {type(job).__name__}; expected a Job: {name}(tankcal.load(path))")


def _parts(job, made, U_m3):
    """Proportional parts of a centimetre table where their error is a small part of U."""
    spec = job.table
    is_centimetres = spec.step_m is not None and abs(spec.step_m - PARTS * MILLIMETRE) <= 1e-9
    if job.tank.kind != "vertical" or not is_centimetres:
        return ()
    edges = np.unique(np.round([0.0, *made.breakpoints_m, made.top_m], 3))
    allowed = np.maximum(PARTS_OF_U * np.minimum(U_m3, VAST_M3), PARTS_M3)

    def bound_m3(dips_m):
        return np.interp(dips_m, made.table.height_m, allowed)

    return proportional_parts(made.volume_m3, edges, spec.step_m, PARTS, bound_m3)


def _corrections(job, survey, made, liquid):
    found = corrections_of(job, survey, made.over_m)
    if liquid is None or liquid.certified == "geometry":
        return found
    gross = gross_at_top(job, survey, made.over_m)
    return (*found, correction_by_liquid(found, gross, float(made.table.volume_m3[-1])))


def _by_density(job, survey, levels, zero_m, measured):
    """The same rows for each further density of the liquid: another head, another draught."""
    found = {}
    for density in job.table.other_densities_kg_m3:
        filled = filled_with(job, density)
        if measured is None:
            body = body_of(filled, survey, uncertain=False)
        else:
            body = measured.body_for(density)
        found[density] = body.volume_m3(levels)
        refuse_falling(filled, body, zero_m, levels - zero_m, found[density])
    return found
