"""Everything that a run leaves behind, written all or nothing."""

import shutil
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from tankcal import record as records
from tankcal import report
from tankcal.errors import CellError, InputError, Problem, TankcalError, VocabularyError
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.memory import without_collection, without_looking_back
from tankcal.messages import message
from tankcal.record import long_tables, manifest
from tankcal.report import dcc, folders
from tankcal.report.attachments import sha256
from tankcal.report.outputs import tables
from tankcal.text.languages import LANGUAGES

if TYPE_CHECKING:
    from tankcal.pipeline.result import Result
    from tankcal.report.letterhead import Letterhead

RECORD = "record.json"
WORKBOOKS = ("capacity.xlsx", "adjustment.xlsx")
FILES = (
    *(RECORD, long_tables.FILE, *tables.FILES, *WORKBOOKS, dcc.FILE),
    *(*report.FILES, report.LETTERHEAD, manifest.FILE),
)


def write(
    result: "Result",
    directory: str | PathLike,
    progress: Callable[[str, int, int], None] | None = None,
    letterhead: "Letterhead | None" = None,
    papers: bool = True,
) -> list[Path]:
    """Write record, CSV files, workbook, certificate.xml, notebook, PDFs and HTML of a result.

    Parameters
    ----------
    result : Result
        Of `tankcal.run`.
    directory : path
        Made when missing; earlier results there are replaced when all is written, and a folder that
        holds anything else is refused.
    progress : callable, optional
        Called as progress(text, done, total).
    letterhead : report.letterhead.Letterhead, optional
    papers : bool, optional
        False: record and CSV files only; `rebuild` makes the others from the record.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For a folder that is not tankcal's to replace.
    """

    def prepare(folder):
        record = records.record_of(result)
        records.save(record, folder / RECORD)
        if result.adjustment is not None:
            tables.write_covariance(result.adjustment, folder)
        return record

    return _write(prepare, directory, progress, letterhead=letterhead, papers=papers)


def write_adjustment(job, adjustment, directory, progress=None, letterhead=None, papers=True):
    """The same for a survey that was only adjusted (`survey.Adjustment` of a `Job`)."""

    def prepare(folder):
        record = records.record_of_adjustment(job, adjustment)
        records.save(record, folder / RECORD)
        tables.write_covariance(adjustment, folder)
        return record

    return _write(prepare, directory, progress, letterhead=letterhead, papers=papers)


def rebuild(record_path, directory, progress=None, language=None, letterhead=None):
    """Write the same from a record.json alone; nothing is computed again, the record is copied.

    points_cov.npz, which no record holds, is taken over when it lies beside the record. The other
    arguments are those of `write`.

    Parameters
    ----------
    record_path : path
        Of a record.json, or the folder of results that holds one.
    language : str, optional
        Of workbook and papers, one of LANGUAGES; None: that of the job.

    Raises
    ------
    InputError
        For what is no record, or a language that is not known.
    """
    source = record_file(record_path)
    known_language(language)
    record = records.load(source)

    def prepare(folder):
        records.copy_record(record, source, folder)
        covariance = source.with_name(COVARIANCE_FILE)
        if covariance.exists():
            shutil.copyfile(covariance, folder / covariance.name)
        return record

    try:
        return _write(prepare, directory, progress, language, letterhead)
    except (VocabularyError, CellError) as error:
        found = message("record_speaks_otherwise", "does not have the content of a record "
                                                   "({what})",
                        what=str(error))  # fmt: skip
        raise InputError(Problem(source.name, found)) from error
    except TankcalError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        found = message(
            "no_record",
            "does not have the content of a record ({name}: {error})",
            name=type(error).__name__,
            error=str(error),
        )
        raise InputError(Problem(source.name, found)) from error


def known_language(language):
    """The language, or None; raises InputError for one that is not among LANGUAGES."""
    if language not in (None, *LANGUAGES):
        expected = message(
            "unknown_language",
            "found {language!r}; expected one of {languages}",
            language=language,
            languages=[*LANGUAGES],
        )
        raise InputError(Problem("--language", expected))
    return language


def record_file(path):
    """The record that a path names: the file itself, or record.json in a folder of results."""
    return Path(path) / RECORD if Path(path).is_dir() else Path(path)


def _write(prepare, directory, progress, language=None, letterhead=None, papers=True):
    """Write everything into `directory`; `prepare` puts the record into a folder and gives it."""
    refuse_foreign(directory)
    progress = progress or (lambda text, done, total: None)
    with folders.replaced(directory, language) as temporary:
        progress(message("writing_record", "writing the record and the tables"), 0, 1)
        with without_collection():
            record = prepare(temporary)
            tables.write_tables(record, temporary)
        if papers:
            with without_looking_back():
                _write_papers(record, temporary, progress, language, letterhead)
    return [Path(directory) / name for name in FILES if (Path(directory) / name).exists()]


def _write_papers(record, folder, progress, language, letterhead):
    """Workbook, digital certificate, notebook, PDFs and HTML beside the record."""
    from tankcal.report import (
        workbook,  # a second to import, which record and tables need not wait for
    )

    progress(message("writing_workbook", "writing the workbook"), 0, 1)
    of_tank, of_survey = WORKBOOKS
    name = of_tank if record["capacity"] else of_survey
    digest = sha256((folder / RECORD).read_bytes())
    with without_collection():
        workbook.write(record, folder / name, language, digest)
        if record["capacity"]:
            (folder / dcc.FILE).write_bytes(dcc.certificate_xml(record, digest, language))
    report.build(
        folder / RECORD,
        folder,
        lambda done, total: progress(message("writing_report", "writing the report"), done, total),
        language,
        letterhead,
        record,
    )


def refuse_foreign(directory):
    """Raise InputError when `directory` exists and holds anything but results of tankcal."""
    folders.refuse_foreign(directory, FILES)
