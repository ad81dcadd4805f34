"""Cell formats of an input workbook, and its page layout."""

DARK, LIGHT, YELLOW, GREY, INK = "#1F4E79", "#DCE6F1", "#FFF2CC", "#7F7F7F", "#404040"
_FONT = {"font_name": "Arial", "font_size": 10}
_EXAMPLE = {"italic": True, "font_color": GREY}
# The text format keeps the name 1-2 from becoming a date.
_NUMBERS = {"text": "@", "date": "yyyy-mm-dd"}
A4 = 9  # code of the page size
LETTERS_TO_LINE = 1.45  # letters of the small font in one unit of column width
LINE_PT = 12.0  # height of a line


class Look:
    """Named formats, each created once."""

    def __init__(self, book):
        self._book, self._made = book, {}
        self.title = self._format(bold=True, font_size=14, font_color=DARK)
        self.section = self._format(bold=True, bg_color=LIGHT, font_color=DARK)
        self.plain = self._format()
        self.wrapped = self._format(text_wrap=True, valign="top")
        self.link = self._format(font_color="#0563C1", underline=1, valign="top")
        self.bold = self._format(bold=True)
        self.mark = self._format(font_color=GREY, font_size=8, valign="top")
        self.note = self._format(
            font_size=8, font_color=INK, text_wrap=True, valign="top", align="left"
        )
        self.key_note = self._format(font_size=9, font_color=INK, text_wrap=True, valign="vcenter")
        self.code = self._format(
            font_name="Courier New", font_size=9, font_color=GREY, valign="vcenter"
        )
        self.required = self._heading(DARK, "#FFFFFF")
        self.optional = self._heading(LIGHT, DARK)
        self.unit = self._format(align="center", valign="vcenter", font_color=DARK)
        self.code_heading = self._format(
            font_name="Courier New", font_size=9, font_color=GREY, bottom=2, align="center"
        )

    def cell(self, kind, is_to_fill_in=False):
        """Format of an input cell; kind is "number", "text" or "date"."""
        given = {"align": "left", "bg_color": YELLOW} if is_to_fill_in else {"align": "left"}
        return self.row(kind, **given)

    def row(self, kind, **more):
        """Format of a ruled cell in the first rows of a table."""
        given = {"border": 1, "border_color": "#BFBFBF", "valign": "vcenter"} | more
        if kind in _NUMBERS:
            given["num_format"] = _NUMBERS[kind]
        return self._format(**given)

    def column(self, kind):
        """Format of a column of values."""
        return self._format(**({"num_format": _NUMBERS[kind]} if kind in _NUMBERS else {}))

    def example(self, **more):
        """Format of an example, which is never read."""
        return self._format(**_EXAMPLE, valign="vcenter", **more)

    def _heading(self, fill, ink):
        return self._format(
            bold=True, bg_color=fill, font_color=ink, align="center", valign="top", text_wrap=True
        )

    def _format(self, **given):
        key = tuple(sorted(given.items()))
        if key not in self._made:
            self._made[key] = self._book.add_format(_FONT | given)
        return self._made[key]


def type_of_cell(field):
    """Cell format for the values of a field: "number", "date" or "text"."""
    return {"number": "number", "flag": "number", "date": "date"}.get(field.kind, "text")


def print_on_a4(sheet, texts, is_landscape=False):
    """Print on A4, one page wide, with the name of the sheet and the page number below."""
    sheet.set_paper(A4)
    if is_landscape:
        sheet.set_landscape()
    sheet.fit_to_pages(1, 0)
    sheet.set_margins(left=0.5, right=0.5, top=0.6, bottom=0.7)
    sheet.set_footer(f"&L&8&A&R&8{texts.of('cover', 'page')}")


def opened(text):
    """Note with a capital letter."""
    return text[:1].upper() + text[1:]


def lines_of(text, width):
    """Number of lines of a text in the small font, in a column of this width."""
    letters, lines, length = width * LETTERS_TO_LINE, 1, 0
    for word in text.split():
        if length and length + 1 + len(word) > letters:
            lines, length = lines + 1, 0
        length += len(word) + (1 if length else 0)
    return lines
