"""Command line: arguments, progress and exit status, without computation.

The English help is in the definitions of the arguments. Its translations are in the words of each
language under [help], by command and name of the argument.
"""

import argparse
import os
import sys
from contextlib import contextmanager
from importlib import import_module

import tankcal
from tankcal.errors import Problem, TankcalError, reason_of
from tankcal.messages import message, printable_lines
from tankcal.products.base import find_module, products, refusals
from tankcal.terminal import (
    complain,
    failure,
    is_out_of_memory,
    language_of_run,
    prepare_for_small_work,
    print_json,
    raise_at_signals,
    say,
    say_in_language,
    signal_status,
    speak,
    words_of_run,
)

DESCRIPTION = """\
tankcal calibrates storage tanks: from a survey of the wall to the capacity table with
its uncertainty, as Excel workbook, PDF certificate and notebook."""

EPILOG = """\
a new tank, step by step:
  tankcal new my-tank           create an empty job: the folder my-tank with job.toml, points.csv,
                                courses.csv
  tankcal new my-tank --workbook   or with one Excel workbook, job.xlsx
  (enter the measurements in the CSV files or in the workbook)
  tankcal run my-tank           compute the job; the results are in my-tank/results
  tankcal notebook my-tank      edit, check and compute the job in a notebook (JupyterLab)
  tankcal app                   the same in a browser, from the first tank to the certificate
  tankcal report my-tank/results --language es   write the reports again, in Spanish
  tankcal lint table.csv        check any capacity table for errors
  tankcal read-table old.csv --courses courses.csv   radii and head from a former table
  tankcal compare old.csv my-tank/results        has the tank changed since its former table?
  tankcal history archive --tank TK-1            its tables, radii and verdicts over the years
  tankcal verify my-tank/results                 do the files of a run agree?
  tankcal export my-tank/results --profile NAME   the table for a gauging system
  tankcal inspect my-tank                      plumb, roundness and settlement from the same survey
  tankcal batch site --out site-results        compute many jobs, on all cores

photographs, distances, angles and levels instead of surveyed points:
  tankcal new my-tank --survey photos          (or total-station) create such a job
  tankcal run my-tank --only adjustment        adjust the survey; no tank is required
  tankcal import book.gsi --out my-tank        read the field book of a total station
  tankcal plan my-plan                         predict the uncertainty of a survey

exit status: 0 done; 2 the input must be corrected (one line per problem: file, row, column,
expected value; earlier results remain unchanged); 3 the survey has no valid solution; 130 stopped
by Ctrl-C, 143 by SIGTERM, 129 by closing the terminal.

the job format: docs/job-format.md; axes, signs and units: docs/conventions.md"""


def main(arguments=None):
    """Run the command line and return the exit status."""
    _open_closed_streams()
    _print_in_any_encoding()
    speak()
    is_bare = arguments is None and len(sys.argv) == 1
    if is_bare and _has_display():
        arguments = ["app"]  # as started by a double click
    with _translate_argparse(words_of_run()):
        options = _options(arguments)
        options.arguments = sys.argv[1:] if arguments is None else list(arguments)
        if options.command is None:
            options.shown.print_help()
            if is_bare:
                say(
                    message(
                        "no_display",
                        "no display was found: 'tankcal app --no-browser' prints an address for a "
                        "browser of this machine",
                    )
                )
            return 0
    try:
        with raise_at_signals():
            prepare_for_small_work()
            return options.command(options) or 0
    except TankcalError as error:
        if getattr(options, "machine", False):
            print_json(**failure(error))
            return error.exit_status
        for text in error.texts:
            complain(text)
        return error.exit_status
    except BrokenPipeError:  # the reader of the output ended, such as `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except BaseException as error:
        return _find_status(error)


def _has_display():
    """Return whether this session can open a browser."""
    if sys.platform in ("win32", "darwin"):
        return not os.environ.get("SSH_CONNECTION")
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _find_status(error):
    """Return the exit status after a signal or a lack of memory or disk space; print one line.

    Any other error is raised again.
    """
    status = signal_status(error)
    if status is not None:
        complain(
            message("stopped", "stopped; earlier results are unchanged, or completely replaced")
        )
        return status
    if is_out_of_memory(error):
        complain(
            message(
                "out_of_memory",
                "not enough memory; earlier results are unchanged. Close other programs, raise "
                "the memory limit, or compute on a machine with more memory",
            )
        )
        return 2
    if isinstance(error, OSError):
        complain(Problem(str(error.filename or "system"), reason_of(error)).text)
        return 2
    raise error


def _open_closed_streams():
    """Replace standard streams that the caller closed (None) by the null device."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode, encoding="utf-8"))


def _print_in_any_encoding():
    """Escape characters that the terminal or file cannot encode: cp1252 on Windows, ASCII."""
    for stream in (sys.stdout, sys.stderr):
        # "surrogateescape" is the setting of Python in the locale C
        if getattr(stream, "errors", None) in ("strict", "surrogateescape"):
            stream.reconfigure(errors="backslashreplace")


def _options(arguments):
    """Return the parsed arguments; names after options are also names."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = _parser_of(arguments[0] if arguments else None)
    options, rest = parser.parse_known_args(arguments)
    if rest and (not hasattr(options, "names") or any(word.startswith("-") for word in rest)):
        parser.error(argparse._("unrecognized arguments: %s") % " ".join(rest))
    if rest:
        options.names = [*options.names, *rest]
    return options


def _parser_of(command):
    """Return the parser of a command of tankcal alone; of all commands for any other word."""
    module = find_module(command)
    if module is None:
        for name, reason in refusals().items():
            complain(
                message(
                    "product_rejected",
                    "the product {name} of another package is not available: {reason}",
                    name=name,
                    reason=reason,
                )
            )
        return _parser()
    parser, commands = _empty_parser()
    import_module(module).add(commands)
    if words_of_run():
        translate_parser(parser, words_of_run()["help"])
    return parser


class _Parser(argparse.ArgumentParser):
    """A parser that repeats no control character of its arguments."""

    def _print_message(self, message, file=None):
        super()._print_message(printable_lines(message), file)

    def _check_value(self, action, value):
        """Refuse an invalid choice; suggest a similar choice in place of the list."""
        spelt = None
        if action.choices and value not in action.choices:
            from tankcal.job.tables import meant, shown  # half a second

            spelt = meant(value, action.choices)
        if spelt is None:
            return super()._check_value(action, value)
        text = message("choice_meant", "found {found}; did you mean '{spelt}'?",
                       found=shown(value), spelt=spelt)  # fmt: skip
        raise argparse.ArgumentError(action, say_in_language(text))


class _Version(argparse.Action):
    """Print the version, which is determined only on request."""

    def __call__(self, parser, *_):
        print(f"tankcal {tankcal.__version__}")
        parser.exit()


def _parser():
    """Return the complete parser in the current language."""
    parser, translate = _parser_in_english()
    translate(parser)
    return parser


def _parser_in_english():
    """Return (the complete parser, a function that translates it to the current language)."""
    parser, commands = _empty_parser()
    modules = (module for product in products() for _, module in product.commands)
    for module in dict.fromkeys(modules):  # a module may have several commands
        import_module(module).add(commands)
    return parser, _translate


def _empty_parser():
    """Return (parser without commands, its subparsers), in English."""
    parser = _Parser(
        prog="tankcal",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, default=argparse.SUPPRESS,
                        help="show program's version number and exit")  # fmt: skip
    parser.set_defaults(command=None, shown=parser)
    return parser, parser.add_subparsers(metavar="COMMAND")


def _translate(parser):
    """Translate a parser to the current language; its commands may be of other distributions."""
    if not words_of_run():
        return
    known = dict(words_of_run()["help"])
    for product in products():
        texts = dict(product.help_words(language_of_run()))
        known["metavars"] = known["metavars"] | texts.pop("metavars", {})
        known |= texts
    translate_parser(parser, known)


def translate_parser(parser, known):
    """Replace the texts of a parser and of its commands by the texts of [help].

    A text without translation remains: a product of another distribution may have none.
    """
    texts = known.get(_name(parser), {})
    parser.description = texts.get("about", parser.description)
    parser.epilog = texts.get("ending", parser.epilog)
    for action in parser._actions:
        if isinstance(action.metavar, str):
            action.metavar = known["metavars"].get(action.metavar, action.metavar)
        elif isinstance(action.metavar, tuple):
            action.metavar = tuple(known["metavars"].get(name, name) for name in action.metavar)
        if isinstance(action, argparse._SubParsersAction):
            _put_in_list(action, known)
            for command_parser in action.choices.values():
                translate_parser(command_parser, known)
        elif action.help is not None and action.dest != "help":
            action.help = texts.get(action.dest) or known["shared"].get(action.dest, action.help)


@contextmanager
def _translate_argparse(words):
    """Translate the messages of argparse within the block; {}: English."""
    translations = words.get("help", {}).get("argparse", {})
    before = argparse._, argparse.ngettext

    def translate(text):
        return translations.get(text, text)

    def translate_plural(single, several, count):
        return translate(single if count == 1 else several)

    if translations:
        argparse._, argparse.ngettext = translate, translate_plural
    try:
        yield
    finally:
        argparse._, argparse.ngettext = before


def _put_in_list(action, known):
    """Replace the one-line help of each command in a list."""
    names = {name: _name(command_parser) for name, command_parser in action.choices.items()}
    for line in action._choices_actions:
        line.help = known.get(names[line.dest], {}).get("line", line.help)


def _name(parser):
    """Return the command of a parser: "tankcal", "run", "camera read"."""
    return parser.prog.removeprefix("tankcal ")
