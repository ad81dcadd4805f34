"""Numbers in text, a block of whole lines at a time, by the parser of pandas."""

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
LEAST_ROW = 6  # bytes of the shortest row of three numbers


@dataclass(frozen=True)
class Layout:
    """How three numbers stand in a row.

    Attributes
    ----------
    separator : str
        "," or ";" or "tab" or "blank" (blanks and tabs, any number of them).
    decimal : str
        "." or ",".
    columns : tuple of int
        Of x, y and z, from 0.
    """

    separator: str = "blank"
    decimal: str = "."
    columns: tuple[int, int, int] = (0, 1, 2)

    def cells(self, line):
        """The cells of a line of bytes, without blanks about them."""
        if self.separator == "blank":
            return line.split()
        mark = b"\t" if self.separator == "tab" else self.separator.encode()
        return [cell.strip() for cell in line.split(mark)]

    def number(self, cell):
        """The number of a cell as float; None where it is none, or not finite."""
        if self.decimal == ",":
            cell = cell.replace(b".", b"x").replace(b",", b".")
        if NUMBER.fullmatch(cell) is None:
            return None
        value = float(cell)
        return value if np.isfinite(value) else None


class Lines:
    """The lines of a text file, one or a block at a time, memory independent of its length.

    Attributes
    ----------
    row : int
        Of the line last given, counted as an editor shows it.
    """

    def __init__(self, file, stream):
        self.file, self.row = file, 0
        self._stream, self._text, self._at = stream, b"", 0
        self._fill()
        if self._text.startswith(b"\xef\xbb\xbf"):
            self._at = 3

    def next_line(self):
        """The next line with anything in it, without blanks about it; None at the end."""
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
        """At most so many lines as one block of bytes, b"" at the end; the row of its first."""
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
        """More text; False at the end of the file. The last line gets its end."""
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
    """Lines of a block with anything in them."""
    lines = block.count(b"\n")
    if block.startswith((b"\n", b"\r\n")) or b"\n\n" in block or b"\n\r\n" in block:
        lines = sum(1 for line in block.split(b"\n") if line.strip())
    return lines


def count_rows(block):
    """Lines of a block that are neither blank nor a comment."""
    return sum(not _is_idle(line) for line in block.split(b"\n"))


def skip_lines(lines, wanted):
    """Pass over so many lines with anything in them; how many there were."""
    done = 0
    while done < wanted:
        block, _ = lines.take(wanted - done)
        if not block:
            break
        done += count_lines(block)
    return done


def parse_rows(file, block, first_row, layout):
    """(rows, 3) finite float64 of the lines of a block; InputError naming the first bad row.

    Blank lines count for nothing, nor do those that begin as a comment does.
    """
    if b"\r" not in block or block.count(b"\r") == block.count(b"\r\n"):
        found = _parse(block, layout)
        if found is None:
            kept = [line for line in block.split(b"\n") if not _is_idle(line)]
            found = _parse(b"\n".join(kept) + b"\n", layout) if kept else np.empty((0, 3))
            if found is not None and len(found) != len(kept):
                found = None
        if found is not None:
            return found
    raise _bad_row(file, block, first_row, layout)


def _is_idle(line):
    line = line.strip()
    return not line or line.startswith(COMMENTS)


def _parse(block, layout):
    """The numbers, or None where anything in the block is none."""
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
    except (ValueError, OverflowError, pd.errors.ParserError):  # empty data, too
        return None
    order = np.argsort(np.argsort(layout.columns))  # pandas gives columns as they stand
    numbers = table.to_numpy().T[order].T
    return numbers if np.isfinite(numbers.sum()) and np.isfinite(numbers).all() else None


def _bad_row(file, block, first_row, layout):
    """The refusal that names the first row without three numbers."""
    for i, line in enumerate(block.split(b"\n")):
        if _is_idle(line):
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
                        found=shown(cell),
                    ),
                    row=first_row + i,
                )
    return file.refusal(
        message("cloud_file_rows", "its rows are not of numbers alone"), row=first_row
    )


def shown(cell):
    """Bytes of a file as a message shows them: a few letters that can be printed."""
    text = cell[:40].decode("utf-8", errors="replace")
    return "".join(c if c.isprintable() else "?" for c in text)


def whole_number(line):
    """The count that stands alone in a line of bytes; None where there is another thing."""
    return int(line) if line is not None and re.fullmatch(rb"\d{1,18}", line) else None
