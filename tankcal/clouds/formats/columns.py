"""XYZ, ASC, TXT and CSV: rows of numbers, their separator and columns told by the first lines."""

import re

from tankcal.clouds.contents import ScanHeader
from tankcal.clouds.formats.counted_text import looks_as_pts, looks_as_ptx
from tankcal.clouds.formats.files import Piece, no_points
from tankcal.clouds.formats.lines import COMMENTS, NUMBER, Layout, Lines, parse_rows, shown
from tankcal.messages import message

JUDGED = 50  # lines that tell separator and columns
NAMES = {
    "x": "x", "east": "x", "easting": "x", "y": "y", "north": "y", "northing": "y",
    "z": "z", "height": "z", "elevation": "z",
}  # fmt: skip
UNIT = re.compile(r"[\s_]*[\[(]?(mm|cm|m|ft)?[\])]?$")
WITH_COMMA = re.compile(rb"[+-]?\d*,\d+([eE][+-]?\d+)?")


def find_kind(file):
    """ "ptx", "pts" or "xyz" of a text file; InputError where its ending says another thing."""
    lines = [line for line in _first_lines(file) if line]
    if looks_as_ptx(lines):
        return "ptx"
    if file.ending == ".ptx":
        raise file.refusal(
            message(
                "cloud_file_no_ptx",
                "does not begin as a PTX file does: columns, rows, four lines of 3 numbers, four "
                "of 4",
            )
        )
    return "pts" if looks_as_pts(lines) else "xyz"


def describe(file):
    """The one scan of a file, its number of points not known before it is read."""
    _find_layout(file)
    return "xyz", (ScanHeader("", None),)


def pieces(file, chunk):
    """Points of a file."""
    layout, heading = _find_layout(file)
    is_empty = True
    with file.path.open("rb") as stream:
        lines = Lines(file, stream)
        if heading:
            lines.take(heading)
        while True:
            block, row = lines.take(chunk)
            if not block:
                break
            xyz = parse_rows(file, block, row, layout)
            if len(xyz):
                is_empty = False
                yield Piece(0, xyz, len(xyz))
    if is_empty:
        raise no_points(file)


def _first_lines(file):
    """Whole lines from the start of a file, stripped."""
    start = file.start.removeprefix(b"\xef\xbb\xbf")
    if len(file.start) < file.bytes:
        start = start[: start.rfind(b"\n") + 1]
    elif b"\n" not in start and b"\r" in start.strip():
        start = b""  # ends of lines of no system that is in use
    return [line.strip() for line in start.split(b"\n")]


def _find_layout(file):
    """The `Layout` of the rows and how many lines stand before them."""
    lines, named = _first_lines(file), None
    for first, line in enumerate(lines):
        if not line:
            continue
        is_comment = line.startswith(COMMENTS)
        if not is_comment and _begins_with_number(line):
            rows = [row for row in lines[first:] if row and not row.startswith(COMMENTS)]
            return _judge(file, rows[:JUDGED], named, first), first
        columns = _columns_of_heading(line.lstrip(b"#/% ") if is_comment else line)
        if columns is None and not is_comment:
            raise file.refusal(
                message(
                    "cloud_file_heading",
                    "found {found!r}; expected a heading that names x, y and z, or rows of numbers",
                    found=shown(line),
                ),
                row=first + 1,
            )
        named = columns or named
    raise no_points(file)


def _begins_with_number(line):
    cell = re.split(rb"[\s;,]", line, maxsplit=1)[0]
    return NUMBER.fullmatch(cell) is not None


def _columns_of_heading(line):
    """Places of x, y and z among the names of a heading, by its separator; None: it has none."""
    text = line.decode("utf-8", errors="replace").lower()
    for mark in (";", "\t", ",", None):
        if mark is not None and mark not in text:
            continue
        places = {}
        for i, name in enumerate(text.split(mark)):
            kind = NAMES.get(UNIT.sub("", name.strip(' "\t'), count=1))
            if kind is not None:
                places.setdefault(kind, i)
        if len(places) == 3:
            return places["x"], places["y"], places["z"]
    return None


def _judge(file, rows, named, first):
    """The `Layout` of rows of numbers."""
    layout = _separated(file, rows, named, first)
    count = len(layout.cells(rows[0]))
    if count <= max(layout.columns):
        raise file.refusal(
            message(
                "cloud_file_columns",
                "{found} columns; expected x, y and z",
                found=count,
            ),
            row=first + 1,
        )
    if named is None and len(rows) > 10 and count > 3:
        cells = [layout.cells(row)[0] for row in rows]
        if all(cell.isdigit() for cell in cells):
            numbers = [int(cell) for cell in cells]
            if numbers == list(range(numbers[0], numbers[0] + len(numbers))):
                raise file.refusal(
                    message(
                        "cloud_file_numbered",
                        "its first column counts the rows; expected x, y and z first, or a heading "
                        "that names them",
                    ),
                    row=first + 1,
                )
    return layout


def _separated(file, rows, named, first):
    columns = named or (0, 1, 2)
    text = b"\n".join(rows)
    has_comma, has_point = b"," in text, b"." in text
    if b";" in text:
        if has_comma and has_point:
            raise _mixed(file, first)
        return Layout(";", "," if has_comma else ".", columns)
    if not has_comma:
        has_blank_cell = named and any(b"\t\t" in row for row in rows)
        return Layout("tab" if has_blank_cell else "blank", ".", columns)
    cells = [cell for row in rows for cell in row.split()]
    if len(rows[0].split()) >= 3 and not any(cell.endswith(b",") for cell in cells):
        are_decimals = all(WITH_COMMA.fullmatch(cell) for cell in cells if b"," in cell)
        if are_decimals and not has_point:
            return Layout("blank", ",", columns)
        if not are_decimals or has_point:
            raise _mixed(file, first)
    if not has_point and named is None and len(rows[0].split(b",")) >= 6:
        raise _mixed(file, first)  # 1,5,2,5,3,5 may be three numbers or six
    return Layout(",", ".", columns)


def _mixed(file, first):
    return file.refusal(
        message(
            "cloud_file_comma",
            "a comma here may be a decimal sign or may part columns; expected a decimal point, or "
            "columns parted by semicolons",
        ),
        row=first + 1,
    )
