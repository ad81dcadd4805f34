"""Rows of a sheet that are read: without comments; hidden and merged cells are refused."""

from bisect import bisect_left

from tankcal.job.excel import MAX_COLUMNS, column_letters
from tankcal.job.tables import shown
from tankcal.messages import message


def table_rows(place, grid, log):
    """Rows of a table in a sheet.

    A first column without a heading is reserved for marks: # switches its row off. The column is
    left out.

    Parameters
    ----------
    place : str
        Name of the sheet in messages.
    grid : Grid
        Cells of the sheet.
    log : Log
        Receives merged and hidden cells, and cells beyond the last column.

    Returns
    -------
    rows : list of (int, list)
        Row number and cells of the heading and of the rows below it.
    first_column : int
        Number of the first column.
    """
    rows = [
        (number, cells)
        for number, cells in grid.rows
        if not (isinstance(cells[0], str) and cells[0].lstrip().startswith("#"))
    ]
    for number, cells in rows:
        if len(cells) > MAX_COLUMNS:
            log.problem(
                place,
                message(
                    "beyond_last_column",
                    "cells beyond column {last}",
                    last=column_letters(MAX_COLUMNS),
                ),
                number,
            )
            del cells[MAX_COLUMNS:]
    _tell_merged(place, grid, rows, log)
    _tell_hidden(place, grid, rows, log)
    for _, cells in rows:
        cells.extend([None] * (len(rows[0][1]) - len(cells)))
    if not rows or not _is_blank(rows[0][1][0]):
        return rows, 1
    for number, cells in rows:
        if not _is_blank(cells[0]):
            expected = message(
                "in_column_of_marks",
                "found {found} in a column without a heading; expected nothing there, or # to "
                "switch the row off",
                found=shown(cells[0]),
            )
            log.place_columns(place, {"": "A"})
            log.problem(place, expected, number, "")
    return [(number, cells[1:]) for number, cells in rows], 2


def placed_columns(rows, first_column):
    """{heading: letters of its column} from the first of the rows."""
    headings = rows[0][1] if rows else []
    return {
        heading.strip(): column_letters(column)
        for column, heading in enumerate(headings, first_column)
        if isinstance(heading, str)
    }


def _is_blank(cell):
    return cell is None or (isinstance(cell, str) and not cell.strip())


def _tell_merged(place, grid, rows, log):
    numbers = [number for number, _ in rows]
    for top, bottom, left, right in grid.merged:
        nearest_row = bisect_left(numbers, top)
        if nearest_row < len(numbers) and numbers[nearest_row] <= bottom:
            cells = f"{column_letters(left)}{top}:{column_letters(right)}{bottom}"
            expected = message(
                "merged_cells",
                "the cells {cells} are merged; expected one cell for each value: unmerge them",
                cells=cells,
            )
            log.problem(place, expected, top)


def _tell_hidden(place, grid, rows, log):
    hidden = [number for number, _ in rows if number in grid.hidden_rows]
    for first, last in _runs(hidden):
        expected = message(
            "hidden_row",
            "the row is hidden, and not blank; expected visible rows: unhide or delete it",
        )
        if last > first:
            expected = message(
                "hidden_rows",
                "the rows {first} to {last} are hidden, and not blank; expected visible "
                "rows: unhide or delete them",
                first=first,
                last=last,
            )
        log.problem(place, expected, first)
    for first, last in grid.hidden_columns:
        if any(cell is not None for _, cells in rows for cell in cells[first - 1 : last]):
            left, right = column_letters(first), column_letters(last)
            expected = message(
                "hidden_column",
                "column {left} is hidden, and not blank; expected visible columns: unhide or "
                "delete it",
                left=left,
            )
            if last > first:
                expected = message(
                    "hidden_columns",
                    "one of the columns {left} to {right} is hidden, and not blank; expected "
                    "visible columns: unhide or delete it",
                    left=left,
                    right=right,
                )
            log.problem(place, expected)


def _runs(numbers):
    """(first, last) of each run of consecutive numbers."""
    runs = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], number)
        else:
            runs.append((number, number))
    return runs
