"""PLY: vertices of text files and of binary files of either byte order; faces are ignored."""

import re
from dataclasses import dataclass

import numpy as np

from tankcal.clouds.formats.files import (
    WHOLE,
    Piece,
    ScanHeader,
    count_mismatch,
    divide_records,
    no_points,
)
from tankcal.clouds.formats.lines import Layout, Lines, parse_rows, printable_start, skip_lines
from tankcal.messages import message

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class _Element:
    """Element of a PLY header, with names and types of its properties ("" marks a list)."""

    name: str
    count: int
    names: tuple[str, ...]
    types: tuple[str, ...]


@dataclass(frozen=True)
class PlyHeader:
    """Header of a PLY file: position and format of the vertices.

    Attributes
    ----------
    order : str or None
        Byte order of binary numbers, "<" or ">"; None for text.
    before : tuple of _Element
        Elements before the vertices.
    vertex : _Element
        Element of the vertices.
    is_last : bool
        Whether the vertices are the last element.
    first : int
        Length of the header, bytes.
    lines : int
        Number of lines of the header.
    """

    order: str | None
    before: tuple[_Element, ...]
    vertex: _Element
    is_last: bool
    first: int
    lines: int

    @property
    def start(self):
        """Byte at which the binary vertices begin."""
        return self.first + sum(
            element.count * self.record(element).itemsize for element in self.before
        )

    def record(self, element):
        """Data type of one row of an element without lists."""
        fields = [(f"f{i}", self.order + kind) for i, kind in enumerate(element.types)]
        return np.dtype(fields)

    @property
    def columns(self):
        """Indices of x, y and z among the properties of a vertex."""
        return tuple(self.vertex.names.index(name) for name in "xyz")


def describe(file):
    """Return the format and the single scan of a file."""
    return "ply", (ScanHeader("", read_header(file).vertex.count),)


def shares(file, points_each):
    """Divide binary vertices into ranges; a text file is a single piece."""
    header = read_header(file)
    return (WHOLE,) if header.order is None else divide_records(header.vertex.count, points_each)


def pieces(file, chunk, share=WHOLE):
    """Yield the vertices of a share of a file as `Piece` objects."""
    header = read_header(file)
    return (
        _text_pieces(file, header, chunk)
        if header.order is None
        else _binary_pieces(file, header, chunk, share)
    )


def read_header(file):
    """Read the `PlyHeader` and check it against the size of the file."""
    header_end = re.search(rb"\nend_header[ \t]*\r?\n", file.start)
    if header_end is None or not re.match(rb"ply[ \t]*\r?\n", file.start):
        raise file.refusal(
            message(
                "cloud_file_ply_end",
                'no line "end_header" among the first {bytes} bytes: is the file cut or damaged?',
                bytes=len(file.start),
            )
        )
    text = file.start[: header_end.end()]
    order, elements = _parse_header(file, text)
    index = next((i for i, element in enumerate(elements) if element.name == "vertex"), None)
    vertex = elements[index] if index is not None else _Element("vertex", 0, (), ())
    header = PlyHeader(
        order, elements[:index], vertex, index == len(elements) - 1, len(text), text.count(b"\n")
    )
    _check_vertices(file, header)
    return header


def _parse_header(file, text):
    """Return byte order and elements; raise InputError with the first row that is invalid."""
    order, elements = "", []
    for row, line in enumerate(text.split(b"\n"), start=1):
        words = line.decode("utf-8", errors="replace").split()
        match words:
            case [] | ["ply"] | ["end_header"] | ["comment" | "obj_info", *_]:
                continue
            case ["format", kind, "1.0"] if kind in ORDERS:
                order = ORDERS[kind]
                continue
            case ["element", name, count] if re.fullmatch("[0-9]{1,18}", count):
                elements.append(_Element(name, int(count), (), ()))
                continue
            case ["property", kind, name] if kind in TYPES and elements:
                elements[-1] = _add_property(elements[-1], name, TYPES[kind])
                continue
            case ["property", "list", size, kind, name] if elements and {size, kind} <= {*TYPES}:
                elements[-1] = _add_property(elements[-1], name, "")
                continue
        raise file.refusal(
            message(
                "cloud_file_ply_row",
                "found {found!r} in the header; expected a format, an element or a property of PLY",
                found=printable_start(line),
            ),
            row=row,
        )
    if order == "":
        raise file.refusal(
            message("cloud_file_ply_format", 'no line "format" in the header: damaged')
        )
    return order, tuple(elements)


def _add_property(element, name, kind):
    return _Element(element.name, element.count, (*element.names, name), (*element.types, kind))


def _check_vertices(file, header):
    vertex = header.vertex
    has_lists = "" in vertex.types or any("" in element.types for element in header.before)
    if {*"xyz"} - {*vertex.names} or len({*vertex.names}) < len(vertex.names) or has_lists:
        raise file.refusal(
            message(
                "cloud_file_ply_vertex",
                "expected an element vertex with x, y and z, each property once, without lists in "
                "it or before it",
            )
        )
    if not vertex.count:
        raise no_points(file)
    if header.order is None:
        least = 2 * len(vertex.names)
        most = (file.bytes - header.first + 1) // least
        is_valid = vertex.count <= most
        before = sum(element.count for element in header.before)
        is_valid = is_valid and before <= file.bytes
    else:
        size = header.record(vertex).itemsize
        most = max(file.bytes - header.start, 0) // size
        is_valid = vertex.count == most or (vertex.count < most and not header.is_last)
    if not is_valid:
        raise count_mismatch(file, vertex.count, most)


def _binary_pieces(file, header, chunk, share):
    record, first = header.record(header.vertex), share.first
    count = header.vertex.count - first if share.count is None else share.count
    columns = [f"f{i}" for i in header.columns]
    kinds = {header.vertex.types[i] for i in header.columns}
    kind = np.float32 if "f4" in kinds else np.float64
    with file.path.open("rb") as stream:
        stream.seek(header.start + first * record.itemsize)
        for done in range(0, count, chunk):
            rows = np.fromfile(stream, record, min(chunk, count - done))
            if len(rows) < min(chunk, count - done):
                raise count_mismatch(file, header.vertex.count, first + done + len(rows))
            columns_xyz = np.empty((3, len(rows)), kind)
            for row, column in zip(columns_xyz, columns, strict=True):
                row[:] = rows[column]
            yield Piece(0, columns_xyz.T, len(rows))


def _text_pieces(file, header, chunk):
    vertex, layout = header.vertex, Layout(columns=header.columns)
    is_single = "f4" in {vertex.types[i] for i in header.columns}
    with file.path.open("rb") as stream:
        lines = Lines(file, stream)
        for _ in range(header.lines):
            lines.take(1)
        skip_lines(lines, sum(element.count for element in header.before))
        left = vertex.count
        while left:
            block, row = lines.take(min(chunk, left))
            if not block:
                raise count_mismatch(file, vertex.count, vertex.count - left)
            xyz = parse_rows(file, block, row, layout)
            left -= len(xyz)
            # A program that prints float32 gives no more digits, so that float32 is exact.
            single = xyz.astype(np.float32) if is_single else xyz
            yield Piece(0, single if np.array_equal(single, xyz) else xyz, len(xyz))
        if header.is_last and lines.next_line() is not None:
            raise file.refusal(
                message(
                    "cloud_file_ply_rest",
                    "more rows behind the {declared} vertices that it declares: damaged",
                    declared=vertex.count,
                ),
                row=lines.row,
            )
