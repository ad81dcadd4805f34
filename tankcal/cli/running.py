"""`tankcal run` and `tankcal demo`: computation of a job and output of its results."""

from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem, SolutionError, problem_of
from tankcal.job.certificate_entries import missing_entries
from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_json,
    add_letterhead,
    marks,
    parse_cluster,
    print_doubts,
    print_json,
    print_paths,
    read_job,
    read_letterhead,
    say,
    warn,
)
from tankcal.text.digits import (
    decimals_of,
    decimals_of_height,
    fixed,
    format_significant,
    format_with_u,
)

MOST_NAMES = 5  # of rejected observations of a kind


def add(commands):
    """Add the parsers of `tankcal run` and `tankcal demo`."""
    _add_run(commands)
    demo = commands.add_parser(
        "demo",
        help="run the shipped example",
        description="Compute the shipped example, a reconstruction of the tank of Silva 1995.",
    )
    demo.add_argument("--out", metavar="DIR", help="output folder", default="tankcal-demo-results")
    demo.add_argument("--quiet", action="store_true", help="no progress, only problems")
    demo.set_defaults(command=_demo)


def _add_run(commands):
    run = commands.add_parser(
        "run",
        help="compute a job and write its results",
        description="Read, check and compute a job, and write the results, all or nothing: "
        "record.json, points.csv, sections.csv, capacity.csv, capacity.xlsx, certificate.xml, "
        "report.ipynb, certificate.pdf, working-papers.pdf, report.pdf (both), field-table.pdf "
        "and report.html. An adjusted survey adds points_cov.npz, photos.csv, cameras.csv, "
        "groups.csv and residuals.csv.",
        epilog="exit status: 0 done; 2 the input must be corrected; 3 the survey has no valid "
        "solution, or, with --strict, the adjustment is doubtful; no file is written.",
    )
    run.add_argument("job", metavar="JOB", help="a job folder, its job.toml, or a job workbook")
    run.add_argument(
        "--out",
        metavar="DIR",
        help="output folder (default: results in the folder of the job, or NAME-results beside "
        "NAME.xlsx); earlier results there are replaced",
    )
    run.add_argument(
        "--only",
        choices=("adjustment",),
        help="stop after the adjustment of the survey; no tank is required, and adjustment.xlsx "
        "replaces capacity.xlsx",
    )
    run.add_argument(
        "--strict",
        action="store_true",
        help="write no file if the global test of the adjustment fails, or if a rejected "
        "observation may not be the blunder (exit status 3), or if the certificate would be a "
        "draft (exit status 2)",
    )
    papers = run.add_mutually_exclusive_group()
    add_letterhead(papers)
    papers.add_argument(
        "--no-papers",
        action="store_true",
        help="write the record and the CSV files only; tankcal report creates workbook and "
        "reports from the record",
    )
    run.add_argument(
        "--cluster",
        metavar="WHERE",
        type=parse_cluster,
        default="auto",
        help="workers for point clouds: local (one worker per core), a number of workers (0: "
        "none), or the address of a dask scheduler (default: workers on this machine where "
        "they save time); the results do not depend on the workers",
    )
    run.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(run)
    run.set_defaults(command=_run)


def _run(options):
    from tankcal.report.folders import default_folder

    source = Path(options.job)
    _compute(
        source,
        Path(options.out) if options.out else default_folder(source),
        quiet=options.quiet or options.machine,
        only=options.only,
        strict=options.strict,
        cluster=options.cluster,
        papers=(read_letterhead(options), not options.no_papers),
        tell=_tell_machine if options.machine else _tell,
    )


def _demo(options):
    from tankcal.text.shipped import shipped_folder

    job = shipped_folder("examples") / "silva-1995"
    _compute(job, Path(options.out), quiet=options.quiet, tell=_tell)


def _compute(
    source, out, *, quiet, tell, only=None, strict=False, cluster=None, papers=(None, True)
):
    """Compute a job, or with only="adjustment" its survey; write and print the results.

    `papers` is (letterhead or None, whether to write the reports); `tell` prints the results.
    """
    show = Progress(quiet)
    job = read_job(source, show, only=only)
    from tankcal.report import outputs

    if strict and only is None and papers[1]:
        _refuse_draft(job, papers[0])

    outputs.refuse_foreign(out)
    doubts = _find_doubts(job.warnings)
    if doubts and tell is _tell:  # before the computation, which they may slow down
        show.end()
        print_doubts(doubts)
    result = None
    if only == "adjustment":
        adjustment = tankcal.adjust_job(job, show.step)
    else:
        result = tankcal.run(job, show.step, part_progress=show.part, cluster=cluster)
        adjustment = result.adjustment
    if strict:
        _refuse_failed(adjustment)
    if result is None:
        paths = outputs.write_adjustment(job, adjustment, out, show.part, *papers)
        warnings = dict.fromkeys((*job.warnings, *adjustment.warnings, *_idle_cluster(cluster)))
    else:
        paths = outputs.write(result, out, show.part, *papers)
        warnings = _complete_by_letterhead(result.warnings, result.job, papers[0])
        warnings = (*warnings, *_idle_cluster(cluster, result.job.clouds))
    show.end()
    tell(out, paths, warnings, result, adjustment)


def _complete_by_letterhead(warnings, job, letterhead):
    """Return the warnings, without missing entries of the certificate that a letterhead states."""
    if letterhead is None:
        return warnings
    from tankcal.pipeline.checks import incomplete_certificate

    others = [
        warning
        for warning in warnings
        if getattr(warning.expected, "code", None) != "certificate_incomplete"
    ]
    return (*others, *incomplete_certificate(job, has_letterhead=True))


def _idle_cluster(cluster, clouds=None):
    """Return a warning for requested workers if there are no clouds to read."""
    if cluster in (None, "auto", 0) or clouds is not None:
        return ()
    text = message("cluster_idle", "without effect: the job has no point cloud")
    return (Problem("--cluster", text),)


def _find_doubts(warnings):
    from tankcal.job.plausibility import CODES

    return [warning for warning in warnings if getattr(warning.expected, "code", None) in CODES]


def _tell(out, paths, warnings, result, adjustment):
    """Print warnings, a summary and the files; print implausible inputs again at the end."""
    doubts = _find_doubts(warnings)
    warn(warning for warning in warnings if warning not in doubts)
    if adjustment is not None:
        say(_summary(adjustment))
    if result is not None:
        say(_capacity(result))
    for line in describe_rejected(result, adjustment):
        say(line)
    print_paths(out, paths)
    print_doubts(doubts)


def _tell_machine(out, paths, warnings, result, adjustment):
    """Print the results as one JSON object."""
    print_json(
        exit_status=0,
        out=str(out),
        files=[path.name for path in paths],
        tank=None if result is None else result.job.tank.id,
        top=None if result is None else _top(result),
        adjustment=None if adjustment is None else _fit(adjustment),
        warnings=[problem_of(warning) for warning in warnings],
    )


def _top(result):
    """Return the values of the top row; k is null if U results from Monte Carlo."""
    table, stated = result.table, result.intervals
    return {
        "height_m": float(table.height_m[-1]),
        "volume_m3": float(table.volume_m3[-1]),
        "u_m3": float(table.u_m3[-1]),
        "U_m3": float(stated.U_m3[-1]),
        "k": float(table.k[-1]) if stated.by_gum[-1] else None,
        "coverage_probability": table.probability,
    }


def _fit(adjustment):
    tested = adjustment.redundancy > 0
    return {
        "points": len(adjustment.names),
        "redundancy": adjustment.redundancy,
        "sigma0": float(adjustment.sigma0) if tested else None,
        "global_test_passed": bool(adjustment.adjusted.test().passed) if tested else None,
        "set_aside": len(adjustment.removed),
    }


def _capacity(result):
    """Return one line with the capacity, rounded to the digits of U, and the number of points."""
    top_m = result.table.height_m[-1]
    top, stated = result.at(top_m), result.intervals
    unit, factor, decimals = _volume_unit(result.job.table.volume_unit)
    U = factor * stated.U_m3[-1]
    volume = format_with_u(factor * top.value_m3, U, marks(), least=0)
    how = message("by_monte_carlo", "by Monte Carlo")
    if stated.by_gum[-1]:
        how = message("with_k", "k = {factor:.2f}", factor=top.k)
    points = ""
    if result.accepted is not None:
        accepted = len(result.accepted)
        points = message(
            "points_of_wall",
            ", {accepted} points of the wall, {rejected} rejected",
            accepted=accepted,
            rejected=len(result.job.points.names) - accepted,
        )
    values = {
        "tank": result.job.tank.id,
        "unit": unit,
        "height": fixed(top_m, decimals_of_height(top_m), marks()),
        "points": points,
    }
    if not stated.U_m3[-1] > 0:
        return message(
            "holds_without_u",
            "{tank}: {volume} {unit} at {height} m, no uncertainty stated, because no input has "
            "a declared uncertainty{points}",
            volume=fixed(factor * top.value_m3, decimals, marks()),
            **values,
        )
    return message(
        "holds",
        "{tank}: {volume} {unit} at {height} m, U = {uncertainty} {unit} ({how}){points}",
        volume=volume.value,
        uncertainty=fixed(U, decimals_of(U, least=None), marks()),
        how=how,
        **values,
    )


def _volume_unit(name):
    """Return (unit of volumes for the terminal, its factor from m3, decimals of a row)."""
    from tankcal.tank.dips import TABLE_DECIMALS, VOLUME_UNITS_M3

    shown = message("cubic_metres", "m3") if name == "m3" else name
    return shown, float(1 / VOLUME_UNITS_M3[name]), TABLE_DECIMALS[name]


def _refuse_draft(job, letterhead):
    """Raise InputError if the certificate lacks required entries."""
    location = job.tank.details.get("location")
    missing = missing_entries(job.certificate, location, letterhead is not None)
    if missing:
        text = message(
            "strict_draft",
            "not given: {entries}; ISO/IEC 17025, 7.8.2 and 7.8.4, requires them; no file was "
            "written (--strict)",
            entries=missing,
        )
        raise InputError(Problem("job.toml", text, column="certificate"))


def _refuse_failed(adjustment):
    """Raise SolutionError for a doubtful adjustment or a failed global test."""
    if adjustment is not None and adjustment.doubts:
        nothing = message("strict_nothing", "no file was written (--strict)")
        raise SolutionError(*(doubt.text for doubt in adjustment.doubts), nothing)
    if adjustment is None or adjustment.redundancy <= 0:
        return
    test = adjustment.adjusted.test()
    if not test.passed:
        raise SolutionError(
            message(
                "strict_test_failed",
                "the global test of the adjustment failed: v'Pv = {chi2:.1f}, expected {low:.1f} "
                "to {high:.1f} ({dof} degrees of freedom, sigma0 = {sigma0:.3f}); no file was "
                "written (--strict)",
                chi2=test.chi2,
                low=test.low,
                high=test.high,
                dof=test.dof,
                sigma0=adjustment.sigma0,
            )
        )


def _summary(adjustment):
    """Return one line with the fit of the survey and the precision of its points."""
    from tankcal.survey.network.quality import precision

    removed = len({(removal.kind, removal.ids, removal.row) for removal in adjustment.removed})
    free = ~adjustment.fixed.all(axis=1)
    mean = ""
    if free.any():
        quality = precision(adjustment.xyz_m[free], adjustment.covariance_m2[free])
        sd = format_significant(1000 * quality.mean_sd_m, 3, marks())
        mean = message("mean_sd", ", mean standard deviation {sd} mm", sd=sd)
    return message(
        "adjusted",
        "adjustment: {fit}, {set_aside}, {points}{mean}",
        fit=_describe_fit(adjustment),
        set_aside=_count_rejected(removed),
        points=_count_points(len(adjustment.names)),
        mean=mean,
    )


def _describe_fit(adjustment):
    if adjustment.redundancy <= 0:
        return message(
            "not_tested",
            "redundancy {dof}, no observation is redundant, not tested",
            dof=adjustment.redundancy,
        )
    test = message("test_is_passed", "global test passed")
    if not adjustment.adjusted.test().passed:
        test = message("test_is_failed", "global test FAILED")
    return message(
        "fit",
        "sigma0 = {sigma0:.3f}, redundancy {dof}, {test}",
        sigma0=adjustment.sigma0,
        dof=adjustment.redundancy,
        test=test,
    )


def _count_rejected(count):
    if count == 0:
        return message("none_set_aside", "no observations rejected")
    if count == 1:
        return message("one_set_aside", "1 observation rejected")
    return message("some_set_aside", "{count} observations rejected", count=count)


def _count_points(count):
    if count == 1:
        return message("one_point", "1 point")
    return message("some_points", "{count} points", count=count)


def describe_rejected(result, adjustment):
    """Yield a line (Message) with the first names for each kind of rejected observations.

    Parameters
    ----------
    result : Result or None
        None: only the survey was adjusted.
    adjustment : NetworkAdjustment or None
    """
    kinds = []
    if result is not None:
        kinds = [
            (message("set_aside_points", "points rejected"), _rejected_points(result)),
            (message("set_aside_straps", "circumferences rejected"), _rejected_straps(result)),
            (message("set_aside_offsets", "offsets rejected"), _rejected_offsets(result)),
        ]
    readings = message("set_aside_readings", "readings rejected")
    for kind, all_names in (*kinds, (readings, _rejected_readings(adjustment))):
        names = list(dict.fromkeys(all_names))
        if len(names) > MOST_NAMES:
            yield message(
                "set_aside_and_more",
                "  {what}: {names} and {more} more (see the working papers)",
                what=kind,
                names=names[:MOST_NAMES],
                more=len(names) - MOST_NAMES,
            )
        elif names:
            yield message("set_aside_named", "  {what}: {names}", what=kind, names=names)


def _rejected_points(result):
    """Yield the names of the rejected points of the wall."""
    if result.accepted is not None:
        kept = {int(i) for i in result.accepted}
        yield from (name for i, name in enumerate(result.job.points.names) if i not in kept)


def _rejected_straps(result):
    """Yield the names and rows of the rejected circumferences."""
    straps = result.straps
    for i in () if straps is None else straps.adjusted[~straps.accepted]:
        strap = straps.reduced[i].strap
        yield message("named_in_row", "{name} (row {row})", name=strap.name, row=str(strap.row))


def _rejected_offsets(result):
    """Yield the lines, levels and rows of the rejected offsets."""
    read, lines = result.read, result.job.lines
    if read is None or lines is None:
        return
    for i in read.places[read.are("offsets")][~read.tests_of("offsets")[2]]:
        offset = lines.offsets[i]
        yield message(
            "named_at_level",
            "line {line} at {level_m:g} m (row {row})",
            line=offset.line,
            level_m=offset.level_m,
            row=str(offset.row),
        )


def _rejected_readings(adjustment):
    """Yield the ends, file and row of the rejected readings, largest test statistic first."""
    removed = () if adjustment is None else adjustment.removed
    for reading in sorted(removed, key=lambda reading: -abs(reading.w)):
        yield message(
            "named_in_file",
            "{ends} ({file}, row {row})",
            ends="-".join(map(str, reading.ids)),
            file=reading.file,
            row="-" if reading.row is None else str(reading.row),
        )
