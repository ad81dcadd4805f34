"""Tanks of ships in the report: sounding pipe, corrections of soundings for trim and list."""

from math import dist

from tankcal.report import blocks
from tankcal.report.tables.table import Column, Table
from tankcal.text.digits import decimals_of_rows, fixed

ROUNDING_M = 0.0005  # half of the last printed digit of a sounding


def _column(key, unit="", **more):
    return Column(key, unit, heading=f"ship_{key}", sheet=True, **more)


CELLS = Table(
    "ship_cells",
    (
        _column("trim_m", "m", decimals=2),
        _column("list_deg", "deg", decimals=2),
        _column("dry_m3", "m3", decimals=3, width=16),
        _column("full_m", "m", decimals=3, width=16),
        _column("largest_m", "mm", decimals=1, width=16),
        _column("largest_U_m", "mm", digits=2, width=16),
    ),
    rows=lambda record: [_cell(cell) for cell in record["ship"]["cells"]],
)


def _cell(cell):
    """Return a row: a state of trim and list, with its largest correction and U."""
    kept = {key: cell[key] for key in ("trim_m", "list_deg", "dry_m3", "full_m")}
    indices = [index for index, value in enumerate(cell["correction_m"]) if value is not None]
    if not indices:
        return kept | {"largest_m": None, "largest_U_m": None}
    largest = max(indices, key=lambda index: abs(cell["correction_m"][index]))
    U_values = [cell["U_correction_m"][index] for index in indices]
    return kept | {
        "largest_m": cell["correction_m"][largest],
        "largest_U_m": max((U for U in U_values if U is not None), default=None),
    }


def count_beyond_pipe(record):
    """Return (length of the pipe, m; number of states in which the tank is full beyond its end)."""
    ship = record["ship"]
    length_m = dist(ship["pipe_bottom_m"], ship["pipe_top_m"])
    beyond = [cell["full_m"] for cell in ship["cells"] if cell["full_m"] > length_m + ROUNDING_M]
    return length_m, len(beyond)


def _csv_column(key, heading=None, unit=""):
    return Column(key, csv=heading or key, csv_unit=unit)


CORRECTIONS = Table(
    "ship_corrections",
    (
        _csv_column("trim_m"),
        _csv_column("list_deg"),
        _csv_column("sounding_m"),
        _csv_column("state"),
        _csv_column("correction_m", "correction_mm", "mm"),
        _csv_column("u_correction_m", "u_correction_mm", "mm"),
        _csv_column("U_correction_m", "U_correction_mm", "mm"),
        _csv_column("volume_m3"),
        _csv_column("u_m3"),
        _csv_column("U_m3"),
    ),
)
_OF_CELL = (
    "state",
    "correction_m",
    "u_correction_m",
    "U_correction_m",
    "volume_m3",
    "u_m3",
    "U_m3",
)


def corrections_columns(record):
    """Return the columns {key: values} of all corrections, by list, trim and sounding."""
    ship = record["ship"]
    count = len(ship["sounding_m"])
    columns = {key: [] for key in ("trim_m", "list_deg", "sounding_m", *_OF_CELL)}
    for cell in ship["cells"]:
        columns["trim_m"] += [cell["trim_m"]] * count
        columns["list_deg"] += [cell["list_deg"]] * count
        columns["sounding_m"] += ship["sounding_m"]
        for key in _OF_CELL:
            columns[key] += cell[key]
    return columns


def group_by_list(record):
    """Return [(list in degrees, its cells by trim)] for the tables of the report."""
    cells = record["ship"]["cells"]
    return [
        (list_deg, [cell for cell in cells if cell["list_deg"] == list_deg])
        for list_deg in record["ship"]["list_deg"]
    ]


def largest_U_m(cells, index):
    """Largest expanded uncertainty of the corrections of a sounding, m, or None."""
    values = [cell["U_correction_m"][index] for cell in cells]
    return max((U for U in values if U is not None), default=None)


ACROSS = 8  # largest number of trims in a table
DECIMALS = 1  # decimals of a correction in mm


def facts(paper):
    """Block of draft marks, bow, sounding pipe, contraction, and interpolation error."""
    ship = paper.record["ship"]
    return paper.facts(
        [
            ("ship_marks", paper.number(ship["length_between_marks_m"], "m", decimals=2)),
            ("ship_bow", paper.number(ship["bow_azimuth_deg"], "deg", decimals=1)),
            ("ship_pipe_bottom", _place(paper, ship["pipe_bottom_m"])),
            ("ship_pipe_top", _place(paper, ship["pipe_top_m"])),
            ("ship_contraction", paper.number(ship["contraction_percent"], "percent", digits=3)),
            ("ship_interpolated", paper.number(ship["interpolated_m"], "mm", decimals=DECIMALS)),
        ]
    )


def _place(paper, xyz):
    return "; ".join(paper.number(coordinate, "m", decimals=3) for coordinate in xyz)


def corrections(paper):
    """Tables of corrections for each list, with the largest U of each row.

    A paragraph before them states the number of states in which the tank is full only beyond the
    end of the pipe.
    """
    shown = _beyond_pipe(paper)
    for list_deg, cells in group_by_list(paper.record):
        for start in range(0, len(cells), ACROSS):
            shown.append(_matrix(paper, list_deg, cells[start : start + ACROSS]))
    return shown


def _beyond_pipe(paper):
    length_m, count = count_beyond_pipe(paper.record)
    if not count:
        return []
    length = paper.number(length_m, "m", decimals=3)
    cells = len(paper.record["ship"]["cells"])
    return [paper.paragraph("ship_beyond_pipe", count=count, cells=cells, length=length)]


def _matrix(paper, list_deg, cells):
    """Return the table of a list: a row per sounding, a column per trim, and the largest U."""
    soundings = paper.record["ship"]["sounding_m"]
    indices = range(len(soundings))
    heads = [[paper.word("table_headings.ship_sounding_m"), "m"]]
    columns = [[paper.number(sounding, decimals=3) for sounding in soundings]]
    for cell in cells:
        trim = paper.number(cell["trim_m"], decimals=2)
        heads.append([paper.word("texts.ship_trim", trim=trim), "mm"])
        columns.append([_correction(paper, cell, index) for index in indices])
    largest_U = [largest_U_m(cells, index) for index in indices]
    in_mm = [None if U is None else 1000 * U for U in largest_U]
    digits = decimals_of_rows([U or 0.0 for U in in_mm], least=0)
    heads.append([paper.word("table_headings.ship_U"), "mm"])
    columns.append(
        [
            None if U is None else fixed(U, decimals, paper.marks)
            for U, decimals in zip(in_mm, digits, strict=True)
        ]
    )
    rows = [list(row) for row in zip(*columns, strict=True)]
    caption = paper.word("captions.ship_matrix", list=paper.number(list_deg, "deg", decimals=2))
    align = ["decimal"] * len(heads)
    return blocks.repeat_caption(blocks.table(heads, rows, caption, align, paper.marks.decimal))


def _correction(paper, cell, place):
    if cell["state"][place]:
        return paper.word(f"ship_states.{cell['state'][place]}")
    return paper.number(1000 * cell["correction_m"][place], decimals=DECIMALS)
