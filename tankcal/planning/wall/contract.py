"""Sections of plan.toml for bare walls: strapping, reference lines, hits, tangents, liquid."""

from tankcal.job.contract.ranging import RANGING
from tankcal.job.fields import Field
from tankcal.messages import message
from tankcal.planning.fields import count, number, numbers_list

_INSTRUMENT = Field("instrument", "name", "as in instruments.toml; blank: the only one that fits")
_AT = numbers_list(
    "at_percent", "heights in each course, percent of its height; blank: 20, 80", 0, 100
)
_COURSES = Field("courses", "names", "names of courses; blank: all")
_READINGS = count("readings", "how often each is read; blank: 1", high=20)
_RADIUS = number(
    "radius_m",
    message("plan_note_hit_radius", "of the ring about the axis of the tank, metres"),
    0,
    1000,
    True,
)
_HEIGHT = number(
    "height_m", "of the instrument above the bottom of the shell; blank: 1.6", -50, 200
)
STRAPS = (
    _COURSES,
    _AT,
    _READINGS,
    number(
        "s_mm",
        message("plan_note_strap_sd", "standard deviation of one reading of the tape"),
        0,
        100,
        True,
        True,
    ),
    _INSTRUMENT,
    number("temperature_c", "of the tape; blank: that of the shell", -60, 120),
    number("tension_n", "pull of the tape; blank: that of its certificate", 0, 1000),
    count("pulls", "in how many pieces it is pulled round; blank: 1", high=50),
)
LINES = (
    count("count", message("plan_note_lines", "how many lines stand round the tank"), True, 200),
    _AT,
    _READINGS,
    number(
        "s_mm",
        message("plan_note_offset_sd", "standard deviation of one offset"),
        0,
        100,
        True,
        True,
    ),
    count("faces", "1, or 2: the plummet is turned as well; blank: 2", high=2),
    _INSTRUMENT,
    Field("side", "choice", "where they stand; blank: outside", choices=("outside", "inside")),
    number("first_azimuth_deg", "of the first line from the axis; blank: 0", -360, 360),
)
HITS = (
    count(
        "setups", message("plan_note_hit_setups", "how many set-ups stand in this ring"), True, 60
    ),
    _RADIUS,
    number("start_azimuth_deg", "of the first set-up from the axis; blank: 0", -360, 360),
    _HEIGHT,
    count("hits", message("plan_note_hits", "of each set-up at each height"), True, 500),
    number(
        "spread_deg",
        "azimuths of the wall that each sees; blank: all that it can",
        0,
        360,
        above_low=True,
    ),
    _COURSES,
    _AT,
    _INSTRUMENT,
)
TIES = (
    count("targets", message("plan_note_ties", "how many targets neighbours share"), True, 20),
    *(field for field in RANGING if field.name in ("s_mm", "s_arcsec")),
)
CONTROL_TARGETS = (
    count("targets", "of each set-up; blank: 2", high=20),
    number("every_min", "minutes between their readings at most; blank: 20", 5, 240),
    number("minutes", "that the hits of a set-up take; blank: 10 seconds each", 1, 1440),
)
TANGENTS = (
    count(
        "stations",
        message("plan_note_tangent_stations", "how many stations stand round the tank"),
        True,
        60,
    ),
    _RADIUS,
    number("start_azimuth_deg", "of the first station from the axis; blank: 0", -360, 360),
    _HEIGHT,
    _AT,
    number(
        "s_arcsec",
        message(
            "plan_note_tangent_sd",
            "standard deviation of a sight to a limb, pointing included, seconds of arc",
        ),
        0,
        1e4,
        True,
        True,
    ),
    _READINGS,
    _INSTRUMENT,
)
TRAVERSE = (
    number(
        "s_mm",
        message(
            "plan_note_traverse_mm",
            "standard deviation of a distance between stations, millimetres; blank: none",
        ),
        0,
        1e3,
        above_low=True,
    ),
    number(
        "s_arcsec",
        message(
            "plan_note_traverse_arcsec",
            "standard deviation of a direction or a zenith angle between stations, seconds of arc",
        ),
        0,
        1e4,
        True,
        True,
    ),
    number(
        "s_bar_arcsec",
        "standard deviation of an angle to the ends of a stadia over the next station, seconds of"
        " arc; blank: none",
        0,
        1e4,
        above_low=True,
    ),
    Field("bar", "name", "that stadia, as in instruments.toml; blank: the only one there"),
)
RUNS = (
    Field("meter", "name", "as in meters.toml; blank: the only one there"),
    Field("from_empty", "flag", "the run begins in the empty, dry tank; blank: false"),
    number(
        "first_dip_m",
        message("plan_note_first_dip", "first dip that is read, from the table's zero, metres"),
        -100,
        200,
        True,
    ),
    number(
        "last_dip_m",
        message("plan_note_last_dip", "last dip, metres; below the first: liquid is drawn off"),
        -100,
        200,
        True,
    ),
    number("step_m", "from dip to dip, metres; or steps", 0, 100, above_low=True),
    count("steps", "from the first dip to the last; or step_m", high=1000),
    number(
        "s_dip_mm", "standard deviation of a dip; blank: that of [liquid]", 0, 1000, False, True
    ),
    number("temperature_c", "of liquid and shell; blank: that of the table", -200, 300),
    Field("temperatures", "flag", "read at the meter, in the tank, of the shell; blank: true"),
)
FILLING = (
    numbers_list(
        "dips_m",
        "dips whose volumes and differences the prediction lists; blank: the lowest and the highest"
        " of the runs, and the full tank",
        -100,
        200,
    ),
    number(
        "expected_run_ppm",
        "run effect that is expected, standard deviation, where the runs are to show it: [liquid]"
        " has no run_ppm",
        0,
        1e5,
    ),
)
WALL = (
    number("form_mm", "rms ovality of a course, as expected; blank: as walls have it", 0, 500),
    number("common_form_mm", "the part of it that runs up the whole shell; blank: 0", 0, 500),
)
SINGLE = {
    "lines": LINES,
    "setup_ties": TIES,
    "control_targets": CONTROL_TARGETS,
    "tangents": TANGENTS,
    "traverse": TRAVERSE,
    "filling": FILLING,
    "wall": WALL,
}
REPEATED = {"straps": STRAPS, "hits": HITS, "runs": RUNS}
OF_WALL = ("straps", "lines", "hits", "tangents")  # sections that measure an upright wall
MEASURING = (*OF_WALL, "runs")
TABLES = ("obstructions", "thickness", "tape_checks")  # tables of a job that these plans may have
