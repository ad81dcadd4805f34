"""The keys of plan.toml and the columns of its tables that a job does not have."""

from tankcal.job.contract import COLUMNS
from tankcal.job.fields import Field
from tankcal.messages import message


class Count(Field):
    """A whole number."""

    def _expected_number(self):
        return message("a_whole_number", "a whole number{bounds}", bounds=self._bounds())


def _number(name, note, low=-1e5, high=1e5, required=False, above_low=False, choices=()):
    return Field(
        name, "number", note, required, low=low, high=high, above_low=above_low, choices=choices
    )


def _count(name, note, required=False, high=500):
    return Count(name, "number", note, required, low=1, high=high)


def _list(name, note, low, high, required=False):
    return Field(name, "numbers", note, required, low=low, high=high)


_RING = (
    _count(
        "stations", message("plan_note_stations", "how many stations stand around the tank"), True
    ),
    _number("distance_m", "from the wall, metres; or radius_m", 0, 1000, above_low=True),
    _number("radius_m", "from the axis of the tank, metres", 0, 1000),
    _list(
        "heights_m",
        message("plan_note_ring_heights", "heights above the bottom of the shell, metres"),
        -50,
        200,
        True,
    ),
    _number("start_azimuth_deg", "of the first station from the axis; blank: 0", -360, 360),
)
PATTERN = (
    _count(
        "generatrices",
        message("plan_note_generatrices", "vertical lines of targets, evenly spread"),
        True,
        2000,
    ),
    _number("first_azimuth_deg", "of the first line from the axis; blank: 0", -360, 360),
    _count("levels", "rows of targets in each course, at its Gauss levels; blank: 2", high=5),
    _list("heights_m", "heights of the rows above the bottom, in place of levels", -100, 200),
    _number("weld_clearance_mm", "from any weld to a target; blank: 300", 0, 2000),
    _list("weld_azimuths_deg", "azimuths of vertical welds that targets keep away from", -360, 360),
    _number("reference_weld_deg", "azimuth that arc lengths count from; blank: 0", -360, 360),
    _number("offset_mm", "from the wall to the centre of a target; blank: 0", 0, 500),
    _number("axis_x_m", "x of the tank's axis; blank: 0", -1e8, 1e8),
    _number("axis_y_m", "y of the tank's axis; blank: 0", -1e8, 1e8),
    _number("form_mm", "rms ovality of a course, as expected; blank: as walls have it", 0, 500),
    _number("common_form_mm", "the part of it that runs up the whole shell; blank: 0", 0, 500),
)
PHOTO_RINGS = (
    Field(
        "camera",
        "name",
        message("plan_note_camera", "the camera, as in cameras.toml"),
        required=True,
    ),
    *_RING,
    _list("directions_deg", "turns of the camera away from the axis; blank: 0", -360, 360),
    _number("aim_height_m", "height on the wall ahead of it; blank: half the shell", -50, 200),
    _list("rolls_deg", "an exposure for each turn about its own axis; blank: 0", -360, 360),
    _count("photographs", "exposures of each of these; blank: 1", high=50),
    _count("readings", "of each image point; blank: 1", high=100),
    _number("s_um", "standard deviation of a reading; blank: image_sd_um", 0, 1e4),
)
SETUP_RINGS = (
    Field(
        "instrument",
        "name",
        message("plan_note_instrument", "the total station, as in instruments.toml"),
        required=True,
    ),
    *_RING,
    _number("s_direction_arcsec", "standard deviation of a direction; blank: none", 0, 1e5),
    _number("s_zenith_arcsec", "standard deviation of a zenith angle; blank: none", 0, 1e5),
    _number("s_mm", "standard deviation of a slope distance; blank: none", 0, 1e5),
    _count("sets", "how often everything is measured; blank: 1", high=100),
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
    _number(
        "azimuth_deg",
        message("plan_note_tape_azimuth", "of its middle from the axis"),
        -360,
        360,
        True,
    ),
    _number(
        "length_m", message("plan_note_tape_length", "of the tape, metres"), 0, 200, True, True
    ),
    _number(
        "low_m",
        message("plan_note_tape_low", "its lowest end above the bottom of the shell"),
        -50,
        200,
        True,
    ),
    _number("off_m", "from the wall; blank: 0.1", 0, 50),
    _number("s_mm", message("plan_note_tape_sd", "standard deviation of a reading"), 0, 1e5, True),
    _count("readings", "how often it is read; blank: 1", high=100),
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
    _list("from_m", "box: one corner, x, y, z", -1e8, 1e8),
    _list("to_m", "box: the opposite corner", -1e8, 1e8),
    _list("axis_m", "cylinder: x, y of its upright axis", -1e8, 1e8),
    _number("radius_m", "cylinder: radius", 0, 1e3, above_low=True),
    _number("low_m", "cylinder: z of its bottom", -1e5, 1e5),
    _number("high_m", "cylinder: z of its top", -1e5, 1e5),
)
LIMITS = (
    _number("incidence_deg", "largest angle of sight from the wall's normal; blank: 70", 0, 90),
    _number("relative_u", "largest U over volume, such as 0.002", 0, 1, above_low=True),
    Field("of", "choice", "what it is for; blank: top", choices=("top", "delivery")),
    _count("rays", "fewest rays of a point that is not weak; blank: 3", high=50),
)
COSTS = tuple(
    _number(name, f"of one {name.replace('_', ' ')}; blank: 0", 0, 1e9)
    for name in (
        "photo_station",
        "photograph",
        "setup",
        "tape",
        "control_point",
        "target",
        "reading",
    )
)
SINGLE = {"pattern": PATTERN, "limits": LIMITS, "costs": COSTS}
REPEATED = {
    "photo_rings": PHOTO_RINGS,
    "setup_rings": SETUP_RINGS,
    "tapes": TAPES,
    "obstacles": OBSTACLES,
}
_READINGS = _count("readings", "how often it is measured; blank: 1", high=100)


def _without_values(table, *values):
    kept = tuple(field for field in COLUMNS[table] if field.name not in (*values, "use"))
    return (*kept, _READINGS)


TABLES = {
    "distances": _without_values("distances", "distance_m"),
    "height_differences": _without_values("height_differences", "dz_m"),
    "plumb_lines": _without_values("plumb_lines"),
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
