"""The field sheets as a workbook: the tables of the paper, to sort, filter and print."""

import tankcal
from tankcal.report import numbers
from tankcal.report.plain import Column
from tankcal.report.planning import sketches
from tankcal.report.planning.rows import field_tables
from tankcal.report.planning.stands import stands
from tankcal.report.planning.wall_rows import field_tables_of_wall
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.look import Column as Cells
from tankcal.report.workbook.sections import CellTable, Picture, SheetContent, write_workbook

ONE_PER_SHEET = (
    *("targets", "others", "stations", "photographs", "setups", "ties", "bases", "control"),
)
LANDSCAPE = ("ties", "setups", "circumferences", "runs", "tangents")
EQUIPMENT = ("cameras", "instruments")
SKETCHES = {"wall": sketches.wall, "stands": stands}
FIRST = {"targets": ("point", "line", "row")}  # columns of a sheet before those of the paper
COUNTED = ("line", "row", "course")  # columns of names that sort as numbers if they are numbers
LONGEST = 30  # letters of a column without wrapped text


def write(paper, path):
    """Write the workbook of a PlanPaper; equal plans give equal bytes."""
    tables = field_tables(paper.prediction)
    names = [name for name in ONE_PER_SHEET if name in tables]
    _write(paper, path, tables, names, SKETCHES)


def write_wall(paper, path):
    """Write the workbook of a WallPaper, one sheet per table."""
    tables = field_tables_of_wall(paper.plan)
    names = [name for name in tables if name not in EQUIPMENT]
    _write(paper, path, tables, names, {})


def _write(paper, path, tables, names, sketches):
    """Write sketches, a sheet for each name of a table, and the sheet of the equipment.

    Parameters
    ----------
    paper : PlanPaper
    path : str or Path
    tables : dict
        {name: (rows, columns of the paper)}.
    names : list of str
        Tables with a separate sheet.
    sketches : dict
        {name: draw}; draw(paper) returns a figure of matplotlib.
    """
    job = paper.plan.job
    head = workbook_head(tankcal.__version__, tank=job.tank.id, date=job.survey.date)

    def sheets(book):
        if sketches:
            pictures = (
                Picture(name, draw(paper), paper.word(f"captions.{name}_alt"))
                for name, draw in sketches.items()
            )
            yield SheetContent("sketches", [tuple(pictures)], landscape=False, tab="input")
        for name in names:
            yield _tables_sheet(paper, name, {name: tables[name]})
        equipment = {name: tables[name] for name in EQUIPMENT if name in tables}
        if equipment:
            yield _tables_sheet(paper, "equipment", equipment)

    write_workbook(paper, path, "plan", head, sheets)


def _tables_sheet(paper, code, tables):
    """Return a sheet of tables below each other; a single table can be sorted."""
    is_single = len(tables) == 1
    sections = [
        CellTable(
            name,
            [_cells(paper, rows, column) for column in _columns_of(name, of_paper)],
            title="" if is_single else paper.word(f"captions.{name}"),
            is_editable=True,
        )
        for name, (rows, of_paper) in tables.items()
    ]
    return SheetContent(
        code, sections, landscape=code in LANDSCAPE, tab="input", is_filtered=is_single
    )


def _columns_of(name, of_paper):
    """Return the columns of a sheet: sort keys first, then the columns of the paper."""
    first = FIRST.get(name, ())
    return [*map(Column, first), *(column for column in of_paper if column.key not in first)]


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
