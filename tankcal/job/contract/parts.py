"""The keys of [mesh], [corrections], [checks] and [inspection]: most are for some kinds only."""

from tankcal.job.contract.kinds import LOADED, VERTICAL, WITH_POINTS
from tankcal.job.contract.shorthand import choice, number, positive
from tankcal.job.fields import Field
from tankcal.job.plausibility import DIAMETERS, MOST_YIELD_MPA, SERVICES, SHELLS, TARGETS

MESH_UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}


MESH = (
    Field(
        "file",
        "mesh file",
        "name of the file of the mesh, beside job.toml or the workbook: .stl, .obj, .ply or .off",
        required=True,
        kinds=("mesh",),
    ),
    choice(
        "unit",
        "unit of the coordinates in that file",
        tuple(MESH_UNITS_M),
        required=True,
        kinds=("mesh",),
    ),
)


def _switch(name, note, kinds=()):
    return Field(name, "flag", f"{note}; blank: true", kinds=kinds)


CORRECTIONS = (
    _switch("plate", "subtract the plates from an outside survey", WITH_POINTS),
    _switch("paint", "subtract the paint from an outside survey", VERTICAL),
    _switch("temperature", "bring the shell to the reference temperature"),
    _switch("head", "load the shell with the liquid head, a sphere with its pressure, too", LOADED),
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
        "ambient, heated or refrigerated: what temperatures are plausible; blank: ambient",
        SERVICES,
    ),
    number(
        "air_temperature_c",
        "temperature of the air during the survey, degrees Celsius; the shell's is near it",
        -80,
        150,
    ),
    number(
        "top_z_m",
        "z of the top of the shell as surveyed, in the frame of the points, metres; bottom_z_m and"
        " the courses lead there",
        -1e5,
        1e5,
        kinds=VERTICAL,
    ),
    choice(
        "bottom_slopes",
        "cone and dish: the bottom goes up or down from its edge to its centre",
        ("up", "down"),
        kinds=VERTICAL,
    ),
    number(
        "circumference_m",
        "circumference of the first course by tape, outside, square to the axis, metres",
        0.3,
        1000,
        kinds=VERTICAL,
    ),
    choice(
        "diameter_is",
        "what tank.nominal_diameter_m is by the drawing, to the millimetre: inside, middle (of the"
        " plates of the first course) or outside; blank: not known",
        DIAMETERS,
        kinds=WITH_POINTS,
    ),
    positive(
        "diameter_within_mm",
        "by how much the diameter as built may differ from tank.nominal_diameter_m where that is a"
        " rounded figure, millimetres; blank: 1 in 500 of it",
        500,
        kinds=WITH_POINTS,
    ),
    choice(
        "targets",
        "how targets are fixed to the wall: flat (film or thin magnets) or raised (prisms, balls or"
        " targets in holders); blank: flat",
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
        "rule that tankcal inspect judges the tank by: api_653, api_650 or a .toml file beside"
        " job.toml; blank: api_653",
        kinds=VERTICAL,
    ),
    positive(
        "yield_mpa",
        "yield stress of the shell's steel, MPa; limits of settlement need it",
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
