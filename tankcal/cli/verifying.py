"""`tankcal verify`: agreement of the files of a run, and reproduction of the results."""

from dataclasses import asdict

from tankcal.errors import problem_of
from tankcal.messages import message, printable
from tankcal.terminal import Progress, add_json, add_language, print_json, say, speak_of_record


def add(commands):
    """Add the parser of `tankcal verify`."""
    verify = commands.add_parser(
        "verify",
        help="check that the files of a run agree and can be reproduced",
        description="Compare every file of a folder of results with SHA256SUMS, and the reports "
        "with reports created again from the record. Compare the input files of the job, if "
        "available, with the hashes in the record, and every number of the record with the job "
        "computed again. One line per disagreement.",
        epilog="exit status: 0 no disagreement; 2 at least one disagreement, or no file to "
        "compare.",
    )
    verify.add_argument(
        "results",
        metavar="RESULTS",
        help="a folder written by tankcal: results, comparison, inspection, history, plan or "
        "camera; or a PDF of results",
    )
    verify.add_argument(
        "--job",
        metavar="DIR",
        help="folder of the input files, or the workbook of the job (default: the parent folder "
        "of the results)",
    )
    verify.add_argument(
        "--hashes-only",
        action="store_true",
        help="compare hashes only, without creating reports or computing numbers again",
    )
    add_language(verify)
    verify.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(verify)
    verify.set_defaults(command=_verify)


def _verify(options):
    speak_of_record(options.language, options.results)
    from tankcal.report.verification import verify

    show = Progress(options.quiet or options.machine)
    result = verify(
        options.results,
        options.job,
        hashes_only=options.hashes_only,
        step=show.step,
        part=show.part,
    )
    show.end()
    status = 2 if result.problems else 0
    if options.machine:
        _print(result, status)
    else:
        _tell(result, options.hashes_only)
    return status


def _print(result, status):
    again = result.recomputed
    print_json(
        exit_status=status,
        record_sha256=result.digest,
        manifest_sha256=result.manifest_sha256,
        compared=result.compared,
        inputs_compared=result.inputs_found,
        papers_made_again=result.papers_again,
        recomputed=None
        if again is None
        else {
            "made_by": again.made_by,
            "computed_by": again.computed_by,
            "numbers": again.numbers,
            "different": again.different,
            "largest": None
            if again.largest is None
            else {
                key: None if value == float("inf") else value
                for key, value in asdict(again.largest).items()
            },
            "agrees": again.agrees,
        },
        compared_by_hash_alone=result.by_hash,
        compared_by_numbers_alone=result.by_numbers,
        notes=[str(note) for note in result.notes],
        problems=[problem_of(problem) for problem in result.problems],
    )


def _tell(result, hashes_only):
    for problem in result.problems:
        say(problem.text)
    if result.recomputed is not None:
        for line in _numbers(result.recomputed):
            say(line)
    elif result.saved_file == "record.json" and not result.inputs_found:
        say(
            message(
                "verify_no_inputs",
                "the input files of the job were not found: neither compared nor computed again",
            )
        )
    for note in result.notes:
        say(note)
    if result.papers_again:
        say(message("verify_papers_again", "the reports were created again and compared"))
    if hashes_only:
        say(
            message(
                "verify_hashes_only",
                "hashes only: no report was created and no number was computed again",
            )
        )
    _sum(result)


def _numbers(again):
    """Yield the comparison of the numbers, and the versions that computed them."""
    if again.different == 0:
        yield message(
            "verify_same_numbers",
            "computed again: {count} numbers, all identical bit for bit",
            count=again.numbers,
        )
    elif again.largest is None:
        yield message(
            "verify_rounded_numbers",
            "computed again: {count} numbers, {different} not identical bit for bit, all by "
            "rounding only",
            count=again.numbers,
            different=again.different,
        )
    else:
        difference = again.largest
        yield message(
            "verify_near_numbers",
            "computed again: {count} numbers, {different} not identical bit for bit; the largest "
            "difference relative to its tolerance is at {place}: {recorded} in the record, "
            "{computed} now, {relative} of the largest number there (tolerance {tolerance})",
            count=again.numbers,
            different=again.different,
            place=difference.place,
            recorded=f"{difference.recorded:.12g}",
            computed=f"{difference.computed:.12g}",
            relative=f"{difference.relative:.1e}",
            tolerance=f"{difference.tolerance:.0e}",
        )
    versions_then, versions_now = (
        ", ".join(f"{name} {version}" for name, version in versions.items())
        for versions in (again.made_by, again.computed_by)
    )
    if versions_then == versions_now:
        yield message(
            "verify_same_versions", "computed both times with {versions}", versions=versions_then
        )
    else:
        yield message(
            "verify_other_versions",
            "computed with {made}; computed again with {now}",
            made=versions_then,
            now=versions_now,
        )


def _list_partial(result):
    """Yield the files that were not compared with files created again."""
    by_hash, by_numbers = (", ".join(map(printable, names))
                           for names in (result.by_hash, result.by_numbers))  # fmt: skip
    if by_hash:
        yield message(
            "verify_by_hash",
            "compared by their hash in SHA256SUMS only, which anybody can recompute: {files}",
            files=by_hash,
        )
    if by_numbers:
        yield message(
            "verify_by_numbers",
            "written by another version of tankcal; only numbers of five or more digits were "
            "compared: {files}",
            files=by_numbers,
        )


def _sum(result):
    if result.problems:
        count = len(result.problems)
        text = message("verify_disagree", "{count} disagreements", count=count)
        say(message("verify_disagrees", "1 disagreement") if count == 1 else text)
        return
    values = {"count": len(result.compared), "file": result.saved_file,
              "digest": result.digest or result.manifest_sha256}  # fmt: skip
    if result.is_whole:
        say(message("verify_agree", "{count} files compared, all agree: {file} is sha256:{digest}",
                    **values))  # fmt: skip
    else:
        for text in _list_partial(result):
            say(text)
        say(
            message(
                "verify_agree_in_part",
                "{count} files agree within the comparison made: {file} is sha256:{digest}",
                **values,
            )
        )
    if result.manifest_sha256 and result.digest:
        say(message("verify_manifest", "SHA256SUMS is sha256:{digest}",
                    digest=result.manifest_sha256))  # fmt: skip
