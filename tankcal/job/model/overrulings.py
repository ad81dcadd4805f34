"""What somebody decided against the search for blunders, or before it."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Overruling:
    """A point of the wall, or a reading of the survey, that was decided by hand.

    Attributes
    ----------
    point : str or None
        Its name; None: a reading.
    table, reading_row : str, int or None
        Table of a reading and its row there; None: a point.
    decision : {"keep", "leave_out"}
        It stays whatever the search says, or is taken out before it.
    reason : str
    by, date : str
        "": not given.
    row, file
        Where it stands, for messages.
    """

    point: str | None
    table: str | None
    reading_row: int | None
    decision: str
    reason: str
    by: str = ""
    date: str = ""
    row: int | None = None
    file: str = field(default="overrulings.csv", compare=False)

    @property
    def is_kept(self):
        """Does it stay?"""
        return self.decision == "keep"

    @property
    def what(self):
        """What was decided, as it is named in papers."""
        return self.point if self.table is None else f"{self.table} {self.reading_row}"
