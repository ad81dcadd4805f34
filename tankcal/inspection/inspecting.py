"""The assembling of an inspection: figures of all parts, judged, as an `InspectionFile`."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tankcal.errors import Problem
from tankcal.inspection.basis import RECORD, basis_of
from tankcal.inspection.bottom import Bottom, inspect_bottom
from tankcal.inspection.figures import Figure
from tankcal.inspection.known_welds import known_welds
from tankcal.inspection.largest_gaps import undetermined
from tankcal.inspection.levelling import read_edge_profiles, read_settlement
from tankcal.inspection.rules import DEFAULT, find_rule, limit_of
from tankcal.inspection.shape import LEAST_READ, inspect_shape, not_surveyed
from tankcal.inspection.verdict import judged
from tankcal.inspection.welds_of_clouds import gaps_of_result
from tankcal.job.folder import OF_INSPECTIONS
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.pipeline.cloud_passes import Reading
from tankcal.record.inspection import InspectedTank, InspectionFile, InspectionRule
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
    settlement, edges : path or None
        settlement.csv and edge_profiles.csv; None: files of these names beside a job, if any.
    yield_pa : float or None
        Yield stress of the shell's steel; None: as the job says.
    """

    source: str | Path
    rule: str | None = None
    nominal: str = "drawing"
    settlement: str | Path | None = None
    edges: str | Path | None = None
    yield_pa: float | None = None


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
    [('plumbness_axis', 'passed'), ('plumbness_generatrix', 'guard_band')]
    """
    log, progress = Log(), progress or (lambda text: None)
    rule = None if asked.rule is None else find_rule(asked.rule, log)
    files = _levelled(asked)
    _read_alone(files, log)  # what is wrong with them is told before a long survey is computed
    log.stop_if_problems()
    basis = basis_of(asked.source, progress, part_progress)
    rule = rule or _rule_of_job(basis, log)
    if basis.is_older and files == (None, None):
        log.problem(basis.file, _older())
    log.stop_if_problems()
    strength = basis.strength
    if asked.yield_pa is not None:
        strength = replace(strength, yield_pa=asked.yield_pa)
    bottom = inspect_bottom(*files, strength, rule.sections, log)
    log.stop_if_problems()
    welds = _welds(basis, rule, part_progress, progress)
    found = inspection_of(basis, rule, bottom, welds, nominal=asked.nominal)
    told = [_older_warning(basis)] if basis.is_older else []
    return replace(found, warnings=[*found.warnings, *warnings_of([*log.warnings, *told])])


def _levelled(asked):
    """Paths of the two tables of levelling: as asked, or beside a job; None where there is none."""
    source, found = Path(asked.source), []
    folder = source if source.is_dir() else source.parent
    is_job = not ((source / RECORD).is_file() or source.suffix.lower() == ".json")
    for given, name in zip((asked.settlement, asked.edges), OF_INSPECTIONS, strict=True):
        beside = folder / name if is_job and (folder / name).is_file() else None
        found.append(beside if given is None else Path(given))
    return tuple(found)


def _read_alone(files, log):
    """Tell `log` what is wrong with the tables of levelling themselves."""
    told = Log()  # their warnings come once more with the figures
    settlement, edges = files
    if settlement is not None:
        read_settlement(settlement, told)
    if edges is not None:
        read_edge_profiles(edges, told)
    log.problems += told.problems


def _rule_of_job(basis, log):
    """The rule that a job names, a file beside it, or the usual one; None after telling `log`."""
    name = basis.rule or DEFAULT
    is_file = name.lower().endswith(".toml")
    return find_rule(str(basis.folder / name) if is_file else name, log)


def _welds(basis, rule, part_progress, progress):
    """`GapsFound` at the welds: of the clouds of a job, else of none."""
    if basis.survey is not None:
        most = {code: limit_of(rule, code) for code in ("peaking", "banding")}
        limits = {code: one.value for code, one in most.items() if one is not None}
        return gaps_of_result(basis.survey, limits, Reading(None, part_progress), progress)
    given = [one.get("welds_rad") or () for one in basis.job["courses"]]
    return undetermined(known_welds(basis.courses_m, given), "gap_no_cloud")


def inspection_of(basis, rule, bottom=None, welds=None, *, nominal="drawing"):
    """The `InspectionFile` of what was computed.

    Parameters
    ----------
    basis : basis.Basis
    rule : rules.Rule or None
        None: figures without limits.
    bottom : bottom.Bottom, optional
    welds : largest_gaps.GapsFound, optional
    nominal : str
        One of NOMINALS.
    """
    sizes, own, bottom = basis.sizes, [], bottom or Bottom()
    if nominal == "mean":
        sizes = replace(sizes, nominal_radius_m=None)
    if basis.shape is None:
        figures, generatrices, levels = not_surveyed(rule, sizes, "wall_not_surveyed"), None, []
    else:
        figures, generatrices, levels = inspect_shape(basis.shape, sizes, rule)
        own += _doubts(basis, sizes, levels)
    if welds is not None:
        figures += [_of_gap(one, limit_of(rule, one.code)) for one in welds.figures]
    checks = [judged(one) for one in (*figures, *bottom.figures)]  # in the order of CHECKS
    return InspectionFile(
        notice=basis.job["certificate"].get("notice") or "",
        tank=_tank(basis, sizes, levels),
        rule=_rule(rule),
        as_built=bottom.as_built,
        checks=checks,
        generatrices=generatrices,
        levels=levels,
        gaps=[] if welds is None else list(welds.gaps),
        settlements=list(bottom.settlements),
        edges=list(bottom.edges),
        warnings=[*(WarningRecord(**one) for one in basis.warnings), *warnings_of(own)],
    )


def _of_gap(one, limit):
    """The `Figure` of a `largest_gaps.GapFigure`."""
    return Figure(
        code=one.code,
        unit="mm",
        value=one.value_mm,
        U=one.U_mm,
        k=one.k,
        dof=np.inf,
        limit=limit,
        course=one.course,
        height_m=one.height_m,
        azimuth_deg=one.azimuth_deg,
        used=one.used,
        remark=one.remark,
        remark_values=one.remark_values,
    )


def _tank(basis, sizes, levels):
    survey, is_surveyed = basis.job["survey"] or {}, basis.shape is not None
    by_drawing = sizes.nominal_radius_m is not None
    mean_m = 2 * float(np.mean([one.mean_radius_m for one in levels])) if levels else None
    return InspectedTank(
        id=basis.job["tank"]["id"],
        name=basis.job["source"],
        source=basis.source,
        file=basis.file,
        sha256=basis.sha256,
        survey_date=survey.get("date"),
        survey_side=survey.get("side") if is_surveyed else None,
        methods=list(basis.methods),
        nominal_diameter_m=sizes.diameter_m if by_drawing else mean_m,
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
        "{point} ({residual_mm:+.1f} mm, {height_m:.2f} m up, azimuth {azimuth_deg:.0f} deg): "
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


def _older_warning(basis):
    text = message(
        "inspect_older_record_alone",
        "a record of a version that did not keep the shape of its wall: only what was levelled is "
        "inspected; the rest needs its job, or the record of a new run",
    )
    return Problem(basis.file, text)
