"""Columns of great_circles.csv: equator and meridians of a sphere by tape."""

from tankcal.job.contract.observations import USE
from tankcal.job.contract.strapping import readings_by_tape
from tankcal.job.fields import Field
from tankcal.survey.great_circles import KINDS

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
    Field("note", "text", "remark for the reader"),
)
COLUMNS = {"great_circles": GREAT_CIRCLES}
BESIDE = ("obstructions", "tape_checks")  # tables of strapping that a sphere also uses
