"""The workbook file: writing of cells, properties, sheets with page set-up and protection.

Writing of values, texts and tables into the cells of a sheet.

`Sheet` writes numbers by columns and rows. XlsxWriter determines the type of each cell and escapes
each of its attributes, which is slow for a hundred thousand numbers. The output is unchanged.
"""

from datetime import datetime
from functools import cache, cached_property
from itertools import pairwise, repeat
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import xlsxwriter
from xlsxwriter.exceptions import FileCreateError
from xlsxwriter.utility import quote_sheetname, xl_col_to_name, xl_range_abs
from xlsxwriter.worksheet import CellFormulaTuple, CellNumberTuple, CellStringTuple, Worksheet

from tankcal.report.paper import Paper
from tankcal.report.workbook.look import (
    ACCENT,
    DATE,
    FONT,
    LINE_PT,
    MUTED,
    ROW_PT,
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

    def ends(self):
        """Return the indices of the first and last column that are not blank; () without any."""
        if None not in self.values:
            return (0, len(self.values) - 1) if self.values else ()
        columns = [column for column, value in enumerate(self.values) if value is not None]
        return (columns[0], columns[-1]) if columns else ()


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

    def write_formula(self, row, column, formula, look, value):
        """Write a formula of functions that Excel 2010 has.

        XlsxWriter would search each formula for the names of thirty newer functions, which takes a
        seventh of the time of the workbook.
        """
        self._take_place(row, column)
        self.table[row][column] = CellFormulaTuple(formula.removeprefix("="), look, value)

    def _take_place(self, row, column):
        if self._check_dimensions(row, column):
            raise ValueError(f"row {row + 1} is beyond the last of a sheet")

    def _calculate_spans(self):
        """Determine the first and last used column of each group of 16 rows."""
        used_columns = {}
        for row, cells in self.table.items():
            ends = cells.ends() if type(cells) is NumberRow else cells and (min(cells), max(cells))
            if ends:
                used_columns.setdefault(row // _ROWS_OF_A_SPAN, []).extend(ends)
        self.row_spans = {
            span: f"{min(columns) + 1}:{max(columns) + 1}" for span, columns in used_columns.items()
        }

    def _write_rows(self):
        """Write all rows with cells or a height."""
        self._calculate_spans()
        names = [xl_col_to_name(column) for column in range(self.dim_colmax + 1)]
        indices = {}  # {format: its index in the file}
        height = f'ht="{0.75 * self.default_row_height:.16g}" customHeight="1"'
        if self.excel_version == 2010:
            height += ' x14ac:dyDescent="0.25"'
        for row in range(self.dim_rowmin, self.dim_rowmax + 1):
            cells, info = self.table.get(row), self.row_info.get(row)
            span = self.row_spans.get(row // _ROWS_OF_A_SPAN)
            if cells:
                if info is None:
                    self.fh.write(f'<row r="{row + 1}" spans="{span}" {height}>')
                else:
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


RECORD_PROPERTY = "record.json SHA-256"  # property that `tankcal verify` reads
_A4 = 9  # Excel's code of the paper size
_INDEX_ROW, _INDEX_WIDTH = 2, 34  # first row and width of the list of sheets
_PAGE_PT = (750.0, 480.0)  # width and height, points, of A4 in landscape within the margins
_COLUMN_PT, _BESIDE_PT = 5.25, 3.75  # points per unit of column width, and per column
# Colours of the tabs by kind of sheet.
_TAB = {"result": ACCENT, "input": "#C98A00", "paper": "#8FA3B8", "origin": "#5F7A61"}
# Actions that remain possible on protected sheets.
_OPENINGS = {"sort": True, "autofilter": True, "format_columns": True, "format_rows": True}


def header_text(text):
    """Return user text for a page header: a single line of at most 50 letters, & doubled."""
    return " ".join(str(text).split())[:50].replace("&", "&&")


def workbook_head(version, *, tank=None, source="", date=None, notice="", laboratory=""):
    """Return the part of a record that a Book requires, for a saved file other than a record.

    Parameters
    ----------
    version : str
        Version of tankcal.
    tank : str, optional
        Id of the tank; None: the subject of the workbook is `source`.
    source : str, optional
        Name of the job.
    date : str, optional
        Date of the survey (ISO).
    notice, laboratory : str, optional
        Entries of the certificate.

    Returns
    -------
    dict
    """
    return {
        "tankcal": version,
        "capacity": None,
        "job": {
            "certificate": {"laboratory": laboratory, "notice": notice},
            "tank": None if tank is None else {"id": tank},
            "source": source,
            "survey": None if date is None else {"date": date},
        },
    }


class Book(Writer):
    """Workbook; a context manager that saves the file at its end.

    Parameters
    ----------
    path : str or Path
        Path of the workbook.
    record : dict
        Record, or the result of `workbook_head`.
    words : dict
        Words of the language.
    about : str, optional
        "capacity", "adjustment", "plan" or "comparison", the key of the title; None: by the record.
    hidden : collection of str, optional
        Codes of hidden sheets, which are not printed with the whole workbook.

    Attributes
    ----------
    subject : str
        Subject of the workbook: the tank, or the survey.
    notice : str
        Notice of the certificate, printed on every sheet; "" for none.
    """

    def __init__(self, path, record, words, about=None, hidden=()):
        self._path, self._record = path, record
        self._hidden, self._sheets = hidden, []
        options = {
            "strings_to_formulas": False,
            "strings_to_urls": False,
            "strings_to_numbers": False,
            # Sheets are stored in files, since memory would hold them three times.
            "tmpdir": str(Path(path).parent),
            "default_format_properties": dict(FONT),
        }
        super().__init__(xlsxwriter.Workbook(str(path), options), words)
        job = record["job"]
        certificate, tank = job["certificate"], job["tank"]
        name = tank["id"] if tank else job["source"]
        self.subject = f"{words['page']['tank' if tank else 'survey']} {name}"
        self.notice = str(certificate.get("notice") or "")
        self._made_by = f"tankcal {record['tankcal']}"
        self._number = certificate.get("number") or ""
        self._set_properties(certificate, name, record, about)

    def _set_properties(self, certificate, name, record, about):
        """Set the properties of the file: title, author, company, language, date."""
        kind = about or ("capacity" if record["capacity"] else "adjustment")
        laboratory = str(certificate.get("laboratory") or "")
        self._file.set_properties(
            {
                "title": self.word(f"document.{kind}", name=name),
                "subject": self.notice or self.subject,
                "author": str(certificate.get("operator") or laboratory),
                "company": laboratory,
                "comments": self.word("document.comments", program=self._made_by),
                "created": _created(certificate.get("date_of_issue"), record["job"]["survey"]),
            }
        )
        self._file.set_custom_property("Language", self.words["language"]["code"], "text")

    def name_record(self, digest):
        """Store the SHA-256 of the record.json as a property of the file."""
        self._file.set_custom_property(RECORD_PROPERTY, digest, "text")

    @cached_property
    def paper(self):
        """Formatter of the record in the language of the workbook, for declared tables."""
        return Paper(self._record, self.words)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None:
            try:
                self._file.close()
            except FileCreateError as failure:
                raise OSError(f"{self._path}: the workbook cannot be written: {failure}") from None

    # ---- sheets

    def sheet(self, code, subtitle="", landscape=False, tab="paper"):
        """Add a protected sheet with title, page set-up, header and footer.

        Parameters
        ----------
        code : str
            Key of the name in [workbook.sheets] and of the title in [workbook.titles].
        subtitle : str, optional
            Text in the second row, after subject and notice.
        landscape : bool, optional
            True: the sheet is printed in landscape.
        tab : str, optional
            Kind of the sheet, which determines the colour of its tab: "result", "input", "paper" or
            "origin".

        Returns
        -------
        Sheet
        """
        sheet = self._page(code, landscape, tab)
        self.set_height(sheet, 0, 24)
        look = self.format(bold=True, font_size=15, font_color=ACCENT)
        sheet.write_string(0, 0, self.word(f"titles.{code}"), look)
        line = " · ".join(part for part in (self.subject, self.notice, subtitle) if part)
        sheet.write_string(1, 0, line, self.format(font_color=MUTED))
        return sheet

    def write_index(self):
        """Write links to the visible sheets, and the names of hidden sheets, into the first sheet.

        The list lies to the right of the printed area.
        """
        (_, first), *others = self._sheets
        column = first.dim_colmax + 2
        first.print_area(0, 0, first.dim_rowmax, first.dim_colmax)
        first.set_column(column, column, _INDEX_WIDTH)
        head, link = self.format(bold=True, font_color=ACCENT), self.format(font_color=ACCENT)
        first.write_string(_INDEX_ROW, column, self.word("labels.index"), head)
        shown = [sheet.get_name() for code, sheet in others if code not in self._hidden]
        for row, name in enumerate(shown, _INDEX_ROW + 1):
            first.write_url(row, column, f"internal:'{name}'!A1", link, name)
        names = [sheet.get_name() for code, sheet in others if code in self._hidden]
        row = _INDEX_ROW + len(shown) + 2
        for text in [self.word("labels.index_hidden"), *names] if names else ():
            first.write_string(row, column, text, self.format(font_color=MUTED))
            row += 1

    def plain_sheet(self, code, columns, landscape=False, tab="origin"):
        """Add a protected sheet of columns with headings in row 1, for other programs.

        A cell with None remains blank.

        Parameters
        ----------
        columns : list of Column
            Columns of the sheet.
        code, landscape, tab
            As in `sheet`.

        Returns
        -------
        Sheet
        """
        sheet = self._page(code, landscape, tab)
        self.widths(sheet, *(column.width for column in columns))
        lines = max(lines_of(column.heading, 0.85 * column.width) for column in columns)
        sheet.set_row(0, LINE_PT * lines + 3)
        self.freeze(sheet, 0)
        for place, column in enumerate(columns):
            sheet.write_string(0, place, column.heading, self._head(column))
        digits = (
            column.digits
            if isinstance(column.digits, list)
            else repeat(column.digits, len(column.cells))
            for column in columns
        )
        looks = cache(
            lambda shown: tuple(self.format(num_format=number_format(places)) for places in shown)
        )
        cells = zip(*(column.cells for column in columns), strict=True)
        rows = zip(cells, map(looks, zip(*digits, strict=True)), strict=True)
        sheet.write_number_rows(1, (NumberRow(*row) for row in rows))
        return sheet

    def _page(self, code, landscape, tab):
        """Add a protected sheet with page set-up, header and footer."""
        name = self.sheet_name(code)
        sheet = self._file.add_worksheet(name, Sheet)
        self._sheets.append((code, sheet))
        if code in self._hidden:
            sheet.hide()
        sheet.hide_gridlines(2)
        sheet.set_default_row(ROW_PT)
        sheet.set_tab_color(_TAB[tab])
        sheet.set_paper(_A4)
        if landscape:
            sheet.set_landscape()
        sheet.fit_to_pages(1, 0)
        sheet.center_horizontally()
        sheet.set_margins(left=0.6, right=0.6, top=0.8, bottom=0.75)
        sheet.set_header(
            f"&L&9 {header_text(self.subject)}&C&9&B {header_text(self.notice)}"
            f"&R&9 {header_text(name)}"
        )
        page = self.words["page"]
        number = f"{page['number']} {header_text(self._number)}" if self._number else ""
        pages = page["footer"].format(page="&P", pages="&N")
        sheet.set_footer(f"&L&9 {self._made_by}&C&9 {number}&R&9 {pages}")
        sheet.protect("", _OPENINGS)
        return sheet

    def keep_together(self, sheet, starts, last, widths):
        """Set page breaks in landscape so that blocks of rows are not divided.

        Parameters
        ----------
        sheet : Sheet
            Sheet with the blocks.
        starts : list of int
            First row of each block, in ascending order.
        last : int
            Last row of the sheet.
        widths : list of float
            Widths of the columns, which determine the scale of the print.
        """
        wide_pt = sum(_COLUMN_PT * width + _BESIDE_PT for width in widths)
        page_pt = _PAGE_PT[1] * max(wide_pt / _PAGE_PT[0], 1.0)
        name, used, breaks = sheet.get_name(), 0.0, []
        for start, end in pairwise([0, *starts, last + 1]):
            high = sum(self._heights.get((name, row), LINE_PT) for row in range(start, end))
            if used and used + high > page_pt:
                breaks.append(start)
                used = 0.0
            used += high
        sheet.set_h_pagebreaks(breaks)

    def name(self, name, sheet, first_row, last_row, column, last_column=None):
        """Define a name for the cells of columns; names do not depend on the language.

        Parameters
        ----------
        name : str
            Name to define.
        sheet : Sheet
            Sheet of the cells.
        first_row, last_row, column : int
            Position of the cells, from 0.
        last_column : int, optional
            Last column; None: a single column.
        """
        cells = xl_range_abs(first_row, column, last_row, last_column or column)
        self._file.define_name(name, f"={quote_sheetname(sheet.get_name())}!{cells}")

    def chart(self, subtype="straight"):
        """Add a scatter chart; `subtype` None: without lines between the points."""
        options = {"type": "scatter"} | ({"subtype": subtype} if subtype else {})
        return self._file.add_chart(options)


def _created(issued, survey):
    """Return the date of issue, or of the survey, or a fixed date for reproducible bytes."""
    date = day(issued) or day(survey and survey["date"]) or datetime(2000, 1, 1)
    return datetime(date.year, date.month, date.day)
