"""Comparisons of `tankcal verify` for each kind of file: hash of the record, and content.

Each function adds discrepancies to a `Verification`.
"""

import io
import re
import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import tankcal
from tankcal.errors import InputError, Problem, TankcalError
from tankcal.messages import message
from tankcal.record.manifest import digest_of
from tankcal.report import dcc, outputs
from tankcal.report.attachments import sha256
from tankcal.report.outputs import RECORD
from tankcal.report.workbook.book import RECORD_PROPERTY

INPUT_CODES = ("verify_input_missing", "verify_input_changed")
_HASH = re.compile(r"sha256:([0-9a-f]{64})")
_DCC = f"{{{dcc.DCC}}}"


def content_of(path):
    """Return the bytes of a file, or None if it does not exist."""
    return path.read_bytes() if path.is_file() else None


def compare_pdf(verification, path):
    """Compare the hash in a PDF and its embedded files.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    path : Path
        The PDF. Its embedded files are compared with the files beside it.

    Returns
    -------
    dict
        Embedded files, {name: bytes}.
    """
    import logging

    import pypdf

    name = path.name
    logging.getLogger("pypdf").setLevel(logging.CRITICAL)  # suppress its messages
    try:
        reader = pypdf.PdfReader(io.BytesIO(path.read_bytes()))
        keywords = str((reader.metadata or {}).get("/Keywords", ""))
        # pathlib does not accept subclasses of str, such as the names that pypdf returns
        embedded = {str(file): bytes(parts[-1]) for file, parts in reader.attachments.items()}
    except Exception as error:  # a broken file can raise any exception
        verification.tell(
            name,
            message(
                "verify_no_pdf",
                "cannot be read as a PDF ({what}); expected one that tankcal wrote",
                what=type(error).__name__,
            ),
        )
        return {}
    if verification.digest is None and RECORD in embedded:
        verification.digest = sha256(embedded[RECORD])
    verification.compared.append(name)
    _same_record(verification, name, keywords)
    for file, embedded_bytes in embedded.items():
        is_name = Path(file).name == file
        bytes_beside = content_of(path.with_name(file)) if is_name else None
        if bytes_beside is not None and bytes_beside != embedded_bytes:
            verification.tell(
                name,
                message(
                    "verify_differs_inside",
                    "holds a {file} inside that differs from the one beside it (SHA-256 {inside} "
                    "and {outside}); expected the same file",
                    file=file,
                    inside=sha256(embedded_bytes)[:12],
                    outside=sha256(bytes_beside)[:12],
                ),
            )
    return embedded


def _same_record(verification, name, text):
    """Report a text that does not state the SHA-256 of the record."""
    named = _HASH.findall(text)
    if not named:
        verification.tell(
            name,
            message(
                "verify_names_none",
                "names no record by its SHA-256; expected one that tankcal wrote, with its record",
            ),
        )
    elif verification.digest not in (None, *named):
        verification.tell(
            name,
            message(
                "verify_other_record",
                "was made of another record: it names {named}, and record.json is {digest} "
                "(SHA-256)",
                named=named[0][:12],
                digest=verification.digest[:12],
            ),
        )


def compare_workbook(verification, name, content):
    """Compare the hash of the record in the properties of an Excel workbook.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    name : str
        Name of the file.
    content : bytes
        Content of the file.
    """
    verification.compared.append(name)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as parts:
            properties = parts.read("docProps/custom.xml").decode("utf-8")
    except (zipfile.BadZipFile, KeyError, OSError, ValueError, RuntimeError, NotImplementedError):
        properties = ""
    place = properties.find(f'name="{RECORD_PROPERTY}"')
    value = re.search(r"[0-9a-f]{64}", properties[place:]) if place >= 0 else None
    _same_record(verification, name, f"sha256:{value[0]}" if value else "")


def compare_certificate(verification, name, content, record):
    """Compare a digital certificate with the record: hash, input files and content.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    name : str
        Name of the file.
    content : bytes
        Content of the file.
    record : dict
        Record of the results.
    """
    verification.compared.append(name)
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        verification.tell(
            name,
            message(
                "verify_no_xml",
                "cannot be read as XML ({what}); expected a digital calibration certificate",
                what=str(error),
            ),
        )
        return
    named = [
        (text, reference)
        for data in root.iter(f"{_DCC}metaData")
        for text in [data.findtext(f"{_DCC}description/{_DCC}content")]
        for reference in [data.findtext(f"{_DCC}reference")]
        if reference
    ]
    # The first record is that of the certificate; an input may be a record as well.
    files = dict(named)
    _same_record(verification, name, dict(reversed(named)).get(RECORD, ""))
    for entry in record["files"]:
        expected = f"sha256:{entry['sha256']}"
        if files.get(" ".join(entry["file"].split()), expected) != expected:
            verification.tell(
                name,
                message(
                    "verify_other_input",
                    "names another SHA-256 of {file} than the record; expected the same",
                    file=entry["file"],
                ),
            )
    if record["tankcal"] == tankcal.__version__ and _version_of(root) == tankcal.__version__:
        _compare_again(verification, name, content, record, root)


def _version_of(root):
    """Return the version of tankcal in a certificate, or None."""
    release = root.findtext(f".//{_DCC}dccSoftware/{_DCC}software/{_DCC}release")
    return release and release.removeprefix("v")


def _compare_again(verification, name, content, record, root):
    """Compare a certificate of this version with the certificate written again."""
    language = root.findtext(f".//{_DCC}mandatoryLangCodeISO639_1")
    try:
        again = dcc.certificate_xml(record, verification.digest, dcc.language_with(language))
    except (TankcalError, LookupError, TypeError, ValueError):
        return  # the loading of the record has reported its problems
    if again != content:
        verification.tell(
            name,
            message(
                "verify_other_content",
                "says something else than the record; expected what tankcal makes of it",
            ),
        )


def compare_page(verification, name, content):
    """Compare the hash in a web page or notebook; pages without certificate have no hash.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    name : str
        Name of the file.
    content : bytes
        Content of the file.
    """
    text = content.decode("utf-8", errors="replace")
    if _HASH.search(text):
        verification.compared.append(name)
        _same_record(verification, name, text)


def compare_tables(verification, folder, record):
    """Compare the CSV files, which contain no hash, with the tables of the record.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    folder : Path
        Folder of the CSV files.
    record : dict
        Record of the results.
    """
    if record["tankcal"] != tankcal.__version__:
        return  # another version may write another format
    present = [
        name for name in outputs.CSV_FILES if name.endswith(".csv") and (folder / name).is_file()
    ]
    with tempfile.TemporaryDirectory(prefix="tankcal-") as again:
        try:
            outputs.write_tables(record, Path(again))
        except (LookupError, TypeError, ValueError, AttributeError):
            text = message("verify_no_tables", "does not have the content of a record")
            raise InputError(Problem(RECORD, text)) from None
        for name in present:
            expected = content_of(Path(again) / name)
            if expected is None:
                continue
            verification.compared.append(name)
            if expected != (folder / name).read_bytes():
                verification.tell(
                    name,
                    message(
                        "verify_other_table",
                        "says something else than the record; expected what tankcal makes of it",
                    ),
                )


def compare_inputs(verification, record, job):
    """Compare the input files, if available, with the hashes in the record.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    record : dict
        Record of the results.
    job : Path
        Folder of the input files.
    """
    places = {entry["file"]: job / entry["file"] for entry in record["files"]}
    present = {file: place for file, place in places.items() if place.is_file()}
    verification.inputs_found = bool(present)
    for entry in record["files"] if present else ():
        name = entry["file"]
        if name not in present:
            verification.tell(
                name,
                message(
                    "verify_input_missing",
                    "is missing beside the other input files; expected the file of the record",
                ),
            )
            continue
        verification.compared.append(name)
        digest = digest_of(present[name])
        if digest != entry["sha256"]:
            verification.tell(
                name,
                message(
                    "verify_input_changed",
                    "was changed after the run: its SHA-256 is {found}, in the record {recorded}",
                    found=digest[:12],
                    recorded=entry["sha256"][:12],
                ),
            )
