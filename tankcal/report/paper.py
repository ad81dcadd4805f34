"""A record on paper: its values with their units and digits, in the words of its language.

The cells of the templates use it; nothing here computes a number.

    paper = Paper("record.json")
    columns = [Column("course"), Column("height_m", "m", 3)]
    paper.table("courses", paper.record["courses"], columns)
"""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from tankcal.record import load
from tankcal.record.columns import as_columns
from tankcal.report import attachments, blocks
from tankcal.report.letterhead import read_saved
from tankcal.report.plain import Column, PlainPaper
from tankcal.text.words import (
    choice_sentence,
    input_name,
    language_of,
    load_words,
    translate_record,
)

__all__ = ["Column", "Paper"]
_BLANK = "_" * 20  # to be filled in by hand
_DIGITS_OF_DIGEST = 12
DECIMALS_OF_PARTS = {"m": 4, "m3": 4, "mm/m": 2, "mm": 2, "deg": 2, "kg/m3": 1}


@dataclass(frozen=True)
class ReadRecord:
    """A record.json that has been read: its path, and what it holds."""

    path: Path
    record: dict = field(repr=False)


class Paper(PlainPaper):
    """A record with its language's words; raises InputError for another format.

    source      the path of a record.json, a ReadRecord, or a record as parsed
    words       of a language; None: those of `language`
    language    None: that which the record asks for
    letterhead  the path of a saved letterhead, or None
    """

    def __init__(self, source, words=None, language=None, letterhead=None):
        if isinstance(source, dict):
            path, record = None, source
        elif isinstance(source, ReadRecord):
            path, record = source.path, source.record
        else:
            path, record = Path(source), load(source)
        super().__init__(words or load_words(language or language_of(record)))
        self.record = translate_record(self.words, record)
        self._path = path
        self.letterhead = read_saved(letterhead) if letterhead else None

    @property
    def volume_unit(self):
        """The unit that the job chose for volumes."""
        return (self.record["job"]["table"] or {}).get("volume_unit") or "m3"

    def input_name(self, row):
        """The name of an input of the budget."""
        return input_name(self.words, row)

    def coverage(self):
        """The coverage probability in percent."""
        return self.percent(self.record["job"]["table"]["coverage_probability"])

    def choices(self, code=None):
        """One sentence for each choice of the record, or for that with the given code."""
        return [
            choice_sentence(self.words, choice)
            for choice in self.record["choices"]
            if code in (None, choice["code"])
        ]

    @cached_property
    def readings(self):
        """`ArrayColumns` of every reading of the adjustment."""
        return as_columns(self.record["adjustment"]["residuals"])

    # ---- blocks

    def document(self, part):
        """The start of the part: title, author, running head with the notice, page numbers."""
        certificate, tank = self.record["job"]["certificate"], self.subject()
        of_letterhead = self.letterhead["name"] if self.letterhead else ""
        number = certificate.get("number") or (_BLANK if part == "certificate" else "")
        left = f"{self.word('page.number')} {number}" if number else ""
        return blocks.document(
            part=part,
            title=f"{self.word(f'titles.{part}')}, {tank}",
            author=str(certificate.get("laboratory") or of_letterhead),
            date=self.date(),
            language=self.words["language"]["code"],
            notice=str(certificate.get("notice", "")),
            running=[left, tank],
            footer=self._footer(),
            letterhead=self.letterhead,
            attachments=self._attachments(part),
            record_sha256=self.digest or "",
        )

    def _footer(self):
        """Page numbers, and the first digits of the SHA-256 of the record that is printed."""
        pages = self.words["page"]["footer"]
        if self.digest is None:
            return pages
        digest = self.digest[:_DIGITS_OF_DIGEST]
        return f"{pages} · {self.word('certificate.record', digest=digest)}"

    @cached_property
    def digest(self):
        """The SHA-256 of the file of the record; None for a record that was handed over parsed."""
        return attachments.sha256(self._path.read_bytes()) if self._path else None

    def _attachments(self, part):
        """The files to be held inside the part's PDF; they lie beside the record."""
        is_first = part == "certificate" or self.record["capacity"] is None
        if self._path is None or not is_first:
            return []
        names = attachments.OF_RECORD
        described = {name: self.word(f"attached.{Path(name).stem}") for name in names}
        return [one.data() for one in attachments.beside(self._path.parent, described)]

    def laboratory(self):
        """Who issues the paper, for the head of its first page; "" where the letterhead says it."""
        name = self.record["job"]["certificate"].get("laboratory", "")
        return "" if self.letterhead and self.letterhead["name"] == name else name

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

    def dimensions(self, described):
        """What the record says of a part: [{code, value, unit}], a text where there is no unit.

        A code that is a text is looked up in the words `parts`.
        """
        return blocks.key_values(
            [(self.label(one["code"]), self.size_text(one)) for one in described]
        )

    def size_text(self, one):
        """What the record says of one size of a part: its value with its unit, or its words."""
        value, unit = one["value"], one["unit"]
        if unit is None:
            return self.words["parts"].get(value, str(value))
        return self.number(value, unit, decimals=DECIMALS_OF_PARTS.get(unit, 0))
