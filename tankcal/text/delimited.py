"""Separator and cells of the lines of a text table."""

import csv
import re

BY_CERTAINTY = (";", "\t", ",")  # a comma may be a decimal mark


def find_separator(lines):
    """Return the separator that divides most lines into the same number of cells.

    Examples
    --------
    >>> find_separator(["dip;volume", "0,01;1,5", "0,02;3,1"])
    ';'
    """
    return max(BY_CERTAINTY, key=lambda mark: count_agreeing(lines, mark))


def count_agreeing(lines, separator):
    """Count the lines with the most frequent number of separators; -1 if this number is 0."""
    counts = [line.count(separator) for line in lines]
    usual = max(set(counts), key=lambda count: (count > 0, counts.count(count)))
    return counts.count(usual) if usual > 0 else -1


def separator_of_table(lines, usual):
    """Return the separator of a table with headings in the first line.

    Parameters
    ----------
    lines : list of str
        Lines without comments and blank lines.
    usual : str
        Separator returned for a table with one column.
    """
    heading = "".join(lines[0].split('"')[::2]) if lines else ""  # text outside quotation marks
    marks = [mark for mark in BY_CERTAINTY if mark in heading]
    if len(marks) == 1:
        return marks[0]
    return find_separator(lines) if marks else usual


def split_cells(line, separator):
    """Split a line of a CSV file into cells without surrounding blanks.

    A cell contains no line break.

    Raises
    ------
    csv.Error
        The line has an unmatched quotation mark.

    Examples
    --------
    >>> split_cells('a, "b ""c""; d" ,e  ', ",")
    ['a', 'b "c"; d', 'e']
    """
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        cells = _read_cells(line, separator)
    except csv.Error:  # `csv` accepts blanks before a quotation mark, not after it
        cells = _read_cells(_BLANKS_BEHIND[separator].sub('"', line), separator)
    return [cell.strip() for cell in cells]


_BLANKS_BEHIND = {  # pattern of blanks between a quotation mark and the end of its cell
    mark: re.compile(rf'"[^\S{mark}]+(?={mark}|$)') for mark in BY_CERTAINTY
}


def _read_cells(line, separator):
    """Split a line into cells with the strict parser of `csv`."""
    return next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True))
