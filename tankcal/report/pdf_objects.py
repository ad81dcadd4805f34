"""Objects of a PDF of typst: their positions and contents."""

import re
from dataclasses import dataclass

_START = re.compile(rb"startxref\n(\d+)\n%%EOF\s*\Z")
_END = 64  # bytes at the end of the file, which contain the position of the cross-reference table
_TABLE = re.compile(rb"xref\s+0 (\d+)\r?\n")
_LINE, _DIGITS = 20, 10  # bytes of an entry of the table and of its position


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
