"""From the survey to the capacity table: rows, volumes and their causes of uncertainty.

The wall may be that of an adjusted survey or of a plan.
"""

from dataclasses import dataclass
from itertools import chain

import numpy as np

from tankcal.geometry.field.sites import MOST_SITES
from tankcal.messages import message
from tankcal.methods.base import accompanying_methods, given_methods, method_of
from tankcal.pipeline.checks.size import check_reference, check_scan, check_size, check_wall
from tankcal.pipeline.checks.survey import against_nominal, warn_of_undeclared
from tankcal.pipeline.tanks import body_of, critical_zone, zero_height
from tankcal.solver.compiled import threads_for
from tankcal.tank.body import Body
from tankcal.tank.capacity import Capacity, refuse_falling
from tankcal.tank.dips import (
    HEIGHT_STEPS_M,
    LADDERS_M,
    Straightness,
    choose_rows,
    interpolation_errors,
    table_heights,
    top_mark,
)
from tankcal.uncertainty import ROUNDING, combine

CLOSED = 1e-3  # area at the top, relative to the largest area, below which a tank is closed
SAME_DIP_M = 1e-6  # largest difference of dips of a row and a joint that coincide


@dataclass(frozen=True)
class ComputedTable:
    """A tank with its capacity table.

    Attributes
    ----------
    body : Body
        Tank as the sum of its parts.
    zero_m : float
        Level of the table's zero (dip 0) in the frame of the parts, m.
    levels_m : ndarray, shape (rows,)
        Levels of the rows in that frame, m.
    breakpoints_m : ndarray
        Dips between empty and full at which the area jumps, m.
    table : Capacity
    straightness : Straightness
        Error of linear interpolation between the rows.
    """

    body: Body
    zero_m: float
    levels_m: np.ndarray
    breakpoints_m: np.ndarray
    table: Capacity
    straightness: Straightness

    @property
    def top_m(self):
        """Dip of the last row: the full tank, in whole millimetres."""
        return float(self.table.height_m[-1])

    @property
    def over_m(self):
        """Height of the last row above the top of the tank, m; negative below the top."""
        return float(self.levels_m[-1] - self.body.highest_m)

    def volume_m3(self, dips_m):
        """Exact volumes (n,) at dips, m3."""
        return _exact(self.body, self.zero_m)(dips_m)


def compute_table(job, survey, progress=lambda text: None, body=None):
    """Compute the capacity table of a job, with the covariance of its rows.

    Parameters
    ----------
    job : Job
    survey : Wall, Scan, mesh or None
        Survey of the tank; None if declared sizes alone describe it.
    progress : callable, optional
        Called with a line of text as each step begins.
    body : Body, optional
        Tank with additional information, such as metered liquid; None: from the survey.

    Returns
    -------
    ComputedTable

    Raises
    ------
    InputError, SolutionError
        If the capacity falls with rising dips: see `refuse_falling`.
    """
    progress(message("integrating", "integrating volumes"))
    if body is None:
        with threads_for(MOST_SITES):
            body = body_of(job, survey)
    zero = zero_height(job, survey)
    progress(message("propagating", "propagating the covariance to every row of the table"))
    spec = job.table
    top = top_mark(body.highest_m - zero, spec.height_unit, closed=_is_closed(body))
    breakpoints = np.unique([edge - zero for edge in body.breakpoints_m if 0 < edge - zero < top])
    exact = _exact(body, zero)
    heights = _rows(spec, exact, top, breakpoints)
    levels = heights + zero
    volumes, areas, sources = _remove_rounding(*body.rows(levels))
    table = Capacity(
        height_m=heights,
        volume_m3=volumes,
        area_m2=areas,
        sources=sources,
        probability=spec.coverage_probability,
        critical_m=critical_zone(job),
    )
    dips = distinct_dips(heights, breakpoints)
    refuse_falling(job, body, zero, dips, exact(dips))
    straightness = interpolation_errors(exact, heights, breakpoints)
    return ComputedTable(body, zero, levels, breakpoints, table, straightness)


def distinct_dips(heights_m, breakpoints_m):
    """Rows, and the breakpoints that differ from a row by more than rounding.

    Across a joint, a table of geometry and liquid has a step: the difference of the areas times the
    estimated error of the joint's height, a few millilitres. Two dips closer than this would show
    the step as a falling volume.

    Examples
    --------
    >>> distinct_dips(np.array([4.79, 4.8]), np.array([4.795, 4.8 + 1e-15])).tolist()
    [4.79, 4.795, 4.8]
    """
    next_row = np.searchsorted(heights_m, breakpoints_m)
    neighbours = heights_m[np.clip([next_row - 1, next_row], 0, len(heights_m) - 1)]
    distance = np.abs(neighbours - breakpoints_m).min(axis=0)
    return np.union1d(heights_m, breakpoints_m[distance > SAME_DIP_M])


def check_table(job, survey, computed, sighting=None):
    """Warnings about a survey and the capacity table computed from it.

    Parameters
    ----------
    job : Job
    survey : Wall, Scan, mesh or None
        As passed to `compute_table`.
    computed : ComputedTable
    sighting : Sighting, Touching or Clouded, optional
        For a wall surveyed by reflectorless hits, by tangents or by clouds.

    Returns
    -------
    tuple of Problem
    """
    of_size = check_size(job, survey)
    survey = getattr(survey, "surveyed", None) or survey  # warnings are about the measurements
    return (
        *of_size,
        *_check_survey(job, survey, computed.top_m),
        *_check_sights(job, survey, sighting),
        *warn_of_undeclared(undeclared_inputs(job, survey, computed.body)),
        *against_nominal(job.tank, computed.table.volume_m3[-1]),
    )


def undeclared_inputs(job, survey, body):
    """Inputs without u: those of the table, then those that affect only corrections of a ship."""
    by_method = (method.undeclared(job, survey) for method in given_methods(job))
    return tuple(dict.fromkeys((*body.undeclared(), *chain.from_iterable(by_method))))


def _check_sights(job, survey, sighting):
    """Warnings about the sights or clouds of a wall."""
    if sighting is None:
        return ()
    for method in given_methods(job):
        if method.is_sighted:
            return method.warnings(job, survey, sighting)
    return ()


def _check_survey(job, survey, top_m):
    """Warnings about a survey, and about the readings that accompany it."""
    if survey is None:
        return ()
    method = method_of(survey)
    if method is not None:
        problems = method.warnings(job, survey)
        if method.computes_top:
            problems = (*problems, *check_reference(job, top_m))
    elif survey.surveyed_as == "wall":
        from tankcal.pipeline.wall.finding import warnings_of

        problems = (*warnings_of(job, survey), *check_wall(job, survey))
    elif survey.surveyed_as == "scan":
        return check_scan(job, survey, top_m)
    else:  # a nominal wall
        return check_reference(job, top_m)
    for other in accompanying_methods(job):
        if other is not method:
            problems = (*problems, *other.warnings(job, survey))
    return problems


def _remove_rounding(volumes, areas, sources):
    """Rows with exact zeros in place of rounding errors.

    Below a raised bottom the volume is a difference of volumes, such as -9e-16 m3 with u of 3e-20
    m3. It would be written with twenty decimals. A row with volume 0 and a significant u is not
    changed.
    """
    u = combine(sources, len(volumes)).u
    largest_rounding = ROUNDING * np.max(np.abs(volumes), initial=0.0)
    is_empty = (np.abs(volumes) <= largest_rounding) & (u <= largest_rounding)
    has_no_area = np.abs(areas) <= ROUNDING * np.max(np.abs(areas), initial=0.0)
    rows = is_empty[:, None]
    sources = tuple(cause.mapped(lambda columns: np.where(rows, 0.0, columns)) for cause in sources)
    return np.where(is_empty, 0.0, volumes), np.where(has_no_area, 0.0, areas), sources


def _exact(body, zero_m):
    """Function from dips to exact volumes."""
    return lambda dips_m: body.volume_m3(dips_m + zero_m)


def _is_closed(body):
    """Whether a tank narrows to zero at its top, as a sphere or a horizontal cylinder does."""
    span = np.linspace(body.lowest_m, body.highest_m, 9)
    areas = body.area_m2(span)
    return bool(areas[-1] < CLOSED * areas.max())


def _rows(spec, exact, top_m, breakpoints_m):
    """Dips of the rows: by the requested step, or by the bound on linear interpolation."""
    step = spec.step_m
    if step is None and spec.height_unit != "m":
        step = float(HEIGHT_STEPS_M[spec.height_unit])
    if spec.max_interpolation_error_m3 is not None:
        return choose_rows(
            exact,
            top_m,
            spec.max_interpolation_error_m3,
            breakpoints_m,
            step_m=step,
            ladder_m=LADDERS_M[spec.height_unit],
        ).height_m
    return table_heights(step, top_m, spec.fine_step_m, spec.fine_zones)
