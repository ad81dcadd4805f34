"""A worksheet of XlsxWriter that takes and writes numbers by columns and rows: the same bytes.

XlsxWriter asks of each cell what kind it is, and escapes each of its attributes. A table has a
hundred thousand numbers, of which all that differs is the number.
"""

from math import isfinite

from xlsxwriter.utility import xl_col_to_name
from xlsxwriter.worksheet import CellNumberTuple, CellStringTuple, Worksheet

_ROWS_OF_A_SPAN = 16  # XlsxWriter names the columns in use of so many rows at once


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
            if self._check_dimensions(row, column):
                raise ValueError(f"row {row + 1} is beyond the last of a sheet")
        for row in rows:
            value = values[row - first_row]
            if not isfinite(value):
                raise TypeError(f"row {row + 1}, column {column + 1}: {value} is no finite number")
            self.table[row][column] = CellNumberTuple(value, looks[row - first_row])

    def _calculate_spans(self):
        """The first and the last column in use of each 16 rows."""
        found = {}
        for row, cells in self.table.items():
            if cells:
                found.setdefault(row // _ROWS_OF_A_SPAN, []).extend((min(cells), max(cells)))
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
