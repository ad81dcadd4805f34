"""Table of tangents: sights to the limbs of a tank from set-ups of a traverse round it."""

from tankcal.job.fields import USE, Field, angle_fields

TANGENTS = (
    Field("setup", "name", "set-up of setups.csv", required=True),
    Field(
        "set",
        "name",
        "set of directions within the set-up, with its zero as in directions.csv",
    ),
    Field("course", "name", "course of courses.csv", required=True),
    Field(
        "level_m",
        "number",
        "height above the table's zero of the point of tangency, metres",
        required=True,
        low=-100,
        high=100,
    ),
    Field(
        "side",
        "choice",
        "limb of the tank, as seen from the set-up",
        required=True,
        choices=("left", "right"),
    ),
    *angle_fields("direction", "direction as read, clockwise", (-1, 1)),
    *angle_fields(
        "zenith",
        "zenith angle, from the zenith downwards; blank: the sight is at its level",
        (0, 0.5),
    ),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of each angle, pointing at the limb included, seconds of arc",
        required=True,
        low=0,
        high=1e4,
        above_low=True,
    ),
    USE,
)
EXAMPLES = (
    {
        "setup": "S1-1",
        "course": "1",
        "level_m": 0.45,
        "side": "left",
        "direction_deg": 73.2157,
        "zenith_deg": 94.0216,
        "s_arcsec": 5,
    },
)
