"""Assemble an inspection: figures and verdicts of all parts as an `InspectionFile`."""

from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

import tankcal.record
from tankcal.errors import InputError, Problem
from tankcal.job import load
from tankcal.job.folder import OF_INSPECTIONS
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.methods.clouds.passes import Reading
from tankcal.pipeline.surveying import find_survey, locate_in_book
from tankcal.pipeline.wall.finding import warnings_of as warnings_of_wall
from tankcal.pipeline.wall.surveyed import Wall
from tankcal.products.inspection.edges import assess_edges
from tankcal.products.inspection.levelling import read_edge_profiles, read_settlement
from tankcal.products.inspection.rules import (
    DEFAULT,
    Figure,
    Strength,
    bulge_limits,
    edge_limits,
    find_rule,
    limit_of,
    make_check,
    settlement_limits,
)
from tankcal.products.inspection.settlement import assess_settlement
from tankcal.products.inspection.shape import LEAST_READ, Sizes, empty_wall_figures, inspect_shape
from tankcal.products.inspection.weld_gaps import empty_gaps, find_gaps
from tankcal.products.inspection.welds import list_welds
from tankcal.record import content_error
from tankcal.record.inspection import InspectedTank, InspectionFile, InspectionRule
from tankcal.record.making import JobAsRead, shape_record
from tankcal.record.schema import WarningRecord, fill_from, to_plain, warnings_of

NOMINALS = ("drawing", "mean")  # sources of the nominal radius
OFF_NOMINAL_MM = 5.0  # deviation of the mean radius that is within building tolerances


@dataclass(frozen=True)
class Asked:
    """Input and options of an inspection.

    Attributes
    ----------
    source : path
        A job, a record.json, or a folder of results.
    rule : str or None
        Name of a shipped rule or path of a rule file. If None, the rule of the job, or DEFAULT.
    nominal : str
        One of NOMINALS: the radii are compared with the radius of the drawing or with their mean.
    settlement, edges : path or None
        settlement.csv and edge_profiles.csv. If None, files of these names in the folder of a job.
    yield_pa : float or None
        Yield stress of the shell's steel, Pa. If None, the yield stress that the job states.
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
        Input and options.
    progress, part_progress : callable, optional
        Callbacks as in `tankcal.run`.

    Returns
    -------
    record.inspection.InspectionFile

    Raises
    ------
    InputError
        If the rule, the tables, the job or the record have problems, or if an older record does
        not contain the shape of its wall. The error lists all problems.
    SolutionError
        As in `tankcal.run`.

    Examples
    --------
    >>> from tankcal.products.inspection.inspecting import Asked, inspect_files
    >>> inspection = inspect_files(Asked("examples/silva-1995"))
    >>> [(check.code, check.verdict) for check in inspection.checks[:2]]
    [('plumbness_axis', 'passed'), ('plumbness_generatrix', 'guard_band')]
    """
    log, progress = Log(), progress or (lambda text: None)
    rule = None if asked.rule is None else find_rule(asked.rule, log)
    files = _levelling_paths(asked)
    _check_levellings(files, log)  # report their problems before a long computation of the survey
    log.stop_if_problems()
    basis = read_basis(asked.source, progress, part_progress)
    rule = rule or _rule_of_job(basis, log)
    if basis.is_older and files == (None, None):
        log.problem(
            basis.file,
            message(
                "inspect_older_record",
                "a record of a version that did not keep the shape of its wall (radii by azimuth "
                "and height with their covariance); expected its job, or the record of a new run",
            ),
        )
    log.stop_if_problems()
    strength = basis.strength
    if asked.yield_pa is not None:
        strength = replace(strength, yield_pa=asked.yield_pa)
    bottom = inspect_bottom(*files, strength, rule.sections, log)
    log.stop_if_problems()
    welds = _welds(basis, rule, part_progress, progress)
    try:
        inspection = assemble_inspection(basis, rule, bottom, welds, nominal=asked.nominal)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        if basis.survey is not None:
            raise
        raise content_error(basis.file, error) from error
    older = [_older_warning(basis)] if basis.is_older else []
    return replace(
        inspection, warnings=[*inspection.warnings, *warnings_of([*log.warnings, *older])]
    )


def _levelling_paths(asked):
    """Paths of the two levelling tables, given or in the folder of a job; None for no table."""
    source, paths = Path(asked.source), []
    folder = source if source.is_dir() else source.parent
    is_job = not ((source / RECORD).is_file() or source.suffix.lower() == ".json")
    for given, name in zip((asked.settlement, asked.edges), OF_INSPECTIONS, strict=True):
        beside = folder / name if is_job and (folder / name).is_file() else None
        paths.append(beside if given is None else Path(given))
    return tuple(paths)


def _check_levellings(files, log):
    """Report the problems of the levelling tables to `log`."""
    alone = Log()  # drops the warnings, which are reported again with the figures
    settlement, edges = files
    if settlement is not None:
        read_settlement(settlement, alone)
    if edges is not None:
        read_edge_profiles(edges, alone)
    log.problems += alone.problems


def _rule_of_job(basis, log):
    """Rule that a job names, or the default rule; None if `log` received a problem of the rule."""
    name = basis.rule or DEFAULT
    is_file = name.lower().endswith(".toml")
    return find_rule(str(basis.folder / name) if is_file else name, log)


def _welds(basis, rule, part_progress, progress):
    """`WeldGaps` at the welds, from the clouds of a job or without any determined gap."""
    if basis.survey is not None:
        gap_limits = {code: limit_of(rule, code) for code in ("peaking", "banding")}
        limits = {code: entry.value for code, entry in gap_limits.items() if entry is not None}
        return find_gaps(basis.survey, limits, Reading(None, part_progress), progress)
    given_rad = [entry.get("welds_rad") or () for entry in basis.job["courses"]]
    return empty_gaps(list_welds(basis.courses_m, given_rad), "gap_no_cloud")


def assemble_inspection(basis, rule, bottom=None, welds=None, *, nominal="drawing"):
    """Build the `InspectionFile` from the results of all parts.

    Parameters
    ----------
    basis : basis.Basis
        Job or record, with the shape of the wall.
    rule : rules.Rule or None
        Rule with the limits; None for figures without limits.
    bottom : Bottom, optional
        Results of the levellings.
    welds : weld_gaps.WeldGaps, optional
        Gaps at the welds.
    nominal : str
        One of NOMINALS.
    """
    sizes, problems, bottom = basis.sizes, [], bottom or Bottom()
    if nominal == "mean":
        sizes = replace(sizes, nominal_radius_m=None)
    if basis.shape is None:
        figures, generatrices, levels = (
            empty_wall_figures(rule, sizes, "wall_not_surveyed"),
            None,
            [],
        )
    else:
        figures, generatrices, levels = inspect_shape(basis.shape, sizes, rule)
        problems += _warn_about_shape(basis, sizes, levels)
    if welds is not None:
        figures += [
            Figure(
                code=item.code,
                unit="mm",
                value=item.value_mm,
                U=item.U_mm,
                k=item.k,
                dof=np.inf,
                limit=limit_of(rule, item.code),
                course=item.course,
                height_m=item.height_m,
                azimuth_deg=item.azimuth_deg,
                used=item.used,
                remark=item.remark,
                remark_values=item.remark_values,
            )
            for item in welds.figures
        ]
    checks = [make_check(item) for item in (*figures, *bottom.figures)]  # in the order of CHECKS
    return InspectionFile(
        notice=basis.job["certificate"].get("notice") or "",
        tank=_tank_record(basis, sizes, levels),
        rule=_rule_record(rule),
        as_built=bottom.as_built,
        checks=checks,
        generatrices=generatrices,
        levels=levels,
        gaps=[] if welds is None else list(welds.gaps),
        settlements=list(bottom.settlements),
        edges=list(bottom.edges),
        warnings=[*(WarningRecord(**item) for item in basis.warnings), *warnings_of(problems)],
    )


def _tank_record(basis, sizes, levels):
    """`InspectedTank` of the file."""
    survey, is_surveyed = basis.job["survey"] or {}, basis.shape is not None
    by_drawing = sizes.nominal_radius_m is not None
    mean_m = 2 * float(np.mean([level.mean_radius_m for level in levels])) if levels else None
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


def _rule_record(rule):
    """`InspectionRule` of the file, or None without a rule."""
    if rule is None:
        return None
    return InspectionRule(rule.name, rule.file, rule.source, rule.verified, rule.remark)


def _warn_about_shape(basis, sizes, levels):
    """Warnings about the shape of a wall."""
    if sizes.nominal_radius_m is not None:
        yield from _warn_about_nominal(basis, sizes, levels)
    yield from _warn_about_rejected(basis)
    plumb_lines = [*basis.shape["plumbs"][-1:], *basis.shape["courses"]]
    if any(sum(plumb["is_read"]) < LEAST_READ for plumb in plumb_lines):
        text = message(
            "inspect_between_readings",
            "fewer than {least} generatrices have readings at both ends: the plumb is estimated "
            "between readings, where a dent may be missed; of simulated walls just beyond a limit "
            "about 6 in 100 passed, not 2.5",
            least=LEAST_READ,
        )
        yield Problem(basis.file, text)


def _warn_about_nominal(basis, sizes, levels):
    """Warning if the mean radii of all levels deviate alike from the nominal radius."""
    means = [1000 * (level.mean_radius_m - sizes.nominal_radius_m) for level in levels]
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


def _warn_about_rejected(basis):
    """Warning about rejected points near the wall, which enter no check."""
    rejected = basis.shape["set_aside"]
    if not rejected:
        return
    worst = max(rejected, key=lambda point: abs(point["residual_mm"]))
    text = message(
        "inspect_set_aside",
        "{count} points near the wall were not taken for it and are not judged, the farthest "
        "{point} ({residual_mm:+.1f} mm, {height_m:.2f} m up, azimuth {azimuth_deg:.0f} deg): "
        "fittings or slips, or a dent? look there",
        count=len(rejected),
        **worst,
    )
    yield Problem(basis.file, text)


def _older_warning(basis):
    """Warning that only the levellings of an older record are inspected."""
    text = message(
        "inspect_older_record_alone",
        "a record of a version that did not keep the shape of its wall: only what was levelled is "
        "inspected; the rest needs its job, or the record of a new run",
    )
    return Problem(basis.file, text)


# ---- settlement of the foot, edge and bulges of the bottom


@dataclass(frozen=True)
class Bottom:
    """Results of the levellings of a tank.

    Attributes
    ----------
    settlements : tuple of record.inspection.Settlement
        Each epoch, then the differences between epochs.
    edges : tuple of record.inspection.EdgeProfile
    figures : tuple of verdict.Figure
        Figures of each epoch in the order of the checks; edge and bulge last.
    """

    settlements: tuple = ()
    edges: tuple = ()
    figures: tuple = ()

    @property
    def as_built(self):
        """Whether differences to an earlier epoch remove the form of the tank as built."""
        return any(settlement.since is not None for settlement in self.settlements)


def inspect_bottom(settlement, edges, strength, sections, log) -> Bottom:
    """Read settlement.csv and edge_profiles.csv, and compute their figures.

    Parameters
    ----------
    settlement, edges : path or None
        The files; None if not levelled.
    strength : rules.Strength
        Diameter, height and steel of the tank. A levelled tank without a diameter is a problem.
    sections : dict
        {section: {key: value}} of the rule. Without the section "settlement", "edge" or "bulge",
        its figures have no limits.
    log : Log
        Receives the problems and warnings of both files.

    Returns
    -------
    Bottom
        Empty if the files have problems.

    Examples
    --------
    >>> from tankcal.products.inspection.rules import Strength
    >>> from tankcal.job.tables import Log
    >>> tank = Strength(13.0, 9.5, yield_pa=250e6, e_pa=206e9)
    >>> bottom = inspect_bottom("examples/inspection/settlement.csv", None, tank, {}, Log())
    >>> [settlement.epoch for settlement in bottom.settlements], bottom.as_built
    (['2019-03-11', '2026-05-04', '2026-05-04'], True)
    """
    problem_count = len(log.problems)
    levelling = None if settlement is None else read_settlement(settlement, log)
    lines = None if edges is None else read_edge_profiles(edges, log)
    is_levelled = not (settlement is None and edges is None)
    if is_levelled and strength.diameter_m is None:
        text = message("bottom_no_diameter", "missing; settlement and edges are held against the"
                       " size of the tank, expected its diameter")  # fmt: skip
        log.problem(Path(settlement or edges).name, text, None, "nominal_diameter_m")
    if len(log.problems) > problem_count:
        return Bottom()
    settlements, figures, profiles = [], [], []
    if levelling is not None:
        limits = settlement_limits(sections.get("settlement"))
        settlements, figures = assess_settlement(levelling, strength, limits, log)
    if lines is not None:
        limits = edge_limits(sections.get("edge")), bulge_limits(sections.get("bulge"))
        profiles, edge_figures = assess_edges(
            lines, strength.diameter_m / 2, *limits, file=Path(edges).name, log=log
        )
        figures = [*figures, *edge_figures]
    return Bottom(tuple(settlements), tuple(profiles), tuple(figures))


# ---- input: a job, or the record of a run

RECORD = "record.json"  # file name of the record in a folder of results
# Attribute of a job or key of a record, and the code of the method in `InspectedTank`.
METHODS = {"clouds": "scan", "hits": "hits", "tangents": "tangents", "strapping": "straps",
           "lines": "lines"}  # fmt: skip


@dataclass(frozen=True)
class Basis:
    """Data of a tank that an inspection starts from.

    Attributes
    ----------
    source : str
        "job" or "record".
    file : str
        Name of the job or of the record.
    folder : Path
        Folder of the job or of the record; levelling tables are searched for here.
    job : dict
        The job as read, a `record.making.JobAsRead` as plain data.
    shape : dict or None
        Shape of the wall, a `record.wall_shape.WallShapeRecord` as plain data.
    methods : tuple of str
        Survey methods that observed the wall.
    warnings : list of dict
        Warnings about the survey, in the form of a record.
    sha256 : str or None
        Hash of the record file; None for a job.
    is_older : bool
        Whether the record has a surveyed wall but, from an older version, not its shape.
    survey : Surveyed or None
        Computed survey of a job; None for a record.
    """

    source: str
    file: str
    folder: Path
    job: dict
    shape: dict | None
    methods: tuple[str, ...]
    warnings: list = field(default_factory=list)
    sha256: str | None = None
    is_older: bool = False
    survey: object = None

    @property
    def strength(self):
        """`Strength` for the settlement limits, with the yield stress that the job states."""
        stated, sizes = self.job.get("inspection") or {}, self.sizes
        known = {"yield_pa": stated.get("yield_pa"), "e_pa": self.job["material"]["e_pa"]}
        return Strength(sizes.diameter_m, sizes.height_m or None, **known)

    @property
    def rule(self):
        """Name of the rule that the job requires, or None if the job names no rule."""
        return (self.job.get("inspection") or {}).get("rule")

    @property
    def courses_m(self):
        """Heights of the courses from the bottom up, m."""
        return tuple(course["height_m"] for course in self.job["courses"])

    @property
    def sizes(self):
        """`Sizes` for the checks of the wall, with the nominal radius of the drawing."""
        nominal = None
        if self.shape is not None:
            nominal = self.shape["nominal_radius_m"]
        elif self.job["tank"]["nominal_diameter_m"] is not None:
            nominal = self.job["tank"]["nominal_diameter_m"] / 2
        diameter_m = None if nominal is None else 2 * nominal
        return Sizes(nominal, sum(self.courses_m), self.courses_m, diameter_m)


def read_basis(source, progress, part_progress=None):
    """Read the `Basis` from a job, a record.json or a folder of results.

    Parameters
    ----------
    source : path
        Job, record.json or folder of results.
    progress, part_progress : callable
        Callbacks as in `tankcal.run`.

    Raises
    ------
    InputError
        If the job or the record is invalid, or if the tank is not upright.
    SolutionError
        If the survey of the job cannot be adjusted.
    """
    path = Path(source)
    if (path / RECORD).is_file():
        path = path / RECORD
    if path.suffix.lower() == ".json":
        return _basis_of_record(path)
    return _basis_of_job(path, progress, part_progress)


def _require_upright(file, kind):
    """Raise InputError unless the tank is upright."""
    if kind != "vertical":
        expected = message(
            "inspect_not_upright",
            "found a tank of kind {kind}; expected an upright one (vertical): plumb, roundness and "
            "settlement are of shells of courses",
            kind=kind,
        )
        raise InputError(Problem(file, expected, column="tank.kind"))


def _basis_of_job(path, progress, part_progress):
    """Read a job and compute its survey."""
    job = load(path)
    settings = "job.toml" if path.is_dir() else path.name
    _require_upright(settings, job.tank.kind)
    try:
        survey = find_survey(job, progress, part_progress=part_progress)
    except InputError as error:
        raise InputError(locate_in_book(job, error.problems)) from error
    job, wall = survey.job, survey.survey
    is_wall = isinstance(wall, Wall)
    warnings = (*job.warnings, *(survey.adjustment.warnings if survey.adjustment else ()))
    warnings = (*warnings, *(warnings_of_wall(job, wall) if is_wall else ()))
    return Basis(
        source="job",
        file=job.source,
        folder=path if path.is_dir() else path.parent,
        job=to_plain(fill_from(JobAsRead, job, inspection=job.inspection)),
        shape=to_plain(shape_record(job, wall)),
        methods=_methods({name: getattr(job, name) for name in METHODS}, is_wall),
        warnings=to_plain(warnings_of(dict.fromkeys(locate_in_book(job, warnings)))),
        survey=survey,
    )


def _basis_of_record(path):
    """Read a saved record."""
    record = tankcal.record.load(path)
    kind = (record["job"]["tank"] or {}).get("kind")
    if kind is None:
        expected = message(
            "inspect_no_tank", "a record without a tank; expected that of a run with its table"
        )
        raise InputError(Problem(path.name, expected))
    _require_upright(path.name, kind)
    return Basis(
        source="record",
        file=path.name,
        folder=path.parent,
        job=record["job"],
        shape=record.get("wall_shape"),
        methods=_methods(record, record["shell"] is not None),
        warnings=record["warnings"],
        sha256=sha256(path.read_bytes()).hexdigest(),
        is_older=record["shell"] is not None and record.get("wall_shape") is None
        and record.get("radii") is None,
    )  # fmt: skip


def _methods(source, is_wall):
    """Codes of the methods that observed a wall, as in `InspectedTank`."""
    names = tuple(word for key, word in METHODS.items() if source.get(key) is not None)
    # Without scans, hits or tangents, the shell was fitted to measured points.
    sightings = {"scan", "hits", "tangents"} & set(names)
    return names if sightings or not is_wall else ("points", *names)
