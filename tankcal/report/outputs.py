"""All files of a run, written as a whole or not at all, and its tables as CSV files."""

import csv
import gc
import io
import shutil
from collections.abc import Callable
from math import isnan
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tankcal import record as records
from tankcal.errors import CellError, InputError, Problem, TankcalError, VocabularyError
from tankcal.job.covariance import MAX_POINTS
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.memory import without_collection, without_looking_back
from tankcal.messages import message
from tankcal.methods.base import methods
from tankcal.record import long_tables, manifest
from tankcal.record.columns import ArrayColumns, Texts, count_rows, values_of
from tankcal.report import dcc, folders, numbers
from tankcal.report.attachments import sha256
from tankcal.report.laboratory import LETTERHEAD_FILE
from tankcal.report.papers import FILES as PAPER_FILES
from tankcal.report.papers import build, is_certifiable
from tankcal.report.tables import capacity, ship, survey, tank
from tankcal.report.tables import survey as readings
from tankcal.text.delimited import guard_formula
from tankcal.text.digits import PROGRAM, decimals_of_rows, fixed_rows
from tankcal.text.shipped import LANGUAGES

if TYPE_CHECKING:
    from tankcal.pipeline.chain import Result
    from tankcal.report.laboratory import Letterhead


BLOCK = 10_000  # number of rows that are formatted at a time
_YES = {True: "yes", False: "no"}
LEAST_DECIMALS = 6  # smallest number of decimals: volumes to millilitres
CSV_FILES = (
    "points.csv",
    "points_cov.npz",
    "sections.csv",
    *(file for method in methods() for file in method.csv_files),
    "capacity.csv",
    "ship_corrections.csv",
    "photos.csv",
    "cameras.csv",
    "groups.csv",
    "residuals.csv",
)


def write_table(table, path, rows):
    """Write a declared Table with its headings.

    Parameters
    ----------
    table : Table
        Declaration of the table.
    path : Path
        Path of the file.
    rows : list of dict, dict or ArrayColumns
        Rows, or columns {key: values}. Columns without values are omitted.
    """
    if isinstance(rows, ArrayColumns):
        values_of = rows.arrays
    else:
        values_of = rows if isinstance(rows, dict) else _columns_of_rows(rows)
    columns = {}
    for column in table.in_csv():
        if column.key not in values_of:
            continue
        cells = _plain(values_of[column.key], numbers.unit(column.csv_unit).factor)
        columns |= _spread(column.csv, cells)
    write_csv(columns, path, table.csv_style)


def _columns_of_rows(rows):
    keys = dict.fromkeys(key for row in rows for key in row)
    return {key: [row.get(key) for row in rows] for key in keys}


def _plain(values, factor):
    """Convert values by a factor of unit; True and False become yes and no."""
    if isinstance(values, Texts):
        return values
    if isinstance(values, np.ndarray):
        if values.dtype == bool:
            return Texts(values.astype(np.intp), ("no", "yes"))
        return values if factor == 1.0 or values.dtype.kind != "f" else factor * values
    types = set(map(type, values))
    if bool in types:
        return [_YES.get(value, value) for value in values]
    if factor == 1.0:
        return values
    return [None if value is None else factor * value for value in values]


def _spread(heading, cells):
    """Return a column; a column of lists becomes several columns, such as id_1 and id_2."""
    if isinstance(cells, Texts) and cells.codes.ndim > 1:
        each = [Texts(codes, cells.texts) for codes in cells.codes.T]
    elif not isinstance(cells, list) or not any(isinstance(cell, list) for cell in cells):
        return {heading: cells}
    else:
        width = max(map(len, cells), default=0)
        padded = ([*cell, *[""] * (width - len(cell))] for cell in cells)
        each = map(list, zip(*padded, strict=True))
    return {f"{heading}_{i}": column for i, column in enumerate(each, 1)}


def write_rows(rows, path):
    """Write rows (list of dict with equal keys) with twelve digits; lists are joined by spaces."""
    columns = {key: [_plain_cell(row[key]) for row in rows] for key in rows[0]}
    write_csv(columns, path, "%.12g")


def _plain_cell(value):
    if isinstance(value, bool):
        return _YES[value]
    return " ".join(map(str, value)) if isinstance(value, list) else value


def write_csv(columns, path, style):
    """Write columns as a CSV file.

    Parameters
    ----------
    columns : dict
        {heading: cells}, all of equal length.
    path : Path
        Path of the file.
    style : str
        Format of floats, such as "%.6f".
    """
    columns = {heading: _cells(values) for heading, values in columns.items()}
    count = len(next(iter(columns.values()), ()))
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(",".join(map(_quoted, columns)) + "\n")
        for start in range(0, count, BLOCK):
            cells = [_texts(column[start : start + BLOCK], style) for column in columns.values()]
            file.write("\n".join(map(",".join, zip(*cells, strict=True))) + "\n")


def _cells(values):
    """Return a column as numbers or as quoted texts."""
    if isinstance(values, Texts):
        return values.mapped(_quoted).filled("")
    return values if isinstance(values, np.ndarray) else list(values)


def _texts(values, style):
    """Return the cells of a column: floats in the format `style`, missing values empty."""
    if isinstance(values, np.ndarray):
        if values.dtype == object:
            return values.tolist()
        values = values_of(values)
    types = set(map(type, values))
    if types <= {int}:
        return list(map(str, values))
    if types <= {float, type(None)}:
        return ["" if x is None or x != x else style % x for x in values]
    return [_text(value, style) for value in values]


def _text(value, style):
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if isnan(value) else style % value
    return _quoted(str(value))


def _quoted(text):
    """Return a text as a cell, quoted if necessary and never a formula."""
    if text.isalnum():
        return text
    text = guard_formula(text)
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow((text, ""))
    return line.getvalue().removesuffix(",\n")


# ---- the CSV files: tables of the record in metres, millimetres and degrees


def write_tables(record, directory):
    """Write all tables of the record with rows as CSV files."""
    tables = {
        "points": (survey.POINTS, survey.point_columns(record)),
        "sections": (tank.SECTIONS, None),
    }
    for method in methods():
        if record.get(method.name):
            tables |= {name: (table, None) for name, table in method.csv_tables(record).items()}
    if record["capacity"]:
        tables["capacity"] = capacity.capacity_table(record), _capacity(record)
    if record.get("ship"):
        tables["ship_corrections"] = ship.CORRECTIONS, ship.corrections_columns(record)
    if record["adjustment"]:
        cameras, observed = (record["adjustment"][key] for key in ("cameras", "residuals"))
        free = dict.fromkeys(name for camera in cameras for name in camera["free"])
        tables |= {
            "photos": (survey.PHOTOS, None),
            "cameras": (survey.camera_table(free), None),
            "groups": (readings.GROUPS, None),
            "residuals": (readings.READINGS, readings.convert_units(observed)),
        }
    for name, (table, columns) in tables.items():
        rows = table.rows(record) if columns is None else columns
        if len(rows) and (columns is None or count_rows(columns)):
            write_table(table, directory / f"{name}.csv", rows)


def write_covariance(adjustment, directory):
    """Write points_cov.npz, the full covariance matrix of all points, in the format of a job.

    The file is omitted if the survey exceeds the limit of a job with a full covariance matrix. The
    record contains the covariance matrix of each point.
    """
    if len(adjustment.names) <= MAX_POINTS:
        np.savez(
            directory / "points_cov.npz",
            covariance_m2=adjustment.full_covariance_m2(),
            points=np.array(adjustment.names, dtype=str),
        )


def _capacity(record):
    """Return the columns of the capacity table, with volumes rounded to the digits of U."""
    columns = capacity.capacity_columns(record)
    digits = decimals_of_rows(columns["stated_U_m3"], least=LEAST_DECIMALS)
    return {
        key: fixed_rows(values, digits, PROGRAM) if "_m3" in key else values
        for key, values in columns.items()
    }


RECORD = "record.json"
WORKBOOKS = ("capacity.xlsx", "adjustment.xlsx")
FILES = (
    *(RECORD, long_tables.FILE, *CSV_FILES, *WORKBOOKS, dcc.FILE),
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
    letterhead : report.laboratory.Letterhead, optional
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
            write_covariance(result.adjustment, folder)
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
        write_covariance(adjustment, folder)
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
            write_tables(record, temporary)
        if papers:
            with without_looking_back():
                _write_papers(record, temporary, progress, language, letterhead)
    return [Path(directory) / name for name in FILES if (Path(directory) / name).exists()]


def _write_papers(record, folder, progress, language, letterhead):
    """Write workbook, digital certificate, notebook, PDFs and web page beside the record."""
    from tankcal.report import workbook  # takes a second; record and tables do not need it
    from tankcal.report.laboratory import refuse_below_capability

    refuse_below_capability(letterhead, record)
    progress(message("writing_workbook", "writing the workbook"), 0, 1)
    tank_file, survey_file = WORKBOOKS
    name = tank_file if record["capacity"] else survey_file
    digest = sha256((folder / RECORD).read_bytes())
    with without_collection():
        workbook.write(record, folder / name, language, digest)
        if is_certifiable(record):
            (folder / dcc.FILE).write_bytes(dcc.certificate_xml(record, digest, language))
    gc.collect()  # sheets and their workbook refer to each other
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
