"""Table of plausible ranges and cross-checks in words, with the codes of their messages.

`docs/plausibility.md` shows TABLE; a test compares both. `tankcal.job.plausibility` contains the
limits.
"""

from dataclasses import dataclass

from tankcal.job import plausibility as limits


@dataclass(frozen=True)
class Plausible:
    """One line of the table.

    Attributes
    ----------
    what : str
        Keys of job.toml and columns of tables, as written in the files.
    expected : str
        Plausible range.
    slip : str
        Mistake that the check detects.
    against : str
        Quantities that the number is compared with.
    codes : tuple of str
        Codes of the messages.
    verified : bool
        False: a limit of a standard that was read in a secondary source.
    """

    what: str
    expected: str
    slip: str
    against: str
    codes: tuple[str, ...]
    verified: bool = True


def _c(bounds):
    return f"{bounds[0]:g} to {bounds[1]:g} °C"


def _per_k(shell):
    low, high = limits.EXPANSION_PER_K[shell]
    return f"{low:g} to {high:g} 1/K"


def _line(kind):
    (a, b), (c, d) = limits.SOLID_PLATES_MM[kind]
    return f"({a:g} + {b:g} D) to ({c:g} + {d:g} D) mm, D in m"


def _thinnest(shell):
    a, b = limits.THIN_MM[shell]
    lines = [f"{least:g} + {per_m:g} D" for least, per_m in dict.fromkeys((a, b))]
    return lines[0] + " mm" if len(lines) == 1 else f"the lesser of {' and '.join(lines)} mm"


def _of_ends(form):
    low, high = limits.END_DEPTH[form]
    hemisphere = f" or {limits.HEMISPHERE:g} to 0.5" if form == "spherical" else ""
    return f"{form} {low:g} to {high:g}{hemisphere}"


TABLE = (
    Plausible(
        "survey.date",
        f"year {limits.FIRST_YEAR} to today, of a plan up to {limits.YEARS_PLANNED} years ahead"
        " (problem)",
        "1024 for 2024, a day to come",
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
        f"{_c(limits.SHELL_C[limits.AMBIENT])}; checks.service heated"
        f" {_c(limits.SHELL_C[limits.HEATED])}, refrigerated"
        f" {_c(limits.SHELL_C[limits.REFRIGERATED])}",
        "degrees Fahrenheit",
        f"checks.air_temperature_c: {limits.SHELL_OVER_AIR_K[0]:g} to"
        f" {limits.SHELL_OVER_AIR_K[1]:+g} K from it",
        ("temperature_strange", "shell_unlike_air"),
    ),
    Plausible(
        "table.reference_temperature_c",
        f"{_c(limits.REFERENCE_C[limits.AMBIENT])}; checks.service heated"
        f" {_c(limits.REFERENCE_C[limits.HEATED])}, refrigerated"
        f" {_c(limits.REFERENCE_C[limits.REFRIGERATED])}",
        "degrees Fahrenheit (68, 60, 59)",
        "checks.service",
        ("temperature_strange",),
    ),
    Plausible(
        "checks.air_temperature_c",
        _c(limits.AIR_C),
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
        "; ".join(f"{name} {low:g} to {high:g} GPa" for name, (low, high) in limits.E_GPA.items())
        + "; needed under a liquid head with a shell of another kind than carbon steel",
        "that of another metal",
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
        "the head that the plate carries",
        ("plate_thick", "plate_thin"),
    ),
    Plausible(
        "courses: their order",
        f"the top course at most {limits.RISING_PLATES:g} times as thick as the bottom one; no"
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
        f"lying {_line('horizontal')}; sphere {_line('sphere')}; below {limits.LEAST_PLATE_MM:g} mm"
        " a problem",
        "ten times too thick or too thin, centimetres",
        "the diameter",
        ("solid_plate_thick", "solid_plate_thin", "solid_plate_tiny"),
    ),
    Plausible(
        "datum.bottom_z_m",
        f"with the courses {1000 * limits.TOP_MISS_M:g} mm from checks.top_z_m; bottom points near"
        f" the wall within {limits.RIM_MISS_M:g} m; at most {100 * limits.OFF_SHELL:g} % of the"
        f" points of the wall over {1000 * limits.OFF_SHELL_M:g} mm below the bottom or above the"
        " top course",
        "half a metre off",
        "checks.top_z_m, bottom.csv, the points of the wall",
        ("top_not_met", "rim_off", "points_off_shell"),
    ),
    Plausible(
        "datum.dip_plate_z_m",
        f"within {limits.DIP_PLATE_M:g} m of the bottom, of a lying tank or a sphere within"
        f" {limits.DIP_PLATE:g} D, too; with a cone or a dish and the place of the dip point within"
        f" {limits.PLATE_ON_BOTTOM_M:g} m and half the rise of its surface there",
        "half a metre off",
        "the bottom",
        ("dip_plate_far", "dip_plate_off_bottom"),
    ),
    Plausible(
        "datum.reference_height_m",
        f"from {limits.REFERENCE_BELOW_M:g} m below the tank's top to {limits.REFERENCE_ABOVE_M:g}"
        f" m + {limits.REFERENCE_ABOVE:g} D above",
        "below the shell's top, feet",
        "the top of shell or solid",
        ("reference_below_top", "reference_far_above"),
    ),
    Plausible(
        "bottom.centre_z_m",
        f"at most {limits.SLOPE_UP:g} of the radius above the edge",
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
        f"{100 * limits.SIZE_MISS:g} % + {1000 * limits.SIZE_MISS_M:g} mm from a diameter among the"
        " sizes; 1 in 500, or checks.diameter_within_mm, and 3 sd from that of a survey by any"
        " method, of all courses and of each (of points between inside and outside where"
        f" checks.diameter_is is blank); {100 * limits.IMPOSSIBLE_MISS:g} % is a problem",
        "radius for diameter, feet, a wrong offset, scale or side",
        "sizes, inside radii of the survey",
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
        f"{100 * limits.IMPOSSIBLE_MISS:g} % from the median of all (great circles 5 %) and from"
        " the circumference by the drawing, more is a problem; ten times the limit of repeats from"
        " each other, and from others of a course, a ring or a sphere; a course that stands apart"
        " 1 in 1000 of the radius from the others, a ring a plate (half of one where laps are"
        " given) and 1 in 500",
        "feet, a metre misread, transposed digits, a strap over a manhole",
        "one another, tank.nominal_diameter_m",
        (
            *("circle_of_other_size", "repeats_far", "strap_far", "strapped_course_far"),
            *("strap_contradicts_far", "strap_of_ring_far", "circle_contradicts_far", "ring_far"),
            *("strap_against_lines", "strip_upright", "weld_thick"),
        ),
    ),
    Plausible(
        "offsets.offset_mm",
        "offsets and their steps from course to course as instruments and plates make them",
        "centimetres, the wrong sign or side, levels from the top down",
        "plates, the line's side, circumferences.reading_m",
        ("offsets_small", "lines_of_inside", "lines_turned_about"),
    ),
    Plausible(
        "instruments.toml: certificates of tapes and other instruments",
        "corrections within what a verification allows; temperatures, pulls and sections of tapes"
        " that there are; offsets and scales within 3 sd of the certificate where the wall or a"
        " tape determines them",
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
        "whatever moves the volume much",
        "the capacity",
        ("not_nominal",),
    ),
    Plausible(
        "horizontal.length_m",
        f"{limits.LENGTH_OVER_DIAMETER[0]:g} to {limits.LENGTH_OVER_DIAMETER[1]:g} diameters; over"
        f" {limits.MOST_LENGTH_OVER_DIAMETER:g} a problem",
        "decimetres, feet",
        f"the diameter; checks.length_m within {100 * limits.SIZE_MISS:g} % +"
        f" {1000 * limits.SIZE_MISS_M:g} mm",
        ("length_strange", "length_impossible"),
    ),
    Plausible(
        "horizontal.end_a_depth_m, horizontal.end_b_depth_m, top.depth_m",
        "over the diameter: "
        + ", ".join(_of_ends(form) for form in limits.END_DEPTH)
        + "; two ends of one form differ by less than"
        f" {100 * (limits.ENDS_DIFFER - 1):.0f} % or {1000 * limits.ENDS_DIFFER_M:g} mm",
        "twice as deep, the dish's radius for its depth",
        "the diameter, the other end",
        ("end_depth_strange", "ends_differ"),
    ),
    Plausible(
        "horizontal.end_a_dish_radius_m, end_a_knuckle_radius_m and those of end B",
        f"dish {limits.DISH_RADIUS[0]:g} to {limits.DISH_RADIUS[1]:g}, knuckle"
        f" {limits.KNUCKLE_RADIUS[0]:g} to {limits.KNUCKLE_RADIUS[1]:g} diameters",
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
        f"up to {limits.STRONG_ROLL_DEG:g} degrees",
        "the angle against the horizontal",
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
        f"{limits.ROOF_KG_M2[0]:g} to {limits.ROOF_KG_M2[1]:g} kg for a square metre of the tank",
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
        "points of a lying cylinder or a sphere",
        f"residuals (rms) up to {100 * limits.MISFIT:g} % of the diameter +"
        f" {1000 * limits.MISFIT_M:g} mm, and {limits.MISFIT_SDS:g} times their given sd; over"
        f" {100 * limits.IMPOSSIBLE_MISFIT:g} % a problem",
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
        f"with it the inside diameter (of the first course) within {100 * limits.DRAWN_MISS:g} % +"
        f" {1000 * limits.DRAWN_MISS_M:g} mm + {limits.CIRCUMFERENCE_SDS:g} sd of the drawing's;"
        f" not {limits.OTHER_SIDE[0]:g} to {limits.OTHER_SIDE[1]:g} times two plates off, the way"
        " that the other side explains, where two plates are over"
        f" {2e6 * limits.CIRCUMFERENCE_MISS:g} ppm of D + 6 sd",
        "inside for outside, plates two times off",
        "tank.nominal_diameter_m, plates and paint, survey.side",
        ("side_doubtful", "inside_unlike_drawing"),
    ),
    Plausible(
        "checks.circumference_m",
        f"{1e6 * limits.CIRCUMFERENCE_MISS:g} ppm and {limits.CIRCUMFERENCE_SDS:g} sd from that of"
        " the points",
        "inside for outside, a wrong scale, feet",
        "the first course, outside, plate and paint added where it was surveyed inside",
        ("circumference_off",),
    ),
    Plausible(
        "check readings, distances between control points, bases by stadia",
        "4 sd; no base is rejected",
        "slope distances 0.1 % too long, the length of another bar",
        "the adjusted survey",
        ("check_reading_off", "check_point_off", "control_scale", "base_rejected"),
    ),
    Plausible(
        "liquid.csv: meter_temperature_c, tank_temperature_c, shell_temperature_c",
        f"{_c(limits.LIQUID_C[limits.AMBIENT])}; checks.service heated"
        f" {_c(limits.LIQUID_C[limits.HEATED])}, refrigerated"
        f" {_c(limits.LIQUID_C[limits.REFRIGERATED])}; meter within {limits.METER_OVER_TANK_K:g} K"
        f" of the liquid in the tank, shell within {limits.SHELL_OVER_LIQUID_K:g} K",
        "degrees Fahrenheit, columns exchanged",
        "one another",
        ("metered_temperature_strange", "temperatures_far_apart"),
    ),
    Plausible(
        "liquid.tank_temperature_c",
        f"from dip to dip within {limits.TANK_C_STEP_K:g} K",
        "liquid in layers, read at one height",
        "the dip before it",
        ("tank_temperature_jumps",),
        verified=False,
    ),
    Plausible(
        "liquid.expansion_per_k",
        f"{limits.LIQUID_EXPANSION_PER_K[0]:g} to {limits.LIQUID_EXPANSION_PER_K[1]:g} 1/K",
        "that of the shell, ten times too small",
        "",
        ("liquid_expands_strangely",),
    ),
    Plausible(
        "meters.toml: factor_after",
        f"within {100 * limits.METER_DRIFT:g} % of the factor before, at most"
        f" {100 * limits.MUCH_METER_DRIFT:g} %",
        "a meter that changed",
        "factor",
        ("meter_drifted", "meter_changed"),
        verified=False,
    ),
    Plausible(
        "control.csv: x_m, y_m of stations of untied set-ups of hits",
        "given to 0.3 m where no course is strapped",
        "stations that were left blank and assumed to be evenly spaced",
        "",
        ("places_assumed",),
    ),
    Plausible(
        "clouds.toml: s_translation_mm, s_rotation_arcsec",
        "pairs of scans no further apart than these and the scanners allow (0.1 %), all overlaps"
        " together as well (1 %)",
        "a scan that moved, a registration worse than declared",
        "the overlaps of the scans",
        ("scans_apart", "registration_beyond"),
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
        f"standard deviation of a batch by its meter at most {100 * limits.BATCH_SD:g} % of it;"
        " well above a bottom and well within a lying tank 0.7 to 1.4 times what the nominal sizes"
        " hold between its dips, most of them over 5 or under 0.2 times a problem; no cause of"
        " liquid and geometry beyond 6.6 sd",
        "litres, gallons, barrels, a batch missing, a valve that passes, a dip misread",
        "meters.toml, nominal sizes",
        ("batch_too_small", "batch_unlike_sizes", "batches_in_other_unit", "liquid_far_because"),
    ),
)
CODES = frozenset(code for line in TABLE for code in line.codes)
