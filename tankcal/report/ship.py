"""Tanks of ships in the report: sounding pipe, and corrections for trim and list."""

from tankcal.report import blocks
from tankcal.report.tables import ship as tables
from tankcal.text.digits import decimals_of_rows, fixed

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
    for list_deg, cells in tables.group_by_list(paper.record):
        for start in range(0, len(cells), ACROSS):
            shown.append(_matrix(paper, list_deg, cells[start : start + ACROSS]))
    return shown


def _beyond_pipe(paper):
    length_m, count = tables.count_beyond_pipe(paper.record)
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
    largest_U = [tables.largest_U_m(cells, index) for index in indices]
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
