"""`tankcal gauge`: commissioning of an automatic level gauge."""

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
from tankcal.text.digits import fixed, format_with_u


def add(commands):
    """Add the parser of `tankcal gauge`."""
    gauge = commands.add_parser(
        "gauge",
        help="commission a level gauge by hand dips",
        description="From hand dips and indications of a level gauge at several levels to its "
        "offset and scale, the corrections of its indications and the zeros of dip plate, table "
        "and gauge, each with U, and a decision by a declared limit. See docs/gauge.md.",
        epilog="exit status: 0 done, whatever the decision; 2 the input must be corrected (one "
        "line per problem: file, row, column, expected value).",
    )
    gauge.add_argument("folder", metavar="DIR", help="folder with gauge.toml and readings.csv")
    gauge.add_argument(
        "--new", action="store_true", help="create the folder with empty input files to fill in"
    )
    gauge.add_argument(
        "--out",
        metavar="DIR",
        help="write certificate, gauge.json, workbook and CSV files to this folder, all or nothing",
    )
    add_letterhead(gauge)
    add_language(gauge)
    gauge.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(gauge)
    gauge.set_defaults(command=_gauge)


def _gauge(options):
    speak(options.language)
    if options.new:
        from tankcal.products.gauge.reading import EMPTY_FILES

        print_paths(options.folder, EMPTY_FILES.write(options.folder, language_of_run()))
        return
    from tankcal.products.gauge.commissioning import commission
    from tankcal.products.gauge.reading import read_comparison
    from tankcal.record.schema import to_plain

    letterhead = read_letterhead(options)
    if options.out is not None:
        from tankcal.products.gauge.paper import DOCUMENT

        DOCUMENT.refuse_foreign(options.out)
    comparison = read_comparison(options.folder)
    if options.language is None and comparison.sections["certificate"]["language"] is not None:
        speak(comparison.sections["certificate"]["language"])
    show = Progress(options.quiet or options.machine)
    gauge = to_plain(commission(comparison))
    written = ()
    if options.out is not None:
        written = DOCUMENT.write(gauge, Path(options.out), language_of_run(), show.step, letterhead)
    show.end()
    print_saved(options, gauge, _tell, written)


def _tell(gauge):
    """Print warnings, levels, line, zeros and decision."""
    from tankcal.products.gauge.paper import GaugePaper

    paper = GaugePaper(gauge, language_of_run())
    warn(paper.warning(warning) for warning in gauge["warnings"])
    for level in gauge["levels"]:
        verdict = level["verdict"]
        say(
            message(
                "gauge_level",
                "{name}: dip {dip} m, gauge {gauge} m, deviation {deviation} mm, U = {U} mm"
                "{verdict}",
                name=level["name"],
                dip=fixed(level["dip_m"], 4, marks()),
                gauge=fixed(level["gauge_m"], 4, marks()),
                **_digits(level["deviation_mm"], level["U_mm"], "deviation"),
                verdict="" if verdict is None else ": " + paper.words["verdicts"][verdict],
            )
        )
    line = gauge["line"]
    say(
        message(
            "gauge_line",
            "offset {offset} mm at {level} m, U = {U} mm",
            **_digits(line["offset_mm"], line["U_offset_mm"], "offset"),
            level=fixed(line["mean_level_m"], 2, marks()),
        )
    )
    say(
        message(
            "gauge_slope",
            "slope {slope} mm/m, U = {U} mm/m",
            **_digits(line["slope_mm_per_m"], line["U_slope_mm_per_m"], "slope"),
        )
    )
    for zero in gauge["zeros"][1:3]:
        if zero["z_mm"] is not None:
            say(
                message(
                    "gauge_zero_line",
                    "{zero}: {z} mm above the dip plate, U = {U} mm",
                    zero=paper.words["zeros"][zero["code"]],
                    **_digits(zero["z_mm"], zero["U_mm"], "z"),
                )
            )
    if gauge["decision"] is not None:
        say(paper.decision())


def _digits(value, U, name):
    """{name: value, "U": U} with the digits of U."""
    written = format_with_u(value, U, marks())
    return {name: written.value, "U": written.uncertainty}
