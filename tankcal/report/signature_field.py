"""Field for an electronic signature, which is added to a PDF of typst.

page.typ sets a link at the place of the signature. An incremental update (ISO 32000-1, 7.5.6)
replaces the annotation of the link by the widget of a signature field. It also replaces the tag
`Link` by `Form`. Position, page and order remain unchanged, so that the file still conforms to
PDF/A-3a and PDF/UA-1.
"""

import hashlib
import re

from tankcal.report.pdf_objects import head_of, objects_of

LINK = b"/URI(tankcal:signature)"  # link of page.typ at the place of the signature
NAME = "signature"  # name of the field in the PDF
_PRINTED = 4  # annotation flag: print


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
    position = pdf.find(LINK)
    objects = objects_of(pdf)
    if position < 0 or objects is None:
        return pdf
    annotation = objects.around(position)
    tag = annotation and objects.around(pdf.find(b"/Obj %d 0 R" % annotation[0]))
    root = re.search(rb"/Root (\d+) 0 R", objects.trailer)
    catalog = root and objects.content(int(root[1]))
    parts = _parts(annotation, tag)
    if parts is None or catalog is None or b"/AcroForm" in catalog:
        return pdf
    # The tag becomes a form, and the catalogue lists the field.
    changed = {
        tag[0]: tag[1].replace(b"/S/Link", b"/S/Form", 1),
        int(root[1]): catalog[: catalog.rindex(b">>")]
        + b"/AcroForm<</Fields[%d 0 R]/SigFlags 1>>>>" % annotation[0],
    }
    appearance = len(objects.places)
    changed[annotation[0]], changed[appearance] = _field(name, parts, appearance)
    return pdf + _update(objects, changed)


def _field(name, parts, appearance):
    """Return the widget of the field and its empty appearance before the signature."""
    rectangle, parent, page = parts
    left, bottom, right, top = map(float, rectangle.split())
    widget = (
        b"<</Type/Annot/Subtype/Widget/FT/Sig/T(%s)/TU%s/Rect[%s]/F %d/P %s/StructParent %s"
        b"/AP<</N %d 0 R>>>>"
        % (NAME.encode(), _text(name), rectangle, _PRINTED, page, parent, appearance)
    )
    form = b"<</Type/XObject/Subtype/Form/BBox[0 0 %g %g]/Resources<<>>/Length 0>>"
    return widget, form % (right - left, top - bottom) + b"\nstream\n\nendstream"


def _parts(annotation, tag):
    """Return rectangle, number in the structure tree and page of the link, or None."""
    if not annotation or not tag or b"/S/Link" not in tag[1]:
        return None
    matches = (
        re.search(rb"/Rect\[([^]]+)\]", annotation[1]),
        re.search(rb"/StructParent (\d+)", annotation[1]),
        re.search(rb"/Pg (\d+ 0 R)", tag[1]),
    )
    return [match[1] for match in matches] if all(matches) else None


def _text(words):
    """Return a text in PDF notation: UTF-16 in hexadecimal digits."""
    return b"<FEFF%s>" % words.encode("utf-16-be").hex().upper().encode()


def _update(objects, changed):
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
