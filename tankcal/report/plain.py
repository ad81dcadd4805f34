"""Values with their units and digits, and blocks, in the words of a language.

What every paper shares, whatever it is about; nothing here computes a number.
"""

from dataclasses import replace
from datetime import date

from tankcal.errors import VocabularyError
from tankcal.report import blocks, numbers
from tankcal.report.tables import Column, decimals_of_cells
from tankcal.text.digits import decimals_of, decimals_of_height, fixed, format_significant, shortest
from tankcal.text.words import marks_of, percent

__all__ = ["Column", "PlainPaper", "words_with_part"]
_SPACE = "\N{NO-BREAK SPACE}"


class PlainPaper:
    """Formats values and makes blocks with the words {group: {key: template}} of a language."""

    def __init__(self, words):
        self.words = words
        self.marks = marks_of(words)

    # ---- the unit of volumes

    volume_unit = "m3"  # of all volumes on this paper: m3, L or bbl

    @property
    def volume_symbol(self):
        """How the unit of volumes is printed: "m³"."""
        return numbers.unit(self.volume_unit).symbol

    @property
    def volume_factor(self):
        """What a volume in m3 is multiplied by."""
        return numbers.unit(self.volume_unit).factor

    def _shown_unit(self, unit):
        """The unit that a value is shown in: one of volume becomes that of the paper."""
        return unit.replace("m3", self.volume_unit, 1) if unit in ("m3", "m3/unit") else unit

    def _fewer(self, decimals):
        """Decimals in the paper's unit of volume of those chosen for m3; None stays None."""
        if not isinstance(decimals, int):
            return decimals
        lost = numbers.unit("m3").least - numbers.unit(self.volume_unit).least
        return max(decimals - lost, 0)

    def _in_unit(self, column):
        """A Column of volumes in m3 in the unit of the paper; any other as it is."""
        unit = self._shown_unit(column.unit)
        if unit == column.unit:
            return column
        decimals, least = self._fewer(column.decimals), self._fewer(column.least)
        return replace(column, unit=unit, decimals=decimals, least=least)

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
        shown = numbers.unit(self._shown_unit(unit))
        if self._shown_unit(unit) != unit:
            decimals = self._fewer(decimals)
        if u is not None:
            decimals = decimals_of(u * shown.factor, least=None if u == value else 0)
        if decimals is not None:
            text = fixed(value * shown.factor, decimals, self.marks)
        else:
            text = format_significant(value * shown.factor, digits or 6, self.marks)
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

    def facts_of(self, table, on=None):
        """(key, text) of a declared Table of one row, for `facts`: those that this paper shows."""
        (row,) = table.rows(self.record)
        return [(one.key, self._fact(one, row)) for one in table.on_paper(on, [row])]

    def _fact(self, column, row):
        if column.text is not None:
            return column.text(self, row)
        value = row.get(column.key)
        if value is None or not column.is_text:
            return self.number(value, column.unit, column.decimals, digits=column.digits)
        return self.word(f"{column.words}.{value}") if column.words else value

    def rows(self, table, keys):
        """The rows of a table that the record holds as one list per column."""
        return [
            dict(zip(keys, values, strict=True))
            for values in zip(*(table[key] for key in keys), strict=True)
        ]

    def show(self, table, rows=None, *, on=None, across=None, **values):
        """A declared Table as a block: of these rows (None: its own of the record).

        on      name of the paper's table, and of its caption; None: that of the Table
        across  sets a long table in so many columns of the page
        values  for the places in the caption
        """
        rows = table.rows(self.record) if rows is None else rows
        columns = table.on_paper(on, rows)
        return self.table(on or table.name, rows, columns, across=across, **values)

    def table(self, name, rows, columns, /, across=None, **values):
        """A table with caption `captions.<name>`; `across` sets a long one in columns."""
        columns = [self._in_unit(column) for column in columns]
        texts = [self.column_texts(rows, column) for column in columns]
        heads = [
            [self.word(f"table_headings.{c.heading or c.key}"), self._unit_in_words(c.unit)]
            for c in columns
        ]
        align = [c.align or ("left" if c.is_text or c.text else "decimal") for c in columns]
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
        if column.text is not None:
            values = texts = [column.text(self, row) for row in rows]
        else:
            values = [row.get(column.key) for row in rows]
            texts = self._texts(values, column) if column.is_text else self._numbers(rows, column)
        return [
            column.nothing if value is None else text
            for value, text in zip(values, texts, strict=True)
        ]

    def _texts(self, values, column):
        known = self.words[column.words] if column.words else {}
        return [self._text(value, known) for value in values]

    def _text(self, value, known):
        if isinstance(value, list):
            return ", ".join(map(str, value))
        if isinstance(value, bool) and str(value) not in known:
            return self.words["yes_no"]["yes" if value else "no"]
        return known.get(str(value), str(value))

    def _numbers(self, rows, column):
        factor = numbers.unit(column.unit).factor
        values = [row.get(column.key) for row in rows]
        scaled = [None if value is None else value * factor for value in values]
        if column.digits is not None:
            return [format_significant(value, column.digits, self.marks) for value in scaled]
        decimals = decimals_of_cells(column, rows, factor)
        return [
            fixed(value, places, self.marks) for value, places in zip(scaled, decimals, strict=True)
        ]

    def figure(self, figure, name, /, width=1.0, **values):
        """A matplotlib figure with caption `captions.<name>` and description `<name>_alt`."""
        from tankcal.report.figures import with_decimal_mark

        caption = self.word(f"captions.{name}", **values)
        figure = with_decimal_mark(figure, self.marks.decimal)
        return blocks.figure(figure, caption, self.word(f"captions.{name}_alt"), width)


def words_with_part(words, part):
    """The words with those of the group `part` before the groups of the same names."""
    own = words[part]
    merged = {name: _merged(words.get(name, {}), group) for name, group in own.items()}
    return {name: group for name, group in words.items() if name != part} | merged


def _merged(common, own):
    """Words of a group with those of its part; groups of groups alike."""
    if any(isinstance(one, dict) for one in own.values()):
        return common | {name: common.get(name, {}) | group for name, group in own.items()}
    return common | own
