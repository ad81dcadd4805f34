"""The command line: arguments, progress, exit status. It computes nothing."""

import argparse
import os
import sys
from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem, SolutionError, TankcalError

DESCRIPTION = """\
tankcal calibrates storage tanks: from surveyed points of the wall to the capacity
table, with its uncertainty, as Excel workbook, PDF certificate and notebook."""

EPILOG = """\
a new tank, step by step:
  tankcal new my-tank           write an empty job: the folder my-tank with job.toml, points.csv,
                                courses.csv, and the same as one workbook, job.xlsx
  (fill in the blanks, in the CSV files or in the workbook)
  tankcal run my-tank           compute it; the results are in my-tank/results
  tankcal run my-tank/job.xlsx  the same, from the workbook
  tankcal lint table.csv        look for mistakes in any capacity table

photographs, distances, angles and levels instead of surveyed points:
  tankcal new my-tank --survey photos          (or total-station) write such a job
  tankcal run my-tank --only adjustment        adjust the survey; no tank is needed

exit status: 0 done; 2 the input must be mended (one line per problem: file, row, column, what was
expected; earlier results stay as they were); 3 the survey has no sound solution.

the job format: docs/job-format.md; axes, signs and units: docs/conventions.md"""

MOST_FINDINGS = 50  # that are shown at once


def main(arguments=None):
    """Run the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return options.command(options) or 0
    except TankcalError as error:
        for line in str(error).splitlines():
            print(f"tankcal: {line}", file=sys.stderr)
        return error.exit_status
    except BrokenPipeError:  # the reader of our output went away: nothing to say to nobody
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"tankcal: {error.filename or 'system'}: {error.strerror or error}", file=sys.stderr)
        return 2
    except BaseException as error:
        if not _interrupted(error):
            raise
        print("tankcal: stopped; nothing was written", file=sys.stderr)
        return 130


def _interrupted(error):
    """Whether Ctrl-C is behind an error, however a library dressed it."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def _parser():
    parser = argparse.ArgumentParser(
        prog="tankcal",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"tankcal {tankcal.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    _add_run(commands)
    new = commands.add_parser(
        "new",
        help="write an empty job to fill in",
        description="Write a starter job: job.toml and the CSV files of that kind of tank, with "
        "comments, and the same as one workbook, job.xlsx. Fill in one of the two.",
    )
    new.add_argument("directory", metavar="DIR", help="a folder to make")
    new.add_argument(
        "--kind",
        choices=("vertical", "horizontal", "sphere", "mesh"),
        default="vertical",
        help="kind of tank (default: vertical)",
    )
    new.add_argument(
        "--survey",
        choices=("photos", "total-station"),
        help="with files for photographs or total-station readings, in place of surveyed points",
    )
    new.set_defaults(command=_new)

    demo = commands.add_parser(
        "demo",
        help="run the shipped example",
        description="Compute the shipped example, a reconstruction of the tank of Silva 1995.",
    )
    demo.add_argument("--out", metavar="DIR", help="where to write", default="tankcal-demo-results")
    demo.add_argument("--quiet", action="store_true", help="no progress, only problems")
    demo.set_defaults(command=_demo)

    _add_lint(commands)
    return parser


def _add_run(commands):
    run = commands.add_parser(
        "run",
        help="compute a job and write its results",
        description="Read and check a job, compute it, and write the results, all or nothing: "
        "record.json, points.csv, sections.csv, capacity.csv, capacity.xlsx, report.ipynb, "
        "certificate.pdf, working-papers.pdf, report.pdf (both) and report.html. An adjusted "
        "survey adds points_cov.npz, photos.csv, cameras.csv, groups.csv and residuals.csv.",
        epilog="exit status: 0 done; 2 the input must be mended; 3 no sound solution, or, with "
        "--strict, the adjustment is in doubt. Then nothing is written.",
    )
    run.add_argument("job", metavar="JOB", help="a job folder, its job.toml, or a job workbook")
    run.add_argument(
        "--out",
        metavar="DIR",
        help="where to write (default: results in the job's folder, or NAME-results beside "
        "NAME.xlsx); earlier results there are replaced",
    )
    run.add_argument(
        "--only",
        choices=("adjustment",),
        help="stop after the adjustment of the survey; no tank is needed, and adjustment.xlsx "
        "takes the place of capacity.xlsx",
    )
    run.add_argument(
        "--strict",
        action="store_true",
        help="write nothing when the global test of the adjustment fails, or when what was set "
        "aside as a blunder may not be the one (exit status 3)",
    )
    run.add_argument("--quiet", action="store_true", help="no progress, only problems")
    run.set_defaults(command=_run)


def _add_lint(commands):
    lint = commands.add_parser(
        "lint",
        help="look for mistakes in a capacity table, of any origin",
        description="Look for mistakes in a capacity table: unreadable numbers, rows missing, "
        "doubled or swapped, wrong digits, shifted blocks, wrong units, a total or a last row "
        "that does not fit. One line a finding; docs/table.md says how they are found.",
        epilog="exit status: 0 no errors (there may be warnings); 2 errors found, or no table.",
    )
    lint.add_argument(
        "file", metavar="FILE", help="a CSV file, an Excel workbook (.xlsx), or a record.json"
    )
    lint.add_argument("--sheet", metavar="NAME", help="of a workbook (default: the longest table)")
    for name, unit, what in (
        ("volume", "M3", "volume the tank is meant to hold, m3"),
        ("diameter", "M", "inside diameter of an upright tank, m; with --nominal-height"),
        ("height", "M", "height that the last row is meant to have, m"),
    ):
        lint.add_argument(f"--nominal-{name}", metavar=unit, type=_positive, help=what)
    lint.set_defaults(command=_lint)


def _positive(text):
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a number above 0")
    return value


def _run(options):
    source = Path(options.job)
    out = Path(options.out) if options.out else _default_out(source)
    compute = _adjust if options.only == "adjustment" else _compute
    compute(source, out, options.quiet, options.strict)


def _default_out(source):
    if source.suffix.lower() == ".xlsx":
        return source.with_name(f"{source.stem}-results")
    return (source.parent if source.name == "job.toml" else source) / "results"


def _demo(options):
    from tankcal.shipped import shipped

    _compute(shipped("examples") / "silva-1995", Path(options.out), options.quiet)


def _prepare_for_small_work():
    """A second BLAS thread costs time with small matrices, a compiler with small surveys."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("TANKCAL_COMPILED", "patient")


def _compute(source, out, quiet, strict=False):
    _prepare_for_small_work()
    from tankcal import outputs

    show = _Progress(quiet)
    show.step(f"reading {source}")
    job = tankcal.load(source)
    outputs.refuse_foreign(out)
    result = tankcal.run(job, show.step)
    adjustment = result.adjustment
    if strict:
        _refuse_failed(adjustment)
    paths = outputs.write(result, out, show.part)
    show.end()
    _warn(result.warnings)
    if adjustment is not None:
        print(_summary(adjustment))
    top = result.at(result.table.height_m[-1])
    points = ""
    if result.accepted is not None:
        accepted = len(result.accepted)
        surveyed = len(result.job.points.names)
        points = f", {accepted} points of the wall, {surveyed - accepted} rejected"
    print(
        f"{job.tank.id}: {top.value_m3:.3f} m3 at {result.table.height_m[-1]:.3f} m, "
        f"U = {top.U_m3:.3f} m3 (k = {top.k:.2f}){points}"
    )
    _list(out, paths)


def _adjust(source, out, quiet, strict):
    _prepare_for_small_work()
    from tankcal import outputs

    show = _Progress(quiet)
    show.step(f"reading {source}")
    job = tankcal.load(source, only="adjustment")
    outputs.refuse_foreign(out)
    adjustment = tankcal.adjust_job(job, show.step)
    if strict:
        _refuse_failed(adjustment)
    paths = outputs.write_adjustment(job, adjustment, out, show.part)
    show.end()
    _warn(dict.fromkeys((*job.warnings, *adjustment.warnings)))
    print(_summary(adjustment))
    _list(out, paths)


def _refuse_failed(adjustment):
    """Raise when there is an adjustment that is in doubt, or whose global test failed."""
    if adjustment is not None and adjustment.doubts:
        raise SolutionError(
            "\n".join([*map(str, adjustment.doubts), "nothing was written (--strict)"])
        )
    if adjustment is None or adjustment.redundancy <= 0:
        return
    test = adjustment.adjusted.test()
    if not test.passed:
        raise SolutionError(
            f"the global test of the adjustment failed: v'Pv = {test.chi2:.1f}, expected "
            f"{test.low:.1f} to {test.high:.1f} ({test.dof} degrees of freedom, sigma0 = "
            f"{adjustment.sigma0:.3f}); nothing was written (--strict)"
        )


def _summary(adjustment):
    """One line: how well the survey fits, and how good its points are."""
    from tankcal.network.quality import precision

    test, sigma0 = "nothing redundant, not tested", ""
    if adjustment.redundancy > 0:
        passed = adjustment.adjusted.test().passed
        test = f"global test {'passed' if passed else 'FAILED'}"
        sigma0 = f"sigma0 = {adjustment.sigma0:.3f}, "
    removed = len({(one.kind, one.ids, one.row) for one in adjustment.removed})
    free = ~adjustment.fixed.all(axis=1)
    mean = ""
    if free.any():
        found = precision(adjustment.xyz_m[free], adjustment.covariance_m2[free])
        mean = f", mean sd {1000 * found.mean_sd_m:.3g} mm"
    return (
        f"adjustment: {sigma0}redundancy {adjustment.redundancy}, {test}, "
        f"{_counted(removed, 'observation')} set aside, "
        f"{_counted(len(adjustment.names), 'point')}{mean}"
    )


def _warn(warnings):
    for warning in warnings:
        print(f"tankcal: warning: {warning}", file=sys.stderr)


def _list(out, paths):
    print(f"results in {out}:")
    for path in paths:
        print(f"  {path}")


def _new(options):
    from tankcal.starter import write_starter

    directory = Path(options.directory)
    survey = {} if options.survey is None else {"survey": options.survey}
    write_starter(directory, options.kind, **survey)
    print(f"wrote {directory}: fill in job.toml and the CSV files, or job.xlsx instead, then")
    print(f"  tankcal run {directory}     or     tankcal run {directory / 'job.xlsx'}")


def _lint(options):
    _prepare_for_small_work()
    from tankcal.linter import Nominal, lint

    if options.nominal_diameter is not None and options.nominal_height is None:
        expected = "given without --nominal-height; expected both"
        raise InputError(Problem("--nominal-diameter", expected))
    nominal = Nominal(options.nominal_volume, options.nominal_diameter, options.nominal_height)
    report = lint(options.file, nominal, options.sheet)
    for finding in report.findings[:MOST_FINDINGS]:
        print(finding)
    more = len(report.findings) - MOST_FINDINGS
    if more > 0:
        print(f"and {more} more findings; mend these first")
    warnings = len(report.findings) - report.errors
    for summary in report.summaries:
        print(summary)
    print(f"{_counted(report.errors, 'error')}, {_counted(warnings, 'warning')}")
    return 2 if report.errors else 0


def _counted(count, thing):
    return f"{count or 'no'} {thing}{'' if count == 1 else 's'}"


class _Progress:
    """One line on standard error a step; a long step counts on in its own line on a terminal."""

    def __init__(self, quiet):
        self.quiet = quiet
        self.live = sys.stderr.isatty()
        self.now = None

    def step(self, text):
        self.part(text, 0, 0)

    def part(self, text, done, total):
        if self.quiet:
            return
        if text != self.now:
            self.end()
            print(f"tankcal: {text}", end="" if self.live else "\n", file=sys.stderr, flush=True)
        if self.live and total:
            print(f"\rtankcal: {text} {done}/{total}", end="", file=sys.stderr, flush=True)
        self.now = text

    def end(self):
        if self.live and self.now and not self.quiet:
            print(file=sys.stderr)
        self.now = None
