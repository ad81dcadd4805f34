"""Sheets declared as sections: facts, sentences, tables and figures below each other.

A `SheetContent` lists its sections in order, and `write_sheet` writes them with an empty row after
each. A section is a part or a tuple of parts, which then have no empty row between them. Every
part can have a title. The sheets of all workbooks are declared in this way (docs/house.md), except
for those with formulas, charts or names of ranges.
"""

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import TYPE_CHECKING

from xlsxwriter.utility import xl_range_abs

from tankcal.report import numbers
from tankcal.report.tables import decimals_of_cells
from tankcal.report.workbook.book import Book
from tankcal.report.workbook.look import DATE, Column, width_of
from tankcal.text.digits import NOTHING, decimals_of_each

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEAD_ROW = 3  # row of the first section, from 0
FIRST_LINE = {"bold": True, "font_size": 12}  # look of the result in the first row of a sheet
_DPI, _PT_PER_INCH, _MARGIN_PT = 110, 72.0, 8.0  # of figures: resolution, unit, margin of the row


class Part:
    """Part of a section; a subclass has `title` and `write(book, sheet, row, widths)`."""

    title = ""

    def is_empty(self):
        """Whether the part, with its title, is omitted."""
        return False


@dataclass(frozen=True)
class Facts(Part):
    """Labels with their values, a row each.

    Attributes
    ----------
    lines : sequence of (str, value, str or int or None)
        Label, value, and number format; DATE: the value is an ISO date; None: a text.
    title : str
        Heading above the facts; "" for none.
    longest : int
        Largest number of letters of a text in a single cell; a longer text is a paragraph.
    widths : tuple of float
        Widths of the columns, in letters, that determine line breaks; (): those of the sheet.
    """

    lines: Sequence
    title: str = ""
    longest: int = 0
    widths: tuple = ()

    def write(self, book, sheet, row, widths):
        """Write the facts from a row and return the next row."""
        widths = self.widths or widths
        for label, value, shown in self.lines:
            if shown == DATE:
                book.put_date(sheet, row, 1, value, align="left")
            elif shown is None and len(str(value)) > self.longest:
                book.paragraph_in(sheet, row, 1, str(value), widths[1:])
            else:
                look = {"num_format": shown} if shown else {}
                book.put(sheet, row, 1, value, align="left", valign="top", **look)
            book.label(sheet, row, label, widths[0])
            row += 1
        return row

    def is_empty(self):
        return not self.lines


@dataclass(frozen=True)
class Sentences(Part):
    """Paragraphs across all columns, a row each.

    Attributes
    ----------
    texts : sequence of str
        Paragraphs.
    title : str
        Heading above the first paragraph; "" for none.
    look : Mapping
        Properties of the format of all paragraphs.
    widths : tuple of float
        Widths of the columns, in letters, that determine line breaks; (): those of the sheet.
    """

    texts: Sequence
    title: str = ""
    look: Mapping = field(default_factory=dict)
    widths: tuple = ()

    def write(self, book, sheet, row, widths):
        """Write the paragraphs from a row and return the next row."""
        for text in self.texts:
            book.paragraph(sheet, row, text, self.widths or widths, **self.look)
            row += 1
        return row

    def is_empty(self):
        return not self.texts


@dataclass(frozen=True)
class CellTable(Part):
    """Table of columns with their cells.

    Attributes
    ----------
    name : str
        Name of the Excel table, which does not depend on the language.
    columns : list of Column
        Columns of the table.
    title : str
        Heading above the table; "" for none.
    is_optional : bool
        True: a table without rows is omitted; False: a text takes its place.
    muted : collection of int
        Indices of rows in grey italics.
    links : sequence of (str, str)
        Address and text of the links in the last column, from the first row; "": no link.
    is_editable : bool
        True: the cells can be changed although the sheet is protected.
    """

    name: str
    columns: Sequence[Column]
    title: str = ""
    is_optional: bool = False
    muted: Iterable = ()
    links: Sequence = ()
    is_editable: bool = False

    def write(self, book, sheet, row, widths, autofilter=False):
        """Write the table from a row and return the next row."""
        if not self.columns[0].cells:
            book.put(sheet, row, 0, book.word("texts.no_rows"))
            return row + 1
        last = book.table(
            sheet, row, self.name, self.columns, self.muted, autofilter=autofilter, widths=widths
        )
        look = {"bottom": 4, "align": "left", "indent": 1, "underline": 1, "font_color": "blue"}
        for below, (address, text) in enumerate(self.links, row + 1):
            if address:
                column = len(self.columns) - 1
                sheet.write_url(below, column, address, book.format(**look), text)
        if self.is_editable:
            cells = xl_range_abs(row, 0, last, len(self.columns) - 1)
            sheet.unprotect_range(cells, self.name)
        return last + 1

    def is_empty(self):
        return self.is_optional and not self.columns[0].cells


@dataclass(frozen=True)
class Picture(Part):
    """Figure of matplotlib in one high row, which page breaks cannot divide.

    Attributes
    ----------
    name : str
        Name of the picture.
    figure : Figure
        Figure of matplotlib.
    description : str
        Alternative text.
    title : str
        Heading above the figure; "" for none.
    """

    name: str
    figure: "Figure"
    description: str
    title: str = ""

    def write(self, book, sheet, row, widths):
        """Insert the figure into a row and return the next row."""
        image = io.BytesIO()
        self.figure.savefig(image, format="png", dpi=_DPI, metadata={"Software": None})
        book.set_height(sheet, row, _PT_PER_INCH * self.figure.get_figheight() + _MARGIN_PT)
        options = {"image_data": image, "description": self.description}
        sheet.insert_image(row, 0, f"{self.name}.png", options)
        return row + 1


@dataclass(frozen=True)
class DrawnPart(Part):
    """Part that a function writes.

    Attributes
    ----------
    draw : callable
        draw(book, sheet, row) writes the part from a row and returns the next row.
    title : str
        Heading above the part; "" for none.
    """

    draw: Callable
    title: str = ""

    def write(self, book, sheet, row, widths):
        """Write the part from a row and return the next row."""
        return self.draw(book, sheet, row)


def cell_table(book, table, rows=None, *, name=None, **more):
    """Return the `CellTable` of a declared table.

    Parameters
    ----------
    book : Book
        Workbook.
    table : Table
        Declaration of the table.
    rows : list of dict, optional
        Rows; None: the rows of the record.
    name : str, optional
        Name of the Excel table; None: the name of `table`.
    **more
        Further attributes of the `CellTable`.

    Returns
    -------
    CellTable
    """
    return CellTable(name or table.name, columns_of(book, table, rows), **more)


@dataclass(frozen=True)
class SheetContent:
    """Content of a sheet.

    Attributes
    ----------
    code : str
        Key of the name in [workbook.sheets] and of the title in [workbook.titles].
    sections : sequence
        Sections in order: a part (`Facts`, `Sentences`, `CellTable`, `Picture`, `DrawnPart`) or a
        tuple of parts.
    subtitle, landscape, tab
        As in `Book.sheet`.
    widths : sequence of float
        Widths of the columns, in letters; (): those of the widest table.
    least : sequence of float
        Smallest widths of the first columns.
    is_filtered : bool
        True: the headings of the single table have filters and, with the first column, stay
        visible and are repeated in print.
    repeats_headings : bool
        True: the headings of the last table are repeated in print.
    keeps_together : bool
        True: page breaks do not divide a table with a title.
    """

    code: str
    sections: Sequence
    subtitle: str = ""
    landscape: bool = True
    tab: str = "paper"
    widths: Sequence = ()
    least: Sequence = ()
    is_filtered: bool = False
    repeats_headings: bool = False
    keeps_together: bool = False


def write_sheet(book, content):
    """Write a sheet with its sections.

    Parameters
    ----------
    book : Book
        Workbook.
    content : SheetContent
        Content of the sheet.

    Returns
    -------
    Sheet
    int
        Row after the sections, from 0.
    """
    sheet = book.sheet(content.code, content.subtitle, content.landscape, content.tab)
    sections = [part if isinstance(part, tuple) else (part,) for part in content.sections]
    tables = [part for parts in sections for part in parts if isinstance(part, CellTable)]
    if content.widths:
        widths = content.widths
        book.widths(sheet, *widths)
    else:
        widths = set_widths(book, sheet, *(table.columns for table in tables), least=content.least)
    row, starts = HEAD_ROW, []
    for parts in sections:
        written = [part for part in parts if not part.is_empty()]
        for part in written:
            is_table = isinstance(part, CellTable)
            if part.title:
                if is_table:
                    starts.append(row)
                book.heading(sheet, row, part.title, len(part.columns if is_table else widths))
                row += 1
            if is_table and content.repeats_headings:
                sheet.repeat_rows(row)
            filters = {"autofilter": True} if is_table and content.is_filtered else {}
            row = part.write(book, sheet, row, widths, **filters)
        row += bool(written)
    if content.is_filtered:
        book.freeze(sheet, HEAD_ROW, 1)
    if content.keeps_together:
        book.keep_together(sheet, starts, row, widths)
    return sheet, row


def write_workbook(paper, path, kind, head, sheets, subject=None):
    """Write a workbook of declared sheets; equal content gives equal bytes.

    Parameters
    ----------
    paper : PlainPaper
        Formatter of the content in the language of the workbook; `book.paper` of the sheets.
    path : str or Path
        Path of the workbook.
    kind : str
        Key of the title in [workbook.document].
    head : dict
        Part of a record with version, tank and certificate, of `book.workbook_head`.
    sheets : callable
        sheets(book) yields each `SheetContent`.
    subject : str, optional
        Subject of the workbook; None: the tank or the job of `head`.
    """
    with Book(path, head, paper.words, about=kind) as book:
        book.paper = paper
        book.subject = subject or book.subject
        for content in sheets(book):
            write_sheet(book, content)


# ---- declared tables


def columns_of(book, table, rows=None):
    """Return the columns of a declared table with their cells.

    Parameters
    ----------
    book : Book
        Workbook.
    table : Table
        Declaration of the table.
    rows : list of dict, optional
        Rows; None: the rows of the record.

    Returns
    -------
    list of Column
    """
    rows = table.rows(book.paper.record) if rows is None else rows
    return [_cells(book, book.paper, column, rows) for column in table.in_workbook(rows)]


def _cells(book, paper, column, rows):
    """Return a declared column as a Column: numbers in its unit, or translated texts."""
    unit = numbers.unit(column.unit)
    heading = _heading(book, column, unit)
    if column.is_text or column.text:
        return Column(heading, _texts(paper, column, rows), None, column.width)
    nothing = None if column.nothing == NOTHING else column.nothing
    is_share = column.unit == "share"  # the number format converts shares to percent
    factor = 1.0 if is_share else unit.factor
    values = [row.get(column.key) for row in rows]
    cells = [
        nothing if value is None else value if factor == 1.0 else factor * value for value in values
    ]
    return Column(heading, cells, _digits(column, rows, unit.factor), column.width, is_share)


def _heading(book, column, unit):
    if column.sheet is not True:
        return book.word(f"columns.{column.sheet}", **column.named)
    heading = book.words["table_headings"][column.heading or column.key]
    return f"{heading}, {unit.symbol}" if unit.symbol else heading


def _texts(paper, column, rows):
    if column.text is not None:
        return [column.text(paper, row) for row in rows]
    values = [row.get(column.key) for row in rows]
    known = paper.words[column.words] if column.words else {}
    return [known.get(str(value), value) for value in values] if known else values


def _digits(column, rows, factor):
    if column.digits is None:
        return decimals_of_cells(column, rows, factor, rounds_whole=False)
    most = 99 if column.most is None else column.most
    values = [factor * abs(row.get(column.key) or 0.0) for row in rows]
    decimals = decimals_of_each(values, significant=column.digits)
    return [min(places, most) for places in decimals]


def set_widths(book, sheet, *tables, least=()):
    """Set the widths of the columns of a sheet to the widest of its tables.

    Parameters
    ----------
    book : Book
        Workbook.
    sheet : Sheet
        Sheet of the tables.
    *tables : list of Column
        Columns of each table.
    least : sequence of float, optional
        Smallest widths of the first columns.

    Returns
    -------
    list of float
        Widths of the columns.
    """
    widths_of_tables = [[width_of(column) for column in columns] for columns in tables]
    widths = [
        max(column_widths) for column_widths in zip_longest(least, *widths_of_tables, fillvalue=0)
    ]
    book.widths(sheet, *widths)
    return widths
