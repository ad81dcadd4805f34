"""XML of one part, read element by element; only the requested elements are kept."""

from xml.parsers import expat

from tankcal.job.excel.archive import chunks, damaged, without_blanks

MAX_PIECES = 20  # most pieces of the text of one element
PIECE_CHARACTERS = 65_536  # longest piece of text, characters


def parse(archive, member, starts, ends):
    """Read a part from beginning to end.

    Names are without their prefix. Blank cells and rows are skipped.

    Parameters
    ----------
    archive : ZipFile
        The workbook.
    member : str
        Name of the part.
    starts : dict of {str: callable}
        {element: function(attributes)}, called at the start of an element.
    ends : dict of {str: callable}
        {element: function(text)}, called at its end with the text after its last child.

    Raises
    ------
    Unreadable
        For a declaration or a text that is too long.
    ExpatError
        For invalid XML.
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
    """Handlers of one part; the prefix of the root element is removed from all names."""

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
