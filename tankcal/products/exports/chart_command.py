"""`tankcal chart`: the field chart of a small tank, litres at each centimetre on a page."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message, printable
from tankcal.terminal import add_json, add_language, parse_several, print_json, say, speak_of_record


def add(commands):
    """Add the parser of `tankcal chart`."""
    parser = commands.add_parser(
        "chart",
        help="write litres at each centimetre on a page for the wall",
        description="Write the field chart of a small tank, such as that of a fuel station: litres "
        "at each whole centimetre of dip on an A4 page in large type, with product, certificate "
        "number, date and U. See docs/exports.md.",
        epilog="exit status: 0 done; 2 the record or the options must be corrected (no file is "
        "written).",
    )
    parser.add_argument("record", metavar="RECORD", help="a record.json, or a folder of results")
    parser.add_argument("--product", metavar="NAME", help="product (default: that of the job)")
    parser.add_argument(
        "--step-cm",
        metavar="N",
        type=parse_several,
        help="centimetres between two rows (default: 1)",
    )
    parser.add_argument(
        "--ullage",
        action="store_true",
        help="ullages from the reference height in place of dips",
    )
    parser.add_argument(
        "--water",
        action="store_true",
        help="free water in place of the product: litres at each millimetre of water dip",
    )
    parser.add_argument(
        "--step-mm",
        metavar="N",
        type=parse_several,
        help="with --water, millimetres between two rows (default: 1)",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        help="output file (default: TANK-chart.pdf or TANK-water.pdf in this folder)",
    )
    add_language(parser)
    add_json(parser)
    parser.set_defaults(command=_chart)


def _chart(options):
    from tankcal import record as records
    from tankcal.report.outputs import record_file
    from tankcal.report.station_chart import write_chart
    from tankcal.text.naming import file_name

    _refuse_other_steps(options)
    source = record_file(options.record)
    speak_of_record(options.language, source)
    out = options.out
    if out is None:
        name = file_name((records.load(source)["job"]["tank"] or {}).get("id", ""))
        out = f"{name}-{'water' if options.water else 'chart'}.pdf"
    out = Path(out)
    if out.suffix.lower() != ".pdf" or out.is_dir():
        expected = message("chart_out", "expected the name of a .pdf file")
        raise InputError(Problem("--out", expected))
    count = write_chart(
        source, out, options.language, options.product, options.step_cm or 1,
        by_ullage=options.ullage, water_mm=(options.step_mm or 1) if options.water else None,
    )  # fmt: skip
    if options.machine:
        print_json(exit_status=0, rows=count, files=[str(out)])
        return 0
    say(message("chart_written", "{count} rows on a page", count=count))
    print(f"  {printable(out)}")
    return 0


def _refuse_other_steps(options):
    """Refuse options that the chosen kind of chart does not use."""
    if options.water:
        text = message("chart_beside_water", "not used with --water; expected no such option")
        unused = {"--ullage": options.ullage, "--step-cm": options.step_cm}
    else:
        text = message("chart_without_water", "only used with --water; expected --step-cm")
        unused = {"--step-mm": options.step_mm}
    problems = [Problem(name, text) for name, value in unused.items() if value]
    if problems:
        raise InputError(problems)
