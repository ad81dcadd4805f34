"""Columns of the tables of a survey: photographs, angles, distances, heights, control."""

from dataclasses import dataclass

from tankcal.job.fields import FULL_CIRCLE, USE, Field, angle_fields


def _name(name, note, required=True):
    """Return a column for a name."""
    return Field(name, "name", note, required=required)


def _number(name, note, low, high, required=False, above_low=False):
    """Return a column for a number from `low` to `high`."""
    return Field(name, "number", note, required=required, low=low, high=high, above_low=above_low)


def _coordinates(required=False):
    """Return the columns of the coordinates x, y and z."""
    return tuple(
        _number(
            f"{axis}_m",
            f"coordinate {axis}, metres{'' if required else '; blank: not known'}",
            -1e8,
            1e8,
            required,
        )
        for axis in "xyz"
    )


def _sd_mm(of):
    """Return the column of a required standard deviation, millimetres."""
    note = f"standard deviation of {of}, millimetres; 0: held fixed"
    return _number("s_mm", note, 0, 1e6, required=True)


_S_ARCSEC = _number(
    "s_arcsec", "standard deviation, seconds of arc; 0: held fixed", 0, 1e6, required=True
)
_SETUP = _name("setup", "set-up of setups.csv")
_TARGET_HEIGHT = _number(
    "target_height_m", "height of the target above the mark of the point, metres; blank: 0", -50, 50
)
_INSTRUMENT = _name("instrument", "instrument of instruments.toml", required=False)


def _sd_columns():
    """Return the columns of the standard deviations of known coordinates."""
    return tuple(
        _number(
            f"s{axis}_mm",
            f"standard deviation of {axis}, millimetres; blank: approximate coordinate only; 0:"
            " held fixed",
            0,
            1e7,
        )
        for axis in "xyz"
    )


TARGETS = (
    _name("point", "name of the target, unique in the file"),
    _name("section", "name of the ring of targets", required=False),
    _name("generatrix", "name of the vertical line of targets", required=False),
    _number("z_m", "nominal height of the target in the frame of the survey, metres", -1e8, 1e8),
    _number(
        "offset_mm",
        "distance from the wall to the centre of the target, millimetres; blank: 0",
        -500,
        500,
    ),
)
PHOTOS = (
    _name("photo", "name of the photo, unique in the file"),
    _name("camera", "camera of cameras.toml"),
    *(
        _number(
            f"{axis}_m", f"{axis} of the projection centre, metres; blank: not known", -1e8, 1e8
        )
        for axis in "xyz"
    ),
    *(
        field
        for angle in ("omega", "phi", "kappa")
        for field in angle_fields(angle, f"rotation {angle}; blank: not known", (-1, 1))
    ),
    *(
        _number(
            f"s{axis}_m",
            f"standard deviation of {axis}, metres; blank: approximate coordinate only; 0: held"
            " fixed",
            0,
            1e6,
        )
        for axis in "xyz"
    ),
    *(
        _number(
            f"s_{angle}_{unit}",
            f"standard deviation of {angle}, {words}; blank: approximate angle only; 0: held fixed",
            0,
            FULL_CIRCLE[unit],
        )
        for angle in ("omega", "phi", "kappa")
        for unit, words in (("deg", "degrees"), ("gon", "gon"))
    ),
)
IMAGE_POINTS = (
    _name("photo", "photo of photos.csv"),
    _name("point", "name of the point; a repeated row is a repeated reading"),
    _number("x_mm", "image coordinate to the right of the middle, millimetres", -1e4, 1e4),
    _number("y_mm", "image coordinate above the middle, millimetres", -1e4, 1e4),
    _number(
        "column_px",
        "in place of x_mm: column, pixels; the centre of the first column is 0",
        -1e6,
        1e6,
    ),
    _number(
        "line_px",
        "in place of y_mm: line, pixels, counted downwards; the centre of the first line is 0",
        -1e6,
        1e6,
    ),
    _number("sx_um", "standard deviation of x_mm, micrometres", 0, 1e5, above_low=True),
    _number("sy_um", "standard deviation of y_mm, micrometres", 0, 1e5, above_low=True),
    _number("s_px", "standard deviation of column and line, pixels", 0, 1e4, above_low=True),
    USE,
)
FIDUCIALS = (
    _name("photo", "photo of photos.csv"),
    _name("mark", "fiducial mark of cameras.toml; a repeated row is a repeated reading"),
    _number("x_mm", "comparator reading in x, millimetres", -1e4, 1e4, True),
    _number("y_mm", "comparator reading in y, millimetres", -1e4, 1e4, True),
    _number(
        "s_um",
        "standard deviation of x_mm and y_mm, micrometres; blank: image_sd_um",
        0,
        1e5,
        above_low=True,
    ),
)
FILM = (
    _name("camera", "camera of cameras.toml, for all its photos; or state a photo", False),
    _name("photo", "single photo, in place of the camera", False),
    _number(
        "x_mm", "position on the film, to the right of the middle, millimetres", -1e3, 1e3, True
    ),
    _number("y_mm", "position on the film, above the middle, millimetres", -1e3, 1e3, True),
    _number(
        "height_um",
        "height of the film surface there, towards the lens, micrometres",
        -5e3,
        5e3,
        True,
    ),
)
CONTROL = (
    _name("point", "name of the point, unique in each system"),
    *_coordinates(),
    *_sd_columns(),
    _name("system", "name of another coordinate system; blank: system of the survey", False),
    USE,
)
CHECK = CONTROL[:-1]
SETUPS = (
    _name("setup", "name of the set-up, unique in the file"),
    _name("station", "point over which the instrument is set up"),
    _INSTRUMENT,
    _number(
        "instrument_height_m",
        "height of the instrument above the mark of the station, metres; blank: 0",
        -50,
        50,
    ),
)
DISTANCES = (
    _name("from", "first point"),
    _name("to", "second point"),
    _number("distance_m", "distance as read, metres", 0, 1e6, True, True),
    _sd_mm("the distance"),
    Field(
        "kind",
        "choice",
        "spatial (from point to point) or horizontal; blank: spatial",
        choices=("spatial", "horizontal"),
    ),
    _INSTRUMENT,
    _number(
        "temperature_c", "temperature of the tape, degrees Celsius; blank: no correction", -60, 90
    ),
    USE,
)
SLOPE_DISTANCES = (
    _SETUP,
    _name("to", "target point"),
    _number("distance_m", "distance as read, metres", 0, 1e6, True, True),
    _sd_mm("the distance"),
    _TARGET_HEIGHT,
    USE,
)
DIRECTIONS = (
    _SETUP,
    _name("set", "set of directions within the set-up, with a separate zero", False),
    _name("to", "target point"),
    *angle_fields("direction", "direction as read, clockwise", (-1, 1)),
    _S_ARCSEC,
    _TARGET_HEIGHT,
    USE,
)
ZENITH_ANGLES = (
    _SETUP,
    _name("to", "target point"),
    *angle_fields("zenith", "zenith angle, from the zenith downwards", (0, 0.5)),
    _S_ARCSEC,
    _TARGET_HEIGHT,
    USE,
)
AZIMUTHS = (
    _name("from", "point of observation"),
    _name("to", "target point"),
    *angle_fields("azimuth", "azimuth, clockwise from +y", (-1, 1)),
    _S_ARCSEC,
    USE,
)
HORIZONTAL_ANGLES = (
    _name("at", "point of observation"),
    _name("from", "point sighted first, from which the angle is measured"),
    _name("to", "point sighted second, to which the angle is measured, clockwise"),
    *angle_fields("angle", "angle from the first point to the second, clockwise", (-1, 1)),
    _S_ARCSEC,
    USE,
)
VERTICAL_ANGLES = (
    _name("from", "point of observation"),
    _name("to", "target point"),
    *angle_fields("angle", "vertical angle above the horizontal", (-0.25, 0.25)),
    _S_ARCSEC,
    USE,
)
HEIGHT_DIFFERENCES = (
    _name("from", "first point"),
    _name("to", "second point"),
    _number("dz_m", "height of the second point above the first, metres", -1e5, 1e5, True),
    _sd_mm("the difference"),
    USE,
)
PLUMB_LINES = (
    _name("from", "first point of a vertical line"),
    _name("to", "second point of the vertical line"),
    _sd_mm("the horizontal offsets in x and in y"),
    USE,
)
VECTORS = (
    _name("from", "first point"),
    _name("to", "second point"),
    *(
        _number(
            f"d{axis}_m",
            f"{axis} of the second point minus {axis} of the first, metres",
            -1e8,
            1e8,
            True,
        )
        for axis in "xyz"
    ),
    *(
        _number(f"s{axis}_mm", f"standard deviation of d{axis}, millimetres", 0, 1e7, True, True)
        for axis in "xyz"
    ),
    *(
        _number(f"r_{pair}", f"correlation of d{pair[0]} with d{pair[1]}; blank: 0", -1, 1)
        for pair in ("xy", "xz", "yz")
    ),
    USE,
)


@dataclass(frozen=True)
class SurveyTable:
    """Columns of a table of a survey, and the kind of its rows.

    Attributes
    ----------
    columns : tuple of Field
    is_reading : bool
        Whether the rows are readings between points.
    angle : str
        Name of the angle, whose columns end with a unit; "" for a table of lengths.
    may_correlate : bool
        Whether readings may be correlated with other readings (correlated_readings.csv).
    """

    columns: tuple[Field, ...]
    is_reading: bool = False
    angle: str = ""
    may_correlate: bool = False


def _define_readings(columns, angle="", may_correlate=True):
    """Return the `SurveyTable` of a table of readings."""
    return SurveyTable(columns, True, angle, may_correlate)


# A new kind of reading requires only a line here, and its columns above.
TABLES = {
    "targets": SurveyTable(TARGETS),
    "photos": SurveyTable(PHOTOS),
    "image_points": SurveyTable(IMAGE_POINTS),
    "fiducials": SurveyTable(FIDUCIALS),
    "film": SurveyTable(FILM),
    "control": SurveyTable(CONTROL, may_correlate=True),
    "check": SurveyTable(CHECK),
    "setups": SurveyTable(SETUPS),
    "distances": _define_readings(DISTANCES),
    "slope_distances": _define_readings(SLOPE_DISTANCES),
    "directions": _define_readings(DIRECTIONS, "direction"),
    "zenith_angles": _define_readings(ZENITH_ANGLES, "zenith"),
    "azimuths": _define_readings(AZIMUTHS, "azimuth"),
    "horizontal_angles": _define_readings(HORIZONTAL_ANGLES, "angle"),
    "vertical_angles": _define_readings(VERTICAL_ANGLES, "angle"),
    "height_differences": _define_readings(HEIGHT_DIFFERENCES),
    "plumb_lines": _define_readings(PLUMB_LINES, may_correlate=False),
    "vectors": _define_readings(VECTORS),
}
CORRELATED_READINGS = (
    *(
        field
        for number, which in (("1", "first value"), ("2", "second value"))
        for field in (
            Field(
                f"table_{number}",
                "choice",
                f"{which}: table that contains it",
                required=True,
                choices=tuple(name for name, table in TABLES.items() if table.may_correlate),
            ),
            Field(
                f"row_{number}",
                "number",
                f"{which}: row in that table, as numbered in the sheet; the heading of a CSV"
                " file is row 1",
                required=True,
                low=2,
                high=1e7,
            ),
            Field(
                f"value_{number}",
                "choice",
                f"{which}: x, y or z of control and of vectors; blank: the only value of the row",
                choices=("x", "y", "z"),
            ),
        )
    ),
    _number("r", "correlation of the two values", -1, 1, True),
)

COLUMNS = {name: table.columns for name, table in TABLES.items()}
COLUMNS["correlated_readings"] = CORRELATED_READINGS
READINGS = tuple(name for name, table in TABLES.items() if table.is_reading)
ANGLES = {name: table.angle for name, table in TABLES.items() if table.angle}
# Tables of each usual kind of survey; tables of the other kind may be added.
SURVEYS = {
    "photos": (
        *("photos", "image_points", "targets", "control", "check", "distances"),
        *("height_differences", "plumb_lines", "vectors", "correlated_readings"),
    ),
    "total-station": (
        *("setups", "directions", "zenith_angles", "slope_distances", "targets", "control"),
        *("check", "distances", "height_differences", "vectors", "correlated_readings"),
    ),
}
