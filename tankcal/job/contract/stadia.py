"""Table of stadia readings: horizontal angles between the ends of a bar of known length."""

from tankcal.job.fields import Field
from tankcal.job.shared_columns import USE, angle_fields

LEAST = 3e-4  # least angle in turns: a bar of 2 m at 1 km, beyond which no distance is determined
STADIA = (
    Field("setup", "name", "set-up of setups.csv from which the bar was read", required=True),
    Field("to", "name", "station under the middle of the bar", required=True),
    Field("bar", "name", "stadia of instruments.toml; blank: the only stadia there"),
    *angle_fields("angle", "horizontal angle between the ends of the bar", (LEAST, 0.25)),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of the angle, seconds of arc",
        required=True,
        low=0,
        high=1e4,
        above_low=True,
    ),
    USE,
)
COLUMNS = {"stadia": STADIA}
KIND = "stadia"  # kind of instrument
BAR = (  # keys of instruments.toml for stadia
    Field(
        "length_m",
        "number",
        "distance between the marks of a stadia, metres",
        low=0.1,
        high=10,
    ),
    Field(
        "u_mm",
        "number",
        "standard uncertainty of length_m, millimetres",
        low=0,
        high=100,
    ),
)
BESIDE = (  # tables of a triangulation beside stadia
    *("setups", "directions", "zenith_angles", "targets", "control", "check"),
    *("distances", "height_differences", "correlated_readings"),
)
