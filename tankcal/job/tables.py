"""Raw tables of a job: text and numbers as given, with file and row.

The meaning of values is not interpreted here. `tankcal.job.folder` reads job.toml and CSV files;
`tankcal.job.sheets` reads the same tables from one workbook. Both return a `RawJob` and report
every problem to a `Log`, so that one run lists all problems of a job.
"""

import difflib
import hashlib
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from tankcal.errors import SHEET, InputError, Problem, reason_of, sheet_named
from tankcal.messages import message
from tankcal.methods.base import methods, methods_for

TANK_TABLES = (
    *("points", "courses", "welds", "bottom", "deadwood"),
    *("uncertainty", "correlations", "stated"),
)
SURVEY_TABLES = (
    *("targets", "photos", "image_points", "fiducials", "film", "control", "check", "setups"),
    *("distances", "slope_distances", "directions", "zenith_angles", "azimuths"),
    *("horizontal_angles", "vertical_angles", "height_differences", "plumb_lines"),
    *("vectors", "stadia", "correlated_readings"),
)
OVERRULING_TABLES = ("overrulings",)
# The input files of a record are in this order: first the methods for upright tanks.
_UPRIGHT = tuple(
    table
    for method in methods_for("vertical")
    for table in method.tables
    if table not in TANK_TABLES
)
_OTHERS = tuple(
    table
    for method in methods()
    for table in method.tables
    if table not in (*TANK_TABLES, *_UPRIGHT)
)
TABLES = TANK_TABLES + _UPRIGHT
TABLES += _OTHERS + SURVEY_TABLES + OVERRULING_TABLES
REGISTERS = {  # name of an entry in each list
    "cameras": "camera",
    "instruments": "instrument",
    "clouds": "cloud",
    "meters": "meter",
    "equipment": "item",
    "seals": "seal",
}
SETTINGS_FILE = "job.toml"
SETTINGS_SHEET = "job"
WORKBOOK_FILE = "job.xlsx"  # workbook in a job folder
REFUSED_FILE = "image_points_refused.csv"  # written beside image_points.csv, never read
COVARIANCE_FILE = "points_cov.npz"
ARCHIVES = tuple(file for method in methods() for file in method.archives)

MAX_FILE_BYTES = 200_000_000  # largest file of a job
MAX_LINES, MAX_COLUMNS = 500_000, 100  # largest text table
MAX_PROBLEMS_PER_FILE = 50
SEPARATORS = (",", ";", "\t")
NOT_KNOWN = "?"  # replaces an undeclared decimal mark of a CSV file


def shown(value):
    """Value as shown in a message: one printable line of at most 60 characters."""
    if isinstance(value, dict | list | tuple):
        return (
            message("a_list", "a list")
            if isinstance(value, list | tuple)
            else message("a_section", "a section")
        )
    if isinstance(value, int) and not isinstance(value, bool) and value.bit_length() > 200:
        return message("a_long_number", "a number of very many digits")
    text = value if isinstance(value, str) else str(value)
    clipped = text if len(text) <= 60 else text[:57] + "..."
    return _printable(f"'{clipped}'" if isinstance(value, str) else clipped)


def meant(word, known):
    """Known word close to `word`, or None."""
    spellings = {name.lower(): name for name in known}
    close = difflib.get_close_matches(str(word)[:80].lower(), [*spellings], n=1, cutoff=0.6)
    return spellings[close[0]] if close else None


def nearest(word, known):
    """Hint ' (did you mean x?)' if a known word is close to `word`, else ''."""
    close = meant(word, known)
    return message("did_you_mean", " (did you mean {spelt}?)", spelt=close) if close else ""


def _printable(text):
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else "?" for char in text)


class Log:
    """Collector of problems, which prevent a calculation, and of warnings.

    Parameters
    ----------
    book : str, optional
        Name of the workbook with the sheets.

    Attributes
    ----------
    problems, warnings : list of Problem
    """

    def __init__(self, book=None):
        self.book = book
        self.problems = []
        self.warnings = []
        self._letters = {}
        self._cells = set()  # cells with a problem

    def place_columns(self, file, letters):
        """Set the column of each heading of a sheet: {heading: letters}.

        The heading None applies to names that are not headings, such as the keys of settings.
        """
        self._letters[file] = letters

    def problem(self, file, expected, row=None, column=None):
        """Add a problem; the text becomes one printable line.

        Parameters
        ----------
        file : str
            Name of file or sheet.
        expected : Message or str
            What was found and what is expected.
        row : int, optional
            Row in the file.
        column : str, optional
            Heading or key.
        """
        self.problems.append(self._problem(file, expected, row, column))
        self._cells.add((file, row, column))

    def warning(self, file, expected, row=None, column=None):
        """Add a warning, which does not prevent a calculation; parameters as for `problem`."""
        self.warnings.append(self._problem(file, expected, row, column))

    def has(self, file, row, column):
        """Return True if a problem of this cell exists."""
        return (file, row, column) in self._cells

    def _problem(self, file, expected, row, column):
        letters = self._letters.get(file)
        cell = None
        if letters is not None and row is not None and column is not None:
            letter = letters.get(column, letters.get(None))
            cell = None if letter is None else f"{letter}{row}"
        column = None if column is None else _printable(str(column)[:80])
        book = self.book if file.startswith(SHEET) else None
        return Problem(_printable(str(file)[:120]), _printable(expected), row, column, cell, book)

    def stop_if_problems(self):
        """Raise InputError with the problems, sorted by file and row; long lists are truncated."""
        if not self.problems:
            return
        by_file = {}
        for problem in self.problems:
            by_file.setdefault(problem.file, []).append(problem)
        listed = []
        for file, problems in by_file.items():
            problems.sort(key=lambda problem: problem.row or 0)
            listed += problems[:MAX_PROBLEMS_PER_FILE]
            more = len(problems) - MAX_PROBLEMS_PER_FILE
            if more > 0:
                expected = message(
                    "more_problems", "and {more} more problems; correct these first", more=more
                )
                listed.append(Problem(file, expected, book=problems[0].book))
        raise InputError(listed)


@dataclass(frozen=True)
class BadCell:
    """Workbook cell without a usable value: a formula not calculated, an error such as #N/A."""

    complaint: str


class Percent(float):
    """A number that a workbook shows in percent: 0.05 for 5 %."""

    def __str__(self):
        return f"{100 * self:.12g} %"


@dataclass(frozen=True)
class Value:
    """One setting as read, with its row in the file; None or an empty text is blank."""

    raw: object
    row: int | None = None


@dataclass(frozen=True)
class Table:
    """One table as read.

    Attributes
    ----------
    file : str
        Name of file or sheet.
    headings : tuple of str
        Headings of the columns.
    heading_row : int
        Row of the headings in the file.
    rows : tuple of tuple
        Cells of each row.
    row_numbers : tuple of int
        Row in the file of each row.
    decimal : str or None
        Declared decimal mark of a CSV file (NOT_KNOWN: not declared). None: a workbook, whose
        numbers must be in number cells.
    skipped : int
        Number of unreadable rows, each with a problem.
    """

    file: str
    headings: tuple[str, ...]
    heading_row: int
    rows: tuple[tuple, ...]
    row_numbers: tuple[int, ...]
    decimal: str | None
    skipped: int = 0


@dataclass(frozen=True)
class Register:
    """List of cameras, instruments, clouds or meters as read.

    Attributes
    ----------
    file : str
        Name of file or sheet.
    entries : dict
        {name: {key: Value}}.
    rows : dict
        {name: row in the file; None: not known}.
    """

    file: str
    entries: dict
    rows: dict


@dataclass(frozen=True)
class RawJob:
    """A job as read; an unreadable table or register is None, with a problem in the log.

    Attributes
    ----------
    source : str
        Name of the folder or workbook.
    folder : Path
        Folder of job.toml or of the workbook.
    settings_file : str
        Name of the file or sheet of settings in messages.
    settings : dict or None
        {section: {key: Value}}; None: unreadable.
    sections : dict
        {section: row}.
    tables : dict of {str: Table or None}
        Tables by name.
    archives : dict of {str: bytes}
        Content of the files in ARCHIVES that the job has, and of its mesh.
    files : tuple
        (name, SHA-256, size in bytes) of each file read.
    registers : dict
        {"cameras", "instruments", "clouds" or "meters": Register or None}.
    is_planned : bool
        True: the survey lies in the future.
    """

    source: str
    folder: Path
    settings_file: str
    settings: dict | None
    sections: dict
    tables: dict
    archives: dict = field(default_factory=dict)
    files: tuple = field(default=())
    registers: dict = field(default_factory=dict)
    is_planned: bool = False

    def file_of(self, table):
        """Name of the file or sheet of a table in messages, whether it exists or not."""
        if self.settings_file.startswith(SHEET):
            return sheet_named(table)
        return f"{table}.toml" if table in REGISTERS else f"{table}.csv"


def in_book(problem, book):
    """Change the file of a problem to the sheet of a workbook."""
    if problem.file.startswith(SHEET):
        return replace(problem, book=book)
    name, _, ending = problem.file.rpartition(".")
    known = {**dict.fromkeys(TABLES, "csv"), **dict.fromkeys(("job", *REGISTERS), "toml")}
    if known.get(name) != ending:
        return problem
    return replace(problem, file=f"{SHEET}{name}", book=book)


def read_bytes(path, log, limit=MAX_FILE_BYTES):
    """Content of a file; None, with a problem in `log`, if unreadable."""
    try:
        if not path.exists():
            return log.problem(path.name, message("file_not_found", "not found; expected a file"))
        if not path.is_file():
            log.problem(path.name, message("no_file", "not a file; expected a file"))
            return None
        size = path.stat().st_size
        if size <= limit:
            return path.read_bytes()
        expected = message(
            "file_too_large",
            "{size:.0f} MB, expected at most {limit:.0f} MB",
            size=size / 1e6,
            limit=limit / 1e6,
        )
        log.problem(path.name, expected)
    except (OSError, ValueError) as error:
        log.problem(path.name, unreadable_file(error))
    return None


def read_beside(folder, name, log, limit=MAX_FILE_BYTES):
    """Content of a file in the folder of a job; None, with a problem in `log`, if unreadable.

    Links to files outside the folder are refused. A job may come from somebody else, and messages
    about an unreadable table would show lines of the linked file.
    """
    path = folder / name
    with suppress(OSError, ValueError, RuntimeError):  # read_bytes reports these errors
        if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
            expected = message(
                "link_out_of_job",
                "a symbolic link to a place outside the folder; expected the file itself: copy it "
                "into the folder",
            )
            log.problem(name, expected)
            return None
    return read_bytes(path, log, limit)


def unreadable_file(error):
    """Message about a file that cannot be read because of an OSError or a ValueError."""
    reason = message("impossible_name", "impossible name")
    if isinstance(error, OSError):
        reason = reason_of(error)
    return message("file_cannot_be_read", "the file cannot be read ({reason})", reason=reason)


def fingerprint(name, data):
    """(name, SHA-256, size in bytes) of a file, as in `RawJob.files`."""
    return name, hashlib.sha256(data).hexdigest(), len(data)


def make_table(file, numbered_rows, decimal, log, hint=""):
    """Build a Table from rows; blank rows and rows that start with # are left out.

    Parameters
    ----------
    file : str
        Name of file or sheet.
    numbered_rows : iterable of (int, list or None)
        Row number and cells; None: unreadable, already reported. The first row that is not left out
        contains the headings.
    decimal : str or None
        As in `Table`.
    log : Log
        Receives the problems.
    hint : str, optional
        End of the message about a row with too many cells.

    Returns
    -------
    Table or None
        None without valid headings.
    """
    headings, heading_row, rows, numbers, skipped = None, 0, [], [], 0
    for number, raw_cells in numbered_rows:
        if raw_cells is None:
            skipped += 1
            continue
        cells = [cell.strip() if isinstance(cell, str) else cell for cell in raw_cells]
        width = len(cells)
        while cells and (cells[-1] is None or cells[-1] == ""):
            cells.pop()
        if not cells or (isinstance(cells[0], str) and cells[0].startswith("#")):
            continue
        if headings is None:
            headings, heading_row = _headings(file, cells, number, log), number
            if headings is None:
                return None
        elif len(cells) > len(headings):
            expected = message(
                "too_many_cells",
                "{count} cells, expected {in_heading} as in the heading{hint}",
                count=len(cells),
                in_heading=len(headings),
                hint=hint,
            )
            log.problem(file, expected, number)
            skipped += 1
        elif width < len(headings):
            log.problem(
                file,
                message(
                    "too_few_cells",
                    "{width} cells, expected {count} as in the heading",
                    width=width,
                    count=len(headings),
                ),
                number,
            )
            skipped += 1
        else:
            rows.append(tuple(cells + [None] * (len(headings) - len(cells))))
            numbers.append(number)
    if headings is None:
        log.problem(
            file, message("empty_table", "empty; expected a row of headings and the rows below it")
        )
        return None
    return Table(file, headings, heading_row, tuple(rows), tuple(numbers), decimal, skipped)


def _headings(file, cells, number, log):
    if len(cells) > MAX_COLUMNS:
        log.problem(file, too_many_columns(len(cells)), number)
        return None
    is_valid = True
    for position, cell in enumerate(cells):
        if not isinstance(cell, str) or not cell:
            column = position + 1
            expected = message(
                "heading_no_text", "column {column} has a heading that is not text", column=column
            )
            if cell in (None, ""):
                expected = message("no_heading", "column {column} has no heading", column=column)
            log.problem(file, expected, number)
            is_valid = False
        elif cell in cells[:position]:
            log.problem(
                file,
                message("heading_twice", "this heading is given twice; expected once"),
                number,
                cell,
            )
            is_valid = False
    return tuple(cells) if is_valid else None


def too_many_columns(count):
    """Message about a row with too many cells."""
    return message(
        "too_many_columns", "{count} cells; expected at most {most}", count=count, most=MAX_COLUMNS
    )


def missing_sheet():
    """Message about a missing sheet."""
    return message("missing_sheet", "missing sheet; {sheets}", sheets=expected_sheets())


def expected_sheets():
    """Phrase that lists the sheets of a workbook."""
    return message(
        "sheets_of_workbook",
        "a workbook has the sheets {settings}, {tables} (the last five are optional), or "
        "those of a survey in place of the points",
        settings=SETTINGS_SHEET,
        tables=[*TANK_TABLES],
    )
