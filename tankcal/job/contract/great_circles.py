"""great_circles.csv: equator and meridians of a sphere by tape."""

from tankcal.job.contract.observations import USE
from tankcal.job.contract.strapping import readings_by_tape
from tankcal.job.fields import Field
from tankcal.survey.great_circles import KINDS

GREAT_CIRCLES = (
    Field("circle", "name", "its name; rows of the same name are repeated readings", required=True),
    Field("kind", "choice", "equator, or meridian from pole to pole", required=True, choices=KINDS),
    Field(
        "azimuth_deg",
        "number",
        "of the plane of a meridian, degrees clockwise from +y; blank for the equator",
        low=0,
        high=360,
    ),
    *readings_by_tape("reading of the tape round the sphere, outside, metres"),
    USE,
    Field("note", "text", "for the reader"),
)
COLUMNS = {"great_circles": GREAT_CIRCLES}
BESIDE = ("obstructions", "tape_checks")  # of a strapping that a sphere has, too
