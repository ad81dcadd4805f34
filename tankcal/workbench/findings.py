"""What the check of a job found, placed in the cells of its tables."""

from dataclasses import dataclass, field, replace

from tankcal.errors import SHEET, Problem

BAD, DOUBTFUL = "bad", "doubtful"


@dataclass(frozen=True)
class Mark:
    """A problem (BAD) or a warning (DOUBTFUL) of a cell."""

    level: str
    problem: Problem


@dataclass(frozen=True)
class Check:
    """The outcome of a check.

    Attributes
    ----------
    problems, warnings : tuple of Problem
    job : Job or None
        Where there is no problem.
    marks : dict
        {table or keys: {(row, column): tuple of Mark}}. Of a table the row counts from 0 and the
        column is its heading, of keys they are owner and key; None: the whole row, column or table.
    """

    problems: tuple
    warnings: tuple
    job: object
    marks: dict = field(default_factory=dict)

    @property
    def is_sound(self):
        """Is there nothing that keeps the job from being computed?"""
        return not self.problems


def found_in(draft, numbers, check):
    """The check with its marks, of the numbers that the rows of each table have in their file."""
    rows = {
        name: {number: place for place, number in enumerate(known) if number is not None}
        for name, known in numbers.items()
    }
    marks = {}
    for level, problems in ((BAD, check.problems), (DOUBTFUL, check.warnings)):
        for problem in problems:
            name = _table_of(draft, problem)
            if name is None:
                continue
            place = _place(problem, rows.get(name))
            if name in draft.keys:
                place = _place_in_keys(problem, {one.owner for one in draft.keys[name].entries})
            known = marks.setdefault(name, {})
            known[place] = (*known.get(place, ()), Mark(level, problem))
    return replace(check, marks=marks)


def _table_of(draft, problem):
    """Name of the table or keys that a problem is of; None: of none."""
    name = problem.file.removeprefix(SHEET)
    if not draft.is_book:
        name, _, ending = problem.file.rpartition(".")
        if ending not in ("csv", "toml") or (ending == "toml") != (name in draft.keys):
            return None
    return name if name in draft.keys or name in draft.tables else None


def _place(problem, rows):
    return (rows or {}).get(problem.row), problem.column


def _place_in_keys(problem, owners):
    if problem.column is None:
        return None, None
    if problem.column.startswith("["):
        return problem.column.strip("[]"), None
    known = [one for one in owners if problem.column.startswith(f"{one}.")]
    if known:
        owner = max(known, key=len)
        return owner, problem.column.removeprefix(f"{owner}.")
    owner, _, key = problem.column.rpartition(".")
    return owner or key, key if owner else None
