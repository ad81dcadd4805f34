"""Verification of the files of a run.

The verification has four parts: hashes that the files state, SHA256SUMS, the papers written again
from the record, and the record computed again from the input files. If everything agrees, the
papers belong to the record and the record to the input files. Only a signature proves who wrote
them.
"""

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from tankcal import record as records
from tankcal.errors import InputError, Problem
from tankcal.messages import Message, message
from tankcal.record.long_tables import FILE as TABLES
from tankcal.record.long_tables import problems_of_tables
from tankcal.record.manifest import digest_of, files_below, read_manifest
from tankcal.record.recomputation import Recomputation, input_folder
from tankcal.report import dcc, outputs
from tankcal.report.attachments import sha256
from tankcal.report.outputs import RECORD, WORKBOOKS
from tankcal.report.verified_again import (
    compute_numbers_again,
    make_papers_again,
    verify_saved_folder,
)
from tankcal.report.verified_files import (
    INPUT_CODES,
    compare_certificate,
    compare_inputs,
    compare_page,
    compare_pdf,
    compare_tables,
    compare_workbook,
    content_of,
)

PDFS = ("certificate.pdf", "working-papers.pdf", "field-table.pdf", "report.pdf")
PAGES = ("report.html", "report.ipynb")


@dataclass
class Verification:
    """Result of a verification.

    Attributes
    ----------
    digest : str or None
        SHA-256 of the record; None: no record exists.
    compared : list of str
        Names of the compared files.
    problems : list of Problem
        Discrepancies.
    inputs_found : bool
        Whether an input file of the job was available.
    saved_file : str
        Name of the file from which all other files are derived.
    manifest_sha256 : str or None
        SHA-256 of SHA256SUMS; None: the file does not exist.
    papers_again : bool
        Whether the papers were written again.
    recomputed : record.recomputation.Recomputation or None
        Result of the recomputation; None: the job was not computed again.
    notes : list of Message
        Checks that were not possible, with the reasons.
    made_again : set of str
        Names of the files that were compared with a new version of their content.
    by_hash, by_numbers : list of str
        Names of the files of which only the hash, or only the numbers with many digits, were
        compared.
    """

    digest: str | None = None
    compared: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    inputs_found: bool = False
    saved_file: str = RECORD
    manifest_sha256: str | None = None
    papers_again: bool = False
    recomputed: Recomputation | None = None
    notes: list[Message] = field(default_factory=list)
    made_again: set[str] = field(default_factory=set)
    by_hash: list[str] = field(default_factory=list)
    by_numbers: list[str] = field(default_factory=list)

    def tell(self, name, text):
        """Add a discrepancy of a file."""
        self.problems.append(Problem(name, text))

    def note(self, text):
        """Add a message on a check that was not possible."""
        self.notes.append(text)

    @property
    def is_whole(self):
        """Whether all files were compared with their sources and the record was computed again."""
        is_record = self.saved_file == RECORD
        return not (self.by_hash or self.by_numbers) and (self.recomputed or not is_record)

    def is_told(self, name):
        """Return whether a file has a discrepancy."""
        return any(problem.file == name for problem in self.problems)

    def add_compared(self, name):
        """Add a file to the compared files, once."""
        if name not in self.compared:
            self.compared.append(name)


def verify(path, job=None, *, hashes_only=False, step=None, part=None):
    """Verify a folder of results, or a PDF with its embedded files.

    Parameters
    ----------
    path : path
        Folder of results of a job, a comparison, an inspection, a history, a plan or a camera. Or
        a PDF, whose embedded files are compared with the files beside it.
    job : path, optional
        Folder of the input files, or the Excel workbook of the job; None: the parent folder of the
        results.
    hashes_only : bool, optional
        True: compare hashes only; write no papers and compute no numbers again.
    step, part : callable, optional
        Progress: step(text), part(text, done, total).

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        If the path is neither of the two, or if a saved file cannot be read.
    """
    path = Path(path)
    verification = Verification()
    callbacks = None if hashes_only else (step, part)
    if path.is_dir():
        inputs = input_folder(job) if job else path.resolve().parent
        _folder(verification, path, inputs, callbacks)
    elif path.is_file():
        _file(verification, path, input_folder(job) if job else None, callbacks)
    else:
        text = message("verify_nothing", "is not there; expected a folder of results or a PDF")
        raise InputError(Problem(path.name or str(path), text))
    return verification


def _folder(verification, folder, job, callbacks):
    """Verify a folder; `callbacks` is (step, part), or None to compare hashes only."""
    manifest = read_manifest(folder)
    verification.manifest_sha256 = manifest and manifest.sha256
    if (folder / RECORD).is_file():
        _results(verification, folder, job, callbacks, manifest)
    elif not verify_saved_folder(verification, folder, callbacks, manifest, job):
        text = message("verify_no_record", "is missing; expected the record of the results")
        raise InputError(Problem(RECORD, text))
    _compare_manifest(verification, folder, manifest)
    # The record states the hash of its long tables.
    proved = {*verification.made_again, RECORD, TABLES}
    verification.by_hash = [name for name in files_below(folder) if name not in proved]


def _results(verification, folder, job, callbacks, manifest):
    """Verify a folder with a record: hashes, papers and numbers."""
    record = records.load(folder / RECORD, is_checked=False)
    verification.digest = sha256((folder / RECORD).read_bytes())
    verification.compared.append(RECORD)
    table_problems = problems_of_tables(record)
    verification.problems += table_problems
    for name in PDFS:
        if (folder / name).is_file():
            compare_pdf(verification, folder / name)
    for name in WORKBOOKS:
        if (folder / name).is_file():
            compare_workbook(verification, name, (folder / name).read_bytes())
    if (folder / dcc.FILE).is_file():
        compare_certificate(verification, dcc.FILE, (folder / dcc.FILE).read_bytes(), record)
    for name in PAGES:
        if (folder / name).is_file():
            compare_page(verification, name, (folder / name).read_bytes())
    if not table_problems:
        compare_tables(verification, folder, record)
    compare_inputs(verification, record, job)
    if callbacks is None or table_problems:
        return
    _numbers(verification, record, job, folder, callbacks)

    def rebuild(place, language, letterhead):
        outputs.rebuild(folder / RECORD, place, callbacks[1], language, letterhead)

    papers = (*PDFS, *WORKBOOKS, dcc.FILE, *PAGES)
    if any((folder / name).is_file() for name in papers):  # a run may have no papers
        versions = {"tankcal": record["tankcal"], **record["versions"]}
        make_papers_again(verification, folder, manifest, rebuild, versions)


def _numbers(verification, record, job, folder, callbacks):
    """Compute the job again if its input files agree with the record."""
    files = {entry["file"] for entry in record["files"]}
    if not verification.inputs_found:
        return
    if any(
        problem.file in files and problem.expected.code in INPUT_CODES
        for problem in verification.problems
    ):
        text = message(
            "verify_inputs_differ",
            "the input files are not those of the record: nothing was computed again",
        )
        verification.note(text)
        return
    step, part = callbacks
    compute_numbers_again(verification, record, job, folder=folder, step=step, part=part)


def _compare_manifest(verification, folder, manifest):
    """Report missing, extra and altered files according to SHA256SUMS."""
    if manifest is None:
        text = message(
            "verify_no_manifest_here",
            "no SHA256SUMS, which lists every file: files that are missing, extra or altered may "
            "not be seen",
        )
        verification.note(text)
        return
    present = files_below(folder)
    for name in manifest.digests:
        if name not in present and not verification.is_told(name):
            text = message("verify_missing", "is missing; SHA256SUMS lists it")
            verification.tell(name, text)
    for name in present:
        if name not in manifest.digests:
            text = message("verify_extra", "is extra; SHA256SUMS does not list it")
            verification.tell(name, text)
            continue
        verification.add_compared(name)
        is_listed = (path := folder / name).is_file() and digest_of(path) == manifest.digests[name]
        if not is_listed and not verification.is_told(name):
            text = message(
                "verify_altered", "was altered: its SHA-256 is not the one in SHA256SUMS"
            )
            verification.tell(name, text)


def _file(verification, path, job, callbacks):
    """Verify a PDF by its embedded record; compare the embedded files with the files beside it."""
    embedded = compare_pdf(verification, path)
    if RECORD not in embedded:
        if not verification.problems:
            text = message(
                "verify_none_inside",
                "holds no record.json inside; expected a certificate or report of tankcal, or the "
                "folder of results",
            )
            raise InputError(Problem(path.name, text))
        return
    with tempfile.TemporaryDirectory(prefix="tankcal-") as folder:
        tables = embedded.get(TABLES) or content_of(path.with_name(TABLES))
        for name, content in ((RECORD, embedded[RECORD]), (TABLES, tables)):
            if content is not None:
                (Path(folder) / name).write_bytes(content)
        record = records.load(Path(folder) / RECORD, is_checked=False)
        # Reads the tables while the temporary folder exists.
        table_problems = problems_of_tables(record)
    for name in WORKBOOKS:
        if name in embedded:
            compare_workbook(verification, f"{path.name}: {name}", embedded[name])
    if dcc.FILE in embedded:
        compare_certificate(verification, f"{path.name}: {dcc.FILE}", embedded[dcc.FILE], record)
    if job:
        compare_inputs(verification, record, job)
        if table_problems and callbacks is not None:
            _note_missing_tables(verification)
        elif callbacks is not None:
            _numbers(verification, record, job, None, callbacks)


def _note_missing_tables(verification):
    verification.note(
        message(
            "verify_tables_not_inside",
            "the long tables of the record are neither inside the PDF nor beside it: nothing was "
            "computed again; verify the folder of the results",
        )
    )
