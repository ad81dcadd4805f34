"""`tankcal verify`: whether the files of a run belong together."""

from tankcal.cli.arguments import add_language
from tankcal.cli.machine import add_json, print_json
from tankcal.cli.showing import prepare_for_small_work, say, speak_of_record
from tankcal.errors import problem_of
from tankcal.messages import message


def add(commands):
    """The parser of `tankcal verify`."""
    verify = commands.add_parser(
        "verify",
        help="check that the files of a run belong together, by their hashes",
        description="Compare the SHA-256 of record.json with those that PDFs, workbook, digital "
        "certificate and web page name, what a PDF holds inside with the files beside it, the CSV "
        "files with the record, and the input files of the job, where it is at hand, with those of "
        "the record. One line a disagreement. Nothing is computed again.",
        epilog="exit status: 0 all agree; 2 something does not, or there is nothing to compare.",
    )
    verify.add_argument(
        "results", metavar="RESULTS", help="a folder of results, or one of its PDFs"
    )
    verify.add_argument(
        "--job",
        metavar="DIR",
        help="folder of the input files (default: the one that the results lie in)",
    )
    add_language(verify)
    add_json(verify)
    verify.set_defaults(command=_verify)


def _verify(options):
    prepare_for_small_work()
    speak_of_record(options.language, options.results)
    from tankcal.report.verification import verify

    found = verify(options.results, options.job)
    status = 2 if found.problems else 0
    if options.machine:
        print_json(
            exit_status=status,
            record_sha256=found.digest,
            compared=found.compared,
            inputs_compared=found.inputs_found,
            problems=[problem_of(one) for one in found.problems],
        )
        return status
    for one in found.problems:
        say(one.text)
    if not found.inputs_found:
        say(message("verify_no_inputs", "the input files of the job are not here: not compared"))
    if found.problems:
        count = len(found.problems)
        text = message("verify_disagree", "{count} disagreements", count=count)
        say(message("verify_disagrees", "1 disagreement") if count == 1 else text)
    else:
        say(
            message(
                "verify_agree",
                "{count} files compared, all agree: record.json is sha256:{digest}",
                count=len(found.compared),
                digest=found.digest,
            )
        )
    return status
