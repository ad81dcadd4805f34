"""Limits of plausible input and of quantities computed from it, and their table in words.

A number beyond a range causes a warning; an impossible number is a problem. The limits are chosen
by tankcal: wide enough for existing tanks, narrow enough to detect mistyped values. TABLE describes
them with the codes of their messages; `docs/plausible-values.md` shows it, and a test compares the
two.
"""

import math
from dataclasses import dataclass

from tankcal.messages import message
from tankcal.units import FOOT_M, INCH_M

AMBIENT, HEATED, REFRIGERATED = SERVICES = ("ambient", "heated", "refrigerated")
CARBON_STEEL, STAINLESS_STEEL, ALUMINIUM = METALS = (
    "carbon_steel",
    "stainless_steel",
    "aluminium",
)
SHELLS = (*METALS, "other")
INSIDE, MIDDLE, OUTSIDE = DIAMETERS = ("inside", "middle", "outside")
# Plates between the inside radius and this radius.
PLATES_TO_INSIDE = {INSIDE: 0.0, MIDDLE: 0.5, OUTSIDE: 1.0}
FLAT, RAISED = TARGETS = ("flat", "raised")

MOST_YIELD_MPA = 2000  # yield stress of the shell; a larger number is in Pa or psi

FIRST_YEAR = 1900  # earliest year of a survey
DAYS_AHEAD = 1  # latest day of a survey after today, because of time zones
YEARS_PLANNED = 10  # longest time until a planned survey
DAYS_TO_ISSUE = 60  # longest time until the date of issue of a certificate

SHELL_C = {AMBIENT: (-35.0, 50.0), HEATED: (-35.0, 300.0), REFRIGERATED: (-200.0, 50.0)}
REFERENCE_C = {AMBIENT: (0.0, 40.0), HEATED: (0.0, 300.0), REFRIGERATED: (-200.0, 40.0)}
AIR_C = (-45.0, 48.0)
SHELL_OVER_AIR_K = (-15.0, 30.0)  # shell at night, shell in the sun

EXPANSION_PER_K = {
    "carbon_steel": (0.95e-5, 1.4e-5),
    "stainless_steel": (0.95e-5, 1.9e-5),
    "aluminium": (2.1e-5, 2.6e-5),
}
E_GPA = {
    "carbon_steel": (185.0, 220.0),
    "stainless_steel": (175.0, 220.0),
    "aluminium": (62.0, 80.0),
}

WATER_STRESS_MPA = 350.0  # largest stress in the thinnest plausible plates
# Smallest design stress.
LEAST_STRESS_MPA = {"carbon_steel": 137.0, "stainless_steel": 120.0, "aluminium": 55.0}
MIN_POINTS_PER_COURSE = 5  # fewer points are a problem
LIGHT, HEAVY = 0.45, 1.0  # relative densities: of liquid not given; least for the upper limit
# Largest thickness: addend and factor to the need of head and code.
THICK_MM, THICK_FACTOR = 6.5, 1.4
CODE_MM, CODE_PER_M = 5.0, 0.08  # minimum thickness of codes: a + b times the diameter in m
THIN_MM = {  # thinnest course: the lesser of two lines a + b times the diameter in m
    "carbon_steel": ((2.0, 0.15), (4.0, 0.04)),
    "stainless_steel": ((1.0, 0.05), (1.0, 0.05)),
    "aluminium": ((2.0, 0.15), (4.0, 0.04)),
}
SOLID_PLATES_MM = {  # lying cylinder, sphere: least and most, each a + b times the diameter in m
    "horizontal": ((1.0, 0.4), (12.0, 8.0)),
    "sphere": ((1.0, 0.2), (6.0, 4.0)),
}
LEAST_PLATE_MM = 1.0  # thinnest plate
PAINT_MM = 1.5  # thickest paint
TARGET_MM = {  # wall to centre of target; flat: film, thin magnets; raised: prisms, balls, holders
    FLAT: (0.0, 2.5),
    RAISED: (2.5, 100.0),
}
RISING_PLATES = 1.1  # thickness of the top course over that of the bottom course

NEAR_JOINT_M = 0.025  # points nearer to a joint are on a weld, not on a plate
# Rings of points: largest height of a ring, smallest gap between rings, largest number of rings.
LEVEL_M, RING_GAP_M, MOST_RINGS = 0.03, 0.08, 60
TOP_MISS_M = 0.05  # largest difference of checks.top_z_m and the sum of the courses
# Points of the wall beyond an end of the shell: distance, and largest share and number of them.
OFF_SHELL_M, OFF_SHELL, OFF_SHELL_POINTS = 0.05, 0.03, 5
NEAR_WALL = 0.005  # share of the radius; nearer points belong to the wall
# Bottom points beyond this share of the radius agree with bottom_z_m within this length.
RIM, RIM_MISS_M = 0.8, 0.25
# Largest distance of dip plate and bottom, as a length and, for a lying tank or a sphere, also as
# a share of the diameter.
DIP_PLATE_M, DIP_PLATE = 0.3, 0.05
PLATE_ON_BOTTOM, PLATE_ON_BOTTOM_M = 0.5, 0.05  # share of the rise at the dip point, plus a length
SLOPE_UP = 0.04  # rise of a cone over the radius; 1:120 is usual, 1:25 the limit
# Reference height below the top of the tank; above it, as a length plus a share of the diameter.
REFERENCE_BELOW_M, REFERENCE_ABOVE_M, REFERENCE_ABOVE = 0.05, 5.0, 0.2

# Difference from the drawing: share of the size plus a length.
DIAMETER_MISS, DIAMETER_MISS_M = 0.01, 0.02
SIZE_MISS, SIZE_MISS_M, IMPOSSIBLE_MISS = 0.01, 0.02, 0.3
VOLUME_MISS = 0.05  # relative difference of capacity and nominal volume
LENGTH_OVER_DIAMETER, MOST_LENGTH_OVER_DIAMETER = (0.4, 16.0), 40.0
END_DEPTH = {  # depth of an end over the diameter
    "conical": (0.02, 0.3),
    "ellipsoidal": (0.12, 0.4),
    "spherical": (0.05, 0.22),
    "torispherical": (0.12, 0.3),
    "guppy": (0.05, 0.6),
}
STRONG_ROLL_DEG = 15.0  # inclination of a gauge tube
HEMISPHERE = 0.47  # smallest depth of a hemispherical end over the diameter
DISH_RADIUS, KNUCKLE_RADIUS = (0.7, 1.3), (0.03, 0.25)  # over the diameter
ENDS_DIFFER, ENDS_DIFFER_M = 1.2, 0.03  # two ends of one form: ratio and difference of sizes
SPHERE_M = 50.0  # largest diameter of a sphere
DENSITIES_KG_M3 = (400.0, 2000.0)
ROOF_KG_M2 = (15.0, 500.0)  # mass of a floating roof over the area of the tank

MISFIT, MISFIT_M, IMPOSSIBLE_MISFIT = 0.002, 0.010, 0.02  # rms of residuals, over the diameter
MISFIT_SDS = 3.0  # rms of residuals over the given standard deviation
CIRCUMFERENCE_MISS, CIRCUMFERENCE_SDS = 4e-4, 3.0
# Difference of inside diameter and drawing: share plus length.
DRAWN_MISS, DRAWN_MISS_M = 1e-3, 0.004
OTHER_SIDE = (0.6, 1.6)  # difference over two plates that indicates the other side of the wall

LIQUID_C = {AMBIENT: (-30.0, 50.0), HEATED: (-30.0, 250.0), REFRIGERATED: (-200.0, 50.0)}
LIQUID_EXPANSION_PER_K = (5e-5, 2.5e-3)  # water at 8 degrees, liquefied gas
METER_OVER_TANK_K, SHELL_OVER_LIQUID_K = 10.0, 25.0
TANK_C_STEP_K = 2.0  # change of the liquid temperature in the tank from dip to dip
METER_DRIFT, MUCH_METER_DRIFT = 2e-4, 5e-4  # relative change of a meter factor: drift, large change
BATCH_SD = 1e-3  # sd of a batch by its meter, over the batch

RATIO_MISS = 0.03  # relative difference of a ratio of sizes from a ratio of units
RATIOS = {  # ratios of two sizes that should be equal, by cause
    "feet": (1 / FOOT_M,),
    "radius": (2.0,),
    "girth": (math.pi,),
    "inches": (25.4, 1 / INCH_M),
    "point": (10.0, 100.0, 1000.0),
}

# Words in names of deadwood that reduce or increase the capacity, in three languages.
TAKES_ROOM = (
    *("coil", "pipe", "tube", "column", "pillar", "ladder", "stair", "agitator", "mixer", "beam"),
    *("serpentina", "tubo", "tubulação", "coluna", "pilar", "escada", "agitador", "viga"),
    *("tubería", "columna", "escalera", "mezclador"),
)
GIVES_ROOM = (
    *("manhole", "manway", "sump", "nozzle", "door", "dome", "recess", "bulge", "hatch"),
    *("boca de ", "poço", "bocal", "porta", "domo", "recesso", "escotilha", "pote", "bolsa"),
    *("sumidero", "pozo", "boquilla", "tubuladura", "puerta", "escotilla", "receso"),
)


def unit_guess(ratio):
    """Message with the likely cause of the ratio of two sizes that should be equal."""
    ratio = max(ratio, 1 / ratio) if ratio > 0 else math.inf
    cause = {
        "feet": message("ratio_of_feet", ", as of feet and metres"),
        "radius": message("ratio_of_radius", ", as of a diameter and a radius"),
        "girth": message("ratio_of_girth", ", as of a circumference and a diameter"),
        "inches": message("ratio_of_inches", ", as of an inch in place of a metric unit"),
        "point": message("ratio_of_point", ", as of a decimal point in the wrong place"),
    }
    matches = (
        (abs(ratio / match - 1), text)
        for name, text in cause.items()
        for match in RATIOS[name]
        if abs(ratio / match - 1) <= RATIO_MISS
    )
    text = min(matches, key=lambda match: match[0], default=(0.0, ""))[1]
    return message(
        "ratio_of_sizes", "; they are as {ratio:.3g} to 1{cause}", ratio=ratio, cause=text
    )


def least_course_mm(diameter_m, head_m, density=LIGHT, shell="carbon_steel"):
    """Smallest plausible thickness of a course, mm.

    It is the larger of the thickness at a stress of 350 MPa and of the thinnest plates of this
    metal.

    Parameters
    ----------
    diameter_m, head_m : float
        Diameter of the tank; height of liquid above the bottom of the course.
    density : float, optional
        Relative density of the liquid.
    shell : str, optional
        Metal of the shell.
    """
    needed = _head_mm(diameter_m, head_m, density, WATER_STRESS_MPA)
    return max(min(a + b * diameter_m for a, b in THIN_MM[shell]), needed)


def most_course_mm(diameter_m, head_m, density=HEAVY, shell="carbon_steel"):
    """Largest plausible thickness of a course, mm.

    It is 1.4 times the thickness required by the smallest design stress or by a code, plus 6.5 mm
    for corrosion. For the parameters, see `least_course_mm`.
    """
    needed = _head_mm(diameter_m, head_m, density, LEAST_STRESS_MPA[shell])
    return THICK_MM + THICK_FACTOR * max(CODE_MM + CODE_PER_M * diameter_m, needed)


def side_doubt(inside_m, nominal_m, drawn, plate_m, side, sd_m=0.0):
    """Compare an inside diameter with the drawing, to the thickness of a plate.

    Parameters
    ----------
    inside_m : float
        Inside diameter of the first course, from points or sizes.
    nominal_m : float or None
        Nominal diameter.
    drawn : {"inside", "middle", "outside"} or None
        Definition of the nominal diameter.
    plate_m : float
        Thickness of plate and paint; 0: not known.
    side : {"inside", "outside"}
        Declared side of the survey. A survey from the other side differs by two plates.
    sd_m : float, optional
        Standard deviation of `inside_m`.

    Returns
    -------
    Message or None
        None if the diameter is plausible or cannot be compared.
    """
    if drawn is None or nominal_m is None or (drawn != INSIDE and not plate_m):
        return None
    expected = nominal_m - 2 * PLATES_TO_INSIDE[drawn] * plate_m
    miss, step = inside_m - expected, 2 * plate_m
    values = {
        "inside_m": inside_m,
        "side": side,
        "nominal_m": nominal_m,
        "drawn": drawn,
        "miss_mm": 1000 * miss,
    }
    sign = -1 if side == OUTSIDE else 1
    noise = CIRCUMFERENCE_MISS * nominal_m + CIRCUMFERENCE_SDS * sd_m
    if step > 2 * noise and OTHER_SIDE[0] * step < sign * miss < OTHER_SIDE[1] * step:
        return message(
            "side_doubtful",
            "{inside_m:.4f} m inside with survey.side = {side}, {miss_mm:+.0f} mm from the drawing"
            " ({nominal_m:g} m {drawn}); measured {other} it would be {other_mm:+.0f} mm: which"
            " side of the wall was it?",
            other=INSIDE if side == OUTSIDE else OUTSIDE,
            other_mm=1000 * (miss - sign * step),
            **values,
        )
    if abs(miss) > DRAWN_MISS * nominal_m + DRAWN_MISS_M + CIRCUMFERENCE_SDS * sd_m:
        return message(
            "inside_unlike_drawing",
            "{inside_m:.4f} m inside with survey.side = {side}, {miss_mm:+.0f} mm from the drawing"
            " ({nominal_m:g} m {drawn}): are side, plates and scale right?",
            **values,
        )
    return None


def reference_doubt(reference_m, top_m, diameter_m):
    """Message about a reference height that does not fit the top of the tank; None if plausible."""
    if reference_m < top_m - REFERENCE_BELOW_M:
        return message(
            "reference_below_top",
            "{found_m:g} m, and the top of the tank is {top_m:.4g} m above the table's zero:"
            " expected the reference point above it",
            found_m=reference_m,
            top_m=top_m,
        )
    most = top_m + REFERENCE_ABOVE_M + REFERENCE_ABOVE * (diameter_m or 0.0)
    if reference_m > most:
        return message(
            "reference_far_above",
            "{found_m:g} m, and the top of the tank is {top_m:.4g} m above the table's zero: "
            "expected at most {most_m:.4g} m; is it in another unit?",
            found_m=reference_m,
            top_m=top_m,
            most_m=most,
        )
    return None


def _head_mm(diameter_m, head_m, density, stress_mpa):
    """Thickness required by a liquid head, mm: 1000 rho g H D / 2 over the stress."""
    return 4.903 * density * diameter_m * head_m / stress_mpa


@dataclass(frozen=True)
class Plausible:
    """Line of the table.

    Attributes
    ----------
    what : str
        Keys of job.toml and columns of tables, as written in a job.
    expected : str
        Plausible range, in words.
    slip : str
        Typical errors that the range detects.
    against : str
        Quantity with which the number is compared; "" without a comparison.
    codes : tuple of str
        Codes of the messages that report an implausible number.
    verified : bool
        False: limit of a standard, taken from a secondary source.
    """

    what: str
    expected: str
    slip: str
    against: str
    codes: tuple[str, ...]
    verified: bool = True


def _celsius_range(bounds):
    """Bounds in degrees Celsius, as a text."""
    return f"{bounds[0]:g} to {bounds[1]:g} °C"


def _expansion_range(shell):
    """Plausible coefficients of thermal expansion of a metal, as a text."""
    low, high = EXPANSION_PER_K[shell]
    return f"{low:g} to {high:g} 1/K"


def _plate_range(kind):
    """Plausible plates of a kind of tank, two lines in the diameter D, as a text."""
    thinnest, thickest = SOLID_PLATES_MM[kind]
    return (
        f"({thinnest[0]:g} + {thinnest[1]:g} D) to ({thickest[0]:g} + {thickest[1]:g} D) mm, D in m"
    )


def _thinnest(shell):
    """Least plate of a metal, the lesser of two lines in the diameter D, as a text."""
    lines = [f"{least:g} + {per_m:g} D" for least, per_m in dict.fromkeys(THIN_MM[shell])]
    return lines[0] + " mm" if len(lines) == 1 else f"the lesser of {' and '.join(lines)} mm"


def _depth_range(form):
    """Plausible depths of an end over its diameter, as a text."""
    low, high = END_DEPTH[form]
    hemisphere = f" or {HEMISPHERE:g} to 0.5" if form == "spherical" else ""
    return f"{form} {low:g} to {high:g}{hemisphere}"


TABLE = (
    Plausible(
        "survey.date",
        f"year {FIRST_YEAR} to today; for a plan up to {YEARS_PLANNED} years ahead (problem)",
        "1024 for 2024, a date in the future",
        "today's date",
        ("survey_date_impossible",),
    ),
    Plausible(
        "certificate.date_of_issue",
        f"up to {DAYS_TO_ISSUE} days from today",
        "a wrong year",
        "today's date, survey.date",
        ("issue_date_far",),
    ),
    Plausible(
        "survey.shell_temperature_c",
        f"{_celsius_range(SHELL_C[AMBIENT])}; checks.service heated"
        f" {_celsius_range(SHELL_C[HEATED])}, refrigerated"
        f" {_celsius_range(SHELL_C[REFRIGERATED])}",
        "degrees Fahrenheit",
        f"checks.air_temperature_c: {SHELL_OVER_AIR_K[0]:g} to {SHELL_OVER_AIR_K[1]:+g} K from it",
        ("temperature_strange", "shell_unlike_air"),
    ),
    Plausible(
        "table.reference_temperature_c",
        f"{_celsius_range(REFERENCE_C[AMBIENT])}; checks.service heated"
        f" {_celsius_range(REFERENCE_C[HEATED])}, refrigerated"
        f" {_celsius_range(REFERENCE_C[REFRIGERATED])}",
        "degrees Fahrenheit (68, 60, 59)",
        "checks.service",
        ("temperature_strange",),
    ),
    Plausible(
        "checks.air_temperature_c",
        _celsius_range(AIR_C),
        "degrees Fahrenheit",
        "",
        ("air_temperature_strange",),
    ),
    Plausible(
        "material.expansion_per_k",
        f"carbon steel {_expansion_range('carbon_steel')}, stainless"
        f" {_expansion_range('stainless_steel')}, aluminium"
        f" {_expansion_range('aluminium')}; needed unless the shell is of carbon steel",
        "ten times too small, the value of aluminium",
        "checks.shell; blank: carbon steel",
        ("constant_strange", "constant_missing"),
    ),
    Plausible(
        "material.e_gpa",
        "; ".join(f"{name} {low:g} to {high:g} GPa" for name, (low, high) in E_GPA.items())
        + "; needed under a liquid head unless the shell is of carbon steel",
        "the modulus of another metal",
        "checks.shell; blank: carbon steel",
        ("constant_strange", "constant_missing"),
    ),
    Plausible(
        "courses.thickness_mm",
        f"from {_thinnest('carbon_steel')} (stainless {_thinnest('stainless_steel')}), or 4.9 D h G"
        f" / {WATER_STRESS_MPA:g}, up to {THICK_MM:g} mm + {THICK_FACTOR:g}"
        f" times the larger of {CODE_MM:g} + {CODE_PER_M:g} D and 4.9 D h G / S (D"
        f" diameter, h shell above the course's bottom, m; G relative density, {LIGHT:g} to"
        f" {HEAVY:g} if not given; S {LEAST_STRESS_MPA['carbon_steel']:g} MPa,"
        f" stainless {LEAST_STRESS_MPA['stainless_steel']:g}, aluminium"
        f" {LEAST_STRESS_MPA['aluminium']:g})",
        "two or three times too thick or too thin, centimetres",
        "the liquid head on the plate",
        ("plate_thick", "plate_thin"),
    ),
    Plausible(
        "courses: their order",
        f"the top course at most {RISING_PLATES:g} times as thick as the bottom course; no"
        f" level ring of points within {1000 * NEAR_JOINT_M:g} mm of a joint",
        "courses from the top down, a wrong height",
        "plates, rings of points.csv",
        ("courses_top_down", "ring_on_joint"),
    ),
    Plausible(
        "courses.paint_mm",
        f"up to {PAINT_MM:g} mm; none where survey.side is inside",
        "another unit, inside for outside",
        "survey.side",
        ("paint_thick", "paint_of_inside"),
    ),
    Plausible(
        "horizontal.thickness_mm, sphere.thickness_mm",
        f"horizontal tank {_plate_range('horizontal')}; sphere {_plate_range('sphere')}; below"
        f" {LEAST_PLATE_MM:g} mm"
        " a problem",
        "ten times too thick or too thin, centimetres",
        "the diameter",
        ("solid_plate_thick", "solid_plate_thin", "solid_plate_tiny"),
    ),
    Plausible(
        "datum.bottom_z_m",
        f"with the courses {1000 * TOP_MISS_M:g} mm from checks.top_z_m; bottom points near"
        f" the wall within {RIM_MISS_M:g} m; at most {100 * OFF_SHELL:g} % of the"
        f" wall points over {1000 * OFF_SHELL_M:g} mm below the bottom or above the"
        " top course",
        "half a metre off",
        "checks.top_z_m, bottom.csv, the points of the wall",
        ("top_not_met", "rim_off", "points_off_shell"),
    ),
    Plausible(
        "datum.dip_plate_z_m",
        f"within {DIP_PLATE_M:g} m of the bottom, in a horizontal tank or a sphere also"
        f" within {DIP_PLATE:g} D; on a cone or a dish with a known dip point within"
        f" {PLATE_ON_BOTTOM_M:g} m and half the rise of the bottom there",
        "half a metre off",
        "the bottom",
        ("dip_plate_far", "dip_plate_off_bottom"),
    ),
    Plausible(
        "datum.reference_height_m",
        f"from {REFERENCE_BELOW_M:g} m below the tank's top to {REFERENCE_ABOVE_M:g}"
        f" m + {REFERENCE_ABOVE:g} D above",
        "below the shell's top, feet",
        "the top of the tank",
        ("reference_below_top", "reference_far_above"),
    ),
    Plausible(
        "bottom.centre_z_m",
        f"at most {SLOPE_UP:g} of the radius above the edge",
        "a cone up for down",
        "checks.bottom_slopes (problem; requested if blank), the dip plate",
        ("bottom_slopes_otherwise", "bottom_rises_much", "bottom_steep"),
    ),
    Plausible(
        "deadwood.volume_m3",
        "negative for coils, pipes, columns, stairs, mixers and all other names; positive for"
        " manholes, doors, domes, sumps; at most a tenth of the tank's volume over its height, a"
        " problem above the whole volume",
        "the wrong sign, litres",
        "the name, in English, Portuguese or Spanish; the tank between bottom_m and top_m",
        ("deadwood_takes", "deadwood_gives", "deadwood_sign_unsaid", "deadwood_large"),
    ),
    Plausible(
        "tank.nominal_diameter_m",
        f"{100 * SIZE_MISS:g} % + {1000 * SIZE_MISS_M:g} mm from a declared"
        " diameter; 1 in 500, or checks.diameter_within_mm, and 3 standard uncertainties from the"
        " diameter of any survey, for all courses together and each course (for points between"
        f" inside and outside if checks.diameter_is is blank); {100 * IMPOSSIBLE_MISS:g} %"
        " is a problem",
        "radius for diameter, feet, a wrong offset, scale or side",
        "declared sizes, inside radii of the survey",
        (
            *("size_unlike_drawing", "points_unlike_drawing", "points_too_wide"),
            *("course_unlike_drawing", "size_in_other_unit", "wall_unlike_nominal"),
            *("strapped_unlike_nominal", "rings_unlike_nominal", "sphere_unlike_nominal"),
            *("circumference_of_inside", "strapped_unlike_declared"),
        ),
    ),
    Plausible(
        "targets.offset_mm",
        "{:g} to {:g} mm; checks.targets raised {:g} to {:g} mm".format(
            *TARGET_MM[FLAT], *TARGET_MM[RAISED]
        ),
        "ten times too large, the constant of a prism",
        "checks.targets",
        ("target_offset_strange",),
    ),
    Plausible(
        "circumferences.reading_m, great_circles.reading_m",
        f"{100 * IMPOSSIBLE_MISS:g} % from the median of all readings (great circles 5"
        " %) and from the circumference of the drawing (larger: a problem); ten times the limit"
        " of repeats between readings of a circumference, and between circumferences of a course,"
        " ring or sphere; a course 1 in 1000 of the radius from the other courses; a ring a plate"
        " (half a plate if laps are given) and 1 in 500",
        "feet, a metre misread, transposed digits, a strap over a manhole",
        "each other, tank.nominal_diameter_m",
        (
            *("circle_of_other_size", "repeats_far", "strap_far", "strapped_course_far"),
            *("strap_contradicts_far", "strap_of_ring_far", "circle_contradicts_far", "ring_far"),
            *("strap_against_lines", "strip_upright", "weld_thick"),
        ),
    ),
    Plausible(
        "offsets.offset_mm",
        "offsets and steps between courses typical of instruments and plates",
        "centimetres, the wrong sign or side, levels from the top down",
        "plates, the line's side, circumferences.reading_m",
        ("offsets_small", "lines_of_inside", "lines_turned_about"),
    ),
    Plausible(
        "instruments.toml: certificates of tapes and other instruments",
        "corrections within the limits of verification; temperatures, tensions and cross-sections"
        " of existing tapes; offsets and scales within 3 standard uncertainties of the certificate"
        " if the wall or a tape determines them",
        "ppm, percent or degrees Fahrenheit, the constant of a prism, another tape",
        "the readings, circumferences.temperature_c, survey.shell_temperature_c",
        (
            *("tape_correction_strange", "tape_correction_mm_strange", "large_correction"),
            *("tape_in_fahrenheit", "tape_unlike_shell", "certified_temperature_strange"),
            *("tape_stiffness_strange", "pull_unlike_certificate", "comparisons_apart"),
            *("offset_strange", "offset_unlike_certificate", "scale_unlike_certificate"),
            "hits_ranged_otherwise",
        ),
    ),
    Plausible(
        "radius_m of radii.csv",
        f"{100 * DIAMETER_MISS:g} % + {500 * DIAMETER_MISS_M:g} mm from half of"
        f" tank.nominal_diameter_m; {100 * IMPOSSIBLE_MISS:g} % is a problem",
        "diameter for radius, feet",
        "the drawing",
        ("radius_unlike_drawing", "radius_impossible", "radius_is_diameter"),
    ),
    Plausible(
        "tank.nominal_volume_m3",
        f"{100 * VOLUME_MISS:g} % from the capacity",
        "any error with a large effect on the volume",
        "the capacity",
        ("not_nominal",),
    ),
    Plausible(
        "horizontal.length_m",
        f"{LENGTH_OVER_DIAMETER[0]:g} to {LENGTH_OVER_DIAMETER[1]:g} diameters; over"
        f" {MOST_LENGTH_OVER_DIAMETER:g}: a problem",
        "decimetres, feet",
        f"the diameter; checks.length_m within {100 * SIZE_MISS:g} % + {1000 * SIZE_MISS_M:g} mm",
        ("length_strange", "length_impossible"),
    ),
    Plausible(
        "horizontal.end_a_depth_m, horizontal.end_b_depth_m, top.depth_m",
        "as a fraction of the diameter: "
        + ", ".join(_depth_range(form) for form in END_DEPTH)
        + "; two ends of equal form differ by less than"
        f" {100 * (ENDS_DIFFER - 1):.0f} % or {1000 * ENDS_DIFFER_M:g} mm",
        "twice the depth, the dish's radius for its depth",
        "the diameter, the other end",
        ("end_depth_strange", "ends_differ"),
    ),
    Plausible(
        "horizontal.end_a_dish_radius_m, end_a_knuckle_radius_m, also of end B",
        f"dish {DISH_RADIUS[0]:g} to {DISH_RADIUS[1]:g}, knuckle"
        f" {KNUCKLE_RADIUS[0]:g} to {KNUCKLE_RADIUS[1]:g} diameters",
        "radius for diameter, twice the radius",
        "the diameter, the other end",
        ("end_radius_strange", "ends_differ"),
    ),
    Plausible(
        "horizontal.tilt_mm_per_m",
        "up to 50 mm/m",
        "degrees or percent",
        "",
        ("large_tilt",),
    ),
    Plausible(
        "horizontal.tube_angle_deg",
        f"up to {STRONG_ROLL_DEG:g} degrees",
        "the angle from the horizontal",
        "",
        ("large_roll",),
    ),
    Plausible(
        "sphere.diameter_m",
        f"up to {SPHERE_M:g} m",
        "feet",
        "tank.nominal_diameter_m",
        ("sphere_large",),
    ),
    Plausible(
        "roof.mass_kg",
        f"{ROOF_KG_M2[0]:g} to {ROOF_KG_M2[1]:g} kg per square metre of the tank",
        "tonnes",
        "tank.nominal_diameter_m",
        ("roof_mass_strange",),
    ),
    Plausible(
        "table.liquid_density_kg_m3 and all densities",
        f"{DENSITIES_KG_M3[0]:g} to {DENSITIES_KG_M3[1]:g} kg/m3",
        "g/cm3",
        "",
        ("strange_density",),
    ),
    Plausible(
        "points of a horizontal cylinder or a sphere",
        f"residuals (rms) up to {100 * MISFIT:g} % of the diameter +"
        f" {1000 * MISFIT_M:g} mm, and {MISFIT_SDS:g} times their declared"
        f" standard deviation; over {100 * IMPOSSIBLE_MISFIT:g} %: a problem",
        "one axis in another unit, points of another object",
        "the fitted shape",
        ("points_misfit", "points_beyond_sd", "points_make_no_shape"),
    ),
    Plausible(
        "survey.side",
        "set-ups and photographs on that side of the wall of a vertical tank, a horizontal"
        " cylinder or a sphere (problem)",
        "inside for outside",
        "the adjusted stations",
        ("stations_on_other_side",),
    ),
    Plausible(
        "checks.diameter_is",
        "if given, the inside diameter (of the first course) differs from the drawing by at most"
        f" {100 * DRAWN_MISS:g} % + {1000 * DRAWN_MISS_M:g} mm +"
        f" {CIRCUMFERENCE_SDS:g} standard uncertainties, and not by"
        f" {OTHER_SIDE[0]:g} to {OTHER_SIDE[1]:g} times two plates in the direction"
        " explained by the other side (tested if two plates are over"
        f" {2e6 * CIRCUMFERENCE_MISS:g} ppm of D + 6 standard uncertainties)",
        "inside for outside, plates two times off",
        "tank.nominal_diameter_m, plates and paint, survey.side",
        ("side_doubtful", "inside_unlike_drawing"),
    ),
    Plausible(
        "checks.circumference_m",
        f"{1e6 * CIRCUMFERENCE_MISS:g} ppm and {CIRCUMFERENCE_SDS:g} standard"
        " uncertainties from the circumference of the points",
        "inside for outside, a wrong scale, feet",
        "the outside of the first course; plate and paint are added to an inside survey",
        ("circumference_off",),
    ),
    Plausible(
        "check readings, distances between control points, bases by stadia",
        "4 standard deviations; no base is rejected",
        "slope distances 0.1 % too long, the length of another bar",
        "the adjusted survey",
        ("check_reading_off", "check_point_off", "control_scale", "base_rejected"),
    ),
    Plausible(
        "liquid.csv: meter_temperature_c, tank_temperature_c, shell_temperature_c",
        f"{_celsius_range(LIQUID_C[AMBIENT])}; checks.service heated"
        f" {_celsius_range(LIQUID_C[HEATED])}, refrigerated"
        f" {_celsius_range(LIQUID_C[REFRIGERATED])}; meter within"
        f" {METER_OVER_TANK_K:g} K of the liquid in the tank, shell within"
        f" {SHELL_OVER_LIQUID_K:g} K of it",
        "degrees Fahrenheit, columns exchanged",
        "each other",
        ("metered_temperature_strange", "temperatures_far_apart"),
    ),
    Plausible(
        "liquid.tank_temperature_c",
        f"within {TANK_C_STEP_K:g} K between successive dips",
        "stratified liquid, read at a single height",
        "the previous dip",
        ("tank_temperature_jumps",),
        verified=False,
    ),
    Plausible(
        "liquid.expansion_per_k",
        f"{LIQUID_EXPANSION_PER_K[0]:g} to {LIQUID_EXPANSION_PER_K[1]:g} 1/K",
        "the coefficient of the shell, ten times too small",
        "",
        ("liquid_expands_strangely",),
    ),
    Plausible(
        "meters.toml: factor_after",
        f"within {100 * METER_DRIFT:g} % of the previous factor, at most"
        f" {100 * MUCH_METER_DRIFT:g} %",
        "a meter that changed",
        "factor",
        ("meter_drifted", "meter_changed"),
        verified=False,
    ),
    Plausible(
        "control.csv: x_m, y_m of set-ups of hits without ties",
        "stated within 0.3 m if no course is strapped",
        "blank stations, which are assumed evenly spaced",
        "",
        ("places_assumed",),
    ),
    Plausible(
        "tank.nominal_diameter_m with lines.csv",
        "8 m or more",
        "a tank whose radius is small compared with the errors of offsets",
        "",
        ("too_small_for_lines",),
        verified=False,
    ),
    Plausible(
        "clouds.toml: s_translation_mm, s_rotation_arcsec",
        "pairs of scans agree within these values and the scanner's (significance 0.1 %), and so"
        " do all overlaps together (1 %)",
        "a displaced scan, a registration worse than declared",
        "the overlaps of the scans",
        ("scans_apart", "registration_beyond"),
    ),
    Plausible(
        "liquid.flow_m3_h",
        "within the flow range of the meter proving",
        "litres per minute, a nearly closed valve",
        "flow_min_m3_h, flow_max_m3_h of meters.toml",
        ("flow_out_of_range",),
        verified=False,
    ),
    Plausible(
        "liquid.volume_m3",
        f"standard deviation of a batch by its meter at most {100 * BATCH_SD:g} % of the"
        " batch; well above the bottom, or well within a horizontal tank, 0.7 to 1.4 times the"
        " nominal volume between its dips (most batches over 5 or under 0.2 times: a problem); no"
        " cause of a discrepancy between liquid and geometry beyond 6.6 standard deviations",
        "litres, gallons, barrels, a missing batch, a leaking valve, a misread dip",
        "meters.toml, nominal sizes",
        ("batch_too_small", "batch_unlike_sizes", "batches_in_other_unit", "liquid_far_because"),
    ),
)
CODES = frozenset(code for line in TABLE for code in line.codes)
