"""Formatting of a record in a language: values with their units and digits, and blocks.

The cells of the templates use this module. It computes no results.

    paper = Paper("record.json")
    columns = [Column("course"), Column("height_m", "m", 3)]
    paper.table("courses", paper.record["courses"], columns)
"""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from tankcal.job.certificate_entries import IN_LETTERHEAD
from tankcal.record import load
from tankcal.record.columns import as_columns
from tankcal.report import attachments, blocks
from tankcal.report.laboratory import letterhead_in_scope, read_saved
from tankcal.report.plain import Column, PlainPaper
from tankcal.report.uncertainty.stated import stated_U_m3
from tankcal.text.words import (
    choice_sentence,
    input_name,
    language_of,
    load_words,
    translate_record,
)

__all__ = ["Column", "Paper"]
_BLANK = "_" * 20  # line to fill in by hand
INCOMPLETE = "certificate_incomplete"  # code of the warning of missing entries
_DIGITS_OF_DIGEST = 12  # digits of the SHA-256 in the footer
# Decimals of the dimensions of a part, by unit.
DECIMALS_OF_PARTS = {"m": 4, "m3": 4, "mm/m": 2, "mm": 2, "deg": 2, "kg/m3": 1}


@dataclass(frozen=True)
class ReadRecord:
    """A loaded record.json with its path."""

    path: Path
    record: dict = field(repr=False)


def _complete(warnings):
    """Return the warnings without the missing entries that a letterhead supplies."""
    kept = []
    for warning in warnings:
        entries = (warning.get("values") or {}).get("entries")
        if warning.get("code") == INCOMPLETE and set(entries) & set(IN_LETTERHEAD):
            missing = [entry for entry in entries if entry not in IN_LETTERHEAD]
            text = warning["text"].replace(", ".join(entries), ", ".join(missing))
            kept += [warning | {"text": text, "values": {"entries": missing}}] if missing else []
        else:
            kept.append(warning)
    return kept


class Paper(PlainPaper):
    """Formatter of a record in a language.

    Parameters
    ----------
    source : str, Path, ReadRecord or dict
        Path of a record.json, or the loaded record.
    words : dict, optional
        Words of the language; None: the words of `language`.
    language : str, optional
        Code of the language; None: the language of the record.
    letterhead : str or Path, optional
        Path of a saved letterhead.

    Raises
    ------
    InputError
        If the file has another format.
    """

    def __init__(self, source, words=None, language=None, letterhead=None):
        if isinstance(source, dict):
            path, record = None, source
        elif isinstance(source, ReadRecord):
            path, record = source.path, source.record
        else:
            path, record = Path(source), load(source)
        super().__init__(words or load_words(language or language_of(record)))
        self._path = path
        self.letterhead = read_saved(letterhead) if letterhead else None
        if self.letterhead:
            record = record | {"warnings": _complete(record["warnings"])}
        self.record = translate_record(self.words, record)

    @property
    def volume_unit(self):
        """Unit of volumes that the job specifies."""
        return (self.record["job"]["table"] or {}).get("volume_unit") or "m3"

    def input_name(self, row):
        """Return the name of an input quantity of the budget."""
        return input_name(self.words, row)

    def coverage(self):
        """Return the coverage probability in percent (str)."""
        return self.percent(self.record["job"]["table"]["coverage_probability"])

    def choices(self, code=None):
        """Return a sentence for each choice of the record, or for the choices with a code."""
        return [
            choice_sentence(self.words, choice)
            for choice in self.record["choices"]
            if code in (None, choice["code"])
        ]

    @cached_property
    def readings(self):
        """Residuals of all readings of the adjustment (`ArrayColumns`)."""
        return as_columns(self.record["adjustment"]["residuals"])

    # ---- blocks

    def document(self, part):
        """Document block of a part, with title, author, running head and footer."""
        certificate, tank = self.record["job"]["certificate"], self.subject()
        letterhead_name = self.letterhead["name"] if self.letterhead else ""
        number = certificate.get("number") or (_BLANK if part == "certificate" else "")
        left = f"{self.word('page.number')} {number}" if number else ""
        return blocks.document(
            part=part,
            title=f"{self.word(f'titles.{part}')}, {tank}",
            author=str(certificate.get("laboratory") or letterhead_name),
            date=self.date(),
            language=self.words["language"]["code"],
            notice=str(certificate.get("notice", "")),
            running=[left, tank],
            footer=self._footer(),
            letterhead=letterhead_in_scope(self.letterhead, self.record),
            attachments=self._attachments(part),
            record_sha256=self.digest or "",
        )

    def _footer(self):
        """Return the footer: page numbers and the first digits of the SHA-256 of the record."""
        pages = self.words["page"]["footer"]
        if self.digest is None:
            return pages
        digest = self.digest[:_DIGITS_OF_DIGEST]
        return f"{pages} · {self.word('certificate.record', digest=digest)}"

    @cached_property
    def digest(self):
        """SHA-256 of the file of the record; None for a record without a file."""
        return attachments.sha256(self._path.read_bytes()) if self._path else None

    def _attachments(self, part):
        """Return the files beside the record that the PDF of a part embeds."""
        is_first = part == "certificate" or self.record["capacity"] is None
        if self._path is None or not is_first:
            return []
        names = attachments.OF_RECORD
        described = {name: self.word(f"attached.{Path(name).stem}") for name in names}
        return [file.data() for file in attachments.beside(self._path.parent, described)]

    def laboratory(self):
        """Return the laboratory for the head of the first page; "" if the letterhead names it."""
        name = self.record["job"]["certificate"].get("laboratory", "")
        return "" if self.letterhead and self.letterhead["name"] == name else name

    def date(self):
        """Return the date of issue if given, otherwise the date of the survey (ISO)."""
        job = self.record["job"]
        return str(job["certificate"].get("date_of_issue") or (job["survey"] or {}).get("date", ""))

    def subject(self):
        """Return the subject of the report: the tank, or the survey by the name of its job."""
        tank = self.record["job"]["tank"]
        if tank is None:
            return f"{self.word('page.survey')} {self.record['job']['source']}"
        return f"{self.word('page.tank')} {tank['id']}"

    def subtitle(self, part):
        """Return the line below the title of a part."""
        tank = self.record["job"]["tank"]
        if self.record["capacity"] is None:
            name = self.record["job"]["source"] if tank is None else self.subject()
            return self.word("titles.adjustment_subtitle", value=name)
        return self.word(f"titles.{part}", value=self.word(f"kinds.{tank['kind']}"))

    def dimensions(self, described):
        """Block of the dimensions of a part, [{code, value, unit}].

        A value without a unit is a text; its translation is in the words `parts`.
        """
        return blocks.key_values(
            [(self.label(size["code"]), self.size_text(size)) for size in described]
        )

    def size_text(self, size):
        """Return a size of a part, {code, value, unit}, as a number with its unit or as words."""
        value, unit = size["value"], size["unit"]
        if unit is None:
            return self.words["parts"].get(value, str(value))
        if size["code"] == "full_capacity" and (U_m3 := stated_U_m3(self.record["capacity"])[-1]):
            return self.number(value, unit, u=U_m3)
        return self.number(value, unit, decimals=DECIMALS_OF_PARTS.get(unit, 0))
