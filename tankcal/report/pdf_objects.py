"""Objects of a PDF as typst writes it: where each of them is, and what it holds."""

import re
from dataclasses import dataclass

_START = re.compile(rb"startxref\n(\d+)\n%%EOF\s*\Z")
_END = 64  # bytes at the end, in which the start of the table of places is told
_TABLE = re.compile(rb"xref\s+0 (\d+)\r?\n")
_LINE, _DIGITS = 20, 10  # bytes of an entry of that table, and of the place in it


@dataclass(frozen=True)
class Objects:
    """Where the objects of a PDF are (ISO 32000-1, 7.5.4).

    Attributes
    ----------
    pdf : bytes
    table : int
        Where the table of places starts.
    lines : int
        Where its entries do.
    places : list of int
        Of each object, by its number; 0 for none.
    """

    pdf: bytes
    table: int
    lines: int
    places: list[int]

    @property
    def trailer(self):
        """What follows the table."""
        return self.pdf[self.lines + _LINE * len(self.places) :]

    def around(self, at):
        """(number, content) of the object that a place of the file is in; None for no place."""
        if at < 0:
            return None
        head = self.pdf.rfind(b" 0 obj", 0, at)
        number = int(self.pdf[self.pdf.rfind(b"\n", 0, head) + 1 : head])
        content = self.content(number)
        return content and (number, content)

    def content(self, number):
        """What is between `obj` and `endobj`; None where the object is not at its place."""
        head, start = head_of(number), self.places[number]
        if not self.pdf.startswith(head, start):
            return None
        return self.pdf[start + len(head) : self.pdf.index(b"\nendobj", start)]

    def with_contents(self, changed):
        """The same PDF with other contents of some objects, {number: bytes}."""
        first = min(self.places[number] for number in changed)
        behind = sorted((place, i) for i, place in enumerate(self.places) if place >= first)
        entries = bytearray(self.pdf[self.lines : self.lines + _LINE * len(self.places)])
        pieces, done, moved = [], 0, 0
        for place, number in behind:
            entries[_LINE * number : _LINE * number + _DIGITS] = b"%010d" % (place + moved)
            if number in changed:
                start, former = place + len(head_of(number)), self.content(number)
                pieces += [self.pdf[done:start], changed[number]]
                done = start + len(former)
                moved += len(changed[number]) - len(former)
        told = b"startxref\n%d"
        trailer = self.trailer.replace(told % self.table, told % (self.table + moved))
        return b"".join([*pieces, self.pdf[done : self.lines], entries, trailer])


def objects_of(pdf):
    """The Objects of a PDF with a table of places; None for a file of another form."""
    found = _START.search(pdf[-_END:])
    table = found and int(found[1])
    head = found and _TABLE.match(pdf, table)
    if not head:
        return None
    lines, count = head.end(), int(head[1])
    entries = pdf[lines : lines + _LINE * count]
    places = [int(entries[i : i + _DIGITS]) for i in range(0, _LINE * count, _LINE)]
    return Objects(pdf, table, lines, places)


def head_of(number):
    """The line that an object begins with."""
    return b"%d 0 obj\n" % number
