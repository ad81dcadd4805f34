"""Tables of reference lines: lines of sight round a tank and offsets of the wall from them."""

from tankcal.job.fields import USE, Field

LINES = (
    Field("line", "name", "name of the reference line", required=True),
    Field(
        "azimuth_deg",
        "number",
        "azimuth of the line, degrees clockwise from +y; all blank: evenly spaced in the order"
        " of the rows, from 0",
        low=-360,
        high=360,
    ),
    Field(
        "instrument",
        "name",
        "plummet of instruments.toml; blank: the only instrument there other than a tape",
    ),
    Field(
        "side",
        "choice",
        "side of the wall on which the line was set up; blank: outside",
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
        "horizontal distance of the wall from the line, read on a scale with any zero, millimetres",
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
    Field(
        "face",
        "number",
        "face of the plummet: 1, or 2 (rotated by half a turn); blank: 1",
        low=1,
        high=2,
    ),
    Field(
        "reference",
        "flag",
        "true: reading at the reference level; all blank: the lowest level read on every line",
    ),
    USE,
)
COLUMNS = {"lines": LINES, "offsets": OFFSETS}
EXAMPLES = {
    "lines": [{"line": "A", "azimuth_deg": 0}, {"line": "B", "azimuth_deg": 30}],
    "offsets": [
        {
            "line": "A",
            "course": "1",
            "level_m": 0.45,
            "offset_mm": 201.0,
            "s_mm": 0.5,
            "face": 1,
            "reference": True,
        },
        {
            "line": "A",
            "course": "1",
            "level_m": 1.35,
            "offset_mm": 198.5,
            "s_mm": 0.5,
            "face": 1,
        },
    ],
}
