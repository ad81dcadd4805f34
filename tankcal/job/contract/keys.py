"""Keys of job.toml that all or most kinds of tank have, and those of [mesh] and its checks."""

from tankcal.job.contract.registers import CAMERA_SETTINGS
from tankcal.job.fields import KINDS, LOADED, VERTICAL, WITH_POINTS, Field, choice, number, positive
from tankcal.job.plausibility import DIAMETERS, MOST_YIELD_MPA, SERVICES, SHELLS, TARGETS
from tankcal.text.shipped import LANGUAGES
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

PART_KEYS = {
    "inspection": INSPECTION,
    "mesh": MESH,
    "corrections": CORRECTIONS,
    "checks": CHECKS,
}


SPHERE = ("sphere",)
MOST_BAR = 50  # largest gauge pressure of a sphere, bar

TABLE = (
    positive(
        "step_m",
        "step of the capacity table, metres: 0.01 for centimetres; blank if heights are in feet"
        " and inches",
        start="0.01",
    ),
    number(
        "reference_temperature_c",
        "reference temperature of the shell for the table, degrees Celsius",
        -200,
        300,
        required=True,
    ),
    choice(
        "height_unit",
        "unit of heights in the printed table: m, or feet and inches in steps of 1/8 or 1/16"
        " inch; blank: m",
        ("m", "ft-in-8", "ft-in-16"),
    ),
    choice(
        "volume_unit",
        "unit of all volumes in the report: m3, L, hL, bbl (42 US gallons), US gal or imp gal;"
        " blank: m3",
        ("m3", "L", "hL", "bbl", "US gal", "imp gal"),
    ),
    choice(
        "heights_in",
        "heights of the printed table, if height_unit is m: m, or cm for a table of centimetres"
        " with parts of millimetres; blank: m",
        ("m", "cm"),
    ),
    Field(
        "ullage",
        "flag",
        "true: the table also has the ullage of each row, from the reference height; blank: false",
    ),
    positive("fine_step_m", "smaller step within fine_zones, metres"),
    Field(
        "fine_zones",
        "ranges",
        "ranges of dips with the step fine_step_m, metres: 0-0.3; 2.1-2.4",
    ),
    positive(
        "max_interpolation_error_l",
        "largest error of linear interpolation between rows, litres; determines the step if"
        " step_m is blank",
        1e5,
    ),
    Field("height_expansion", "flag", "true: dips expand with the shell; blank: false"),
    number(
        "liquid_density_kg_m3",
        "density of the liquid that loads the shell, kg/m3; 0 or blank: no liquid head",
        0,
        3000,
        kinds=LOADED,
    ),
    number(
        "pressure_bar",
        "gauge pressure in the sphere for the table, bar; 0 or blank: none",
        0,
        MOST_BAR,
        kinds=SPHERE,
    ),
    Field(
        "other_densities_kg_m3",
        "numbers",
        "densities of additional tables, kg/m3: 700; 850",
        kinds=LOADED,
        low=0,
        above_low=True,
        high=3000,
    ),
    number(
        "coverage_probability",
        "coverage probability of the expanded uncertainty; blank: 0.95",
        0.5,
        0.9999,
    ),
    Field(
        "rule",
        "rule name",
        "decision rule for the table: a rule of tankcal, such as oiml_r71, or a .toml file"
        " beside job.toml; blank: none",
    ),
    Field(
        "minimum_delivery_m",
        "numbers",
        "heights of the minimum deliveries whose largest uncertainty is reported, metres: 1.5;"
        " 2; blank: 1.5, 2 and 3, as far as the tank allows",
        low=0,
        above_low=True,
        high=100,
    ),
    Field(
        "monte_carlo",
        "flag",
        "false: no Monte Carlo run beside the law of propagation of uncertainty; blank: true",
    ),
    choice("language", "language of the report; blank: English", LANGUAGES),
)


def _text(name, note):
    """Return a key for a text."""
    return Field(name, "text", note)


def _size(name, note, high, required_for=()):
    """Return a key for a nominal size, metres."""
    return number(name, note, 0.1, high, required_for=required_for)


TANK = (
    Field("id", "tank id", "name or number of the tank", required=True),
    choice(
        "kind",
        "kind of tank: vertical or horizontal (cylinder), sphere, or mesh (any closed surface)",
        KINDS,
        required=True,
        start="vertical",
    ),
    _size("nominal_diameter_m", "diameter from the drawing, metres", 300, VERTICAL),
    _size("nominal_height_m", "height of the shell from the drawing, metres", 100, VERTICAL),
    number(
        "nominal_volume_m3",
        "capacity from the drawing, cubic metres; the result is compared with it",
        0.01,
        1e6,
    ),
    _text("owner", "owner of the tank"),
    _text("location", "location of the tank"),
    _text("product", "product stored in the tank"),
    _text("manufacturer", "manufacturer of the tank"),
    _text("year", "year of construction"),
    _text("serial_number", "serial number on the plate of the tank"),
    _text("construction", "type of construction, such as: welded, butt joints, fixed roof"),
    _text("remarks", "remarks to be printed about the tank"),
)
SURVEY = (
    choice(
        "side",
        "side of the wall on which points and sizes were measured",
        ("outside", "inside"),
        required=True,
        kinds=WITH_POINTS,
    ),
    Field("date", "date", "date of the survey, year-month-day", required=True),
    number(
        "shell_temperature_c",
        "temperature of the shell during the survey, degrees Celsius; blank: no correction",
        -200,
        300,
    ),
    number(
        "liquid_level_m",
        "dip of the liquid in the tank during the survey, from the table's zero, metres; 0 or"
        " blank: empty",
        0,
        100,
        kinds=LOADED,
    ),
    number(
        "liquid_density_kg_m3",
        "density of the liquid in the tank during the survey, kg/m3; 0 or blank: empty",
        0,
        3000,
        kinds=LOADED,
    ),
    number(
        "pressure_bar",
        "gauge pressure in the sphere during the survey, bar; 0 or blank: none",
        0,
        MOST_BAR,
        kinds=SPHERE,
    ),
    _text(
        "equipment_register",
        "file of the laboratory's equipment, such as ../equipment.toml; blank: equipment.toml of"
        " the job, if it exists",
    ),
    Field(
        "equipment_used",
        "names",
        "equipment of the register that was used in this survey; blank: all of it",
    ),
)
DATUM = (
    number(
        "bottom_z_m",
        "z of the bottom of the first course, in the frame of the points, metres",
        -1e5,
        1e5,
        required_for=VERTICAL,
        kinds=VERTICAL,
    ),
    number(
        "dip_plate_z_m",
        "z of the dip plate (the table's zero), metres; blank: the bottom",
        -1e5,
        1e5,
    ),
    number("dip_x_m", "x of the dip point, metres", -1e8, 1e8, kinds=VERTICAL),
    number("dip_y_m", "y of the dip point, metres", -1e8, 1e8, kinds=VERTICAL),
    positive(
        "reference_height_m",
        "height of the gauge reference point above the table's zero, metres",
        200,
    ),
)
MATERIAL = (
    number("e_gpa", "Young's modulus of the shell, GPa; blank: 206", 40, 500, kinds=LOADED),
    number(
        "poisson", "Poisson's ratio of the shell of a sphere; blank: 0.3", 0.1, 0.45, kinds=SPHERE
    ),
    positive("expansion_per_k", "thermal expansion of the shell, 1/K; blank: 1.1e-5", 1e-4),
)
ADJUSTMENT = (
    Field(
        "snooping",
        "flag",
        "test the points and reject outliers; blank: true",
        kinds=WITH_POINTS,
    ),
    choice(
        "scale",
        "variances as given (a_priori) or scaled by the residuals (a_posteriori); blank: a_priori",
        ("a_priori", "a_posteriori"),
        kinds=WITH_POINTS,
    ),
    choice(
        "datum",
        "datum of the adjusted points: control, fixed_photo, minimal or inner; blank: control",
        ("control", "fixed_photo", "minimal", "inner"),
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    Field(
        "datum_points",
        "names",
        "points that define the datum minimal or inner: P7; P9:xy; P3:z; blank: chosen"
        " automatically",
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    Field(
        "fixed_photo",
        "name",
        "photo that defines the datum fixed_photo",
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    positive(
        "image_sd_um",
        "standard deviation of image coordinates whose row states none, micrometres",
        1e4,
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    positive(
        "reading_limit_um",
        "largest standard deviation of repeated readings of an image point or mark,"
        " micrometres; larger: they are rejected; blank: no limit",
        1e4,
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    Field(
        "depth_of_field",
        "flag",
        "true: radial distortion depends on the depth of each point (focus_calibrations of"
        " cameras.toml); blank: false",
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    choice(
        "image_weights",
        "image coordinates of residuals and weights: measured, or ideal (after the correction);"
        " blank: measured",
        ("measured", "ideal"),
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    number(
        "refraction",
        "coefficient of refraction for zenith and vertical angles and slope distances, such as"
        " 0.13; blank: no correction for curvature and refraction",
        -5,
        5,
        kinds=WITH_POINTS,
        of_survey=True,
    ),
)
CERTIFICATE = (
    _text("number", "number of the certificate"),
    _text("laboratory", "laboratory that issues the certificate"),
    _text("laboratory_address", "address of the laboratory"),
    _text("country", "country of issue, two letters of ISO 3166-1, such as: BR"),
    _text("accreditation_number", "accreditation of the laboratory, such as: CAL 0123"),
    _text("customer", "customer who ordered the calibration"),
    _text("customer_address", "address of the customer"),
    _text("customer_contact", "contact named by the customer, with telephone or e-mail"),
    _text("place", "place of the calibration; blank: location of the tank"),
    _text("method", "method of the survey, such as: total station inside the tank"),
    _text("standard", "standard of the method with its edition, as the laboratory declares it"),
    _text("procedure", "procedure of the laboratory"),
    _text("deviations", "deviations from the method, omissions included"),
    _text("operator", "name of the surveyor"),
    _text("equipment", "instruments used"),
    _text("traceability", "standards and certificates that make the results traceable"),
    _text("conditions", "weather during the survey"),
    _text("condition_of_tank", "state of the tank during the survey, such as: clean, empty"),
    _text("external_results", "results from external providers, and their names"),
    _text("customer_data", "data supplied by the customer and not measured by the laboratory"),
    _text("replaces", "certificate replaced by this certificate, and the reason"),
    _text("authorised_by", "person who authorises the certificate"),
    _text("authorised_role", "function of the person who authorises the certificate"),
    Field("survey_end", "date", "last day of a survey of several days; [survey] date is the first"),
    Field("date_of_issue", "date", "date of issue, year-month-day"),
    Field(
        "next_verification",
        "date",
        "last day of the next verification, only if the customer asked for it; year-month-day",
    ),
    Field(
        "next_verification_rule",
        "rule name",
        "rule that demands the next verification: a rule of tankcal with a period, or a .toml file"
        " beside job.toml",
    ),
    _text("remarks", "remarks to be printed on the certificate"),
    _text("notice", "notice printed on every page, such as RECONSTRUCTION"),
)
CSV = (
    choice(
        "separator",
        "separator of the cells in the CSV files: , or ; or a tab",
        (",", ";", "\t"),
        start=",",
    ),
    choice("decimal", "decimal mark in the CSV files", (".", ","), start="."),
)

COMMON_KEYS = {
    "tank": TANK,
    "survey": SURVEY,
    "datum": DATUM,
    "table": TABLE,
    "material": MATERIAL,
    "adjustment": ADJUSTMENT,
    "adjustment.camera": CAMERA_SETTINGS,
    "certificate": CERTIFICATE,
    "csv": CSV,
}
