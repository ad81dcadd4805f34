"""What `tankcal verify` compares of each kind of file: the record that it names, what it says.

Each function tells a `Verification`, here `found`, what does not agree.
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
from tankcal.report import dcc
from tankcal.report.attachments import sha256
from tankcal.report.outputs import RECORD, tables
from tankcal.report.workbook.book import RECORD_PROPERTY

INPUT_CODES = ("verify_input_missing", "verify_input_changed")
_HASH = re.compile(r"sha256:([0-9a-f]{64})")
_DCC = f"{{{dcc.DCC}}}"


def content_of(path):
    """Bytes of a file; None where there is none."""
    return path.read_bytes() if path.is_file() else None


def compare_pdf(found, name, content, beside):
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
        lies_beside = content_of(place) if place else None
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


def compare_workbook(found, name, content):
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


def compare_certificate(found, name, content, record):
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


def compare_page(found, name, content):
    """Web page and notebook print the hash on the certificate; those of a survey alone do not."""
    said = content.decode("utf-8", errors="replace")
    if _HASH.search(said):
        found.compared.append(name)
        _same_record(found, name, said)


def compare_tables(found, folder, record):
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
            expected = content_of(Path(again) / name)
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


def compare_inputs(found, record, job):
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
        digest = digest_of(there[name])
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
