"""Output of `--json`: one JSON object on standard output, for other programs."""

import codecs
import json
import sys
from pathlib import Path

from tankcal.cli.showing import print_paths
from tankcal.errors import InputError, problem_of


def add_json(parser):
    """Add the option `--json` to a command."""
    parser.add_argument(
        "--json",
        dest="machine",
        action="store_true",
        help="print one JSON object in place of lines of text, also for errors; implies --quiet",
    )


def print_json(**values):
    """Print one object, in ASCII if the output is not UTF-8; missing numbers are null."""
    in_ascii = codecs.lookup(sys.stdout.encoding or "ascii").name != "utf-8"
    json.dump(values, sys.stdout, ensure_ascii=in_ascii, allow_nan=False, indent=1)
    print()


def print_saved(options, results, tell, written):
    """Print the results of a command, by tell(results) in lines of text, and its written files.

    Parameters
    ----------
    options : Namespace
    results : dict
        With `--json`, one object with these values is printed.
    tell : callable
    written : sequence of Path
        Paths below options.out.
    """
    if options.machine:
        print_json(exit_status=0, **results)
        return
    tell(results)
    if written:
        print_paths(Path(options.out), [path.name for path in written])


def failure(error):
    """Return the output for a `TankcalError`: its problems and the exit status."""
    problems = error.problems if isinstance(error, InputError) else ()
    return {
        "exit_status": error.exit_status,
        "problems": [problem_of(problem) for problem in problems],
        "error": None if problems else str(error),
    }
