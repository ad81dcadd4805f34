"""What all sheets share: formats, page set-up, protection, and how tables are written."""

import re
from dataclasses import dataclass
from datetime import datetime
from math import ceil

import xlsxwriter
from xlsxwriter.exceptions import FileCreateError

ACCENT = "#1F4E79"
RULE = "#BFC9D4"
MUTED = "#595959"
INPUT = "#FFF7DB"
NONE = "–"  # what is shown where the record has no value
_FONT = {"font_name": "Arial", "font_size": 10}  # or its equal in measure, on every machine
_A4 = 9
_LINE_PT = 15.0  # height of a line of text
_MOST_LINES = 27  # Excel allows a row 409 pt
_FITS = 1.15  # letters that fit into one unit of column width, on average
_LONGEST_CELL = 32767  # characters, Excel's limit
_OPENINGS = {"sort": True, "autofilter": True, "format_columns": True, "format_rows": True}


@dataclass(frozen=True)
class Column:
    """One column of a table: heading with its unit, cells from the top down, and their look.

    digits  decimals of all cells, or a list with those of each cell, or None: text; in place of a
            number of decimals a number format of Excel
    """

    heading: str
    cells: list
    digits: int | list | None = None
    width: int = 12
    percent: bool = False


def number_format(digits, percent=False):
    """The Excel number format with so many decimals; a format stays as it is."""
    if isinstance(digits, str):
        return digits
    return "0" + ("." + "0" * digits if digits else "") + (" %" if percent else "")


def in_mm(value_m):
    """A length in m as mm; None stays None."""
    return None if value_m is None else value_m * 1000.0


def header_text(text):
    """User text as it may stand in a page header: & doubled, one line, of bearable length."""
    return " ".join(str(text).split())[:50].replace("&", "&&")


class Book:
    """A workbook being written; as a context manager it is closed, that is saved, at the end."""

    def __init__(self, path, record):
        self._path = path
        self._file = xlsxwriter.Workbook(
            str(path),
            {
                "strings_to_formulas": False,
                "strings_to_urls": False,
                "strings_to_numbers": False,
                "in_memory": True,
                "default_format_properties": dict(_FONT),
            },
        )
        self._formats = {}
        job = record["job"]
        self.subject = f"Tank {job['tank']['id']}" if job["tank"] else f"Survey {job['source']}"
        what = "Capacity table of tank" if record["capacity"] else "Adjustment of the survey:"
        name = job["tank"]["id"] if job["tank"] else job["source"]
        survey_date = job["survey"] and job["survey"]["date"]
        certificate = job["certificate"]
        self.notice = str(certificate.get("notice") or "")
        self._made_by = f"tankcal {record['tankcal']}"
        self._number = certificate.get("number") or ""
        self._file.set_properties(
            {
                "title": f"{what} {name}",
                "subject": self.notice,
                "author": str(certificate.get("laboratory") or ""),
                "comments": f"Written by {self._made_by}",
                "created": _date(certificate.get("date_of_issue"), survey_date),
            }
        )

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None:
            try:
                self._file.close()
            except FileCreateError as failure:
                raise OSError(f"{self._path}: the workbook cannot be written: {failure}") from None

    def format(self, **properties):
        """The format with these XlsxWriter properties, made once."""
        key = tuple(sorted(properties.items()))
        if key not in self._formats:
            self._formats[key] = self._file.add_format({"valign": "vcenter", **properties})
        return self._formats[key]

    def sheet(self, name, title, subtitle="", landscape=False):
        """A new protected sheet with its title, page set-up, header and footer."""
        sheet = self._file.add_worksheet(name)
        sheet.hide_gridlines(2)
        sheet.set_paper(_A4)
        if landscape:
            sheet.set_landscape()
        sheet.fit_to_pages(1, 0)
        sheet.center_horizontally()
        sheet.set_margins(left=0.6, right=0.6, top=0.8, bottom=0.75)
        sheet.set_header(
            f"&L&9 {header_text(self.subject)}&C&9&B {header_text(self.notice)}&R&9 {name}"
        )
        number = f"Certificate {header_text(self._number)}" if self._number else ""
        sheet.set_footer(f"&L&9 {self._made_by}&C&9 {number}&R&9 Page &P of &N")
        sheet.protect("", _OPENINGS)
        sheet.set_row(0, 24)
        sheet.write_string(0, 0, title, self.format(bold=True, font_size=15, font_color=ACCENT))
        line = " · ".join(part for part in (self.subject, self.notice, subtitle) if part)
        sheet.write_string(1, 0, line, self.format(font_color=MUTED))
        return sheet

    def heading(self, sheet, row, text, columns):
        """A heading with a rule under it across so many columns."""
        rule = {"bottom": 1, "bottom_color": ACCENT}
        look = self.format(bold=True, font_size=12, font_color=ACCENT, **rule)
        sheet.set_row(row, 21)
        for column in range(columns):
            sheet.write_blank(row, column, None, look)
        sheet.write_string(row, 0, text, look)

    def put(self, sheet, row, column, value, **look):
        """Write one value of the record: a number as number, all else as text, never a formula."""
        if isinstance(value, bool):
            value = "yes" if value else "no"
        if isinstance(value, list | tuple):
            value = ", ".join(str(item) for item in value)
        if isinstance(value, int | float):
            look = {"align": "right", **look}
            sheet.write_number(row, column, value, self.format(**look))
            return
        if value is None:
            value, look = NONE, {**look, "font_color": MUTED}
        look.pop("num_format", None)
        sheet.write_string(row, column, str(value)[:_LONGEST_CELL], self.format(**look))

    def paragraph(self, sheet, row, text, widths, **look):
        """A wrapped text across the columns of these widths, in a row as high as it needs."""
        look = {"text_wrap": True, "align": "left", **look}
        sheet.set_row(row, _LINE_PT * _lines(text, sum(widths)))
        sheet.merge_range(row, 0, row, len(widths) - 1, "", self.format(**look))
        sheet.write_string(row, 0, text[:_LONGEST_CELL], self.format(**look))

    def paragraph_in(self, sheet, row, column, text, widths):
        """A wrapped text from one column over those of these widths, at its left."""
        sheet.set_row(row, _LINE_PT * _lines(text, sum(widths)))
        look = self.format(text_wrap=True, align="left")
        sheet.merge_range(row, column, row, column + len(widths) - 1, "", look)
        sheet.write_string(row, column, text[:_LONGEST_CELL], look)

    def table(self, sheet, row, name, columns, muted=(), autofilter=False):
        """An Excel table with its headings in `row`; returns the number of its last row.

        muted  numbers of the data rows that stand back in grey italics
        """
        count = len(columns[0].cells)
        muted = frozenset(muted)
        for place, column in enumerate(columns):
            cell_look = {"bottom": 4, "bottom_color": RULE}
            if column.digits is None:
                cell_look |= {"text_wrap": True, "align": "left", "indent": 1}
            else:
                cell_look |= {"align": "right"}
            for index, value in enumerate(column.cells):
                look = dict(cell_look)
                if isinstance(column.digits, list):
                    look["num_format"] = number_format(column.digits[index], column.percent)
                elif column.digits is not None:
                    look["num_format"] = number_format(column.digits, column.percent)
                if index in muted:
                    look |= {"italic": True, "font_color": MUTED}
                self.put(sheet, row + 1 + index, place, value, **look)
        sheet.add_table(
            row,
            0,
            row + count,
            len(columns) - 1,
            {
                "name": name,
                "style": None,
                "autofilter": autofilter,
                "columns": [
                    {"header": column.heading, "header_format": self._head(column)}
                    for column in columns
                ],
            },
        )
        lines = max(_lines(column.heading, 0.85 * column.width) for column in columns)
        sheet.set_row(row, _LINE_PT * lines + 3)
        self._heights(sheet, row + 1, columns)
        return row + count

    def _heights(self, sheet, first, columns):
        """Make the rows of a table high enough for their longest text."""
        texts = [column for column in columns if column.digits is None]
        for index in range(len(columns[0].cells)):
            lines = max(
                (_lines(str(column.cells[index] or ""), column.width - 2) for column in texts),
                default=1,
            )
            if lines > 1:
                sheet.set_row(first + index, _LINE_PT * lines)

    def _head(self, column):
        side = {"align": "left", "indent": 1} if column.digits is None else {"align": "right"}
        colours = {"font_color": "white", "bg_color": ACCENT}
        return self.format(bold=True, text_wrap=True, **side, **colours)

    def widths(self, sheet, *widths):
        """Set the widths of the first columns, in characters."""
        for column, width in enumerate(widths):
            sheet.set_column(column, column, width)

    def name(self, name, sheet, first_row, last_row, column):
        """Give a name to the cells of one column."""
        letter = xlsxwriter.utility.xl_col_to_name(column)
        place = f"='{sheet.get_name()}'!${letter}${first_row + 1}"
        if last_row != first_row:
            place += f":${letter}${last_row + 1}"
        self._file.define_name(name, place)

    def chart(self):
        """A new chart with straight lines between numbers on both axes."""
        return self._file.add_chart({"type": "scatter", "subtype": "straight"})


def _lines(text, width):
    """How many lines a text takes in columns of this width."""
    return min(max(ceil(len(text) / (_FITS * width)), 1), _MOST_LINES)


def _date(*candidates):
    """The first ISO date of the candidates, else a fixed one: the same record, the same bytes."""
    for text in candidates:
        found = re.match(r"\d{4}-\d{2}-\d{2}", str(text or ""))
        if found:
            try:
                return datetime.fromisoformat(found.group())
            except ValueError:
                continue
    return datetime(2000, 1, 1)
