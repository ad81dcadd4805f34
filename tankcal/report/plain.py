"""Values with their units and digits, and blocks, in the words of a language.

What every paper shares, whatever it is about; nothing here computes a number.
"""

from dataclasses import dataclass
from datetime import date

from tankcal.errors import VocabularyError
from tankcal.report import blocks, numbers
from tankcal.text.digits import (
    NOTHING,
    decimals_of,
    decimals_of_height,
    decimals_of_rows,
    fixed,
    shortest,
    with_digits,
)
from tankcal.text.words import marks_of, percent

_SPACE = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class Column:
    """A column of a table of the record.

    key       key of the value in each row; its heading is word `table_headings.<key>`
    unit      unit in which it is shown, one of numbers.UNITS; "" for text and bare numbers
    u         key of the standard or expanded uncertainty that sets the decimals (two digits of it);
              whole digits are rounded off in the column of that uncertainty alone
    least     but never fewer decimals than this
    most      nor more than this, where an uncertainty may be the rounding of what is exact
    decimals  this many decimals; beside u: where no row has an uncertainty; or
    digits    this many significant digits, or
    height    True: a height, in millimetres or finer where it must be; none of these: text
    words     group of words that a code is looked up in
    heading   key of another heading
    nothing   what is printed for a value that does not exist
    align     one of blocks.ALIGNMENTS; None: text to the left, numbers by their decimal marks
    formulas  True: formulas of the record in this text are set as such
    """

    key: str
    unit: str = ""
    decimals: int | None = None
    u: str | None = None
    least: int = 0
    most: int | None = None
    digits: int | None = None
    height: bool = False
    words: str | None = None
    heading: str | None = None
    nothing: str = NOTHING
    align: str | None = None
    formulas: bool = False


class PlainPaper:
    """Formats values and makes blocks with the words {group: {key: template}} of a language."""

    def __init__(self, words):
        self.words = words
        self.marks = marks_of(words)

    # ---- words and numbers

    def word(self, name, /, **values):
        """The word or sentence called "group.key", with whole numbers in the marks of its language.

        Raises VocabularyError when it is missing.
        """
        group, key = name.split(".", 1)
        template = self.words.get(group, {}).get(key)
        if not isinstance(template, str):
            raise VocabularyError(f"the words of this language lack {name}")
        shown = {
            name: fixed(value, 0, self.marks) if isinstance(value, int) else value
            for name, value in values.items()
        }
        return template.format(**shown)

    def label(self, key):
        """The label of a field; a field of the user's own keeps its name."""
        return self.words["labels"].get(key, str(key).replace("_", " "))

    def number(self, value, unit="", decimals=None, u=None, digits=None):
        """A number with its unit; None gives None, so that a field not given can be left out.

        Beside its uncertainty `u` it keeps its whole digits; an uncertainty itself, `u` of its own
        value, has two digits in every unit: 420 L.
        """
        if value is None:
            return None
        shown = numbers.unit(unit)
        if u is not None:
            decimals = decimals_of(u * shown.factor, least=None if u == value else 0)
        if decimals is not None:
            text = fixed(value * shown.factor, decimals, self.marks)
        else:
            text = with_digits(value * shown.factor, digits or 6, self.marks)
        return f"{text}{_SPACE}{shown.symbol}" if shown.symbol else text

    def height(self, value_m, unit="m"):
        """A height in millimetres, or finer where it must be, with its unit; None gives None."""
        if value_m is None:
            return None
        return self.number(value_m, unit, decimals=decimals_of_height(value_m))

    def day(self, iso):
        """A date (YYYY-MM-DD) as it is written in the language; None gives None."""
        if not iso:
            return None
        day, dates = date.fromisoformat(str(iso)), self.words["language"]["dates"]
        return dates["form"].format(day=day.day, month=dates[str(day.month)], year=day.year)

    def plain(self, value, unit=""):
        """A number that somebody chose: at most six digits, no zeros at its end; or None."""
        if value is None:
            return None
        text = shortest(value, self.marks)
        return f"{text}{_SPACE}{unit}" if unit else text

    def percent(self, share):
        """A share in percent."""
        return percent(self.words, share)

    # ---- blocks

    def heading(self, name, level=1):
        """The heading `headings.<name>`."""
        return blocks.heading(self.word(f"headings.{name}"), level)

    def paragraph(self, name, /, **values):
        """The sentence `texts.<name>`."""
        return blocks.paragraph(self.word(f"texts.{name}", **values))

    def facts(self, items):
        """Labels and values, `items` a list of (key, text or None); what is None is left out."""
        return blocks.key_values(
            [(self.label(key), value) for key, value in items if value not in (None, "")]
        )

    def rows(self, table, keys):
        """The rows of a table that the record holds as one list per column."""
        return [
            dict(zip(keys, values, strict=True))
            for values in zip(*(table[key] for key in keys), strict=True)
        ]

    def table(self, name, rows, columns, /, across=None, **values):
        """A table with caption `captions.<name>`; `across` sets a long one in columns."""
        texts = [self.column_texts(rows, column) for column in columns]
        heads = [
            [self.word(f"table_headings.{c.heading or c.key}"), self._unit_in_words(c.unit)]
            for c in columns
        ]
        align = [c.align or ("left" if _is_text(c) else "decimal") for c in columns]
        cells = [list(row) for row in zip(*texts, strict=True)]
        caption = self.word(f"captions.{name}", **values)
        mark = self.marks.decimal
        if across:
            return blocks.columns_table(heads, cells, caption, align, across, mark)
        formulas = [number for number, column in enumerate(columns) if column.formulas]
        return blocks.table(heads, cells, caption, align, mark, formulas)

    def _unit_in_words(self, name):
        """A unit at the head of a column; one that holds a word is in the language."""
        return self.words["units"].get(name) or numbers.unit(name).symbol

    def column_texts(self, rows, column):
        """The cells of a column, as text."""
        values = [row.get(column.key) for row in rows]
        if _is_text(column):
            texts = [self._text(value, column) for value in values]
        else:
            texts = self._numbers(values, rows, column)
        return [
            column.nothing if value is None else text
            for value, text in zip(values, texts, strict=True)
        ]

    def _text(self, value, column):
        if isinstance(value, list):
            return ", ".join(map(str, value))
        known = self.words[column.words] if column.words else {}
        return known.get(str(value), str(value))

    def _numbers(self, values, rows, column):
        factor = numbers.unit(column.unit).factor
        scaled = [None if value is None else value * factor for value in values]
        if column.digits is not None:
            return [with_digits(value, column.digits, self.marks) for value in scaled]
        decimals = [column.decimals] * len(rows)
        if column.height:
            decimals = [decimals_of_height(value or 0.0) for value in values]
        if column.u is not None:
            of_rows = [(row.get(column.u) or 0.0) * factor for row in rows]
            least = None if column.u == column.key else column.least  # 420 L has two digits
            limits = {"least": least, "most": column.most}
            if column.decimals is not None:
                limits["unknown"] = column.decimals
            decimals = decimals_of_rows(of_rows, **limits)
        return [
            fixed(value, places, self.marks) for value, places in zip(scaled, decimals, strict=True)
        ]

    def figure(self, figure, name, /, width=1.0, **values):
        """A matplotlib figure with caption `captions.<name>` and description `<name>_alt`."""
        from tankcal.report.figures import with_decimal_mark

        caption = self.word(f"captions.{name}", **values)
        figure = with_decimal_mark(figure, self.marks.decimal)
        return blocks.figure(figure, caption, self.word(f"captions.{name}_alt"), width)


def _is_text(column):
    numeric = (column.decimals, column.u, column.digits)
    return not column.height and all(rule is None for rule in numeric)
