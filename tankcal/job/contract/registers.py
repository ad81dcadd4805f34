"""Keys of cameras.toml, instruments.toml, clouds.toml, meters.toml and [adjustment.camera]."""

from tankcal.camera.comparator import KINDS as TRANSFORMATIONS
from tankcal.camera.model import AFFINITIES, CONVENTIONS
from tankcal.job.fields import FREE, USE, Field, angle_fields, number
from tankcal.survey.network.survey import STATES

USUAL_INCIDENCE_MM = 1.0  # default standard uncertainty of the bias at 60 degrees incidence, mm
RANGING = (  # keys of instruments.toml for ranging on the wall
    Field(
        "s_mm",
        "number",
        "standard deviation of a distance to the bare wall, millimetres",
        low=0,
        high=1e3,
        above_low=True,
    ),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of a direction or a zenith angle to the bare wall, seconds of arc",
        low=0,
        high=1e4,
        above_low=True,
    ),
    Field(
        "u_incidence_mm",
        "number",
        "standard uncertainty of the ranging bias at 60 degrees of incidence, relative to"
        " perpendicular incidence, millimetres; blank: 1",
        low=0,
        high=100,
    ),
)
LEAST = 3e-4  # least angle in turns: a bar of 2 m at 1 km, beyond which no distance is determined
STADIA = (
    Field("setup", "name", "set-up of setups.csv from which the bar was read", required=True),
    Field("to", "name", "station under the middle of the bar", required=True),
    Field("bar", "name", "stadia of instruments.toml; blank: the only stadia there"),
    *angle_fields("angle", "horizontal angle between the ends of the bar", (LEAST, 0.25)),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of the angle, seconds of arc",
        required=True,
        low=0,
        high=1e4,
        above_low=True,
    ),
    USE,
)
COLUMNS = {"stadia": STADIA}
KIND = "stadia"  # kind of instrument
BAR = (  # keys of instruments.toml for stadia
    Field(
        "length_m",
        "number",
        "distance between the marks of a stadia, metres",
        low=0.1,
        high=10,
    ),
    Field(
        "u_mm",
        "number",
        "standard uncertainty of length_m, millimetres",
        low=0,
        high=100,
    ),
)
BESIDE = (  # tables of a triangulation beside stadia
    *("setups", "directions", "zenith_angles", "targets", "control", "check"),
    *("distances", "height_differences", "correlated_readings"),
)
TAPE = (  # keys of instruments.toml for tapes
    number("thickness_mm", "thickness of a tape for strapping, millimetres", 0, 5),
    number(
        "section_mm2",
        "cross-section of a tape, mm²; with e_gpa it determines the stretch",
        0.1,
        100,
    ),
    number("e_gpa", "Young's modulus of a tape, GPa", 1, 500),
    number(
        "friction",
        "coefficient of friction between tape and shell; blank: a tension is the mean round the"
        " tank",
        0,
        1,
    ),
    number(
        "laying_mm",
        "standard deviation of the reading from the lay of the tape in each pull, millimetres",
        0,
        50,
    ),
    number(
        "weight_n_per_m",
        "weight of a metre of a tape, newtons; needed if the tape hangs free (sag in"
        " obstructions.csv)",
        0.01,
        5,
    ),
    Field("master", "name", "master tape compared with this tape in tape_checks.csv"),
)
PLUMMET = (  # keys of instruments.toml for plummets
    Field(
        "u_collimation_arcsec",
        "number",
        "standard uncertainty of the verticality of a plummet's line, seconds of arc; blank:"
        " estimated from its two faces",
        low=0,
        high=3600,
    ),
)
INSTRUMENT_KINDS = ("tape", "edm", "total_station", "theodolite", "level", "plummet", "stadia")
# Key in cameras.toml and largest magnitude of each parameter of tankcal.camera.model.
PARAMETER_KEYS = {
    "c": ("c_mm", 1e5),
    "x0": ("x0_mm", 1e4),
    "y0": ("y0_mm", 1e4),
    "K1": ("K1_mm-2", 1.0),
    "K2": ("K2_mm-4", 1.0),
    "K3": ("K3_mm-6", 1.0),
    "K4": ("K4_mm-8", 1.0),
    "P1": ("P1_mm-1", 1.0),
    "P2": ("P2_mm-1", 1.0),
    "P3": ("P3_mm-2", 1.0),
    "P4": ("P4_mm-4", 1.0),
    "A": ("A", 0.1),
    "B": ("B", 0.1),
}
SECOND_NAMES = {"A": "b1", "B": "b2"}  # names of the parameters in the form b1_b2
_NOTES = {
    "c": "principal distance, millimetres",
    "x0": "principal point, to the right of the middle of the format, millimetres",
    "y0": "principal point, above the middle of the format, millimetres",
    "A": "affinity, in the form set by the key affinity",
    "B": "affinity, in the form set by the key affinity",
    "b1": "affinity in place of A, for the form b1_b2",
    "b2": "affinity in place of B, for the form b1_b2",
}


# ---- keys of cameras.toml, instruments.toml, clouds.toml, meters.toml and [adjustment.camera]


def _note(name):
    """Return the note of a parameter."""
    kind = "radial" if name.startswith("K") else "decentring"
    return _NOTES.get(name, f"{kind} distortion {name}")


def _value(name, key=None):
    """Return the key of the value of a parameter, or another key for it."""
    usual_key, largest = PARAMETER_KEYS[name]
    low = 0 if name == "c" else -largest
    return Field(
        key or usual_key,
        "number",
        _note(key or name),
        required=name == "c",
        low=low,
        high=largest,
        above_low=name == "c",
    )


def sd_key(name):
    """Return the key of the standard deviation of a parameter, in the unit of its value."""
    return f"s_{name}_mm" if name in ("c", "x0", "y0") else f"s_{name}"


def _sd(name, of=None):
    """Return the key of a standard deviation; of: parameter whose bound applies, if not `name`."""
    note = f"standard deviation of {name}, in the unit of the parameter; 0: held fixed"
    return Field(sd_key(name), "number", note, low=0, high=PARAMETER_KEYS[of or name][1])


AFFINITIES_BY_AUTHOR = {"silva": "both_y", "pessoa": "both_x"}
MARKS = "marks"
FOCUS_CALIBRATIONS = "focus_calibrations"
# Keys chosen by the user in [cameras.NAME.marks], all with one kind of value.
FAMILIES = {
    "cameras": {
        MARKS: Field(
            MARKS,
            "numbers",
            "calibrated position of a fiducial mark, millimetres from the middle: [-83.01, 0.02]",
            low=-1e3,
            high=1e3,
        )
    }
}
_FOCUS = (
    Field(
        "focus_m",
        "number",
        "focus distance of the lens, metres; with focus_calibrations, in place of K",
        low=0,
        above_low=True,
        high=1e9,
    ),
    Field(
        "lens_focal_length_mm",
        "number",
        "focal length of the lens (c at infinity), millimetres; with focus_calibrations",
        low=0,
        above_low=True,
        high=1e4,
    ),
    Field(
        f"{FOCUS_CALIBRATIONS}.distance_m",
        "numbers",
        "two focus distances at which the lens was calibrated, metres (1e9: infinity): [5, 25]",
        low=0,
        above_low=True,
        high=1e9,
    ),
    *(
        Field(
            f"{FOCUS_CALIBRATIONS}.{PARAMETER_KEYS[name][0]}",
            "numbers",
            f"radial distortion {name} at these two distances; blank: 0",
            low=-1.0,
            high=1.0,
        )
        for name in ("K1", "K2", "K3")
    ),
)
CAMERA = (
    Field(
        "format_mm",
        "numbers",
        "width and height of the image, millimetres: [180, 130]",
        low=0,
        above_low=True,
        high=1000,
    ),
    Field(
        "format_px",
        "numbers",
        "in place of format_mm: columns and lines of the image, with pixel_um: [6000, 4000]",
        low=0,
        above_low=True,
        high=1e6,
    ),
    Field(
        "pixel_um",
        "numbers",
        "size of a pixel, micrometres: 3.9, or across and down [3.9, 3.9]",
        low=0,
        above_low=True,
        high=1000,
    ),
    *(_value(name) for name in PARAMETER_KEYS),
    *(_value(name, key) for name, key in SECOND_NAMES.items()),
    *(_sd(name) for name in PARAMETER_KEYS),
    *(_sd(key, name) for name, key in SECOND_NAMES.items()),
    Field(
        "affinity",
        "choice",
        "form of the affinity: both_y (silva), both_x (pessoa), b1_b2 or before_distortion; blank: "
        "b1_b2",
        choices=(*AFFINITIES, *AFFINITIES_BY_AUTHOR),
    ),
    Field(
        "radial_balance_mm",
        "number",
        "radius of zero radial distortion, of the balanced form, millimetres; blank: 0",
        low=0,
        high=1000,
    ),
    Field(
        "convention",
        "choice",
        "sign convention of K and P: correction_added, correction_subtracted or"
        " distortion_of_ideal; needed with any K or P",
        choices=tuple(CONVENTIONS),
    ),
    Field(
        "fiducial_transformation",
        "choice",
        "transformation of comparator readings with the marks in fiducials.csv; blank: affine",
        choices=tuple(TRANSFORMATIONS),
    ),
    *_FOCUS,
)
INSTRUMENT = (
    Field(
        "kind",
        "text",
        f"{', '.join(INSTRUMENT_KINDS)}, or another kind",
        required=True,
        choices=INSTRUMENT_KINDS,
    ),
    Field("certificate", "text", "number of the instrument's certificate; printed if given"),
    Field(
        "certified_temperature_c",
        "number",
        "reference temperature of the certificate, degrees Celsius",
        low=-60,
        high=90,
    ),
    Field(
        "tension_n",
        "number",
        "tension stated in the certificate of a tape, newtons",
        low=0,
        high=1000,
    ),
    Field("expansion_per_k", "number", "thermal expansion of a tape, 1/K", low=0, high=1e-4),
    Field(
        "correction",
        "number",
        "correction of the scale: true = reading (1 + correction); blank: 0",
        low=-0.1,
        high=0.1,
    ),
    Field(
        "correction_mm",
        "number",
        "correction added to each reading, millimetres; blank: 0",
        low=-1e4,
        high=1e4,
    ),
    Field(
        "u_scale_ppm",
        "number",
        "standard uncertainty of the scale, ppm; free: estimated as an unknown; blank: 0",
        low=0,
        high=1e5,
        choices=(FREE,),
    ),
    Field(
        "u_offset_mm",
        "number",
        "standard uncertainty of the offset, millimetres; free: estimated as an unknown; blank: 0",
        low=0,
        high=1e4,
        choices=(FREE,),
    ),
)
SCOPES_AND_STATES = (
    "off",
    *(f"{scope} {state}" for scope in ("camera", "block", "photo") for state in STATES),
)


def _override(name, note):
    """Return a key for the scope and state of a camera parameter."""
    return Field(name, "choice", note, choices=SCOPES_AND_STATES, of_survey=True)


EQUIPMENT = (  # keys of equipment.toml; no value enters a calculation
    Field(
        "description",
        "text",
        "kind of equipment with make and model, such as: total station, Leica TS16",
        required=True,
    ),
    Field("serial_number", "text", "number of the manufacturer or of the laboratory"),
    Field("laboratory", "text", "laboratory that calibrated it, with its accreditation"),
    Field("certificate", "text", "number of its calibration certificate"),
    Field("date", "date", "date of its calibration, year-month-day"),
    Field("due", "date", "last day on which this calibration may be used, year-month-day"),
    Field("uncertainty", "text", "uncertainty of the certificate, such as: 0.03 mm/m, k = 2"),
)
SEALS = (  # keys of seals.toml, the seal plan; no value enters a calculation
    Field("place", "text", "sealed part, such as: cover of the dip hatch", required=True),
    Field("mark", "text", "number or mark of the seal, such as: INM 004512"),
    Field("secures", "text", "parts that the seal secures, such as: datum plate and gauge tube"),
    Field("attached", "date", "day on which the seal was attached, year-month-day"),
)
CAMERA_SETTINGS = (
    _override(
        "default", "scope and state of c x0 y0 K1 K2 K3 P1 P2 and the affinity; blank: camera free"
    ),
    *(_override(name, _note(name)) for name in PARAMETER_KEYS),
    *(_override(key, _note(key)) for key in SECOND_NAMES.values()),
)

# Alternative spellings of keys, with equal meaning and unit: K1 for K1_mm-2, s_c for s_c_mm.
SHORT_KEYS = {
    "cameras": {key: name for name, (key, _) in PARAMETER_KEYS.items() if name[0] in "KP"}
    | {sd_key(name): f"s_{name}" for name in ("c", "x0", "y0")},
    "instruments": {},
    "clouds": {},
    "meters": {},
    "equipment": {},
    "seals": {},
}
REGISTER_KEYS = {
    "cameras": CAMERA,
    "instruments": (*INSTRUMENT, *TAPE, *PLUMMET, *RANGING, *BAR),
    "equipment": EQUIPMENT,
    "seals": SEALS,
}
REGISTERS_OF_SURVEY = {
    "photos": ("cameras", "instruments"),
    "total-station": ("instruments",),
    "triangulation": ("instruments",),
}
# Keys of [adjustment] that require photographs.
OF_PHOTOS = ("fixed_photo", "image_sd_um", "reading_limit_um", "depth_of_field", "image_weights")
