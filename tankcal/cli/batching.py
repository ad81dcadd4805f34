"""`tankcal batch`: many jobs, by workers of dask or one after the other."""

import shlex
import sys
from pathlib import Path

from tankcal.cli.arguments import add_language, parse_worker_memory, parse_workers
from tankcal.cli.machine import add_json, print_json
from tankcal.cli.reporting import add_letterhead
from tankcal.cli.showing import (
    Progress,
    complain,
    language_of_run,
    prepare_for_small_work,
    print_paths,
    say,
    speak,
)
from tankcal.cli.stopping import stopped_status
from tankcal.errors import TankcalError, problem_from
from tankcal.messages import message

GIGABYTE = 1 << 30


def add(commands):
    """The parser of `tankcal batch`."""
    batch = commands.add_parser(
        "batch",
        help="compute many jobs, on all cores or a cluster",
        description="Do with each of many jobs what is asked (run, report, compare, inspect, "
        "export), each in a folder of its own under DIR/jobs, and write a summary of all: "
        "summary.html, summary.xlsx, summary.csv and summary.json. The same command again does "
        "only what is new or changed, and goes on where it was ended. docs/batch.md says how.",
        epilog="exit status: 0 all done; 2 some jobs were refused or failed (one line each), or "
        "nothing could be begun; 3 all others are done, but some have no sound solution; 130 "
        "stopped by Ctrl-C: the same command goes on.",
    )
    batch.add_argument(
        "names",
        metavar="JOBS",
        nargs="+",
        help="job folders, workbooks, folders of these, patterns such as 'site/*', or a list: "
        "@jobs.txt (one a line) or jobs.csv (columns job, name, former, compare_by, inspect_by, "
        "profile, language); without run: folders of results, too",
    )
    batch.add_argument(
        "--out", metavar="DIR", required=True, help="the folder of the batch, made when missing"
    )
    batch.add_argument(
        "--do",
        metavar="STEPS",
        default="run",
        help="run, report, compare, inspect, export, or some of these with commas between "
        "(default: run)",
    )
    who = batch.add_mutually_exclusive_group()
    who.add_argument(
        "--workers",
        metavar="N",
        type=parse_workers,
        help="workers on this machine (default: one for each core; 0: none, one job after the "
        "other)",
    )
    who.add_argument(
        "--cluster", metavar="ADDRESS", help="of a dask scheduler, such as tcp://192.168.1.20:8786"
    )
    batch.add_argument(
        "--worker-memory",
        metavar="GB",
        type=parse_worker_memory,
        default=2.0,
        help="memory that a worker on this machine may take, in gigabytes (default: 2); one that "
        "takes more is ended, and its job tried again",
    )
    batch.add_argument("--former", metavar="PATH", help="of compare: a former table, or a folder "
                       "of them called by the names of the jobs")  # fmt: skip
    batch.add_argument("--compare-by", metavar="RULE", help="of compare: a rule by its name, or a "
                       ".toml file")  # fmt: skip
    batch.add_argument("--inspect-by", metavar="RULE", help="of inspect: a rule by its name, or a "
                       ".toml file")  # fmt: skip
    batch.add_argument("--profile", metavar="NAME", help="of export: one of tankcal export --list, "
                       "or a .toml file")  # fmt: skip
    of_papers = batch.add_mutually_exclusive_group()
    add_letterhead(of_papers)
    of_papers.add_argument(
        "--no-papers", action="store_true", help="of run: write record and CSV files only"
    )
    add_language(batch)
    batch.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(batch)
    batch.set_defaults(command=_batch)


def _batch(options):
    prepare_for_small_work()
    speak(options.language)
    from tankcal.batch.asked import Asked, parse_steps
    from tankcal.batch.running import run_batch

    asked = Asked(
        do=parse_steps(options.do),
        papers=not options.no_papers,
        **{
            name: getattr(options, name)
            for name in ("language", "letterhead", "former", "compare_by", "inspect_by", "profile")
        },
    )
    told = _Told(options.quiet or options.machine, options.machine)
    workers = options.cluster or (options.workers if options.workers is not None else "local")
    try:
        batch = run_batch(
            options.names, asked.absolute(), options.out, workers=workers,
            worker_bytes=int(options.worker_memory * GIGABYTE), language=language_of_run(),
            telling=told,
        )  # fmt: skip
    except KeyboardInterrupt as stop:
        told.show.end()
        complain(message("batch_stopped", "stopped; what was done is kept, and this goes on: "
                         "{command}", command=_command()))  # fmt: skip
        return stopped_status(stop)
    except TankcalError:
        told.show.end()
        raise
    told.show.end()
    if options.machine:
        print_json(
            exit_status=batch.exit_status, out=options.out, jobs=batch.total,
            settled_before=batch.skipped, counts=dict(sorted(batch.counts.items())),
            files=list(map(str, batch.files)), rows=batch.rows,
        )  # fmt: skip
    else:
        _tell(batch, options.out)
    return batch.exit_status


class _Told:
    """Progress, and one line for each job that is not done."""

    def __init__(self, quiet, machine):
        self.show, self._machine = Progress(quiet), machine
        self.step, self.part = self.show.step, self.show.part

    def ended(self, name, status, problems, count):
        if self._machine:
            return
        text = problem_from(problems[0]).text if problems else status
        if count > 1:
            text = message(
                "batch_told_more", "{text}, and {count} more", text=text, count=count - 1
            )
        self.show.aside(message("batch_told", "{name}: {text}", name=name, text=text))


def _tell(batch, out):
    counts = batch.counts
    say(
        message(
            "batch_done",
            "{total} jobs: {done} done, {unsound} without sound solution, {refused} refused, "
            "{failed} failed; {skipped} were settled before",
            total=batch.total,
            skipped=batch.skipped,
            **{status: counts[status] for status in ("done", "unsound", "refused", "failed")},
        )
    )
    print_paths(Path(out), [path.name for path in batch.files])


def _command():
    """What was typed, to be typed again."""
    return " ".join(["tankcal", *map(shlex.quote, sys.argv[1:])])
