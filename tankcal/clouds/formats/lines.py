"""Numbers from text in blocks of whole lines, and the text files PTX and PTS.

PTX and PTS: text files with a count before the points of each scan.

PTX: a scan begins with columns, rows, position and three axes of the scanner, and a 4 x 4 matrix.
The matrix is applied from the right to rows (x, y, z, 1). "0 0 0" is a direction without a return.
PTS: each block has a count and its points; all blocks are in one frame.
"""

import csv
import io
import re
import warnings
from dataclasses import dataclass

import numpy as np

from tankcal.clouds.formats.files import Piece, ScanHeader, count_mismatch, no_points
from tankcal.messages import message

BLOCK = 1 << 22  # bytes read at a time
LONGEST_LINE = 1 << 20  # bytes
COMMENTS = (b"#", b"//", b"%")
NUMBER = re.compile(rb"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
LEAST_ROW = 6  # length of the shortest row of three numbers, bytes


@dataclass(frozen=True)
class Layout:
    """Separator, decimal sign and columns of the coordinates in a row.

    Attributes
    ----------
    separator : str
        ",", ";", "tab" or "blank" (any number of blanks and tabs).
    decimal : str
        "." or ",".
    columns : tuple of int
        Columns of x, y and z, from 0.
    """

    separator: str = "blank"
    decimal: str = "."
    columns: tuple[int, int, int] = (0, 1, 2)

    def cells(self, line):
        """Split a line of bytes into cells, without surrounding blanks."""
        if self.separator == "blank":
            return line.split()
        mark = b"\t" if self.separator == "tab" else self.separator.encode()
        return [cell.strip() for cell in line.split(mark)]

    def number(self, cell):
        """Convert a cell to float; None if it is not a finite number."""
        if self.decimal == ",":
            cell = cell.replace(b".", b"x").replace(b",", b".")  # a point makes the number invalid
        if NUMBER.fullmatch(cell) is None:
            return None
        value = float(cell)
        return value if np.isfinite(value) else None


class Lines:
    """Lines of a text file, read singly or in blocks, with memory independent of its length.

    Attributes
    ----------
    row : int
        Number of the last line that was read, counted from 1.
    """

    def __init__(self, file, stream):
        self.file, self.row = file, 0
        self._stream, self._text, self._at = stream, b"", 0
        self._fill()
        if self._text.startswith(b"\xef\xbb\xbf"):
            self._at = 3

    def next_line(self):
        """Read the next line that is not blank, without surrounding blanks; None at the end."""
        while True:
            end = self._text.find(b"\n", self._at)
            if end < 0:
                if not self._fill():
                    return None
                continue
            line = self._text[self._at : end].strip()
            self._at, self.row = end + 1, self.row + 1
            if line:
                return line

    def take(self, most):
        """Read a block of at most `most` lines; return its bytes (b"" at the end) and first row."""
        end = self._text.rfind(b"\n", self._at)
        while end < 0:
            if not self._fill():
                return b"", self.row + 1
            end = self._text.rfind(b"\n", self._at)
        block = self._text[self._at : end + 1]
        lines = block.count(b"\n")
        if lines > most:
            ends = np.flatnonzero(np.frombuffer(block, np.uint8) == ord("\n"))
            block, lines = block[: ends[most - 1] + 1], most
        self._at += len(block)
        first, self.row = self.row + 1, self.row + lines
        return block, first

    def _fill(self):
        """Read more text; False at the end of the file. An unfinished last line gets its end."""
        rest = self._text[self._at :]
        if len(rest) > LONGEST_LINE and b"\n" not in rest:
            raise self.file.refusal(
                message(
                    "cloud_file_long_line",
                    "a line of more than {bytes} bytes; expected a point in each line",
                    bytes=LONGEST_LINE,
                ),
                row=self.row + 1,
            )
        more = self._stream.read(BLOCK)
        if not more and (not rest or rest.endswith(b"\n")):
            return False
        self._text, self._at = rest + (more or b"\n"), 0
        return True


def count_lines(block):
    """Number of lines of a block that are not blank."""
    lines = block.count(b"\n")
    if block.startswith((b"\n", b"\r\n")) or b"\n\n" in block or b"\n\r\n" in block:
        lines = sum(1 for line in block.split(b"\n") if line.strip())
    return lines


def count_rows(block):
    """Number of lines of a block that are neither blank nor a comment."""
    return sum(not _is_blank_or_comment(line) for line in block.split(b"\n"))


def skip_lines(lines, wanted):
    """Skip `wanted` lines that are not blank; return the number of lines skipped."""
    done = 0
    while done < wanted:
        block, _ = lines.take(wanted - done)
        if not block:
            break
        done += count_lines(block)
    return done


def parse_rows(file, block, first_row, layout):
    """Read the coordinates of a block of lines.

    Blank lines and comments are ignored.

    Parameters
    ----------
    file : CloudFile
        File that the error names.
    block : bytes
        Whole lines.
    first_row : int
        Number of the first line in the file.
    layout : Layout
        Separator, decimal sign and columns.

    Returns
    -------
    ndarray, shape (rows, 3)
        Finite coordinates in the unit of the file.

    Raises
    ------
    InputError
        If a row does not contain three numbers; the error names the first such row.
    """
    # A carriage return within a line would be read as the end of the line.
    if b"\r" not in block or block.count(b"\r") == block.count(b"\r\n"):
        numbers = _parse(block, layout)
        if numbers is None:
            rows = [line for line in block.split(b"\n") if not _is_blank_or_comment(line)]
            numbers = _parse(b"\n".join(rows) + b"\n", layout) if rows else np.empty((0, 3))
            if numbers is not None and len(numbers) != len(rows):
                numbers = None
        if numbers is not None:
            return numbers
    raise _row_error(file, block, first_row, layout)


def _is_blank_or_comment(line):
    line = line.strip()
    return not line or line.startswith(COMMENTS)


def _parse(block, layout):
    """Read the numbers of a block; None if a cell is not a finite number."""
    import pandas as pd

    separator = {"blank": r"\s+", "tab": "\t"}.get(layout.separator, layout.separator)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            table = pd.read_csv(
                io.BytesIO(block),
                sep=separator,
                decimal=layout.decimal,
                header=None,
                usecols=list(layout.columns),
                dtype=np.float64,
                engine="c",
                quoting=csv.QUOTE_NONE,
                na_filter=False,
                skipinitialspace=True,
                encoding="latin-1",
            )
    except (ValueError, OverflowError, pd.errors.ParserError):  # also for empty data
        return None
    order = np.argsort(np.argsort(layout.columns))  # pandas keeps the order of the file
    numbers = table.to_numpy().T[order].T
    return numbers if np.isfinite(numbers.sum()) and np.isfinite(numbers).all() else None


def _row_error(file, block, first_row, layout):
    """Create the InputError that names the first row without three numbers."""
    for i, line in enumerate(block.split(b"\n")):
        if _is_blank_or_comment(line):
            continue
        cells = layout.cells(line)
        for name, column in zip("xyz", layout.columns, strict=True):
            cell = cells[column] if column < len(cells) else b""
            if layout.number(cell) is None or b"\r" in line.rstrip(b"\r"):
                return file.refusal(
                    message(
                        "cloud_file_number",
                        "{name}: found {found!r}; expected a number",
                        name=name,
                        found=printable_start(cell),
                    ),
                    row=first_row + i,
                )
    return file.refusal(
        message("cloud_file_rows", "its rows are not of numbers alone"), row=first_row
    )


def printable_start(cell):
    """First printable letters of a cell, for a message."""
    text = cell[:40].decode("utf-8", errors="replace")
    return "".join(c if c.isprintable() else "?" for c in text)


def whole_number(line):
    """Whole number in a line of bytes; None if the line has other contents."""
    return int(line) if line is not None and re.fullmatch(rb"\d{1,18}", line) else None


MOST_SCANS = 10_000
RIGID = 1e-3  # tolerance of an orthonormal matrix, for rotations written with few digits
LAYOUT = Layout()


def describe_ptx(file):
    """Return format and scan headers of a PTX file; the lines of each scan are counted."""
    return "ptx", tuple(_describe(file, _ptx_header))


def describe_pts(file):
    """Return format and scan headers of a PTS file, one per block; the lines are counted."""
    return "pts", tuple(_describe(file, _pts_header))


def ptx_pieces(file, chunk):
    """Yield the points of a PTX file, without directions that have no return."""
    for piece in _pieces(file, chunk, _ptx_header):
        x, y, z = piece.xyz.T
        has_return = (x != 0) | (y != 0) | (z != 0)
        xyz = piece.xyz if has_return.all() else piece.xyz.T[:, has_return].T
        yield Piece(piece.scan, xyz, piece.read)


def pts_pieces(file, chunk):
    """Yield the points of a PTS file."""
    return _pieces(file, chunk, _pts_header)


def is_ptx(lines):
    """Whether the first lines that are not blank are the header of a PTX scan."""
    counts = [whole_number(line) for line in lines[:2]]
    cells = [len(line.split()) for line in lines[2:10]]
    return None not in counts and cells == [3, 3, 3, 3, 4, 4, 4, 4]


def is_pts(lines):
    """Whether the first lines that are not blank are a count and a row of points."""
    return len(lines) > 1 and whole_number(lines[0]) is not None and len(lines[1].split()) >= 3


def _describe(file, read_header):
    scans = []
    with file.path.open("rb") as stream:
        lines = Lines(file, stream)
        while (scan := read_header(file, lines)) is not None:
            _check_size(file, scan, lines.row)
            lines_read = skip_lines(lines, scan.declared)
            if lines_read < scan.declared:
                raise _scan_count_error(file, len(scans), scan, lines_read)
            scans.append(scan)
            if len(scans) > MOST_SCANS:
                raise file.refusal(
                    message(
                        "cloud_file_scans",
                        "holds more than {most} scans; expected points in some of them",
                        most=MOST_SCANS,
                    )
                )
    if not sum(scan.declared for scan in scans):
        raise no_points(file)
    return scans


def _check_size(file, scan, row):
    if scan.declared * LEAST_ROW > file.bytes + LEAST_ROW:
        raise file.refusal(
            message(
                "cloud_file_text_room",
                "declares {declared} points; {size} bytes have no room for them: is it cut or "
                "damaged?",
                declared=scan.declared,
                size=file.bytes,
            ),
            row=row,
        )


def _scan_count_error(file, number, scan, points_read):
    return (
        count_mismatch(file, scan.declared, points_read)
        if number == 0
        else file.refusal(
            message(
                "cloud_file_scan_count",
                "scan {number} declares {declared} points and holds {found}; expected the same "
                "number: is the file cut or damaged?",
                number=number + 1,
                declared=scan.declared,
                found=points_read,
            )
        )
    )


def _pieces(file, chunk, read_header):
    with file.path.open("rb") as stream:
        lines, number = Lines(file, stream), 0
        while (scan := read_header(file, lines)) is not None:
            left = scan.declared
            while left:
                block, row = lines.take(min(left, chunk))
                if not block:
                    raise _scan_count_error(file, number, scan, scan.declared - left)
                xyz = parse_rows(file, block, row, LAYOUT)
                left -= len(xyz)
                yield Piece(number, xyz, len(xyz))
            number += 1


def _ptx_header(file, lines):
    """Read the next `ScanHeader`; None at the end of the file."""
    columns = lines.next_line()
    if columns is None:
        return None
    row, sizes = lines.row, (whole_number(columns), whole_number(lines.next_line()))
    if None in sizes:
        raise file.refusal(
            message(
                "cloud_file_ptx_size",
                "found {found!r}; expected the numbers of columns and of rows of a scan, each in a "
                "line of its own",
                found=printable_start(columns),
            ),
            row=row,
        )
    row, position = lines.row, [_numbers(lines.next_line(), 3) for _ in range(4)]
    matrix = [_numbers(lines.next_line(), 4) for _ in range(4)]
    if None in position or None in matrix or not _is_rigid(np.array(matrix).T):
        raise file.refusal(
            message(
                "cloud_file_ptx_frame",
                "after the size of a scan: expected its position and three axes, 3 numbers each, "
                "and four lines of 4 numbers that turn and shift without a change of size",
            ),
            row=row + 1,
        )
    return ScanHeader("", sizes[0] * sizes[1], np.array(matrix).T)


def _numbers(line, wanted):
    """Read `wanted` finite numbers from a line; None if the line has other contents."""
    cells = [] if line is None else LAYOUT.cells(line)
    numbers = [LAYOUT.number(cell) for cell in cells]
    return None if len(numbers) != wanted or None in numbers else numbers


def _is_rigid(pose):
    # A rotation is orthonormal with a positive determinant.
    turn = pose[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(turn @ turn.T - np.eye(3)).max()
        is_turn = error < RIGID and np.linalg.det(turn) > 0
    return bool(is_turn) and np.allclose(pose[3], [0, 0, 0, 1], atol=1e-9)


def _pts_header(file, lines):
    line = lines.next_line()
    if line is None:
        return None
    count = whole_number(line)
    if count is None:
        raise file.refusal(
            message(
                "cloud_file_pts_count",
                "found {found!r}; expected the number of points that follow, alone in its line, or "
                "the end of the file",
                found=printable_start(line),
            ),
            row=lines.row,
        )
    return ScanHeader("", count)
