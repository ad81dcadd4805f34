"""Reading of numbers from text in blocks of whole lines, with the parser of pandas."""

import csv
import io
import re
import warnings
from dataclasses import dataclass

import numpy as np

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
