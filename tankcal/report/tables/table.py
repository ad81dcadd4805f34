"""What a table is declared with: `Column` and `Table`, and the digits of the cells of a column."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from tankcal.text.digits import NOTHING, decimals_of_height, decimals_of_rows


@dataclass(frozen=True)
class Column:
    """A column of a table: where its values are, how they are written, and who shows them.

    Of the rules for numbers (decimals, u, digits, height) one is given; none: text.

    Parameters
    ----------
    key : str
        Key of the value in each row; on paper its heading is word `table_headings.<key>`.
    unit : str
        Unit in which it is shown, one of numbers.UNITS; "" for text and bare numbers.
    decimals : int or callable, optional
        So many, or what gives them from a row (in the workbook maybe a number format); beside
        `u`: where no row has an uncertainty.
    u : str, optional
        Key of the uncertainty that sets the decimals (two digits of it); whole digits are rounded
        off in the column of that uncertainty alone, and on paper only.
    least, most : int, optional
        Never fewer decimals, nor more, where an uncertainty may be the rounding of what is exact.
    digits : int, optional
        So many significant digits.
    height : bool
        A height, in millimetres or finer where it must be.
    words : str, optional
        Group of words that a code is looked up in.
    text : callable, optional
        Gives the text of a cell from (paper, row).
    heading : str, optional
        Key of another heading on paper.
    nothing, align, formulas
        What is printed for no value; one of blocks.ALIGNMENTS (None: text to the left, numbers by
        their decimal marks); whether formulas of the record in this text are set as such.
    on : str, optional
        Names of the papers' tables that show it, with blanks between; None: all, "": none.
    sheet : str or True, optional
        Its heading in the workbook, a key of [workbook.columns]; True: that of the paper with its
        unit; None: the workbook does not show it.
    named, width, in_sheet
        Values for the places in that heading; least width in letters; fields of this column that
        are others in the workbook.
    csv, csv_unit : str, optional
        Its heading in the CSV file, None: it is not there; its unit there, "": that of the record.
    optional : bool
        It is left out where no row has the key.
    """

    key: str
    unit: str = ""
    decimals: int | Callable | None = None
    u: str | None = None
    least: int = 0
    most: int | None = None
    digits: int | None = None
    height: bool = False
    words: str | None = None
    heading: str | None = None
    nothing: str = NOTHING
    align: str | None = None
    formulas: bool = False
    text: Callable | None = None
    on: str | None = None
    sheet: str | bool | None = None
    named: Mapping = field(default_factory=dict)
    width: float = 12
    in_sheet: Mapping = field(default_factory=dict)
    csv: str | None = None
    csv_unit: str = ""
    optional: bool = False

    @property
    def is_text(self):
        """Whether its cells are texts: no rule says how a number is written."""
        rules = (self.decimals, self.u, self.digits)
        return not self.height and all(rule is None for rule in rules)


@dataclass(frozen=True)
class Table:
    """Columns in their order, and the rows of the record that they are of.

    Parameters
    ----------
    name : str
        On paper its caption is word `captions.<name>`; name of the table in the workbook and,
        with ".csv", of the file.
    columns : tuple of Column
    rows : callable, optional
        Gives the rows, dicts, from a record.
    last : Mapping
        {"sheet", "csv" or the name of a paper's table: keys, with blanks between, of the columns
        that stand last there}.
    csv_style : str
        How the file writes numbers.
    """

    name: str
    columns: tuple
    rows: Callable | None = None
    last: Mapping = field(default_factory=dict)
    csv_style: str = "%.12g"

    def on_paper(self, name=None, rows=None):
        """The columns of the paper's table of that name (None: its own)."""
        name = name or self.name
        shown = [one for one in self.columns if one.on is None or name in one.on.split()]
        return self._in_order(name, _known(shown, rows))

    def in_workbook(self, rows=None):
        """The columns of its sheet."""
        shown = [replace(one, **one.in_sheet) for one in self.columns if one.sheet]
        return self._in_order("sheet", _known(shown, rows))

    def in_csv(self):
        """The columns of its file."""
        return self._in_order("csv", [one for one in self.columns if one.csv])

    def but(self, **changed):
        """The same table with other fields of some columns: {key: {field: value}}."""
        columns = [replace(one, **changed.get(one.key, {})) for one in self.columns]
        return replace(self, columns=tuple(columns))

    def only(self, *keys):
        """The same table with these columns alone."""
        return replace(self, columns=tuple(one for one in self.columns if one.key in keys))

    def _in_order(self, medium, columns):
        later = self.last.get(medium, "").split()
        return sorted(columns, key=lambda one: later.index(one.key) if one.key in later else -1)


def _known(columns, rows):
    """The columns without those that are optional and that no row knows."""
    if rows is None:
        return columns
    return [one for one in columns if not one.optional or any(one.key in row for row in rows)]


def decimals_of_cells(column, rows, factor=1.0, rounds_whole=True):
    """Decimals of each cell of a column of numbers, shown as `factor` times its value.

    Parameters
    ----------
    rounds_whole : optional
        Whether a column of uncertainties may round whole digits off: 417 L to 420 L.
    """
    if column.u is None:
        if column.height:
            return [decimals_of_height(row.get(column.key) or 0.0) for row in rows]
        if callable(column.decimals):
            return [column.decimals(row) for row in rows]
        return [column.decimals] * len(rows)
    of_rows = [(row.get(column.u) or 0.0) * factor for row in rows]
    rounds_whole = rounds_whole and column.u == column.key
    limits = {"least": None if rounds_whole else column.least, "most": column.most}
    if column.decimals is not None:
        limits["unknown"] = column.decimals
    return decimals_of_rows(of_rows, **limits)
