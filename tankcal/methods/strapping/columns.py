"""Tables and keys of strapping: circumferences, obstructions, plate thicknesses."""

from tankcal.job.fields import LYING, NOTE, STRAPPED, USE, VERTICAL, Field, readings_by_tape
from tankcal.survey.strapping import KINDS


def _name(name, note, required=False, kinds=()):
    """Return a column for a name."""
    return Field(name, "name", note, required=required, kinds=kinds)


def _number(name, note, low, high, required=False, above_low=False, kinds=()):
    """Return a column for a number from `low` to `high`."""
    bounds = {"low": low, "high": high, "above_low": above_low}
    return Field(name, "number", note, required=required, kinds=kinds, **bounds)


_COURSE = _name("course", "course of courses.csv", required=True, kinds=VERTICAL)
_RING = _name("ring", "horizontal tank, in place of course: ring of rings.csv", True, LYING)
CIRCUMFERENCES = (
    _name(
        "circumference", "name of the circumference; rows with an equal name are repeated readings",
        required=True,
    ),
    _COURSE,
    _RING,
    _number(
        "level_m", "height of the tape above the table's zero, metres", -100, 100, required=True,
        kinds=VERTICAL,
    ),
    _number(
        "from_a_m", "horizontal tank, in place of level_m: position of the tape along the axis"
        " from the start of the cylinder at A, metres", 0, 200, required=True, kinds=LYING,
    ),
    *readings_by_tape("reading of the tape round the outside of the tank, metres"),
    _number("pulls", "number of pieces in which the tape was pulled round; blank: 1", 1, 50),
    USE,
    NOTE,
)  # fmt: skip
OBSTRUCTIONS = (
    _name(
        "circumference",
        "circumference of circumferences.csv, or circle of great_circles.csv, with the obstruction",
        required=True,
    ),
    Field(
        "kind",
        "choice",
        "butt_strap or weld (thickness, width); step (one edge) or lap (thickness); step_over"
        " (over, arc); measured (excess); sag (span of the free tape)",
        required=True,
        choices=KINDS,
    ),
    _number("count", "number of such obstructions; blank: 1", 1, 1000),
    _number("thickness_mm", "height of the obstruction above the plate, millimetres", 0, 200),
    _number("width_mm", "width of the obstruction along the tape, millimetres", 0, 5000),
    _number("over_mm", "step-over: length of the tape over the obstruction, millimetres", 0, 20000),
    _number("arc_mm", "step-over: arc of the bare shell between the legs, millimetres", 0, 20000),
    _number(
        "excess_mm",
        "measured: excess of the tape reading due to the obstruction, millimetres",
        -50,
        500,
    ),
    _number(
        "span_m",
        "sag: length of the free span, with level ends, metres; the tape needs weight_n_per_m",
        0,
        100,
        above_low=True,
    ),
    _number("s_mm", "standard deviation of the correction, millimetres; blank: 0", 0, 100),
)
THICKNESS = (
    _COURSE,
    _RING,
    _number(
        "thickness_mm", "reading of the thickness gauge, millimetres; the mean replaces the"
        " thickness in courses.csv", 0, 100, required=True, above_low=True,
    ),
    _number("s_mm", "standard deviation of the reading, millimetres; blank: from the scatter",
            0, 10),
    _name("instrument", "gauge of instruments.toml"),
    Field("azimuth_deg", "number", "azimuth of the reading, degrees", low=0, high=360),
    _number(
        "paint_mm", "thickness of the paint there, millimetres; the mean replaces that in"
        " courses.csv", 0, 10,
    ),
)  # fmt: skip
TAPE_CHECKS = (
    _name("level", "place where both tapes were read", required=True),
    _number("master_m", "reading of the master tape, metres", 0.3, 1000, required=True),
    _number("working_m", "reading of the working tape, metres", 0.3, 1000, required=True),
    _number("s_mm", "standard deviation of the difference, millimetres; blank: from the scatter",
            0, 100),
    Field("when", "choice", "comparison before or after the work", choices=("before", "after")),
)  # fmt: skip
COLUMNS = {
    "circumferences": CIRCUMFERENCES,
    "obstructions": OBSTRUCTIONS,
    "thickness": THICKNESS,
    "tape_checks": TAPE_CHECKS,
}
KEYS = {
    "shell": (
        Field(
            "shape_sd_mm",
            "number",
            "standard deviation of the radius along the circumference (out-of-roundness of a"
            " strapped shell), millimetres; blank: 6.1, typical of shells (needed for a"
            " horizontal tank)",
            kinds=STRAPPED,
            low=0,
            high=300,
        ),
    ),
    "strapping": (
        Field(
            "wave_mm",
            "number",
            "largest height of the tape above or below its level, millimetres; blank: not in U",
            kinds=STRAPPED,
            low=0,
            high=1000,
        ),
        Field(
            "helix_mm",
            "number",
            "largest difference in height of the tape's ends, millimetres; blank: not in U",
            kinds=STRAPPED,
            low=0,
            high=1000,
        ),
    ),
}
EXAMPLES = {
    "circumferences": [
        {
            "circumference": "1-20",
            "course": "1",
            "ring": "1",
            "level_m": 0.38,
            "from_a_m": 0.38,
            "reading_m": 40.8925,
            "s_mm": 0.5,
        },
        {
            "circumference": "1-80",
            "course": "1",
            "ring": "1",
            "level_m": 1.52,
            "from_a_m": 1.52,
            "reading_m": 40.8931,
            "s_mm": 0.5,
        },
    ],
    "obstructions": [
        {
            "circumference": "1-20",
            "kind": "butt_strap",
            "count": 6,
            "thickness_mm": 8,
            "width_mm": 100,
        },
        {
            "circumference": "1-80",
            "kind": "step_over",
            "over_mm": 1022.0,
            "arc_mm": 1000.0,
            "s_mm": 0.5,
        },
    ],
    "thickness": [
        {"course": "1", "ring": "1", "thickness_mm": 7.92, "azimuth_deg": 90, "paint_mm": 0.3}
    ],
    "tape_checks": [
        {"level": "1", "master_m": 40.8930, "working_m": 40.8921, "s_mm": 0.3, "when": "before"}
    ],
}
SETTING_EXAMPLES = {
    "shell.shape_sd_mm": 5.0,
    "strapping.wave_mm": 20.0,
}
