"""`tankcal standard`: a table of standard volumes at several densities and temperatures."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message, printable
from tankcal.terminal import (
    add_json,
    add_language,
    language_of_run,
    parse_number,
    parse_several,
    print_json,
    say,
    speak_of_record,
)


def add(commands):
    """Add the parser of `tankcal standard`."""
    parser = commands.add_parser(
        "standard",
        help="write standard volumes at each dip, for several densities and temperatures",
        description="Write gross standard volumes with U at each dip, for densities at the base "
        "and temperatures of the liquid, by a named volume correction. See docs/ticket.md.",
        epilog="exit status: 0 done; 2 the record, the settings or the options must be corrected "
        "(no file is written).",
    )
    parser.add_argument("record", metavar="RECORD", help="a record.json, or a folder of results")
    parser.add_argument(
        "ticket", metavar="TICKET.toml", help="product, shell and uncertainties; no gauging needed"
    )
    parser.add_argument(
        "--temperatures",
        metavar="N",
        nargs="+",
        type=parse_number,
        required=True,
        help="temperatures of the liquid, degC",
    )
    parser.add_argument(
        "--densities",
        metavar="N",
        nargs="+",
        type=parse_number,
        required=True,
        help="densities at the base temperature, kg/m3",
    )
    parser.add_argument(
        "--step-cm",
        metavar="N",
        type=parse_several,
        help="centimetres between two dips (default: 10)",
    )
    parser.add_argument(
        "--air",
        metavar="N",
        type=parse_number,
        help="temperature of the air, degC (default: the shell has that of the liquid)",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        help="output file: .csv, .pdf or .xlsx (default: TANK-standard.pdf in this folder)",
    )
    add_language(parser)
    add_json(parser)
    parser.set_defaults(command=_standard)


def _standard(options):
    from tankcal.products.quantity.standard_table import (
        compute_standard_table,
        write_standard_table,
    )
    from tankcal.products.quantity.table import read_table
    from tankcal.report.outputs import record_file
    from tankcal.text.naming import file_name

    source = record_file(options.record)
    speak_of_record(options.language, source)
    _check_lists(options)
    table = read_table(source)
    out = Path(options.out or f"{file_name(table.tank, 'tank')}-standard.pdf")
    _check_output(out, len(options.temperatures))
    standard = compute_standard_table(
        table, Path(options.ticket), options.temperatures, options.densities,
        options.step_cm or 10, options.air,
    )  # fmt: skip
    write_standard_table(standard, out, language_of_run())
    if options.machine:
        print_json(exit_status=0, cells=standard.volume_m3.size, files=[str(out)])
        return 0
    say(message("standard_written", "{count} volumes", count=standard.volume_m3.size))
    print(f"  {printable(out)}")
    return 0


def _check_lists(options):
    """Refuse values that are not in ascending order."""
    text = message("standard_ascending", "expected values in ascending order, each once")
    problems = [
        Problem(name, text)
        for name, values in (("--temperatures", options.temperatures),
                             ("--densities", options.densities))
        if values != sorted(set(values))
    ]  # fmt: skip
    if problems:
        raise InputError(problems)


def _check_output(path, count):
    """Refuse an unknown kind of file, and too many temperatures for a page."""
    from tankcal.products.quantity.standard_table import MOST_COLUMNS, SUFFIXES

    if path.suffix.lower() not in SUFFIXES or path.is_dir():
        text = message("standard_out", "expected the name of a .csv, .pdf or .xlsx file")
        raise InputError(Problem("--out", text))
    if path.suffix.lower() == ".pdf" and count > MOST_COLUMNS:
        text = message(
            "standard_columns", "found {count}; expected at most {most} on a page, or a .csv file",
            count=count, most=MOST_COLUMNS,
        )  # fmt: skip
        raise InputError(Problem("--temperatures", text))
