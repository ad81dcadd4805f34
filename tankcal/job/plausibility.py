"""Limits of plausible input and of quantities computed from it.

A number beyond a range causes a warning; an impossible number is a problem. The limits are chosen
by tankcal: wide enough for existing tanks, narrow enough to detect mistyped values. The table in
`tankcal.job.plausibility_table` describes them in words.
"""

import math

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
