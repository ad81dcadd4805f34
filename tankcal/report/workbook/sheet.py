"""A worksheet of XlsxWriter that takes and writes numbers by columns and rows: the same bytes.

XlsxWriter asks of each cell what kind it is, and escapes each of its attributes. A table has a
hundred thousand numbers, of which all that differs is the number.
"""

from math import isfinite
from typing import NamedTuple

from xlsxwriter.utility import xl_col_to_name
from xlsxwriter.worksheet import CellNumberTuple, CellStringTuple, Worksheet

_ROWS_OF_A_SPAN = 16  # XlsxWriter names the columns in use of so many rows at once


class NumberRow(NamedTuple):
    """A row of nothing but numbers: as cells they would take ten times the memory.

    values  from the first column on; None leaves a cell blank
    looks   the format of each
    """

    values: list
    looks: tuple

    def columns(self):
        """Those that are not blank."""
        if None not in self.values:
            return range(len(self.values))
        return [column for column, value in enumerate(self.values) if value is not None]


class Sheet(Worksheet):
    """A worksheet for many numbers."""

    def write_numbers(self, first_row, column, values, looks):
        """Write numbers from the first row down, each with its format; None leaves a cell blank.

        Raises TypeError for a number that is not finite.
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
        """Write a `NumberRow` into each row from the first one down.

        Raises TypeError for a number that is not finite.
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
        """The first and the last column in use of each 16 rows."""
        found = {}
        for row, cells in self.table.items():
            columns = cells.columns() if type(cells) is NumberRow else cells
            if columns:
                found.setdefault(row // _ROWS_OF_A_SPAN, []).extend((min(columns), max(columns)))
        self.row_spans = {
            span: f"{min(columns) + 1}:{max(columns) + 1}" for span, columns in found.items()
        }

    def _write_rows(self):
        """Every row that has cells or a height."""
        self._calculate_spans()
        names = [xl_col_to_name(column) for column in range(self.dim_colmax + 1)]
        indices = {}  # of formats
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
                told = f'"><v>{cell.number:.16G}</v></c>'
            else:
                told = f'" t="s"><v>{cell.string}</v></c>'
            self.fh.write(f'<c r="{names[column]}{row + 1}" s="{index}{told}')

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
