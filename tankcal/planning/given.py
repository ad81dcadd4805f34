"""What a plan says beside what a job says, and where it says it."""

from dataclasses import dataclass

PLAN_FILE = "plan.toml"


@dataclass(frozen=True)
class Entry:
    """One [section] or [[section]] of plan.toml.

    name    as messages call it: "pattern", "tapes[2]"
    values  {key: value}, None where blank or bad
    filled  keys that say something, be it good or bad
    row     where it begins              rows  {key: row}
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
        """(file, row, name) for messages about the whole."""
        return PLAN_FILE, self.row, self.name

    def is_refused(self, key):
        """Whether something stands there that cannot be used; that has been told."""
        return key in self.filled and self.values[key] is None

    def tell(self, to, key, expected):
        """Tell log.problem or log.warning about one key."""
        to(PLAN_FILE, expected, self.rows.get(key, self.row), f"{self.name}.{key}")


@dataclass(frozen=True)
class Given:
    """The sections and tables of a plan.

    single    {section: Entry}               repeated  {section: [Entry]}
    ties      {name: ColumnValues or None} of tapes, levels and plumb lines
    stadia    ColumnValues of stadia.csv or None
    control   ColumnValues of control.csv or None
    is_wall   whether it is strapped, read from lines or hit, in place of targets
    """

    single: dict
    repeated: dict
    ties: dict
    stadia: object = None
    control: object = None
    is_wall: bool = False
