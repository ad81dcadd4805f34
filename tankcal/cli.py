"""The command line: arguments, progress, exit status. It computes nothing."""

import argparse
import os
import sys
from pathlib import Path

import tankcal
from tankcal.errors import TankcalError

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

exit status: 0 done; 2 the input must be mended (one line per problem: file, row, column, what was
expected; earlier results stay as they were); 3 the survey has no sound solution.

the job format: docs/job-format.md; axes, signs and units: docs/conventions.md"""


def main(arguments=None):
    """Run the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        options.command(options)
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
    return 0


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
        description="Write a starter job: job.toml, points.csv, courses.csv and uncertainty.csv "
        "with comments, and the same as one workbook, job.xlsx. Fill in one of the two.",
    )
    new.add_argument("directory", metavar="DIR", help="a folder to make")
    new.set_defaults(command=_new)

    demo = commands.add_parser(
        "demo",
        help="run the shipped example",
        description="Compute the shipped example, a reconstruction of the tank of Silva 1995.",
    )
    demo.add_argument("--out", metavar="DIR", help="where to write", default="tankcal-demo-results")
    demo.add_argument("--quiet", action="store_true", help="no progress, only problems")
    demo.set_defaults(command=_demo)
    return parser


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
    rejected = len(job.points.names) - len(result.wall)
    top = result.at(result.table.height_m[-1])
    print(
        f"{job.tank.id}: {top.value_m3:.3f} m3 at {result.table.height_m[-1]:.3f} m, "
        f"U = {top.U_m3:.3f} m3 (k = {top.k:.2f}), "
        f"{len(result.wall)} points of the wall, {rejected} rejected"
    )
    print(f"results in {out}:")
    for path in paths:
        print(f"  {path}")


def _new(options):
    from tankcal.starter import write_starter

    directory = Path(options.directory)
    write_starter(directory)
    print(f"wrote {directory}: fill in job.toml and the CSV files, or job.xlsx instead, then")
    print(f"  tankcal run {directory}     or     tankcal run {directory / 'job.xlsx'}")


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
