"""Former radii of a shell (radii.csv, [radii]) and their possible change since then ([change])."""

from tankcal.job.fields import VERTICAL, Field, choice, number

SOURCES = TABLE, RECORD, DECLARED = ("table", "record", "declared")  # sources of the radii
MOST_MM = 1000  # largest uncertainty of a radius

RADII = (
    Field("course", "name", "course of courses.csv, unique in the file", required=True),
    number(
        "radius_m",
        "inside radius of the circle with the mean area of the course, shell empty, metres;"
        " blank only if the course was measured again",
        0.3,
        150,
    ),
    number(
        "u_mm",
        "standard uncertainty of this radius, independent of the other radii, millimetres;"
        " blank: 0",
        0,
        MOST_MM,
    ),
)
COLUMNS = {"radii": RADII}
EXAMPLES = (
    {"course": "1", "radius_m": 6.5012, "u_mm": 0.3},
    {"course": "2", "radius_m": 6.5004, "u_mm": 0.3},
)


def _mm(name, note):
    """Return a key for an uncertainty of a radius, millimetres."""
    return number(name, note, 0, MOST_MM, kinds=VERTICAL)


SETTINGS = (
    choice(
        "source",
        "source of the radii: table (read from a former table), record (a saved result) or"
        " declared; needed with radii.csv",
        SOURCES,
        kinds=VERTICAL,
    ),
    _mm(
        "u_common_mm",
        "standard uncertainty common to all radii, millimetres (0: none); needed with radii.csv",
    ),
    number(
        "reference_temperature_c",
        "reference temperature of the radii, degrees Celsius; blank: that of the table",
        -200,
        300,
        kinds=VERTICAL,
    ),
    Field(
        "note", "text", "document with the radii, such as the former certificate; printed",
        kinds=VERTICAL,
    ),
)  # fmt: skip
CHANGE = (
    _mm(
        "common_mm",
        "standard uncertainty of a change common to all radii since then, millimetres (0:"
        " none); needed if courses were measured again",
    ),
    _mm(
        "own_mm",
        "standard uncertainty of an independent change of each radius since then, millimetres"
        " (0: none); needed if courses were measured again",
    ),
    _mm(
        "shared_mm",
        "standard uncertainty common to the former radii and the new survey, such as of one"
        " tape, millimetres; blank: 0",
    ),
)
KEYS = {"radii": SETTINGS, "change": CHANGE}
NEEDED = ("source", "u_common_mm")  # keys of [radii] required with radii.csv
NEEDED_OF_CHANGE = ("common_mm", "own_mm")  # keys of [change] required with a survey
SETTING_EXAMPLES = {
    "radii.source": "table",
    "radii.u_common_mm": 0.7,
    "radii.reference_temperature_c": 15.0,
    "radii.note": "certificate 1234/2009",
    "change.common_mm": 0.8,
    "change.own_mm": 0.3,
}
