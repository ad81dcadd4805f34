"""Folder of a saved file other than a record, such as inspection.json, and its papers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError, VocabularyError, reason_of
from tankcal.messages import Message
from tankcal.record.saved_formats import SavedFormat
from tankcal.report import folders
from tankcal.text.decoding import read_json


def write_pages(pages, paper, folder, file, page_file=None):
    """Write pages(paper, folder) as a PDF and pages(paper, whole=True) as a web page.

    Parameters
    ----------
    pages : callable
        pages(paper, folder) and pages(paper, whole=True) return lists of Block.
    paper : SavedPaper
        Formatter of the saved file.
    folder : Path
        Folder of the files.
    file : str
        Name of the PDF.
    page_file : str, optional
        Name of the web page; None: no web page.
    """
    from tankcal.report.pdf import pdf
    from tankcal.report.web import page

    (folder / file).write_bytes(pdf([block.data for block in pages(paper, folder)], folder))
    if page_file is not None:
        web_blocks = [block.data for block in pages(paper, whole=True)]
        (folder / page_file).write_text(page(web_blocks), encoding="utf-8")


@dataclass(frozen=True)
class SavedFolder:
    """Results of a command: a saved file and the files derived from it.

    Attributes
    ----------
    saved_format : SavedFormat
        Format of the saved file.
    files : tuple of str
        Names of all possible files, the saved file first.
    unreadable : callable
        unreadable(error) -> Message for a file that is no JSON.
    without_content : callable
        without_content(what) -> Message for a file with unexpected content.
    """

    saved_format: SavedFormat
    files: tuple[str, ...]
    unreadable: Callable[[str], Message]
    without_content: Callable[[str], Message]

    def refuse_foreign(self, folder):
        """Raise InputError if a folder exists and contains any other file."""
        folders.refuse_foreign(folder, self.files)

    def file_of(self, path):
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
            raise InputError(Problem(name, self.unreadable(reason_of(error)))) from error
        return self.saved_format.migrated(data, name)

    def write(self, folder, fill, language=None, progress=None):
        """Write the files by fill(folder, progress), all or none; return their paths.

        An earlier folder of this kind is replaced. A folder with other files raises InputError.

        Parameters
        ----------
        folder : str or Path
            Folder of the results.
        fill : callable
            fill(folder, progress) writes the files.
        language : str, optional
            Language requested for the papers; None: no request.
        progress : callable, optional
            Called as progress(text).

        Returns
        -------
        list of Path
        """
        self.refuse_foreign(folder)
        with folders.replaced(folder, language) as temporary:
            fill(temporary, progress or (lambda text: None))
        return [path for path in (Path(folder) / name for name in self.files) if path.exists()]

    def rebuild(self, source, write):
        """Return write(data) of a saved file; raise InputError for unexpected content."""
        data = self.load(source)
        try:
            return write(data)
        except VocabularyError as error:
            what = str(error)
        except TankcalError:
            raise
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            what = f"{type(error).__name__}: {error}"
        raise InputError(Problem(Path(source).name, self.without_content(what)))
