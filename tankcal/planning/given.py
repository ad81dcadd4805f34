"""Sections and tables of a plan that a job does not have, with their places in the file."""

from dataclasses import dataclass

PLAN_FILE = "plan.toml"


@dataclass(frozen=True)
class Entry:
    """One [section] or [[section]] of plan.toml.

    Attributes
    ----------
    name : str
        Name used in messages: "pattern", "tapes[2]".
    values : dict
        {key: value}; None if blank or invalid.
    filled : frozenset of str
        Keys that are not blank, valid or not.
    row : int or None
        First row of the section.
    rows : dict
        {key: row}.
    """

    name: str
    values: dict
    filled: frozenset
    row: int | None
    rows: dict

    def __getitem__(self, key):
        return self.values[key]

    @property
    def place(self):
        """(file, row, name) for messages about the section."""
        return PLAN_FILE, self.row, self.name

    def is_refused(self, key):
        """Whether the value of a key is invalid; that problem has already been reported."""
        return key in self.filled and self.values[key] is None

    def tell(self, to, key, expected):
        """Report a problem of one key with log.problem or log.warning."""
        to(PLAN_FILE, expected, self.rows.get(key, self.row), f"{self.name}.{key}")


@dataclass(frozen=True)
class Given:
    """The sections and tables of a plan.

    Attributes
    ----------
    single : dict
        {section: Entry} of each [section].
    repeated : dict
        {section: [Entry]} of each [[section]].
    ties : dict
        {name: ColumnValues or None} of tapes, levels and plumb lines.
    stadia : ColumnValues or None
        stadia.csv.
    control : ColumnValues or None
        control.csv.
    is_wall : bool
        Whether the bare wall is measured instead of targets.
    """

    single: dict
    repeated: dict
    ties: dict
    stadia: object = None
    control: object = None
    is_wall: bool = False
