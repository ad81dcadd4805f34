"""`tankcal assess`: certificate and record as an assessor reads them."""

from pathlib import Path

from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    add_letterhead,
    language_of_run,
    print_json,
    print_paths,
    read_letterhead,
    say,
    speak,
)

FAILED = 2  # exit status for a nonconformity


def add(commands):
    """Add the parser of `tankcal assess`."""
    parser = commands.add_parser(
        "assess",
        help="read a certificate as an assessor would",
        description="Compare a certificate and its record with ISO/IEC 17025, ILAC-P14, ILAC-G8, "
        "the GUM and the rule of the job. Each finding has a grade, the clause and how it is "
        "known, the place, and a remedy. The PDF of another laboratory is assessed by its text "
        "alone. See docs/assess.md.",
        epilog="exit status: 0 no nonconformity (observations are possible); 2 nonconformities, or "
        "no certificate.",
    )
    parser.add_argument(
        "results",
        metavar="RESULTS",
        help="a folder of results, a record.json, or the PDF of a certificate",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write report, assessment.json, workbook and CSV file to this folder",
    )
    add_letterhead(parser)
    add_language(parser)
    parser.add_argument("--quiet", action="store_true", help="no progress, only findings")
    add_json(parser)
    parser.set_defaults(command=_assess)


def _assess(options):
    speak(options.language)
    from tankcal.products.assess.assessing import assess, plain_assessment
    from tankcal.products.assess.paper import DOCUMENT, AssessmentPaper

    letterhead = read_letterhead(options)
    if options.out is not None:
        DOCUMENT.refuse_foreign(options.out)
    assessment = assess(options.results)
    if options.language is None:
        speak(assessment.language)
    plain, written = plain_assessment(assessment), ()
    if options.out is not None:
        show = Progress(options.quiet or options.machine)
        written = DOCUMENT.write(plain, Path(options.out), language_of_run(), show.step, letterhead)
        show.end()
    status = FAILED if assessment.nonconformities else 0
    if options.machine:
        print_json(exit_status=status, files=list(map(str, written)), **plain)
        return status
    paper = AssessmentPaper(plain, language_of_run())
    for line in (*paper.lines(), paper.verdict()):
        say(line)
    if written:
        print_paths(options.out, written)
    return status
