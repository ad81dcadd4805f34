"""The columns of every table."""

from tankcal.gum.distributions import FAMILIES
from tankcal.job.contract.inputs import AS_READ, INPUTS, UNITS
from tankcal.job.fields import Field


def _sd(axis):
    return Field(
        f"s{axis}_mm",
        "number",
        f"standard deviation of {axis}, millimetres; for all points or for none",
        in_full=True,
        low=0,
        above_low=True,
        high=1000,
    )


def _coordinate(axis, limit):
    note = f"coordinate {axis}, metres"
    return Field(f"{axis}_m", "number", note, required=True, low=-limit, high=limit)


def _bottom(name, note, low, high, above_low=False):
    """An optional column of bottom.csv, filled in for every row or for none."""
    return Field(name, "number", note, in_full=True, low=low, high=high, above_low=above_low)


POINTS = (
    Field("point", "name", "name of the point, once in the file", required=True),
    _coordinate("x", 1e8),
    _coordinate("y", 1e8),
    _coordinate("z", 1e5),
    _sd("x"),
    _sd("y"),
    _sd("z"),
    Field("section", "name", "name of the ring of points; blank: assigned by height"),
    Field("generatrix", "name", "name of the vertical line of points"),
)
COURSES = (
    Field("course", "name", "name of the ring of plates, from the bottom up", required=True),
    Field(
        "height_m",
        "number",
        "height of the course, metres",
        required=True,
        low=0,
        above_low=True,
        high=50,
    ),
    Field("thickness_mm", "number", "plate thickness, millimetres", required=True, low=0, high=100),
    Field("paint_mm", "number", "paint thickness, millimetres; blank: 0", low=0, high=10),
)
BOTTOM = (
    _bottom("x_m", "surveyed bottom: coordinate x, in the frame of the points, metres", -1e8, 1e8),
    _bottom("y_m", "surveyed bottom: coordinate y, in the frame of the points, metres", -1e8, 1e8),
    _bottom("z_m", "surveyed bottom: coordinate z, in the frame of the points, metres", -1e5, 1e5),
    _bottom("s_mm", "surveyed bottom: standard deviation of z, millimetres", 0, 1000, True),
    _bottom("level_m", "or measured by liquid: dip from the table's zero, metres", -100, 100),
    _bottom("volume_m3", "measured by liquid: volume below that dip, cubic metres", 0, 1e6),
    _bottom("u_m3", "measured by liquid: its standard uncertainty, cubic metres", 0, 1e5),
)
DEADWOOD = (
    Field("name", "name", "name of the thing, once in the file", required=True),
    Field(
        "bottom_m",
        "number",
        "dip of its lowest point, from the table's zero, metres",
        required=True,
        low=-100,
        high=100,
    ),
    Field(
        "top_m",
        "number",
        "dip of its highest point, from the table's zero, metres",
        required=True,
        low=-100,
        high=100,
    ),
    Field(
        "volume_m3",
        "number",
        "its volume, cubic metres: negative takes room (a pipe), positive gives room (a manhole)",
        required=True,
        low=-1e6,
        high=1e6,
    ),
    Field(
        "u_m3",
        "number",
        "standard uncertainty of its volume, cubic metres",
        low=0,
        high=1e5,
    ),
)
UNCERTAINTY = (
    Field(
        "input",
        "choice",
        "what is uncertain: " + ", ".join(INPUTS),
        required=True,
        choices=tuple(INPUTS),
    ),
    Field(
        "u",
        "number",
        "how uncertain it is: its standard uncertainty, or what u_is says",
        required=True,
        low=0,
    ),
    Field(
        "unit",
        "choice",
        "; ".join(f"{name}: {one.unit}" for name, one in INPUTS.items()),
        required=True,
        choices=UNITS,
    ),
    Field(
        "u_is",
        "choice",
        "what u is: standard; half_width of a bounded distribution; expanded, with its k; scale or"
        " sd of a t distribution; blank: standard",
        choices=AS_READ,
    ),
    Field("k", "number", "coverage factor of an expanded uncertainty", low=1, high=20),
    Field("type", "choice", "A (statistics) or B; blank: B", choices=("A", "B")),
    Field("distribution", "choice", "blank: normal", choices=("normal", *FAMILIES, "t")),
    Field("dof", "number", "degrees of freedom, 1 or more; blank: infinite", low=1),
    Field("note", "text", "where the figure comes from"),
)
CORRELATED = tuple(name for name, one in INPUTS.items() if one.correlates)
CORRELATIONS = (
    Field("input", "choice", "an input of uncertainty.csv", required=True, choices=CORRELATED),
    Field("with", "choice", "another one, correlated with it", required=True, choices=CORRELATED),
    Field("r", "number", "their coefficient of correlation", required=True, low=-1, high=1),
)
STATED = (
    Field(
        "high_m",
        "number",
        "dip from the table's zero, metres: its volume is reported with uncertainty and budget",
        required=True,
        low=0,
        above_low=True,
        high=100,
    ),
    Field(
        "low_m",
        "number",
        "of a delivery: the dip it ends at, metres; blank: the volume below high_m",
        low=0,
        high=100,
    ),
    Field(
        "volume_m3",
        "number",
        "volume that an earlier table or a contract states there, cubic metres, for a decision"
        " rule that limits deviations",
        low=0,
        above_low=True,
        high=1e6,
    ),
    Field("note", "text", "what it is"),
)

COLUMNS = {
    "points": POINTS,
    "courses": COURSES,
    "bottom": BOTTOM,
    "deadwood": DEADWOOD,
    "uncertainty": UNCERTAINTY,
    "correlations": CORRELATIONS,
    "stated": STATED,
}
