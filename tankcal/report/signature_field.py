"""The field for an electronic signature: typst makes none, so it is added to what it made.

page.typ sets a link where the signature may come. An incremental update (ISO 32000-1, 7.5.6) makes
of the link's annotation a widget of a signature field, and of its tag `Link` a tag `Form`: place,
page, order and tag stay those that typst gave, so that the file is PDF/A-3a and PDF/UA-1 as before.
"""

import hashlib
import re

from tankcal.report.pdf_objects import head_of, objects_of

LINK = b"/URI(tankcal:signature)"
NAME = "signature"
_PRINTED = 4  # flag of an annotation


def with_signature_field(pdf, name):
    """A PDF of typst with a signature field in the place of its link; unchanged without one.

    Parameters
    ----------
    pdf : bytes
        With a table of places, as typst writes it; a file of another form stays as it is.
    name : str
        What the field is, for those who cannot see it.

    Returns
    -------
    bytes
        The same file with an update behind it; the same bytes for the same file.
    """
    at = pdf.find(LINK)
    objects = objects_of(pdf)
    if at < 0 or objects is None:
        return pdf
    annotation = objects.around(at)
    tag = annotation and objects.around(pdf.find(b"/Obj %d 0 R" % annotation[0]))
    root = re.search(rb"/Root (\d+) 0 R", objects.trailer)
    catalog = root and objects.content(int(root[1]))
    parts = _parts(annotation, tag)
    if parts is None or catalog is None or b"/AcroForm" in catalog:
        return pdf
    changed = {
        tag[0]: tag[1].replace(b"/S/Link", b"/S/Form", 1),
        int(root[1]): catalog[: catalog.rindex(b">>")]
        + b"/AcroForm<</Fields[%d 0 R]/SigFlags 1>>>>" % annotation[0],
    }
    appearance = len(objects.places)
    changed[annotation[0]], changed[appearance] = _field(name, parts, appearance)
    return pdf + _update(objects, changed)


def _field(name, parts, appearance):
    """The widget of the field, and how it looks while nobody has signed: empty."""
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
    """Rectangle, number in the tree of tags, and page of the link; None where it has not all."""
    if not annotation or not tag or b"/S/Link" not in tag[1]:
        return None
    found = (
        re.search(rb"/Rect\[([^]]+)\]", annotation[1]),
        re.search(rb"/StructParent (\d+)", annotation[1]),
        re.search(rb"/Pg (\d+ 0 R)", tag[1]),
    )
    return [one[1] for one in found] if all(found) else None


def _text(words):
    """A text as a PDF holds it in any script: UTF-16 in hexadecimal digits."""
    return b"<FEFF%s>" % words.encode("utf-16-be").hex().upper().encode()


def _update(objects, changed):
    """What is put behind a file so that the objects `changed` {number: content} are so."""
    pdf, trailer, written, places = objects.pdf, objects.trailer, bytearray(b"\n"), {}
    for number, content in sorted(changed.items()):
        places[number] = len(pdf) + len(written)
        written += b"%s%s\nendobj\n" % (head_of(number), content)
    start = len(pdf) + len(written)
    written += b"xref\n0 1\n0000000000 65535 f\r\n"
    for number, place in places.items():
        written += b"%d 1\n%010d 00000 n\r\n" % (number, place)
    keys = [re.search(rb"/(?:Root|Info) \d+ 0 R", trailer[i:])[0] for i in
            (trailer.index(b"/Root"), trailer.index(b"/Info"))]  # fmt: skip
    first = re.search(rb"/ID\[(\([^()]*\))", trailer)
    identity = b""
    if first:
        second = hashlib.sha256(bytes(written)).hexdigest()[:32].encode()
        identity = b"/ID[%s<%s>]" % (first[1], second)
    written += b"trailer\n<</Size %d%s%s/Prev %d>>\nstartxref\n%d\n%%%%EOF" % (
        max(changed) + 1, b"".join(keys), identity, objects.table, start,
    )  # fmt: skip
    return bytes(written)
