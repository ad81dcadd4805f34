"""Files embedded in a PDF, byte for byte: the record and the files derived from it.

The typesetter would compress each file again for each paper. It therefore receives the SHA-256
digests of the files and writes all entries that describe a file. Each digest is then replaced by
its file, which is compressed once for all papers of a run.

Objects of a PDF of typst: their positions and contents, and a field for an electronic signature.

page.typ sets a link at the place of the signature. An incremental update (ISO 32000-1, 7.5.6)
replaces the annotation of the link by the widget of a signature field. It also replaces the tag
`Link` by `Form`. Position, page and order remain unchanged, so that the file still conforms to
PDF/A-3a and PDF/UA-1.
"""

import hashlib
import re
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Lock

from tankcal.errors import TankcalError

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
_START = re.compile(rb"startxref\n(\d+)\n%%EOF\s*\Z")
_END = 64  # bytes at the end of the file, which contain the position of the cross-reference table
_TABLE = re.compile(rb"xref\s+0 (\d+)\r?\n")
_LINE, _DIGITS = 20, 10  # bytes of an entry of the table and of its position
SIGNATURE_LINK = b"/URI(tankcal:signature)"  # link of page.typ at the place of the signature
FIELD_NAME = "signature"  # name of the field in the PDF
_PRINTED = 4  # annotation flag: print


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


# ---- objects of a PDF of typst


@dataclass(frozen=True)
class Objects:
    """Positions of the objects of a PDF (ISO 32000-1, 7.5.4).

    Attributes
    ----------
    pdf : bytes
        The file.
    table : int
        Position of the cross-reference table.
    lines : int
        Position of the first entry of the table.
    places : list of int
        Position of each object, by its number; 0 for an unused number.
    """

    pdf: bytes
    table: int
    lines: int
    places: list[int]

    @property
    def trailer(self):
        """Content after the cross-reference table."""
        return self.pdf[self.lines + _LINE * len(self.places) :]

    def around(self, at):
        """Return (number, content) of the object at a position; None for a negative position."""
        if at < 0:
            return None
        head = self.pdf.rfind(b" 0 obj", 0, at)
        number = int(self.pdf[self.pdf.rfind(b"\n", 0, head) + 1 : head])
        content = self.content(number)
        return content and (number, content)

    def content(self, number):
        """Return the content between `obj` and `endobj`; None if the table is wrong."""
        head, start = head_of(number), self.places[number]
        if not self.pdf.startswith(head, start):
            return None
        return self.pdf[start + len(head) : self.pdf.index(b"\nendobj", start)]

    def with_contents(self, changed):
        """Return the PDF with new contents of some objects, {number: bytes}.

        Numbers from `len(places)` on, without gaps, add objects.
        """
        if not changed:
            return self.pdf
        count = len(self.places)
        first = min(self.places[number] for number in changed if number < count)
        later_objects = sorted((place, i) for i, place in enumerate(self.places) if place >= first)
        entries = bytearray(self.pdf[self.lines : self.lines + _LINE * len(self.places)])
        # Each replaced object shifts all later objects by the change of its length.
        pieces, copied_to, shift = [], 0, 0
        for place, number in later_objects:
            entries[_LINE * number : _LINE * number + _DIGITS] = b"%010d" % (place + shift)
            if number in changed:
                start, former = place + len(head_of(number)), self.content(number)
                pieces += [self.pdf[copied_to:start], changed[number]]
                copied_to = start + len(former)
                shift += len(changed[number]) - len(former)
        pieces.append(self.pdf[copied_to : self.table])
        place = self.table + shift
        for number in sorted(number for number in changed if number >= count):
            pieces.append(b"%s%s\nendobj\n" % (head_of(number), changed[number]))
            entries += b"%010d 00000 n\r\n" % place
            place += len(pieces[-1])
            count += 1
        head, trailer = self.pdf[self.table : self.lines], self.trailer
        for key, former, new in (
            (b"startxref\n%d", self.table, place),
            (b"/Size %d", len(self.places), count),
        ):
            trailer = trailer.replace(key % former, key % new)
        head = head.replace(b"0 %d" % len(self.places), b"0 %d" % count)
        return b"".join([*pieces, head, entries, trailer])


def objects_of(pdf):
    """Return the Objects of a PDF with a cross-reference table; None for another form."""
    start = _START.search(pdf[-_END:])
    table = start and int(start[1])
    head = start and _TABLE.match(pdf, table)
    if not head:
        return None
    lines, count = head.end(), int(head[1])
    entries = pdf[lines : lines + _LINE * count]
    places = [int(entries[i : i + _DIGITS]) for i in range(0, _LINE * count, _LINE)]
    return Objects(pdf, table, lines, places)


def head_of(number):
    """Return the first line of an object."""
    return b"%d 0 obj\n" % number


# ---- signature field


def with_signature_field(pdf, name):
    """Replace the signature link of a PDF by a signature field.

    Parameters
    ----------
    pdf : bytes
        PDF of typst. A file without the link, or of another form, remains unchanged.
    name : str
        Description of the field for readers who cannot see it.

    Returns
    -------
    bytes
        The PDF with an incremental update; the result is reproducible.
    """
    position = pdf.find(SIGNATURE_LINK)
    objects = objects_of(pdf)
    if position < 0 or objects is None:
        return pdf
    annotation = objects.around(position)
    tag = annotation and objects.around(pdf.find(b"/Obj %d 0 R" % annotation[0]))
    root = re.search(rb"/Root (\d+) 0 R", objects.trailer)
    catalog = root and objects.content(int(root[1]))
    parts = _parts_of_link(annotation, tag)
    if parts is None or catalog is None or b"/AcroForm" in catalog:
        return pdf
    # The tag becomes a form, and the catalogue lists the field.
    changed = {
        tag[0]: tag[1].replace(b"/S/Link", b"/S/Form", 1),
        int(root[1]): catalog[: catalog.rindex(b">>")]
        + b"/AcroForm<</Fields[%d 0 R]/SigFlags 1>>>>" % annotation[0],
    }
    appearance = len(objects.places)
    changed[annotation[0]], changed[appearance] = _signature_widget(name, parts, appearance)
    return pdf + _incremental_update(objects, changed)


def _signature_widget(name, parts, appearance):
    """Return the widget of the field and its empty appearance before the signature."""
    rectangle, parent, page = parts
    left, bottom, right, top = map(float, rectangle.split())
    widget = (
        b"<</Type/Annot/Subtype/Widget/FT/Sig/T(%s)/TU%s/Rect[%s]/F %d/P %s/StructParent %s"
        b"/AP<</N %d 0 R>>>>"
        % (
            FIELD_NAME.encode(),
            b"<FEFF%s>" % name.encode("utf-16-be").hex().upper().encode(),
            rectangle,
            _PRINTED,
            page,
            parent,
            appearance,
        )
    )
    form = b"<</Type/XObject/Subtype/Form/BBox[0 0 %g %g]/Resources<<>>/Length 0>>"
    return widget, form % (right - left, top - bottom) + b"\nstream\n\nendstream"


def _parts_of_link(annotation, tag):
    """Return rectangle, number in the structure tree and page of the link, or None."""
    if not annotation or not tag or b"/S/Link" not in tag[1]:
        return None
    matches = (
        re.search(rb"/Rect\[([^]]+)\]", annotation[1]),
        re.search(rb"/StructParent (\d+)", annotation[1]),
        re.search(rb"/Pg (\d+ 0 R)", tag[1]),
    )
    return [match[1] for match in matches] if all(matches) else None


def _incremental_update(objects, changed):
    """Return the incremental update that sets the objects `changed`, {number: content}."""
    pdf, trailer, update, places = objects.pdf, objects.trailer, bytearray(b"\n"), {}
    for number, content in sorted(changed.items()):
        places[number] = len(pdf) + len(update)
        update += b"%s%s\nendobj\n" % (head_of(number), content)
    # A new cross-reference table lists the changed objects and refers to the former table.
    start = len(pdf) + len(update)
    update += b"xref\n0 1\n0000000000 65535 f\r\n"
    for number, place in places.items():
        update += b"%d 1\n%010d 00000 n\r\n" % (number, place)
    keys = [re.search(rb"/(?:Root|Info) \d+ 0 R", trailer[i:])[0] for i in
            (trailer.index(b"/Root"), trailer.index(b"/Info"))]  # fmt: skip
    first = re.search(rb"/ID\[(\([^()]*\))", trailer)
    identity = b""
    if first:
        second = hashlib.sha256(bytes(update)).hexdigest()[:32].encode()
        identity = b"/ID[%s<%s>]" % (first[1], second)
    update += b"trailer\n<</Size %d%s%s/Prev %d>>\nstartxref\n%d\n%%%%EOF" % (
        max(changed) + 1, b"".join(keys), identity, objects.table, start,
    )  # fmt: skip
    return bytes(update)
