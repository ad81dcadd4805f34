"""LAS and LAZ: check of the header; LAS records are read here, LAZ records in a child process.

The layout follows the LAS specification 1.4 R15 (ASPRS), little-endian. The layout of the LASzip
record and of the chunk table follows the LASzip library.
"""

import struct
from dataclasses import dataclass

import numpy as np

from tankcal.clouds.formats.files import (
    EXTENT_LIMIT,
    WHOLE,
    Piece,
    ScanHeader,
    count_mismatch,
    describe_cut,
    divide_records,
    no_points,
    require_library,
)
from tankcal.clouds.formats.isolation import decode_frames
from tankcal.messages import message

LEAST_HEADER = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}  # least size in bytes, by minor version
LEAST_RECORD = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)  # least bytes, by point format
VLR, EVLR = 54, 60  # least bytes of a variable length record, and of an extended record
LASZIP_ID = 22204  # record ID of the LASzip record
FARTHEST = 1e11  # largest offset in units of the file: 1e8 m in mm
ONE_STREAM = 1  # compressor of LASzip 1: all points in one stream, without chunks
VARIABLE = 0xFFFFFFFF  # chunk size that marks chunks of variable size


@dataclass(frozen=True)
class LasHeader:
    """Values of a valid header that are needed to read the points.

    Attributes
    ----------
    count : int
        Number of points.
    first : int
        Byte at which the points begin.
    record : int
        Size of a record, bytes.
    scale, offset : ndarray, shape (3,)
        Scale factors and offsets of the integer coordinates, in the unit of the file.
    low, high : ndarray, shape (3,)
        Smallest and largest coordinates, in the unit of the file.
    laszip : bytes or None
        LASzip record of a LAZ file, or None for a LAS file.
    """

    count: int
    first: int
    record: int
    scale: np.ndarray
    offset: np.ndarray
    low: np.ndarray
    high: np.ndarray
    laszip: bytes | None

    @property
    def format(self):
        """ "las" or "laz"."""
        return "las" if self.laszip is None else "laz"


def describe(file):
    """Return format and scans of a file; raise InputError with all problems of its header."""
    header = read_header(file)
    return header.format, (ScanHeader("", header.count),)


def shares(file, points_each):
    """Divide the points into ranges; ranges of LAZ begin at chunks, the only seekable places."""
    header = read_header(file)
    if header.laszip is None:
        return divide_records(header.count, points_each)
    compressor, size = _read_chunking(header.laszip)
    if compressor == ONE_STREAM or size == VARIABLE:
        return (WHOLE,)
    return divide_records(header.count, max(1, points_each // size) * size)


def pieces(file, chunk, share=WHOLE):
    """Yield the points of a share of a file as `Piece` objects."""
    header = read_header(file)
    first = share.first
    count = header.count - first if share.count is None else share.count
    box = _Box(file, header, first)
    blocks = _las_blocks if header.laszip is None else _laz_blocks
    for integers in blocks(file, header, chunk, first, count):
        columns = np.empty((3, len(integers)))  # contiguous columns are several times faster
        for i, column in enumerate(columns):
            np.multiply(integers[:, i], header.scale[i], out=column)
            column += header.offset[i]
        box.check(columns.T)
        yield Piece(0, columns.T, len(integers))


def read_header(file):
    """Read the `LasHeader` and check it against the file; raise InputError with all problems."""
    start = file.start
    minor = start[25] if len(start) > 25 else 0
    least = LEAST_HEADER.get(minor)
    if least is None or start[24:25] != b"\1":
        found = f"{start[24]}.{minor}" if len(start) > 25 else "?"
        raise file.refusal(
            message(
                "cloud_file_las_version",
                "LAS of version {found}; expected 1.0 to 1.4",
                found=found,
            )
        )
    if len(start) < least:
        header = message("cloud_file_las_header", "the header")
        raise file.refusal(describe_cut(file, header, least, file.bytes))
    parts = _Parts(start, minor)
    problems = [*_layout_problems(file, parts, least), *_number_problems(parts)]
    if problems:
        raise file.refusal(*problems)
    laszip = _laszip_record(file, parts) if parts.is_compressed else None
    if laszip is None:
        _check_what_follows(file, parts)
    else:
        require_library(file, "lazrs")
        _check_laszip(file, parts, laszip)
        laszip = _set_chunk_size(laszip, parts.count)
        _check_chunk_table(file, parts, laszip)
    return LasHeader(
        parts.count,
        parts.first,
        parts.record,
        parts.scale,
        parts.offset,
        parts.low,
        parts.high,
        laszip,
    )


class _Parts:
    """Unchecked numbers of a header."""

    def __init__(self, start, minor):
        def at(place, form):
            return struct.unpack_from("<" + form, start, place)[0]

        self.size, self.first, self.vlrs = at(94, "H"), at(96, "I"), at(100, "I")
        form = at(104, "B")
        self.is_compressed, self.form = bool(form & 0xC0), form & 0x3F
        self.record, self.old_count = at(105, "H"), at(107, "I")
        self.scale = np.frombuffer(start, "<f8", 3, 131)
        self.offset = np.frombuffer(start, "<f8", 3, 155)
        box = np.frombuffer(start, "<f8", 6, 179).reshape(3, 2)
        self.high, self.low = box[:, 0], box[:, 1]
        self.waveforms = at(227, "Q") if minor >= 3 else 0
        self.evlr_start, self.evlrs, self.count = 0, 0, self.old_count
        if minor >= 4:
            self.evlr_start, self.evlrs, self.count = at(235, "Q"), at(243, "I"), at(247, "Q")


def _layout_problems(file, parts, least):
    """Yield messages about sizes that are inconsistent with the file or with each other."""
    if not least <= parts.size <= file.bytes:
        yield message(
            "cloud_file_las_size",
            "a header of {found} bytes; expected {least} or more, in a file of {size} bytes",
            found=parts.size,
            least=least,
            size=file.bytes,
        )
    vlrs_end = parts.size + VLR * parts.vlrs
    if not vlrs_end <= parts.first <= file.bytes:
        yield message(
            "cloud_file_las_first",
            "points from byte {first} on, behind {count} records that need {needed} bytes at "
            "least, in a file of {size} bytes: damaged",
            first=parts.first,
            count=parts.vlrs,
            needed=vlrs_end,
            size=file.bytes,
        )
    if parts.evlrs:
        end = parts.evlr_start + EVLR * parts.evlrs
        if parts.evlr_start < parts.first or end > file.bytes:
            yield message(
                "cloud_file_las_evlrs",
                "{count} records behind the points, from byte {start} to {end} at least, in a file "
                "of {size} bytes with points from byte {first} on: damaged",
                count=parts.evlrs,
                start=parts.evlr_start,
                end=end,
                size=file.bytes,
                first=parts.first,
            )
    if parts.form >= len(LEAST_RECORD) or parts.record < LEAST_RECORD[parts.form]:
        yield message(
            "cloud_file_las_record",
            "records of format {form} and {found} bytes; expected a format of 0 to 10 with the "
            "bytes that it needs",
            form=parts.form,
            found=parts.record,
        )
    end = parts.first + parts.count * parts.record
    if not parts.is_compressed and parts.first <= file.bytes < end:
        yield message(
            "cloud_file_las_count",
            "declares {declared} points, and has room for {found}; is the file cut or damaged?",
            declared=parts.count,
            found=(file.bytes - parts.first) // max(parts.record, 1),
        )
    if parts.old_count not in (0, parts.count):
        yield message(
            "cloud_file_las_counts",
            "declares {declared} points in one place and {found} in another; expected the same",
            declared=parts.count,
            found=parts.old_count,
        )


def _number_problems(parts):
    """Yield messages about an invalid scale, offset or bounding box."""
    if not np.all((parts.scale > 0) & (parts.scale <= 1)):  # also true for nan
        yield message(
            "cloud_file_las_scale",
            "scale factors {found}; expected three numbers above 0, at most 1",
            found=_format_numbers(parts.scale),
        )
    if not np.all(np.abs(parts.offset) <= FARTHEST):
        yield message(
            "cloud_file_las_offset",
            "offsets {found}; expected three finite numbers, at most {most:g}",
            found=_format_numbers(parts.offset),
            most=FARTHEST,
        )
    with np.errstate(invalid="ignore", over="ignore"):
        extent = parts.high - parts.low
    if not np.all((extent >= 0) & (extent < EXTENT_LIMIT)) and parts.count:
        yield message(
            "cloud_file_las_box",
            "coordinates from {low} to {high}; expected the largest not below the smallest, and "
            "less than {most:g} between them",
            low=_format_numbers(parts.low),
            high=_format_numbers(parts.high),
            most=EXTENT_LIMIT,
        )


def _format_numbers(numbers):
    return [f"{number:g}" for number in numbers]


def _check_what_follows(file, parts):
    """Raise InputError if the points do not fill the space up to the next part of the file.

    A count that is too small leaves complete records unread.
    """
    end = parts.first + parts.count * parts.record
    stop = parts.evlr_start if parts.evlrs else file.bytes
    if stop < end or (stop - end >= parts.record and not parts.waveforms):
        raise count_mismatch(file, parts.count, (stop - parts.first) // parts.record)
    if parts.count == 0:
        raise no_points(file)


def _laszip_record(file, parts):
    """Read the LASzip record from the variable length records before the points."""
    with file.path.open("rb") as stream:
        place = parts.size
        for _ in range(parts.vlrs):  # the number was checked against the space before the points
            stream.seek(place)
            head = stream.read(VLR)
            if len(head) < VLR:
                break
            number, length = struct.unpack_from("<HH", head, 18)
            end = place + VLR + length
            if end > parts.first:
                break
            if head[2:18].rstrip(b"\0") == b"laszip encoded" and number == LASZIP_ID:
                return stream.read(length)
            place = end
    raise file.refusal(
        message(
            "cloud_file_laz_no_record",
            "compressed, without the LASzip record that says how: damaged",
        )
    )


def _check_laszip(file, parts, data):
    """Raise InputError if the LASzip record does not describe a point or has no chunk size."""
    is_valid = len(data) >= 34
    if is_valid:
        compressor, coder, major, minor = struct.unpack_from("<HHBB", data)
        chunk, items = struct.unpack_from("<I", data, 12)[0], struct.unpack_from("<H", data, 32)[0]
        if compressor not in (ONE_STREAM, 2, 3) or coder != 0:
            raise file.refusal(
                message(
                    "cloud_file_laz_kind",
                    "compressed by LASzip {version} with compressor {compressor} and coder {coder};"
                    " expected compressor 1, 2 or 3 and coder 0: decompress it to LAS with the"
                    " program that wrote it, or is it damaged?",
                    version=f"{major}.{minor}",
                    compressor=compressor,
                    coder=coder,
                )
            )
        is_valid = chunk > 0 or compressor == ONE_STREAM
        is_valid = is_valid and items > 0 and len(data) >= 34 + 6 * items
    if is_valid:
        sizes = [struct.unpack_from("<H", data, 36 + 6 * i)[0] for i in range(items)]
        is_valid = sum(sizes) == parts.record
    if not is_valid:
        raise file.refusal(
            message(
                "cloud_file_laz_record",
                "the LASzip record does not describe points of {record} bytes: damaged",
                record=parts.record,
            )
        )


def _set_chunk_size(data, count):
    """Set a chunk size that lazrs accepts in the LASzip record of a single stream.

    A single stream of LASzip 1 has no chunk size. LASzip 1.2 writes 0 or the value for variable
    sizes, both of which lazrs refuses. lazrs accepts any other number.
    """
    if _read_chunking(data)[0] != ONE_STREAM:
        return data
    return data[:12] + struct.pack("<I", min(max(count, 1), VARIABLE - 1)) + data[16:]


def _read_chunking(data):
    """Return the compressor of a LASzip record and the number of points in a chunk."""
    return struct.unpack_from("<H", data)[0], struct.unpack_from("<I", data, 12)[0]


def _check_chunk_table(file, parts, data):
    """Raise InputError if the chunk table is outside the file or its size is implausible."""
    compressor, size = _read_chunking(data)
    if compressor == ONE_STREAM:
        return
    with file.path.open("rb") as stream:
        stream.seek(parts.first)
        place = int.from_bytes(stream.read(8), "little", signed=True)
        is_inside = parts.first + 8 <= place <= file.bytes - 8
        if is_inside:
            stream.seek(place)
            version, chunks = struct.unpack("<II", stream.read(8))
    if not is_inside:
        raise file.refusal(
            message(
                "cloud_file_laz_table",
                "its table of chunks would stand at byte {place} of {size}: is the file cut, or "
                "was it not finished?",
                place=place,
                size=file.bytes,
            )
        )
    room = (place - parts.first - 8) // parts.record  # each chunk begins with an uncompressed point
    least, most = (
        (0, min(parts.count, room)) if size == VARIABLE else _chunk_bounds(parts.count, size)
    )
    if version != 0 or not least <= chunks <= min(most, room, file.bytes - place - 8 + least):
        raise file.refusal(
            message(
                "cloud_file_laz_chunks",
                "a table of {chunks} chunks for {count} points in {size} bytes: damaged",
                chunks=chunks,
                count=parts.count,
                size=file.bytes,
            )
        )
    if parts.count == 0:
        raise no_points(file)


def _chunk_bounds(count, size):
    """Least and largest number of chunks of one size; some programs add an empty last chunk."""
    full = -(-count // size)
    return full, full + 1


class _Box:
    """Check that points lie in the bounding box of the header.

    A damaged scale or offset moves the points out of the box.
    """

    def __init__(self, file, header, done):
        self.file, self.done = file, done
        slack = (
            10 * header.scale
            + 1e-9 * np.maximum(np.abs(header.low), np.abs(header.high))
            + 1e-3 * (header.high - header.low)  # some programs round the box
        )
        self.low, self.high = header.low - slack, header.high + slack
        self.is_blank = not (header.low.any() or header.high.any())  # some programs write zeros

    def check(self, xyz):
        """Raise InputError for a point outside the box."""
        is_inside = np.all(xyz.min(axis=0) >= self.low) and np.all(xyz.max(axis=0) <= self.high)
        if not (self.is_blank or is_inside):
            outside = ((xyz < self.low) | (xyz > self.high)).any(axis=1)
            i = int(np.flatnonzero(outside)[0])
            raise self.file.refusal(
                message(
                    "cloud_file_las_outside",
                    "point {number} is ({x}, {y}, {z}), outside of the box that the header gives: "
                    "damaged, or its header was not brought up to date",
                    number=self.done + i + 1,
                    **dict(zip("xyz", _format_numbers(xyz[i]), strict=True)),
                )
            )
        self.done += len(xyz)


def _las_blocks(file, header, chunk, first, count):
    record = np.dtype(
        {"names": ["xyz"], "formats": ["(3,)<i4"], "offsets": [0], "itemsize": header.record}
    )
    with file.path.open("rb") as stream:
        stream.seek(header.first + first * header.record)
        for done in range(0, count, chunk):
            wanted = min(chunk, count - done)
            records = np.fromfile(stream, record, wanted)
            if len(records) < wanted:
                raise count_mismatch(file, header.count, first + done + len(records))
            yield records["xyz"]


def _laz_blocks(file, header, chunk, first, count):
    request = {
        "kind": "laz",
        "path": str(file.path),
        "first": header.first,
        "record": header.record,
        "skip": first,
        "count": count,
        "laszip": header.laszip.hex(),
        "chunk": chunk,
    }
    for frame in decode_frames(file, request):
        yield frame.data.view("<i4").reshape(-1, 3)
