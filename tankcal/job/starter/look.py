"""Formats of the cells of an input workbook, and how its sheets are printed."""

DARK, LIGHT, YELLOW, GREY, INK = "#1F4E79", "#DCE6F1", "#FFF2CC", "#7F7F7F", "#404040"
_FONT = {"font_name": "Arial", "font_size": 10}
_EXAMPLE = {"italic": True, "font_color": GREY}
_NUMBERS = {"text": "@", "date": "yyyy-mm-dd"}  # text: 1-2 stays a name, and becomes no date
A4 = 9
LETTERS_TO_LINE = 1.45  # letters of a small font in one unit of a column's width
LINE_PT = 12.0


class Look:
    """Formats by their names, each made once."""

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
        """Of a cell to type in: kind is "number", "text" or "date"."""
        given = {"align": "left", "bg_color": YELLOW} if is_to_fill_in else {"align": "left"}
        return self.row(kind, **given)

    def row(self, kind, **more):
        """Of a cell of one of the first rows of a table, ruled as a form is."""
        given = {"border": 1, "border_color": "#BFBFBF", "valign": "vcenter"} | more
        if kind in _NUMBERS:
            given["num_format"] = _NUMBERS[kind]
        return self._format(**given)

    def column(self, kind):
        """Of a column of values."""
        return self._format(**({"num_format": _NUMBERS[kind]} if kind in _NUMBERS else {}))

    def example(self, **more):
        """Of an example, which is never read."""
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
    """The format that keeps what will be typed there: "number", "date" or "text"."""
    return {"number": "number", "flag": "number", "date": "date"}.get(field.kind, "text")


def print_on_a4(sheet, texts, is_landscape=False):
    """A4, one page wide, with the sheet's name and the number of the page below."""
    sheet.set_paper(A4)
    if is_landscape:
        sheet.set_landscape()
    sheet.fit_to_pages(1, 0)
    sheet.set_margins(left=0.5, right=0.5, top=0.6, bottom=0.7)
    sheet.set_footer(f"&L&8&A&R&8{texts.of('cover', 'page')}")


def opened(text):
    """A note with a capital letter."""
    return text[:1].upper() + text[1:]


def lines_of(text, width):
    """How many lines a text takes in the small font of a note, in a column of this width."""
    room, lines, length = width * LETTERS_TO_LINE, 1, 0
    for word in text.split():
        if length and length + 1 + len(word) > room:
            lines, length = lines + 1, 0
        length += len(word) + (1 if length else 0)
    return lines
