"""`tankcal import`: conversion of instrument field books to the CSV files of a job."""

import datetime
import shlex
import sys
from dataclasses import replace
from pathlib import Path

from tankcal.errors import InputError, Problem, problem_of
from tankcal.job.tables import SETTINGS_FILE, WORKBOOK_FILE
from tankcal.messages import message, printable
from tankcal.terminal import (
    add_json,
    add_language,
    complain,
    parse_positive,
    print_json,
    refuse_argument,
    say,
    say_in_language,
    speak,
    warn,
)

LISTS = (".csv", ".txt", ".tsv")
NO = ("n", "no", "nao", "não")


def add(commands):
    """Add the parser of `tankcal import`."""
    parser = commands.add_parser(
        "import",
        help="import field books or a list of points into a job",
        description="Read the files of total stations (Leica GSI, RW5, Trimble JobXML, Sokkia "
        "SDR33, plain tables) and write the tables of a job, all or nothing: set-ups, "
        "reflectorless readings of the wall, control targets, and readings that tie set-ups. A "
        "list of points (CSV) with your own headings becomes points.csv, or the table that "
        "--table names. docs/import.md describes each format.",
        epilog="exit status: 0 done; 2 the files or the options must be corrected (one line per "
        "problem: file, row, expected value; no file is written).",
    )
    parser.add_argument(
        "names", metavar="FILE", nargs="+", help="the files, in the order of the measurement"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="the folder of the job (default: this folder, if it is a job)"
    )
    parser.add_argument(
        "--format",
        choices=("gsi", "rw5", "jxl", "sdr", "csv"),
        help="format of all files (default: determined from the content)",
    )
    parser.add_argument(
        "--profile", metavar="FILE.toml", help="profile: meaning of the columns of a plain table"
    )
    parser.add_argument(
        "--table",
        metavar="NAME",
        help="the table of the job to which a list is converted (default: points)",
    )
    parser.add_argument(
        "--column",
        metavar="HEADING=COLUMN",
        action="append",
        default=[],
        help="meaning of a heading of a list, such as 'Este (m)=x_m'",
    )
    parser.add_argument(
        "--yes", action="store_true", help="write a list without confirmation at the terminal"
    )
    for name, text in (
        ("hits", "names or codes of reflectorless readings of the wall, 1-200 or W* (default: "
        "names or codes that begin with WALL, HIT, PAREDE or PARED)"),
        ("control", "names or codes of control targets (default: targets with repeated readings)"),
        ("leave", "names or codes to leave out"),
        ("check", "names or codes of hits for comparison only (use = check)"),
    ):  # fmt: skip
        parser.add_argument(f"--{name}", metavar="PATTERN", action="append", default=[], help=text)
    parser.add_argument(
        "--no-hits", action="store_true", help="the files contain targets only, no hits"
    )
    parser.add_argument(
        "--instrument",
        metavar="NAME",
        default="",
        help="name of the instrument in instruments.toml",
    )
    for name, what in (("mm", "distances"), ("arcsec", "angles")):
        parser.add_argument(
            f"--targets-{name}",
            metavar=name.upper(),
            type=parse_positive,
            help=f"standard deviation of {what} to targets that tie set-ups",
        )
    for name, what in (("begin", "first"), ("end", "last")):
        parser.add_argument(
            f"--{name}",
            metavar="TIME",
            type=_time,
            help=f"time of the {what} reading, such as 2026-07-14T09:00, for files without times",
        )
    parser.add_argument(
        "--codes",
        choices=("before", "after"),
        help="code blocks of GSI (words 41 to 49) were stored before or after their readings "
        "(default: reported, not used)",
    )
    parser.add_argument(
        "--station-code",
        metavar="CODE",
        help="code of the GSI blocks that begin a station: word 42 is the station name, word 43 "
        "the instrument height in millimetres",
    )
    parser.add_argument(
        "--no-control", action="store_true", help="do not write known coordinates to control.csv"
    )
    parser.add_argument(
        "--replace", action="store_true", help="replace tables that already contain rows"
    )
    add_language(parser)
    add_json(parser)
    parser.set_defaults(command=_import)


def _time(text):
    try:
        return datetime.datetime.fromisoformat(text).replace(tzinfo=None)
    except ValueError:
        raise refuse_argument(
            message(
                "option_time",
                "found {text!r}; expected a date with the time, such as 2026-07-14T09:00",
                text=text,
            )
        ) from None


def _import(options):
    from tankcal.terminal import read_job_language

    options.out = options.out or _folder_here(options.names)
    folder = Path(options.out)
    has_job = (folder / SETTINGS_FILE).is_file()
    speak(options.language or (read_job_language(folder) if has_job else None))
    _refuse_workbook(folder)
    foreign_list = _read_foreign_list(options)
    if foreign_list is not None:
        return _import_list(foreign_list, options)
    from tankcal.products.fieldbooks.importing import Choices, import_fieldbooks

    choices = Choices(
        hits=tuple(options.hits),
        control=tuple(options.control),
        leave=tuple(options.leave),
        check=tuple(options.check),
        no_hits=options.no_hits,
        format=options.format,
        profile=options.profile,
        instrument=options.instrument,
        targets_mm=options.targets_mm,
        targets_arcsec=options.targets_arcsec,
        begin=options.begin,
        end=options.end,
        no_control=options.no_control,
        codes=options.codes,
        station_code=options.station_code,
    )
    result = import_fieldbooks(options.names, options.out, choices, replace_tables=options.replace)
    if options.machine:
        _print_machine(result.summary, result.warnings, result.paths)
        return None
    for line in result.summary:
        say(line)
    warn(result.warnings)
    survey = "total-station" if options.no_hits else "wall-hits"
    _say_written(options, result.paths, survey)
    return None


def _print_machine(summary, warnings, paths):
    """Print the results of an import as one JSON object."""
    print_json(
        exit_status=0,
        summary=list(map(str, summary)),
        warnings=list(map(problem_of, warnings)),
        files=list(map(str, paths)),
    )


def _folder_here(names):
    """Return the current folder if it is a job; else name the command that imports the files."""
    if Path(SETTINGS_FILE).is_file():
        return "."
    text = message(
        "import_without_out",
        "missing; expected the folder of the job: tankcal import {names} --out DIR",
        names=" ".join(map(_quote_path, names)),
    )
    raise InputError(Problem("--out", text))


def _refuse_workbook(folder):
    """Raise InputError for a job in a workbook, because its CSV files would not be read."""
    if (folder / WORKBOOK_FILE).is_file() and not (folder / "job.toml").is_file():
        text = message(
            "import_into_workbook",
            "contains the workbook {book}; expected a job with CSV files: tankcal new "
            "ANOTHER-FOLDER",
            book=WORKBOOK_FILE,
        )
        raise InputError(Problem(folder.resolve().name, text))


def _read_foreign_list(options):
    """Return the ForeignList of a single file with a list of points or another table, or None."""
    if len(options.names) != 1 or options.profile or options.format:
        return None
    from tankcal.products.fieldbooks import lists
    from tankcal.products.fieldbooks.detection import is_field_book

    path, stated = Path(options.names[0]), dict(map(_column, options.column))
    is_named = bool(options.table or stated)
    if not is_named and (path.suffix.lower() not in LISTS or not path.is_file()):
        return None
    name = options.table or (path.stem if lists.is_table(path.stem) else "points")
    if not lists.is_table(name):
        text = message(
            "list_no_table", "found --table {name}; expected a table of a job", name=name
        )
        raise InputError(Problem("--table", text))
    if not is_named and (path.stat().st_size > lists.MAX_BYTES or is_field_book(path.read_bytes())):
        return None
    try:
        foreign_list = lists.read_list(path, Path(options.out), name, stated)
    except InputError:
        if is_named:
            raise
        return None  # the reader of field books refuses it
    # at least one needed column beside the name of the point is recognised
    unknown = {field_.name for field_ in foreign_list.missing} - {"point"}
    is_list = len(unknown) < sum(field.required for field in lists.COLUMNS[name]) - 1
    return foreign_list if is_named or is_list else None


def _column(text):
    heading, mark, column = text.rpartition("=")
    if not (mark and heading.strip() and column.strip()):
        expected = message(
            "list_bad_column",
            "found --column {text!r}; expected HEADING=COLUMN, such as 'Este (m)=x_m'",
            text=text,
        )
        raise InputError(Problem("--column", expected))
    return heading.strip(), column.strip()


def _import_list(foreign_list, options):
    """Confirm the headings of a ForeignList, write it, and return the exit status."""
    from tankcal.products.fieldbooks.lists import refuse_missing, write_list

    is_asked = sys.stdin.isatty() and sys.stdout.isatty() and not (options.yes or options.machine)
    folder = Path(options.out)
    if is_asked:
        foreign_list = _ask_missing(foreign_list)
    lines = _list_meanings(foreign_list, folder)
    if not options.machine:
        for line in lines:
            say(line)
        warn(foreign_list.warnings)
    refuse_missing(foreign_list)
    prompt = say_in_language(message("list_confirm", "write it? [Y/n] "))
    if is_asked and _answer(prompt).lower() in NO:
        complain(
            message(
                "list_not_written",
                "no file was written; --column 'HEADING=COLUMN' assigns another meaning to a "
                "heading",
            )
        )
        return 2
    paths = write_list(foreign_list, folder, replace=options.replace)
    if options.machine:
        _print_machine(lines, foreign_list.warnings, paths)
        return 0
    _say_written(options, paths, None)
    return 0


def _list_meanings(foreign_list, folder):
    """Return the lines that show the meaning of each heading."""
    first = message(
        "list_becomes",
        "{file} becomes {table}.csv of {folder}:",
        file=foreign_list.table.file,
        table=foreign_list.name,
        folder=str(folder),
    )
    lines = [first]
    for heading in foreign_list.table.headings:
        meaning = foreign_list.meanings.get(heading)
        named = {"heading": heading}
        if meaning is None:
            line = message("list_unused", "  {heading}: not used", **named)
        elif meaning.factor == 1:
            line = message("list_means", "  {heading} = {column}", column=meaning.column, **named)
        else:
            line = message(
                "list_means_converted",
                "  {heading} = {column}, converted from {unit}",
                column=meaning.column,
                unit=meaning.unit,
                **named,
            )
        lines.append(line)
    return lines


def _ask_missing(foreign_list):
    """Return the ForeignList with headings chosen by the user for missing columns."""
    from tankcal.job.headings import stated_meaning

    meanings = dict(foreign_list.meanings)
    for field in foreign_list.missing:
        free = [title for title in foreign_list.table.headings if title not in meanings]
        if not free:
            break
        say(message("list_ask", "which heading is {column}?", column=field.name))
        for number, heading in enumerate(free, 1):
            print(f"  {number} {printable(heading)}")
        answer = _answer("> ")
        if answer.isdecimal() and 1 <= int(answer) <= len(free):
            heading = free[int(answer) - 1]
            meanings[heading] = stated_meaning(heading, field)
    return replace(foreign_list, meanings=meanings)


def _answer(prompt):
    """Return one line of the terminal; its end counts as no."""
    try:
        return input(prompt).strip()
    except EOFError:
        return "no"


def _say_written(options, paths, survey):
    """Print the written files and the next command."""
    folder = Path(options.out)
    say(message("import_wrote", "wrote into {folder}:", folder=str(folder)))
    for path in paths:
        print(f"  {printable(path)}")
    _say_next(options, survey)


def _say_next(options, survey):
    """Print the next commands; a folder without job.toml is not yet a job."""
    folder = job = Path(options.out)
    if not (folder / "job.toml").is_file():
        job = folder.parent / f"{folder.resolve().name or 'tank'}-job"
        text = message(
            "import_without_job",
            "{folder} has no job.toml, so tankcal run cannot compute it: create an empty job, "
            "then repeat the import with --out {job}, which fills in the empty tables of that job",
            folder=str(folder),
            job=str(job),
        )
        say(text)
        survey_option = "" if survey is None else f" --survey {survey}"
        print(f"  tankcal new {_quote_path(job)}{survey_option}")
        words = list(options.arguments)
        if "--out" in words:
            at = words.index("--out")
            del words[at : at + 2]
        print(f"  {printable(shlex.join(['tankcal', *words, '--out', str(job)]))}")
    say(message("import_next", "then"))
    print(f"  tankcal run {_quote_path(job)}")


def _quote_path(path):
    """Return a path quoted for a shell, with escaped control characters."""
    return printable(shlex.quote(str(path)))
