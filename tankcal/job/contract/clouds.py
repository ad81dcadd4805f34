"""The keys of clouds.toml, a section for each file of a scanner, and the table of scan targets."""

from tankcal.job.contract.hits import SURFACES
from tankcal.job.contract.kinds import WITH_POINTS
from tankcal.job.contract.shorthand import FREE, choice, number, positive
from tankcal.job.fields import Field

UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us_ft": 1200 / 3937, "in": 0.0254}
OF_FILE = "file"  # in place of a pose: that of the file itself
DOCUMENTED = "documented"  # of assume
KINDS = WITH_POINTS
ASSUMED = {  # what is taken where nothing is declared, and assume says so (docs/clouds-job.md)
    "u_offset_mm": 2.0,
    "u_scale_ppm": 20.0,
    "s_translation_mm": 3.0,
    "s_rotation_arcsec": 20.0,
}
REGISTRATION = ("s_translation_mm", "s_rotation_arcsec")
RANGING = ("u_offset_mm", "u_scale_ppm")
OF_SCANNER = (  # what all files of one scanner have alike
    *("offset_mm", "u_offset_mm", "scale_ppm", "u_scale_ppm", "u_incidence_mm", "certificate"),
)

CLOUD = (
    Field(
        "file",
        "cloud file",
        "the file of the scanner beside the job, or in a folder there: scans/a.e57",
        required=True,
    ),
    choice("unit", "unit of its coordinates", tuple(UNITS_M), required=True),
    Field(
        "pose",
        "rows",
        "from each scan's frame to that of the tank: four rows of four numbers a scan, lengths in"
        " the unit of the file; file: as the file has it; blank: its own frame is the tank's",
        low=-1e9,
        high=1e9,
        width=4,
        choices=(OF_FILE,),
    ),
    Field(
        "scanner_xyz",
        "numbers",
        "where the scanner stood in the scan's own frame, in the unit of the file; blank: 0; 0; 0",
        low=-1e9,
        high=1e9,
    ),
    number(
        "s_translation_mm",
        "standard deviation of the pose of each scan along each axis, millimetres (0: exact);"
        " blank only with three targets of each scan, or with assume",
        0,
        1e4,
    ),
    number(
        "s_rotation_arcsec",
        "standard deviation of the turn of each scan about each axis, its levelling among them,"
        " seconds of arc; blank as before",
        0,
        1e5,
    ),
    Field("scanner", "name", "name of the scanner; files of one scanner share its errors"),
    number("offset_mm", "added to each distance, millimetres; blank: 0", -1e3, 1e3),
    Field(
        "u_offset_mm",
        "number",
        "standard uncertainty of the offset of ranging on the wall, millimetres (0: exact); free: a"
        " tape tells it; blank only with assume",
        low=0,
        high=1e3,
        choices=(FREE,),
    ),
    number("scale_ppm", "true = reading (1 + scale), ppm; blank: 0", -1e5, 1e5),
    number(
        "u_scale_ppm",
        "standard uncertainty of the scale, ppm (0: exact); blank only with assume",
        0,
        1e5,
    ),
    number(
        "u_incidence_mm",
        "standard uncertainty of how much more or less is ranged at 60 degrees of incidence than"
        " square to the wall, millimetres; blank: 1",
        0,
        100,
    ),
    choice(
        "side",
        "where the scanner stood: inside or outside; blank: survey.side",
        ("inside", "outside"),
    ),
    choice(
        "surface",
        "what was scanned: each has a bias by incidence of its own; blank: all the same",
        SURFACES,
    ),
    Field(
        "leave_out",
        "rows",
        "boxes that nothing of the wall is in: x0 y0 z0 x1 y1 z1 in the frame of the tank, metres",
        low=-1e8,
        high=1e8,
        width=6,
    ),
    Field("time", "time", "when, such as 2026-01-05T14:30"),
    Field("certificate", "text", "number of the scanner's certificate; printed when given"),
    choice(
        "assume",
        "documented: take the documented values for what is not declared; the budget says so",
        (DOCUMENTED,),
    ),
)


def _coordinate(axis):
    note = f"coordinate {axis} of its centre in the scan's own frame, metres"
    return number(f"{axis}_m", note, -1e8, 1e8, required=True)


SCAN_TARGETS = (
    Field(
        "scan",
        "name",
        "the scan: the name of its section in clouds.toml; of several in a file that and a number,"
        " NAME 1",
        required=True,
    ),
    Field(
        "target", "name", "name of the target, as the survey and other scans have it", required=True
    ),
    *(_coordinate(axis) for axis in "xyz"),
    positive("s_mm", "standard deviation of each coordinate, millimetres", 1000, required=True),
)
COLUMNS = {"scan_targets": SCAN_TARGETS}
BESIDE = (  # what ties scans, and what tells an offset
    *("setups", "control", "directions", "zenith_angles", "slope_distances"),
    "circumferences",
)
