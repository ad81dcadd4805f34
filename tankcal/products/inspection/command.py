"""`tankcal inspect`: plumb, roundness, welds and settlement of a tank from its survey."""

from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    language_of_run,
    parse_yield,
    print_saved,
    say,
    speak,
    warn,
)

MOST_WARNINGS = 10  # that are shown
NOMINALS = ("drawing", "mean")


def add(commands):
    """Add the parser of `tankcal inspect`."""
    inspect = commands.add_parser(
        "inspect",
        help="inspect plumb, roundness, welds and settlement of a tank from its survey",
        description="Inspect a vertical tank with the survey of its calibration: plumb, roundness, "
        "peaking and banding (from scans), settlement (from levelling). Each result has its "
        "U and a verdict by a rule. The inspection is not part of the certificate. See "
        "docs/inspection.md.",
        epilog="exit status: 0 done, whatever the verdict; 2 the input must be corrected; 3 the "
        "survey has no valid solution.",
    )
    inspect.add_argument(
        "source", metavar="JOB", help="a job, a record.json, or a folder of results"
    )
    inspect.add_argument(
        "--rule", metavar="RULE", help="the name of a rule, or a .toml file (default: api_653)"
    )
    inspect.add_argument(
        "--nominal",
        choices=NOMINALS,
        default=NOMINALS[0],
        help="reference of the radii: the drawing, or the mean of the measured radii",
    )
    inspect.add_argument(
        "--settlement",
        metavar="FILE",
        help="elevations along the foot of the shell (default: settlement.csv beside the job, if "
        "any)",
    )
    inspect.add_argument(
        "--edges",
        metavar="FILE",
        help="levelled lines across the bottom (default: edge_profiles.csv beside the job, if any)",
    )
    inspect.add_argument(
        "--yield-mpa",
        metavar="MPA",
        type=parse_yield,
        help="yield strength of the steel, for the limits of settlement (default: value of the "
        "job)",
    )
    inspect.add_argument(
        "--out",
        metavar="DIR",
        help="write inspection.json and reports to this folder, all or nothing",
    )
    add_language(inspect)
    inspect.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(inspect)
    inspect.set_defaults(command=_inspect)


def _inspect(options):
    from tankcal.terminal import read_job_language, read_record_language

    speak(
        options.language
        or read_record_language(options.source)
        or read_job_language(options.source)
    )
    from tankcal.products.inspection.inspecting import Asked, inspect_files
    from tankcal.record.schema import to_plain

    if options.out is not None:
        from tankcal.report.inspection import refuse_foreign, write_inspection

        refuse_foreign(options.out)
    show = Progress(options.quiet or options.machine)
    show.step(message("inspect_reading", "inspecting {source}", source=options.source))
    asked = Asked(
        options.source,
        rule=options.rule,
        nominal=options.nominal,
        settlement=options.settlement,
        edges=options.edges,
        yield_pa=None if options.yield_mpa is None else 1e6 * options.yield_mpa,
    )
    inspection = to_plain(inspect_files(asked, show.step, show.part))
    written = ()
    if options.out is not None:
        written = write_inspection(inspection, options.out, language_of_run(), show.step)
    show.end()
    print_saved(options, inspection, _tell, written)


def _tell(inspection):
    """Print warnings, the rule, and a line for each check."""
    from tankcal.report.inspection import InspectionPaper

    paper = InspectionPaper(inspection, language_of_run())
    warn(paper.warning(warning) for warning in inspection["warnings"][:MOST_WARNINGS])
    rule = paper.record["rule"]
    say(message("inspect_by", "rule: {rule} ({file})", rule=rule["name"], file=rule["file"]))
    if not rule["verified"]:
        say(
            message(
                "inspect_not_read",
                "* not verified in the text of the standard: {remark}",
                remark=rule["remark"],
            )
        )
    for check in inspection["checks"]:
        say(_line(paper, check))


def _line(paper, check):
    """Return the line of a check: name, value with U, limit, verdict, position."""
    name, verdict = paper.check_name(check["code"]), paper.verdict(check)
    if check["value"] is None:
        return f"{name}: {paper.remark(check) or verdict}"
    values = {
        "check": name,
        "value": paper.value(check),
        "U": paper.format_figure(check, check["U"]) or "?",
        "limit": paper.limit(check) or "-",
        "verdict": verdict,
        "place": paper.place(check),
    }
    return message(
        "inspect_check", "{check}: {value}, U {U}, limit {limit}: {verdict} ({place})", **values
    )
