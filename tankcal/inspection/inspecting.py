"""The assembling of an inspection: figures of all parts, judged, as an `InspectionFile`."""

from dataclasses import dataclass
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.inspection.basis import basis_of
from tankcal.inspection.rules import DEFAULT, find_rule
from tankcal.inspection.shape import LEAST_READ, Sizes, inspect_shape, not_surveyed
from tankcal.inspection.verdict import judged
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.record.inspection import CHECKS, InspectedTank, InspectionFile, InspectionRule
from tankcal.record.texts import WarningRecord, warnings_of

NOMINALS = ("drawing", "mean")
OFF_NOMINAL_MM = 5.0  # of the mean radius: less is within what shells are built to


@dataclass(frozen=True)
class Asked:
    """What to inspect, and by what.

    Attributes
    ----------
    source : path
        A job, a record.json, or a folder of results.
    rule : str or None
        Name of a shipped rule, or path of a file; None: as the job says, else DEFAULT.
    nominal : str
        One of NOMINALS: what the radii are compared with, that of the drawing or their own mean.
    """

    source: str | Path
    rule: str | None = None
    nominal: str = "drawing"


def inspect_files(asked, progress=None, part_progress=None) -> InspectionFile:
    """Inspect a tank by its survey.

    Parameters
    ----------
    asked : Asked
    progress, part_progress : callable, optional
        As of `tankcal.run`.

    Returns
    -------
    record.inspection.InspectionFile

    Raises
    ------
    InputError
        With every problem of rule and tables; of the job or the record; for an older record, which
        does not keep the shape of its wall.
    SolutionError
        As `tankcal.run`.

    Examples
    --------
    >>> from tankcal.inspection.inspecting import Asked, inspect_files
    >>> found = inspect_files(Asked("examples/silva-1995"))
    >>> [(one.code, one.verdict) for one in found.checks[:2]]
    [('plumbness_axis', 'passed'), ('plumbness_generatrix', 'passed')]
    """
    log = Log()
    rule = find_rule(asked.rule or DEFAULT, log)
    log.stop_if_problems()
    basis = basis_of(asked.source, progress or (lambda text: None), part_progress)
    if basis.is_older:
        raise InputError(Problem(basis.file, _older()))
    return inspection_of(basis, rule, nominal=asked.nominal)


def inspection_of(basis, rule, *, nominal="drawing"):
    """The `InspectionFile` of a `Basis`, by a `rules.Rule` or none.

    nominal  one of NOMINALS
    """
    sizes, own = basis.sizes, []
    if nominal == "mean":
        sizes = Sizes(None, sizes.height_m, sizes.courses_m)
    if basis.shape is None:
        figures, generatrices, levels = not_surveyed(rule, sizes, "wall_not_surveyed"), None, []
    else:
        figures, generatrices, levels = inspect_shape(basis.shape, sizes, rule)
        own += _doubts(basis, sizes, levels)
    checks = sorted((judged(one) for one in figures), key=lambda one: CHECKS.index(one.code))
    return InspectionFile(
        notice=basis.job["certificate"].get("notice") or "",
        tank=_tank(basis, sizes),
        rule=_rule(rule),
        as_built=False,
        checks=checks,
        generatrices=generatrices,
        levels=levels,
        gaps=[],
        settlements=[],
        edges=[],
        warnings=[*(WarningRecord(**one) for one in basis.warnings), *warnings_of(own)],
    )


def _tank(basis, sizes):
    survey, is_surveyed = basis.job["survey"] or {}, basis.shape is not None
    by_drawing = sizes.nominal_radius_m is not None
    return InspectedTank(
        id=basis.job["tank"]["id"],
        name=basis.job["source"],
        source=basis.source,
        file=basis.file,
        sha256=basis.sha256,
        survey_date=survey.get("date"),
        survey_side=survey.get("side") if is_surveyed else None,
        methods=list(basis.methods),
        nominal_diameter_m=sizes.diameter_m,
        nominal_source="drawing" if by_drawing else "mean" if is_surveyed else "none",
        height_m=sizes.height_m or None,
        state=basis.shape["state"] if is_surveyed else "as_found",
    )


def _rule(rule):
    if rule is None:
        return None
    return InspectionRule(rule.name, rule.file, rule.source, rule.verified, rule.remark)


def _doubts(basis, sizes, levels):
    """What the shape of a wall should be read with."""
    if sizes.nominal_radius_m is not None:
        yield from _of_nominal(basis, sizes, levels)
    yield from _of_set_aside(basis)
    plumbs = [*basis.shape["plumbs"][-1:], *basis.shape["courses"]]
    if any(sum(one["is_read"]) < LEAST_READ for one in plumbs):
        text = message(
            "inspect_between_readings",
            "fewer than {least} generatrices have readings at both ends: the plumb is estimated "
            "between readings, where a dent may be missed; of simulated walls just beyond a limit "
            "about 6 in 100 passed, not 2.5",
            least=LEAST_READ,
        )
        yield Problem(basis.file, text)


def _of_nominal(basis, sizes, levels):
    """Every radius on one side of the nominal one: is that what was built?"""
    means = [1000 * (one.mean_radius_m - sizes.nominal_radius_m) for one in levels]
    spread = max(means) - min(means)
    middle = sum(means) / len(means)
    if abs(middle) > max(2 * spread, OFF_NOMINAL_MM):
        text = message(
            "inspect_nominal",
            "the mean radii are {miss_mm:+.1f} mm from the nominal one, at all levels alike: that "
            "is in every departure; is the nominal diameter what was built? --nominal mean takes "
            "it off",
            miss_mm=middle,
        )
        yield Problem(basis.file, text, column="tank.nominal_diameter_m")


def _of_set_aside(basis):
    """Points near the wall that were not taken for it, and so are not judged."""
    found = basis.shape["set_aside"]
    if not found:
        return
    worst = max(found, key=lambda one: abs(one["residual_mm"]))
    text = message(
        "inspect_set_aside",
        "{count} points near the wall were not taken for it and are not judged, the farthest "
        "{point} ({residual_mm:+.0f} mm, {height_m:.2f} m up, azimuth {azimuth_deg:.0f} deg): "
        "fittings or slips, or a dent? look there",
        count=len(found),
        **worst,
    )
    yield Problem(basis.file, text)


def _older():
    return message(
        "inspect_older_record",
        "a record of a version that did not keep the shape of its wall (radii by azimuth and "
        "height with their covariance); expected its job, or the record of a new run",
    )
