"""The closed lists of a job: every key of job.toml and every column of its tables.

`docs/job-format.md` says the same for people, and the starter job is written from these lists.
"""

from tankcal.job.fields import Field


def _text(name, note):
    return Field(name, "text", note)


KEYS = {
    "tank": (
        Field("id", "tank id", "the tank's name or number", required=True),
        Field(
            "kind",
            "choice",
            "kind of tank; vertical is an upright cylinder",
            required=True,
            choices=("vertical",),
            start="vertical",
        ),
        Field(
            "nominal_diameter_m",
            "number",
            "diameter from the drawing, metres",
            required=True,
            low=0.1,
            high=300,
        ),
        Field(
            "nominal_height_m",
            "number",
            "height of the shell from the drawing, metres",
            required=True,
            low=0.1,
            high=100,
        ),
        _text("owner", "who owns the tank"),
        _text("location", "where it stands"),
        _text("product", "what is stored in it"),
        _text("manufacturer", "who built it"),
        _text("year", "when it was built"),
        _text("serial_number", "number on its plate"),
        _text("construction", "such as: welded, butt joints, fixed roof"),
        _text("remarks", "anything to be printed about the tank"),
    ),
    "survey": (
        Field(
            "side",
            "choice",
            "side of the wall that was surveyed",
            required=True,
            choices=("outside", "inside"),
        ),
        Field("date", "date", "day of the survey, year-month-day", required=True),
        Field(
            "shell_temperature_c",
            "number",
            "temperature of the shell during the survey, degrees Celsius; blank: no correction",
            low=-60,
            high=120,
        ),
        Field(
            "liquid_level_m",
            "number",
            "liquid in the tank during the survey, metres; this version: 0 (empty) or blank",
            low=0,
            high=100,
        ),
        Field(
            "liquid_density_kg_m3",
            "number",
            "density of that liquid, kg/m3; 0: empty",
            low=0,
            high=3000,
        ),
    ),
    "datum": (
        Field(
            "bottom_z_m",
            "number",
            "z of the bottom of the first course, in the frame of the points, metres",
            required=True,
            low=-1e5,
            high=1e5,
        ),
        Field(
            "dip_plate_z_m",
            "number",
            "z of the dip plate, the table's zero, metres; blank: the bottom",
            low=-1e5,
            high=1e5,
        ),
        Field("dip_x_m", "number", "x of the dip point, metres", low=-1e8, high=1e8),
        Field("dip_y_m", "number", "y of the dip point, metres", low=-1e8, high=1e8),
        Field(
            "reference_height_m",
            "number",
            "gauge reference point above the dip plate, metres",
            low=0,
            above_low=True,
            high=200,
        ),
    ),
    "table": (
        Field(
            "step_m",
            "number",
            "step of the capacity table, metres: 0.01 for centimetres",
            required=True,
            low=0,
            above_low=True,
            start="0.01",
        ),
        Field(
            "reference_temperature_c",
            "number",
            "shell temperature that the table is for, degrees Celsius",
            required=True,
            low=-60,
            high=120,
        ),
        Field(
            "liquid_density_kg_m3",
            "number",
            "density for the liquid head, kg/m3; this version: 0 (no head) or blank",
            low=0,
            high=3000,
        ),
        Field(
            "coverage_probability",
            "number",
            "of the expanded uncertainty; blank: 0.95",
            low=0.5,
            high=0.9999,
        ),
        _text("language", "this version prints English: en or blank"),
    ),
    "material": (
        Field("e_gpa", "number", "Young's modulus of the shell, GPa; blank: 206", low=40, high=500),
        Field(
            "expansion_per_k",
            "number",
            "thermal expansion of the shell, 1/K; blank: 1.1e-5",
            low=0,
            above_low=True,
            high=1e-4,
        ),
    ),
    "adjustment": (
        Field("snooping", "flag", "test the points and reject the bad ones; blank: true"),
        Field(
            "scale",
            "choice",
            "variances as given (a_priori) or from the residuals; blank: a_priori",
            choices=("a_priori", "a_posteriori"),
        ),
    ),
    "certificate": (
        _text("number", "number of the certificate"),
        _text("laboratory", "who issues the certificate"),
        _text("laboratory_address", "the issuer's address"),
        _text("customer", "who ordered the calibration"),
        _text("customer_address", "the customer's address"),
        _text("method", "how it was surveyed, such as: total station, ISO 7507-3"),
        _text("procedure", "the laboratory's own procedure"),
        _text("operator", "who surveyed"),
        Field("date_of_issue", "date", "day of issue, year-month-day"),
        _text("traceability", "instruments and their certificates"),
        _text("conditions", "weather and state of the tank during the survey"),
        _text("remarks", "anything to be printed on the certificate"),
        _text("notice", "a word that every page carries, such as RECONSTRUCTION"),
    ),
    "csv": (
        Field(
            "separator",
            "choice",
            "between the cells of the CSV files: , or ; or a tab",
            choices=(",", ";", "\t"),
            start=",",
        ),
        Field("decimal", "choice", "decimal mark in the CSV files", choices=(".", ","), start="."),
    ),
}

OPEN_SECTIONS = ("certificate",)  # hold text fields of the user's own, too
LATER_SECTIONS = ("roof", "adjustment.camera")
LATER_KEYS = {
    "table": ("fine_step_m", "fine_zones", "rule", "minimum_delivery_m"),
    "adjustment": (
        "datum",
        "datum_points",
        "fixed_photo",
        "image_sd_um",
        "refraction",
    ),
}
LATER_ABOVE_ZERO = (
    ("table", "liquid_density_kg_m3", "the correction for the liquid head"),
    ("survey", "liquid_level_m", "a survey of a tank with liquid in it"),
)
LATER_KINDS = ("horizontal", "sphere", "mesh")


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


INPUT_UNITS = {  # unit, how many of it make one of SI, largest u that makes sense, what it is
    "scale": ("ppm", 1e6, 1e4, "scale of the survey"),
    "datum": ("mm", 1e3, 100, "height of the table's zero against the shell"),
    "plate_thickness": ("mm", 1e3, 10, "plate thickness, the same error in all courses"),
    "paint": ("mm", 1e3, 5, "paint thickness, the same error in all courses"),
    "shell_temperature": ("K", 1, 50, "shell temperature during the survey"),
    "expansion": ("1/K", 1, 1e-4, "coefficient of thermal expansion"),
}

COLUMNS = {
    "points": (
        Field("point", "name", "name of the point, once in the file", required=True),
        _coordinate("x", 1e8),
        _coordinate("y", 1e8),
        _coordinate("z", 1e5),
        _sd("x"),
        _sd("y"),
        _sd("z"),
        Field("section", "name", "name of the ring of points; blank: assigned by height"),
        Field("generatrix", "name", "name of the vertical line of points"),
    ),
    "courses": (
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
        Field(
            "thickness_mm", "number", "plate thickness, millimetres", required=True, low=0, high=100
        ),
        Field("paint_mm", "number", "paint thickness, millimetres; blank: 0", low=0, high=10),
    ),
    "uncertainty": (
        Field(
            "input",
            "choice",
            "what is uncertain: " + ", ".join(INPUT_UNITS),
            required=True,
            choices=tuple(INPUT_UNITS),
        ),
        Field(
            "u",
            "number",
            "its standard uncertainty (not the half-width, not U)",
            required=True,
            low=0,
        ),
        Field(
            "unit",
            "choice",
            "; ".join(f"{name}: {row[0]}" for name, row in INPUT_UNITS.items()),
            required=True,
            choices=("ppm", "mm", "K", "1/K"),
        ),
        Field("type", "choice", "A (statistics) or B; blank: B", choices=("A", "B")),
        Field(
            "distribution",
            "choice",
            "blank: normal",
            choices=("normal", "rectangular", "triangular", "u-shaped", "t"),
        ),
        Field(
            "dof",
            "number",
            "degrees of freedom; blank: infinite",
            low=0,
            above_low=True,
        ),
        _text("note", "where the figure comes from"),
    ),
}
