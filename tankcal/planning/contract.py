"""Keys of plan.toml, and sections and tables of a plan that a job does not have."""

from dataclasses import dataclass

from tankcal.job.contract import columns_of
from tankcal.job.contract.registers import RANGING
from tankcal.job.fields import ANGLE_UNITS, Field
from tankcal.messages import message

PLAN_FILE = "plan.toml"


class Count(Field):
    """Field of a whole number."""

    def _expected_number(self):
        return message("a_whole_number", "a whole number{bounds}", bounds=self._bounds())


def number(name, note, low=-1e5, high=1e5, required=False, above_low=False, choices=()):
    """Return a Field of a number between `low` and `high`."""
    return Field(
        name, "number", note, required, low=low, high=high, above_low=above_low, choices=choices
    )


def count(name, note, required=False, high=500):
    """Return a Field of a whole number from 1 to `high`."""
    return Count(name, "number", note, required, low=1, high=high)


def numbers_list(name, note, low, high, required=False):
    """Return a Field of a list of numbers between `low` and `high`."""
    return Field(name, "numbers", note, required, low=low, high=high)


# ---- plans of targets

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

# ---- plans of the bare wall: strapping, reference lines, hits, tangents, metered liquid

_INSTRUMENT = Field("instrument", "name", "as in instruments.toml; blank: the only one that fits")
_AT = numbers_list(
    "at_percent", "heights in each course, percent of its height; blank: 20, 80", 0, 100
)
_COURSES = Field("courses", "names", "names of courses; blank: all")
_WALL_READINGS = count("readings", "how often each is read; blank: 1", high=20)
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
    _WALL_READINGS,
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
    _WALL_READINGS,
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
    _WALL_READINGS,
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
EXPECTED_WALL = (
    number("form_mm", "rms ovality of a course, as expected; blank: as walls have it", 0, 500),
    number("common_form_mm", "the part of it that runs up the whole shell; blank: 0", 0, 500),
)

# ---- sections and tables of all plans

SINGLE = {
    "pattern": PATTERN,
    "limits": LIMITS,
    "costs": COSTS,
    "lines": LINES,
    "setup_ties": TIES,
    "control_targets": CONTROL_TARGETS,
    "tangents": TANGENTS,
    "traverse": TRAVERSE,
    "filling": FILLING,
    "wall": EXPECTED_WALL,
}
REPEATED = {
    "photo_rings": PHOTO_RINGS,
    "setup_rings": SETUP_RINGS,
    "tapes": TAPES,
    "obstacles": OBSTACLES,
    "straps": STRAPS,
    "hits": HITS,
    "runs": RUNS,
}
WALL_SECTIONS = ("straps", "lines", "hits", "tangents")  # sections that measure an upright wall
MEASURING = (*WALL_SECTIONS, "runs")
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
WALL_TABLES = ("obstructions", "thickness", "tape_checks")  # more tables of plans of a bare wall


@dataclass(frozen=True)
class Entry:
    """One [section] or [[section]] of plan.toml.

    Attributes
    ----------
    name : str
        Name used in messages: "pattern", "tapes[2]".
    values : dict
        {key: value}; None if blank or invalid.
    filled_keys : frozenset of str
        Keys that are not blank, valid or not.
    row : int or None
        First row of the section.
    rows : dict
        {key: row}.
    """

    name: str
    values: dict
    filled_keys: frozenset
    row: int | None
    rows: dict

    def __getitem__(self, key):
        return self.values[key]

    @property
    def place(self):
        """(file, row, name) for messages about the section."""
        return PLAN_FILE, self.row, self.name

    def is_refused(self, key):
        """Whether the value of a key is invalid; that problem has already been reported."""
        return key in self.filled_keys and self.values[key] is None

    def report(self, to, key, expected):
        """Report a problem of one key with log.problem or log.warning."""
        to(PLAN_FILE, expected, self.rows.get(key, self.row), f"{self.name}.{key}")


@dataclass(frozen=True)
class PlanInput:
    """The sections and tables of a plan.

    Attributes
    ----------
    sections : dict
        {section: Entry} of each [section], and {section: [Entry]} of each [[section]].
    ties : dict
        {name: ColumnValues or None} of tapes, levels and plumb lines.
    stadia : ColumnValues or None
        stadia.csv.
    control : ColumnValues or None
        control.csv.
    is_wall : bool
        Whether the bare wall is measured instead of targets.
    """

    sections: dict
    ties: dict
    stadia: object = None
    control: object = None
    is_wall: bool = False

    def entries(self, section):
        """Return the entries of a [section] or [[section]] as a list."""
        content = self.sections[section]
        return content if isinstance(content, list) else [content]

    def has(self, section):
        """Whether a section is in the plan; an empty [section] is not."""
        content = self.sections[section]
        return bool(content if isinstance(content, list) else content.filled_keys)


def no_such_name(found, file, hint=""):
    """Return the message about a name that a file does not define."""
    return message(
        "plan_no_such_name",
        "found {found!r}; expected a name of {file}{hint}",
        found=found,
        file=file,
        hint=hint,
    )


def too_many_sections(count, most):
    """Return the message about too many sections of one kind."""
    return message(
        "plan_many_sections", "{count} of them; expected at most {most}", count=count, most=most
    )


def check_form(section, log):
    """Check that the common ovality of the shell does not exceed the ovality of a course."""
    whole, common = section["form_mm"] or 0.0, section["common_form_mm"] or 0.0
    if common > whole and not section.is_refused("form_mm"):
        expected = message(
            "plan_form_part",
            "found {common:g}, which is a part of form_mm; expected at most {whole:g}",
            common=common,
            whole=whole,
        )
        section.report(log.problem, "common_form_mm", expected)


def forms_m(section):
    """Expected ovality of a course and its part common to the shell, m; None if blank."""
    sizes_mm = (section[key] for key in ("form_mm", "common_form_mm"))
    return tuple(None if size_mm is None else size_mm / 1000 for size_mm in sizes_mm)
