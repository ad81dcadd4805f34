"""Manual decisions against the search for blunders, or before it."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Overruling:
    """Manual decision on a point of the wall or on a reading of the survey.

    Attributes
    ----------
    point : str or None
        Name of the point; None: a reading.
    table, reading_row : str, int or None
        Table of a reading and row in the table; None: a point.
    decision : {"keep", "leave_out"}
        "keep": not rejected by the search; "leave_out": removed before the search.
    reason : str
    by, date : str
        "": not given.
    row, file
        Row and file of the decision, for messages.
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
        """Return True if the point or reading is kept."""
        return self.decision == "keep"

    @property
    def what(self):
        """Name of the point or reading in reports."""
        return self.point if self.table is None else f"{self.table} {self.reading_row}"
