"""The radii of a shell that a former table, a record or a declaration gives: radii.csv, [radii],
and how they may have changed since, [change]."""

from tankcal.job.contract.kinds import VERTICAL
from tankcal.job.contract.shorthand import choice, number
from tankcal.job.fields import Field

SOURCES = TABLE, RECORD, DECLARED = ("table", "record", "declared")  # where radii come from
MOST_MM = 1000  # of an uncertainty of a radius

RADII = (
    Field("course", "name", "course of courses.csv, each once", required=True),
    number(
        "radius_m",
        "radius inside of the circle of the course's mean area, shell empty, metres; blank only"
        " where the course was measured again",
        0.3,
        150,
    ),
    number(
        "u_mm",
        "standard uncertainty that this radius has for itself, millimetres; blank: 0",
        0,
        MOST_MM,
    ),
)
COLUMNS = {"radii": RADII}


def _mm(name, note):
    return number(name, note, 0, MOST_MM, kinds=VERTICAL)


SETTINGS = (
    choice(
        "source",
        "where the radii come from: table (read out of a former table), record (a saved result)"
        " or declared; needed with radii.csv",
        SOURCES,
        kinds=VERTICAL,
    ),
    _mm(
        "u_common_mm",
        "standard uncertainty that all radii have in common, millimetres (0: none); needed with"
        " radii.csv",
    ),
    number(
        "reference_temperature_c",
        "shell temperature that the radii are for, degrees Celsius; blank: that of the table",
        -200,
        300,
        kinds=VERTICAL,
    ),
    Field(
        "note", "text", "where the radii were found, such as the former certificate; printed",
        kinds=VERTICAL,
    ),
)  # fmt: skip
CHANGE = (
    _mm(
        "common_mm",
        "standard uncertainty of how all radii may have changed together since then, millimetres"
        " (0: not at all); needed where courses were measured again",
    ),
    _mm(
        "own_mm",
        "standard uncertainty of how each radius may have changed for itself, millimetres (0: not"
        " at all); needed where courses were measured again",
    ),
    _mm(
        "shared_mm",
        "standard uncertainty that the former radii and the new survey have in common, of one"
        " tape, millimetres; blank: nothing",
    ),
)
KEYS = {"radii": SETTINGS, "change": CHANGE}
NEEDED = ("source", "u_common_mm")  # of [radii], with radii.csv
NEEDED_OF_CHANGE = ("common_mm", "own_mm")  # of [change], with a survey
