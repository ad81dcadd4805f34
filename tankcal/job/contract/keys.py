"""The keys of job.toml that every kind of tank has, or most of them."""

from tankcal.job.contract.kinds import KINDS, VERTICAL, WITH_POINTS
from tankcal.job.contract.registers import CAMERA_SETTINGS
from tankcal.job.fields import Field
from tankcal.text.languages import LANGUAGES

# The keys of [table].

TABLE = (
    Field(
        "step_m",
        "number",
        "step of the capacity table, metres: 0.01 for centimetres; blank with feet and inches",
        low=0,
        above_low=True,
        start="0.01",
    ),
    Field(
        "reference_temperature_c",
        "number",
        "shell temperature that the table is for, degrees Celsius",
        required=True,
        low=-200,
        high=300,
    ),
    Field(
        "height_unit",
        "choice",
        "of the printed table: m, or feet and inches in steps of 1/8 or 1/16 inch; blank: m",
        choices=("m", "ft-in-8", "ft-in-16"),
    ),
    Field(
        "volume_unit",
        "choice",
        "of the printed table: m3, L, or bbl (42 US gallons); blank: m3",
        choices=("m3", "L", "bbl"),
    ),
    Field(
        "fine_step_m",
        "number",
        "smaller step within fine_zones, metres",
        low=0,
        above_low=True,
    ),
    Field(
        "fine_zones",
        "ranges",
        "dips, metres, between which the table has that step: 0-0.3; 2.1-2.4",
    ),
    Field(
        "max_interpolation_error_l",
        "number",
        "largest error of linear interpolation between rows, litres; without step_m the step is"
        " chosen by it",
        low=0,
        above_low=True,
        high=1e5,
    ),
    Field(
        "height_expansion",
        "flag",
        "true: dips expand with the shell, too; blank: false",
    ),
    Field(
        "liquid_density_kg_m3",
        "number",
        "density of the liquid that loads the shell, kg/m3; 0 or blank: no head",
        kinds=VERTICAL,
        low=0,
        high=3000,
    ),
    Field(
        "other_densities_kg_m3",
        "numbers",
        "densities of further tables, kg/m3: 700; 850",
        kinds=VERTICAL,
        low=0,
        above_low=True,
        high=3000,
    ),
    Field(
        "coverage_probability",
        "number",
        "of the expanded uncertainty; blank: 0.95",
        low=0.5,
        high=0.9999,
    ),
    Field(
        "rule",
        "rule name",
        "decision rule that the table is judged by: one that ships with tankcal, such as oiml_r71,"
        " or a .toml file beside job.toml; blank: none",
    ),
    Field(
        "minimum_delivery_m",
        "numbers",
        "heights of the least deliveries whose worst uncertainty is reported, metres: 1.5; 2;"
        " blank: 1.5, 2 and 3 as far as they fit",
        low=0,
        above_low=True,
        high=100,
    ),
    Field(
        "monte_carlo",
        "flag",
        "false: no Monte Carlo beside the law of propagation; blank: true",
    ),
    Field(
        "language",
        "choice",
        "language of the papers; blank: English",
        choices=LANGUAGES,
    ),
)


def _text(name, note):
    return Field(name, "text", note)


def _size(name, note, high, required_for=()):
    return Field(name, "number", note, required_for=required_for, low=0.1, high=high)


TANK = (
    Field("id", "tank id", "the tank's name or number", required=True),
    Field(
        "kind",
        "choice",
        "kind of tank: vertical (an upright cylinder), horizontal (a lying one), sphere, or mesh"
        " (any closed surface)",
        required=True,
        choices=KINDS,
        start="vertical",
    ),
    _size("nominal_diameter_m", "diameter from the drawing, metres", 300, VERTICAL),
    _size("nominal_height_m", "height of the shell from the drawing, metres", 100, VERTICAL),
    Field(
        "nominal_volume_m3",
        "number",
        "capacity from the drawing, cubic metres; the result is compared with it",
        low=0.01,
        high=1e6,
    ),
    _text("owner", "who owns the tank"),
    _text("location", "where it stands"),
    _text("product", "what is stored in it"),
    _text("manufacturer", "who built it"),
    _text("year", "when it was built"),
    _text("serial_number", "number on its plate"),
    _text("construction", "such as: welded, butt joints, fixed roof"),
    _text("remarks", "anything to be printed about the tank"),
)
SURVEY = (
    Field(
        "side",
        "choice",
        "side of the wall on which points and sizes were measured",
        required=True,
        kinds=WITH_POINTS,
        choices=("outside", "inside"),
    ),
    Field("date", "date", "day of the survey, year-month-day", required=True),
    Field(
        "shell_temperature_c",
        "number",
        "temperature of the shell during the survey, degrees Celsius; blank: no correction",
        low=-200,
        high=300,
    ),
    Field(
        "liquid_level_m",
        "number",
        "liquid in the tank during the survey: its dip from the table's zero, metres; 0 or blank:"
        " empty",
        kinds=VERTICAL,
        low=0,
        high=100,
    ),
    Field(
        "liquid_density_kg_m3",
        "number",
        "density of that liquid, kg/m3; 0 or blank: empty",
        kinds=VERTICAL,
        low=0,
        high=3000,
    ),
)
DATUM = (
    Field(
        "bottom_z_m",
        "number",
        "z of the bottom of the first course, in the frame of the points, metres",
        required_for=VERTICAL,
        kinds=VERTICAL,
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
    Field("dip_x_m", "number", "x of the dip point, metres", kinds=VERTICAL, low=-1e8, high=1e8),
    Field("dip_y_m", "number", "y of the dip point, metres", kinds=VERTICAL, low=-1e8, high=1e8),
    Field(
        "reference_height_m",
        "number",
        "gauge reference point above the table's zero, metres",
        low=0,
        above_low=True,
        high=200,
    ),
)
MATERIAL = (
    Field(
        "e_gpa",
        "number",
        "Young's modulus of the shell, GPa; blank: 206",
        kinds=VERTICAL,
        low=40,
        high=500,
    ),
    Field(
        "expansion_per_k",
        "number",
        "thermal expansion of the shell, 1/K; blank: 1.1e-5",
        low=0,
        above_low=True,
        high=1e-4,
    ),
)
ADJUSTMENT = (
    Field(
        "snooping",
        "flag",
        "test the points and reject the bad ones; blank: true",
        kinds=WITH_POINTS,
    ),
    Field(
        "scale",
        "choice",
        "variances as given (a_priori) or from the residuals; blank: a_priori",
        kinds=WITH_POINTS,
        choices=("a_priori", "a_posteriori"),
    ),
    Field(
        "datum",
        "choice",
        "what holds the frame of the adjusted points: control, fixed_photo, minimal or inner;"
        " blank: control",
        kinds=WITH_POINTS,
        choices=("control", "fixed_photo", "minimal", "inner"),
        of_survey=True,
    ),
    Field(
        "datum_points",
        "names",
        "points that carry the datum minimal or inner: P7; P9:xy; P3:z; blank: chosen",
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    Field(
        "fixed_photo",
        "name",
        "the photo that holds the datum fixed_photo",
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    Field(
        "image_sd_um",
        "number",
        "standard deviation of image coordinates that carry none, micrometres",
        kinds=WITH_POINTS,
        low=0,
        above_low=True,
        high=1e4,
        of_survey=True,
    ),
    Field(
        "reading_limit_um",
        "number",
        "largest standard deviation of repeated readings of an image point or mark, micrometres;"
        " beyond it they are rejected; blank: none are",
        kinds=WITH_POINTS,
        low=0,
        above_low=True,
        high=1e4,
        of_survey=True,
    ),
    Field(
        "depth_of_field",
        "flag",
        "true: radial distortion by the depth of each point, from focus_calibrations in"
        " cameras.toml; blank: false",
        kinds=WITH_POINTS,
        of_survey=True,
    ),
    Field(
        "image_weights",
        "choice",
        "image in which residuals are counted and weighed: measured or ideal (after the"
        " correction); blank: measured",
        kinds=WITH_POINTS,
        choices=("measured", "ideal"),
        of_survey=True,
    ),
    Field(
        "refraction",
        "number",
        "coefficient of refraction for zenith and vertical angles and slope distances, such as"
        " 0.13; blank: neither curvature nor refraction",
        kinds=WITH_POINTS,
        low=-5,
        high=5,
        of_survey=True,
    ),
)
CERTIFICATE = (
    _text("number", "number of the certificate"),
    _text("laboratory", "who issues the certificate"),
    _text("laboratory_address", "the issuer's address"),
    _text("accreditation_number", "accreditation of the laboratory, such as: CAL 0123"),
    _text("customer", "who ordered the calibration"),
    _text("customer_address", "the customer's address"),
    _text("customer_contact", "whom the customer named, with telephone or e-mail"),
    _text("place", "where the calibration was made; blank: where the tank stands"),
    _text("method", "how it was surveyed, such as: total station, ISO 7507-3"),
    _text("procedure", "the laboratory's own procedure"),
    _text("deviations", "what was done otherwise than the method says, or left out"),
    _text("operator", "who surveyed"),
    _text("equipment", "instruments that were used"),
    _text("traceability", "to what standards, and by which certificates, results are traceable"),
    _text("conditions", "weather during the survey"),
    _text("condition_of_tank", "state of the tank during the survey, such as: clean, empty"),
    _text("external_results", "results that came from others, and from whom"),
    _text("customer_data", "what the customer supplied and the laboratory did not measure"),
    _text("replaces", "the certificate that this one replaces, and why"),
    _text("authorised_by", "who authorises the certificate"),
    _text("authorised_role", "that person's function"),
    Field("date_of_issue", "date", "day of issue, year-month-day"),
    _text("remarks", "anything to be printed on the certificate"),
    _text("notice", "a word that every page carries, such as RECONSTRUCTION"),
)
CSV = (
    Field(
        "separator",
        "choice",
        "between the cells of the CSV files: , or ; or a tab",
        choices=(",", ";", "\t"),
        start=",",
    ),
    Field("decimal", "choice", "decimal mark in the CSV files", choices=(".", ","), start="."),
)

KEYS = {
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
