"""Archive of a workbook: checked before any part is parsed.

Refused are passwords, macros, links to other files, embedded files, entity declarations, and
archives whose unpacked size is out of proportion.
"""

import io
import re
import zipfile
from xml.parsers import expat

from tankcal.messages import message

MAX_FILE_BYTES = 50_000_000  # largest workbook
MAX_UNPACKED_BYTES = 100_000_000  # largest sum of all parts
MAX_MEMBERS = 5000  # largest number of parts
MAX_RATIO, RATIO_FROM_BYTES = 300, 10_000_000  # largest unpacked over packed size, above a size
MAX_TAGS = 2_500_000  # most start and end tags of all parts; a cell with a value has four
CHUNK_BYTES = 1_000_000  # size of the pieces in which a part is read
_BLANK_CELL = re.compile(rb"<c r=[^<>]*(?:/>|></c>)")
_BLANK_ROW = re.compile(rb"<row r=[^<>]*(?:/>|>\s*</row>)")
_OLE = b"\xd0\xcf\x11\xe0"
_NOT_A_WORKBOOK = message("not_a_workbook", "not an Excel workbook (.xlsx)")
_SAVE_AGAIN = message("save_again", "open it in Excel or LibreOffice and save it as .xlsx")
_DAMAGED = message("damaged_workbook", "damaged: open it in Excel or LibreOffice and save it again")
_HUGE = message(
    "delete_formatted_rows",
    "delete the empty rows and columns that are formatted below and beside the data, or hand in "
    "a folder with CSV files",
)
_MACROS = message("holds_macros", "holds macros; save it as .xlsx (a workbook without macros)")
_LINKS = message(
    "holds_links",
    "holds links to other workbooks; put values in place of those formulas (in Excel: Data, Edit "
    "Links, Break Link) and save it again",
)
_CONNECTIONS = message(
    "holds_connections", "holds connections to data elsewhere; remove them and save it again"
)
# {beginning of the name of a part, in lower case: reason to refuse the workbook}
_REFUSED_PARTS = {
    "xl/vbaproject": _MACROS,
    "xl/macrosheets/": _MACROS,
    "xl/externallinks/": _LINKS,
    "xl/connections": _CONNECTIONS,
    "xl/querytables/": _CONNECTIONS,
    "xl/embeddings/": message(
        "holds_embedded_files", "holds embedded files; remove them and save it again"
    ),
    "xl/activex/": message(
        "holds_controls", "holds controls (ActiveX); remove them and save it again"
    ),
    "xl/workbook.bin": message(
        "is_xlsb", "a binary workbook (.xlsb); {save_again}", save_again=_SAVE_AGAIN
    ),
}
MAX_PIECES = 20  # most pieces of the text of one element
PIECE_CHARACTERS = 65_536  # longest piece of text, characters


class Unreadable(Exception):
    """The workbook cannot be read; the text states the reason and the remedy."""


def damaged():
    """`Unreadable` for an incomplete workbook."""
    return Unreadable(_DAMAGED)


def open_archive(data):
    """Open the content of a workbook as a ZipFile; raises Unreadable if it is refused."""
    if data.startswith(_OLE):
        raise Unreadable(
            message(
                "is_old_xls",
                "an old .xls or a workbook with a password; save it as .xlsx without password",
            )
        )
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
        _refuse_directory(archive.infolist(), len(data))
        _refuse_kind(archive)
        _refuse_content(archive)
    except Unreadable:
        raise
    except Exception:  # zipfile and zlib raise many types for damaged parts
        raise Unreadable(
            message(
                "not_a_workbook_or_damaged",
                "{not_a_workbook}, or damaged",
                not_a_workbook=_NOT_A_WORKBOOK,
            )
        ) from None
    return archive


def chunks(archive, member):
    """Yield the content of a part in pieces, at most the size in its directory entry."""
    with archive.open(member) as stream:
        while chunk := stream.read(CHUNK_BYTES):
            yield chunk


def without_blanks(chunk):
    """Remove cells without content, and rows of such cells, from XML.

    A sheet that is formatted down to its last row contains millions of them.
    """
    return _BLANK_ROW.sub(b"", _BLANK_CELL.sub(b"", chunk))


def _refuse_directory(members, packed_bytes):
    unpacked = sum(member.file_size for member in members)
    if len(members) > MAX_MEMBERS:
        raise Unreadable(
            message(
                "too_many_parts",
                "{count} parts inside, expected at most {most}",
                count=len(members),
                most=MAX_MEMBERS,
            )
        )
    if unpacked > MAX_UNPACKED_BYTES:
        raise Unreadable(
            message(
                "unpacks_too_large",
                "unpacks to {unpacked:.0f} MB, expected at most {most:.0f} MB: {huge}",
                unpacked=unpacked / 1e6,
                most=MAX_UNPACKED_BYTES / 1e6,
                huge=_HUGE,
            )
        )
    if unpacked > RATIO_FROM_BYTES and unpacked > MAX_RATIO * packed_bytes:
        raise Unreadable(
            message(
                "unpacks_too_often",
                "unpacks to more than {most} times its size, which no workbook of a job does",
                most=MAX_RATIO,
            )
        )
    usual = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
    if any(member.flag_bits & 1 or member.compress_type not in usual for member in members):
        raise Unreadable(
            message(
                "packed_unusually", "packed in an unusual way; {save_again}", save_again=_SAVE_AGAIN
            )
        )
    if len({member.filename for member in members}) < len(members):
        raise Unreadable(
            message(
                "same_part_twice", "holds the same part twice; {save_again}", save_again=_SAVE_AGAIN
            )
        )


def _refuse_kind(archive):
    names = archive.namelist()
    if "mimetype" in names and b"opendocument" in archive.read("mimetype")[:100]:
        raise Unreadable(
            message("is_ods", "an OpenDocument file (.ods); {save_again}", save_again=_SAVE_AGAIN)
        )
    for name in names:
        for beginning, reason in _REFUSED_PARTS.items():
            if name.lower().startswith(beginning):
                raise Unreadable(reason)
    if "xl/workbook.xml" not in names:
        raise Unreadable(_NOT_A_WORKBOOK)


def _refuse_content(archive):
    tags = 0
    for member in archive.infolist():
        if not member.filename.lower().endswith((".xml", ".rels", ".vml")):
            continue
        before = b""
        for chunk in chunks(archive, member):
            if not before and _is_disguised(chunk):
                raise _foreign_declarations()
            # A declaration may begin in one piece and end in the next.
            joined = before[-16:] + chunk
            if b"<!DOCTYPE" in joined or b"<!ENTITY" in joined or b"\0" in chunk:
                raise _foreign_declarations()
            if len(chunk) == CHUNK_BYTES and b">" not in chunk:
                raise Unreadable(
                    message(
                        "text_too_long",
                        "holds a text of more than a million characters; {save_again}",
                        save_again=_SAVE_AGAIN,
                    )
                )
            tags += without_blanks(chunk).count(b"<")
            if tags > MAX_TAGS:
                raise Unreadable(
                    message(
                        "too_many_cells_in_workbook",
                        "holds more cells than a job needs: {huge}",
                        huge=_HUGE,
                    )
                )
            before = chunk


def _foreign_declarations():
    return Unreadable(
        message(
            "xml_declarations",
            "holds XML declarations that no workbook needs (DOCTYPE, ENTITY, encoding)",
        )
    )


def _is_disguised(start):
    """Return True if the XML has an encoding that would hide a DOCTYPE."""
    encoding = re.match(rb"\s*(?:\xef\xbb\xbf)?<\?xml[^>]*?encoding\s*=\s*[\"']([^\"']*)", start)
    usual = (b"utf-8", b"us-ascii", b"ascii", b"iso-8859-1", b"windows-1252")
    return encoding is not None and encoding[1].lower() not in usual


# ---- XML of one part, read element by element; only the requested elements are kept


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
