"""The keys of [mesh], [corrections] and [checks] of job.toml: most are for some kinds only."""

from tankcal.job.contract.kinds import VERTICAL, WITH_POINTS
from tankcal.job.fields import Field
from tankcal.job.plausibility import DIAMETERS, SERVICES, SHELLS

MESH_UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}


MESH = (
    Field(
        "file",
        "mesh file",
        "name of the file of the mesh, beside job.toml or the workbook: .stl, .obj, .ply or .off",
        required=True,
        kinds=("mesh",),
    ),
    Field(
        "unit",
        "choice",
        "unit of the coordinates in that file",
        required=True,
        kinds=("mesh",),
        choices=tuple(MESH_UNITS_M),
    ),
)


def _switch(name, note, kinds=()):
    return Field(name, "flag", f"{note}; blank: true", kinds=kinds)


CORRECTIONS = (
    _switch("plate", "subtract the plates from an outside survey", WITH_POINTS),
    _switch("paint", "subtract the paint from an outside survey", VERTICAL),
    _switch("temperature", "bring the shell to the reference temperature"),
    _switch("head", "load the shell with the liquid head", VERTICAL),
    _switch("tilt", "take the tilt into account", ("vertical", "horizontal")),
    _switch("bottom", "take the form of the bottom into account", VERTICAL),
    _switch("deadwood", "take the deadwood into account"),
    _switch("roof", "take the floating roof into account", VERTICAL),
)

CHECKS = (
    Field(
        "shell",
        "choice",
        "metal of the shell: carbon_steel, stainless_steel, aluminium, or other; blank:"
        " carbon_steel",
        choices=SHELLS,
    ),
    Field(
        "service",
        "choice",
        "ambient, heated or refrigerated: what temperatures are plausible; blank: ambient",
        choices=SERVICES,
    ),
    Field(
        "air_temperature_c",
        "number",
        "temperature of the air during the survey, degrees Celsius; the shell's is near it",
        low=-80,
        high=150,
    ),
    Field(
        "top_z_m",
        "number",
        "z of the top of the shell as surveyed, in the frame of the points, metres; bottom_z_m and"
        " the courses lead there",
        kinds=VERTICAL,
        low=-1e5,
        high=1e5,
    ),
    Field(
        "bottom_slopes",
        "choice",
        "cone and dish: the bottom goes up or down from its edge to its centre",
        kinds=VERTICAL,
        choices=("up", "down"),
    ),
    Field(
        "circumference_m",
        "number",
        "circumference of the first course by tape, outside, square to the axis, metres",
        kinds=VERTICAL,
        low=0.3,
        high=1000,
    ),
    Field(
        "diameter_is",
        "choice",
        "what tank.nominal_diameter_m is by the drawing, to the millimetre: inside, middle (of the"
        " plates of the first course) or outside; blank: not known",
        kinds=WITH_POINTS,
        choices=DIAMETERS,
    ),
    Field(
        "length_m",
        "number",
        "length of the cylinder from the drawing, without the ends, metres",
        kinds=("horizontal",),
        low=0,
        above_low=True,
        high=200,
    ),
)

KEYS = {
    "mesh": MESH,
    "corrections": CORRECTIONS,
    "checks": CHECKS,
}
