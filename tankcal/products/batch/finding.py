"""Search for the jobs named on the command line: folders, workbooks, patterns and lists.

The name of a job is the name of its folder or workbook. Jobs with equal names have a part of the
SHA-256 of their path appended. A job already contained in the folder of the batch keeps its name.
"""

import csv
import glob
import os
import re
import zipfile
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.folder import (
    decode,
    is_row,
    results_given_as_job,
    separator_of_text,
    split_lines,
)
from tankcal.job.tables import (
    SETTINGS_FILE,
    SETTINGS_SHEET,
    WORKBOOK_FILE,
    Log,
    read_bytes,
)
from tankcal.messages import message
from tankcal.products.batch.outcomes import LIST_OPTIONS, Options, read_known_names
from tankcal.text.delimited import split_cells
from tankcal.text.naming import file_name

RECORD = "record.json"
SAVED = (RECORD, "comparison.json", "inspection.json", "upkeep.json")
UPKEEP_FILE = "upkeep.toml"
BOOK = ".xlsx"
OUTCOME, OF_BATCH = "outcome.json", ("report", "export")  # file and folders of a job of a batch
PATTERN = re.compile(r"[*?\[]")
HEADINGS = ("job", "name", *LIST_OPTIONS)  # headings of a list of jobs; only the first is required
DIGITS = 6  # hexadecimal digits of a digest appended to a name
MOST_LIST_BYTES = 100_000_000
ENDINGS = (".toml", ".csv", ".xlsx", ".pdf", ".json")  # of former tables named after jobs


@dataclass(frozen=True)
class NamedJob:
    """A job as named by the user.

    Attributes
    ----------
    source : Path
        Job folder, workbook, or saved file such as record.json. It may not exist; this is reported
        when it is read.
    overrides : dict
        Name and options of this job only, see `options.LIST_OPTIONS`.
    """

    source: Path
    overrides: dict


@dataclass(frozen=True)
class BatchJob:
    """One job of a batch.

    Attributes
    ----------
    name : str
        Name of its folder, unique in the batch.
    label : str
        Name of the job, which other jobs may also have.
    source : str
        Absolute path.
    options : Options
    """

    name: str
    label: str
    source: str
    options: Options


def find_jobs(arguments, options, out=None, known=None):
    """Return the jobs named by arguments, sorted by name.

    Parameters
    ----------
    arguments : sequence of str
        Job folders, workbooks, saved records, folders of any of these, shell patterns, lists
        (`@jobs.txt`, `jobs.csv`).
    options : Options
    out : str, optional
        Absolute path of the folder of the batch, which is not searched.
    known : dict, optional
        {absolute path: name} of the jobs in the folder of the batch.

    Returns
    -------
    list of BatchJob

    Raises
    ------
    InputError
        A list cannot be read, or an argument names no job.
    """
    log, jobs = Log(), {}
    target = _Target(_kind_of_input(options.steps), out)
    for argument in arguments:
        for job in _find_of_argument(argument, target, log):
            jobs.setdefault(os.path.abspath(job.source), job)  # a link is a separate job
    log.stop_if_problems()
    return _assign_names(jobs, options, known or {})


@dataclass(frozen=True)
class _Target:
    """Kind of objects to search for (see `_kind_of_input`), and the folder to skip."""

    kind: str
    out: str | None


def _kind_of_input(steps):
    """Return the input of the steps: "jobs", "records", "upkeeps", or "either", jobs preferred."""
    if "run" in steps:
        return "jobs"
    if "upkeep" in steps:
        return "upkeeps"
    return "either" if steps == ("inspect",) else "records"


def _find_of_argument(argument, target, log):
    """Return the `NamedJob` objects of an argument."""
    path = Path(argument.removeprefix("@"))
    if argument.startswith("@") or (path.suffix.lower() == ".csv" and path.is_file()):
        return _find_listed(path, target, log)
    if PATTERN.search(argument) and not os.path.lexists(argument):
        names = sorted(glob.glob(argument, recursive=True))
        if not names:
            text = message("batch_no_match", "no file or folder matches; expected jobs")
            log.problem(argument, text)
        return [
            job for name in names for job in _find_in_path(Path(name), target, log, strict=False)
        ]
    return _find_in_path(path, target, log)


def _find_in_path(path, target, log, strict=True):
    """Return the jobs of a path: the path itself, or the jobs in a folder.

    strict  whether a folder without jobs is a problem
    """
    job_path = _job_of_path(path, target)
    if job_path is not None:
        return [NamedJob(job_path, {})]
    if not path.is_dir():
        return [NamedJob(path, {})] if strict or path.suffix.lower() == BOOK else []
    try:
        inside = _find_in_folder(path, target)
    except OSError as error:
        text = message("batch_folder_unreadable", "the folder cannot be read ({reason})",
                       reason=reason_of(error))  # fmt: skip
        log.problem(error.filename or str(path), text)
        return []
    if not inside and strict:
        results = None if target.kind == "records" else results_given_as_job(path)
        log.problem(str(path), results or _empty_folder_message(target.kind))
    return [NamedJob(source, {}) for source in inside]


def _empty_folder_message(kind):
    """Return the message for a folder without jobs or results."""
    if kind == "records":
        return message(
            "batch_no_records",
            "contains no results; expected folders with record.json, such as results of tankcal "
            "run",
        )
    if kind == "upkeeps":
        return message(
            "batch_no_upkeeps", "contains no tank in service; expected folders with upkeep.toml"
        )
    return message(
        "batch_no_jobs",
        "contains no job; expected job folders with job.toml, or job workbooks (.xlsx)",
    )


def _job_of_path(path, target):
    """Return the job that a path is, or None."""
    if target.kind == "upkeeps":
        path = path.parent if path.name == UPKEEP_FILE else path
        return path if (path / UPKEEP_FILE).is_file() else None
    if path.name == SETTINGS_FILE and path.is_file():
        path = path.parent
    if (path / SETTINGS_FILE).is_file():
        if target.kind != "records":
            return path
        return path / "results" / RECORD if (path / "results" / RECORD).is_file() else None
    if path.name in SAVED and path.is_file():
        return path
    if target.kind != "jobs" and path.is_dir():
        return next((path / name for name in SAVED if (path / name).is_file()), None)
    return (
        path
        if target.kind != "records" and path.suffix.lower() == BOOK and path.is_file()
        else None
    )


def _find_in_folder(folder, target):
    """Return the sorted jobs below a folder, without hidden folders and contents of jobs."""
    sources = []

    def fail(error):
        raise error

    for place, folders, names in os.walk(folder, onerror=fail):
        place = Path(place)
        if os.path.abspath(place) == target.out:
            folders.clear()
            continue
        of_batch = OUTCOME in names  # a job of another batch: its reports are not jobs
        folders[:] = sorted(
            folder_name
            for folder_name in folders
            if folder_name[0] != "." and not (of_batch and folder_name in OF_BATCH)
        )
        saved = [name for name in SAVED if name in names]
        if target.kind == "upkeeps":
            if UPKEEP_FILE in names:
                sources.append(place)
                folders.clear()
            continue
        if target.kind == "records":
            sources += [place / name for name in saved]
        elif SETTINGS_FILE in names:
            sources.append(place)
            folders.clear()
        elif saved:
            sources += [place / saved[0]] if target.kind == "either" else []
            folders.clear()
        else:
            books = (place / name for name in sorted(names) if name[0] not in ".~")
            sources += [book for book in books if book.suffix.lower() == BOOK and _is_job(book)]
    return sorted(sources)


def _is_job(book):
    """Return whether a workbook has the sheet of a job; True also for an unreadable workbook."""
    try:
        with zipfile.ZipFile(book) as file:
            sheets = file.read("xl/workbook.xml")
    except (OSError, KeyError, ValueError, zipfile.BadZipFile, NotImplementedError, RuntimeError):
        return True
    return re.search(rb'\bname="\s*%s\s*"' % SETTINGS_SHEET.encode(), sheets, re.IGNORECASE)


# ---- lists


def _find_listed(path, target, log):
    """Return the jobs of a list: one per line, or a CSV file with a column job."""
    data, is_csv = read_bytes(path, log, MOST_LIST_BYTES), path.suffix.lower() == ".csv"
    text = None if data is None else decode(path.name, data, log)
    if text is None:
        return []
    problems_before = len(log.problems)
    if is_csv:
        rows = list(_csv_rows(path, text, log))
    else:  # one job per line
        lines = map(str.strip, text.splitlines())
        rows = [{"job": line} for line in lines if line and not line.startswith("#")]
    jobs = []
    for cells in rows:
        job = cells.pop("job")
        for name in LIST_OPTIONS:  # files relative to the list, else names, such as a shipped rule
            beside = path.parent / cells.get(name, "")
            if cells.get(name) and (name == "former" or beside.is_file()):
                cells[name] = os.path.abspath(beside)
        source = path.parent / job
        inside = _find_in_path(source, target, log, strict=False) or [NamedJob(source, {})]
        jobs += [NamedJob(named.source, cells) for named in inside]
    if not jobs and len(log.problems) == problems_before:
        log.problem(
            path.name,
            message("batch_empty_list", "the list contains no jobs; expected one job per row"),
        )
    return jobs


def _csv_rows(path, text, log):
    """Return a dict for each row of a CSV list; [] after adding a problem to `log`."""
    mark = separator_of_text(text, ",")
    lines = [(row, line) for row, line in enumerate(split_lines(text), 1) if is_row(line)]
    table = []
    for row, line in lines:
        try:
            table.append((row, split_cells(line, mark)))
        except csv.Error as error:
            log.problem(
                path.name,
                message("batch_no_csv", "not valid CSV ({reason})", reason=str(error)),
                row,
            )
            return []
    if not table:
        return []
    row, headings = table[0]
    wrong = [heading for heading in headings if heading not in HEADINGS]
    if wrong or HEADINGS[0] not in headings or len(set(headings)) < len(headings):
        text = message(
            "batch_headings",
            "found the headings {found}; expected job, and optionally {others}, each once",
            found=headings[:10],
            others=[*HEADINGS[1:]],
        )
        log.problem(path.name, text, row)
        return []
    return list(_job_rows(path, headings, table[1:], log))


def _job_rows(path, headings, table, log):
    """Return {heading: cell} of each valid row."""
    for row, cells in table:
        if not any(cells):
            continue
        if len(cells) > len(headings):
            text = message("batch_long_row", "found {found} cells; expected at most {most}",
                           found=len(cells), most=len(headings))  # fmt: skip
            log.problem(path.name, text, row)
            continue
        row_cells = dict(zip(headings, cells, strict=False))
        if row_cells.get("job"):
            yield row_cells
        else:
            log.problem(
                path.name, message("batch_no_job_cell", "blank; expected a job"), row, "job"
            )


# ---- names


def _assign_names(named_jobs, options, known):
    """Return a `BatchJob` with a unique name for each job."""
    labels = {source: _label(job) for source, job in named_jobs.items()}
    taken = {name.casefold(): source for source, name in known.items() if os.path.exists(source)}
    counts = Counter(label.casefold() for label in labels.values())
    jobs = []
    for source, job in named_jobs.items():
        label = labels[source]
        owner = taken.get(label.casefold(), source)
        name = known.get(source, label)
        if source not in known and (counts[label.casefold()] > 1 or owner != source):
            name = f"{label}~{sha256(source.encode(errors='replace')).hexdigest()[:DIGITS]}"
        overrides = {key: value for key, value in job.overrides.items() if key in LIST_OPTIONS}
        jobs.append(BatchJob(name, label, source, options.override(overrides)))
    _refuse_doubles(jobs)
    return sorted(jobs, key=lambda job: job.name)


def _refuse_doubles(jobs):
    """Raise InputError if two jobs have the same name."""
    names = Counter(job.name.casefold() for job in jobs)
    double = sorted({job.name for job in jobs if names[job.name.casefold()] > 1})
    if double:
        text = message(
            "batch_double_names",
            "two jobs have the name {names}; expected different names",
            names=double[:5],
        )
        raise InputError(Problem("JOBS", text))


def _label(job):
    """Return the name of a job: from its list, or from its folder or workbook."""
    if job.overrides.get("name"):
        return file_name(job.overrides["name"], "job")
    path = Path(os.path.abspath(job.source))
    if path.name == WORKBOOK_FILE:
        path = path.parent
    if path.name not in SAVED:
        return file_name(path.stem if path.suffix.lower() == BOOK else path.name, "job")
    place = path.parent
    if place.name in ("results", "comparison", "inspection"):
        behind = "" if place.name == "results" else f"-{place.name}"
        return file_name(place.parent.name.removesuffix("-results") + behind, "job")
    return file_name(place.name.removesuffix("-results"), "job")


# ---- former tables


_names_in = lru_cache(maxsize=4)(read_known_names)  # cached: each job looks into the former batch


def find_former_or_none(job):
    """Return the former table of a job; None if there is no table, or no comparison."""
    try:
        return find_former(job)
    except InputError:
        return None


def find_former(job):
    """Return the path of the former table of a job; None if the job is not compared.

    Raises
    ------
    InputError
        A folder of former tables contains no table of this job.
    """
    options = job.options
    if "compare" not in options.steps or options.former is None:
        return None
    folder = Path(os.path.abspath(options.former))
    if not folder.is_dir():
        return folder
    if (folder / RECORD).is_file():
        return folder / RECORD
    names = (_names_in(str(folder)).get(job.source), job.name, job.label)
    for name in dict.fromkeys(label for label in names if label):
        places = [folder / name, folder / "jobs" / name / "results", folder / name / "results"]
        tables = [folder / f"{name}{ending}" for ending in ENDINGS]
        for path in (*(place / RECORD for place in places), *tables):
            if path.is_file():
                return path
    text = message(
        "batch_no_former",
        "contains no former table of {name}; expected {name} with one of the endings "
        "{endings}, or a folder {name} with record.json",
        name=job.label,
        endings=[*ENDINGS],
    )
    raise InputError(Problem(str(options.former), text))
