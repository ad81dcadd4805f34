"""Tools of all commands: output in the language of the job, types of arguments, early end.

Output consists of progress, remaining time, warnings and lists of files. With `--json` a command
prints one JSON object on standard output, for other programs. A command ends early by Ctrl-C,
SIGTERM, a closed terminal, or lack of memory.
"""

import argparse
import atexit
import codecs
import gc
import json
import math
import os
import shutil
import signal
import sys
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path

from tankcal.errors import InputError, problem_of
from tankcal.messages import Message, message, printable, printable_lines
from tankcal.text.naming import NUMBER, WHOLE_NUMBER
from tankcal.text.shipped import DEFAULT, LANGUAGES, nearest_language


def read_job_language(path):
    """Return the language of a job for `load`, or None if it cannot be read.

    No problem is reported here; `load` reports the problems of the job.
    """
    from tankcal.job.tables import SETTINGS_FILE, WORKBOOK_FILE, Log

    path, log = Path(path), Log()
    try:
        if (path / WORKBOOK_FILE).is_file() and not (path / SETTINGS_FILE).is_file():
            path /= WORKBOOK_FILE
        if path.suffix.lower() == ".xlsx":
            code = _read_workbook(path, log)
        else:
            code = _read_settings(path / SETTINGS_FILE if path.is_dir() else path, log)
    except (OSError, ValueError):
        return None
    return nearest_language(code)


def read_plan_language(path):
    """Return the language of a plan for `load_plan`, or None."""
    from tankcal.job.tables import Log
    from tankcal.planning.contract import PLAN_FILE

    path = Path(path)
    try:
        return nearest_language(_read_settings(path / PLAN_FILE if path.is_dir() else path, Log()))
    except (OSError, ValueError):
        return None


def read_record_language(path):
    """Return the language of the job of a record, or of the record in a folder of results."""
    from tankcal.record.versions import RECORD
    from tankcal.text.delimited import read_json

    path = Path(path)
    try:
        record = read_json(path / RECORD.file if path.is_dir() else path)
        return nearest_language(record["job"]["table"]["language"])
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None


def _read_settings(path, log):
    """Return the language in job.toml or plan.toml."""
    from tankcal.job.folder import MAX_SETTINGS_BYTES, parsed_toml
    from tankcal.job.tables import read_bytes

    data = read_bytes(path, log, MAX_SETTINGS_BYTES)
    parsed = None if data is None else parsed_toml(path.name, data, log)
    section = {} if parsed is None else parsed[0].get("table")
    return section.get("language") if isinstance(section, dict) else None


def _read_workbook(path, log):
    """Return the language in a job workbook."""
    from tankcal.job.excel import MAX_FILE_BYTES, Unreadable, read_sheets
    from tankcal.job.sheets import KEY, SECTION, VALUE, table_rows
    from tankcal.job.tables import SETTINGS_SHEET, read_bytes

    data = read_bytes(path, log, MAX_FILE_BYTES)
    if data is None:
        return None
    try:
        sheets = read_sheets(data, lambda title: title.strip().lower() == SETTINGS_SHEET)
    except Unreadable:
        return None
    for sheet in sheets:
        rows, _ = table_rows(sheet.title, sheet.grid, log)
        headings = rows[0][1] if rows else []
        if {SECTION, KEY, VALUE} <= {heading for heading in headings if isinstance(heading, str)}:
            place = [headings.index(heading) for heading in (SECTION, KEY, VALUE)]
            for _, cells in rows[1:]:
                section, key, value = (cells[position] for position in place)
                if (section, key) == ("table", "language"):
                    return value if nearest_language(value) else _language_of_form(cells)
    return None


def _language_of_form(cells):
    """Return the language of the explanations of a form."""
    from tankcal.text.words import load_words

    for language in LANGUAGES:
        notes = load_words(language)["input"].get("notes", {})
        if language != DEFAULT and notes["keys"]["table.language"] in cells:
            return language
    return None


LEAST_S = 2.0  # time before the remaining time is estimated, s
MILLION = 1_000_000  # from here on counts are shown in millions


def describe_progress(done, total, fresh, seconds):
    """Return the progress and the remaining time of a long step; for millions also the rate.

    Parameters
    ----------
    done, total : int
    fresh : int
        The part of `done` that was completed within `seconds`.
    seconds : float
    """
    left = ""
    if seconds >= LEAST_S and fresh > 0 and done < total:
        rest = (total - done) * seconds / fresh
        if rest < 100:
            left = message("part_seconds_left", ", about {count:.0f} s left", count=rest)
        else:
            left = message("part_minutes_left", ", about {count:.0f} min left", count=rest / 60)
    if total < MILLION:
        return message("part_done", "{done}/{total}{left}", done=done, total=total, left=left)
    return message(
        "part_millions_done",
        "{done:.1f}/{total:.1f} million, {rate:.1f} million/s{left}",
        done=done / MILLION,
        total=total / MILLION,
        rate=fresh / MILLION / max(seconds, 1e-3),
        left=left,
    )


RECORD = "record.json"
# Allocations between garbage collections; many, because objects of modules are permanent
OBJECTS_AT_ONCE = 10_000
LEAST_MEMORY_B = 512 << 20  # address space; below about 450 MB OpenBLAS may hang while it loads
_LOCALE = ("LC_ALL", "LC_MESSAGES", "LANG")  # in order of priority
TO_THE_END = "\x1b[K"  # control sequence: clear the rest of the line
_spoken = {}  # words of the current language; empty: the English of the messages


def speak(language=None):
    """Set the language of the output; None: language of the environment."""
    _spoken.clear()
    if language is None:
        setting = next((os.environ[name] for name in _LOCALE if os.environ.get(name)), "")
        language = nearest_language(setting) or DEFAULT
    if language != DEFAULT:
        from tankcal.text.words import load_words

        _spoken.update(load_words(language))


def words_of_run():
    """Return the words of the current language; {}: English."""
    return _spoken


def speak_of_record(language, *sources):
    """Set the language; None: language of the first source that is or contains a record."""
    from tankcal.record import load

    speak(language)
    for path in () if language is not None else map(Path, sources):
        record = path / RECORD if path.is_dir() else path
        if record.suffix.lower() == ".json" and record.is_file():
            with suppress(InputError, AttributeError, KeyError, TypeError):
                asked = nearest_language(load(record)["job"]["table"]["language"])
                if asked is not None:
                    return speak(asked)
    return None


def language_of_run():
    """Return the code of the current language."""
    return _spoken["language"]["code"] if _spoken else DEFAULT


def say_in_language(text):
    """Return a text in the current language; a text without a code is unchanged."""
    if not (_spoken and isinstance(text, Message)):
        return printable_lines(text)
    from tankcal.text.words import say as said_in

    return said_in(_spoken, text)


def marks():
    """Return the number marks of the current language (digits.Marks)."""
    from tankcal.text.digits import PROGRAM, Marks

    return Marks(**_spoken["language"]["marks"]) if _spoken else PROGRAM


def say(text):
    """Print a line on standard output."""
    print(say_in_language(text))


def complain(text):
    """Print lines on standard error."""
    for line in say_in_language(text).splitlines():
        print(f"tankcal: {line}", file=sys.stderr)


def read_job(source, show, **options):
    """Return the checked Job of a folder or workbook; set its language."""
    language = read_job_language(source)
    if language is not None:
        speak(language)
    show.step(message("reading_job", "reading {file}", file=str(source)))
    from tankcal.job import load  # takes half a second: print the line above first

    return load(source, **options)


def prepare_for_small_work():
    """Limit BLAS to one thread and collect garbage less often; both are faster for a command.

    Raises
    ------
    MemoryError
        If the limit of address space is below `LEAST_MEMORY_B`.
    """
    with suppress(ImportError):  # Windows has neither the module nor this limit
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY and limit < LEAST_MEMORY_B:
            raise MemoryError
    # Effective only before numpy is imported; waiting threads of BLAS cost processor time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(OBJECTS_AT_ONCE)
    # The interpreter collects garbage as it ends: a tenth of a run, for memory that ends with it.
    atexit.register(gc.freeze)


def warn(warnings):
    """Print warnings on standard error."""
    for warning in warnings:
        text = getattr(warning, "text", warning)
        complain(message("warning", "warning: {text}", text=text))


def print_doubts(warnings):
    """Print implausible inputs on standard error, below a separate heading."""
    if warnings:
        complain(
            message(
                "doubtful_input",
                "DOUBTFUL INPUT: the results depend on it; see also the first page of the "
                "certificate:",
            )
        )
    warn(warnings)


def print_paths(out, paths):
    """Print the written files."""
    say(message("results_in", "results in {folder}:", folder=str(out)))
    for path in paths:
        print(f"  {printable(path)}")


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


class Progress:
    """Progress on standard error: one line per step, updated on a terminal."""

    def __init__(self, quiet):
        self.quiet = quiet
        self.live = sys.stderr.isatty()
        self.now, self.began = None, (0.0, 0)
        self._line = ""

    def step(self, text):
        """Begin a step."""
        self.part(text, 0, 0)

    def part(self, text, done, total):
        """Show the progress of a step: `done` of `total` parts."""
        if self.quiet:
            return
        line = f"tankcal: {say_in_language(text)}"
        if text != self.now:
            self.end()
            print(line, end="" if self.live else "\n", file=sys.stderr, flush=True)
            self._line, self.began = line, (time.monotonic(), done)
        if self.live and total:
            began, first = self.began
            so_far = say_in_language(
                describe_progress(done, total, done - first, time.monotonic() - began)
            )
            width = shutil.get_terminal_size().columns - 1
            if self._line and len(self._line) + 1 + len(so_far) > width:
                print(file=sys.stderr)  # a wrapped line cannot be overwritten
                self._line = ""
            shown = f"{self._line} {so_far}".lstrip()[:width]
            print(f"\r{shown}{TO_THE_END}", end="", file=sys.stderr, flush=True)
        self.now = text

    def aside(self, text):
        """Print a line on standard error above the line of the current step."""
        if self.live and self.now and not self.quiet:
            print(f"\r{TO_THE_END}", end="", file=sys.stderr)
        complain(text)

    def end(self):
        """End the line of the current step."""
        if self.live and self.now and not self.quiet:
            print(file=sys.stderr)
        self.now = None


MOST_WORKERS = 256  # on one machine
LEAST_WORKER_GB = 0.5


def add_language(parser):
    """Add the option --language of a command without a job."""
    parser.add_argument(
        "--language",
        metavar="CODE",
        choices=LANGUAGES,
        help=f"language of all output: {', '.join(LANGUAGES)} (default: language of the input, "
        "else of the environment)",
    )


def add_letterhead(parser):
    """Add the option --letterhead."""
    parser.add_argument(
        "--letterhead",
        metavar="FILE",
        help="TOML file with name, address, logo and colours of the laboratory (docs/report.md)",
    )


def read_letterhead(options):
    """Return the checked letterhead of the options, or None."""
    if options.letterhead is None:
        return None
    from tankcal.report.laboratory import load

    return load(options.letterhead)


def parse_number(text):
    """Return a finite number."""
    value = _number(text)
    if not math.isfinite(value):
        raise refuse_argument(
            message("option_number", "found {text!r}; expected a number", text=text)
        )
    return value


def parse_positive(text):
    """Return a positive number."""
    value = _number(text)
    if not 0 < value < float("inf"):
        raise refuse_argument(
            message("option_above_0", "found {text!r}; expected a number above 0", text=text)
        )
    return value


def parse_yield(text):
    """Return a yield strength in megapascals, at most MOST_YIELD_MPA."""
    from tankcal.job.plausibility import MOST_YIELD_MPA

    value = parse_positive(text)
    if value > MOST_YIELD_MPA:
        raise refuse_argument(
            message(
                "option_yield",
                "found {text!r}; expected at most {most} MPa (is it in another unit?)",
                text=text,
                most=MOST_YIELD_MPA,
            )
        )
    return value


def parse_share(text):
    """Return a number between 0 and 1."""
    value = _number(text)
    if not 0 < value < 1:
        raise refuse_argument(
            message("option_share", "found {text!r}; expected a number between 0 and 1", text=text)
        )
    return value


def parse_several(text):
    """Return a whole number from 2 to 1000000."""
    value = _number(text)
    if not (2 <= value <= 1e6 and value == int(value)):
        raise refuse_argument(
            message(
                "option_several",
                "found {text!r}; expected a whole number from 2 to 1000000",
                text=text,
            )
        )
    return int(value)


def parse_count(text):
    """Return a whole number."""
    if not WHOLE_NUMBER.fullmatch(text):
        raise refuse_argument(
            message("option_whole", "found {text!r}; expected a whole number", text=text)
        )
    return int(text)


def parse_workers(text):
    """Return a number of workers on this machine."""
    workers = parse_count(text)
    if workers > MOST_WORKERS:
        raise refuse_argument(
            message(
                "option_workers",
                "found {text!r}; expected at most {most} workers on one machine",
                text=text,
                most=MOST_WORKERS,
            )
        )
    return workers


def parse_worker_memory(text):
    """Return the memory of a worker in gigabytes."""
    value = parse_positive(text)
    if value < LEAST_WORKER_GB:
        raise refuse_argument(
            message(
                "option_worker_memory",
                "found {text!r}; expected at least {least} gigabytes; jobs with reports need 1",
                text=text,
                least=LEAST_WORKER_GB,
            )
        )
    return value


def parse_cluster(text):
    """Return the workers for clouds: "auto", "local", a number, or the address of a scheduler."""
    if WHOLE_NUMBER.fullmatch(text):
        return parse_workers(text)
    if text not in ("auto", "local") and ":" not in text:
        raise refuse_argument(
            message(
                "option_cluster",
                "found {text!r}; expected auto, local, a number of workers, or an address such as "
                "tcp://192.168.1.20:8786",
                text=text,
            )
        )
    return text


def parse_dips(text):
    """Return dips in metres, separated by commas, not negative."""
    values = [_number(part) for part in text.split(",")]
    if not all(0 <= value < float("inf") for value in values):
        raise refuse_argument(
            message(
                "option_dips",
                "found {text!r}; expected dips in metres such as 2.5,5,7.5",
                text=text,
            )
        )
    return values


def refuse_argument(text):
    """Return the error of an argument in the current language."""
    return argparse.ArgumentTypeError(say_in_language(text))


def _number(text):
    """Return a number; nan for forms that tables refuse, such as 1_000 or full-width digits."""
    return float(text) if NUMBER.fullmatch(text) else float("nan")


_OF_MEMORY = ("failed to map segment", "cannot allocate memory", "can't start new thread")
ENDING = ("SIGTERM", "SIGHUP")  # beside SIGINT, which Python turns into KeyboardInterrupt


class EndingSignal(KeyboardInterrupt):
    """A signal ended the command; unfinished work is undone, as after Ctrl-C.

    number  number of the signal
    """

    def __init__(self, number):
        super().__init__()
        self.number = number


@contextmanager
def raise_at_signals():
    """Raise `EndingSignal` in the block for a signal of ENDING; ignored signals remain ignored."""
    handled = []
    if threading.current_thread() is threading.main_thread():
        numbers = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
        handled = [number for number in numbers if signal.getsignal(number) == signal.SIG_DFL]
    for number in handled:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number in handled:
            signal.signal(number, signal.SIG_DFL)


def _end(number, _):
    raise EndingSignal(number)


def signal_status(error):
    """Return the exit status of a command ended by a signal (128 + signal), or None.

    Also if a library raised another error while handling the signal.
    """
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return None if error is None else 128 + getattr(error, "number", signal.SIGINT)


def is_out_of_memory(error):
    """Return whether a command failed for lack of memory.

    Python raises other errors for libraries that cannot be loaded and threads that cannot start.
    """
    if isinstance(error, ImportError | RuntimeError | OSError):
        return any(text in str(error).lower() for text in _OF_MEMORY)
    return isinstance(error, MemoryError)
