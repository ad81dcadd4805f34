"""Paper of a saved file other than a record: head of the document and user texts."""

from datetime import date
from typing import ClassVar

from tankcal.report import attachments, blocks
from tankcal.report.plain import PlainPaper
from tankcal.text.words import message_sentence

DIGITS_OF_DIGEST = 12  # digits of the SHA-256 in the footer
LONGEST_WORD = 30  # largest number of letters of a word in a column


class SavedPaper(PlainPaper):
    """Formatter of a saved file in a language, with a letterhead.

    A subclass defines `subject()`, the subject of the paper, and `date()`, an ISO date or "".

    Attributes
    ----------
    kind : str
        Key of the title in the words: "comparison", "inspection".
    file : str
        Name of the saved file.
    attached : dict
        {name of an embedded file: key of its description}.
    is_dense : bool
        Whether the PDF has small letters and margins, for a form on a single page.
    record : dict
        Content of the saved file, from which declared tables take their rows.
    letterhead : dict or None
        Letterhead of the laboratory.
    """

    kind = file = ""
    is_dense = False
    attached: ClassVar[dict] = {}
    record: dict
    letterhead: dict | None

    def head(self, folder=None):
        """Document block and head of the first page.

        The PDF embeds the files of `folder`; None: it embeds no files.
        """
        title = self.word(f"titles.{self.kind}")
        return [
            blocks.document(
                title=f"{title}, {self.subject()}",
                author=self.letterhead["name"] if self.letterhead else "",
                date=self.date(),
                language=self.words["language"]["code"],
                notice=self.record["notice"],
                running=[title, self.subject()],
                footer=self._footer(folder),
                letterhead=self.letterhead,
                attachments=self._attachments(folder),
                **({"dense": True} if self.is_dense else {}),
            ),
            blocks.masthead(title, self.subject()),
        ]

    def _footer(self, folder):
        """Return the footer: page numbers and the first digits of the SHA-256 of the file."""
        footer = f"{self.words['page']['footer']} · tankcal {self.record['tankcal']}"
        if folder is None:
            return footer
        digest = attachments.sha256((folder / self.file).read_bytes())[:DIGITS_OF_DIGEST]
        return f"{footer} · {self.word('texts.digest', digest=digest)}"

    def _attachments(self, folder):
        if folder is None:
            return []
        described = {name: self.word(f"attached.{key}") for name, key in self.attached.items()}
        return [file.data() for file in attachments.beside(folder, described)]

    def warning(self, entry):
        """Return a warning of the file in the language."""
        sentence = message_sentence(self.words, entry["text"], entry["code"], entry["values"])
        place = f"{entry['file']}: " if entry["file"] else ""
        return bearable(f"{place}{sentence}")


def bearable(text):
    """Shorten the words of a user text that exceed the width of a column."""
    return " ".join(map(shortened, str(text).split(" ")))


def shortened(name):
    """Shorten a name to at most LONGEST_WORD letters by omitting its middle."""
    half = LONGEST_WORD // 2
    return name if len(name) <= LONGEST_WORD else f"{name[:half]}…{name[1 - half :]}"


def signed_text(value, text):
    """Prefix the text of a positive number with a plus sign."""
    return f"+{text}" if value > 0 else text


def iso_day(text):
    """Return the ISO date at the start of a text, or ""."""
    try:
        return date.fromisoformat(str(text or "")[:10]).isoformat()
    except ValueError:
        return ""
