"""The field sheets as a workbook: the tables of the paper, to sort, filter and print."""

import io

from xlsxwriter.utility import xl_range_abs

import tankcal
from tankcal.report import numbers
from tankcal.report.plain import Column
from tankcal.report.planning import sketches
from tankcal.report.planning.rows import field_tables
from tankcal.report.planning.stands import stands
from tankcal.report.planning.wall_rows import field_tables_of_wall
from tankcal.report.workbook.book import Book, about_saved
from tankcal.report.workbook.look import Column as Cells
from tankcal.report.workbook.tables import HEAD_ROW, set_widths

ONE_PER_SHEET = (
    *("targets", "others", "stations", "photographs", "setups", "ties", "bases", "control"),
)
LANDSCAPE = ("ties", "setups", "circumferences", "runs", "tangents")
EQUIPMENT = ("cameras", "instruments")
SKETCHES = {"wall": sketches.wall, "stands": stands}
FIRST = {"targets": ("point", "line", "row")}  # columns of a sheet before those of the paper
COUNTED = ("line", "row", "course")  # columns of names that sort as numbers if they are numbers
LONGEST = 30  # letters of a column without wrapped text
DPI, PT, MARGIN_PT = 110, 72.0, 8.0


def write(paper, path):
    """Write the workbook of a PlanPaper; equal plans give equal bytes."""
    tables = field_tables(paper.prediction)
    of_sheets = {name: tables[name] for name in ONE_PER_SHEET if name in tables}
    _write(paper, path, of_sheets, tables, SKETCHES)


def write_wall(paper, path):
    """Write the workbook of a WallPaper, one sheet per table."""
    tables = field_tables_of_wall(paper.plan)
    of_sheets = {name: table for name, table in tables.items() if name not in EQUIPMENT}
    _write(paper, path, of_sheets, tables, {})


def _write(paper, path, of_sheets, tables, pictures):
    job = paper.plan.job
    about = about_saved(tankcal.__version__, tank=job.tank.id, date=job.survey.date)
    with Book(path, about, paper.words, about="plan") as book:
        if pictures:
            _draw(book, paper, pictures)
        for name, table in of_sheets.items():
            _add_sheet(book, paper, name, {name: table})
        equipment = {name: tables[name] for name in EQUIPMENT if name in tables}
        if equipment:
            _add_sheet(book, paper, "equipment", equipment)


def _add_sheet(book, paper, code, tables):
    """Add a sheet of tables, one below the other.

    A single table can be sorted, and its headings are repeated on every page.
    """
    sheet = book.sheet(code, landscape=code in LANDSCAPE, tab="input")
    columns = {
        name: [_cells(paper, rows, column) for column in _columns_of(name, of_paper)]
        for name, (rows, of_paper) in tables.items()
    }
    widths, row, is_single = set_widths(book, sheet, *columns.values()), HEAD_ROW, len(columns) == 1
    if is_single:
        book.freeze(sheet, HEAD_ROW, 1)
    for name, of_sheet in columns.items():
        if not is_single:
            book.heading(sheet, row, paper.word(f"captions.{name}"), len(of_sheet))
            row += 1
        last = book.table(sheet, row, name, of_sheet, autofilter=is_single, widths=widths)
        sheet.unprotect_range(xl_range_abs(row, 0, last, len(of_sheet) - 1), name)
        row = last + 2


def _columns_of(name, of_paper):
    """Return the columns of a sheet: sort keys first, then the columns of the paper."""
    first = FIRST.get(name, ())
    return [*map(Column, first), *(column for column in of_paper if column.key not in first)]


def _draw(book, paper, pictures):
    """Add the sheet of sketches, each in one high row."""
    sheet, row = book.sheet("sketches", tab="input"), HEAD_ROW
    for name, draw in pictures.items():
        figure, picture = draw(paper), io.BytesIO()
        figure.savefig(picture, format="png", dpi=DPI, metadata={"Software": None})
        book.set_height(sheet, row, PT * figure.get_figheight() + MARGIN_PT)
        described = {"image_data": picture, "description": paper.word(f"captions.{name}_alt")}
        sheet.insert_image(row, 0, f"{name}.png", described)
        row += 1


def _cells(paper, rows, column):
    """Return a column of the paper as a column of the workbook, numbers in the same unit."""
    unit = numbers.unit(column.unit)
    heading = paper.word(f"table_headings.{column.heading or column.key}")
    heading = f"{heading}, {unit.symbol}" if unit.symbol else heading
    is_number = column.decimals is not None or column.digits is not None
    values = [row.get(column.key) for row in rows]
    if not is_number:
        texts = zip(values, paper.column_texts(rows, column), strict=True)
        cells = ["" if value is None else text for value, text in texts]
        if column.key in COUNTED and all(text.isdecimal() for text in cells):
            return Cells(heading, list(map(int, cells)), 0)
        return Cells(heading, cells, width=min(LONGEST, max(12, *map(len, cells)) + 1))
    cells = [None if value is None else value * unit.factor for value in values]
    return Cells(heading, cells, "General" if column.decimals is None else column.decimals)
