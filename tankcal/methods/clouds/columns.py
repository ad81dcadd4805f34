"""Keys of clouds.toml, with a section for each scanner file, and the table of scan targets."""

from tankcal.job.fields import FREE, SURFACES, WITH_POINTS, Field, choice, number, positive
from tankcal.units import FOOT_M, INCH_M, US_SURVEY_FOOT_M

UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": FOOT_M, "us_ft": US_SURVEY_FOOT_M, "in": INCH_M}
OF_FILE = "file"  # in place of a pose: the pose stored in the file
DOCUMENTED = "documented"  # value of the key assume
KINDS = WITH_POINTS
ASSUMED = {  # values for undeclared keys if assume = documented (docs/clouds-job.md)
    "u_offset_mm": 2.0,
    "u_scale_ppm": 20.0,
    "s_translation_mm": 3.0,
    "s_rotation_arcsec": 20.0,
}
REGISTRATION = ("s_translation_mm", "s_rotation_arcsec")
RANGING = ("u_offset_mm", "u_scale_ppm")
OF_SCANNER = (  # keys with equal values for all files of one scanner
    *("offset_mm", "u_offset_mm", "scale_ppm", "u_scale_ppm", "u_incidence_mm", "certificate"),
)

CLOUD = (
    Field(
        "file",
        "cloud file",
        "file of the scanner, beside the job or in a folder there: scans/a.e57",
        required=True,
    ),
    choice("unit", "unit of the coordinates in the file", tuple(UNITS_M), required=True),
    Field(
        "pose",
        "rows",
        "transformation from the frame of each scan to that of the tank: four rows of four"
        " numbers for each scan, lengths in the unit of the file; file: as stored in the file;"
        " blank: the scan is in the frame of the tank",
        low=-1e9,
        high=1e9,
        width=4,
        choices=(OF_FILE,),
    ),
    Field(
        "scanner_xyz",
        "numbers",
        "position of the scanner in the scan's own frame, in the unit of the file; blank: 0; 0; 0",
        low=-1e9,
        high=1e9,
    ),
    number(
        "s_translation_mm",
        "standard deviation of the position of each scan along each axis, millimetres (0:"
        " exact); blank only with three targets in each scan, or with assume",
        0,
        1e4,
    ),
    number(
        "s_rotation_arcsec",
        "standard deviation of the rotation of each scan about each axis, levelling included,"
        " seconds of arc; blank only with three targets in each scan, or with assume",
        0,
        1e5,
    ),
    Field(
        "scanner", "name", "name of the scanner; files of one scanner have common systematic errors"
    ),
    number("offset_mm", "offset added to each distance, millimetres; blank: 0", -1e3, 1e3),
    Field(
        "u_offset_mm",
        "number",
        "standard uncertainty of the ranging offset on the wall, millimetres (0: exact); free:"
        " estimated from a circumference by tape; blank only with assume",
        low=0,
        high=1e3,
        choices=(FREE,),
    ),
    number("scale_ppm", "scale correction: true = reading (1 + scale), ppm; blank: 0", -1e5, 1e5),
    number(
        "u_scale_ppm",
        "standard uncertainty of the scale, ppm (0: exact); blank only with assume",
        0,
        1e5,
    ),
    number(
        "u_incidence_mm",
        "standard uncertainty of the ranging bias at 60 degrees of incidence, relative to"
        " perpendicular incidence, millimetres; blank: 1",
        0,
        100,
    ),
    choice(
        "side",
        "position of the scanner: inside or outside; blank: survey.side",
        ("inside", "outside"),
    ),
    choice(
        "surface",
        "surface that was scanned; each kind has a separate bias with incidence; blank: one"
        " common bias",
        SURFACES,
    ),
    Field(
        "leave_out",
        "rows",
        "boxes whose points are not part of the wall: x0 y0 z0 x1 y1 z1 in the frame of the"
        " tank, metres",
        low=-1e8,
        high=1e8,
        width=6,
    ),
    Field("time", "time", "time of the scan, such as 2026-01-05T14:30"),
    Field("certificate", "text", "number of the scanner's certificate; printed if given"),
    choice(
        "assume",
        "documented: use the documented values for what is not declared; the budget states it",
        (DOCUMENTED,),
    ),
)


def _coordinate(axis):
    """Return the column of a coordinate of a scan target."""
    note = f"coordinate {axis} of the target's centre in the scan's own frame, metres"
    return number(f"{axis}_m", note, -1e8, 1e8, required=True)


SCAN_TARGETS = (
    Field(
        "scan",
        "name",
        "name of the scan: its section in clouds.toml; if a file has several scans, the section"
        " and a number, NAME 1",
        required=True,
    ),
    Field(
        "target",
        "name",
        "name of the target, as in the survey and in the other scans",
        required=True,
    ),
    *(_coordinate(axis) for axis in "xyz"),
    positive("s_mm", "standard deviation of each coordinate, millimetres", 1000, required=True),
)
COLUMNS = {"scan_targets": SCAN_TARGETS}
BESIDE = (  # tables that connect scans or determine an offset
    *("setups", "control", "directions", "zenith_angles", "slope_distances"),
    "circumferences",
)
SETTING_EXAMPLES = {
    "clouds.file": "scans/inside.e57",
    "clouds.unit": "m",
    "clouds.pose": "file",
    "clouds.u_offset_mm": 1.0,
    "clouds.u_scale_ppm": 10.0,
    "clouds.s_translation_mm": 0.0,
    "clouds.s_rotation_arcsec": 8.0,
}
EXAMPLES = {
    "scan_targets": [
        {"scan": "A", "target": "T1", "x_m": 4.2153, "y_m": -1.0482, "z_m": 0.3127, "s_mm": 1.0},
        {"scan": "A", "target": "T2", "x_m": -3.3318, "y_m": 2.7604, "z_m": 2.1145, "s_mm": 1.0},
    ],
}
