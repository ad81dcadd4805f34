"""What `--json` prints: one JSON object on standard output, for programs that call tankcal."""

import json
import sys

from tankcal.errors import InputError, problem_of


def add_json(parser):
    """The option `--json` of a command."""
    parser.add_argument(
        "--json",
        dest="machine",
        action="store_true",
        help="print one JSON object instead of lines of text, when it fails too; implies --quiet",
    )


def print_json(**values):
    """Print one object; numbers that do not exist are null."""
    json.dump(values, sys.stdout, ensure_ascii=False, allow_nan=False, indent=1)
    print()


def failure(error):
    """What is printed of a `TankcalError`: its problems, and the exit status that follows."""
    problems = error.problems if isinstance(error, InputError) else ()
    return {
        "exit_status": error.exit_status,
        "problems": [problem_of(one) for one in problems],
        "error": None if problems else str(error),
    }
