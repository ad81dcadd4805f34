"""Complete lists of the keys of job.toml and of the columns of the tables of a job.

Each table of the tank has a module with its columns and its checks. The starter job and the tables
of `docs/job-format.md` (`make job-format`) are generated from these lists.
"""

from tankcal.job.contract import (
    bottom,
    courses,
    fittings,
    overrulings,
    registers,
    ship,
    top,
    uncertainty,
)
from tankcal.job.contract.keys import COMMON_KEYS, PART_KEYS
from tankcal.job.contract.lying import KEYS as LYING_KEYS
from tankcal.job.contract.observations import COLUMNS as SURVEY_COLUMNS
from tankcal.job.contract.observations import SURVEYS as ADJUSTED_SURVEYS
from tankcal.job.contract.registers import OF_PHOTOS, REGISTER_KEYS, REGISTERS_OF_SURVEY
from tankcal.job.contract.uncertainty import INPUTS
from tankcal.job.fields import KINDS
from tankcal.methods.base import methods
from tankcal.text.words import NOTES

SECTIONS = (
    *("tank", "survey", "datum", "table", "horizontal", "sphere", "mesh", "ship"),
    *("bottom", "top", "roof", "levels"),
    *("shell", "strapping", "liquid", "radii", "change"),
    *("corrections", "material", "checks", "inspection"),
    *("adjustment", "adjustment.camera", "certificate"),
    "csv",
)
COLUMNS = {
    "courses": courses.COLUMNS,
    "welds": courses.WELD_COLUMNS,
    "bottom": bottom.COLUMNS,
    "deadwood": fittings.COLUMNS,
    "uncertainty": uncertainty.COLUMNS,
    "correlations": uncertainty.CORRELATION_COLUMNS,
    "stated": uncertainty.STATED_COLUMNS,
}
COLUMNS |= registers.COLUMNS
_KEYS = COMMON_KEYS | PART_KEYS | LYING_KEYS
_KEYS |= {"bottom": bottom.KEYS, "top": top.KEYS, "roof": fittings.KEYS, "ship": ship.KEYS}
_KEYS["levels"] = uncertainty.KEYS
_LATER = SURVEY_COLUMNS | overrulings.COLUMNS  # in the order of docs/job-format.md
for _method in methods():
    _columns = _method.columns()
    for _table, _fields in (COLUMNS | _LATER).items():
        if _columns.get(_table, _fields) != _fields:
            raise ValueError(f"method {_method.name}: the table {_table} has other columns already")
    COLUMNS |= _columns
    REGISTER_KEYS |= _method.register_fields()
    _KEYS |= _method.settings()
COLUMNS |= _LATER
KEYS = {section: _KEYS[section] for section in SECTIONS}

SURVEYS = ADJUSTED_SURVEYS | {
    "strapping": (),
    "reference-line": (),
    "wall-hits": (),  # filled in below, as for each survey of a method
    "triangulation": (*registers.COLUMNS, *registers.BESIDE),
    "tangents": (),
    "cloud": (),
    "liquid": (),
    "radii": (),
}

SURVEYS_OF_KIND = {}  # surveys whose tables for a kind of tank differ from SURVEYS
for _method in methods():
    for _kind in _method.kinds if _method.starter else ():
        _surveys = SURVEYS if _kind == "vertical" else SURVEYS_OF_KIND.setdefault(_kind, {})
        _surveys[_method.starter] = _method.starter_tables()
        REGISTERS_OF_SURVEY[_method.starter] = _method.starter_registers


def tables_of_survey(kind, survey):
    """Return the names of the tables of a survey for a kind of tank."""
    return SURVEYS_OF_KIND.get(kind, {}).get(survey, SURVEYS[survey])


REQUIRED_TABLES = {"vertical": ("points", "courses")}
_COMMON_TABLES = ("uncertainty", "correlations", "stated")
_TESTED_TABLES = (*_COMMON_TABLES, "overrulings")  # of kinds with an outlier test of the points
TABLES_OF_KIND = {
    "vertical": ("points", "courses", "welds", "bottom", "deadwood", *_TESTED_TABLES),
    "horizontal": ("points", "deadwood", *_TESTED_TABLES),
    "sphere": ("points", "deadwood", *_TESTED_TABLES),
    "mesh": ("deadwood", *_COMMON_TABLES),
}

for _group, _owners in {"keys": KEYS, "columns": COLUMNS, "entries": REGISTER_KEYS}.items():
    for _owner, _fields in _owners.items():  # translates the notes quoted in messages
        NOTES.update({field.note: (_group, f"{_owner}.{field.name}") for field in _fields})


def columns_of(table, kind="vertical"):
    """Return the `Field`s of a table for a kind of tank (None, unknown kind: vertical)."""
    return tuple(field for field in COLUMNS[table] if field.suits(kind or "vertical"))


OPEN_SECTIONS = ("certificate",)  # sections that may also contain text fields of the user

__all__ = [
    "COLUMNS",
    "INPUTS",
    "KEYS",
    "KINDS",
    "OF_PHOTOS",
    "OPEN_SECTIONS",
    "REGISTERS_OF_SURVEY",
    "REGISTER_KEYS",
    "REQUIRED_TABLES",
    "SURVEYS",
    "SURVEYS_OF_KIND",
    "TABLES_OF_KIND",
    "columns_of",
    "tables_of_survey",
]
