"""The exceptions of tankcal: one small family, with numbers in the message.

`InputError` is the user's to mend (exit status 2), `SolutionError` is the survey's (exit status 3).
"""

import errno
import json
from dataclasses import dataclass
from math import isfinite

from tankcal.messages import Message, as_plain, message, printable

SHEET = "sheet "  # how the file of a problem in a workbook begins


def sheet_named(name):
    """The place of a sheet, as a text that each language says in its words."""
    return message("in_sheet", "sheet {sheet}", sheet=name)


_OF_SYSTEM = {
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
    """Why a file cannot be read or written, as a Message where the reason is a usual one.

    Parameters
    ----------
    error : Exception
        An OSError, an error of the JSON or UTF-8 reader, or any other.

    Examples
    --------
    >>> reason_of(FileNotFoundError(errno.ENOENT, "nao existe"))
    'No such file or directory'
    """
    if isinstance(error, json.JSONDecodeError):
        return message("not_json", "not JSON: row {row}, column {column}",
                       row=str(error.lineno), column=str(error.colno))  # fmt: skip
    if isinstance(error, UnicodeDecodeError):
        return message("not_utf8", "not UTF-8 text: byte {at}", at=error.start + 1)
    if isinstance(error, RecursionError):
        return message("nested_too_deeply", "nested too deeply")
    if isinstance(error, OSError):
        return _OF_SYSTEM.get(error.errno) or error.strerror or str(error) or type(error).__name__
    return str(error) or type(error).__name__


class TankcalError(Exception):
    """Anything that tankcal raises on purpose; `exit_status` is what the command line returns."""

    exit_status = 1

    @property
    def texts(self):
        """What it says, line by line; a Message among them can be said in another language."""
        return self.args

    def __str__(self):
        return "\n".join(map(str, self.args))


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with the input, in one line.

    Attributes
    ----------
    file : str
        Name of the file or workbook sheet, as the user knows it ("points.csv").
    expected : str
        What was found and what was expected, in plain words.
    row : int or None
        Line of the file or row of the sheet, counted as an editor shows it (heading = 1).
    column : str or None
        Heading of the column, or the key ("tank.nominal_height_m").
    cell : str or None
        Of a sheet ("C7"), when it is known.
    book : str or None
        File name of the workbook that the sheet stands in.

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
        """The whole line as a Message."""
        return message("problem", "{place}: {text}", place=self.place, text=self.expected)

    @property
    def place(self):
        """Where it is, from the file to the column, as texts."""
        place = [printable(self.book)] if self.book else []
        is_sheet = self.file.startswith(SHEET)
        name = self.file.removeprefix(SHEET)
        place.append(sheet_named(name) if is_sheet else printable(self.file))
        if self.cell is not None:
            place.append(message("in_cell", "cell {cell}", cell=self.cell))
        elif self.row is not None:
            place.append(message("in_row", "row {row}", row=str(self.row)))
        return [*place, self.column] if self.column else place

    def __str__(self):
        return str(self.text)


def problem_of(problem):
    """A `Problem` as plain data: place, text in English, code and values."""
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
    """Plain data with null for what is no finite number, which JSON does not hold."""
    if isinstance(plain, dict):
        return {name: _without_nan(one) for name, one in plain.items()}
    if isinstance(plain, list):
        return [_without_nan(one) for one in plain]
    return None if isinstance(plain, float) and not isfinite(plain) else plain


def problem_from(plain):
    """The `Problem` that plain data is of, to be said in any language (see `problem_of`)."""
    text = plain["text"]
    if plain.get("code"):
        text = Message(text)
        text.code, text.values = plain["code"], plain["values"]
    places = {name: plain.get(name) for name in ("row", "column", "cell", "book")}
    return Problem(plain["file"], text, **places)


class InputError(TankcalError):
    """The input cannot be used; `problems` holds every one that was found, not only the first."""

    exit_status = 2

    def __init__(self, problems):
        self.problems = tuple([problems] if isinstance(problems, Problem) else problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self):  # so that it comes from another process with its problems
        return type(self), (self.problems,)

    @property
    def texts(self):
        """The lines of its problems, as Messages."""
        return tuple(problem.text for problem in self.problems)


class SolutionError(TankcalError):
    """The input is readable but has no sound solution: singular, not converged, too few points."""

    exit_status = 3


class HeightError(TankcalError, ValueError):
    """A height outside the capacity table was asked for; a table is never extrapolated."""

    exit_status = 2


class VocabularyError(TankcalError):
    """A code or a unit that no language has words for; in a record that was read, damage."""


class CellError(TankcalError):
    """A cell of the report met what it cannot work with; in a record that was read, damage."""


class ProgramError(TankcalError):
    """A result that contradicts itself, such as an interval that leaves its volume out.

    The mistake is tankcal's, not the user's: nothing is written, and the message says so.
    """

    def __init__(self, message):
        super().__init__(
            f"{message}: this contradicts itself, so nothing is stated. It is a mistake of "
            "tankcal; please report it with the job"
        )
