"""Whether the files of a run belong together: by the hashes that each of them names.

What is compared is only what is there. That all hashes agree shows that the papers are of this
record, and the record of these input files; who made them, only a signature shows.
"""

import io
import re
import tempfile
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import tankcal
from tankcal import record as records
from tankcal.errors import InputError, Problem, TankcalError
from tankcal.messages import message
from tankcal.report import dcc
from tankcal.report.attachments import KINDS, sha256
from tankcal.report.outputs import RECORD, WORKBOOKS, tables
from tankcal.report.workbook.book import RECORD_PROPERTY

PDFS = ("certificate.pdf", "working-papers.pdf", "field-table.pdf", "report.pdf")
PAGES = ("report.html", "report.ipynb")
_HASH = re.compile(r"sha256:([0-9a-f]{64})")
_DCC = f"{{{dcc.DCC}}}"


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
    """

    digest: str | None = None
    compared: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    inputs_found: bool = False

    def tell(self, name, text):
        """Add a disagreement: the file, and what is wrong with it."""
        self.problems.append(Problem(name, text))


def verify(path, job=None):
    """Compare the files of a folder of results, or a PDF with what it holds inside.

    Parameters
    ----------
    path : path
        Folder of results, or a PDF of one; files beside the PDF are compared with what it holds.
    job : path, optional
        Folder of the input files; None: the one that the results lie in.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        For a path that is neither, and for a record that cannot be read.
    """
    path = Path(path)
    found = Verification()
    if path.is_dir():
        _folder(found, path, Path(job) if job else path.resolve().parent)
    elif path.is_file():
        _file(found, path, Path(job) if job else None)
    else:
        text = message("verify_nothing", "is not there; expected a folder of results or a PDF")
        raise InputError(Problem(path.name or str(path), text))
    return found


def _folder(found, folder, job):
    content = _read(folder / RECORD)
    if content is None:
        text = message("verify_no_record", "is missing; expected the record of the results")
        raise InputError(Problem(RECORD, text))
    record = records.load(folder / RECORD)
    found.digest = sha256(content)
    found.compared.append(RECORD)
    beside = {name: folder / name for name in KINDS}
    for name in PDFS:
        if (folder / name).is_file():
            _pdf(found, name, (folder / name).read_bytes(), beside)
    for name in WORKBOOKS:
        if (folder / name).is_file():
            _workbook(found, name, (folder / name).read_bytes())
    if (folder / dcc.FILE).is_file():
        _certificate(found, dcc.FILE, (folder / dcc.FILE).read_bytes(), record)
    for name in PAGES:
        if (folder / name).is_file():
            _page(found, name, (folder / name).read_bytes())
    _tables(found, folder, record)
    _inputs(found, record, job)


def _file(found, path, job):
    """A PDF with what it holds inside: its record counts, and files beside it are compared."""
    held = _pdf(found, path.name, path.read_bytes(), {n: path.with_name(n) for n in KINDS})
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
        (Path(folder) / RECORD).write_bytes(held[RECORD])
        record = records.load(Path(folder) / RECORD)
    for name in WORKBOOKS:
        if name in held:
            _workbook(found, f"{path.name}: {name}", held[name])
    if dcc.FILE in held:
        _certificate(found, f"{path.name}: {dcc.FILE}", held[dcc.FILE], record)
    if job:
        _inputs(found, record, job)


def _read(path):
    return path.read_bytes() if path.is_file() else None


# ---- one kind of file each


def _pdf(found, name, content, beside):
    """The hash that a PDF names, and what it holds inside; gives {name: bytes} of that."""
    import logging

    import pypdf

    logging.getLogger("pypdf").setLevel(logging.CRITICAL)  # its remarks are not for the terminal
    try:
        reader = pypdf.PdfReader(io.BytesIO(content))
        said = str((reader.metadata or {}).get("/Keywords", ""))
        held = {one: bytes(parts[-1]) for one, parts in reader.attachments.items()}
    except Exception as error:  # of a broken file pypdf raises whatever came of it
        found.tell(
            name,
            message(
                "verify_no_pdf",
                "cannot be read as a PDF ({what}); expected one that tankcal wrote",
                what=type(error).__name__,
            ),
        )
        return {}
    if found.digest is None and RECORD in held:
        found.digest = sha256(held[RECORD])
    found.compared.append(name)
    _same_record(found, name, said)
    for one, bytes_held in held.items():
        place = beside.get(one)
        lies_beside = _read(place) if place else None
        if lies_beside is not None and lies_beside != bytes_held:
            found.tell(
                name,
                message(
                    "verify_differs_inside",
                    "holds a {file} inside that differs from the one beside it (SHA-256 {inside} "
                    "and {outside}); expected the same file",
                    file=one,
                    inside=sha256(bytes_held)[:12],
                    outside=sha256(lies_beside)[:12],
                ),
            )
    return held


def _same_record(found, name, said):
    """Whether a text names the SHA-256 of the record."""
    named = _HASH.findall(said)
    if not named:
        found.tell(
            name,
            message(
                "verify_names_none",
                "names no record by its SHA-256; expected one that tankcal wrote, with its record",
            ),
        )
    elif found.digest not in (None, *named):
        found.tell(
            name,
            message(
                "verify_other_record",
                "was made of another record: it names {named}, and record.json is {digest} "
                "(SHA-256)",
                named=named[0][:12],
                digest=found.digest[:12],
            ),
        )


def _workbook(found, name, content):
    """The property of the workbook that names its record."""
    found.compared.append(name)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as parts:
            said = parts.read("docProps/custom.xml").decode("utf-8")
    except (zipfile.BadZipFile, KeyError, OSError, ValueError, RuntimeError, NotImplementedError):
        said = ""
    place = said.find(f'name="{RECORD_PROPERTY}"')
    value = re.search(r"[0-9a-f]{64}", said[place:]) if place >= 0 else None
    _same_record(found, name, f"sha256:{value[0]}" if value else "")


def _certificate(found, name, content, record):
    """The digital certificate: its record, its input files, and that it is of that record."""
    found.compared.append(name)
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        found.tell(
            name,
            message(
                "verify_no_xml",
                "cannot be read as XML ({what}); expected a digital calibration certificate",
                what=str(error),
            ),
        )
        return
    files = {
        text: reference
        for one in root.iter(f"{_DCC}metaData")
        for text in [one.findtext(f"{_DCC}description/{_DCC}content")]
        for reference in [one.findtext(f"{_DCC}reference")]
        if reference
    }
    _same_record(found, name, files.get(RECORD, ""))
    for one in record["files"]:
        expected = f"sha256:{one['sha256']}"
        if files.get(" ".join(one["file"].split()), expected) != expected:
            found.tell(
                name,
                message(
                    "verify_other_input",
                    "names another SHA-256 of {file} than the record; expected the same",
                    file=one["file"],
                ),
            )
    if record["tankcal"] == tankcal.__version__ and _written_by(root) == tankcal.__version__:
        _made_again(found, name, content, record, root)


def _written_by(root):
    """The version of tankcal that wrote a certificate; None where it does not say."""
    release = root.findtext(f".//{_DCC}dccSoftware/{_DCC}software/{_DCC}release")
    return release and release.removeprefix("v")


def _made_again(found, name, content, record, root):
    """Whether the certificate is what the record gives, where this version wrote both."""
    language = root.findtext(f".//{_DCC}mandatoryLangCodeISO639_1")
    try:
        again = dcc.certificate_xml(record, found.digest, dcc.language_with(language))
    except (TankcalError, LookupError, TypeError, ValueError):
        return  # a record that says otherwise was told of where it was loaded
    if again != content:
        found.tell(
            name,
            message(
                "verify_other_content",
                "says something else than the record; expected what tankcal makes of it",
            ),
        )


def _page(found, name, content):
    """Web page and notebook print the hash on the certificate; those of a survey alone do not."""
    said = content.decode("utf-8", errors="replace")
    if _HASH.search(said):
        found.compared.append(name)
        _same_record(found, name, said)


def _tables(found, folder, record):
    """The CSV files, which hold no hash: whether they are those that the record gives."""
    if record["tankcal"] != tankcal.__version__:
        return  # another version may have written them otherwise
    there = [name for name in tables.FILES if name.endswith(".csv") and (folder / name).is_file()]
    with tempfile.TemporaryDirectory(prefix="tankcal-") as again:
        try:
            tables.write_tables(record, Path(again))
        except (LookupError, TypeError, ValueError, AttributeError):
            text = message("verify_no_tables", "does not have the content of a record")
            raise InputError(Problem(RECORD, text)) from None
        for name in there:
            expected = _read(Path(again) / name)
            if expected is None:
                continue
            found.compared.append(name)
            if expected != (folder / name).read_bytes():
                found.tell(
                    name,
                    message(
                        "verify_other_table",
                        "says something else than the record; expected what tankcal makes of it",
                    ),
                )


def _inputs(found, record, job):
    """The input files, by the hashes of the record, where the job is at hand."""
    places = {one["file"]: job / one["file"] for one in record["files"]}
    there = {file: place for file, place in places.items() if place.is_file()}
    found.inputs_found = bool(there)
    for one in record["files"] if there else ():
        name = one["file"]
        if name not in there:
            found.tell(
                name,
                message(
                    "verify_input_missing",
                    "is missing beside the other input files; expected the file of the record",
                ),
            )
            continue
        found.compared.append(name)
        digest = _digest_of(there[name])
        if digest != one["sha256"]:
            found.tell(
                name,
                message(
                    "verify_input_changed",
                    "was changed after the run: its SHA-256 is {found}, in the record {recorded}",
                    found=digest[:12],
                    recorded=one["sha256"][:12],
                ),
            )


def _digest_of(path):
    """SHA-256 of a file of any size."""
    import hashlib

    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
