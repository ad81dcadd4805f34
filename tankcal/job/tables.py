"""The raw tables of a job: text and numbers as they stand, with the file and row of each.

Nothing here knows what a value means. `tankcal.job.folder` reads job.toml and CSV files,
`tankcal.job.sheets` the same from one workbook. Both give a `RawJob`, and tell everything that
is wrong to a `Log`, so that all problems of a job come in one run.
"""

import difflib
import hashlib
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from tankcal.errors import SHEET, InputError, Problem, reason_of, sheet_named
from tankcal.messages import message

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
STRAPPING_TABLES = (
    *("circumferences", "obstructions", "thickness", "tape_checks"),
    *("lines", "offsets"),
)
SPHERE_TABLES = ("great_circles",)
HITS_TABLES = ("wall_hits", "control_readings")
TANGENT_TABLES = ("tangents",)
CLOUD_TABLES = ("scan_targets",)
LIQUID_TABLES = ("liquid",)
RADII_TABLES = ("radii",)
RING_TABLES = ("rings",)
OVERRULING_TABLES = ("overrulings",)
TABLES = TANK_TABLES + STRAPPING_TABLES + HITS_TABLES + TANGENT_TABLES + CLOUD_TABLES
TABLES += LIQUID_TABLES + RADII_TABLES + RING_TABLES + SPHERE_TABLES + SURVEY_TABLES
TABLES += OVERRULING_TABLES
REGISTERS = {  # what each lists
    "cameras": "camera",
    "instruments": "instrument",
    "clouds": "cloud",
    "meters": "meter",
}
SETTINGS_FILE = "job.toml"
SETTINGS_SHEET = "job"
WORKBOOK_FILE = "job.xlsx"  # of a job folder that is filled in as a workbook
REFUSED_FILE = "image_points_refused.csv"  # written beside image_points.csv, never read
COVARIANCE_FILE = "points_cov.npz"
RADII_COVARIANCE_FILE = "radii_cov.npz"

MAX_FILE_BYTES = 200_000_000
MAX_LINES, MAX_COLUMNS = 500_000, 100  # of a text table
MAX_PROBLEMS_PER_FILE = 50
SEPARATORS = (",", ";", "\t")
NOT_KNOWN = "?"  # in place of the decimal mark of a CSV file


def shown(value):
    """The value as a message shows it: one printable line of at most 60 characters."""
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
    """The known word that is close to `word`, or None."""
    spelt = {one.lower(): one for one in known}
    close = difflib.get_close_matches(str(word)[:80].lower(), [*spelt], n=1, cutoff=0.6)
    return spelt[close[0]] if close else None


def nearest(word, known):
    """' (did you mean x?)' when one of the known words is close to `word`, else ''."""
    found = meant(word, known)
    return message("did_you_mean", " (did you mean {spelt}?)", spelt=found) if found else ""


def _printable(text):
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else "?" for char in text)


class Log:
    """Collects what is wrong (`problems`) and what only deserves a look (`warnings`).

    book  name of the workbook that the sheets stand in
    """

    def __init__(self, book=None):
        self.book = book
        self.problems = []
        self.warnings = []
        self._letters = {}
        self._cells = set()  # with a problem

    def place_columns(self, file, letters):
        """Tell in which column of a sheet each heading stands: {heading: letters}.

        None in place of a heading stands for all that is no heading, such as the keys of settings.
        """
        self._letters[file] = letters

    def problem(self, file, expected, row=None, column=None):
        """Note one thing that stops the job; each text becomes one printable line."""
        self.problems.append(self._problem(file, expected, row, column))
        self._cells.add((file, row, column))

    def warning(self, file, expected, row=None, column=None):
        """Note one thing that does not stop the job."""
        self.warnings.append(self._problem(file, expected, row, column))

    def has(self, file, row, column):
        """Is a problem of that cell noted already?"""
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
        """Raise InputError with every problem, by file and row; the longest lists are cut."""
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
    """A workbook cell without a usable value: a formula never calculated, an error such as #N/A."""

    complaint: str


class Percent(float):
    """A number that a workbook shows in percent: 0.05 for 5 %."""

    def __str__(self):
        return f"{100 * self:.12g} %"


@dataclass(frozen=True)
class Value:
    """One setting as read, and the row of its file; blank is None or an empty text."""

    raw: object
    row: int | None = None


@dataclass(frozen=True)
class Table:
    """One table as read: `rows[i]` stands in row `row_numbers[i]` of `file`.

    skipped is the number of rows that could not be read (each told as a problem).
    decimal is the mark of numbers in a CSV file as it is declared (NOT_KNOWN: it is not), or None
    in a workbook, where a number cell must hold a number.
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
    """Cameras or instruments as read.

    entries  {name: {key: Value}}        rows  {name: row, None where it is not known}
    """

    file: str
    entries: dict
    rows: dict


@dataclass(frozen=True)
class RawJob:
    """A job as read. A table or register that is there but cannot be read is None (this is told).

    settings    {section: {key: Value}}, or None: unreadable
    sections    {section: row}
    covariance  bytes of points_cov.npz, or None
    files       (name, SHA-256, bytes) of each file read
    folder      Path of the folder of job.toml or of the workbook
    registers   {"cameras", "instruments", "clouds" or "meters": Register}
    radii_covariance  bytes of radii_cov.npz, or None
    is_planned  whether it is still to be measured: its day lies ahead
    """

    source: str
    folder: Path
    settings_file: str
    settings: dict | None
    sections: dict
    tables: dict
    covariance: bytes | None = None
    files: tuple = field(default=())
    registers: dict = field(default_factory=dict)
    radii_covariance: bytes | None = None
    is_planned: bool = False

    def file_of(self, table):
        """Name of the table's file or sheet in messages, whether it is there or not."""
        if self.settings_file.startswith(SHEET):
            return sheet_named(table)
        return f"{table}.toml" if table in REGISTERS else f"{table}.csv"


def in_book(problem, book):
    """A problem of a job that stands in a workbook: its file is a sheet there."""
    if problem.file.startswith(SHEET):
        return replace(problem, book=book)
    name, _, ending = problem.file.rpartition(".")
    known = {**dict.fromkeys(TABLES, "csv"), **dict.fromkeys(("job", *REGISTERS), "toml")}
    if known.get(name) != ending:
        return problem
    return replace(problem, file=f"{SHEET}{name}", book=book)


def read_bytes(path, log, limit=MAX_FILE_BYTES):
    """The bytes of a file, or None after telling `log` why it cannot be read."""
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
    """The bytes of a file of a job, or None after telling `log`; no link leads out of its folder.

    A job may come from somebody else. The target of such a link is no part of the job, and a
    message about a table that cannot be read would print lines of it.
    """
    path = folder / name
    with suppress(OSError, ValueError, RuntimeError):  # read_bytes reports these
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
    """What is said of a file that an OSError or a ValueError keeps from being read."""
    reason = message("impossible_name", "impossible name")
    if isinstance(error, OSError):
        reason = reason_of(error)
    return message("file_cannot_be_read", "the file cannot be read ({reason})", reason=reason)


def fingerprint(name, data):
    """(name, SHA-256, bytes) of a file, as `RawJob.files` lists it."""
    return name, hashlib.sha256(data).hexdigest(), len(data)


def make_table(file, numbered_rows, decimal, log, hint=""):
    """Table of (row, cells) pairs, or None; blank rows and rows that start with # are left out.

    The first row that remains is the heading. Cells that are None stand for a row that cannot be
    read, told already. `hint` ends the message about a row of too many cells.
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
    sound = True
    for position, cell in enumerate(cells):
        if not isinstance(cell, str) or not cell:
            column = position + 1
            expected = message(
                "heading_no_text", "column {column} has a heading that is not text", column=column
            )
            if cell in (None, ""):
                expected = message("no_heading", "column {column} has no heading", column=column)
            log.problem(file, expected, number)
            sound = False
        elif cell in cells[:position]:
            log.problem(
                file,
                message("heading_twice", "this heading is given twice; expected once"),
                number,
                cell,
            )
            sound = False
    return tuple(cells) if sound else None


def too_many_columns(count):
    """Message about a row of so many cells."""
    return message(
        "too_many_columns", "{count} cells; expected at most {most}", count=count, most=MAX_COLUMNS
    )


def missing_sheet():
    """What is said of a sheet that is not there."""
    return message("missing_sheet", "missing sheet; {sheets}", sheets=expected_sheets())


def expected_sheets():
    """One phrase that names the sheets of a workbook."""
    return message(
        "sheets_of_workbook",
        "a workbook has the sheets {settings}, {tables} (the last five are optional), or "
        "those of a survey in place of the points",
        settings=SETTINGS_SHEET,
        tables=[*TANK_TABLES],
    )
