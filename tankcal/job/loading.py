"""From a folder or a workbook to a checked `Job`, or to the list of all its problems."""

from os import PathLike
from pathlib import Path

from tankcal.job.building import job_of
from tankcal.job.folder import read_folder, results_given_as_job
from tankcal.job.model import Job
from tankcal.job.tables import SETTINGS_FILE, TABLES, WORKBOOK_FILE, Log
from tankcal.messages import message

OTHER_WORKBOOKS = (".xls", ".xlsm", ".xlsb", ".xltx", ".ods", ".numbers")


def load(path: str | PathLike, only: str | None = None) -> Job:
    """Read a job and check it as a whole.

    Parameters
    ----------
    path : str or PathLike
        A folder with job.toml, a job.toml, or a workbook (.xlsx).
    only : {"adjustment"}, optional
        "adjustment" reads a job whose survey alone is needed. All values are checked singly. Tank,
        survey, datum and table of the job are None if they are incomplete. The parts of the tank
        (points, bottom, deadwood, ...) are left out.

    Returns
    -------
    Job
        In SI units. Its `warnings` list findings that do not prevent a calculation.

    Raises
    ------
    InputError
        With every problem of the input, each with its file, row and column.
    ValueError
        If `only` has another value.

    Examples
    --------
    >>> import tankcal
    >>> job = tankcal.load("examples/silva-1995")
    >>> len(job.courses), len(job.points.names), job.tank.nominal_diameter_m
    (5, 119, 13.0)
    """
    if only not in (None, "adjustment"):
        raise ValueError(f"found only = {only!r}; expected 'adjustment'")
    return _load(path, None, only is None)


def load_edited(path: str | PathLike, edited: dict[str, bytes]) -> Job:
    """Read a job with edited files that are not yet saved.

    Parameters
    ----------
    path : str or PathLike
        As for `load`.
    edited : dict of {str: bytes}
        Content of the edited files by name. They replace files of the folder or are added to them.

    Returns
    -------
    Job

    Raises
    ------
    InputError
        As for `load`.

    Examples
    --------
    >>> settings = open("examples/silva-1995/job.toml", "rb").read()
    >>> edited = {"job.toml": settings.replace(b"= 13.0 ", b"= 13.5 ")}
    >>> load_edited("examples/silva-1995", edited).tank.nominal_diameter_m
    13.5
    """
    return _load(path, edited, True)


def _load(path, edited, is_whole):
    log = Log()
    raw = _read(Path(path), log, edited)
    if raw is None:
        log.stop_if_problems()
    return job_of(raw, log, is_whole)


def _form_in(folder, log, edited):
    """The folder, or its workbook if that is the form filled in; None if they contradict."""
    book = folder / WORKBOOK_FILE
    if edited is not None or not book.is_file():
        return folder
    if not (folder / SETTINGS_FILE).is_file():
        ignored = [f"{table}.csv" for table in TABLES if (folder / f"{table}.csv").is_file()]
        if ignored:
            text = message(
                "beside_workbook",
                "not read: the job of this folder is {book}",
                book=WORKBOOK_FILE,
            )
            log.warning(ignored[0], text)
        return book
    from tankcal.job.forms import filled_workbook  # folders of older versions have both

    before = len(log.problems)
    book = filled_workbook(folder, log)
    return (book or folder) if len(log.problems) == before else None


def _read(path, log, edited):
    """RawJob; None, with a problem in `log`, if the path is not a job."""
    expected = message("expected_job", "expected a job folder, its job.toml or a workbook (.xlsx)")
    try:
        results = results_given_as_job(path)
        if results is not None:
            log.problem(path.name or ".", results)
            return None
        if path.is_dir():
            path = _form_in(path, log, edited)
            if path is None:
                return None
        if path.is_dir():
            return read_folder(path, log, edited)
        if path.name == SETTINGS_FILE and path.is_file():
            return read_folder(path.parent, log, edited)
        if path.suffix.lower() == ".xlsx" and path.is_file():
            from tankcal.job.sheets import read_workbook

            return read_workbook(path, log, edited)
        found = message("not_found", "not found")
        if path.exists():
            suffix = path.suffix
            found = message("found_file_ending", "found a {suffix} file", suffix=suffix)
            if not suffix:
                found = message("found_nameless_file", "found a nameless file")
        if path.suffix.lower() in OTHER_WORKBOOKS and path.is_file():
            expected = message(
                "save_as_xlsx", "open it in Excel or LibreOffice and save it as .xlsx"
            )
    except (OSError, ValueError):
        found = message("an_impossible_name", "an impossible name")
    log.problem(
        path.name or ".", message("no_job", "{found}; {expected}", found=found, expected=expected)
    )
    return None
