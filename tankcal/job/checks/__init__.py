"""Checks of the job as a whole, which need more than one of its values.

Each check reports problems and warnings to `log` and returns nothing. A check is skipped if its
values are missing or invalid, because these faults have already been reported.
"""

from tankcal.job.checking import loads_sphere
from tankcal.job.checks.bearing import useless_inputs
from tankcal.job.checks.extent import (
    Extent,
    estimate_diameter_m,
    extent_of,
    has_wall_points,
    is_supplemented,
    wall_of,
)
from tankcal.job.checks.plausible import check_plausible
from tankcal.job.checks.settings import check_settings, check_steps, check_tiny_sds
from tankcal.job.checks.survey import check_survey
from tankcal.job.contract.bottom import check_bottom
from tankcal.job.contract.courses import check_courses, check_welds
from tankcal.job.contract.fittings import check_deadwood, check_roof
from tankcal.job.contract.lying import check_horizontal, check_sphere
from tankcal.job.contract.overrulings import check_overrulings
from tankcal.job.contract.top import check_top
from tankcal.job.contract.uncertainty import (
    check_correlations,
    check_inputs,
    check_levels,
    check_stated,
)
from tankcal.job.entries import kind_of
from tankcal.methods.base import methods_for

__all__ = ["check_all", "check_tank"]


def check_all(values, tables, registers, raw, is_whole, log):
    """Run all checks that the readable parts allow.

    Parameters
    ----------
    values : dict or None
        {section: {key: value}} of the settings; None: unreadable.
    tables : dict
        {name: ColumnValues; None: missing}.
    registers : dict
        {"cameras", "instruments", "clouds" or "meters": {name: {key: value}}}.
    raw : RawJob
        Job as read.
    is_whole : bool
        False: check only the survey.
    log : Log
        Receives problems and warnings.
    """
    if is_whole:
        check_tank(values, tables, raw, log)
        for method in methods_for(kind_of(raw)):
            method.check(values, tables, registers, raw, log)
        check_tiny_sds(tables, registers, raw, log)
    check_survey(values, tables, registers, raw, is_whole, log)
    if tables["overrulings"] is not None:
        check_overrulings(tables["overrulings"], tables, is_whole, log)


def check_tank(values, tables, raw, log):
    """Run all checks except those of the survey; parameters as for `check_all`."""
    kind = kind_of(raw)
    extent = Extent()
    if values is not None:
        extent = extent_of(values, tables, kind)
        check_steps(values["table"], extent, raw, log)
        check_settings(values, tables, extent, kind, raw, log)
        check_levels(values["levels"], extent, raw, log)
        check_plausible(values, tables, extent, kind, raw, log)
    if values is not None:
        _check_of_kind(values, tables, extent, kind, raw, log)
    _check_uncertainty(values, tables, extent, kind, raw, log)


def _check_uncertainty(values, tables, extent, kind, raw, log):
    inputs, correlations, stated = (tables[t] for t in ("uncertainty", "correlations", "stated"))
    if inputs is not None:
        is_readable = values is not None and kind is not None
        check_inputs(inputs, useless_inputs(values, tables, kind) if is_readable else {}, log)
    if correlations is not None:
        check_correlations(correlations, inputs, raw, log)
    if stated is not None:
        check_stated(stated, extent, log)


def _check_of_kind(values, tables, extent, kind, raw, log):
    points, courses = tables["points"], tables["courses"]
    if kind == "vertical":
        if courses is not None:
            check_courses(courses, values, log)
        if tables["welds"] is not None:
            check_welds(tables["welds"], courses, log)
        check_bottom(values, tables["bottom"], points, extent, raw, log)
        check_top(values, is_supplemented(tables), raw, log)
        check_roof(values["roof"], extent, raw, log)
    if kind == "horizontal":
        check_horizontal(values, wall_of(tables), raw, log, estimate_diameter_m(kind, tables))
    if kind == "sphere":
        check_sphere(
            values,
            has_wall_points(tables),
            any(
                method.is_given(tables) or raw.tables.get(method.readings_table, ()) is None
                for method in methods_for(kind)
                if not method.is_supplement
            ),
            loads_sphere(values),
            raw,
            log,
        )
    if tables["deadwood"] is not None:
        check_deadwood(tables["deadwood"], extent, log)
