"""`tankcal report`: reports created again from a record."""

from pathlib import Path

from tankcal.terminal import Progress, add_letterhead, print_paths, read_letterhead, speak
from tankcal.text.shipped import LANGUAGES


def add(commands):
    """Add the parser of `tankcal report`."""
    report = commands.add_parser(
        "report",
        help="write the reports again, from a record",
        description="Write workbook, notebook, PDFs, web page and CSV files again from record.json "
        "alone, all or nothing. From comparison.json, inspection.json or history.json, write "
        "the reports of a comparison, an inspection or a history. The results are not "
        "computed again.",
        epilog="exit status: 0 done; 2 the record, the language or the letterhead cannot be used; "
        "no file is written.",
    )
    report.add_argument(
        "record",
        metavar="RECORD",
        help="a record.json, comparison.json, inspection.json or history.json, or a folder of "
        "results",
    )
    report.add_argument(
        "--out",
        metavar="DIR",
        help="output folder (default: folder of the record); earlier results there are replaced",
    )
    report.add_argument(
        "--language",
        metavar="CODE",
        help=f"language of the reports: {', '.join(LANGUAGES)} (default: language of the job)",
    )
    add_letterhead(report)
    report.add_argument("--quiet", action="store_true", help="no progress, only problems")
    report.set_defaults(command=_report)


def _report(options):
    from tankcal.report import outputs
    from tankcal.report.saved_documents import find_document

    show = Progress(options.quiet)
    letterhead = read_letterhead(options)
    document, saved = find_document(options.record)
    if document is not None:
        language = outputs.known_language(options.language)
        speak(language)
        out = Path(options.out) if options.out else saved.parent
        paths = document.rebuild(saved, out, language, show.step, letterhead)
        show.end()
        print_paths(out, paths)
        return
    source = outputs.record_file(options.record)
    out = Path(options.out) if options.out else source.parent
    if options.language in LANGUAGES:
        speak(options.language)
    paths = outputs.rebuild(source, out, show.part, options.language, letterhead)
    show.end()
    print_paths(out, paths)
