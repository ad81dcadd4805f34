"""Evidence of an assessment: the printed certificate, the record, and the files beside them.

The text of a PDF is compared without blanks and hyphens and in Unicode form NFKC, because a PDF
breaks lines, divides words and typesets formulas. The first and last line of each page are its
running head and foot.
"""

import io
import re
import tempfile
import unicodedata
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import date
from functools import cached_property
from pathlib import Path

from tankcal import record as records
from tankcal.errors import InputError, Problem
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.linter.grids import read_pages
from tankcal.report.document import blocks_of
from tankcal.report.laboratory import LETTERHEAD_FILE
from tankcal.report.notebook import TEMPLATES, execute, join_templates, set_parameters
from tankcal.report.outputs import RECORD
from tankcal.report.paper import Paper, ReadRecord
from tankcal.report.papers import parts_without_content
from tankcal.text.shipped import DEFAULT, LANGUAGES

CERTIFICATE = "certificate.pdf"
# Blanks, and the hyphens with which a PDF divides words at the end of a line.
_DROPPED = re.compile(r"[\s\u00ad\u200b\u2010-]+")


def compact(text):
    """Return a text in form NFKC without blanks and hyphens; a minus sign remains.

    Examples
    --------
    >>> compact("U = 0.56 m³")
    'U=0.56m3'
    """
    return _DROPPED.sub("", unicodedata.normalize("NFKC", text))


@dataclass(frozen=True)
class Certificate:
    """A printed certificate.

    Attributes
    ----------
    name : str
        Name of the file.
    path : Path
    pages : tuple of str
        Text of each page.
    language : str
        Language of the PDF, of languages.LANGUAGES; English if not stated.
    """

    name: str
    path: Path
    pages: tuple[str, ...]
    language: str

    @cached_property
    def lines(self):
        """Lines of each page without empty lines (list of list of str)."""
        return [[line.strip() for line in page.splitlines() if line.strip()] for page in self.pages]

    @cached_property
    def body(self):
        """Compact text without running heads and feet."""
        return compact("\n".join(line for page in self.lines for line in page[1:-1]))


@dataclass(frozen=True)
class Evidence:
    """Certificate, record and day of an assessment.

    Attributes
    ----------
    name : str
        Name of the assessed folder or file.
    source : Path
        Folder of results, or the PDF.
    day : date
        Day of the assessment.
    certificate : Certificate or None
    paper : Paper or None
        Formatter of the record, in the language of the certificate; None without a record.
    record, letterhead, rule : dict or None
        The record, the letterhead of the certificate, and the verdict by the rule.
    entries : dict
        Entries of [certificate] of the job.
    """

    name: str
    source: Path
    day: date
    certificate: Certificate | None
    paper: Paper | None
    record: dict | None = None
    letterhead: dict | None = None
    rule: dict | None = None
    entries: dict = field(default_factory=dict)

    @cached_property
    def blocks(self):
        """Blocks of the certificate, set again from the record (list of dict)."""
        folder = self.paper._path.parent
        lacks = parts_without_content(self.record)
        notebook = join_templates(RECORD, lacks, TEMPLATES[:1])
        letterhead = LETTERHEAD_FILE if self.letterhead else None
        values = {"RECORD": str(folder / RECORD), "LANGUAGE": self.certificate.language}
        set_parameters(notebook, values | {"LETTERHEAD": letterhead and str(folder / letterhead)})
        return blocks_of(execute(notebook, folder), "certificate")


@contextmanager
def read_evidence(source, day):
    """Read the evidence of a folder of results, a record.json or a PDF.

    The files that a certificate of tankcal embeds are read like a folder of results.

    Parameters
    ----------
    source : path
        Folder of results, record.json, or PDF of any laboratory.
    day : date
        Day of the assessment.

    Yields
    ------
    Evidence

    Raises
    ------
    InputError
        If neither a certificate nor a record with a capacity table can be read.
    """
    source = Path(source)
    if source.suffix.lower() == ".pdf":
        with tempfile.TemporaryDirectory(prefix="tankcal-") as folder:
            embedded, language = _read_file(source)
            for name, content in embedded.items():
                if Path(name).name == name:
                    (Path(folder) / name).write_bytes(content)
            certificate = _read_certificate(source, language)
            record = Path(folder) / RECORD
            yield _evidence(source, day, certificate, record if record.is_file() else None)
        return
    folder = source.parent if source.name == RECORD else source
    if not (folder / RECORD).is_file():
        text = message(
            "assess_nothing",
            "contains no record.json; expected a folder of results, a record.json or the PDF of a "
            "certificate",
        )
        raise InputError(Problem(str(source), text))
    path = folder / CERTIFICATE
    certificate = _read_certificate(path, _read_file(path)[1]) if path.is_file() else None
    yield _evidence(folder, day, certificate, folder / RECORD)


def _evidence(source, day, certificate, record_path):
    paper = None
    if record_path is not None:
        record = records.load(record_path, is_checked=False)
        if record["capacity"] is None:
            text = message("assess_no_table", "contains no capacity table, so no certificate")
            raise InputError(Problem(record_path.name, text))
        letterhead = record_path.with_name(LETTERHEAD_FILE)
        paper = Paper(
            ReadRecord(record_path, record),
            language=certificate.language if certificate else None,
            letterhead=letterhead if letterhead.is_file() else None,
        )
    name = source.name or str(source)
    if paper is None:
        return Evidence(name, source, day, certificate, None)
    record = paper.record
    return Evidence(
        name, source, day, certificate, paper, record, paper.letterhead, record.get("rule"),
        record["job"]["certificate"],
    )  # fmt: skip


def _read_certificate(path, language):
    log = Log()
    pages = read_pages(path, log, mode="plain")
    log.stop_if_problems()
    return Certificate(path.name, path, pages, language)


def _read_file(path):
    """Return the embedded files of a PDF, {name: bytes}, and its language."""
    import logging

    import pypdf

    logging.getLogger("pypdf").setLevel(logging.CRITICAL)  # suppress its messages
    try:
        reader = pypdf.PdfReader(io.BytesIO(path.read_bytes()))
        language = str(reader.trailer["/Root"].get("/Lang") or "")
        embedded = {str(name): bytes(parts[-1]) for name, parts in reader.attachments.items()}
    except Exception:  # a broken file can raise any exception; read_pages reports it
        return {}, DEFAULT
    return embedded, language if language in LANGUAGES else DEFAULT
