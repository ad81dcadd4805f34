"""The command line: arguments, progress, exit status. It computes nothing."""

import argparse
import os
import sys
from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem, TankcalError

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

    run = commands.add_parser(
        "run",
        help="compute a job and write its results",
        description="Read and check a job, compute it, and write the results, all or nothing: "
        "record.json, points.csv, sections.csv, capacity.csv, capacity.xlsx, report.ipynb, "
        "certificate.pdf, working-papers.pdf, report.pdf (both) and report.html.",
    )
    run.add_argument("job", metavar="JOB", help="a job folder, its job.toml, or a job workbook")
    run.add_argument(
        "--out",
        metavar="DIR",
        help="where to write (default: results in the job's folder, or NAME-results beside "
        "NAME.xlsx); earlier results there are replaced",
    )
    run.add_argument("--quiet", action="store_true", help="no progress, only problems")
    run.set_defaults(command=_run)

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
    _compute(source, Path(options.out) if options.out else _default_out(source), options.quiet)


def _default_out(source):
    if source.suffix.lower() == ".xlsx":
        return source.with_name(f"{source.stem}-results")
    return (source.parent if source.name == "job.toml" else source) / "results"


def _demo(options):
    from tankcal.shipped import shipped

    _compute(shipped("examples") / "silva-1995", Path(options.out), options.quiet)


def _compute(source, out, quiet):
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: a second thread costs time
    from tankcal import outputs

    show = _Progress(quiet)
    show.step(f"reading {source}")
    job = tankcal.load(source)
    outputs.refuse_foreign(out)
    result = tankcal.run(job, show.step)
    paths = outputs.write(result, out, show.part)
    show.end()
    for warning in result.warnings:
        print(f"tankcal: warning: {warning}", file=sys.stderr)
    top = result.at(result.table.height_m[-1])
    points = ""
    if result.accepted is not None:
        accepted = len(result.accepted)
        points = f", {accepted} points of the wall, {len(job.points.names) - accepted} rejected"
    print(
        f"{job.tank.id}: {top.value_m3:.3f} m3 at {result.table.height_m[-1]:.3f} m, "
        f"U = {top.U_m3:.3f} m3 (k = {top.k:.2f}){points}"
    )
    print(f"results in {out}:")
    for path in paths:
        print(f"  {path}")


def _new(options):
    from tankcal.starter import write_starter

    directory = Path(options.directory)
    write_starter(directory, options.kind)
    print(f"wrote {directory}: fill in job.toml and the CSV files, or job.xlsx instead, then")
    print(f"  tankcal run {directory}     or     tankcal run {directory / 'job.xlsx'}")


def _lint(options):
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
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
