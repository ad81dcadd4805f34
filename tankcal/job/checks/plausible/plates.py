"""Plausibility of plates and paint: for the liquid head, the diameter, and other plates."""

import numpy as np

from tankcal.job.checking import course_heights, tell
from tankcal.job.checks.extent import is_strapped, may_be_seen_from_both_sides
from tankcal.job.plausibility import (
    CARBON_STEEL,
    HEAVY,
    LEAST_PLATE_MM,
    LEAST_STRESS_MPA,
    LIGHT,
    PAINT_MM,
    RISING_PLATES,
    SOLID_PLATES_MM,
    least_course_mm,
    most_course_mm,
)
from tankcal.messages import message

WATER_KG_M3 = 1000.0


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
                **_of_course(plate, most, head, diameter),
            )
        elif plate < least:
            text = message(
                "plate_thin",
                "{found_mm:g} mm, expected {limit_mm:.3g} mm or more for {head_m:.4g} m of shell "
                "above it and a diameter of {diameter_m:g} m: is it in centimetres, or half of it?",
                **_of_course(plate, least, head, diameter),
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


def _of_course(plate, limit, head, diameter):
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
            **_of_solid(plate, least, most, diameter),
        )
    elif plate < least:
        text = message(
            "solid_plate_thin",
            "{found_mm:g} mm, expected {least_mm:.3g} to {most_mm:.3g} mm for a diameter of"
            " {diameter_m:g} m: ten times too thin, or in centimetres?",
            **_of_solid(plate, least, most, diameter),
        )
    else:
        return
    tell(log.warning, raw, kind, "thickness_mm", text)


def _of_solid(plate, least, most, diameter):
    return {"found_mm": plate, "least_mm": least, "most_mm": most, "diameter_m": diameter}
