"""Exceptions of tankcal.

An `InputError` (exit status 2) requires a correction of the input by the user. A `SolutionError`
(exit status 3) means that the survey does not determine a result.
"""

import errno
import json
from dataclasses import dataclass
from math import isfinite

from tankcal.messages import Message, as_plain, message, printable

SHEET = "sheet "  # prefix of Problem.file for a sheet of a workbook


def sheet_named(name):
    """Place of a sheet as a translatable message.

    Parameters
    ----------
    name : str
        Name of the sheet.

    Returns
    -------
    Message
    """
    return message("in_sheet", "sheet {sheet}", sheet=name)


_SYSTEM_MESSAGES = {
    errno.ENOENT: message("no_such_file", "No such file or directory"),
    errno.EACCES: message("permission_denied", "Permission denied"),
    errno.EPERM: message("not_permitted", "Operation not permitted"),
    errno.EISDIR: message("is_a_folder", "Is a directory"),
    errno.ENOTDIR: message("is_no_folder", "Not a directory"),
    errno.EEXIST: message("already_exists", "File exists"),
    errno.ENOTEMPTY: message("folder_not_empty", "Directory not empty"),
    errno.ENOSPC: message("no_space_left", "No space left on device"),
    errno.EROFS: message("read_only_disk", "Read-only file system"),
    errno.ENAMETOOLONG: message("name_too_long", "File name too long"),
    errno.ELOOP: message("links_in_a_circle", "Too many levels of symbolic links"),
    errno.EIO: message("disk_error", "Input/output error"),
    errno.EBUSY: message("resource_busy", "Device or resource busy"),
    errno.EMFILE: message("too_many_files", "Too many open files"),
    errno.EINVAL: message("invalid_argument", "Invalid argument"),
    errno.EADDRINUSE: message("address_in_use", "Address already in use"),
    errno.EADDRNOTAVAIL: message("address_unknown", "Cannot assign requested address"),
    errno.ECONNREFUSED: message("connection_refused", "Connection refused"),
}


def reason_of(error):
    """Reason why a file cannot be read or written.

    Parameters
    ----------
    error : Exception
        An OSError, an error of the JSON or UTF-8 decoder, or any other exception.

    Returns
    -------
    Message or str
        A translatable Message for common reasons, else the text of the exception.

    Examples
    --------
    >>> reason_of(FileNotFoundError(errno.ENOENT, "nao existe"))
    'No such file or directory'
    """
    # Errors of the decoders carry a position in the file, which the message states.
    if isinstance(error, json.JSONDecodeError):
        return message("not_json", "not JSON: row {row}, column {column}",
                       row=str(error.lineno), column=str(error.colno))  # fmt: skip
    if isinstance(error, UnicodeDecodeError):
        return message("not_utf8", "not UTF-8 text: byte {at}", at=error.start + 1)
    if isinstance(error, RecursionError):
        return message("nested_too_deeply", "nested too deeply")
    if isinstance(error, ValueError) and "int_max_str_digits" in str(error):
        return message("number_too_long", "a number with too many digits")
    if isinstance(error, OSError):
        return (
            _SYSTEM_MESSAGES.get(error.errno)
            or error.strerror
            or str(error)
            or type(error).__name__
        )
    return str(error) or type(error).__name__


class TankcalError(Exception):
    """Base class of the exceptions of tankcal; `exit_status` is returned by the command line."""

    exit_status = 1

    @property
    def texts(self):
        """Lines of the error, as texts; each Message among them can be translated."""
        return self.args

    def __str__(self):
        return "\n".join(map(str, self.args))


@dataclass(frozen=True)
class Problem:
    """Single defect of the input, described in one line.

    Attributes
    ----------
    file : str
        Name of the file or of the sheet of a workbook, as known to the user ("points.csv").
    expected : str
        Description of the value found and of the value expected.
    row : int or None
        Line of the file or row of the sheet, counted as in an editor (heading = 1).
    column : str or None
        Heading of the column, or key ("tank.nominal_height_m").
    cell : str or None
        Cell of a sheet ("C7"), if known.
    book : str or None
        File name of the workbook that contains the sheet.

    Examples
    --------
    >>> print(Problem("points.csv", "found 'abc'; expected a number", 5, "x_m"))
    points.csv, row 5, x_m: found 'abc'; expected a number
    """

    file: str
    expected: str
    row: int | None = None
    column: str | None = None
    cell: str | None = None
    book: str | None = None

    @property
    def text(self):
        """Complete line as a Message."""
        return message("problem", "{place}: {text}", place=self.place, text=self.expected)

    @property
    def place(self):
        """Place of the problem, from the file to the column, as a list of texts."""
        # From the outermost to the innermost place: workbook, file or sheet, cell or row, column.
        place = [printable(self.book)] if self.book else []
        is_sheet = self.file.startswith(SHEET)
        name = self.file.removeprefix(SHEET)
        place.append(sheet_named(name) if is_sheet else printable(self.file))
        # A cell contains its row, which is therefore not repeated.
        if self.cell is not None:
            place.append(message("in_cell", "cell {cell}", cell=self.cell))
        elif self.row is not None:
            place.append(message("in_row", "row {row}", row=str(self.row)))
        return [*place, self.column] if self.column else place

    def __str__(self):
        return str(self.text)


def problem_of(problem):
    """Convert a `Problem` to plain data for JSON.

    Parameters
    ----------
    problem : Problem
        The problem.

    Returns
    -------
    dict
        Place, English text, message code and values.
    """
    return {
        "book": problem.book,
        "file": problem.file,
        "row": None if problem.row is None else int(problem.row),
        "column": problem.column,
        "cell": problem.cell,
        "text": str(problem.expected),
        **_without_nan(as_plain(problem.expected)),
    }


def _without_nan(plain):
    """Replace numbers that are not finite by None, because JSON cannot represent them."""
    if isinstance(plain, dict):
        return {name: _without_nan(value) for name, value in plain.items()}
    if isinstance(plain, list):
        return [_without_nan(value) for value in plain]
    # NaN and infinity are no valid JSON.
    return None if isinstance(plain, float) and not isfinite(plain) else plain


def problem_from(plain):
    """Restore a `Problem` from plain data, with its translatable text.

    Parameters
    ----------
    plain : dict
        Result of `problem_of`.
    """
    # Records without a code contain a text that is not translated.
    text = plain["text"]
    if plain.get("code"):
        text = Message(text)
        text.code, text.values = plain["code"], plain["values"]
    places = {name: plain.get(name) for name in ("row", "column", "cell", "book")}
    return Problem(plain["file"], text, **places)


class InputError(TankcalError):
    """Input that cannot be used; `problems` contains every problem, not only the first."""

    exit_status = 2

    def __init__(self, problems):
        self.problems = tuple([problems] if isinstance(problems, Problem) else problems)
        # The text of the exception contains all problems, one in each line.
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self):  # keeps the problems when the error is pickled by another process
        return type(self), (self.problems,)

    @property
    def texts(self):
        """Lines of the problems, as Messages."""
        return tuple(problem.text for problem in self.problems)


class SolutionError(TankcalError):
    """Readable input without a valid solution: singular, not converged, or too few points."""

    exit_status = 3


class HeightError(TankcalError, ValueError):
    """Requested height outside the capacity table; a table is never extrapolated."""

    exit_status = 2


class VocabularyError(TankcalError):
    """Code or unit without a translation; in a record, a sign of damage."""


class CellError(TankcalError):
    """Value that a cell of the report cannot process; in a record, a sign of damage."""


class ProgramError(TankcalError):
    """Result that contradicts itself, such as an interval that excludes its own volume.

    The error is a defect of tankcal, not of the input. No result is written, and the message states
    the cause.
    """

    def __init__(self, message):
        # The message states that no result was written.
        super().__init__(
            f"{message}: this contradicts itself, so nothing is stated. It is a mistake of "
            "tankcal; please report it with the job"
        )
