"""Content of a starter job: tables, lists and keys, by the kind of tank and of survey."""

from dataclasses import dataclass

from tankcal.job.contract import (
    INPUTS,
    KEYS,
    OF_PHOTOS,
    REGISTER_KEYS,
    REGISTERS_OF_SURVEY,
    SURVEYS,
    SURVEYS_OF_KIND,
    TABLES_OF_KIND,
    tables_of_survey,
)
from tankcal.job.contract.uncertainty import UNITS
from tankcal.job.fields import Field
from tankcal.methods.base import methods, methods_for
from tankcal.text.shipped import DEFAULT, LANGUAGES

STRAPPED = ("strapping", "reference-line")  # surveys without an adjustment of points
# Surveys for vertical tanks; for other kinds see SURVEYS_OF_KIND.
OF_SHELLS = tuple(method.starter for method in methods_for("vertical"))
OF_GREAT_CIRCLES = (("sphere", "ovality_mm"), ("sphere", "form_mm"))
# Marks of CSV files from spreadsheets in these languages.
DECIMAL_COMMAS = {"separator": ";", "decimal": ","}
PLACEHOLDER = "NAME"  # replaces the name of a camera or an instrument


@dataclass(frozen=True)
class Form:
    """Kind of tank, kind of survey and language of a starter job.

    Attributes
    ----------
    kind : str
        Kind of tank.
    survey : str or None
        Kind of survey; None: surveyed points.
    language : str
        Language of the report.

    Raises
    ------
    ValueError
        For an unknown value, or a survey that the kind of tank does not have.
    """

    kind: str
    survey: str | None = None
    language: str = DEFAULT

    def __post_init__(self):
        _refuse_others(self.kind, TABLES_OF_KIND)
        _refuse_others(self.language, LANGUAGES)
        if self.survey is not None:
            _refuse_others(self.survey, SURVEYS)
            has_points = "points" in TABLES_OF_KIND[self.kind] and self.survey not in OF_SHELLS
            is_own = self.survey in SURVEYS_OF_KIND.get(self.kind, {})
            if not (has_points or is_own or self.kind == "vertical"):
                raise ValueError(f"a tank of kind {self.kind} has no survey; expected another kind")

    @property
    def tables(self):
        """Names of its tables; the tables of a survey replace the points."""
        of_tank = TABLES_OF_KIND[self.kind]
        if self.survey is None:
            return of_tank
        return (
            *tables_of_survey(self.kind, self.survey),
            *(table for table in of_tank if table != "points"),
        )

    @property
    def registers(self):
        """Names of its lists, such as cameras and instruments."""
        return REGISTERS_OF_SURVEY.get(self.survey, ())

    @property
    def keys(self):
        """{section: its fields}, without empty sections."""
        suiting = {
            section: [field for field in fields if self._has(section, field)]
            for section, fields in KEYS.items()
        }
        return {section: fields for section, fields in suiting.items() if fields}

    @property
    def inputs(self):
        """{name: Declarable} of the inputs of uncertainty for this kind of tank."""
        return {
            name: declarable for name, declarable in INPUTS.items() if self.kind in declarable.kinds
        }

    def start(self, section, field):
        """Initial value of a key; "" if blank."""
        if (section, field.name) == ("tank", "kind"):
            return self.kind
        if (section, field.name) == ("table", "language") and self.language != DEFAULT:
            return self.language
        if section == "csv" and self.language != DEFAULT:
            return DECIMAL_COMMAS[field.name]
        for method in methods_for(self.kind):
            starts = method.starter_settings(self.kind) if method.starter == self.survey else {}
            if f"{section}.{field.name}" in starts:
                return starts[f"{section}.{field.name}"]
        return field.start

    def is_to_fill_in(self, section, field):
        """Return True if the key is required and has no initial value."""
        return field.is_required(self.kind) and not self.start(section, field)

    def entries(self, register):
        """{name: {key: text}} of the initial entries of a list."""
        return {PLACEHOLDER: {}}

    def fields(self, register, given):
        """Fields of an entry: the usual fields, and those named by the user."""
        usual = REGISTER_KEYS[register]
        others = given.keys() - {field.name for field in usual}
        return (*usual, *(Field(name, "numbers", "") for name in given if name in others))

    def rows(self, table):
        """Initial rows of a table: a {column: text} for each row."""
        return ()

    def choices(self, table, field):
        """Choices of a column; for inputs of uncertainty, the inputs of this tank."""
        suiting = self.inputs
        if table in ("uncertainty", "correlations") and set(field.choices) <= set(INPUTS):
            return tuple(name for name in field.choices if name in suiting)
        if field.choices == UNITS:
            return tuple(dict.fromkeys(declarable.unit for declarable in suiting.values()))
        return field.choices

    def _has(self, section, field):
        if field.of_survey and self.survey is None:
            return False
        if (section, field.name) in OF_GREAT_CIRCLES and self.survey not in STRAPPED:
            return False
        starting = [method for method in methods() if method.starter == self.survey]
        if section.startswith("adjustment") and not all(
            method.starter_has_network for method in starting
        ):
            return False
        owners = [method for method in methods() if section in method.settings()]
        if owners and not set(owners) & set(starting):
            return False
        of_photos = section == "adjustment.camera" or field.name in OF_PHOTOS
        return field.suits(self.kind) and (self.survey == "photos" or not of_photos)


def _refuse_others(value, known):
    if value not in known:
        raise ValueError(f"found {value!r}; expected one of {', '.join(known)}")
