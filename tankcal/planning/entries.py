"""Sections and tables of a plan that a job does not have, with their places in the file."""

from dataclasses import dataclass

from tankcal.messages import message

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
    filled_keys : frozenset of str
        Keys that are not blank, valid or not.
    row : int or None
        First row of the section.
    rows : dict
        {key: row}.
    """

    name: str
    values: dict
    filled_keys: frozenset
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
        return key in self.filled_keys and self.values[key] is None

    def report(self, to, key, expected):
        """Report a problem of one key with log.problem or log.warning."""
        to(PLAN_FILE, expected, self.rows.get(key, self.row), f"{self.name}.{key}")


@dataclass(frozen=True)
class PlanInput:
    """The sections and tables of a plan.

    Attributes
    ----------
    sections : dict
        {section: Entry} of each [section], and {section: [Entry]} of each [[section]].
    ties : dict
        {name: ColumnValues or None} of tapes, levels and plumb lines.
    stadia : ColumnValues or None
        stadia.csv.
    control : ColumnValues or None
        control.csv.
    is_wall : bool
        Whether the bare wall is measured instead of targets.
    """

    sections: dict
    ties: dict
    stadia: object = None
    control: object = None
    is_wall: bool = False

    def entries(self, section):
        """Return the entries of a [section] or [[section]] as a list."""
        content = self.sections[section]
        return content if isinstance(content, list) else [content]

    def has(self, section):
        """Whether a section is in the plan; an empty [section] is not."""
        content = self.sections[section]
        return bool(content if isinstance(content, list) else content.filled_keys)


def no_such_name(found, file, hint=""):
    """Return the message about a name that a file does not define."""
    return message(
        "plan_no_such_name",
        "found {found!r}; expected a name of {file}{hint}",
        found=found,
        file=file,
        hint=hint,
    )


def too_many_sections(count, most):
    """Return the message about too many sections of one kind."""
    return message(
        "plan_many_sections", "{count} of them; expected at most {most}", count=count, most=most
    )


def check_form(section, log):
    """Check that the common ovality of the shell does not exceed the ovality of a course."""
    whole, common = section["form_mm"] or 0.0, section["common_form_mm"] or 0.0
    if common > whole and not section.is_refused("form_mm"):
        expected = message(
            "plan_form_part",
            "found {common:g}, which is a part of form_mm; expected at most {whole:g}",
            common=common,
            whole=whole,
        )
        section.report(log.problem, "common_form_mm", expected)


def forms_m(section):
    """Expected ovality of a course and its part common to the shell, m; None if blank."""
    sizes_mm = (section[key] for key in ("form_mm", "common_form_mm"))
    return tuple(None if size_mm is None else size_mm / 1000 for size_mm in sizes_mm)
