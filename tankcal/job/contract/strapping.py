"""The tables and keys of strapping: circumferences by tape, what is in its way, gauges, tapes."""

from tankcal.job.contract.kinds import LYING, STRAPPED, VERTICAL
from tankcal.job.contract.observations import USE
from tankcal.job.fields import Field
from tankcal.survey.strapping import KINDS

NEEDED = {  # of an obstruction, by its kind
    "butt_strap": ("thickness_mm", "width_mm"),
    "weld": ("thickness_mm", "width_mm"),
    "step": ("thickness_mm",),
    "lap": ("thickness_mm",),
    "step_over": ("over_mm", "arc_mm"),
    "measured": ("excess_mm",),
    "sag": ("span_m",),
}


def _name(name, note, required=False, kinds=()):
    return Field(name, "name", note, required=required, kinds=kinds)


def _number(name, note, low, high, required=False, above_low=False, kinds=()):
    bounds = {"low": low, "high": high, "above_low": above_low}
    return Field(name, "number", note, required=required, kinds=kinds, **bounds)


def readings_by_tape(reading_note):
    """Columns of what was read on a tape, and how, of any circumference."""
    return (
        _number("reading_m", reading_note, 0.3, 1000, required=True),
        _number(
            "s_mm", "standard deviation of one reading, millimetres", 0, 100, required=True,
            above_low=True,
        ),
        _name("instrument", "tape of instruments.toml; blank: the only one there that is read"),
        _number(
            "temperature_c",
            "temperature of the tape, degrees Celsius; blank: it lies on the shell and has its"
            " temperature",
            -60,
            120,
        ),
        _number(
            "tension_n",
            "pull at the ends of the tape, newtons; of a tape without friction the mean round the"
            " tank; blank: that of the certificate",
            0,
            1000,
            above_low=True,
        ),
    )  # fmt: skip


_COURSE = _name("course", "course of courses.csv", required=True, kinds=VERTICAL)
_RING = _name("ring", "lying tank, in place of course: ring of rings.csv", True, LYING)
CIRCUMFERENCES = (
    _name("circumference", "its name; rows of the same name are repeated readings", required=True),
    _COURSE,
    _RING,
    _number(
        "level_m", "height of the tape above the table's zero, metres", -100, 100, required=True,
        kinds=VERTICAL,
    ),
    _number(
        "from_a_m", "lying tank, in place of level_m: place of the tape along the axis from the"
        " start of the cylinder at A, metres", 0, 200, required=True, kinds=LYING,
    ),
    *readings_by_tape("reading of the tape round the tank, outside, metres"),
    _number("pulls", "in how many pieces the tape was pulled round; blank: 1", 1, 50),
    USE,
    Field("note", "text", "for the reader"),
)  # fmt: skip
OBSTRUCTIONS = (
    _name(
        "circumference",
        "circumference of circumferences.csv, or circle of great_circles.csv, that it is on",
        required=True,
    ),
    Field(
        "kind",
        "choice",
        "butt_strap or weld (thickness, width); step (one edge) or lap (thickness); step_over"
        " (over, arc); measured (excess); sag (span that the tape hangs free over)",
        required=True,
        choices=KINDS,
    ),
    _number("count", "how many of them; blank: 1", 1, 1000),
    _number("thickness_mm", "how far it stands out from the plate, millimetres", 0, 200),
    _number("width_mm", "width along the tape, millimetres", 0, 5000),
    _number("over_mm", "step-over: length of the tape over it, millimetres", 0, 20000),
    _number("arc_mm", "step-over: arc of the bare shell between the legs, millimetres", 0, 20000),
    _number("excess_mm", "measured: how much longer the tape is for it, millimetres", -50, 500),
    _number(
        "span_m",
        "sag: length of the free span, its ends level, metres; the tape needs weight_n_per_m",
        0,
        100,
        above_low=True,
    ),
    _number("s_mm", "standard deviation of that, millimetres; blank: 0", 0, 100),
)
THICKNESS = (
    _COURSE,
    _RING,
    _number(
        "thickness_mm", "reading of the gauge, millimetres; their mean replaces that of"
        " courses.csv", 0, 100, required=True, above_low=True,
    ),
    _number("s_mm", "standard deviation of the reading, millimetres; blank: as they scatter",
            0, 10),
    _name("instrument", "gauge of instruments.toml"),
    Field("azimuth_deg", "number", "where it was read, degrees", low=0, high=360),
    _number("paint_mm", "paint there, millimetres; the mean replaces that of courses.csv", 0, 10),
)  # fmt: skip
TAPE_CHECKS = (
    _name("level", "where both tapes were read", required=True),
    _number("master_m", "reading of the master tape, metres", 0.3, 1000, required=True),
    _number("working_m", "reading of the working tape, metres", 0.3, 1000, required=True),
    _number("s_mm", "standard deviation of the difference, millimetres; blank: as they scatter",
            0, 100),
    Field("when", "choice", "before or after the work", choices=("before", "after")),
)  # fmt: skip
IN_PLACE = {"course": "ring", "level_m": "from_a_m"}  # columns of lying tanks
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
            "standard deviation of the radius round the wall, millimetres: how far from a circle a"
            " strapped shell is; blank: 6.1, as shells typically have (needed for a lying tank)",
            kinds=STRAPPED,
            low=0,
            high=300,
        ),
    ),
    "strapping": (
        Field(
            "wave_mm",
            "number",
            "how far the tape was at most above or below its level, millimetres; blank: not in U",
            kinds=STRAPPED,
            low=0,
            high=1000,
        ),
        Field(
            "helix_mm",
            "number",
            "how far its ends stood apart in height at most, millimetres; blank: not in U",
            kinds=STRAPPED,
            low=0,
            high=1000,
        ),
    ),
}
TAPE = (  # keys of instruments.toml
    _number("thickness_mm", "thickness of a tape that straps a tank, millimetres", 0, 5),
    _number("section_mm2", "section of a tape, mm²; with e_gpa it stretches", 0.1, 100),
    _number("e_gpa", "Young's modulus of a tape, GPa", 1, 500),
    _number(
        "friction",
        "coefficient between tape and shell; blank: a tension is the mean round the tank",
        0,
        1,
    ),
    _number("laying_mm", "standard deviation of how each pull lies, millimetres", 0, 50),
    _number(
        "weight_n_per_m",
        "weight of a metre of a tape, newtons; needed where it hangs free (sag in"
        " obstructions.csv)",
        0.01,
        5,
    ),
    _name("master", "tape that this one was compared with in tape_checks.csv"),
)
