"""A starter job that has something in it already: what a plan knows before the survey."""

from dataclasses import dataclass, field

from tankcal.job.starter.form import Form


@dataclass(frozen=True)
class FilledForm(Form):
    """A Form with settings, rows and entries, all as texts.

    settings  {"tank.id": text}
    given     {table: ({column: text}, ...)}
    registered  {"cameras" or "instruments": {name: {key: text}}}
    to_fill   keys such as "survey.date" that have to be filled in, beside those that always have
    more      tables beside those of the kind of survey
    """

    settings: dict = field(default_factory=dict)
    given: dict = field(default_factory=dict)
    registered: dict = field(default_factory=dict)
    to_fill: tuple = ()
    more: tuple = ()

    @property
    def tables(self):
        """Names of its tables."""
        usual = super().tables
        return (*usual, *(table for table in self.more if table not in usual))

    @property
    def registers(self):
        """Names of its lists of cameras and instruments."""
        usual = super().registers
        return (*usual, *(name for name in self.registered if name not in usual))

    def start(self, section, field):
        """What stands in the place of a key; "" for nothing."""
        return self.settings.get(f"{section}.{field.name}", super().start(section, field))

    def is_to_fill_in(self, section, field):
        """Is it a key that must be given, and has nothing yet?"""
        if self.start(section, field):
            return False
        return f"{section}.{field.name}" in self.to_fill or super().is_to_fill_in(section, field)

    def entries(self, register):
        """{name: {key: text}} of a list; an empty entry where there is none."""
        return self.registered.get(register) or super().entries(register)

    def rows(self, table):
        """The rows of a table."""
        return self.given.get(table, ())
