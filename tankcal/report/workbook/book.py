"""The workbook file: properties, and sheets with page set-up and protection."""

from datetime import datetime
from functools import cache, cached_property
from itertools import pairwise, repeat
from pathlib import Path

import xlsxwriter
from xlsxwriter.exceptions import FileCreateError
from xlsxwriter.utility import quote_sheetname, xl_range_abs

from tankcal.report.paper import Paper
from tankcal.report.workbook.look import (
    ACCENT,
    FONT,
    LINE_PT,
    MUTED,
    ROW_PT,
    day,
    lines_of,
    number_format,
)
from tankcal.report.workbook.writer import NumberRow, Sheet, Writer

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
