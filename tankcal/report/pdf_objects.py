"""Objects of a PDF of typst: their positions and contents, and a field for an electronic signature.

page.typ sets a link at the place of the signature. An incremental update (ISO 32000-1, 7.5.6)
replaces the annotation of the link by the widget of a signature field. It also replaces the tag
`Link` by `Form`. Position, page and order remain unchanged, so that the file still conforms to
PDF/A-3a and PDF/UA-1.
"""

import hashlib
import re
from dataclasses import dataclass

_START = re.compile(rb"startxref\n(\d+)\n%%EOF\s*\Z")
_END = 64  # bytes at the end of the file, which contain the position of the cross-reference table
_TABLE = re.compile(rb"xref\s+0 (\d+)\r?\n")
_LINE, _DIGITS = 20, 10  # bytes of an entry of the table and of its position
SIGNATURE_LINK = b"/URI(tankcal:signature)"  # link of page.typ at the place of the signature
FIELD_NAME = "signature"  # name of the field in the PDF
_PRINTED = 4  # annotation flag: print


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
        """Return the PDF with new contents of some objects, {number: bytes}."""
        first = min(self.places[number] for number in changed)
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
        position_line = b"startxref\n%d"
        trailer = self.trailer.replace(
            position_line % self.table, position_line % (self.table + shift)
        )
        return b"".join([*pieces, self.pdf[copied_to : self.lines], entries, trailer])


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
            _hexadecimal_text(name),
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


def _hexadecimal_text(words):
    """Return a text in PDF notation: UTF-16 in hexadecimal digits."""
    return b"<FEFF%s>" % words.encode("utf-16-be").hex().upper().encode()


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
