"""Tables of total station hits on the bare wall, and of control targets read between them."""

from tankcal.job.fields import SURFACES, USE, Field, angle_fields


def _time(required=False):
    """Return the column of the time of a reading."""
    return Field("time", "time", "time of the reading, such as 2026-01-05T14:30", required=required)


def _distance(note, required=False):
    """Return the column of a slope distance."""
    return Field("distance_m", "number", note, required=required, low=0, high=1e4, above_low=True)


_SETUP = Field("setup", "name", "set-up of setups.csv", required=True)
_DIRECTION = angle_fields("direction", "direction as read, clockwise", (-1, 1))
_ZENITH = angle_fields("zenith", "zenith angle, from the zenith downwards", (0, 0.5))
WALL_HITS = (
    _SETUP,
    Field(
        "course",
        "name",
        "course of courses.csv that was hit; blank: determined from the height",
        kinds=("vertical",),
    ),
    Field(
        "set",
        "name",
        "set of directions within the set-up, with its zero as in directions.csv",
    ),
    *_DIRECTION,
    *_ZENITH,
    _distance("slope distance to the bare wall as read, metres", required=True),
    Field(
        "s_mm",
        "number",
        "standard deviation of the distance, millimetres; blank: value of the instrument",
        low=0,
        high=1e3,
        above_low=True,
    ),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of each angle, seconds of arc; blank: value of the instrument",
        low=0,
        high=1e4,
        above_low=True,
    ),
    Field(
        "surface",
        "choice",
        "surface that was hit; each kind has a separate bias with incidence; blank: one common"
        " bias",
        choices=SURFACES,
    ),
    _time(),
    USE,
)
CONTROL_READINGS = (
    _SETUP,
    Field("target", "name", "control target; repeated readings show a drift", required=True),
    *_DIRECTION,
    *_ZENITH,
    _distance("slope distance as read, metres"),
    _time(required=True),
)
COLUMNS = {"wall_hits": WALL_HITS, "control_readings": CONTROL_READINGS}
EXAMPLES = {
    "wall_hits": [
        {
            "setup": "S1-1",
            "course": "1",
            "direction_deg": 12.3456,
            "zenith_deg": 91.2345,
            "distance_m": 6.5123,
            "surface": "paint",
        },
        {
            "setup": "S1-1",
            "course": "1",
            "direction_deg": 27.3401,
            "zenith_deg": 91.2338,
            "distance_m": 6.5098,
            "surface": "paint",
        },
    ],
    "control_readings": [
        {
            "setup": "S1-1",
            "target": "K1",
            "direction_deg": 10.0012,
            "zenith_deg": 85.4321,
            "distance_m": 6.4321,
            "time": "2026-01-05T14:30",
        }
    ],
}
