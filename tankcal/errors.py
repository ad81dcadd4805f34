"""The exceptions of tankcal: one small family, with numbers in the message.

`InputError` is the user's to mend (exit status 2), `SolutionError` is the survey's (exit status 3).
"""

from dataclasses import dataclass


class TankcalError(Exception):
    """Anything that tankcal raises on purpose; `exit_status` is what the command line returns."""

    exit_status = 1


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with the input, in one line.

    file      name of the file or workbook sheet, as the user knows it ("points.csv")
    expected  what was found and what was expected, in plain words
    row       line of the file or row of the sheet, counted as an editor shows it (heading = 1)
    column    heading of the column, or the key ("tank.nominal_height_m")
    cell      of a sheet ("C7"), when it is known
    """

    file: str
    expected: str
    row: int | None = None
    column: str | None = None
    cell: str | None = None

    def __str__(self):
        place = [self.file]
        if self.cell is not None:
            place.append(f"cell {self.cell}")
        elif self.row is not None:
            place.append(f"row {self.row}")
        if self.column:
            place.append(self.column)
        return ", ".join(place) + ": " + self.expected


class InputError(TankcalError):
    """The input cannot be used; `problems` holds every one that was found, not only the first."""

    exit_status = 2

    def __init__(self, problems):
        self.problems = tuple([problems] if isinstance(problems, Problem) else problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class SolutionError(TankcalError):
    """The input is readable but has no sound solution: singular, not converged, too few points."""

    exit_status = 3


class HeightError(TankcalError, ValueError):
    """A height outside the capacity table was asked for; a table is never extrapolated."""

    exit_status = 2


class ProgramError(TankcalError):
    """A result that contradicts itself, such as an interval that leaves its volume out.

    The mistake is tankcal's, not the user's: nothing is written, and the message says so.
    """

    def __init__(self, message):
        super().__init__(
            f"{message}: this contradicts itself, so nothing is stated. It is a mistake of "
            "tankcal; please report it with the job"
        )
