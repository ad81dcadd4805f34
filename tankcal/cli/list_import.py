"""`tankcal import` of a technician's own list: what its headings mean is shown and confirmed."""

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


def import_list(found, options):
    """Show what the headings of a ForeignList mean, ask, and write it; returns the exit status."""
    is_asked = sys.stdin.isatty() and sys.stdout.isatty() and not (options.yes or options.machine)
    folder = Path(options.out)
    if is_asked:
        found = _ask_missing(found)
    lines = _lines(found, folder)
    if not options.machine:
        for line in lines:
            say(line)
        warn(found.warnings)
    refuse_missing(found)
    if is_asked and not _is_confirmed():
        complain(
            message(
                "list_not_written",
                "no file was written; --column 'HEADING=COLUMN' assigns another meaning to a "
                "heading",
            )
        )
        return 2
    paths = write_list(found, folder, replace=options.replace)
    if options.machine:
        files = [str(path) for path in paths]
        warnings = [problem_of(one) for one in found.warnings]
        print_json(
            exit_status=0, summary=[str(one) for one in lines], warnings=warnings, files=files
        )
        return 0
    say_written(folder, paths, None)
    return 0


def _lines(found, folder):
    """What the list becomes: a line for each heading."""
    first = message(
        "list_becomes",
        "{file} becomes {table}.csv of {folder}:",
        file=found.table.file,
        table=found.name,
        folder=str(folder),
    )
    lines = [first]
    for heading in found.table.headings:
        one = found.meanings.get(heading)
        named = {"heading": heading}
        if one is None:
            line = message("list_unused", "  {heading}: not used", **named)
        elif one.factor == 1:
            line = message("list_means", "  {heading} = {column}", column=one.column, **named)
        else:
            line = message(
                "list_means_converted",
                "  {heading} = {column}, converted from {unit}",
                column=one.column,
                unit=one.unit,
                **named,
            )
        lines.append(line)
    return lines


def _ask_missing(found):
    """The ForeignList with the headings that the user chooses for columns that it lacks."""
    meanings = dict(found.meanings)
    for field in found.missing:
        free = [one for one in found.table.headings if one not in meanings]
        if not free:
            break
        say(message("list_ask", "which heading is {column}?", column=field.name))
        for number, heading in enumerate(free, 1):
            print(f"  {number} {printable(heading)}")
        answer = _answer("> ")
        if answer.isdecimal() and 1 <= int(answer) <= len(free):
            heading = free[int(answer) - 1]
            meanings[heading] = stated_meaning(heading, field)
    return replace(found, meanings=meanings)


def _is_confirmed():
    return _answer(say_in_language(message("list_confirm", "write it? [Y/n] "))).lower() not in NO


def _answer(prompt):
    """One line of the terminal; its end counts as no."""
    try:
        return input(prompt).strip()
    except EOFError:
        return "no"
