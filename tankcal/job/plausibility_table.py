"""Table of plausible ranges and cross-checks in words, with the codes of their messages.

`docs/plausible-values.md` shows TABLE; a test compares the two. The limits are defined in
`tankcal.job.plausibility`.
"""

from dataclasses import dataclass

from tankcal.job import plausibility as limits


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
    low, high = limits.EXPANSION_PER_K[shell]
    return f"{low:g} to {high:g} 1/K"


def _plate_range(kind):
    """Plausible plates of a kind of tank, two lines in the diameter D, as a text."""
    thinnest, thickest = limits.SOLID_PLATES_MM[kind]
    return (
        f"({thinnest[0]:g} + {thinnest[1]:g} D) to ({thickest[0]:g} + {thickest[1]:g} D) mm, D in m"
    )


def _thinnest(shell):
    """Least plate of a metal, the lesser of two lines in the diameter D, as a text."""
    lines = [f"{least:g} + {per_m:g} D" for least, per_m in dict.fromkeys(limits.THIN_MM[shell])]
    return lines[0] + " mm" if len(lines) == 1 else f"the lesser of {' and '.join(lines)} mm"


def _depth_range(form):
    """Plausible depths of an end over its diameter, as a text."""
    low, high = limits.END_DEPTH[form]
    hemisphere = f" or {limits.HEMISPHERE:g} to 0.5" if form == "spherical" else ""
    return f"{form} {low:g} to {high:g}{hemisphere}"


TABLE = (
    Plausible(
        "survey.date",
        f"year {limits.FIRST_YEAR} to today; for a plan up to {limits.YEARS_PLANNED} years ahead"
        " (problem)",
        "1024 for 2024, a date in the future",
        "today's date",
        ("survey_date_impossible",),
    ),
    Plausible(
        "certificate.date_of_issue",
        f"up to {limits.DAYS_TO_ISSUE} days from today",
        "a wrong year",
        "today's date, survey.date",
        ("issue_date_far",),
    ),
    Plausible(
        "survey.shell_temperature_c",
        f"{_celsius_range(limits.SHELL_C[limits.AMBIENT])}; checks.service heated"
        f" {_celsius_range(limits.SHELL_C[limits.HEATED])}, refrigerated"
        f" {_celsius_range(limits.SHELL_C[limits.REFRIGERATED])}",
        "degrees Fahrenheit",
        f"checks.air_temperature_c: {limits.SHELL_OVER_AIR_K[0]:g} to"
        f" {limits.SHELL_OVER_AIR_K[1]:+g} K from it",
        ("temperature_strange", "shell_unlike_air"),
    ),
    Plausible(
        "table.reference_temperature_c",
        f"{_celsius_range(limits.REFERENCE_C[limits.AMBIENT])}; checks.service heated"
        f" {_celsius_range(limits.REFERENCE_C[limits.HEATED])}, refrigerated"
        f" {_celsius_range(limits.REFERENCE_C[limits.REFRIGERATED])}",
        "degrees Fahrenheit (68, 60, 59)",
        "checks.service",
        ("temperature_strange",),
    ),
    Plausible(
        "checks.air_temperature_c",
        _celsius_range(limits.AIR_C),
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
        "; ".join(f"{name} {low:g} to {high:g} GPa" for name, (low, high) in limits.E_GPA.items())
        + "; needed under a liquid head unless the shell is of carbon steel",
        "the modulus of another metal",
        "checks.shell; blank: carbon steel",
        ("constant_strange", "constant_missing"),
    ),
    Plausible(
        "courses.thickness_mm",
        f"from {_thinnest('carbon_steel')} (stainless {_thinnest('stainless_steel')}), or 4.9 D h G"
        f" / {limits.WATER_STRESS_MPA:g}, up to {limits.THICK_MM:g} mm + {limits.THICK_FACTOR:g}"
        f" times the larger of {limits.CODE_MM:g} + {limits.CODE_PER_M:g} D and 4.9 D h G / S (D"
        f" diameter, h shell above the course's bottom, m; G relative density, {limits.LIGHT:g} to"
        f" {limits.HEAVY:g} if not given; S {limits.LEAST_STRESS_MPA['carbon_steel']:g} MPa,"
        f" stainless {limits.LEAST_STRESS_MPA['stainless_steel']:g}, aluminium"
        f" {limits.LEAST_STRESS_MPA['aluminium']:g})",
        "two or three times too thick or too thin, centimetres",
        "the liquid head on the plate",
        ("plate_thick", "plate_thin"),
    ),
    Plausible(
        "courses: their order",
        f"the top course at most {limits.RISING_PLATES:g} times as thick as the bottom course; no"
        f" level ring of points within {1000 * limits.NEAR_JOINT_M:g} mm of a joint",
        "courses from the top down, a wrong height",
        "plates, rings of points.csv",
        ("courses_top_down", "ring_on_joint"),
    ),
    Plausible(
        "courses.paint_mm",
        f"up to {limits.PAINT_MM:g} mm; none where survey.side is inside",
        "another unit, inside for outside",
        "survey.side",
        ("paint_thick", "paint_of_inside"),
    ),
    Plausible(
        "horizontal.thickness_mm, sphere.thickness_mm",
        f"horizontal tank {_plate_range('horizontal')}; sphere {_plate_range('sphere')}; below"
        f" {limits.LEAST_PLATE_MM:g} mm"
        " a problem",
        "ten times too thick or too thin, centimetres",
        "the diameter",
        ("solid_plate_thick", "solid_plate_thin", "solid_plate_tiny"),
    ),
    Plausible(
        "datum.bottom_z_m",
        f"with the courses {1000 * limits.TOP_MISS_M:g} mm from checks.top_z_m; bottom points near"
        f" the wall within {limits.RIM_MISS_M:g} m; at most {100 * limits.OFF_SHELL:g} % of the"
        f" wall points over {1000 * limits.OFF_SHELL_M:g} mm below the bottom or above the"
        " top course",
        "half a metre off",
        "checks.top_z_m, bottom.csv, the points of the wall",
        ("top_not_met", "rim_off", "points_off_shell"),
    ),
    Plausible(
        "datum.dip_plate_z_m",
        f"within {limits.DIP_PLATE_M:g} m of the bottom, in a horizontal tank or a sphere also"
        f" within {limits.DIP_PLATE:g} D; on a cone or a dish with a known dip point within"
        f" {limits.PLATE_ON_BOTTOM_M:g} m and half the rise of the bottom there",
        "half a metre off",
        "the bottom",
        ("dip_plate_far", "dip_plate_off_bottom"),
    ),
    Plausible(
        "datum.reference_height_m",
        f"from {limits.REFERENCE_BELOW_M:g} m below the tank's top to {limits.REFERENCE_ABOVE_M:g}"
        f" m + {limits.REFERENCE_ABOVE:g} D above",
        "below the shell's top, feet",
        "the top of the tank",
        ("reference_below_top", "reference_far_above"),
    ),
    Plausible(
        "bottom.centre_z_m",
        f"at most {limits.SLOPE_UP:g} of the radius above the edge",
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
        f"{100 * limits.SIZE_MISS:g} % + {1000 * limits.SIZE_MISS_M:g} mm from a declared"
        " diameter; 1 in 500, or checks.diameter_within_mm, and 3 standard uncertainties from the"
        " diameter of any survey, for all courses together and each course (for points between"
        f" inside and outside if checks.diameter_is is blank); {100 * limits.IMPOSSIBLE_MISS:g} %"
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
            *limits.TARGET_MM[limits.FLAT], *limits.TARGET_MM[limits.RAISED]
        ),
        "ten times too large, the constant of a prism",
        "checks.targets",
        ("target_offset_strange",),
    ),
    Plausible(
        "circumferences.reading_m, great_circles.reading_m",
        f"{100 * limits.IMPOSSIBLE_MISS:g} % from the median of all readings (great circles 5"
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
        f"{100 * limits.DIAMETER_MISS:g} % + {500 * limits.DIAMETER_MISS_M:g} mm from half of"
        f" tank.nominal_diameter_m; {100 * limits.IMPOSSIBLE_MISS:g} % is a problem",
        "diameter for radius, feet",
        "the drawing",
        ("radius_unlike_drawing", "radius_impossible", "radius_is_diameter"),
    ),
    Plausible(
        "tank.nominal_volume_m3",
        f"{100 * limits.VOLUME_MISS:g} % from the capacity",
        "any error with a large effect on the volume",
        "the capacity",
        ("not_nominal",),
    ),
    Plausible(
        "horizontal.length_m",
        f"{limits.LENGTH_OVER_DIAMETER[0]:g} to {limits.LENGTH_OVER_DIAMETER[1]:g} diameters; over"
        f" {limits.MOST_LENGTH_OVER_DIAMETER:g}: a problem",
        "decimetres, feet",
        f"the diameter; checks.length_m within {100 * limits.SIZE_MISS:g} % +"
        f" {1000 * limits.SIZE_MISS_M:g} mm",
        ("length_strange", "length_impossible"),
    ),
    Plausible(
        "horizontal.end_a_depth_m, horizontal.end_b_depth_m, top.depth_m",
        "as a fraction of the diameter: "
        + ", ".join(_depth_range(form) for form in limits.END_DEPTH)
        + "; two ends of equal form differ by less than"
        f" {100 * (limits.ENDS_DIFFER - 1):.0f} % or {1000 * limits.ENDS_DIFFER_M:g} mm",
        "twice the depth, the dish's radius for its depth",
        "the diameter, the other end",
        ("end_depth_strange", "ends_differ"),
    ),
    Plausible(
        "horizontal.end_a_dish_radius_m, end_a_knuckle_radius_m, also of end B",
        f"dish {limits.DISH_RADIUS[0]:g} to {limits.DISH_RADIUS[1]:g}, knuckle"
        f" {limits.KNUCKLE_RADIUS[0]:g} to {limits.KNUCKLE_RADIUS[1]:g} diameters",
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
        f"up to {limits.STRONG_ROLL_DEG:g} degrees",
        "the angle from the horizontal",
        "",
        ("large_roll",),
    ),
    Plausible(
        "sphere.diameter_m",
        f"up to {limits.SPHERE_M:g} m",
        "feet",
        "tank.nominal_diameter_m",
        ("sphere_large",),
    ),
    Plausible(
        "roof.mass_kg",
        f"{limits.ROOF_KG_M2[0]:g} to {limits.ROOF_KG_M2[1]:g} kg per square metre of the tank",
        "tonnes",
        "tank.nominal_diameter_m",
        ("roof_mass_strange",),
    ),
    Plausible(
        "table.liquid_density_kg_m3 and all densities",
        f"{limits.DENSITIES_KG_M3[0]:g} to {limits.DENSITIES_KG_M3[1]:g} kg/m3",
        "g/cm3",
        "",
        ("strange_density",),
    ),
    Plausible(
        "points of a horizontal cylinder or a sphere",
        f"residuals (rms) up to {100 * limits.MISFIT:g} % of the diameter +"
        f" {1000 * limits.MISFIT_M:g} mm, and {limits.MISFIT_SDS:g} times their declared"
        f" standard deviation; over {100 * limits.IMPOSSIBLE_MISFIT:g} %: a problem",
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
        f" {100 * limits.DRAWN_MISS:g} % + {1000 * limits.DRAWN_MISS_M:g} mm +"
        f" {limits.CIRCUMFERENCE_SDS:g} standard uncertainties, and not by"
        f" {limits.OTHER_SIDE[0]:g} to {limits.OTHER_SIDE[1]:g} times two plates in the direction"
        " explained by the other side (tested if two plates are over"
        f" {2e6 * limits.CIRCUMFERENCE_MISS:g} ppm of D + 6 standard uncertainties)",
        "inside for outside, plates two times off",
        "tank.nominal_diameter_m, plates and paint, survey.side",
        ("side_doubtful", "inside_unlike_drawing"),
    ),
    Plausible(
        "checks.circumference_m",
        f"{1e6 * limits.CIRCUMFERENCE_MISS:g} ppm and {limits.CIRCUMFERENCE_SDS:g} standard"
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
        f"{_celsius_range(limits.LIQUID_C[limits.AMBIENT])}; checks.service heated"
        f" {_celsius_range(limits.LIQUID_C[limits.HEATED])}, refrigerated"
        f" {_celsius_range(limits.LIQUID_C[limits.REFRIGERATED])}; meter within"
        f" {limits.METER_OVER_TANK_K:g} K of the liquid in the tank, shell within"
        f" {limits.SHELL_OVER_LIQUID_K:g} K of it",
        "degrees Fahrenheit, columns exchanged",
        "each other",
        ("metered_temperature_strange", "temperatures_far_apart"),
    ),
    Plausible(
        "liquid.tank_temperature_c",
        f"within {limits.TANK_C_STEP_K:g} K between successive dips",
        "stratified liquid, read at a single height",
        "the previous dip",
        ("tank_temperature_jumps",),
        verified=False,
    ),
    Plausible(
        "liquid.expansion_per_k",
        f"{limits.LIQUID_EXPANSION_PER_K[0]:g} to {limits.LIQUID_EXPANSION_PER_K[1]:g} 1/K",
        "the coefficient of the shell, ten times too small",
        "",
        ("liquid_expands_strangely",),
    ),
    Plausible(
        "meters.toml: factor_after",
        f"within {100 * limits.METER_DRIFT:g} % of the previous factor, at most"
        f" {100 * limits.MUCH_METER_DRIFT:g} %",
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
        f"standard deviation of a batch by its meter at most {100 * limits.BATCH_SD:g} % of the"
        " batch; well above the bottom, or well within a horizontal tank, 0.7 to 1.4 times the"
        " nominal volume between its dips (most batches over 5 or under 0.2 times: a problem); no"
        " cause of a discrepancy between liquid and geometry beyond 6.6 standard deviations",
        "litres, gallons, barrels, a missing batch, a leaking valve, a misread dip",
        "meters.toml, nominal sizes",
        ("batch_too_small", "batch_unlike_sizes", "batches_in_other_unit", "liquid_far_because"),
    ),
)
CODES = frozenset(code for line in TABLE for code in line.codes)
