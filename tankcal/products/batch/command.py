"""`tankcal batch`: computation of many jobs, by dask workers or one after the other."""

import shlex
from pathlib import Path

from tankcal.errors import TankcalError, problem_from
from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    add_letterhead,
    complain,
    language_of_run,
    parse_worker_memory,
    parse_workers,
    print_json,
    print_paths,
    say,
    signal_status,
    speak,
)

GIGABYTE = 1 << 30


def add(commands):
    """Add the parser of `tankcal batch`."""
    batch = commands.add_parser(
        "batch",
        help="compute many jobs, on all cores or a cluster",
        description="Carry out the chosen steps (run, report, compare, inspect, export, or upkeep "
        "alone) for each of many jobs. The results of each job are in its folder under DIR/jobs; "
        "summary.html, summary.xlsx, summary.csv and summary.json summarise all jobs. The same "
        "command again computes new and changed jobs only, and continues a batch that was "
        "interrupted. See docs/batch.md.",
        epilog="exit status: 0 all jobs done; 2 some jobs were refused or failed (one line each), "
        "or the batch could not start; 3 all other jobs are done, but some surveys have no "
        "valid solution; 130 stopped by Ctrl-C: the same command continues the batch.",
    )
    batch.add_argument(
        "names",
        metavar="JOBS",
        nargs="+",
        help="job folders, workbooks, folders that contain these, patterns such as 'site/*', or a "
        "list: @jobs.txt (one job per line) or jobs.csv (columns job, name, former, "
        "compare_by, inspect_by, profile, language); without the step run also folders of "
        "results",
    )
    batch.add_argument(
        "--out", metavar="DIR", required=True, help="the folder of the batch; created if missing"
    )
    batch.add_argument(
        "--do",
        metavar="STEPS",
        default="run",
        help="run, report, compare, inspect, export or several of these, separated by commas, "
        "or upkeep (default: run)",
    )
    who = batch.add_mutually_exclusive_group()
    who.add_argument(
        "--workers",
        metavar="N",
        type=parse_workers,
        help="number of workers on this machine (default: one per core; 0: no workers, one job "
        "after the other)",
    )
    who.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="address of a dask scheduler, such as tcp://192.168.1.20:8786",
    )
    batch.add_argument(
        "--worker-memory",
        metavar="GB",
        type=parse_worker_memory,
        default=2.0,
        help="memory limit of each worker on this machine, in gigabytes (default: 2); a worker "
        "that exceeds it is ended, and its job is tried again",
    )
    batch.add_argument(
        "--former",
        metavar="PATH",
        help="for compare: a former table, or a folder with one former table per job, named after "
        "the jobs",
    )
    batch.add_argument(
        "--compare-by", metavar="RULE", help="for compare: the name of a rule, or a .toml file"
    )
    batch.add_argument(
        "--inspect-by", metavar="RULE", help="for inspect: the name of a rule, or a .toml file"
    )
    batch.add_argument(
        "--profile",
        metavar="NAME",
        help="for export: a profile that tankcal export --list shows, or a .toml file",
    )
    of_papers = batch.add_mutually_exclusive_group()
    add_letterhead(of_papers)
    of_papers.add_argument(
        "--no-papers",
        action="store_true",
        help="for run: write the record and the CSV files only; for upkeep: upkeep.json only",
    )
    add_language(batch)
    batch.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(batch)
    batch.set_defaults(command=_batch)


def _batch(options):
    speak(options.language)
    from tankcal.products.batch.outcomes import Options, parse_steps
    from tankcal.products.batch.running import run_batch

    batch_options = Options(
        steps=parse_steps(options.do),
        papers=not options.no_papers,
        **{
            name: getattr(options, name)
            for name in ("language", "letterhead", "former", "compare_by", "inspect_by", "profile")
        },
    )
    progress = _BatchProgress(options.quiet or options.machine, options.machine)
    workers = options.cluster or (options.workers if options.workers is not None else "local")
    try:
        batch = run_batch(
            options.names, batch_options.absolute(), options.out, workers=workers,
            worker_bytes=int(options.worker_memory * GIGABYTE), language=language_of_run(),
            callbacks=progress,
        )  # fmt: skip
    except KeyboardInterrupt as stop:
        progress.show.end()
        complain(
            message(
                "batch_stopped",
                "stopped; finished jobs are kept; continue with: {command}",
                command=shlex.join(["tankcal", *options.arguments]),
            )
        )
        return signal_status(stop)
    except TankcalError:
        progress.show.end()
        raise
    progress.show.end()
    if options.machine:
        print_json(
            exit_status=batch.exit_status, out=options.out, jobs=batch.total,
            settled_before=batch.skipped, counts=dict(sorted(batch.counts.items())),
            files=list(map(str, batch.files)), rows=batch.rows,
        )  # fmt: skip
    else:
        _tell(batch, options.out)
    return batch.exit_status


class _BatchProgress:
    """Progress of a batch, with one line for each job that is not done."""

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
    """Print the result of a batch."""
    counts = batch.counts
    say(
        message(
            "batch_done",
            "{total} jobs: {done} done, {unsound} without a valid solution, {refused} refused, "
            "{failed} failed; {skipped} unchanged since the last batch",
            total=batch.total,
            skipped=batch.skipped,
            **{status: counts[status] for status in ("done", "unsound", "refused", "failed")},
        )
    )
    print_paths(Path(out), [path.name for path in batch.files])
