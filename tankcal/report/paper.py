"""A record on paper: its values with their units and digits, in the words of its language.

The cells of the templates use it; nothing here computes a number.

>>> paper = Paper("record.json")
>>> paper.table("courses", paper.record["courses"], [Column("course"), Column("height_m", "m", 3)])
"""

from dataclasses import dataclass

from tankcal.errors import TankcalError
from tankcal.record import load
from tankcal.report import blocks, numbers
from tankcal.uncertainty import height_decimals, row_decimals
from tankcal.words import choice_sentence, input_name, load_words, percent

_DECIMALS_OF_PARTS = {"m": 4, "m3": 4, "mm/m": 2, "mm": 2, "deg": 2, "kg/m3": 1}
_SPACE = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class Column:
    """A column of a table of the record.

    key       key of the value in each row; its heading is word `table_headings.<key>`
    unit      unit in which it is shown, one of numbers.UNITS; "" for text and bare numbers
    decimals  this many decimals, or
    u         key of the standard or expanded uncertainty that sets them (two digits of it), or
    least     but never fewer decimals than this
    digits    this many significant digits, or
    height    True: a height, in millimetres or finer where it must be; none of the four: text
    words     group of words that a code is looked up in
    heading   key of another heading
    nothing   what is printed for a value that does not exist
    align     one of blocks.ALIGNMENTS; None: text to the left, numbers by their decimal marks
    """

    key: str
    unit: str = ""
    decimals: int | None = None
    u: str | None = None
    least: int = 0
    digits: int | None = None
    height: bool = False
    words: str | None = None
    heading: str | None = None
    nothing: str = numbers.NOTHING
    align: str | None = None


class Paper:
    """The record at `path` with its language's words; raises InputError for another format."""

    def __init__(self, path):
        self.record = load(path)
        table = self.record["job"]["table"] or {}  # a survey alone has none
        self.words = load_words(table.get("language") or "en")
        self.mark = self.words["language"]["decimal"]

    # ---- words and numbers

    def word(self, name, **values):
        """The word or sentence called "group.key"; raises TankcalError when it is missing."""
        group, key = name.split(".", 1)
        template = self.words.get(group, {}).get(key)
        if not isinstance(template, str):
            raise TankcalError(f"the words of this language lack {name}")
        return template.format(**values)

    def label(self, key):
        """The label of a field; a field of the user's own keeps its name."""
        return self.words["labels"].get(key, str(key).replace("_", " "))

    def number(self, value, unit="", decimals=None, u=None, digits=None):
        """A number with its unit; None gives None, so that a field not given can be left out."""
        if value is None:
            return None
        shown = numbers.unit(unit)
        if u is not None:
            decimals = row_decimals([u * shown.factor])[0]
        if decimals is not None:
            text = numbers.fixed(value * shown.factor, decimals, self.mark)
        else:
            text = numbers.significant(value * shown.factor, digits or 6, self.mark)
        return f"{text}{_SPACE}{shown.symbol}" if shown.symbol else text

    def input_name(self, row):
        """The name of an input of the budget."""
        return input_name(self.words, row)

    def coverage(self):
        """The coverage probability in percent."""
        return self.percent(self.record["job"]["table"]["coverage_probability"])

    def percent(self, share):
        """A share in percent."""
        return percent(self.words, share)

    def choices(self, code=None):
        """One sentence for each choice of the record, or for that with the given code."""
        return [
            choice_sentence(self.words, choice)
            for choice in self.record["choices"]
            if code in (None, choice["code"])
        ]

    # ---- blocks

    def document(self, part):
        """The start of the part: title, author, running head with the notice, page numbers."""
        certificate, tank = self.record["job"]["certificate"], self.subject()
        number = certificate.get("number")
        left = f"{self.word('page.number')} {number}" if number else ""
        return blocks.document(
            part=part,
            title=f"{self.word(f'titles.{part}')}, {tank}",
            author=str(certificate.get("laboratory", "")),
            date=self.date(),
            language=self.words["language"]["code"],
            notice=str(certificate.get("notice", "")),
            running=[left, tank],
            footer=self.words["page"]["footer"],
        )

    def date(self):
        """The date that the document bears: of issue when given, else of the survey (ISO)."""
        job = self.record["job"]
        return str(job["certificate"].get("date_of_issue") or (job["survey"] or {}).get("date", ""))

    def subject(self):
        """What the papers are about: the tank, or the survey alone by the name of its job."""
        tank = self.record["job"]["tank"]
        if tank is None:
            return f"{self.word('page.survey')} {self.record['job']['source']}"
        return f"{self.word('page.tank')} {tank['id']}"

    def subtitle(self, part):
        """The line below the title of a part."""
        tank = self.record["job"]["tank"]
        if self.record["capacity"] is None:
            name = self.record["job"]["source"] if tank is None else self.subject()
            return self.word("titles.adjustment_subtitle", value=name)
        return self.word(f"titles.{part}", value=self.word(f"kinds.{tank['kind']}"))

    def heading(self, name, level=1):
        """The heading `headings.<name>`."""
        return blocks.heading(self.word(f"headings.{name}"), level)

    def paragraph(self, name, **values):
        """The sentence `texts.<name>`."""
        return blocks.paragraph(self.word(f"texts.{name}", **values))

    def facts(self, items):
        """Labels and values, `items` a list of (key, text or None); what is None is left out."""
        return blocks.key_values(
            [(self.label(key), value) for key, value in items if value not in (None, "")]
        )

    def dimensions(self, described):
        """What the record says of a part: [{code, value, unit}], a text where there is no unit.

        A code that is a text is looked up in the words `parts`.
        """
        return blocks.key_values([(self.label(one["code"]), self._part(one)) for one in described])

    def _part(self, one):
        value, unit = one["value"], one["unit"]
        if unit is None:
            return self.words["parts"].get(value, str(value))
        return self.number(value, unit, decimals=_DECIMALS_OF_PARTS.get(unit, 0))

    def rows(self, table, keys):
        """The rows of a table that the record holds as one list per column."""
        return [
            dict(zip(keys, values, strict=True))
            for values in zip(*(table[key] for key in keys), strict=True)
        ]

    def table(self, name, rows, columns, across=None, **values):
        """A table with caption `captions.<name>`; `across` sets a long one in columns."""
        texts = [self.column_texts(rows, column) for column in columns]
        heads = [
            [self.word(f"table_headings.{c.heading or c.key}"), numbers.unit(c.unit).symbol]
            for c in columns
        ]
        align = [c.align or ("left" if _is_text(c) else "decimal") for c in columns]
        cells = [list(row) for row in zip(*texts, strict=True)]
        caption = self.word(f"captions.{name}", **values)
        if across:
            return blocks.columns_table(heads, cells, caption, align, across)
        return blocks.table(heads, cells, caption, align)

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
            return [numbers.significant(value, column.digits, self.mark) for value in scaled]
        decimals = [column.decimals] * len(rows)
        if column.height:
            decimals = [height_decimals(value) for value in values]
        if column.u is not None:
            of_rows = [(row.get(column.u) or 0.0) * factor for row in rows]
            decimals = row_decimals(of_rows, column.least)
        return [
            numbers.fixed(value, places, self.mark)
            for value, places in zip(scaled, decimals, strict=True)
        ]

    def figure(self, figure, name, width=1.0, **values):
        """A matplotlib figure with caption `captions.<name>` and description `<name>_alt`."""
        caption = self.word(f"captions.{name}", **values)
        return blocks.figure(figure, caption, self.word(f"captions.{name}_alt"), width)


def _is_text(column):
    numeric = (column.decimals, column.u, column.digits)
    return not column.height and all(rule is None for rule in numeric)
