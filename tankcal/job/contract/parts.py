"""Keys of [mesh], [corrections], [checks] and [inspection], most of them for some kinds only."""

from tankcal.job.contract.shorthand import LOADED, VERTICAL, WITH_POINTS, choice, number, positive
from tankcal.job.fields import Field
from tankcal.job.plausibility import DIAMETERS, MOST_YIELD_MPA, SERVICES, SHELLS, TARGETS
from tankcal.units import FOOT_M, INCH_M

MESH_UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": FOOT_M, "in": INCH_M}


MESH = (
    Field(
        "file",
        "mesh file",
        "file of the mesh, beside job.toml or the workbook: .stl, .obj, .ply or .off",
        required=True,
        kinds=("mesh",),
    ),
    choice(
        "unit",
        "unit of the coordinates in the mesh file",
        tuple(MESH_UNITS_M),
        required=True,
        kinds=("mesh",),
    ),
)


def _switch(name, note, kinds=()):
    """Return the key of a correction that can be switched off."""
    return Field(name, "flag", f"{note}; blank: true", kinds=kinds)


CORRECTIONS = (
    _switch("plate", "subtract the plates from an outside survey", WITH_POINTS),
    _switch("paint", "subtract the paint from an outside survey", VERTICAL),
    _switch("temperature", "bring the shell to the reference temperature"),
    _switch("head", "load the shell with the liquid head, and a sphere with its pressure", LOADED),
    _switch("tilt", "take the tilt into account", ("vertical", "horizontal")),
    _switch("bottom", "take the form of the bottom into account", VERTICAL),
    _switch("top", "take the head on top into account", VERTICAL),
    _switch("deadwood", "take the deadwood into account"),
    _switch("roof", "take the floating roof into account", VERTICAL),
)

CHECKS = (
    choice(
        "shell",
        "metal of the shell: carbon_steel, stainless_steel, aluminium, or other; blank:"
        " carbon_steel",
        SHELLS,
    ),
    choice(
        "service",
        "service of the tank, which sets the plausible temperatures: ambient, heated or"
        " refrigerated; blank: ambient",
        SERVICES,
    ),
    number(
        "air_temperature_c",
        "air temperature during the survey, degrees Celsius; compared with the shell temperature",
        -80,
        150,
    ),
    number(
        "top_z_m",
        "z of the top of the shell as surveyed, in the frame of the points, metres; compared"
        " with bottom_z_m and the courses",
        -1e5,
        1e5,
        kinds=VERTICAL,
    ),
    choice(
        "bottom_slopes",
        "cone and dish: slope of the bottom from its edge to its centre, up or down",
        ("up", "down"),
        kinds=VERTICAL,
    ),
    number(
        "circumference_m",
        "circumference of the first course by tape, outside, perpendicular to the axis, metres",
        0.3,
        1000,
        kinds=VERTICAL,
    ),
    choice(
        "diameter_is",
        "diameter that tank.nominal_diameter_m states, to the millimetre: inside, middle (of"
        " the plates of the first course) or outside; blank: not known",
        DIAMETERS,
        kinds=WITH_POINTS,
    ),
    positive(
        "diameter_within_mm",
        "largest difference of the diameter as built from a rounded tank.nominal_diameter_m,"
        " millimetres; blank: 1 in 500 of the diameter",
        500,
        kinds=WITH_POINTS,
    ),
    choice(
        "targets",
        "mounting of the targets on the wall: flat (film or thin magnets) or raised (prisms,"
        " balls or targets in holders); blank: flat",
        TARGETS,
        kinds=WITH_POINTS,
    ),
    positive(
        "length_m",
        "length of the cylinder from the drawing, without the ends, metres",
        200,
        kinds=("horizontal",),
    ),
)

INSPECTION = (
    Field(
        "rule",
        "rule name",
        "rule for tankcal inspect: api_653, api_650 or a .toml file beside job.toml; blank:"
        " api_653",
        kinds=VERTICAL,
    ),
    positive(
        "yield_mpa",
        "yield stress of the shell's steel, MPa; needed for limits of settlement",
        MOST_YIELD_MPA,
        kinds=VERTICAL,
    ),
)

KEYS = {
    "inspection": INSPECTION,
    "mesh": MESH,
    "corrections": CORRECTIONS,
    "checks": CHECKS,
}
