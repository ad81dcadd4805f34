"""Which mark separates the cells of a text table, by the text itself."""

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
    found = [mark for mark in BY_CERTAINTY if mark in heading]
    if len(found) == 1:
        return found[0]
    return find_separator(lines) if found else usual
