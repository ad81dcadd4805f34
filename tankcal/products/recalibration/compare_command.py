"""`tankcal compare`: comparison of a former and a new table of one tank."""

from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    language_of_run,
    marks,
    print_saved,
    say,
    speak_of_record,
    warn,
)
from tankcal.text.digits import fixed

MOST_WARNINGS = 10  # that are shown


def add(commands):
    """Add the parser of `tankcal compare`."""
    compare = commands.add_parser(
        "compare",
        help="compare a former table with a new one of the same tank",
        description="Reduce two capacity tables of a tank to one basis (zero, temperature, head, "
        "roof, rounding). Report differences of rows, deliveries and course radii, with a verdict "
        "by a rule: keep, recompute or recalibrate. See docs/compare.md.",
        epilog="exit status: 0 done, whatever the verdict; 2 the input must be corrected.",
    )
    table = "a CSV file, an Excel workbook (.xlsx), a PDF with a text table, a former.toml, a "
    table += "record.json or a folder of results"
    compare.add_argument("old", metavar="OLD", help=f"the former table: {table}")
    compare.add_argument("new", metavar="NEW", help="the new table, in any of these forms")
    compare.add_argument(
        "--former",
        metavar="FILE.toml",
        help="facts about the former table that its rows do not contain",
    )
    compare.add_argument(
        "--new-former", metavar="FILE.toml", help="facts about the new table, if it is not a record"
    )
    compare.add_argument(
        "--courses",
        metavar="FILE",
        help="courses.csv of a vertical tank (default: courses of the record)",
    )
    compare.add_argument(
        "--rule",
        metavar="RULE",
        help="the name of a rule, or a .toml file (default: france_2020_recalibration)",
    )
    compare.add_argument(
        "--out",
        metavar="DIR",
        help="write comparison.json and reports to this folder, all or nothing",
    )
    add_language(compare)
    compare.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(compare)
    compare.set_defaults(command=_compare)


def _compare(options):
    speak_of_record(options.language, options.new, options.old)
    from tankcal.products.recalibration.comparison import Asked, compare_files
    from tankcal.record.schema import to_plain

    if options.out is not None:
        from tankcal.report.comparison import refuse_foreign, write_comparison

        refuse_foreign(options.out)
    show = Progress(options.quiet or options.machine)
    show.step(message("compare_reading", "comparing {old} with {new}",
                      old=options.old, new=options.new))  # fmt: skip
    asked = Asked(
        options.old, options.new, former=options.former, new_former=options.new_former,
        courses=options.courses, rule=options.rule,
    )  # fmt: skip
    comparison = to_plain(compare_files(asked))
    written = ()
    if options.out is not None:
        written = write_comparison(comparison, options.out, language_of_run(), show.step)
    show.end()
    print_saved(options, comparison, _tell, written)


def _tell(comparison):
    """Print warnings, the components of the difference, and the verdict with its reasons."""
    from tankcal.report.comparison import ComparisonPaper

    paper = ComparisonPaper(comparison, language_of_run())
    warn(paper.warning(warning) for warning in comparison["warnings"][:MOST_WARNINGS])
    say(
        message(
            "compare_sides",
            "{former} compared with {new}: {rows} rows from {low} to {high} m",
            former=comparison["former"]["name"],
            new=comparison["new"]["name"],
            rows=len(comparison["rows"]["height_m"]),
            low=_plain(comparison["low_m"]),
            high=_plain(comparison["high_m"]),
        )
    )
    say(_sum(comparison["waterfall"][-1]))
    say(
        message(
            "compare_verdict",
            "verdict: {verdict} ({rule})",
            verdict=paper.word(f"verdicts.{comparison['verdict'] or 'none'}"),
            rule=paper.record["rule"]["name"],
        )
    )
    for reason in comparison["reasons"]:
        say(f"  {paper.reason(reason)}")


def _sum(column):
    names = ("former", "zero", "temperature", "head", "roof", "rounding", "tank", "new")
    return message(
        "compare_sum",
        "at {dip} m, m3: former {former}, zero {zero}, temperature {temperature}, head {head}, "
        "roof {roof}, rounding {rounding}, the tank itself {tank}, new {new}",
        dip=_plain(column["height_m"]),
        **{
            name: _format_signed(column[f"{name}_m3"], name not in ("former", "new"))
            for name in names
        },
    )


def _format_signed(value, is_change):
    text = fixed(value, 3, marks())
    return f"+{text}" if is_change and value > 0 else text


def _plain(value):
    return f"{value:.6g}".replace(".", marks().decimal)
