"""Files embedded in a PDF, byte for byte: the record and the files derived from it.

The typesetter would compress each file again for each paper. It therefore receives the SHA-256
digests of the files and writes all entries that describe a file. Each digest is then replaced by
its file, which is compressed once for all papers of a run.
"""

import hashlib
import re
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Lock

from tankcal.errors import TankcalError
from tankcal.report.pdf_objects import objects_of

KINDS = {  # suffix of the file: MIME type, relationship to the paper (PDF 2.0, 7.11.3)
    ".json": ("application/json", "source"),
    ".npz": ("application/zip", "source"),
    ".xlsx": ("application/vnd.openxmlformats-officedocument.spreadsheetml.sheet", "data"),
    ".csv": ("text/csv", "data"),
    ".xml": ("text/xml", "alternative"),
}
OF_RECORD = (
    *("record.json", "record_tables.npz"),
    *("capacity.xlsx", "adjustment.xlsx", "certificate.xml"),
)
LARGEST = 20_000_000  # bytes; a larger file is not embedded, and the PDF states its digest only
LARGEST_PACKED = 5_000_000  # bytes; largest file of long tables that is embedded
ZIP = b"PK\x03\x04"  # first bytes of a file that is already compressed
LEVEL = 1  # level of compression; level 6 of the typesetter takes five times as long for 6 % less
_TYPE, _DEFLATED = b"/Type/EmbeddedFile", b"/Filter/FlateDecode"
# An embedded file as typst writes it: filter, description, size, content.
_HELD = re.compile(
    rb"<</Length \d+/Type/EmbeddedFile(/Filter/FlateDecode)?(/Subtype/[^/<>]+/Params<</Size )\d+"
    rb"([^<>]*>>>>\nstream\n)(.+)\nendstream",
    re.DOTALL,
)


@dataclass(frozen=True)
class Attachment:
    """Description of a file in the folder of the notebook, with its SHA-256."""

    name: str
    mime: str
    relationship: str
    description: str
    sha256: str

    def data(self):
        """Return the attachment as a dict for a document block."""
        return asdict(self)


def beside(folder, described):
    """Return an Attachment for each existing file that is small enough for a PDF.

    Parameters
    ----------
    folder : str or Path
        Folder of the files.
    described : dict
        {name of the file: description}.

    Returns
    -------
    list of Attachment
    """
    paths = [Path(folder) / name for name in described]
    return [
        Attachment(path.name, *KINDS[path.suffix], described[path.name], sha256(path.read_bytes()))
        for path in paths
        if path.is_file()
        and path.stat().st_size <= (LARGEST_PACKED if path.suffix == ".npz" else LARGEST)
    ]


def contents(blocks, folder):
    """Read the files that the document blocks attach.

    Parameters
    ----------
    blocks : list of dict
        Blocks of a paper.
    folder : str or Path
        Folder of the notebook and of the files.

    Returns
    -------
    dict
        {name: (SHA-256, bytes)}.

    Raises
    ------
    TankcalError
        If a file is absent or has changed since the notebook was executed.
    """
    files = {}
    for file in named(blocks):
        path = Path(folder) / file["name"]
        if Path(file["name"]).name != file["name"] or not path.is_file():
            raise TankcalError(
                f"the PDF holds {file['name']!r} inside, and there is no such file beside the "
                "notebook; expected it there"
            )
        content = path.read_bytes()
        files[file["name"]] = file["sha256"], content
        if sha256(content) != file["sha256"]:
            raise TankcalError(
                f"{file['name']} beside the notebook was changed since the notebook was executed; "
                "execute it again"
            )
    return files


class Packed:
    """Compressed files of a run; each file is compressed once for all PDFs."""

    def __init__(self):
        self._streams, self._lock = {}, Lock()

    def stream(self, digest, content):
        """Return (filter entry, stream) of the file with this SHA-256."""
        with self._lock:  # a second paper waits for the compression by the first
            if digest not in self._streams:
                zipped = content.startswith(ZIP)
                self._streams[digest] = (
                    (b"", content) if zipped else (_DEFLATED, zlib.compress(content, LEVEL))
                )
            return self._streams[digest]


def hold(pdf, files, packed):
    """Replace the digests in a PDF by the files themselves.

    Parameters
    ----------
    pdf : bytes
        PDF of typst, with a digest as the content of each embedded file.
    files : dict
        Files to embed, {SHA-256: bytes}.
    packed : Packed
        Compressed files of the run.

    Returns
    -------
    bytes or None
        None if the PDF does not contain all digests in the expected form.
    """
    objects = objects_of(pdf)
    if objects is None:
        return None
    # Find each embedded file by its type entry, and its digest in the stream of the object.
    changed, missing, position = {}, set(files), pdf.find(_TYPE)
    while position >= 0:
        number, stream = objects.around(position) or (None, b"")
        match = _HELD.fullmatch(stream)
        digest = match and _unpacked(*match.group(1, 4))
        if digest in files:
            changed[number] = _stream(match, packed.stream(digest, files[digest]), files[digest])
            missing.discard(digest)
        position = pdf.find(_TYPE, position + len(_TYPE))
    return None if missing else objects.with_contents(changed)


def _unpacked(deflated, content):
    """Return the text of a stream, decompressed if necessary."""
    return (zlib.decompress(content) if deflated else content).decode("ascii", "replace")


def _stream(match, packed, content):
    """Return the PDF object of a file: the object of its digest with a new size and stream."""
    (deflated, stream), (_, kind, rest, _) = packed, match.groups()
    head = b"<</Length %d/Type/EmbeddedFile%s%s%d%s"
    head %= len(stream), deflated, kind, len(content), rest
    return b"%s%s\nendstream" % (head, stream)


def named(blocks):
    """Return the attachments of all document blocks (list of dict), each file once."""
    documents = [block for block in blocks if block["kind"] == "document"]
    return list(
        {
            attachment["name"]: attachment
            for block in documents
            for attachment in block.get("attachments", [])
        }.values()
    )


def sha256(data):
    """Return the SHA-256 of bytes as hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
