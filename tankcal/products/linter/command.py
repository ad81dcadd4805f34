"""`tankcal lint`: errors in any capacity table."""

from tankcal.errors import InputError, Problem, problem_of
from tankcal.messages import message
from tankcal.terminal import add_json, add_language, parse_positive, print_json, say, speak

MOST_FINDINGS = 50  # that are shown at once


def add(commands):
    """Add the parser of `tankcal lint`."""
    lint = commands.add_parser(
        "lint",
        help="check any capacity table for errors",
        description="Check a capacity table for errors: unreadable numbers; missing, repeated or "
        "exchanged rows; wrong digits; shifted blocks; wrong units; a total or a last row "
        "that does not fit. One line per finding; docs/table.md describes the tests.",
        epilog="exit status: 0 no errors (warnings are possible); 2 errors found, or no table.",
    )
    lint.add_argument(
        "file",
        metavar="FILE",
        help="a CSV file, an Excel workbook (.xlsx), a PDF with the table as text, or a "
        "record.json",
    )
    lint.add_argument(
        "--sheet",
        metavar="NAME",
        help="sheet of a workbook (default: the sheet with the longest table)",
    )
    lint.add_argument(
        "--uneven",
        action="store_true",
        help="the rows are breakpoints, not at even steps",
    )
    for name, unit, what in (
        ("volume", "M3", "nominal volume of the tank, m3"),
        ("diameter", "M", "inside diameter of a vertical tank, m; requires --nominal-height"),
        ("height", "M", "nominal height of the last row, m"),
    ):
        lint.add_argument(f"--nominal-{name}", metavar=unit, type=parse_positive, help=what)
    add_language(lint)
    add_json(lint)
    lint.set_defaults(command=_lint)


def _lint(options):
    speak(options.language)
    from tankcal.products.linter.linting import lint
    from tankcal.products.linter.volumes import Nominal

    if options.nominal_diameter is not None and options.nominal_height is None:
        expected = message("nominal_height_too", "given without --nominal-height; expected both")
        raise InputError(Problem("--nominal-diameter", expected))
    nominal = Nominal(options.nominal_volume, options.nominal_diameter, options.nominal_height)
    report = lint(options.file, nominal, options.sheet, not options.uneven)
    if options.machine:
        print_json(exit_status=2 if report.errors else 0, **_plain(report))
        return 2 if report.errors else 0
    for finding in report.findings[:MOST_FINDINGS]:
        say(finding.text)
    more = len(report.findings) - MOST_FINDINGS
    if more > 0:
        say(message("more_findings", "and {more} more findings; correct these first", more=more))
    warnings = len(report.findings) - report.errors
    for summary in report.summaries:
        say(summary)
    say(
        message(
            "found_in_table",
            "{errors}, {warnings}",
            errors=_errors(report.errors),
            warnings=_warnings(warnings),
        )
    )
    return 2 if report.errors else 0


def _errors(count):
    if count == 0:
        return message("no_errors", "no errors")
    if count == 1:
        return message("one_error", "1 error")
    return message("some_errors", "{count} errors", count=count)


def _warnings(count):
    if count == 0:
        return message("no_warnings", "no warnings")
    if count == 1:
        return message("one_warning", "1 warning")
    return message("some_warnings", "{count} warnings", count=count)


def _plain(report):
    findings = [
        {"severity": finding.severity, **problem_of(finding.problem)} for finding in report.findings
    ]
    return {
        "errors": report.errors,
        "warnings": len(report.findings) - report.errors,
        "summaries": list(map(str, report.summaries)),
        "findings": findings,
    }
