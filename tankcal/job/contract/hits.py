"""The tables of bare wall hits by a total station, and of the control targets read between them."""

from tankcal.job.contract.observations import USE, angle_fields
from tankcal.job.fields import Field


def _time(required=False):
    return Field("time", "time", "when, such as 2026-01-05T14:30", required=required)


def _distance(note, required=False):
    return Field("distance_m", "number", note, required=required, low=0, high=1e4, above_low=True)


SURFACES = ("paint", "rust", "tape")
_SETUP = Field("setup", "name", "the set-up, as in setups.csv", required=True)
_DIRECTION = angle_fields("direction", "as read, clockwise", (-1, 1))
_ZENITH = angle_fields("zenith", "from the zenith down", (0, 0.5))
WALL_HITS = (
    _SETUP,
    Field("course", "name", "course of courses.csv that was hit; blank: the one at its height"),
    Field(
        "set",
        "name",
        "set of directions within the set-up, with the zero that it has in directions.csv",
    ),
    *_DIRECTION,
    *_ZENITH,
    _distance("slope distance to the bare wall as read, metres", required=True),
    Field(
        "s_mm",
        "number",
        "standard deviation of the distance, millimetres; blank: that of the instrument",
        low=0,
        high=1e3,
        above_low=True,
    ),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of either angle, seconds of arc; blank: that of the instrument",
        low=0,
        high=1e4,
        above_low=True,
    ),
    Field(
        "surface",
        "choice",
        "what was hit: each has a bias by incidence of its own; blank: all the same",
        choices=SURFACES,
    ),
    _time(),
    USE,
)
CONTROL_READINGS = (
    _SETUP,
    Field("target", "name", "the control target; read again to see a drift", required=True),
    *_DIRECTION,
    *_ZENITH,
    _distance("slope distance as read, metres"),
    _time(required=True),
)
BESIDE = (  # what ties set-ups, and what tells an offset
    *("setups", "control", "directions", "zenith_angles", "slope_distances"),
    *("circumferences", "obstructions"),
)
COLUMNS = {"wall_hits": WALL_HITS, "control_readings": CONTROL_READINGS}
RANGING = (  # keys of instruments.toml
    Field(
        "s_mm",
        "number",
        "standard deviation of a distance to the bare wall, millimetres",
        low=0,
        high=1e3,
        above_low=True,
    ),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of a direction or a zenith angle to the bare wall, seconds of arc",
        low=0,
        high=1e4,
        above_low=True,
    ),
    Field(
        "u_incidence_mm",
        "number",
        "standard uncertainty of how much more or less is ranged at 60 degrees of incidence than"
        " square to the wall, millimetres; blank: 1",
        low=0,
        high=100,
    ),
)
