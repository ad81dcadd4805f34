"""What the terminal shows, in the language of the job: progress, warnings, lists of files."""

import gc
import os
import shutil
import sys
import time
from contextlib import suppress
from pathlib import Path

from tankcal.errors import InputError
from tankcal.messages import Message, message, printable, printable_lines
from tankcal.text.languages import DEFAULT, nearest_language
from tankcal.text.time_left import how_far

RECORD = "record.json"
OBJECTS_AT_ONCE = 10_000  # are made before the garbage collector looks: those of modules stay
_LOCALE = ("LC_ALL", "LC_MESSAGES", "LANG")  # the first that is set counts
TO_THE_END = "\x1b[K"  # a terminal clears the rest of the line
_spoken = {}  # the words of the language that is spoken; nothing: English as it was made


def speak(language=None):
    """From now on say what is said in this language; None: in that of the environment."""
    _spoken.clear()
    if language is None:
        setting = next((os.environ[name] for name in _LOCALE if os.environ.get(name)), "")
        language = nearest_language(setting) or DEFAULT
    if language != DEFAULT:
        from tankcal.text.word_files import load_words

        _spoken.update(load_words(language))


def words_of_run():
    """The words of the language that is spoken; {}: English."""
    return _spoken


def speak_of_record(language, *sources):
    """Speak a language; None: that of the first source that is a record, or holds one."""
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
    """The code of the language that is spoken."""
    return _spoken["language"]["code"] if _spoken else DEFAULT


def say_in_language(text):
    """A text in the language that is spoken; one without a code is as it is."""
    if not (_spoken and isinstance(text, Message)):
        return printable_lines(text)
    from tankcal.text.words import say as said_in

    return said_in(_spoken, text)


def marks():
    """What stands between the digits of numbers in that language (digits.Marks)."""
    from tankcal.text.digits import PROGRAM, Marks

    return Marks(**_spoken["language"]["marks"]) if _spoken else PROGRAM


def say(text):
    """Print a line of the terminal."""
    print(say_in_language(text))


def complain(text):
    """Lines on standard error."""
    for line in say_in_language(text).splitlines():
        print(f"tankcal: {line}", file=sys.stderr)


def read_job(source, show, **options):
    """The checked Job of a folder or workbook; from now on its language is spoken."""
    from tankcal.cli.asked_language import asked_language

    language = asked_language(source)
    if language is not None:
        speak(language)
    show.step(message("reading_job", "reading {file}", file=str(source)))
    from tankcal.job import load  # half a second: the line above is told before

    return load(source, **options)


def prepare_for_small_work():
    """A second BLAS thread costs time with small matrices, and looking for garbage often, too."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(OBJECTS_AT_ONCE)


def warn(warnings):
    """Warnings on standard error."""
    for warning in warnings:
        text = getattr(warning, "text", warning)
        complain(message("warning", "warning: {text}", text=text))


def print_doubts(warnings):
    """What is implausible of the numbers handed in, on standard error, under a line of its own."""
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
    """Print what was written."""
    say(message("results_in", "results in {folder}:", folder=str(out)))
    for path in paths:
        print(f"  {printable(path)}")


class Progress:
    """One line on standard error a step; a long step counts on in its own line on a terminal."""

    def __init__(self, quiet):
        self.quiet = quiet
        self.live = sys.stderr.isatty()
        self.now, self.began = None, (0.0, 0)
        self._line = ""

    def step(self, text):
        self.part(text, 0, 0)

    def part(self, text, done, total):
        if self.quiet:
            return
        line = f"tankcal: {say_in_language(text)}"
        if text != self.now:
            self.end()
            print(line, end="" if self.live else "\n", file=sys.stderr, flush=True)
            self._line, self.began = line, (time.monotonic(), done)
        if self.live and total:
            began, first = self.began
            so_far = say_in_language(how_far(done, total, done - first, time.monotonic() - began))
            width = shutil.get_terminal_size().columns - 1
            if self._line and len(self._line) + 1 + len(so_far) > width:
                print(file=sys.stderr)  # one that wraps could not be written over
                self._line = ""
            shown = f"{self._line} {so_far}".lstrip()[:width]
            print(f"\r{shown}{TO_THE_END}", end="", file=sys.stderr, flush=True)
        self.now = text

    def aside(self, text):
        """A line on standard error, above that of a step that goes on."""
        if self.live and self.now and not self.quiet:
            print(f"\r{TO_THE_END}", end="", file=sys.stderr)
        complain(text)

    def end(self):
        if self.live and self.now and not self.quiet:
            print(file=sys.stderr)
        self.now = None
