"""Plausibility of single numbers: ranges and cross-checks of shell, liquid, datum and table.

Plausibility of the shell: temperatures, constants of its metal, plates and paint.

Plates are compared with the liquid head, the diameter and other plates.
"""

import datetime

import numpy as np

from tankcal.job.checking import (
    course_heights,
    has_rows,
    is_not_given,
    loads_the_shell,
    places_of,
    tell,
)
from tankcal.job.checks.extent import is_strapped, may_be_seen_from_both_sides
from tankcal.job.checks.settings import bottoms_z
from tankcal.job.contract.bottom import STEEP_FACTOR
from tankcal.job.plausibility import (
    AIR_C,
    AMBIENT,
    CARBON_STEEL,
    DAYS_AHEAD,
    DAYS_TO_ISSUE,
    DIP_PLATE,
    DIP_PLATE_M,
    DISH_RADIUS,
    E_GPA,
    END_DEPTH,
    ENDS_DIFFER,
    ENDS_DIFFER_M,
    EXPANSION_PER_K,
    FIRST_YEAR,
    FLAT,
    HEAVY,
    HEMISPHERE,
    IMPOSSIBLE_MISS,
    KNUCKLE_RADIUS,
    LEAST_PLATE_MM,
    LEAST_STRESS_MPA,
    LENGTH_OVER_DIAMETER,
    LEVEL_M,
    LIGHT,
    MIN_POINTS_PER_COURSE,
    MOST_LENGTH_OVER_DIAMETER,
    MOST_RINGS,
    NEAR_JOINT_M,
    PAINT_MM,
    RAISED,
    REFERENCE_C,
    RIM,
    RIM_MISS_M,
    RING_GAP_M,
    RISING_PLATES,
    SHELL_C,
    SHELL_OVER_AIR_K,
    SIZE_MISS,
    SIZE_MISS_M,
    SLOPE_UP,
    SOLID_PLATES_MM,
    SPHERE_M,
    TARGET_MM,
    TOP_MISS_M,
    YEARS_PLANNED,
    least_course_mm,
    most_course_mm,
    reference_doubt,
    side_doubt,
)
from tankcal.messages import message
from tankcal.tank.tips import FORMS as HEADS

FAHRENHEIT_ZERO, FAHRENHEIT_STEP = 32.0, 5 / 9
WATER_KG_M3 = 1000.0


def check_material(values, kind, raw, log):
    """Check temperatures for the service, and constants for the metal; as `check_plausible`."""
    _check_temperatures(values, raw, log)
    shell = values["checks"]["shell"] or CARBON_STEEL
    _check_expansion(values, shell, raw, log)
    if kind == "vertical":
        _check_modulus(values, shell, raw, log)


def _celsius(fahrenheit):
    return (fahrenheit - FAHRENHEIT_ZERO) * FAHRENHEIT_STEP


def _is_outside(value, bounds):
    return value is not None and not bounds[0] <= value <= bounds[1]


def _check_temperatures(values, raw, log):
    service = values["checks"]["service"] or AMBIENT
    shell, air = values["survey"]["shell_temperature_c"], values["checks"]["air_temperature_c"]
    reference = values["table"]["reference_temperature_c"]
    if _is_outside(air, AIR_C):
        text = message(
            "air_temperature_strange",
            "{found_c:g} degC in the air, expected {low_c:g} to {high_c:g}: in degrees Fahrenheit,"
            " which would be {celsius_c:.1f} degC?",
            found_c=air,
            low_c=AIR_C[0],
            high_c=AIR_C[1],
            celsius_c=_celsius(air),
        )
        tell(log.warning, raw, "checks", "air_temperature_c", text)
    _check_range(reference, REFERENCE_C[service], "table", "reference_temperature_c", raw, log)
    if _check_range(shell, SHELL_C[service], "survey", "shell_temperature_c", raw, log):
        _check_beside_air(shell, air, service, raw, log)


def _check_range(found, bounds, section, key, raw, log):
    """Return False, after a warning, if a temperature is implausible for the service."""
    if not _is_outside(found, bounds):
        return True
    text = message(
        "temperature_strange",
        "{found_c:g} degC, expected {low_c:g} to {high_c:g}: in degrees Fahrenheit, which would be"
        " {celsius_c:.1f} degC? For a tank that is hot or cold by its service, say so in"
        " checks.service",
        found_c=found,
        low_c=bounds[0],
        high_c=bounds[1],
        celsius_c=_celsius(found),
    )
    tell(log.warning, raw, section, key, text)
    return False


def _check_beside_air(shell, air, service, raw, log):
    if (
        None not in (shell, air)
        and service == AMBIENT
        and _is_outside(shell - air, SHELL_OVER_AIR_K)
    ):
        text = message(
            "shell_unlike_air",
            "{found_c:g} degC, and the air had {air_c:g} (checks.air_temperature_c): expected"
            " {low_k:g} to {high_k:+g} K from it; is one of them in degrees Fahrenheit?",
            found_c=shell,
            air_c=air,
            low_k=SHELL_OVER_AIR_K[0],
            high_k=SHELL_OVER_AIR_K[1],
        )
        tell(log.warning, raw, "survey", "shell_temperature_c", text)


def _check_expansion(values, shell, raw, log):
    found, bounds = values["material"]["expansion_per_k"], EXPANSION_PER_K.get(shell)
    if found is None:
        corrected = values["survey"]["shell_temperature_c"] is not None
        if corrected and values["corrections"]["temperature"] is not False:
            _check_given("expansion_per_k", shell, raw, log)
    elif bounds is not None and _is_outside(found, bounds):
        others = [
            metal for metal in EXPANSION_PER_K if not _is_outside(found, EXPANSION_PER_K[metal])
        ]
        hint = message("power_of_ten", "is a digit or a power of ten wrong?")
        if others:
            hint = message(
                "is_of_metal",
                "is the shell of {shell}? Then say so in checks.shell",
                shell=others[0],
            )
        _tell_strange("expansion_per_k", "1/K", found, bounds, shell, hint, raw, log)


def _check_modulus(values, shell, raw, log):
    found, bounds = values["material"]["e_gpa"], E_GPA.get(shell)
    if found is None:
        if loads_the_shell(values) or values["survey"]["liquid_level_m"]:
            _check_given("e_gpa", shell, raw, log)
    elif bounds is not None and _is_outside(found, bounds):
        hint = message("another_metal", "is it another metal? Then say so in checks.shell")
        _tell_strange("e_gpa", "GPa", found, bounds, shell, hint, raw, log)


def _check_given(key, shell, raw, log):
    if shell == CARBON_STEEL or not is_not_given(raw, "material", key):
        return
    text = message(
        "constant_missing",
        "missing; expected the value of {shell}: where it is blank, that of carbon steel is taken",
        shell=shell,
    )
    tell(log.problem, raw, "material", key, text)


def _tell_strange(key, unit, found, bounds, shell, hint, raw, log):
    text = message(
        "constant_strange",
        "{found:g} {unit}, expected {low:g} to {high:g} for {shell}: {hint}",
        found=found,
        unit=unit,
        low=bounds[0],
        high=bounds[1],
        shell=shell,
        hint=hint,
    )
    tell(log.warning, raw, "material", key, text)


def check_plates(values, tables, kind, raw, log):
    """Check the plates of courses, or of a lying cylinder or a sphere."""
    courses = tables["courses"]
    if kind == "vertical" and courses is not None:
        _check_courses(values, courses, log)
        is_outside_seen = is_strapped(tables) or may_be_seen_from_both_sides(tables)
        _check_paint(values, courses, is_outside_seen, log)
    elif kind in SOLID_PLATES_MM:
        _check_solid(values, kind, raw, log)


def _check_courses(values, courses, log):
    diameter, heights = values["tank"]["nominal_diameter_m"], course_heights(courses)
    thickness = courses.of("thickness_mm")
    if None in (diameter, heights) or None in thickness:
        return
    given = values["table"]["liquid_density_kg_m3"] or 0.0
    heaviest = max(HEAVY, given / WATER_KG_M3)
    lightest = given / WATER_KG_M3 if given else LIGHT
    above = np.cumsum(heights[::-1])[::-1]
    shell = values["checks"]["shell"] or CARBON_STEEL
    for row, plate, head in zip(courses.rows, thickness, above.tolist(), strict=True):
        if shell not in LEAST_STRESS_MPA or plate == 0:
            continue
        least = least_course_mm(diameter, head, lightest, shell)
        most = most_course_mm(diameter, head, heaviest, shell)
        text = None
        if plate > most:
            text = message(
                "plate_thick",
                "{found_mm:g} mm, expected at most {limit_mm:.3g} mm for {head_m:.4g} m of shell"
                " above it and a diameter of {diameter_m:g} m: two or ten times too thick?",
                **_course_values(plate, most, head, diameter),
            )
        elif plate < least:
            text = message(
                "plate_thin",
                "{found_mm:g} mm, expected {limit_mm:.3g} mm or more for {head_m:.4g} m of shell "
                "above it and a diameter of {diameter_m:g} m: is it in centimetres, or half of it?",
                **_course_values(plate, least, head, diameter),
            )
        if text is not None:
            log.warning(courses.file, text, row, "thickness_mm")
    if thickness and 0 < RISING_PLATES * thickness[0] < thickness[-1]:
        text = message(
            "courses_top_down",
            "the plates grow thicker upwards, from {first_mm:g} to {last_mm:g} mm; expected "
            "the courses from the bottom up: are they listed from the top down?",
            first_mm=thickness[0],
            last_mm=thickness[-1],
        )
        log.warning(courses.file, text, courses.rows[0], "thickness_mm")


def _course_values(plate, limit, head, diameter):
    return {"found_mm": plate, "limit_mm": limit, "head_m": head, "diameter_m": diameter}


def _check_paint(values, courses, is_outside_seen, log):
    paints = courses.of("paint_mm")
    for row, paint in zip(courses.rows, paints, strict=True):
        if paint is not None and paint > PAINT_MM:
            text = message(
                "paint_thick",
                "{found_mm:g} mm of paint, expected at most {most_mm:g}: is it in another unit?",
                found_mm=paint,
                most_mm=PAINT_MM,
            )
            log.warning(courses.file, text, row, "paint_mm")
    is_subtracted = values["survey"]["side"] != "inside" or is_outside_seen
    if not is_subtracted and any(paints):
        text = message(
            "paint_of_inside",
            "paint is given, which is subtracted only from what was measured outside, but "
            "survey.side is inside: was it measured outside?",
        )
        log.warning(courses.file, text, None, "paint_mm")


def _check_solid(values, kind, raw, log):
    given, nominal = values[kind], values["tank"]["nominal_diameter_m"]
    diameter = given["diameter_m"] or nominal
    if kind == "horizontal":
        diameter = given["height_m"] or diameter
    plate = given["thickness_mm"]
    if not plate:
        return
    if plate < LEAST_PLATE_MM:
        text = message(
            "solid_plate_tiny",
            "found {found_mm:g}; expected millimetres, 0 or at least {least_mm:g}: in centimetres"
            " or metres?",
            found_mm=plate,
            least_mm=LEAST_PLATE_MM,
        )
        tell(log.problem, raw, kind, "thickness_mm", text)
        return
    if diameter is None or values["checks"]["shell"] == "other":
        return
    least, most = (a + b * diameter for a, b in SOLID_PLATES_MM[kind])
    if plate > most:
        text = message(
            "solid_plate_thick",
            "{found_mm:g} mm, expected {least_mm:.3g} to {most_mm:.3g} mm for a diameter of"
            " {diameter_m:g} m: two or ten times too thick, or with the insulation?",
            **_solid_values(plate, least, most, diameter),
        )
    elif plate < least:
        text = message(
            "solid_plate_thin",
            "{found_mm:g} mm, expected {least_mm:.3g} to {most_mm:.3g} mm for a diameter of"
            " {diameter_m:g} m: ten times too thin, or in centimetres?",
            **_solid_values(plate, least, most, diameter),
        )
    else:
        return
    tell(log.warning, raw, kind, "thickness_mm", text)


def _solid_values(plate, least, most, diameter):
    return {"found_mm": plate, "least_mm": least, "most_mm": most, "diameter_m": diameter}


# ---- plausibility of dates and of the heights of bottom, dip plate, shell top and reference


# Dates of survey and issue, compared with today.


def check_dates(values, raw, log):
    """Check the dates of survey and issue.

    A survey lies in the past, after the first tank calibrations; a planned survey may lie in the
    future. The date of issue is close to today.
    """
    today = datetime.date.today()
    surveyed = _day(values["survey"]["date"])
    is_late = surveyed is not None and (surveyed - today).days > DAYS_AHEAD
    if raw.is_planned and is_late:
        if surveyed.year > today.year + YEARS_PLANNED:
            text = message(
                "survey_date_far",
                "found {found}; expected a day within {years} years of today, {today}",
                found=surveyed.isoformat(),
                years=YEARS_PLANNED,
                today=today.isoformat(),
            )
            tell(log.problem, raw, "survey", "date", text)
    elif is_late or (surveyed is not None and surveyed.year < FIRST_YEAR):
        text = message(
            "survey_date_impossible",
            "found {found}; expected a day from the year {first} to today, {today}",
            found=surveyed.isoformat(),
            first=str(FIRST_YEAR),
            today=today.isoformat(),
        )
        tell(log.problem, raw, "survey", "date", text)
    issued = _day(values["certificate"].get("date_of_issue"))
    if issued is not None and (issued - today).days > DAYS_TO_ISSUE:
        text = message(
            "issue_date_far",
            "{found} is {days} days from today: is the year right?",
            found=issued.isoformat(),
            days=(issued - today).days,
        )
        tell(log.warning, raw, "certificate", "date_of_issue", text)


def _day(text):
    return None if text is None else datetime.date.fromisoformat(text)


MIN_RIM = 6  # smallest number of bottom points near the wall


def check_levels(values, tables, extent, kind, raw, log):
    """Check the heights of the datum; parameters as for `checks.check_tank`."""
    _check_dip_plate(values, tables, extent, kind, raw, log)
    _check_reference(values, extent, raw, log)
    if kind == "vertical":
        _check_top(values, raw, log)
        _check_slope(values, raw, log)
        if has_rows(tables["bottom"]):
            _check_rim(values, tables["bottom"], log)


def _check_reference(values, extent, raw, log):
    reference = values["datum"]["reference_height_m"]
    if None in (reference, extent.top_m):
        return
    text = reference_doubt(reference, extent.top_m, values["tank"]["nominal_diameter_m"])
    if text is not None:
        tell(log.warning, raw, "datum", "reference_height_m", text)


def _check_dip_plate(values, tables, extent, kind, raw, log):
    plate, bottoms = values["datum"]["dip_plate_z_m"], bottoms_z(values, tables, kind)
    if plate is None or not bottoms:
        return
    away = max(plate - max(bottoms), min(bottoms) - plate)
    most = DIP_PLATE_M
    if kind in ("horizontal", "sphere") and extent.height_m is not None:
        most = min(most, DIP_PLATE * extent.height_m)
    if away > most * (1 + 1e-9):
        text = message(
            "dip_plate_far",
            "{away_m:.3g} m from the bottom, expected at most {most_m:.3g} m: all dips of "
            "the table count from it",
            away_m=away,
            most_m=most,
        )
        tell(log.warning, raw, "datum", "dip_plate_z_m", text)


def _check_top(values, raw, log):
    top, bottom = values["checks"]["top_z_m"], values["datum"]["bottom_z_m"]
    height = values["tank"]["nominal_height_m"]
    if None in (top, bottom, height) or abs(bottom + height - top) <= TOP_MISS_M:
        return
    text = message(
        "top_not_met",
        "with tank.nominal_height_m = {height_m:g} m the shell ends at z = {end_m:.4g} m, "
        "checks.top_z_m is {top_m:.4g} m: they differ by {miss_m:+.3f} m",
        height_m=height,
        end_m=bottom + height,
        top_m=top,
        miss_m=bottom + height - top,
    )
    tell(log.warning, raw, "datum", "bottom_z_m", text)


def _check_slope(values, raw, log):
    """Compare the slope of a bottom with the drawing, or with the steepest usual slope."""
    centre, edge = values["bottom"]["centre_z_m"], values["datum"]["bottom_z_m"]
    diameter, declared = values["tank"]["nominal_diameter_m"], values["checks"]["bottom_slopes"]
    if None in (centre, edge) or centre == edge:
        return
    found = "up" if centre > edge else "down"
    if declared is not None and declared != found:
        text = message(
            "bottom_slopes_otherwise",
            "{rise_m:+.3g} m from the edge (datum.bottom_z_m), so the bottom slopes {found} "
            "to its centre, but checks.bottom_slopes is {drawn}; expected both to agree",
            rise_m=centre - edge,
            found=found,
            drawn=declared,
        )
        tell(log.problem, raw, "bottom", "centre_z_m", text)
    elif declared is None and diameter is not None and centre - edge > SLOPE_UP * diameter / 2:
        text = message(
            "bottom_rises_much",
            "{rise_m:+.3g} m from the edge (datum.bottom_z_m), which is steep for a bottom that "
            "slopes up to its centre: does it slope down? Then say so in checks.bottom_slopes",
            rise_m=centre - edge,
        )
        tell(log.warning, raw, "bottom", "centre_z_m", text)

    elif declared is None and (diameter is None or abs(centre - edge) <= STEEP_FACTOR * diameter):
        text = message(  # a steeper bottom is reported elsewhere
            "bottom_slopes_unsaid",
            "blank; the bottom slopes {found} to its centre by {rise_m:.3g} m, and no other "
            "entry confirms it; expected up or down, as on the drawing",
            found=found,
            rise_m=abs(centre - edge),
        )
        tell(log.warning, raw, "checks", "bottom_slopes", text)


def _check_rim(values, table, log):
    """Compare bottom points near the wall with the bottom of the shell."""
    edge, diameter = values["datum"]["bottom_z_m"], values["tank"]["nominal_diameter_m"]
    xyz = places_of(table)
    if None in (edge, diameter) or len(xyz) < MIN_RIM or table.columns["x_m"] is None:
        return
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    is_near_wall = np.hypot(*(xyz[:, :2] - (low + high) / 2).T) > RIM * diameter / 2
    if is_near_wall.sum() < MIN_RIM:
        return
    miss = float(np.median(xyz[is_near_wall, 2]) - edge)
    if abs(miss) > RIM_MISS_M:
        text = message(
            "rim_off",
            "the points near the wall lie {miss_m:+.3g} m from datum.bottom_z_m (median): is it the"
            " height of the first course?",
            miss_m=miss,
        )
        log.warning(table.file, text, None, "z_m")


__all__ = ["check_plausible"]


def check_plausible(values, tables, extent, kind, raw, log):
    """Run every plausibility check; parameters as for `checks.check_tank`."""
    check_dates(values, raw, log)
    check_material(values, kind, raw, log)
    check_sizes(values, kind, raw, log)
    check_plates(values, tables, kind, raw, log)
    check_levels(values, tables, extent, kind, raw, log)
    check_targets(values, tables, log)
    if kind == "vertical":
        check_rings(values, tables["points"], tables["courses"], log)


# Level rings of points, compared with the joints of the courses.


# ---- lying cylinders, spheres, heads, rings of points and targets


def check_rings(values, points, courses, log):
    """Warn about a ring of points at a joint, which indicates wrong heights or wrong order."""
    bottom = values["datum"]["bottom_z_m"]
    heights = course_heights(courses)
    if points is None or bottom is None or heights is None or len(heights) < 2:
        return
    rings = _rings(places_of(points)[:, 2]) - bottom
    if not len(rings):
        return
    joints = np.cumsum(heights)[:-1]
    distance, joint = _nearest(rings, joints)
    if distance > NEAR_JOINT_M:
        return
    hint = message("heights_right", "are the heights of the courses and datum.bottom_z_m right?")
    if _nearest(rings, np.cumsum(heights[::-1])[:-1])[0] > 2 * NEAR_JOINT_M:
        hint = message("from_top_down", "are the courses listed from the top down?")
    text = message(
        "ring_on_joint",
        "a ring of points lies {near_mm:.0f} mm from the joint above course {course}, which is"
        " {joint_m:.4g} m above datum.bottom_z_m; expected rings on plates: {hint}",
        near_mm=1000 * distance,
        course=courses.of("course")[joint],
        joint_m=joints[joint],
        hint=hint,
    )
    log.warning(courses.file, text, courses.rows[joint], "height_m")


def _nearest(rings, joints):
    """Smallest distance of a ring from a joint, and index of this joint."""
    distances = np.abs(rings[:, None] - joints).min(axis=0)
    return float(distances.min()), int(distances.argmin())


def _rings(z):
    """Heights of level rings; empty if the points do not form rings."""
    z = np.sort(z)
    parts = np.split(z, np.flatnonzero(np.diff(z) > RING_GAP_M) + 1)
    level = [part for part in parts if len(part) >= MIN_POINTS_PER_COURSE]
    if len(level) > MOST_RINGS or any(np.ptp(part) > LEVEL_M for part in level):
        return np.zeros(0)
    return np.array([np.median(part) for part in level])


RADII = (("dish_radius_m", DISH_RADIUS), ("knuckle_radius_m", KNUCKLE_RADIUS))
ALIKE = dict.fromkeys(END_DEPTH, ("depth_m",)) | {
    "torispherical": ("depth_m", *(name for name, _ in RADII))
}


def check_sizes(values, kind, raw, log):
    """Check the dimensions of tanks that are described by dimensions, and of heads."""
    if kind in ("sphere", "horizontal"):
        _check_inside(values, kind, raw, log)
    if kind == "sphere":
        _check_sphere(values, raw, log)
    if kind == "horizontal":
        _check_lying(values, raw, log)
    if kind == "vertical":
        # Check the depth of the head on a vertical tank.
        form, depth = values["top"]["form"], values["top"]["depth_m"]
        diameter = values["tank"]["nominal_diameter_m"]
        if None not in (form, depth, diameter):
            _check_depth("top", "depth_m", depth, HEADS[form], diameter, raw, log)


def _check_inside(values, kind, raw, log):
    """Compare a measured diameter with a nominal diameter of known definition."""
    found, side = values[kind]["diameter_m"], values["survey"]["side"]
    plate = (values[kind]["thickness_mm"] or 0.0) / 1000
    if None in (found, side):
        return
    inside = found - 2 * plate if side == "outside" else found
    nominal, drawn = values["tank"]["nominal_diameter_m"], values["checks"]["diameter_is"]
    text = side_doubt(inside, nominal, drawn, plate, side)
    if text is not None:
        tell(log.warning, raw, "checks", "diameter_is", text)


def _check_sphere(values, raw, log):
    found, nominal = values["sphere"]["diameter_m"], values["tank"]["nominal_diameter_m"]
    _compare(found, nominal, "sphere", "diameter_m", "tank.nominal_diameter_m", raw, log)
    if found is not None and found > SPHERE_M:
        text = message(
            "sphere_large",
            "{found_m:g} m, expected at most {most_m:g} m: is it in feet?",
            found_m=found,
            most_m=SPHERE_M,
        )
        tell(log.warning, raw, "sphere", "diameter_m", text)


def _check_lying(values, raw, log):
    given, nominal = values["horizontal"], values["tank"]["nominal_diameter_m"]
    drawn = "tank.nominal_diameter_m"
    _compare(given["diameter_m"], nominal, "horizontal", "diameter_m", drawn, raw, log)
    diameter = given["diameter_m"] or nominal
    if None not in (given["width_m"], given["height_m"]):
        diameter = float(np.sqrt(given["width_m"] * given["height_m"]))
    length = given["length_m"]
    drawn = values["checks"]["length_m"]
    _compare(length, drawn, "horizontal", "length_m", "checks.length_m", raw, log)
    if diameter is None:
        return
    if length is not None:
        _check_length(length, diameter, raw, log)
    for end in "ab":
        _check_end(given, end, diameter, raw, log)
    if given["end_a"] == given["end_b"]:
        _check_alike(given, ALIKE.get(given["end_a"], ()), raw, log)


def _compare(found, nominal, section, key, drawn, raw, log):
    """Compare a dimension with the drawing."""
    if None in (found, nominal) or abs(found - nominal) <= SIZE_MISS * nominal + SIZE_MISS_M:
        return
    text = message(
        "size_unlike_drawing",
        "{found_m:g} m, {drawn} is {nominal_m:g} m: they differ by {percent:+.1f} % (a radius, or"
        " another unit?)",
        found_m=found,
        drawn=drawn,
        nominal_m=nominal,
        percent=100 * (found / nominal - 1),
    )
    is_impossible = not 1 / (1 + IMPOSSIBLE_MISS) <= found / nominal <= 1 + IMPOSSIBLE_MISS
    tell(log.problem if is_impossible else log.warning, raw, section, key, text)


def _check_length(length, diameter, raw, log):
    ratio, (least, most) = length / diameter, LENGTH_OVER_DIAMETER
    if ratio > MOST_LENGTH_OVER_DIAMETER:
        text = message(
            "length_impossible",
            "found {found_m:g} m, {ratio:.3g} diameters; expected at most {most:g}: is it "
            "in decimetres?",
            found_m=length,
            ratio=ratio,
            most=MOST_LENGTH_OVER_DIAMETER,
        )
        tell(log.problem, raw, "horizontal", "length_m", text)
    elif not least <= ratio <= most:
        text = message(
            "length_strange",
            "{found_m:g} m is {ratio:.3g} diameters, expected {least:g} to {most:g}: is one of them"
            " in another unit, or a radius?",
            found_m=length,
            ratio=ratio,
            least=least,
            most=most,
        )
        tell(log.warning, raw, "horizontal", "length_m", text)


def _check_end(given, end, diameter, raw, log):
    form, key = given[f"end_{end}"], f"end_{end}_depth_m"
    if form in END_DEPTH and given[key] is not None:
        _check_depth("horizontal", key, given[key], form, diameter, raw, log)
    for name, (least, most) in RADII:
        radius = given[f"end_{end}_{name}"]
        if form == "torispherical" and radius is not None and not (
            least <= radius / diameter <= most
        ):  # fmt: skip
            text = message(
                "end_radius_strange",
                "{found_m:g} m is {ratio:.3g} diameters, expected {least:g} to {most:g}: is it the"
                " right radius, and is the diameter one?",
                found_m=radius,
                ratio=radius / diameter,
                least=least,
                most=most,
            )
            tell(log.warning, raw, "horizontal", f"end_{end}_{name}", text)


def _check_depth(section, key, depth, form, diameter, raw, log):
    (least, most), ratio = END_DEPTH[form], depth / diameter
    is_hemisphere = form == "spherical" and ratio >= HEMISPHERE
    if not least <= ratio <= most and not is_hemisphere:
        text = message(
            "end_depth_strange",
            "{found_m:g} m is {ratio:.3g} diameters, expected {least:g} to {most:g} for a"
            " {form} end: is it the depth, and of one end?",
            found_m=depth,
            ratio=ratio,
            least=least,
            most=most,
            form=form,
        )
        tell(log.warning, raw, section, key, text)


def _check_alike(given, sizes, raw, log):
    """Warn about different dimensions of two ends of one form."""
    for name in sizes:
        a, b = (given[f"end_{end}_{name}"] for end in "ab")
        if None in (a, b) or abs(a - b) < max(ENDS_DIFFER_M, (ENDS_DIFFER - 1) * min(a, b)):
            continue
        end, other = ("a", "b") if a > b else ("b", "a")
        text = message(
            "ends_differ",
            "{found_m:g} m, and {other_m:g} m at end {other}: expected equal ends where both "
            "have the same form",
            found_m=max(a, b),
            other=other.upper(),
            other_m=min(a, b),
        )
        tell(log.warning, raw, "horizontal", f"end_{end}_{name}", text)


def check_targets(values, tables, log):
    """Warn once about offsets that do not fit the kind of target.

    An offset is subtracted from every radius, and no reading of the survey contradicts it.
    """
    table = tables["targets"]
    if not has_rows(table):
        return
    kind = values["checks"]["targets"] or FLAT
    offset = np.nan_to_num(table.numbers("offset_mm"))
    least, most = TARGET_MM[kind]
    outliers = np.flatnonzero((offset < least) | (offset > most))
    if len(outliers) == 0:
        return
    worst = outliers[int(np.argmax(np.abs(offset[outliers])))]
    text = message(
        "target_offset_strange",
        "{found_mm:g} mm from the wall to the centre of the target, {count} targets of {all} so;"
        " expected {least_mm:g} to {most_mm:g} mm with checks.targets = {kind}: is it in another"
        " unit or the constant of a prism, or are the targets {other}?",
        found_mm=float(offset[worst]),
        count=len(outliers),
        all=len(offset),
        least_mm=least,
        most_mm=most,
        kind=kind,
        other=RAISED if kind == FLAT else FLAT,
    )
    log.warning(table.file, text, table.rows[worst], "offset_mm")
