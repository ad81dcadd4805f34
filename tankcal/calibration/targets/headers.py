"""Size and orientation of a picture file from its header alone, before a pixel is decoded."""

import struct
from dataclasses import dataclass

JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # start of frame
JPEG_ALONE = frozenset({0x01, *range(0xD0, 0xD9)})
TIFF_WIDTH, TIFF_HEIGHT, TIFF_TURN = 256, 257, 274
MOST_ENTRIES = 1000


@dataclass(frozen=True)
class Header:
    """size_px (columns, lines) as stored; orientation of its EXIF or TIFF tag, 1: as stored."""

    size_px: tuple
    orientation: int = 1


def header_of(data):
    """Header of a JPEG, PNG, TIFF or BMP file (bytes), or None where it is none of them."""
    try:
        if data[:8] == b"\x89PNG\r\n\x1a\n" and data[12:16] == b"IHDR":
            return Header(struct.unpack(">II", data[16:24]))
        if data[:2] == b"\xff\xd8":
            return _jpeg(data)
        if data[:4] in (b"II*\0", b"MM\0*"):
            return _tiff(data)
        if data[:2] == b"BM":
            columns, lines = struct.unpack("<ii", data[18:26])
            return Header((abs(columns), abs(lines)))
    except (struct.error, IndexError):
        return None
    return None


def _jpeg(data):
    place, turn = 2, 1
    while data[place] == 0xFF:
        kind = data[place + 1]
        if kind == 0xFF or kind in JPEG_ALONE:
            place += 1 if kind == 0xFF else 2
            continue
        (length,) = struct.unpack(">H", data[place + 2 : place + 4])
        if kind in JPEG_SIZES:
            lines, columns = struct.unpack(">HH", data[place + 5 : place + 9])
            return Header((columns, lines), turn)
        if kind == 0xE1 and data[place + 4 : place + 10] == b"Exif\0\0":
            turn = _tags(data[place + 10 : place + 2 + length]).get(TIFF_TURN, 1)
        place += 2 + length
    return None


def _tiff(data):
    tags = _tags(data)
    if TIFF_WIDTH not in tags or TIFF_HEIGHT not in tags:
        return None
    return Header((tags[TIFF_WIDTH], tags[TIFF_HEIGHT]), tags.get(TIFF_TURN, 1))


def _tags(data):
    """{tag: number} of the first directory of a TIFF structure, of short and long numbers."""
    order = {b"II": "<", b"MM": ">"}.get(data[:2])
    if order is None:
        return {}
    found = {}
    try:
        (start,) = struct.unpack(order + "I", data[4:8])
        (count,) = struct.unpack(order + "H", data[start : start + 2])
        for entry in range(min(count, MOST_ENTRIES)):
            place = start + 2 + 12 * entry
            tag, kind = struct.unpack(order + "HH", data[place : place + 4])
            form, length = {3: ("H", 2), 4: ("I", 4)}.get(kind, (None, 0))
            if form:
                (found[tag],) = struct.unpack(order + form, data[place + 8 : place + 8 + length])
    except struct.error:
        pass
    return found
