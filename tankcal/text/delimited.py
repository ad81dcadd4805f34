"""Cells of the lines of a text table, and the mark between them, by the text itself."""

import csv
import re

BY_CERTAINTY = (";", "\t", ",")  # a comma may be a decimal mark


def find_separator(lines):
    """The mark that divides most lines into equally many cells.

    Examples
    --------
    >>> find_separator(["dip;volume", "0,01;1,5", "0,02;3,1"])
    ';'
    """
    return max(BY_CERTAINTY, key=lambda mark: count_agreeing(lines, mark))


def count_agreeing(lines, separator):
    """How many lines have the most frequent number of separators, if that is not zero; else -1."""
    counts = [line.count(separator) for line in lines]
    usual = max(set(counts), key=lambda count: (count > 0, counts.count(count)))
    return counts.count(usual) if usual > 0 else -1


def separator_of_table(lines, usual):
    """The separator of a table whose first line has its headings.

    lines  without comments and blank lines
    usual  the separator of a table of one column
    """
    heading = "".join(lines[0].split('"')[::2]) if lines else ""  # what is outside the quotes
    marks = [mark for mark in BY_CERTAINTY if mark in heading]
    if len(marks) == 1:
        return marks[0]
    return find_separator(lines) if marks else usual


def split_cells(line, separator):
    """Cells of a line of a CSV file without the blanks around them; a cell holds no line break.

    Raises
    ------
    csv.Error
        The line has quotation marks without a partner.

    Examples
    --------
    >>> split_cells('a, "b ""c""; d" ,e  ', ",")
    ['a', 'b "c"; d', 'e']
    """
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        cells = _read_cells(line, separator)
    except csv.Error:  # `csv` takes blanks before a quotation mark, but none behind it
        cells = _read_cells(_BLANKS_BEHIND[separator].sub('"', line), separator)
    return [cell.strip() for cell in cells]


_BLANKS_BEHIND = {  # a quotation mark: blanks that end its cell
    mark: re.compile(rf'"[^\S{mark}]+(?={mark}|$)') for mark in BY_CERTAINTY
}


def _read_cells(line, separator):
    return next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True))
