"""Writing of values, texts and tables into the cells of a sheet.

`Sheet` writes numbers by columns and rows. XlsxWriter determines the type of each cell and escapes
each of its attributes, which is slow for a hundred thousand numbers. The output is unchanged.
"""

from math import isfinite
from typing import NamedTuple

from xlsxwriter.utility import xl_col_to_name
from xlsxwriter.worksheet import CellNumberTuple, CellStringTuple, Worksheet

from tankcal.report.workbook.look import (
    ACCENT,
    DATE,
    LINE_PT,
    MUTED,
    RULE,
    day,
    lines_in,
    lines_of,
    number_format,
    width_of,
)
from tankcal.text.digits import NOTHING

_LONGEST_CELL = 32767  # Excel's limit of the characters of a cell
_ROWS_OF_A_SPAN = 16  # XlsxWriter states the used columns for groups of so many rows


class Writer:
    """Writer for the sheets of an XlsxWriter workbook, with the words of a language."""

    def __init__(self, file, words):
        self._file = file
        self.words = words
        self._formats = {}
        self._heights = {}  # {(name of a sheet, row): points}

    # ---- words and looks

    def word(self, name, /, of="workbook", **values):
        """Return the text "group.key" of the part `of` of the words, with its values.

        A missing text raises KeyError.
        """
        group, key = name.split(".", 1)
        return self.words[of][group][key].format(**values)

    def sheet_name(self, code):
        """Return the name of a sheet in the language, as formulas must refer to it."""
        return self.word(f"sheets.{code}")

    def format(self, **properties):
        """Return the format with these XlsxWriter properties; equal formats are created once."""
        key = tuple(sorted(properties.items()))
        if key not in self._formats:
            self._formats[key] = self._file.add_format({"valign": "vcenter", **properties})
        return self._formats[key]

    # ---- cells

    def heading(self, sheet, row, text, columns):
        """Write a heading, underlined across a number of columns.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        row : int
            Row, from 0.
        text : str
            Heading.
        columns : int
            Number of underlined columns.
        """
        rule = {"bottom": 1, "bottom_color": ACCENT}
        look = self.format(bold=True, font_size=12, font_color=ACCENT, **rule)
        self.set_height(sheet, row, 21)
        self.set_height(sheet, row + 1, 18)  # otherwise the line touches the text below it
        for column in range(columns):
            sheet.write_blank(row, column, None, look)
        sheet.write_string(row, 0, text, look)

    def put(self, sheet, row, column, value, **look):
        """Write a value: numbers as numbers, other values as text, never as formula.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        row, column : int
            Position, from 0.
        value : object
            Value of the record; a list is joined by commas, None is a dash.
        **look
            Properties of the format.
        """
        if isinstance(value, bool):
            value = self.words["yes_no"]["yes" if value else "no"]
        if isinstance(value, list | tuple):
            value = ", ".join(str(item) for item in value)
        if isinstance(value, int | float):
            look = {"align": "right", **look}
            sheet.write_number(row, column, value, self.format(**look))
            return
        if value is None:
            value, look = NOTHING, {**look, "font_color": MUTED}
        look.pop("num_format", None)
        sheet.write_string(row, column, str(value)[:_LONGEST_CELL], self.format(**look))

    def put_date(self, sheet, row, column, text, **look):
        """Write an ISO date as a date of the spreadsheet, and any other text as text.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        row, column : int
            Position, from 0.
        text : str
            ISO date, or another text.
        **look
            Properties of the format.
        """
        date = day(text)
        if date is None or len(str(text)) > len(date.isoformat()):
            self.put(sheet, row, column, text, **look)
        else:
            sheet.write_datetime(row, column, date, self.format(num_format=DATE, **look))

    def paragraph(self, sheet, row, text, widths, **look):
        """Write a wrapped text across the columns of given widths and set the height of the row.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        row : int
            Row, from 0.
        text : str
            Text to write.
        widths : sequence of float
            Widths of the columns, in letters.
        **look
            Properties of the format.
        """
        self.paragraph_in(sheet, row, 0, text, widths, **look)

    def paragraph_in(self, sheet, row, column, text, widths, **look):
        """Write a wrapped text from `column` across columns of given widths.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        row, column : int
            Position of the first column, from 0.
        text : str
            Text to write.
        widths : sequence of float
            Widths of the columns, in letters.
        **look
            Properties of the format.
        """
        look = self.format(**{"text_wrap": True, "align": "left", "valign": "top", **look})
        self.set_height(sheet, row, LINE_PT * lines_of(text, sum(widths)))
        if len(widths) > 1:
            sheet.merge_range(row, column, row, column + len(widths) - 1, "", look)
        sheet.write_string(row, column, text[:_LONGEST_CELL], look)

    def label(self, sheet, row, text, width):
        """Write a wrapped label into the first column of given width; set the height of the row.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        row : int
            Row, from 0.
        text : str
            Label.
        width : float
            Width of the first column, in letters.
        """
        height = LINE_PT * lines_of(text, width)
        if height > self._heights.get((sheet.get_name(), row), LINE_PT):
            self.set_height(sheet, row, height)
        self.put(sheet, row, 0, text, valign="top", text_wrap=True)

    def set_height(self, sheet, row, points):
        """Set the height of a row, in points, and store it for `keep_together`.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        row : int
            Row, from 0.
        points : float
            Height.
        """
        sheet.set_row(row, points)
        self._heights[sheet.get_name(), row] = points

    def widths(self, sheet, *widths):
        """Set the widths of the first columns, in letters."""
        for column, width in enumerate(widths):
            sheet.set_column(column, column, width)

    @staticmethod
    def freeze(sheet, head_row, columns=0):
        """Fix the headings and the first columns, and repeat the headings on printed pages.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the cells.
        head_row : int
            Row of the headings, from 0.
        columns : int, optional
            Number of fixed columns.
        """
        sheet.freeze_panes(head_row + 1, columns)
        sheet.repeat_rows(head_row)

    # ---- tables

    def table(
        self, sheet, row, name, columns, muted=(), autofilter=False, widths=None, muted_fill=None
    ):
        """Write an Excel table.

        Parameters
        ----------
        sheet : Sheet
            Sheet of the table.
        row : int
            Row of the headings, from 0.
        name : str
            Name of the table, which does not depend on the language.
        columns : list of Column
            Columns of the table.
        muted : collection of int, optional
            Indices of rows in grey italics.
        autofilter : bool, optional
            True: the headings have filters.
        widths : list of float, optional
            Widths of the columns; None: computed from the columns.
        muted_fill : str, optional
            Background of the muted rows; None: none.

        Returns
        -------
        int
            Last row of the table.
        """
        count = len(columns[0].cells)
        muted = frozenset(muted)
        widths = widths or [width_of(column) for column in columns]
        for place, column in enumerate(columns):
            self._cells(sheet, row + 1, place, column, muted, muted_fill)
        heads = [
            {"header": column.heading, "header_format": self._head(column)} for column in columns
        ]
        options = {"name": name, "style": None, "autofilter": autofilter, "columns": heads}
        sheet.add_table(row, 0, row + count, len(columns) - 1, options)
        lines = max(
            lines_of(column.heading, width, bold=True)
            for column, width in zip(columns, widths, strict=False)
        )
        self.set_height(sheet, row, LINE_PT * lines + 3)
        self._row_heights(sheet, row + 1, columns, widths)
        return row + count

    def _cells(self, sheet, first, place, column, muted, muted_fill):
        """Write the cells of a column; each format is created once, since tables may be large."""
        cells, digits = column.cells, column.digits
        each = digits if isinstance(digits, list) else [digits] * len(cells)
        keys = [(cell_digits, index in muted) for index, cell_digits in enumerate(each)]
        looks = {
            key: self._cell_look(*key, column.percent, muted_fill) for key in dict.fromkeys(keys)
        }
        formats = {key: self.format(**look) for key, look in looks.items()}
        numbers = [value if type(value) is float else None for value in cells]
        sheet.write_numbers(first, place, numbers, [formats[key] for key in keys])
        for row, (value, key) in enumerate(zip(cells, keys, strict=True), first):
            if type(value) is str and key[0] is None:  # a column of texts
                sheet.write_string(row, place, value[:_LONGEST_CELL], formats[key])
            elif type(value) is not float:
                self.put(sheet, row, place, value, **looks[key])

    @staticmethod
    def _cell_look(digits, muted, percent, muted_fill):
        look = {"bottom": 4, "bottom_color": RULE}
        if digits is None:
            look |= {"text_wrap": True, "align": "left", "indent": 1}
        else:
            look |= {"align": "right", "num_format": number_format(digits, percent)}
        if muted:
            look |= {"italic": True, "font_color": MUTED}
            look |= {"bg_color": muted_fill} if muted_fill else {}
        return look

    def _row_heights(self, sheet, first, columns, widths):
        """Set the heights of the rows of a table for their longest texts."""
        lines_of_columns = [
            lines_in(column, width)
            for column, width in zip(columns, widths, strict=False)
            if column.digits is None
        ]
        for index, lines in enumerate(map(max, zip(*lines_of_columns, strict=True))):
            if lines > 1:
                self.set_height(sheet, first + index, LINE_PT * lines)

    def _head(self, column):
        side = {"align": "left", "indent": 1} if column.digits is None else {"align": "right"}
        colours = {"font_color": "white", "bg_color": ACCENT}
        return self.format(bold=True, text_wrap=True, **side, **colours)


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

    _looks = None  # formats of the last row without blank cells

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
        count = len(numbers.values)
        while count and numbers.values[count - 1] is None:
            count -= 1
        values = numbers.values[:count]
        if None not in values:
            # A cell without its place follows the cell before; this halves a large sheet.
            template = self._template_of(numbers.looks, count, indices)
            self.fh.write(template % tuple(values))
            return
        cells = [
            f'<c r="{name}{row + 1}" s="{indices[look]}"><v>{value:.16G}</v></c>'
            for name, value, look in zip(names, *numbers, strict=False)
            if value is not None
        ]
        self.fh.write("".join(cells))

    def _template_of(self, looks, count, indices):
        """Return the text of a row of `count` cells without blanks between, for the operator %."""
        if looks is not self._looks:
            self._looks, self._templates = looks, {}
        if count not in self._templates:
            cells = (f'<c s="{indices[look]}"><v>%.16G</v></c>' for look in looks[:count])
            self._templates[count] = "".join(cells)
        return self._templates[count]
