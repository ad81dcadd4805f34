"""`tankcal import` of a user-defined list: display and confirmation of the headings."""

import sys
from dataclasses import replace
from pathlib import Path

from tankcal.cli.importing import say_written
from tankcal.cli.machine import print_json
from tankcal.cli.showing import complain, say, say_in_language, warn
from tankcal.errors import problem_of
from tankcal.fieldbooks.lists import refuse_missing, write_list
from tankcal.job.headings import stated_meaning
from tankcal.messages import message, printable

NO = ("n", "no", "nao", "não")


def import_list(foreign_list, options):
    """Confirm the headings of a ForeignList, write it, and return the exit status."""
    is_asked = sys.stdin.isatty() and sys.stdout.isatty() and not (options.yes or options.machine)
    folder = Path(options.out)
    if is_asked:
        foreign_list = _ask_missing(foreign_list)
    lines = _lines(foreign_list, folder)
    if not options.machine:
        for line in lines:
            say(line)
        warn(foreign_list.warnings)
    refuse_missing(foreign_list)
    if is_asked and not _is_confirmed():
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
        files = [str(path) for path in paths]
        warnings = [problem_of(warning) for warning in foreign_list.warnings]
        print_json(
            exit_status=0, summary=[str(line) for line in lines], warnings=warnings, files=files
        )
        return 0
    say_written(folder, paths, None)
    return 0


def _lines(foreign_list, folder):
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


def _is_confirmed():
    return _answer(say_in_language(message("list_confirm", "write it? [Y/n] "))).lower() not in NO


def _answer(prompt):
    """Return one line of the terminal; its end counts as no."""
    try:
        return input(prompt).strip()
    except EOFError:
        return "no"
