"""The folder of a saved file that is no record, such as inspection.json, and its papers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError, VocabularyError, reason_of
from tankcal.messages import Message
from tankcal.record.saved_formats import SavedFormat
from tankcal.report import folders
from tankcal.text.decoding import read_json


def write_pages(pages, paper, folder, file, page_file=None):
    """Set pages(paper, folder) as a PDF, and pages(paper, whole=True) as a web page beside it."""
    from tankcal.report.pdf import pdf
    from tankcal.report.web import page

    (folder / file).write_bytes(pdf([block.data for block in pages(paper, folder)], folder))
    if page_file is not None:
        whole = [block.data for block in pages(paper, whole=True)]
        (folder / page_file).write_text(page(whole), encoding="utf-8")


@dataclass(frozen=True)
class SavedFolder:
    """What a command leaves behind: a saved file, and what is made from it alone.

    Attributes
    ----------
    saved_format : SavedFormat
        Of the file.
    files : tuple of str
        Everything that may lie there, the file first.
    unreadable : callable
        unreadable(error) -> Message of a file that is no JSON.
    without_content : callable
        without_content(what) -> Message of a file that does not hold what it should.
    """

    saved_format: SavedFormat
    files: tuple[str, ...]
    unreadable: Callable[[str], Message]
    without_content: Callable[[str], Message]

    def refuse_foreign(self, folder):
        """Raise InputError when a folder exists and holds anything else."""
        folders.refuse_foreign(folder, self.files)

    def file_of(self, path):
        """The saved file that a path names, itself or its folder; None where it names none."""
        path, name = Path(path), self.saved_format.file
        if path.is_dir():
            path = path / name
            return path if path.is_file() else None
        return path if path.name == name else None

    def load(self, path):
        """Read the saved file; raises InputError when it is none."""
        name = Path(path).name
        try:
            found = read_json(path)
        except (OSError, ValueError, RecursionError) as error:
            raise InputError(Problem(name, self.unreadable(reason_of(error)))) from error
        return self.saved_format.migrated(found, name)

    def write(self, folder, fill, language=None, progress=None):
        """Let fill(folder, progress) write the files, all or nothing; the paths of those made.

        An earlier folder of this kind is replaced; InputError for one that holds anything else.
        """
        self.refuse_foreign(folder)
        with folders.replaced(folder, language) as temporary:
            fill(temporary, progress or (lambda text: None))
        return [path for path in (Path(folder) / name for name in self.files) if path.exists()]

    def rebuild(self, source, write):
        """What write(found) gives of a saved file; InputError where its content is another."""
        found = self.load(source)
        try:
            return write(found)
        except VocabularyError as error:
            what = str(error)
        except TankcalError:
            raise
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            what = f"{type(error).__name__}: {error}"
        raise InputError(Problem(Path(source).name, self.without_content(what)))
