"""All files of a run, written as a whole or not at all."""

import shutil
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from tankcal import record as records
from tankcal.errors import CellError, InputError, Problem, TankcalError, VocabularyError
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.memory import without_collection, without_looking_back
from tankcal.messages import message
from tankcal.record import long_tables, manifest
from tankcal.report import dcc, folders
from tankcal.report.attachments import sha256
from tankcal.report.letterhead import LETTERHEAD_FILE
from tankcal.report.outputs import csv_files
from tankcal.report.papers import FILES as PAPER_FILES
from tankcal.report.papers import build, is_certifiable
from tankcal.text.shipped import LANGUAGES

if TYPE_CHECKING:
    from tankcal.pipeline.result import Result
    from tankcal.report.letterhead import Letterhead

RECORD = "record.json"
WORKBOOKS = ("capacity.xlsx", "adjustment.xlsx")
FILES = (
    *(RECORD, long_tables.FILE, *csv_files.FILES, *WORKBOOKS, dcc.FILE),
    *(*PAPER_FILES, LETTERHEAD_FILE, manifest.FILE),
)


def write(
    result: "Result",
    directory: str | PathLike,
    progress: Callable[[str, int, int], None] | None = None,
    letterhead: "Letterhead | None" = None,
    papers: bool = True,
) -> list[Path]:
    """Write all files of a result: record, CSV files, workbook, certificate.xml, and reports.

    Parameters
    ----------
    result : Result
        Result of `tankcal.run`.
    directory : path
        Folder of the results; it is created if it does not exist. Earlier results are replaced
        after all files have been written.
    progress : callable, optional
        Called as progress(text, done, total).
    letterhead : report.letterhead.Letterhead, optional
        Letterhead of the laboratory.
    papers : bool, optional
        False: write record and CSV files only; `rebuild` writes the other files from the record.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    InputError
        If the folder contains files that are no results of tankcal.
    """

    def prepare(folder):
        record = records.record_of(result)
        records.save(record, folder / RECORD)
        if result.adjustment is not None:
            csv_files.write_covariance(result.adjustment, folder)
        return record

    return _write(prepare, directory, progress, letterhead=letterhead, papers=papers)


def write_adjustment(job, adjustment, directory, progress=None, letterhead=None, papers=True):
    """Write all files of an adjusted survey without tank.

    Parameters
    ----------
    job : Job
        Job of the survey.
    adjustment : survey.Adjustment
        Result of the adjustment.
    directory, progress, letterhead, papers
        As in `write`.

    Returns
    -------
    list of Path
        Written files.
    """

    def prepare(folder):
        record = records.record_of_adjustment(job, adjustment)
        records.save(record, folder / RECORD)
        csv_files.write_covariance(adjustment, folder)
        return record

    return _write(prepare, directory, progress, letterhead=letterhead, papers=papers)


def rebuild(record_path, directory, progress=None, language=None, letterhead=None):
    """Write all files of a result from its record.json, without computation.

    The record is copied. points_cov.npz, which is not part of the record, is copied if it lies
    beside the record.

    Parameters
    ----------
    record_path : path
        Path of a record.json, or of the folder of results that contains it.
    directory, progress, letterhead : optional
        As in `write`.
    language : str, optional
        Language of workbook and papers, one of LANGUAGES; None: the language of the job.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    InputError
        If the file is no valid record, or for an unknown language.
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
        problem = message("record_speaks_otherwise", "does not have the content of a record "
                                                   "({what})",
                        what=str(error))  # fmt: skip
        raise InputError(Problem(source.name, problem)) from error
    except TankcalError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise records.content_error(source.name, error) from error


def known_language(language):
    """Return the language or None; raise InputError for a language not in LANGUAGES."""
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
    """Return the path of the record: the path itself, or record.json in a folder of results."""
    return Path(path) / RECORD if Path(path).is_dir() else Path(path)


def _write(prepare, directory, progress, language=None, letterhead=None, papers=True):
    """Write all files; prepare(folder) writes the record into a folder and returns it."""
    refuse_foreign(directory)
    progress = progress or (lambda text, done, total: None)
    with folders.replace_folder(directory, language) as temporary:
        progress(message("writing_record", "writing the record and the tables"), 0, 1)
        with without_collection():
            record = prepare(temporary)
            csv_files.write_tables(record, temporary)
        if papers:
            with without_looking_back():
                _write_papers(record, temporary, progress, language, letterhead)
    return [Path(directory) / name for name in FILES if (Path(directory) / name).exists()]


def _write_papers(record, folder, progress, language, letterhead):
    """Write workbook, digital certificate, notebook, PDFs and web page beside the record."""
    from tankcal.report import workbook  # takes a second; record and tables do not need it
    from tankcal.report.scope import refuse_below_capability

    refuse_below_capability(letterhead, record)
    progress(message("writing_workbook", "writing the workbook"), 0, 1)
    tank_file, survey_file = WORKBOOKS
    name = tank_file if record["capacity"] else survey_file
    digest = sha256((folder / RECORD).read_bytes())
    with without_collection():
        workbook.write(record, folder / name, language, digest)
        if is_certifiable(record):
            (folder / dcc.FILE).write_bytes(dcc.certificate_xml(record, digest, language))
    build(
        folder / RECORD,
        folder,
        lambda done, total: progress(message("writing_report", "writing the report"), done, total),
        language,
        letterhead,
        record,
    )


def refuse_foreign(directory):
    """Raise InputError if `directory` contains files that are no results of tankcal."""
    folders.refuse_foreign(directory, FILES)
