"""Document of a saved file other than a record, such as comparison.json.

A `SavedDocument` declares what a product writes: the saved file, its tables as CSV files, a
workbook, a PDF and a web page. All of them are derived from the saved file, so that `tankcal
report` can write them again (docs/house.md, "How a document is declared").
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import ClassVar

from tankcal.errors import InputError, Problem, TankcalError, VocabularyError, reason_of
from tankcal.messages import message
from tankcal.record import manifest, save
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import to_plain
from tankcal.report import attachments, blocks, folders
from tankcal.report.plain import PlainPaper
from tankcal.text.delimited import read_json
from tankcal.text.words import message_sentence

DIGITS_OF_DIGEST = 12  # digits of the SHA-256 in the footer
LONGEST_WORD = 30  # largest number of letters of a word in a column


@dataclass(frozen=True)
class SavedDocument:
    """Declaration of a document; its files have the name of the saved file.

    Attributes
    ----------
    saved_format : SavedFormat
        Format of the saved file.
    paper_of : callable
        paper_of(plain, language, letterhead) returns the `SavedPaper` of plain data.
    renderers : callable
        renderers() returns two functions, which are imported when they are needed:
        pages(paper, folder=None, whole=False) returns the blocks of the PDF, or with `whole` those
        of the web page; write_workbook(paper, path) writes the workbook.
    tables : Mapping of str to Table
        {name of the CSV file: its table}. A table without rows has no file.
    has_page : bool
        Whether the document has a web page.
    others : Mapping of str to callable
        {name of a further file: function that writes it}, as `write_workbook`, before the PDF.
    recomputed_by : str
        "module:function" that computes the content again, as (content, folder of the inputs) to
        (number of compared values or None, list of Problem, list of Message on checks that were
        not possible); "": not possible.
    """

    saved_format: SavedFormat
    paper_of: Callable
    renderers: Callable
    tables: Mapping = field(default_factory=dict)
    has_page: bool = True
    others: Mapping = field(default_factory=dict)
    recomputed_by: str = ""

    @property
    def files(self):
        """Names of all possible files, the saved file first (tuple of str)."""
        page = (self._file(".html"),) if self.has_page else ()
        workbook, pdf = self._file(".xlsx"), self._file(".pdf")
        return (
            self.saved_format.file,
            *self.tables,
            workbook,
            *self.others,
            pdf,
            *page,
            manifest.FILE,
        )

    def _file(self, suffix):
        return Path(self.saved_format.file).with_suffix(suffix).name

    def refuse_foreign(self, folder):
        """Raise InputError if a folder exists and contains any other file."""
        folders.refuse_foreign(folder, self.files)

    def find_file(self, path):
        """Return the saved file at a path, which is the file or its folder; None if absent."""
        path, name = Path(path), self.saved_format.file
        if path.is_dir():
            path = path / name
            return path if path.is_file() else None
        return path if path.name == name else None

    def load(self, path):
        """Read the saved file; raise InputError if it is invalid."""
        name = Path(path).name
        try:
            data = read_json(path)
        except (OSError, ValueError, RecursionError) as error:
            text = message(
                "saved_file_unreadable", "cannot be read: {error}", error=reason_of(error)
            )
            raise InputError(Problem(name, text)) from error
        return self.saved_format.migrated(data, name)

    def write(self, result, folder, language=None, progress=None, letterhead=None):
        """Write all files, all or none; an earlier document in the folder is replaced.

        Parameters
        ----------
        result : dataclass or dict
            Content of the saved file, such as the result of `recalibration.comparison.compare`, or
            the same as plain data.
        folder : str or Path
            Folder of the results; it is created if it does not exist.
        language : str, optional
            Language of papers and workbook, one of languages.LANGUAGES; None: English.
        progress : callable, optional
            Called as progress(message) at the beginning of each step.
        letterhead : report.letterhead.Letterhead, optional
            Letterhead of the laboratory.

        Returns
        -------
        list of Path
            Written files.

        Raises
        ------
        InputError
            For a folder with other files, and for data without the content of the format.
        """
        plain = result if isinstance(result, dict) else to_plain(result)
        paper = self.paper_of(plain, language, letterhead)
        self.refuse_foreign(folder)
        with folders.replace_folder(folder, language) as temporary:
            self._write_files(paper, temporary, progress or (lambda text: None))
        return [path for path in (Path(folder) / name for name in self.files) if path.exists()]

    def _write_files(self, paper, folder, progress):
        from tankcal.report.outputs import write_table
        from tankcal.report.pdf import pdf
        from tankcal.report.web import page

        pages, write_workbook = self.renderers()
        progress(message("document_tables", "writing the tables"))
        save(paper.saved, folder / self.saved_format.file)
        for name, table in self.tables.items():
            if rows := table.rows(paper.record):
                write_table(table, folder / name, rows)
        write_workbook(paper, folder / self._file(".xlsx"))
        for name, write_file in self.others.items():
            write_file(paper, folder / name)
        progress(message("document_papers", "writing the documents"))
        # The PDF embeds the files that were written before it.
        blocks = [block.data for block in pages(paper, folder)]
        (folder / self._file(".pdf")).write_bytes(pdf(blocks, folder))
        if self.has_page:
            blocks = [block.data for block in pages(paper, whole=True)]
            (folder / self._file(".html")).write_text(page(blocks), encoding="utf-8")

    def compute_again(self, content, folder):
        """Compute the content again, as `recomputed_by` does.

        The function is in a package above `report`, so it is named by a text.
        """
        module, _, name = self.recomputed_by.partition(":")
        return getattr(import_module(module), name)(content, folder)

    def rebuild(self, source, folder, language=None, progress=None, letterhead=None):
        """Write all files from a saved file; other arguments and errors as in `write`."""
        data = self.load(source)
        try:
            return self.write(data, folder, language, progress, letterhead)
        except VocabularyError as error:
            what = str(error)
        except TankcalError:
            raise
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            what = f"{type(error).__name__}: {error}"
        text = message(
            "saved_file_without_content",
            "lacks the content of a file of this name, or is damaged ({what})",
            what=what,
        )
        raise InputError(Problem(Path(source).name, text))


# ---- paper of a saved file other than a record: head of the document and user texts


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
