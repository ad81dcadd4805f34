"""One XML part of a workbook, element by element: nothing of it is kept but what is asked for."""

from xml.parsers import expat

from tankcal.job.excel.archive import chunks, damaged, without_blanks

MAX_PIECES = 20  # of the text of one element, each of at most this many characters:
PIECE_CHARACTERS = 65_536


def parse(archive, member, starts, ends):
    """Read a part from its beginning to its end.

    starts  {name: function(attributes)} called where such an element begins
    ends    {name: function(text)} called where it ends, with its text up to its last child

    Names stand without their prefix; blank cells and rows are passed over. Raises Unreadable for a
    declaration or a text too long, ExpatError for what is no XML.
    """
    parser = expat.ParserCreate()
    parser.buffer_text, parser.buffer_size = True, PIECE_CHARACTERS
    part = _Part(starts, ends)
    parser.StartElementHandler = part.root
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = _refuse
    part.parser = parser
    for chunk in chunks(archive, member):
        parser.Parse(without_blanks(chunk), False)
    parser.Parse(b"", True)


def _refuse(*_declaration):
    raise damaged()


class _Part:
    """The handlers of one part; the prefix of its root element is that of all that count."""

    def __init__(self, starts, ends):
        self.starts, self.ends = starts, ends
        self.pieces = []
        self.parser = None

    def root(self, name, attributes):
        prefix = name[: name.find(":") + 1]
        self.starts = {prefix + local: call for local, call in self.starts.items()}
        self.ends = {prefix + local: call for local, call in self.ends.items()}
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.text
        self.start(name, attributes)

    def start(self, name, attributes):
        if self.pieces:
            self.pieces.clear()
        call = self.starts.get(name)
        if call is not None:
            call(attributes)

    def end(self, name):
        call = self.ends.get(name)
        if call is not None:
            call("".join(self.pieces))
        if self.pieces:
            self.pieces.clear()

    def text(self, piece):
        self.pieces.append(piece)
        if len(self.pieces) > MAX_PIECES:
            raise damaged()
