"""Names of calibrations where room is short."""

LONGEST = 24  # characters of a name in a table
SHORT = 5  # names up to this long head a column; longer ones are numbered
FEW = 8


def short(name, longest=LONGEST):
    """`name`, or its beginning and end where it is long: the whole stands in the CSV files."""
    if len(name) <= longest:
        return name
    half = (longest - 1) // 2
    return f"{name[:half]}…{name[-half:]}"


def numbered(names):
    """Labels of rows and headings of columns for a matrix of `names`: numbers where they are long.

    Returns two lists of texts.
    """
    if len(names) <= FEW and all(len(name) <= SHORT for name in names):
        return list(names), list(names)
    heads = [str(number) for number in range(1, len(names) + 1)]
    return [f"{head}  {short(name)}" for head, name in zip(heads, names, strict=True)], heads
