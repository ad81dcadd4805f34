"""Problems and warnings of the check of a job, assigned to the cells of its tables."""

from dataclasses import dataclass, field, replace

from tankcal.errors import SHEET, Problem

BAD, DOUBTFUL = "bad", "doubtful"  # levels of a problem and of a warning; also CSS classes


@dataclass(frozen=True)
class Mark:
    """Problem (BAD) or warning (DOUBTFUL) of a cell."""

    level: str
    problem: Problem


@dataclass(frozen=True)
class Check:
    """Result of a check.

    Attributes
    ----------
    problems, warnings : tuple of Problem
        Problems and warnings of the job.
    job : Job or None
        The job; None if it has problems.
    marks : dict
        Marks of cells, {table or keys: {(row, column): tuple of Mark}}. For a table, the row is
        counted from 0 and the column is a heading; for keys, they are owner and key. None denotes
        the whole row, column or table.
    """

    problems: tuple
    warnings: tuple
    job: object
    marks: dict = field(default_factory=dict)

    @property
    def is_valid(self):
        """Whether the job has no problem and can be computed."""
        return not self.problems


def mark_cells(draft, numbers, check):
    """Assign the problems and warnings of a check to cells.

    Parameters
    ----------
    draft : Draft
        Edited files of the job.
    numbers : dict
        Number of each row of each table in its file, {table: sequence of int or None}.
    check : Check
        Check without marks.

    Returns
    -------
    Check
        Check with marks.
    """
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
            place = rows.get(name, {}).get(problem.row), problem.column
            if name in draft.keys:
                place = _place_in_keys(problem, {entry.owner for entry in draft.keys[name].entries})
            known = marks.setdefault(name, {})
            known[place] = (*known.get(place, ()), Mark(level, problem))
    return replace(check, marks=marks)


def _table_of(draft, problem):
    """Name of the table or keys that a problem concerns, or None."""
    name = problem.file.removeprefix(SHEET)
    if not draft.is_book:
        name, _, ending = problem.file.rpartition(".")
        if ending not in ("csv", "toml") or (ending == "toml") != (name in draft.keys):
            return None
    return name if name in draft.keys or name in draft.tables else None


def _place_in_keys(problem, owners):
    """Owner and key of a problem of keys; the owner may itself contain a dot."""
    if problem.column is None:
        return None, None
    if problem.column.startswith("["):
        return problem.column.strip("[]"), None
    matches = [owner_name for owner_name in owners if problem.column.startswith(f"{owner_name}.")]
    if matches:
        owner = max(matches, key=len)
        return owner, problem.column.removeprefix(f"{owner}.")
    owner, _, key = problem.column.rpartition(".")
    return owner or key, key if owner else None
