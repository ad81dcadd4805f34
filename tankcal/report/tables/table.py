"""Classes `Column` and `Table` for the declaration of tables, and columns of several tables."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from tankcal.text.digits import NOTHING, decimals_of_heights, decimals_of_rows


@dataclass(frozen=True)
class Column:
    """Column of a table: key, format and media.

    A column of numbers has one of the rules `decimals`, `u`, `digits` and `height`. A column
    without rule contains texts.

    Parameters
    ----------
    key : str
        Key of the value in a row. The heading in papers is the word `table_headings.<key>`.
    unit : str
        Printed unit, a key of numbers.UNITS; "" for texts and numbers without unit.
    decimals : int or callable, optional
        Number of decimals, or a function of the row that returns it (in the workbook possibly a
        number format). With `u`, it applies if no row has an uncertainty.
    u : str, optional
        Key of the uncertainty whose two digits determine the decimals. Digits before the decimal
        mark are rounded only in the column of the uncertainty itself, and only in papers.
    least, most : int, optional
        Smallest and largest number of decimals with `u`.
    digits : int, optional
        Number of significant digits.
    height : bool
        True: a height, printed to the millimetre or finer if necessary.
    words : str, optional
        Group of words with the translations of codes.
    text : callable, optional
        text(paper, row) returns the text of a cell.
    heading : str, optional
        Key of another heading in papers.
    nothing : str
        Text for a missing value.
    align : str, optional
        One of blocks.ALIGNMENTS; None: texts left, numbers at their decimal marks.
    formulas : bool
        Whether formulas in the text are typeset as mathematics.
    on : str, optional
        Names of the tables in papers that contain the column, separated by spaces; None: all
        tables, "": no table.
    sheet : str or True, optional
        Heading in the workbook, a key of [workbook.columns]; True: heading of the papers with the
        unit; None: not in the workbook.
    named : Mapping
        Values for the placeholders of the heading in the workbook.
    width : float
        Smallest width in the workbook, in letters.
    in_sheet : Mapping
        Fields of the column with other values in the workbook.
    csv : str, optional
        Heading in the CSV file; None: not in the file.
    csv_unit : str
        Unit in the CSV file; "": unit of the record.
    optional : bool
        True: the column is omitted if no row has the key.
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
        """Whether the cells are texts, since the column has no rule for numbers."""
        rules = (self.decimals, self.u, self.digits)
        return not self.height and all(rule is None for rule in rules)


@dataclass(frozen=True)
class Table:
    """Table: columns in their order, and the selection of rows from a record.

    Parameters
    ----------
    name : str
        Name of the table. The caption in papers is the word `captions.<name>`.
    columns : tuple of Column
        Columns of the table.
    rows : callable, optional
        rows(record) returns the rows (list of dict).
    last : Mapping
        {medium: keys of its last columns, separated by spaces}. A medium is "sheet", "csv" or the
        name of a table in papers.
    csv_style : str
        Format of numbers in the CSV file.
    """

    name: str
    columns: tuple
    rows: Callable | None = None
    last: Mapping = field(default_factory=dict)
    csv_style: str = "%.12g"

    def on_paper(self, name=None, rows=None):
        """Return the columns of a table in papers; None: the table with the name of this Table."""
        name = name or self.name
        shown = [
            column for column in self.columns if column.on is None or name in column.on.split()
        ]
        return self._order_columns(name, _drop_unused(shown, rows))

    def in_workbook(self, rows=None):
        """Return the columns of the sheet in the workbook."""
        shown = [replace(column, **column.in_sheet) for column in self.columns if column.sheet]
        return self._order_columns("sheet", _drop_unused(shown, rows))

    def in_csv(self):
        """Return the columns of the CSV file."""
        return self._order_columns("csv", [column for column in self.columns if column.csv])

    def but(self, **changed):
        """Return the table with changed fields of some columns, {key: {field: value}}."""
        columns = [replace(column, **changed.get(column.key, {})) for column in self.columns]
        return replace(self, columns=tuple(columns))

    def only(self, *keys):
        """Return the table with the columns of some keys only."""
        return replace(self, columns=tuple(column for column in self.columns if column.key in keys))

    def _order_columns(self, medium, columns):
        later = self.last.get(medium, "").split()
        return sorted(
            columns, key=lambda column: later.index(column.key) if column.key in later else -1
        )


def _drop_unused(columns, rows):
    """Return the columns without optional columns whose key no row has."""
    if rows is None:
        return columns
    return [
        column
        for column in columns
        if not column.optional or any(column.key in row for row in rows)
    ]


def decimals_of_cells(column, rows, factor=1.0, rounds_whole=True):
    """Return the decimals of each cell of a column of numbers.

    Parameters
    ----------
    column : Column
        Declaration of the column.
    rows : list of dict, length n
        Rows of the table.
    factor : float, optional
        Printed value divided by the value in the row.
    rounds_whole : bool, optional
        Whether a column of uncertainties may round digits before the decimal mark, such as 417 L
        to 420 L.

    Returns
    -------
    list of int, length n
        Decimals, or other results of a callable `column.decimals`.
    """
    if column.u is None:
        if column.height:
            return decimals_of_heights([row.get(column.key) or 0.0 for row in rows])
        if callable(column.decimals):
            return [column.decimals(row) for row in rows]
        return [column.decimals] * len(rows)
    uncertainties = [(row.get(column.u) or 0.0) * factor for row in rows]
    rounds_whole = rounds_whole and column.u == column.key
    limits = {"least": None if rounds_whole else column.least, "most": column.most}
    if column.decimals is not None:
        limits["unknown"] = column.decimals
    return decimals_of_rows(uncertainties, **limits)


SETUP = Column("setup", heading="hit_setup", sheet="hit_setup", width=10)
INSTRUMENT = Column("instrument", heading="hit_instrument", sheet="hit_instrument", width=14)
PLACE = (
    SETUP,
    Column("station", heading="hit_station", sheet="hit_station", width=10),
    INSTRUMENT,
    Column("x_m", "m", decimals=3, heading="hit_x", sheet="hit_x_m"),
    Column("y_m", "m", decimals=3, heading="hit_y", sheet="hit_y_m"),
    Column("z_m", "m", decimals=3, heading="hit_z", sheet="hit_z_m"),
)
COURSE = Column("course", sheet="course", width=9)
LEVEL = Column("level_m", "m", decimals=3, sheet="strap_level_m")
CHECKS = Column("checks", decimals=0, heading="hits_compared", sheet="hits_compared")
LEAST = Column("least", decimals=0, heading="hits_least", sheet="hits_least")
ROW = Column("row", decimals=0, heading="hit_row", sheet="hit_row", width=8)
DEPARTURE = Column(
    "departure_m", "mm", decimals=2, heading="line_departure", sheet="line_departure_mm"
)
SHARED = Table(
    "hit_shared",
    (
        INSTRUMENT,
        Column("certificate", heading="tape_certificate", sheet="tape_certificate", width=14),
        Column("what", words="inputs", heading="hit_shared_what", sheet="hit_shared_what",
               width=22),
        Column("unit", heading="hit_shared_unit", sheet="hit_shared_unit", width=7),
        Column("u_before", decimals=2, heading="hit_u_before", sheet="hit_u_before"),
        Column("value", decimals=2, heading="hit_value", sheet="hit_value"),
        Column("u_after", decimals=2, heading="hit_u_after", sheet="hit_u_after"),
        Column("correlation", decimals=2, heading="hit_correlation", sheet="hit_correlation"),
    ),
    rows=lambda record: [
        {**error, "certificate": error["certificate"] or None} for error in record["hits"]["shared"]
    ],
)  # fmt: skip


def counts_of(sights):
    """Return the columns of the numbers of used and rejected sights (key of the record)."""
    return (
        Column(sights, decimals=0, heading="hits_used", sheet="hits_used"),
        Column("rejected", decimals=0, heading="hits_rejected", sheet="hits_rejected"),
    )


def certificates_of_setups(setups):
    """Return {instrument: certificate} of saved set-ups."""
    named = [setup for setup in setups if setup["instrument"]]
    return {setup["instrument"]: setup["certificate"] for setup in named}
