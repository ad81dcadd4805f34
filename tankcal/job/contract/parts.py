"""The keys of job.toml about parts of a tank and corrections: most are for one kind only."""

from tankcal.job.contract.kinds import VERTICAL, WITH_POINTS
from tankcal.job.fields import Field
from tankcal.job.plausibility import DIAMETERS, SERVICES, SHELLS

HORIZONTAL_ONLY = ("horizontal",)
SPHERE_ONLY = ("sphere",)
END_FORMS = ("flat", "conical", "ellipsoidal", "torispherical", "spherical")
MESH_UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}


def _length(name, note, kinds, high=100.0, required=False):
    return Field(
        name, "number", note, required=required, kinds=kinds, low=0, above_low=True, high=high
    )


def _end(letter):
    """The keys of one end of a horizontal cylinder."""
    name = f"end {letter.upper()}"
    return (
        Field(
            f"end_{letter}",
            "choice",
            f"form of {name}",
            required=True,
            kinds=HORIZONTAL_ONLY,
            choices=END_FORMS,
        ),
        _length(
            f"end_{letter}_depth_m",
            f"{name}: depth along the axis, metres; conical, ellipsoidal, spherical only",
            HORIZONTAL_ONLY,
            20,
        ),
        _length(
            f"end_{letter}_dish_radius_m",
            f"{name}: radius of the dish, metres; torispherical only",
            HORIZONTAL_ONLY,
        ),
        _length(
            f"end_{letter}_knuckle_radius_m",
            f"{name}: radius of the knuckle, metres; torispherical only",
            HORIZONTAL_ONLY,
            20,
        ),
    )


def _thickness(kinds):
    return Field(
        "thickness_mm",
        "number",
        "plate and paint together, millimetres: subtracted from what was measured outside",
        kinds=kinds,
        low=0,
        high=100,
    )


HORIZONTAL = (
    _length(
        "diameter_m",
        "diameter, metres: FILL IN this, or width_m and height_m, or the points",
        HORIZONTAL_ONLY,
        20,
    ),
    _length("width_m", "width of an elliptical cylinder, metres", HORIZONTAL_ONLY, 20),
    _length("height_m", "height of an elliptical cylinder, metres", HORIZONTAL_ONLY, 20),
    _length(
        "length_m",
        "length of the cylinder, without the ends, metres; nothing is subtracted from it",
        HORIZONTAL_ONLY,
        200,
        required=True,
    ),
    *_end("a"),
    *_end("b"),
    Field(
        "tilt_mm_per_m",
        "number",
        "rise of end B over end A, millimetres per metre of axis; negative: A is higher; blank: 0;"
        " not with points",
        kinds=HORIZONTAL_ONLY,
        low=-200,
        high=200,
    ),
    Field(
        "roll_deg",
        "number",
        "turn of an elliptical cross-section about the axis, degrees, clockwise seen from A;"
        " blank: 0",
        kinds=HORIZONTAL_ONLY,
        low=-90,
        high=90,
    ),
    Field(
        "dip_from_a_m",
        "number",
        "dip point: along the axis from the start of the cylinder at A, metres; blank: half the"
        " length, where there is no tilt",
        kinds=HORIZONTAL_ONLY,
        low=0,
        high=200,
    ),
    Field(
        "dip_direction",
        "choice",
        "dips are read plumb, or square to the axis; blank: plumb",
        kinds=HORIZONTAL_ONLY,
        choices=("plumb", "square"),
    ),
    _thickness(HORIZONTAL_ONLY),
    Field(
        "azimuth_deg",
        "number",
        "direction from A to B, degrees clockwise from +y, so that the points know which end is A;"
        " only with points",
        kinds=HORIZONTAL_ONLY,
        low=0,
        high=360,
    ),
)
SPHERE = (
    _length("diameter_m", "diameter, metres: FILL IN this, or the points", SPHERE_ONLY),
    _thickness(SPHERE_ONLY),
)
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
BOTTOM = (
    Field(
        "form",
        "choice",
        "form of the bottom; blank: flat, or points or liquid when bottom.csv has their columns",
        kinds=VERTICAL,
        choices=("flat", "leaning", "cone", "dish", "points", "liquid"),
    ),
    Field(
        "centre_z_m",
        "number",
        "cone and dish: z of the centre, in the frame of the points, metres; the edge is at"
        " datum.bottom_z_m",
        kinds=VERTICAL,
        low=-1e5,
        high=1e5,
    ),
)
ROOF = (
    Field(
        "mass_kg",
        "number",
        "floating roof: its mass with all that floats with it, kilograms; blank: no floating roof",
        kinds=VERTICAL,
        low=0,
        above_low=True,
        high=1e7,
    ),
    Field(
        "critical_bottom_m",
        "number",
        "dip at which the liquid first touches it, from the table's zero, metres",
        kinds=VERTICAL,
        low=0,
        high=100,
    ),
    Field(
        "critical_top_m",
        "number",
        "dip at which it floats freely, from the table's zero, metres",
        kinds=VERTICAL,
        low=0,
        high=100,
    ),
    Field(
        "reference_density_kg_m3",
        "number",
        "density of the liquid that the table is for, kg/m3",
        kinds=VERTICAL,
        low=0,
        above_low=True,
        high=3000,
    ),
    Field(
        "weighing",
        "choice",
        "what the mass was weighed in, or reduced to: air or vacuum",
        kinds=VERTICAL,
        choices=("air", "vacuum"),
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
    _length(
        "length_m",
        "length of the cylinder from the drawing, without the ends, metres",
        HORIZONTAL_ONLY,
        200,
    ),
)

KEYS = {
    "horizontal": HORIZONTAL,
    "sphere": SPHERE,
    "mesh": MESH,
    "bottom": BOTTOM,
    "roof": ROOF,
    "corrections": CORRECTIONS,
    "checks": CHECKS,
}
