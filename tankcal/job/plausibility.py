"""What is plausible: one table of ranges and cross-checks, for the checks and for the docs.

A number beyond a range is told as a warning, or as a problem where it cannot be at all; the limits
are tankcal's own choice, wide enough for what is built, narrow enough for a slip of the hand.
`docs/plausibility.md` shows TABLE, and a test holds the two together.
"""

from dataclasses import dataclass

from tankcal.messages import message

AMBIENT, HEATED, REFRIGERATED = SERVICES = ("ambient", "heated", "refrigerated")
CARBON_STEEL, STAINLESS_STEEL, ALUMINIUM = METALS = (
    "carbon_steel",
    "stainless_steel",
    "aluminium",
)
SHELLS = (*METALS, "other")
INSIDE, MIDDLE, OUTSIDE = DIAMETERS = ("inside", "middle", "outside")

MOST_YIELD_MPA = 2000  # of a shell's steel: more is pascals or psi

FIRST_YEAR = 1900  # of a survey
DAYS_AHEAD = 1  # of a survey, for time zones
YEARS_PLANNED = 10  # ahead, of a survey that is planned
DAYS_TO_ISSUE = 60  # a certificate may be prepared before its day

SHELL_C = {AMBIENT: (-35.0, 50.0), HEATED: (-35.0, 300.0), REFRIGERATED: (-200.0, 50.0)}
REFERENCE_C = {AMBIENT: (0.0, 40.0), HEATED: (0.0, 300.0), REFRIGERATED: (-200.0, 40.0)}
AIR_C = (-45.0, 48.0)
SHELL_OVER_AIR_K = (-15.0, 30.0)  # a shell at night and a shell in the sun

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

WATER_STRESS_MPA = 350.0  # in the thinnest plates
LEAST_STRESS_MPA = {"carbon_steel": 137.0, "stainless_steel": 120.0, "aluminium": 55.0}  # of design
LIGHT, HEAVY = 0.45, 1.0  # relative densities of the contents where the job gives none
THICK_MM, THICK_FACTOR = 6.5, 1.4  # what a course may have over what head and code need
CODE_MM, CODE_PER_M = 5.0, 0.08  # what codes ask for at least, by the diameter in metres
THIN_MM = {  # of a course: least and by the diameter in metres; the lesser of two lines
    "carbon_steel": ((2.0, 0.15), (4.0, 0.04)),
    "stainless_steel": ((1.0, 0.05), (1.0, 0.05)),
    "aluminium": ((2.0, 0.15), (4.0, 0.04)),
}
SOLID_PLATES_MM = {  # a lying cylinder or a sphere: least and most, each a + b times the diameter
    "horizontal": ((1.0, 0.4), (12.0, 8.0)),
    "sphere": ((1.0, 0.2), (6.0, 4.0)),
}
LEAST_PLATE_MM = 1.0
PAINT_MM = 2.0
RISING_PLATES = 1.1  # thickness of the top course over that of the bottom course

NEAR_JOINT_M = 0.025  # rings are surveyed on plates, not on welds
LEVEL_M, RING_GAP_M, MOST_RINGS = 0.03, 0.08, 60
TOP_MISS_M = 0.05
OFF_SHELL_M, OFF_SHELL, OFF_SHELL_POINTS = 0.05, 0.03, 5  # beyond an end; part of the points; least
NEAR_WALL = 0.005  # of the radius: such points are of the wall, not clutter
RIM, RIM_MISS_M = 0.8, 0.25  # bottom points beyond this part of the radius lie near bottom_z_m
DIP_PLATE_M, DIP_PLATE = 0.3, 0.05  # and of the diameter of a lying tank or a sphere
PLATE_ON_BOTTOM, PLATE_ON_BOTTOM_M = 0.5, 0.05  # of the rise at the dip point, and
SLOPE_UP = 0.04  # rise of a cone over the radius; 1:120 is usual, up to 1:25 is plausible
REFERENCE_BELOW_M, REFERENCE_ABOVE_M, REFERENCE_ABOVE = 0.05, 5.0, 0.2

DIAMETER_MISS, DIAMETER_MISS_M = 0.01, 0.02
SIZE_MISS, SIZE_MISS_M, IMPOSSIBLE_MISS = 0.01, 0.02, 0.3
VOLUME_MISS = 0.05
LENGTH_OVER_DIAMETER, MOST_LENGTH_OVER_DIAMETER = (0.4, 16.0), 40.0
END_DEPTH = {  # over the diameter
    "conical": (0.02, 0.3),
    "ellipsoidal": (0.12, 0.4),
    "spherical": (0.05, 0.22),
    "torispherical": (0.12, 0.3),
    "guppy": (0.05, 0.6),
}
STRONG_ROLL_DEG = 15.0  # of a gauge tube off the plumb
HEMISPHERE = 0.47
DISH_RADIUS, KNUCKLE_RADIUS = (0.7, 1.3), (0.03, 0.25)  # over the diameter
ENDS_DIFFER, ENDS_DIFFER_M = 1.2, 0.03
SPHERE_M = 50.0
DENSITIES_KG_M3 = (400.0, 2000.0)
ROOF_KG_M2 = (15.0, 500.0)

MISFIT, MISFIT_M, IMPOSSIBLE_MISFIT = 0.002, 0.010, 0.02  # rms of residuals, over the diameter
MISFIT_SDS = 3.0  # over the standard deviation that was given
CIRCUMFERENCE_MISS, CIRCUMFERENCE_SDS = 4e-4, 3.0
DRAWN_MISS, DRAWN_MISS_M = 1e-3, 0.004  # of an inside diameter that is known from the drawing
OTHER_SIDE = (0.6, 1.6)  # of two plates: a miss that the other side of the wall explains

LIQUID_C = {AMBIENT: (-30.0, 50.0), HEATED: (-30.0, 250.0), REFRIGERATED: (-200.0, 50.0)}
LIQUID_EXPANSION_PER_K = (5e-5, 2.5e-3)  # water at 8 degrees, liquefied gas
METER_OVER_TANK_K, SHELL_OVER_LIQUID_K = 10.0, 25.0
TANK_C_STEP_K = 2.0  # of the liquid in the tank from dip to dip
METER_DRIFT, MUCH_METER_DRIFT = 2e-4, 5e-4  # of a factor, before and after
BATCH_SD = 1e-3  # sd of a batch by its meter, over the batch

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


@dataclass(frozen=True)
class Plausible:
    """One line of the table.

    what     keys of job.toml and columns of tables, as they are written
    expected the plausible range, in words
    slip     what slip of the hand is told by it
    against  what the number is compared with
    codes    of the messages that tell it
    verified False: a limit of a standard that was read at second hand, not in its source
    """

    what: str
    expected: str
    slip: str
    against: str
    codes: tuple[str, ...]
    verified: bool = True


def least_course_mm(diameter_m, head_m, density=LIGHT, shell="carbon_steel"):
    """Plate that water stress of 350 MPa asks for, or what tanks of the metal are made of."""
    needed = _head_mm(diameter_m, head_m, density, WATER_STRESS_MPA)
    return max(min(a + b * diameter_m for a, b in THIN_MM[shell]), needed)


def most_course_mm(diameter_m, head_m, density=HEAVY, shell="carbon_steel"):
    """1.4 times what the least design stress or a code asks for, and 6.5 mm for corrosion."""
    needed = _head_mm(diameter_m, head_m, density, LEAST_STRESS_MPA[shell])
    return THICK_MM + THICK_FACTOR * max(CODE_MM + CODE_PER_M * diameter_m, needed)


def side_doubt(inside_m, nominal_m, drawn, plate_m, side, sd_m=0.0):
    """Message about an inside diameter against the drawing's, to the plate; None: plausible.

    inside_m  of the first course, as it was made of points or sizes, sd_m its standard deviation
    drawn     what nominal_m is: inside, middle or outside; plate_m with the paint, 0: not known
    side      that was declared: of a survey from the other one the miss is that of two plates
    """
    if drawn is None or nominal_m is None or (drawn != INSIDE and not plate_m):
        return None
    expected = nominal_m - {INSIDE: 0.0, MIDDLE: plate_m, OUTSIDE: 2 * plate_m}[drawn]
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
    """Message about a reference height against the dip of the top; None: plausible."""
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
    """Thickness under a liquid head: 1000 rho g H D / 2 over the stress, mm."""
    return 4.903 * density * diameter_m * head_m / stress_mpa


def _c(bounds):
    return f"{bounds[0]:g} to {bounds[1]:g} °C"


def _per_k(shell):
    low, high = EXPANSION_PER_K[shell]
    return f"{low:g} to {high:g} 1/K"


def _line(kind):
    (a, b), (c, d) = SOLID_PLATES_MM[kind]
    return f"({a:g} + {b:g} D) to ({c:g} + {d:g} D) mm, D in m"


def _thinnest(shell):
    a, b = THIN_MM[shell]
    lines = [f"{least:g} + {per_m:g} D" for least, per_m in dict.fromkeys((a, b))]
    return lines[0] + " mm" if len(lines) == 1 else f"the lesser of {' and '.join(lines)} mm"


def _of_ends(form):
    low, high = END_DEPTH[form]
    hemisphere = f" or {HEMISPHERE:g} to 0.5" if form == "spherical" else ""
    return f"{form} {low:g} to {high:g}{hemisphere}"


TABLE = (
    Plausible(
        "survey.date",
        f"year {FIRST_YEAR} to today, of a plan up to {YEARS_PLANNED} years ahead (problem)",
        "1024 for 2024, a day to come",
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
        f"{_c(SHELL_C[AMBIENT])}; checks.service heated {_c(SHELL_C[HEATED])}, refrigerated"
        f" {_c(SHELL_C[REFRIGERATED])}",
        "degrees Fahrenheit",
        f"checks.air_temperature_c: {SHELL_OVER_AIR_K[0]:g} to {SHELL_OVER_AIR_K[1]:+g} K from it",
        ("temperature_strange", "shell_unlike_air"),
    ),
    Plausible(
        "table.reference_temperature_c",
        f"{_c(REFERENCE_C[AMBIENT])}; checks.service heated {_c(REFERENCE_C[HEATED])}, refrigerated"
        f" {_c(REFERENCE_C[REFRIGERATED])}",
        "degrees Fahrenheit (68, 60, 59)",
        "checks.service",
        ("temperature_strange",),
    ),
    Plausible(
        "checks.air_temperature_c",
        _c(AIR_C),
        "degrees Fahrenheit",
        "",
        ("air_temperature_strange",),
    ),
    Plausible(
        "material.expansion_per_k",
        f"carbon steel {_per_k('carbon_steel')}, stainless {_per_k('stainless_steel')}, aluminium"
        f" {_per_k('aluminium')}; needed with a shell of another kind than carbon steel",
        "ten times too small, that of aluminium",
        "checks.shell; blank: carbon steel",
        ("constant_strange", "constant_missing"),
    ),
    Plausible(
        "material.e_gpa",
        "; ".join(f"{name} {low:g} to {high:g} GPa" for name, (low, high) in E_GPA.items())
        + "; needed under a liquid head with a shell of another kind than carbon steel",
        "that of another metal",
        "checks.shell; blank: carbon steel",
        ("constant_strange", "constant_missing"),
    ),
    Plausible(
        "courses.thickness_mm",
        f"from {_thinnest('carbon_steel')} (stainless {_thinnest('stainless_steel')}), or"
        f" 4.9 D h G / {WATER_STRESS_MPA:g}, up to {THICK_MM:g} mm + {THICK_FACTOR:g} times the"
        f" larger of {CODE_MM:g} + {CODE_PER_M:g} D and 4.9 D h G / S (D diameter, h shell above"
        f" the course's bottom, m; G relative density, {LIGHT:g} to {HEAVY:g} if not given; S"
        f" {LEAST_STRESS_MPA['carbon_steel']:g} MPa, stainless"
        f" {LEAST_STRESS_MPA['stainless_steel']:g}, aluminium {LEAST_STRESS_MPA['aluminium']:g})",
        "two or three times too thick or too thin, centimetres",
        "the head that the plate carries",
        ("plate_thick", "plate_thin"),
    ),
    Plausible(
        "courses: their order",
        f"the top course at most {RISING_PLATES:g} times as thick as the bottom one; no level ring"
        f" of points within {1000 * NEAR_JOINT_M:g} mm of a joint",
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
        f"lying {_line('horizontal')}; sphere {_line('sphere')}; below {LEAST_PLATE_MM:g} mm a"
        " problem",
        "ten times too thick, centimetres",
        "the diameter",
        ("solid_plate_strange", "solid_plate_tiny"),
    ),
    Plausible(
        "datum.bottom_z_m",
        f"with the courses {1000 * TOP_MISS_M:g} mm from checks.top_z_m; bottom points near the"
        f" wall within {RIM_MISS_M:g} m; at most {100 * OFF_SHELL:g} % of the points of the wall"
        f" over {1000 * OFF_SHELL_M:g} mm below the bottom or above the top course",
        "half a metre off",
        "checks.top_z_m, bottom.csv, the points of the wall",
        ("top_not_met", "rim_off", "points_off_shell"),
    ),
    Plausible(
        "datum.dip_plate_z_m",
        f"within {DIP_PLATE_M:g} m of the bottom, of a lying tank or a sphere within"
        f" {DIP_PLATE:g} D, too; with a cone or a dish and the place of the dip"
        f" point within {PLATE_ON_BOTTOM_M:g} m and half the rise of its surface there",
        "half a metre off",
        "the bottom",
        ("dip_plate_far", "dip_plate_off_bottom"),
    ),
    Plausible(
        "datum.reference_height_m",
        f"from {REFERENCE_BELOW_M:g} m below the tank's top to {REFERENCE_ABOVE_M:g} m + "
        f"{REFERENCE_ABOVE:g} D above",
        "below the shell's top, feet",
        "the top of shell or solid",
        ("reference_below_top", "reference_far_above"),
    ),
    Plausible(
        "bottom.centre_z_m",
        f"at most {SLOPE_UP:g} of the radius above the edge",
        "cone up for down",
        "checks.bottom_slopes (problem), asked for where it is blank; the dip plate",
        ("bottom_slopes_otherwise", "bottom_rises_much", "bottom_steep"),
    ),
    Plausible(
        "deadwood.volume_m3",
        "negative for coils, pipes, columns, stairs, mixers and whatever has another name; positive"
        " for manholes, doors, domes, sumps; at most a tenth of what the tank holds beside it, all"
        " of that a problem",
        "the wrong sign, litres",
        "the name, in English, Portuguese or Spanish; the tank between bottom_m and top_m",
        ("deadwood_takes", "deadwood_gives", "deadwood_sign_unsaid", "deadwood_large"),
    ),
    Plausible(
        "tank.nominal_diameter_m",
        f"{100 * SIZE_MISS:g} % + {1000 * SIZE_MISS_M:g} mm from the given diameter,"
        f" {100 * DIAMETER_MISS:g} % + {1000 * DIAMETER_MISS_M:g} mm from that of the points;"
        f" {100 * IMPOSSIBLE_MISS:g} % is a problem",
        "radius for diameter, feet",
        "sizes and points",
        ("size_unlike_drawing", "points_unlike_drawing", "points_too_wide"),
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
        "whatever moves the volume much",
        "the capacity",
        ("not_nominal",),
    ),
    Plausible(
        "horizontal.length_m",
        f"{LENGTH_OVER_DIAMETER[0]:g} to {LENGTH_OVER_DIAMETER[1]:g} diameters; over"
        f" {MOST_LENGTH_OVER_DIAMETER:g} a problem",
        "decimetres, feet",
        f"the diameter; checks.length_m within {100 * SIZE_MISS:g} % + {1000 * SIZE_MISS_M:g} mm",
        ("length_strange", "length_impossible"),
    ),
    Plausible(
        "horizontal.end_a_depth_m, horizontal.end_b_depth_m, top.depth_m",
        "over the diameter: "
        + ", ".join(_of_ends(form) for form in END_DEPTH)
        + "; two ends of one form differ by less than"
        f" {100 * (ENDS_DIFFER - 1):.0f} % or {1000 * ENDS_DIFFER_M:g} mm",
        "twice as deep, the dish's radius for its depth",
        "the diameter, the other end",
        ("end_depth_strange", "ends_differ"),
    ),
    Plausible(
        "horizontal.end_a_dish_radius_m, end_a_knuckle_radius_m and those of end B",
        f"dish {DISH_RADIUS[0]:g} to {DISH_RADIUS[1]:g}, knuckle {KNUCKLE_RADIUS[0]:g} to"
        f" {KNUCKLE_RADIUS[1]:g} diameters",
        "radius for diameter, twice as large",
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
        "the angle against the horizontal",
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
        f"{ROOF_KG_M2[0]:g} to {ROOF_KG_M2[1]:g} kg for a square metre of the tank",
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
        "points of a lying cylinder or a sphere",
        f"residuals (rms) up to {100 * MISFIT:g} % of the diameter + {1000 * MISFIT_M:g} mm, and"
        f" {MISFIT_SDS:g} times their given sd; over {100 * IMPOSSIBLE_MISFIT:g} % a problem",
        "one axis in another unit, points of something else",
        "the fitted shape",
        ("points_misfit", "points_beyond_sd", "points_make_no_shape"),
    ),
    Plausible(
        "survey.side",
        "set-ups and photographs on that side of the wall, be it of a vertical tank, a lying"
        " cylinder or a sphere (problem)",
        "inside for outside",
        "the adjusted stations",
        ("stations_on_other_side",),
    ),
    Plausible(
        "checks.diameter_is",
        f"with it the inside diameter (of the first course) within {100 * DRAWN_MISS:g} % +"
        f" {1000 * DRAWN_MISS_M:g} mm + {CIRCUMFERENCE_SDS:g} sd of the drawing's; not"
        f" {OTHER_SIDE[0]:g} to {OTHER_SIDE[1]:g} times two plates off, the way that the other side"
        f" explains, where two plates are over {2e6 * CIRCUMFERENCE_MISS:g} ppm of D + 6 sd",
        "inside for outside, plates two times off",
        "tank.nominal_diameter_m, plates and paint, survey.side",
        ("side_doubtful", "inside_unlike_drawing"),
    ),
    Plausible(
        "checks.circumference_m",
        f"{1e6 * CIRCUMFERENCE_MISS:g} ppm and {CIRCUMFERENCE_SDS:g} sd from that of the points",
        "inside for outside, a wrong scale, feet",
        "the first course, outside, plate and paint added where it was surveyed inside",
        ("circumference_off",),
    ),
    Plausible(
        "check readings, distances between control points",
        "4 sd",
        "slope distances 0.1 % too long",
        "the adjusted survey",
        ("check_reading_off", "check_point_off", "control_scale"),
    ),
    Plausible(
        "liquid.csv: meter_temperature_c, tank_temperature_c, shell_temperature_c",
        f"{_c(LIQUID_C[AMBIENT])}; checks.service heated {_c(LIQUID_C[HEATED])}, refrigerated"
        f" {_c(LIQUID_C[REFRIGERATED])}; meter within {METER_OVER_TANK_K:g} K of the liquid in the"
        f" tank, shell within {SHELL_OVER_LIQUID_K:g} K",
        "degrees Fahrenheit, columns exchanged",
        "one another",
        ("metered_temperature_strange", "temperatures_far_apart"),
    ),
    Plausible(
        "liquid.tank_temperature_c",
        f"from dip to dip within {TANK_C_STEP_K:g} K",
        "liquid in layers, read at one height",
        "the dip before it",
        ("tank_temperature_jumps",),
        verified=False,
    ),
    Plausible(
        "liquid.expansion_per_k",
        f"{LIQUID_EXPANSION_PER_K[0]:g} to {LIQUID_EXPANSION_PER_K[1]:g} 1/K",
        "that of the shell, ten times too small",
        "",
        ("liquid_expands_strangely",),
    ),
    Plausible(
        "meters.toml: factor_after",
        f"within {100 * METER_DRIFT:g} % of the factor before, at most"
        f" {100 * MUCH_METER_DRIFT:g} %",
        "a meter that changed",
        "factor",
        ("meter_drifted", "meter_changed"),
        verified=False,
    ),
    Plausible(
        "liquid.flow_m3_h",
        "within the range that the meter was proved for",
        "litres per minute, a valve hardly open",
        "flow_min_m3_h, flow_max_m3_h of meters.toml",
        ("flow_out_of_range",),
        verified=False,
    ),
    Plausible(
        "liquid.volume_m3",
        f"standard deviation of a batch by its meter at most {100 * BATCH_SD:g} % of it; well"
        " above a bottom and well within a lying tank 0.7 to 1.4 times what the nominal sizes hold"
        " between its dips, most of them over 5 or under 0.2 times a problem",
        "litres, gallons, barrels, a batch missing, a valve that passes, a dip misread",
        "meters.toml, nominal sizes",
        ("batch_too_small", "batch_unlike_sizes", "batches_in_other_unit"),
    ),
)
CODES = frozenset(code for one in TABLE for code in one.codes)
