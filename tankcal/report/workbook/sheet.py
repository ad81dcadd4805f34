"""Worksheet of XlsxWriter that writes numbers by columns and rows, with unchanged output.

XlsxWriter determines the type of each cell and escapes each of its attributes. This is slow for
tables with a hundred thousand numbers.
"""

from math import isfinite
from typing import NamedTuple

from xlsxwriter.utility import xl_col_to_name
from xlsxwriter.worksheet import CellNumberTuple, CellStringTuple, Worksheet

_ROWS_OF_A_SPAN = 16  # XlsxWriter states the used columns for groups of so many rows


class NumberRow(NamedTuple):
    """Row of numbers, which needs a tenth of the memory of cells.

    Attributes
    ----------
    values : list of float or None
        Values from the first column; None leaves a cell blank.
    looks : tuple
        Format of each value.
    """

    values: list
    looks: tuple

    def columns(self):
        """Return the indices of columns that are not blank."""
        if None not in self.values:
            return range(len(self.values))
        return [column for column, value in enumerate(self.values) if value is not None]


class Sheet(Worksheet):
    """Worksheet for many numbers."""

    def write_numbers(self, first_row, column, values, looks):
        """Write numbers into a column.

        Parameters
        ----------
        first_row, column : int
            Position of the first number, from 0.
        values : list of float or None
            Numbers; None leaves a cell blank.
        looks : list
            Format of each number.

        Raises
        ------
        TypeError
            For a number that is not finite.
        """
        rows = [row for row, value in enumerate(values, first_row) if value is not None]
        if not rows:
            return
        for row in (rows[0], rows[-1]):
            self._take_place(row, column)
        for row in rows:
            value = values[row - first_row]
            if not isfinite(value):
                raise TypeError(f"row {row + 1}, column {column + 1}: {value} is no finite number")
            self.table[row][column] = CellNumberTuple(value, looks[row - first_row])

    def write_number_rows(self, first_row, rows):
        """Write each `NumberRow` into a row, from `first_row` (from 0) down.

        A number that is not finite raises TypeError.
        """
        for row, numbers in enumerate(rows, first_row):
            self._take_place(row, 0)
            self._take_place(row, len(numbers.values) - 1)
            if not all(map(isfinite, filter(None, numbers.values))):
                raise TypeError(f"row {row + 1} holds a number that is not finite")
            self.table[row] = numbers

    def _take_place(self, row, column):
        if self._check_dimensions(row, column):
            raise ValueError(f"row {row + 1} is beyond the last of a sheet")

    def _calculate_spans(self):
        """Determine the first and last used column of each group of 16 rows."""
        used_columns = {}
        for row, cells in self.table.items():
            columns = cells.columns() if type(cells) is NumberRow else cells
            if columns:
                used_columns.setdefault(row // _ROWS_OF_A_SPAN, []).extend(
                    (min(columns), max(columns))
                )
        self.row_spans = {
            span: f"{min(columns) + 1}:{max(columns) + 1}" for span, columns in used_columns.items()
        }

    def _write_rows(self):
        """Write all rows with cells or a height."""
        self._calculate_spans()
        names = [xl_col_to_name(column) for column in range(self.dim_colmax + 1)]
        indices = {}  # {format: its index in the file}
        for row in range(self.dim_rowmin, self.dim_rowmax + 1):
            cells, info = self.table.get(row), self.row_info.get(row)
            span = self.row_spans.get(row // _ROWS_OF_A_SPAN)
            if cells:
                self._write_row(row, span, info)
                if type(cells) is NumberRow:
                    self._write_number_row(row, cells, names, indices)
                else:
                    self._write_cells(row, cells, names, indices)
                self._xml_end_tag("row")
            elif info is not None:
                self._write_empty_row(row, span, info)

    def _write_cells(self, row, cells, names, indices):
        for column in sorted(cells):
            cell = cells[column]
            kind, look = type(cell), cell.format
            if look is None or kind not in (CellNumberTuple, CellStringTuple):
                self._write_cell(row, column, cell)
                continue
            index = indices.get(look)
            if index is None:
                index = indices[look] = look._get_xf_index()
            if kind is CellNumberTuple:
                rest_of_cell = f'"><v>{cell.number:.16G}</v></c>'
            else:
                rest_of_cell = f'" t="s"><v>{cell.string}</v></c>'
            self.fh.write(f'<c r="{names[column]}{row + 1}" s="{index}{rest_of_cell}')

    def _write_number_row(self, row, numbers, names, indices):
        for look in dict.fromkeys(numbers.looks):
            if look not in indices:
                indices[look] = look._get_xf_index()
        cells = [
            f'<c r="{name}{row + 1}" s="{indices[look]}"><v>{value:.16G}</v></c>'
            for name, value, look in zip(names, *numbers, strict=False)
            if value is not None
        ]
        self.fh.write("".join(cells))
