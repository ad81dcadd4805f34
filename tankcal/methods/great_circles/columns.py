"""Columns of great_circles.csv: equator and meridians of a sphere by tape."""

from tankcal.job.fields import NOTE, USE, Field, readings_by_tape

KINDS = ("equator", "meridian")
GREAT_CIRCLES = (
    Field(
        "circle",
        "name",
        "name of the great circle; rows with an equal name are repeated readings",
        required=True,
    ),
    Field("kind", "choice", "equator, or meridian from pole to pole", required=True, choices=KINDS),
    Field(
        "azimuth_deg",
        "number",
        "azimuth of the plane of a meridian, degrees clockwise from +y; blank for the equator",
        low=0,
        high=360,
    ),
    *readings_by_tape("reading of the tape round the outside of the sphere, metres"),
    USE,
    NOTE,
)
EXAMPLES = (
    {"circle": "equator", "kind": "equator", "reading_m": 62.8512, "s_mm": 0.5},
    {"circle": "M0", "kind": "meridian", "azimuth_deg": 0, "reading_m": 62.8431, "s_mm": 0.5},
)
