"""Files of a prediction: plan.json, CSV files, and the field sheets as a workbook.

The headings of the CSV files contain units. The workbook has the tables of the paper, to sort,
filter and print.
"""

import tankcal
from tankcal.record import save
from tankcal.record.plan import plain_of, plain_of_wall
from tankcal.report import numbers
from tankcal.report.plain import Column
from tankcal.report.planning import figures
from tankcal.report.planning.figures import stands
from tankcal.report.planning.rows import field_tables, field_tables_of_wall, place_of_change
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.look import Column as Cells
from tankcal.report.workbook.sections import CellTable, Picture, SheetContent, write_workbook
from tankcal.text.delimited import write_guarded

PLACE = ("arc_m", "off_m", "height_m")  # position of an added item
ONE_PER_SHEET = (
    *("targets", "others", "stations", "photographs", "setups", "ties", "bases", "control"),
)
LANDSCAPE = ("ties", "setups", "circumferences", "runs", "tangents")
EQUIPMENT = ("cameras", "instruments")
SKETCHES = {"wall": figures.wall, "stands": stands}
FIRST = {"targets": ("point", "line", "row")}  # columns of a sheet before those of the paper
COUNTED = ("line", "row", "course")  # columns of names that sort as numbers if they are numbers
LONGEST = 30  # letters of a column without wrapped text


def write_files(paper, folder, fingerprints):
    """Write plan.json and the CSV files of a plan of targets.

    Parameters
    ----------
    paper : PlanPaper
    folder : Path
    fingerprints : list of dict
        {file, sha256} of the files of the empty job, which distinguish it from a completed job.
    """
    plan = plain_of(paper.prediction, paper.simulated, fingerprints)
    save(plan, folder / "plan.json")
    points = [
        [
            point["name"], point["rays"], *map(_mm, point["sd_m"]),
            point["undetermined"], point["weak"],
        ]
        for point in plan["points"]
    ]  # fmt: skip
    sections = [
        [
            section["name"], section["height_m"], section["targets"],
            *map(_mm, section["centre_sd_m"]), _mm(section["radius_sd_m"]),
        ]
        for section in plan["sections"]
    ]  # fmt: skip
    _write_table(folder / "points.csv", "point rays sx_mm sy_mm sz_mm undetermined weak", points)
    headings = "section height_m targets centre_sx_mm centre_sy_mm radius_s_mm"
    _write_table(folder / "sections.csv", headings, sections)
    _write_capacity(plan, folder)
    _write_effects(paper, folder)


def write_wall_files(paper, folder, fingerprints):
    """Write plan.json and the CSV files of a plan of the bare wall.

    Parameters are those of `write_files`, with a WallPaper.
    """
    plan = plain_of_wall(paper.prediction, paper.simulated, fingerprints)
    save(plan, folder / "plan.json")
    _write_capacity(plan, folder)
    _write_effects(paper, folder)


def _write_capacity(plan, folder):
    """Write capacity.csv of the plain data of a plan."""
    table = plan["table"]
    _write_table(folder / "capacity.csv", " ".join(table), zip(*table.values(), strict=True))


def _write_effects(paper, folder):
    """Write changes.csv and design.csv, if there are effects or steps."""
    steps = () if paper.design is None else paper.design.steps
    headings = f"action item name {' '.join(PLACE)} cost relative_u difference U_m3 why"
    for name, effects in (("changes.csv", paper.effects), ("design.csv", steps)):
        rows = [
            [
                effect.change.action, effect.change.item, effect.change.name,
                *_place(effect.change), effect.change.cost,
                effect.relative_u, effect.difference, effect.U_m3, effect.why,
            ]
            for effect in effects
        ]  # fmt: skip
        if rows:
            _write_table(folder / name, headings, rows)


def _place(change):
    """Return the position of an added item as texts; "" if it has none."""
    place = place_of_change(change)
    return [f"{place[key]:.3f}" if key in place else "" for key in PLACE]


def _mm(metres):
    return "" if metres is None else f"{1000 * metres:.4f}"


def _write_table(path, headings, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        write_guarded(file, [headings.split(), *rows])


# ---- field sheets as a workbook


def write_sheets(paper, path):
    """Write the workbook of a PlanPaper; equal plans give equal bytes."""
    tables = field_tables(paper.prediction)
    names = [name for name in ONE_PER_SHEET if name in tables]
    _write_sheets(paper, path, tables, names, SKETCHES)


def write_wall_sheets(paper, path):
    """Write the workbook of a WallPaper, one sheet per table."""
    tables = field_tables_of_wall(paper.plan)
    names = [name for name in tables if name not in EQUIPMENT]
    _write_sheets(paper, path, tables, names, {})


def _write_sheets(paper, path, tables, names, sketches):
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
