"""Keys of plan.toml, and columns of its tables that a job does not have."""

from tankcal.job.contract import columns_of
from tankcal.job.fields import Field
from tankcal.job.shared_columns import ANGLE_UNITS
from tankcal.messages import message
from tankcal.planning.fields import count, number, numbers_list
from tankcal.planning.wall import contract as wall

_RING = (
    count(
        "stations", message("plan_note_stations", "how many stations stand around the tank"), True
    ),
    number("distance_m", "from the wall, metres; or radius_m", 0, 1000, above_low=True),
    number("radius_m", "from the axis of the tank, metres", 0, 1000),
    numbers_list(
        "heights_m",
        message("plan_note_ring_heights", "heights above the bottom of the shell, metres"),
        -50,
        200,
        True,
    ),
    number("start_azimuth_deg", "of the first station from the axis; blank: 0", -360, 360),
)
PATTERN = (
    count(
        "generatrices",
        message("plan_note_generatrices", "vertical lines of targets, evenly spread"),
        True,
        2000,
    ),
    number("first_azimuth_deg", "of the first line from the axis; blank: 0", -360, 360),
    count("levels", "rows of targets in each course, at its Gauss levels; blank: 2", high=5),
    numbers_list(
        "heights_m", "heights of the rows above the bottom, in place of levels", -100, 200
    ),
    number("weld_clearance_mm", "from any weld to a target; blank: 300", 0, 2000),
    numbers_list(
        "weld_azimuths_deg", "azimuths of vertical welds that targets keep away from", -360, 360
    ),
    number("reference_weld_deg", "azimuth that arc lengths count from; blank: 0", -360, 360),
    number("offset_mm", "from the wall to the centre of a target; blank: 0", 0, 500),
    number("axis_x_m", "x of the tank's axis; blank: 0", -1e8, 1e8),
    number("axis_y_m", "y of the tank's axis; blank: 0", -1e8, 1e8),
    number("form_mm", "rms ovality of a course, as expected; blank: as walls have it", 0, 500),
    number("common_form_mm", "the part of it that runs up the whole shell; blank: 0", 0, 500),
)
PHOTO_RINGS = (
    Field(
        "camera",
        "name",
        message("plan_note_camera", "the camera, as in cameras.toml"),
        required=True,
    ),
    *_RING,
    numbers_list("directions_deg", "turns of the camera away from the axis; blank: 0", -360, 360),
    number("aim_height_m", "height on the wall ahead of it; blank: half the shell", -50, 200),
    numbers_list("rolls_deg", "an exposure for each turn about its own axis; blank: 0", -360, 360),
    count("photographs", "exposures of each of these; blank: 1", high=50),
    count("readings", "of each image point; blank: 1", high=100),
    number("s_um", "standard deviation of a reading; blank: image_sd_um", 0, 1e4),
)
SETUP_RINGS = (
    Field(
        "instrument",
        "name",
        message("plan_note_instrument", "the total station, as in instruments.toml"),
        required=True,
    ),
    *_RING,
    number("s_direction_arcsec", "standard deviation of a direction; blank: none", 0, 1e5),
    number("s_zenith_arcsec", "standard deviation of a zenith angle; blank: none", 0, 1e5),
    number("s_mm", "standard deviation of a slope distance; blank: none", 0, 1e5),
    count("sets", "how often everything is measured; blank: 1", high=100),
    Field("sights", "flag", "sight the set-ups on either side; blank: true"),
)
TAPES = (
    Field(
        "name",
        "name",
        message("plan_note_tape_name", "of the tape, once in the plan"),
        required=True,
    ),
    Field(
        "kind",
        "choice",
        message("plan_note_tape_kind", "how it hangs"),
        required=True,
        choices=("vertical", "horizontal"),
    ),
    number(
        "azimuth_deg",
        message("plan_note_tape_azimuth", "of its middle from the axis"),
        -360,
        360,
        True,
    ),
    number("length_m", message("plan_note_tape_length", "of the tape, metres"), 0, 200, True, True),
    number(
        "low_m",
        message("plan_note_tape_low", "its lowest end above the bottom of the shell"),
        -50,
        200,
        True,
    ),
    number("off_m", "from the wall; blank: 0.1", 0, 50),
    number("s_mm", message("plan_note_tape_sd", "standard deviation of a reading"), 0, 1e5, True),
    count("readings", "how often it is read; blank: 1", high=100),
    Field("instrument", "name", "the tape, as in instruments.toml"),
)
OBSTACLES = (
    Field("name", "name", message("plan_note_obstacle_name", "what it is"), required=True),
    Field(
        "kind",
        "choice",
        message("plan_note_obstacle_kind", "box or cylinder"),
        required=True,
        choices=("box", "cylinder"),
    ),
    numbers_list("from_m", "box: one corner, x, y, z", -1e8, 1e8),
    numbers_list("to_m", "box: the opposite corner", -1e8, 1e8),
    numbers_list("axis_m", "cylinder: x, y of its upright axis", -1e8, 1e8),
    number("radius_m", "cylinder: radius", 0, 1e3, above_low=True),
    number("low_m", "cylinder: z of its bottom", -1e5, 1e5),
    number("high_m", "cylinder: z of its top", -1e5, 1e5),
)
LIMITS = (
    number("incidence_deg", "largest angle of sight from the wall's normal; blank: 70", 0, 90),
    number("relative_u", "largest U over volume, such as 0.002", 0, 1, above_low=True),
    Field("of", "choice", "what it is for; blank: top", choices=("top", "delivery")),
    count("rays", "fewest rays of a point that is not weak; blank: 3", high=50),
)
COSTS = tuple(
    number(name, f"of one {name.replace('_', ' ')}; blank: 0", 0, 1e9)
    for name in (
        "photo_station",
        "photograph",
        "setup",
        "tape",
        "base",
        "control_point",
        "target",
        "reading",
        "strap",
        "line",
        "run",
        "batch",
    )
)
SINGLE = {"pattern": PATTERN, "limits": LIMITS, "costs": COSTS} | wall.SINGLE
REPEATED = {
    "photo_rings": PHOTO_RINGS,
    "setup_rings": SETUP_RINGS,
    "tapes": TAPES,
    "obstacles": OBSTACLES,
} | wall.REPEATED
_READINGS = count("readings", "how often it is measured; blank: 1", high=100)


def _without_values(table, *values):
    kept = tuple(field for field in columns_of(table) if field.name not in (*values, "use"))
    return (*kept, _READINGS)


TABLES = {
    "distances": _without_values("distances", "distance_m"),
    "height_differences": _without_values("height_differences", "dz_m"),
    "plumb_lines": _without_values("plumb_lines"),
    "stadia": _without_values("stadia", *(f"angle_{unit}" for unit in ANGLE_UNITS)),
}
JOB_TABLES = (
    "courses",
    "welds",
    "bottom",
    "deadwood",
    "uncertainty",
    "correlations",
    "stated",
    "control",
)
