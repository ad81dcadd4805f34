"""XYZ, ASC, TXT and CSV: rows of numbers; the first lines determine separator and columns."""

import re
from dataclasses import dataclass, replace
from itertools import pairwise

from tankcal.clouds.formats.files import (
    WHOLE,
    CloudPiece,
    Piece,
    ScanHeader,
    count_mismatch,
    no_points,
)
from tankcal.clouds.formats.lines import (
    BLOCK,
    COMMENTS,
    LONGEST_LINE,
    NUMBER,
    Layout,
    Lines,
    count_lines,
    count_rows,
    is_pts,
    is_ptx,
    parse_rows,
    printable_start,
    whole_number,
)
from tankcal.errors import InputError
from tankcal.messages import message

LAYOUT_ROWS = 50  # rows that determine separator and columns
NAMES = {
    "x": "x", "east": "x", "easting": "x", "y": "y", "north": "y", "northing": "y",
    "z": "z", "height": "z", "elevation": "z",
}  # fmt: skip
UNIT = re.compile(r"[\s_]*[\[(]?(mm|cm|m|ft)?[\])]?$")
WITH_COMMA = re.compile(rb"[+-]?\d*,\d+([eE][+-]?\d+)?")


def find_kind(file):
    """Return "ptx", "pts" or "xyz"; raise InputError for a .ptx file of another format."""
    lines = [line for line in _first_lines(file) if line]
    if is_ptx(lines):
        return "ptx"
    if file.ending == ".ptx":
        raise file.refusal(
            message(
                "cloud_file_no_ptx",
                "does not begin as a PTX file does: columns, rows, four lines of 3 numbers, four "
                "of 4",
            )
        )
    is_counted = is_pts(lines) and _begins_with_number(lines[1])
    return "pts" if is_counted else "xyz"


def describe(file):
    """Return format and scan header, with the count if a line before the points states it."""
    _, heading, count = _find_layout(file)
    if count is not None:
        _check_count(file, heading, count)
    return "xyz", (ScanHeader("", count),)


def _check_count(file, heading, count):
    """Raise InputError if the number of points differs from the stated count."""
    rows = 0
    # Counting lines is fast; comments are excluded only if the fast count does not match.
    for count_function in (count_lines, count_rows):
        with file.path.open("rb") as stream:
            lines = Lines(file, stream)
            lines.take(heading)
            rows = 0
            while (block := lines.take(1 << 20)[0]) and rows <= count:
                rows += count_function(block)
        if rows == count:
            return
    raise count_mismatch(file, count, rows)


def estimate_rows(file):
    """Estimate the number of rows of a text file from its first lines."""
    return file.bytes * max(file.start.count(b"\n"), 1) / len(file.start)


def shares(file, points_each):
    """Divide a file into byte ranges of whole lines; the first range contains the heading."""
    _, heading, _ = _find_layout(file)
    each = max(1, round(points_each * file.bytes / estimate_rows(file)))
    edges = [0]
    with file.path.open("rb") as stream:
        for _ in range(heading):
            stream.readline(LONGEST_LINE)
        place = stream.tell() + each
        while place < file.bytes:
            stream.seek(place)
            if stream.readline(LONGEST_LINE).endswith(b"\n") and stream.tell() < file.bytes:
                edges.append(stream.tell())
            place = max(stream.tell(), place) + each
    edges.append(file.bytes)
    return tuple(CloudPiece(None, a, b - a) for a, b in pairwise(edges))


def pieces(file, chunk, share=WHOLE):
    """Yield the points of a share of a file as `Piece` objects."""
    layout, heading, _ = _find_layout(file)
    is_empty = share == WHOLE
    with file.path.open("rb") as stream:
        stream.seek(share.first)
        lines = Lines(file, stream if share.count is None else _LimitedStream(stream, share.count))
        if heading and not share.first:
            lines.take(heading)
        while True:
            block, row = lines.take(chunk)
            if not block:
                break
            try:
                xyz = parse_rows(file, block, row, layout)
            except InputError:  # repeat with the row number counted from the start of the file
                parse_rows(file, block, row + _lines_before(file, share.first), layout)
                raise
            if len(xyz):
                is_empty = False
                yield Piece(0, xyz, len(xyz))
    if is_empty:
        raise no_points(file)


class _LimitedStream:
    """Stream that ends after a given number of bytes."""

    def __init__(self, stream, left):
        self.stream, self.left = stream, left

    def read(self, size):
        """Read at most `size` bytes."""
        data = self.stream.read(min(size, self.left))
        self.left -= len(data)
        return data


def _lines_before(file, place):
    """Number of lines before a byte position."""
    with file.path.open("rb") as stream:
        part, count = _LimitedStream(stream, place), 0
        while block := part.read(BLOCK):
            count += block.count(b"\n")
    return count


def _first_lines(file):
    """Complete lines at the start of a file, without surrounding blanks."""
    start = file.start.removeprefix(b"\xef\xbb\xbf")
    if len(file.start) < file.bytes:
        start = start[: start.rfind(b"\n") + 1]
    elif b"\n" not in start and b"\r" in start.strip():
        start = b""  # lines end with a carriage return only, which is not supported
    return [line.strip() for line in start.split(b"\n")]


def _find_layout(file):
    """Return layout of the rows, number of lines before them, and stated number of points or None.

    CloudCompare can write a line of titles, and below it a line with the number of points.
    """
    lines, heading, count = _first_lines(file), None, None
    for first, line in enumerate(lines):
        is_comment = line.startswith(COMMENTS)
        if line and not is_comment and _begins_with_number(line):
            rows = [row for row in lines[first:] if row and not row.startswith(COMMENTS)]
            if count is None and _is_count(line, [*filter(None, lines[first + 1 :])], heading):
                count = whole_number(line)
                continue
            return _check_layout(file, rows[:LAYOUT_ROWS], heading, first), first, count
        if line:
            new_heading = _read_heading(
                line.lstrip(b"#/% ") if is_comment else line, first, is_comment
            )
            if new_heading is None and not is_comment:
                raise _heading_error(file, line, first)
            heading = new_heading or heading
    raise no_points(file)


def _is_count(line, below, heading):
    """Whether a line contains only the number of points, above or below the titles."""
    if whole_number(line) is None or not below:
        return False
    if heading is None:
        return _read_heading(below[0].lstrip(b"#/% "), 0, False) is not None
    row = next((line_below for line_below in below if not line_below.startswith(COMMENTS)), b"")
    return len(re.split(rb"[\s;,]+", row)) >= 3


def _heading_error(file, line, at):
    return file.refusal(
        message(
            "cloud_file_heading",
            "found {found!r}; expected a heading that names x, y and z, a name for each column, or "
            "rows of numbers",
            found=printable_start(line),
        ),
        row=at + 1,
    )


def _begins_with_number(line):
    cell = re.split(rb"[\s;,]", line, maxsplit=1)[0]
    return NUMBER.fullmatch(cell) is not None


@dataclass(frozen=True)
class _Heading:
    """Heading that names x, y and z, with their columns and the number of names."""

    line: bytes
    at: int
    is_comment: bool
    columns: tuple[int, int, int]
    names: int
    is_of_tabs: bool


def _read_heading(line, at, is_comment):
    """Return the `_Heading` of a line, or None if the line does not name x, y and z."""
    text = line.decode("utf-8", errors="replace").lower()
    for mark in (";", "\t", ",", None):
        if mark is not None and mark not in text:
            continue
        names, places = text.split(mark), {}
        for i, name in enumerate(names):
            kind = NAMES.get(UNIT.sub("", name.strip(' "\t'), count=1))
            if kind is not None:
                places.setdefault(kind, i)
        if len(places) == 3:
            columns = places["x"], places["y"], places["z"]
            return _Heading(line, at, is_comment, columns, len(names), mark == "\t")
    return None


def _check_layout(file, rows, heading, first):
    """Return the `Layout` of rows of numbers, checked against the heading."""
    layout = _guess_layout(file, rows, heading, first)
    count = len(layout.cells(rows[0]))
    if heading is not None and count != heading.names:
        if not heading.is_comment:
            raise _heading_error(file, heading.line, heading.at)
        heading, layout = None, replace(layout, columns=(0, 1, 2))
    if count <= max(layout.columns):
        raise file.refusal(
            message("cloud_file_columns", "{found} columns; expected x, y and z", found=count),
            row=first + 1,
        )
    if heading is None and count > 3 and _are_row_numbers([layout.cells(row)[0] for row in rows]):
        raise file.refusal(
            message(
                "cloud_file_numbered",
                "its first column counts the rows; expected x, y and z first, or a heading that "
                "names them",
            ),
            row=first + 1,
        )
    return layout


def _are_row_numbers(cells):
    """Whether the cells of a column are n, n + 1, n + 2 ..."""
    if len(cells) <= 10 or not all(re.fullmatch(rb"\d{1,18}", cell) for cell in cells):
        return False
    numbers = [int(cell) for cell in cells]
    return numbers == [*range(numbers[0], numbers[0] + len(numbers))]


def _guess_layout(file, rows, heading, first):
    """Return the `Layout` of rows, from the marks that occur in them."""
    columns = heading.columns if heading else (0, 1, 2)
    text = b"\n".join(rows)
    has_comma, has_point = b"," in text, b"." in text
    has_tabs = heading is not None and heading.is_of_tabs and b"\t" in rows[0]
    if b";" in text or has_tabs:
        if has_comma and has_point:
            raise _comma_error(file, first)
        return Layout(";" if b";" in text else "tab", "," if has_comma else ".", columns)
    if not has_comma:
        return Layout("blank", ".", columns)
    cells = [cell for row in rows for cell in row.split()]
    if len(rows[0].split()) >= 3 and not any(cell.endswith(b",") for cell in cells):
        are_decimals = all(WITH_COMMA.fullmatch(cell) for cell in cells if b"," in cell)
        if not are_decimals or has_point:
            raise _comma_error(file, first)
        return Layout("blank", ",", columns)
    if not has_point and heading is None and len(rows[0].split(b",")) >= 6:
        raise _comma_error(file, first)  # "1,5,2,5,3,5" may be three numbers or six
    return Layout(",", ".", columns)


def _comma_error(file, first):
    return file.refusal(
        message(
            "cloud_file_comma",
            "a comma here may be a decimal sign or may part columns; expected a decimal point, or "
            "columns parted by semicolons",
        ),
        row=first + 1,
    )
