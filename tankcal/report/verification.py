"""Whether the files of a run belong together, and come out again.

By the hashes that each of them names, by SHA256SUMS, by making the papers again from the record,
and by computing the record again from the input files. That all agree shows that the papers are of
this record, and the record of these input files; who made them, only a signature shows.
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
from tankcal.report.attachments import KINDS, sha256
from tankcal.report.outputs import RECORD, WORKBOOKS
from tankcal.report.verified_again import (
    compute_numbers_again,
    make_papers_again,
    saved_folder,
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
    """What was compared, and what does not agree.

    Attributes
    ----------
    digest : str or None
        SHA-256 of the record that all was compared with; None: there is none.
    compared : list of str
        Names of files, as they were found to be of that record, or not.
    problems : list of Problem
        One for each disagreement.
    inputs_found : bool
        Whether any input file of the job was at hand.
    saved_file : str
        Name of the file that all else was made from.
    manifest_sha256 : str or None
        SHA-256 of SHA256SUMS; None: there is none.
    papers_again : bool
        Whether the papers were made again.
    recomputed : record.recomputation.Recomputation or None
        What came of computing the job again; None: it was not.
    notes : list of Message
        What could not be verified, and why.
    made_again : set of str
        Names of files that were compared with the same made or computed again.
    by_hash, by_numbers : list of str
        Names of files of which only the hash was compared, or only the numbers of many digits.
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
        """Add a disagreement: the file, and what is wrong with it."""
        self.problems.append(Problem(name, text))

    def note(self, text):
        """Add something that could not be verified."""
        self.notes.append(text)

    @property
    def is_whole(self):
        """Whether all was compared with what it was made of, and the record computed again."""
        is_record = self.saved_file == RECORD
        return not (self.by_hash or self.by_numbers) and (self.recomputed or not is_record)

    def is_told(self, name):
        """Whether something is wrong with a file."""
        return any(one.file == name for one in self.problems)

    def add_compared(self, name):
        """Count a file once."""
        if name not in self.compared:
            self.compared.append(name)


def verify(path, job=None, *, hashes_only=False, step=None, part=None):
    """Compare the files of a folder of results, or a PDF with what it holds inside.

    Parameters
    ----------
    path : path
        Folder of results, of a comparison, an inspection, a history, a plan or the camera; or a
        PDF of results: files beside it are compared with what it holds.
    job : path, optional
        Folder of the input files, or the job's workbook; None: the folder that the results lie in.
    hashes_only : bool, optional
        True: no paper is made again, and no number computed again.
    step, part : callable, optional
        Progress: step(text), part(text, done, total).

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        For a path that is neither, and for a saved file that cannot be read.
    """
    path = Path(path)
    found = Verification()
    again = None if hashes_only else (step, part)
    if path.is_dir():
        inputs = input_folder(job) if job else path.resolve().parent
        _folder(found, path, inputs, again)
    elif path.is_file():
        _file(found, path, input_folder(job) if job else None, again)
    else:
        text = message("verify_nothing", "is not there; expected a folder of results or a PDF")
        raise InputError(Problem(path.name or str(path), text))
    return found


def _folder(found, folder, job, again):
    manifest = read_manifest(folder)
    found.manifest_sha256 = manifest and manifest.sha256
    if (folder / RECORD).is_file():
        _results(found, folder, job, again, manifest)
    elif not saved_folder(found, folder, again, manifest):
        text = message("verify_no_record", "is missing; expected the record of the results")
        raise InputError(Problem(RECORD, text))
    _listed(found, folder, manifest)
    proved = {*found.made_again, RECORD, TABLES}  # the record names the hash of its long tables
    found.by_hash = [name for name in files_below(folder) if name not in proved]


def _results(found, folder, job, again, manifest):
    """A folder of results: by the hashes that its files name, its papers and numbers made again."""
    record = records.load(folder / RECORD, is_checked=False)
    found.digest = sha256((folder / RECORD).read_bytes())
    found.compared.append(RECORD)
    told = problems_of_tables(record)
    found.problems += told
    beside = {name: folder / name for name in KINDS}
    for name in PDFS:
        if (folder / name).is_file():
            compare_pdf(found, name, (folder / name).read_bytes(), beside)
    for name in WORKBOOKS:
        if (folder / name).is_file():
            compare_workbook(found, name, (folder / name).read_bytes())
    if (folder / dcc.FILE).is_file():
        compare_certificate(found, dcc.FILE, (folder / dcc.FILE).read_bytes(), record)
    for name in PAGES:
        if (folder / name).is_file():
            compare_page(found, name, (folder / name).read_bytes())
    if not told:
        compare_tables(found, folder, record)
    compare_inputs(found, record, job)
    if again is None or told:
        return
    _numbers(found, record, job, folder, again)

    def rebuild(place, language, letterhead):
        outputs.rebuild(folder / RECORD, place, again[1], language, letterhead)

    papers = (*PDFS, *WORKBOOKS, dcc.FILE, *PAGES)
    if any((folder / name).is_file() for name in papers):  # not of a run without papers
        versions = {"tankcal": record["tankcal"], **record["versions"]}
        make_papers_again(found, folder, manifest, rebuild, versions)


def _numbers(found, record, job, folder, again):
    """Compute the job again where all of its input files are those of the record."""
    files = {one["file"] for one in record["files"]}
    if not found.inputs_found:
        return
    if any(one.file in files and one.expected.code in INPUT_CODES for one in found.problems):
        text = message(
            "verify_inputs_differ",
            "the input files are not those of the record: nothing was computed again",
        )
        found.note(text)
        return
    step, part = again
    compute_numbers_again(found, record, job, folder=folder, step=step, part=part)


def _listed(found, folder, manifest):
    """Every file of the folder by SHA256SUMS: missing, extra, altered."""
    if manifest is None:
        text = message(
            "verify_no_manifest_here",
            "no SHA256SUMS, which lists every file: files that are missing, extra or altered may "
            "not be seen",
        )
        found.note(text)
        return
    there = files_below(folder)
    for name in manifest.digests:
        if name not in there and not found.is_told(name):
            text = message("verify_missing", "is missing; SHA256SUMS lists it")
            found.tell(name, text)
    for name in there:
        if name not in manifest.digests:
            text = message("verify_extra", "is extra; SHA256SUMS does not list it")
            found.tell(name, text)
            continue
        found.add_compared(name)
        if not found.is_told(name) and not _is_listed(folder / name, manifest.digests[name]):
            text = message(
                "verify_altered", "was altered: its SHA-256 is not the one in SHA256SUMS"
            )
            found.tell(name, text)


def _is_listed(path, digest):
    """Whether something is a file, no pipe or broken link, of that SHA-256."""
    return path.is_file() and digest_of(path) == digest


def _file(found, path, job, again):
    """A PDF with what it holds inside: its record counts, and files beside it are compared."""
    held = compare_pdf(found, path.name, path.read_bytes(), {n: path.with_name(n) for n in KINDS})
    if RECORD not in held:
        if not found.problems:
            text = message(
                "verify_none_inside",
                "holds no record.json inside; expected a certificate or report of tankcal, or the "
                "folder of results",
            )
            raise InputError(Problem(path.name, text))
        return
    with tempfile.TemporaryDirectory(prefix="tankcal-") as folder:
        tables = held.get(TABLES) or content_of(path.with_name(TABLES))
        for name, content in ((RECORD, held[RECORD]), (TABLES, tables)):
            if content is not None:
                (Path(folder) / name).write_bytes(content)
        record = records.load(Path(folder) / RECORD, is_checked=False)
        told = problems_of_tables(record)  # reads them while they are there
    for name in WORKBOOKS:
        if name in held:
            compare_workbook(found, f"{path.name}: {name}", held[name])
    if dcc.FILE in held:
        compare_certificate(found, f"{path.name}: {dcc.FILE}", held[dcc.FILE], record)
    if job:
        compare_inputs(found, record, job)
        if told and again is not None:
            _note_missing_tables(found)
        elif again is not None:
            _numbers(found, record, job, None, again)


def _note_missing_tables(found):
    found.note(
        message(
            "verify_tables_not_inside",
            "the long tables of the record are neither inside the PDF nor beside it: nothing was "
            "computed again; verify the folder of the results",
        )
    )
