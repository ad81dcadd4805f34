"""A paper about one saved file that is no record: the head of its document, texts of users."""

from datetime import date
from typing import ClassVar

from tankcal.report import attachments, blocks
from tankcal.report.plain import PlainPaper
from tankcal.text.words import message_sentence

DIGITS_OF_DIGEST = 12
LONGEST_WORD = 30  # letters of a name in a column of a page


class SavedPaper(PlainPaper):
    """A saved file as plain data, `found`, with the words of a language and a letterhead.

    kind      of its title and of its digest in the words: "comparison", "inspection"
    file      name of the file that it is about
    attached  {name of a file that the PDF holds inside: key of its description}

    A class of it says `subject()`, what the papers are about, and `date()`, ISO or "".
    """

    kind = file = ""
    attached: ClassVar[dict] = {}
    found: dict
    letterhead: dict | None

    def head(self, folder=None):
        """The start of the document, and the head of its first page.

        folder  of the files that the PDF holds inside; None: none
        """
        title = self.word(f"titles.{self.kind}")
        return [
            blocks.document(
                title=f"{title}, {self.subject()}",
                author=self.letterhead["name"] if self.letterhead else "",
                date=self.date(),
                language=self.words["language"]["code"],
                notice=self.found["notice"],
                running=[title, self.subject()],
                footer=self._footer(folder),
                letterhead=self.letterhead,
                attachments=self._attachments(folder),
            ),
            blocks.masthead(title, self.subject()),
        ]

    def _footer(self, folder):
        """Page numbers, and the first digits of the SHA-256 of the file that is printed."""
        made = f"{self.words['page']['footer']} · tankcal {self.found['tankcal']}"
        if folder is None:
            return made
        digest = attachments.sha256((folder / self.file).read_bytes())[:DIGITS_OF_DIGEST]
        return f"{made} · {self.word('texts.digest', digest=digest)}"

    def _attachments(self, folder):
        if folder is None:
            return []
        described = {name: self.word(f"attached.{key}") for name, key in self.attached.items()}
        return [one.data() for one in attachments.beside(folder, described)]

    def warning(self, one):
        """A warning of the file in the language."""
        said = message_sentence(self.words, one["text"], one["code"], one["values"])
        place = f"{one['file']}: " if one["file"] else ""
        return bearable(f"{place}{said}")


def bearable(text):
    """A text of a user without words that no column holds: their middle is left out."""
    return " ".join(map(shortened, str(text).split(" ")))


def shortened(name):
    """A name of at most LONGEST_WORD letters, its middle left out."""
    half = LONGEST_WORD // 2
    return name if len(name) <= LONGEST_WORD else f"{name[:half]}…{name[1 - half :]}"


def signed_text(value, text):
    """The text of a number with a plus before it where it is above 0."""
    return f"+{text}" if value > 0 else text


def iso_day(text):
    """The date that a text begins with, as text; "" where it begins with none."""
    try:
        return date.fromisoformat(str(text or "")[:10]).isoformat()
    except ValueError:
        return ""
