"""`tankcal upkeep`: a calibration kept up by everyday data."""

import os
from pathlib import Path

from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    add_letterhead,
    language_of_run,
    marks,
    print_paths,
    print_saved,
    read_letterhead,
    say,
    speak,
    warn,
)
from tankcal.text.digits import format_with_u


def add(commands):
    """Add the parser of `tankcal upkeep`."""
    upkeep = commands.add_parser(
        "upkeep",
        help="keep up a calibration by level logs, meters and delivery tickets",
        description="From level logs, meters and delivery tickets of a tank in service to its "
        "improved table, the factors of its meters and a monthly leak rate, each with U, and to "
        "alarms. See docs/upkeep.md.",
        epilog="exit status: 0 done, also with an alarm; 2 the input must be corrected (a line "
        "per problem: file, row, column, expected value).",
    )
    upkeep.add_argument("folder", metavar="DIR", help="folder with upkeep.toml and the logs")
    upkeep.add_argument(
        "--new", action="store_true", help="create the folder with empty input files to fill in"
    )
    upkeep.add_argument(
        "--from",
        dest="source",
        metavar="SOURCE",
        help="begin with a record.json or its folder, a capacity table of another laboratory (CSV, "
        "workbook, PDF, former.toml), a job such as the sizes of a drawing, or with 'nothing': the "
        "table of a horizontal tank from its sales and [drawing] (default: record in upkeep.toml)",
    )
    upkeep.add_argument(
        "--out",
        metavar="DIR",
        help="write report, upkeep.json, workbook and CSV files to this folder, all at once",
    )
    upkeep.add_argument(
        "--record",
        metavar="DIR",
        help="write record.json of the new table to this folder; `tankcal report DIR` writes its "
        "reports, and a later upkeep begins with it",
    )
    upkeep.add_argument(
        "--state",
        metavar="DIR",
        help="keep results of this run in this folder, so that the next month takes less time; "
        "the output is equal without it",
    )
    upkeep.add_argument(
        "--steps",
        action="store_true",
        help="save every step with its times; they show sales and working hours (default: days)",
    )
    add_letterhead(upkeep)
    add_language(upkeep)
    upkeep.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(upkeep)
    upkeep.set_defaults(command=_upkeep)


def _upkeep(options):
    speak(options.language)
    if options.new:
        from tankcal.products.upkeep.reading import EMPTY_FILES

        print_paths(options.folder, EMPTY_FILES.write(options.folder, language_of_run()))
        return
    from tankcal.products.upkeep.paper import DOCUMENT, UpkeepPaper
    from tankcal.products.upkeep.reading import read_upkeep
    from tankcal.products.upkeep.saved import State
    from tankcal.products.upkeep.upkeep import keep_up
    from tankcal.record.schema import to_plain

    letterhead = read_letterhead(options)
    if options.out is not None:
        DOCUMENT.refuse_foreign(options.out)
    show = Progress(options.quiet or options.machine)
    show.step(message("upkeep_reading", "reading the logs"))
    state = State(options.state)
    inputs = read_upkeep(options.folder, state, _find_source(options))
    if options.language is None and inputs.sections["upkeep"]["language"] is not None:
        speak(inputs.sections["upkeep"]["language"])
    show.step(message("upkeep_estimating", "estimating the tank"))
    result = keep_up(inputs, state, with_steps=options.steps)
    upkeep, written = to_plain(result), ()
    if options.record is not None:
        from tankcal.products.upkeep.new_record import make_record, write_record

        paper = UpkeepPaper(upkeep, language_of_run())
        record = make_record(inputs, result, state, " ".join(paper.reasons()))
        write_record(record, options.record, language_of_run())
    if options.out is not None:
        written = DOCUMENT.write(
            upkeep, Path(options.out), language_of_run(), show.step, letterhead
        )
    show.end()
    print_saved(options, upkeep, _tell, written)


def _find_source(options):
    """Text of --from, as seen from the folder of upkeep.toml."""
    from tankcal.products.upkeep.start import WITHOUT_TABLE

    if options.source in (None, WITHOUT_TABLE):
        return options.source
    folder = Path(options.folder)
    folder = folder.parent if folder.suffix == ".toml" else folder
    return Path(os.path.relpath(options.source, folder)).as_posix()


def _tell(upkeep):
    """Print warnings, result, meters, the last month and the alarm."""
    from tankcal.products.upkeep.paper import UpkeepPaper

    paper = UpkeepPaper(upkeep, language_of_run())
    warn(paper.warning(warning) for warning in upkeep["warnings"])
    for sentence in (paper.result(), *paper.reasons()):
        say(sentence)
    for meter in upkeep["meters"]:
        written = format_with_u(meter["deviation_percent"], meter["U_percent"], marks())
        say(
            message(
                "upkeep_meter_line",
                "meter {name}: {deviation} %, U = {U} %",
                name=meter["name"],
                deviation=written.value,
                U=written.uncertainty,
            )
        )
    last = upkeep["months"][-1]
    written = format_with_u(last["leak_l_h"], last["U_l_h"], marks())
    say(
        message(
            "upkeep_leak_line",
            "{month}: loss {leak} L/h, U = {U} L/h: {verdict}",
            month=last["month"],
            leak=written.value,
            U=written.uncertainty,
            verdict=paper.words["verdicts"][last["verdict"]],
        )
    )
    say(paper.alarm())
