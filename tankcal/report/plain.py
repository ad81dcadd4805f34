"""Formatting common to all papers: values with units and digits, and blocks, in a language.

The module computes no results.
"""

from dataclasses import replace
from datetime import date

from tankcal.errors import VocabularyError
from tankcal.report import blocks, numbers
from tankcal.report.tables import Column, decimals_of_cells
from tankcal.text.digits import (
    decimals_of,
    decimals_of_height,
    fixed,
    fixed_rows,
    format_significant,
    shortest,
)
from tankcal.text.words import marks_of, percent

__all__ = ["Column", "PlainPaper", "words_with_part"]


class PlainPaper:
    """Formatter of values and blocks with the words {group: {key: template}} of a language."""

    def __init__(self, words):
        self.words = words
        self.marks = marks_of(words)

    # ---- the unit of volumes

    volume_unit = "m3"  # unit of all volumes in this paper: m3, L or bbl

    @property
    def volume_symbol(self):
        """Printed unit of volumes, such as "m³"."""
        return numbers.unit(self.volume_unit).symbol

    @property
    def volume_factor(self):
        """Factor from m3 to the unit of volumes."""
        return numbers.unit(self.volume_unit).factor

    def _shown_unit(self, unit):
        """Return the printed unit of a value; units of volume become the unit of the paper."""
        return unit.replace("m3", self.volume_unit, 1) if unit in ("m3", "m3/unit") else unit

    def _fewer(self, decimals):
        """Return the decimals in the unit of the paper for decimals in m3; None remains None."""
        if not isinstance(decimals, int):
            return decimals
        difference = numbers.unit("m3").least - numbers.unit(self.volume_unit).least
        return max(decimals - difference, 0)

    def _convert_column(self, column):
        """Return a Column of volumes in the unit of the paper; other columns are unchanged."""
        unit = self._shown_unit(column.unit)
        if unit == column.unit:
            return column
        decimals, least = self._fewer(column.decimals), self._fewer(column.least)
        return replace(column, unit=unit, decimals=decimals, least=least)

    # ---- words and numbers

    def word(self, name, /, **values):
        """Return the word or sentence "group.key" with its values.

        Integers are formatted in the language. A missing word raises VocabularyError.
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
        """Return the label of a field; an additional field of the user keeps its name."""
        return self.words["labels"].get(key, str(key).replace("_", " "))

    def number(self, value, unit="", decimals=None, u=None, digits=None):
        """Format a number with its unit.

        Parameters
        ----------
        value : float or None
            Value in the unit of the record; None returns None.
        unit : str, optional
            Unit, a key of numbers.UNITS.
        decimals : int, optional
            Number of decimals.
        u : float, optional
            Uncertainty that determines the decimals. If `u` equals `value`, the value is itself an
            uncertainty and has two digits in every unit, such as 420 L.
        digits : int, optional
            Number of significant digits without `decimals` and `u`; default 6.

        Returns
        -------
        str or None
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
        return numbers.join_unit(text, shown.symbol)

    def height(self, value_m, unit="m"):
        """Format a height, m, to the millimetre or finer if necessary; None returns None."""
        if value_m is None:
            return None
        return self.number(value_m, unit, decimals=decimals_of_height(value_m))

    def day(self, iso):
        """Format a date (YYYY-MM-DD) in the language; None returns None."""
        if not iso:
            return None
        day, dates = date.fromisoformat(str(iso)), self.words["language"]["dates"]
        return dates["form"].format(day=day.day, month=dates[str(day.month)], year=day.year)

    def plain(self, value, unit=""):
        """Format an input value with at most six digits, without final zeros; None returns None."""
        if value is None:
            return None
        text = shortest(value, self.marks)
        return numbers.join_unit(text, unit)

    def percent(self, share):
        """Format a share in percent."""
        return percent(self.words, share)

    # ---- blocks

    def heading(self, name, level=1):
        """Heading block with the text `headings.<name>`."""
        return blocks.heading(self.word(f"headings.{name}"), level)

    def paragraph(self, name, /, **values):
        """Paragraph block with the sentence `texts.<name>`."""
        return blocks.paragraph(self.word(f"texts.{name}", **values))

    def facts(self, items):
        """Block of labels and values from a list of (key, text); None and "" are omitted."""
        return blocks.key_values(
            [(self.label(key), value) for key, value in items if value not in (None, "")]
        )

    def facts_of(self, table, on=None):
        """Return (key, text) for each column that this paper shows of a Table with one row."""
        (row,) = table.rows(self.record)
        return [(column.key, self._fact(column, row)) for column in table.on_paper(on, [row])]

    def _fact(self, column, row):
        if column.text is not None:
            return column.text(self, row)
        value = row.get(column.key)
        if value is None or not column.is_text:
            return self.number(value, column.unit, column.decimals, digits=column.digits)
        return self.word(f"{column.words}.{value}") if column.words else value

    def rows(self, table, keys):
        """Return the rows of a table that the record stores as a list per column."""
        return [
            dict(zip(keys, values, strict=True))
            for values in zip(*(table[key] for key in keys), strict=True)
        ]

    def show(self, table, rows=None, *, on=None, across=None, **values):
        """Block of a declared Table.

        Parameters
        ----------
        table : Table
            Declaration of the table.
        rows : list of dict, optional
            Rows; None: the rows of the record.
        on : str, optional
            Name of the table and of its caption in the paper; None: the name of the Table.
        across : int or callable, optional
            Number of parts of a long table side by side on a page; across(texts) returns it from
            the cells of each column.
        **values
            Values in the caption.

        Returns
        -------
        blocks.Block
        """
        rows = table.rows(self.record) if rows is None else rows
        columns = table.on_paper(on, rows)
        return self.table(on or table.name, rows, columns, across=across, **values)

    def table(self, name, rows, columns, /, across=None, **values):
        """Table block with caption `captions.<name>`; `across` sets parts side by side."""
        columns = [self._convert_column(column) for column in columns]
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
            across = across(texts) if callable(across) else across
            return blocks.columns_table(heads, cells, caption, align, across, mark)
        formulas = [number for number, column in enumerate(columns) if column.formulas]
        return blocks.table(heads, cells, caption, align, mark, formulas)

    def _unit_in_words(self, name):
        """Return the unit in the heading of a column; units with words are translated."""
        return self.words["units"].get(name) or numbers.unit(name).symbol

    def column_texts(self, rows, column):
        """Return the cells of a column as texts."""
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
        translations = self.words[column.words] if column.words else {}
        return [self._text(value, translations) for value in values]

    def _text(self, value, translations):
        if isinstance(value, list):
            return ", ".join(map(str, value))
        if isinstance(value, bool) and str(value) not in translations:
            return self.words["yes_no"]["yes" if value else "no"]
        return translations.get(str(value), str(value))

    def _numbers(self, rows, column):
        factor = numbers.unit(column.unit).factor
        values = [row.get(column.key) for row in rows]
        scaled = [None if value is None else value * factor for value in values]
        if column.digits is not None:
            return [format_significant(value, column.digits, self.marks) for value in scaled]
        decimals = decimals_of_cells(column, rows, factor)
        return fixed_rows(scaled, decimals, self.marks)

    def figure(self, figure, name, /, width=1.0, **values):
        """Figure block with caption `captions.<name>` and alternative text `<name>_alt`."""
        from tankcal.report.figures import with_decimal_mark

        caption = self.word(f"captions.{name}", **values)
        figure = with_decimal_mark(figure, self.marks.decimal)
        return blocks.figure(figure, caption, self.word(f"captions.{name}_alt"), width)


def words_with_part(words, part):
    """Return the words, in which the groups of `part` override groups of equal names."""
    groups = words[part]
    merged = {name: _merge(words.get(name, {}), group) for name, group in groups.items()}
    return {name: group for name, group in words.items() if name != part} | merged


def _merge(common, part_words):
    """Return the words of a group, overridden by the words of its part."""
    if any(isinstance(word, dict) for word in part_words.values()):
        return common | {name: common.get(name, {}) | group for name, group in part_words.items()}
    return common | part_words
