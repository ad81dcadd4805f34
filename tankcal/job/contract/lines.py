"""The tables of reference lines: lines of sight round a tank, and offsets of its wall from them."""

from tankcal.job.contract.observations import USE
from tankcal.job.fields import Field

LINES = (
    Field("line", "name", "its name", required=True),
    Field(
        "azimuth_deg",
        "number",
        "where it stands, degrees clockwise from +y; all blank: evenly in the order of the rows,"
        " from 0",
        low=-360,
        high=360,
    ),
    Field(
        "instrument",
        "name",
        "plummet of instruments.toml; blank: the only instrument there that is no tape",
    ),
    Field(
        "side",
        "choice",
        "on which side of the wall it stands; blank: outside",
        choices=("outside", "inside"),
    ),
)
OFFSETS = (
    Field("line", "name", "line of lines.csv", required=True),
    Field("course", "name", "course of courses.csv", required=True),
    Field(
        "level_m",
        "number",
        "height of the reading above the table's zero, metres",
        required=True,
        low=-100,
        high=100,
    ),
    Field(
        "offset_mm",
        "number",
        "horizontal distance of the wall from the line, by a scale of any zero, millimetres",
        required=True,
        low=-5000,
        high=5000,
    ),
    Field(
        "s_mm",
        "number",
        "standard deviation of one reading, millimetres",
        required=True,
        low=0,
        high=100,
        above_low=True,
    ),
    Field("face", "number", "1, or 2: the plummet turned by half a turn; blank: 1", low=1, high=2),
    Field(
        "reference",
        "flag",
        "true: read at the reference level; all blank: the lowest level that every line has",
    ),
    USE,
)
COLUMNS = {"lines": LINES, "offsets": OFFSETS}
PLUMMET = (  # keys of instruments.toml
    Field(
        "u_collimation_arcsec",
        "number",
        "standard uncertainty of how upright a plummet's line is, seconds of arc; blank: its two"
        " faces tell it",
        low=0,
        high=3600,
    ),
)
