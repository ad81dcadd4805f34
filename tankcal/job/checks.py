"""Does the job make sense as a whole? Checks that need more than one value of it.

Each check tells `log` its problems and warnings and returns nothing. A check whose values are
missing or bad stays silent: what is wrong with them has been told already.
"""

import numpy as np

from tankcal.job.contract import INPUT_UNITS
from tankcal.job.entries import settings_place
from tankcal.job.fields import is_blank

MIN_POINTS_PER_COURSE = 5
FEW_POINTS_PER_COURSE = 10
HEIGHT_MISS_M, HEIGHT_MISS_RELATIVE = 0.020, 0.002
UNIT_FACTOR = 5  # sizes that differ by more cannot be in the same unit
DOUBTFUL_EXTENT = 1.5  # points wider than the tank by more: feet, or many points off the tank
MAX_DIP_OFFSET_M = 1.0
MAX_TABLE_ROWS = 25_000  # a 20 m tank in millimetres; its certificate has 90 pages
MAX_POINTS = 50_000
COARSE_STEP_M = 0.5
TINY_SD_MM = 0.01
SMALLEST_THICKNESS_MM = 1.0


def check_settings(values, raw, log):
    """Settings that hang together: heights of the datum, the table's step, pairs of keys."""
    datum, table, survey = values["datum"], values["table"], values["survey"]
    bottom, plate = datum["bottom_z_m"], datum["dip_plate_z_m"]
    if None not in (bottom, plate) and abs(plate - bottom) > MAX_DIP_OFFSET_M:
        expected = (
            f"{abs(plate - bottom):g} m {'above' if plate > bottom else 'below'} the bottom"
            f" (bottom_z_m = {bottom:g}); expected at most {MAX_DIP_OFFSET_M:g} m: another unit"
            " or frame?"
        )
        _tell(log.problem, raw, "datum", "dip_plate_z_m", expected)
    for given, lacking in (("dip_x_m", "dip_y_m"), ("dip_y_m", "dip_x_m")):
        if datum[given] is not None and _is_not_given(raw, "datum", lacking):
            _tell(log.problem, raw, "datum", lacking, f"missing; expected beside {given}")
    _check_step(table["step_m"], values["tank"]["nominal_height_m"], raw, log)
    if survey["liquid_density_kg_m3"] and survey["liquid_level_m"] is None:
        expected = "a density without liquid_level_m; set both to 0 when the tank was empty"
        _tell(log.problem, raw, "survey", "liquid_density_kg_m3", expected)
    if table["language"] not in (None, "en"):
        expected = "this version prints English; expected en"
        _tell(log.warning, raw, "table", "language", expected)


def _tell(to, raw, section, key, expected):
    file, row, name = settings_place(raw, section, key)
    to(file, expected, row, name)


def _is_not_given(raw, section, key):
    value = raw.settings.get(section, {}).get(key)
    return value is None or is_blank(value.raw)


def _check_step(step, height, raw, log):
    if None in (step, height):
        return
    if step >= height:
        expected = f"found {step:g}; expected less than the height, {height:g} m: in millimetres?"
        _tell(log.problem, raw, "table", "step_m", expected)
    elif height / step > MAX_TABLE_ROWS:
        expected = f"{height / step:.0f} rows in the table, expected at most {MAX_TABLE_ROWS}"
        _tell(log.problem, raw, "table", "step_m", expected)
    elif step > COARSE_STEP_M:
        expected = f"{step:g} m is a coarse step for a table: is it in another unit?"
        _tell(log.warning, raw, "table", "step_m", expected)


def check_courses(courses, values, log):
    """Course names once; plates of a credible thickness; heights that add up to the shell's."""
    if not courses.rows and not courses.skipped:
        log.problem(courses.file, "no rows; expected one row for each course, from the bottom up")
        return
    _refuse_repeated(courses, "course", log)
    for row, thickness in zip(courses.rows, courses.of("thickness_mm"), strict=True):
        if thickness is not None and 0 < thickness < SMALLEST_THICKNESS_MM:
            expected = f"found {thickness:g}; expected millimetres, 0 or at least 1: in metres?"
            log.problem(courses.file, expected, row, "thickness_mm")
    heights, nominal = courses.of("height_m"), values["tank"]["nominal_height_m"]
    if nominal is None or None in heights or courses.skipped:
        return  # a course that cannot be read is told already
    miss = sum(heights) - nominal
    allowed = max(HEIGHT_MISS_M, HEIGHT_MISS_RELATIVE * nominal)
    if abs(miss) > allowed * (1 + 1e-9):
        expected = (
            f"the courses add up to {sum(heights):.4g} m, expected tank.nominal_height_m ="
            f" {nominal:g} m within {1000 * allowed:.0f} mm; they miss it by {1000 * miss:.0f} mm"
        )
        log.problem(courses.file, expected, None, "height_m")


def _refuse_repeated(table, column, log):
    first_row = {}
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is None:
            continue
        if name in first_row:
            expected = f"{name!r} is there already, in row {first_row[name]}; expected once"
            log.problem(table.file, expected, row, column)
        else:
            first_row[name] = row


def check_points(points, log):
    """Point names once, places once (a warning), credible and complete standard deviations."""
    if not points.rows and not points.skipped:
        log.problem(points.file, "no rows; expected one row for each surveyed point")
        return
    if len(points.rows) > MAX_POINTS:
        expected = f"{len(points.rows)} points; expected at most {MAX_POINTS}: thin the scan first"
        log.problem(points.file, expected)
    _refuse_repeated(points, "point", log)
    _warn_same_places(points, log)
    _refuse_some_sections(points, log)
    sds = ("sx_mm", "sy_mm", "sz_mm")
    given = [name for name in sds if points.columns[name] is not None]
    for name in sds:
        if given and name not in given:
            expected = f"not given; expected beside {given[0]}, for all points or for none"
            log.problem(points.file, expected, None, name)
    for name in given:
        found = [sd for sd in points.of(name) if sd is not None]
        if found and max(found) < TINY_SD_MM:
            expected = f"at most {max(found):g} mm; expected millimetres: is it in metres?"
            log.warning(points.file, expected, None, name)


def _warn_same_places(points, log):
    first_row = {}
    places = zip(points.of("x_m"), points.of("y_m"), points.of("z_m"), strict=True)
    for row, place in zip(points.rows, places, strict=True):
        if None in place:
            continue
        if place in first_row:
            expected = f"the same coordinates as row {first_row[place]}; counted once"
            log.warning(points.file, expected, row, "x_m")
        else:
            first_row[place] = row


def _refuse_some_sections(points, log):
    """A section for every point or for none: else some would be placed by height, some by name."""
    sections = points.of("section")
    if not any(sections):
        return
    for row, section in zip(points.rows, sections, strict=True):
        if not section:
            expected = "blank; expected a section for every point or for none (placed by height)"
            log.problem(points.file, expected, row, "section")


def check_geometry(points, courses, values, raw, log):
    """Points, drawing and courses in the same unit and frame, and enough points in each course."""
    places = zip(points.of("x_m"), points.of("y_m"), points.of("z_m"), strict=True)
    xyz = np.array([place for place in places if None not in place]).reshape(-1, 3)
    unplaced = points.skipped + len(points.rows) - len(xyz)
    tank, bottom = values["tank"], values["datum"]["bottom_z_m"]
    if not len(xyz):
        return
    diameter, height = tank["nominal_diameter_m"], tank["nominal_height_m"]
    low, high = np.percentile(xyz, [5, 95], axis=0)
    width, rise = float(np.max(high[:2] - low[:2])), float(high[2] - low[2])
    same_unit = True
    if diameter is not None and len(xyz) >= MIN_POINTS_PER_COURSE:
        same_unit = _check_extent(points, "x_m", width, "nominal_diameter_m", diameter, log)
    if height is not None and rise > UNIT_FACTOR * height:
        same_unit = _check_extent(points, "z_m", rise, "nominal_height_m", height, log)
    heights = [None]
    if courses is not None and not courses.skipped:
        heights = courses.of("height_m")
    if not same_unit or bottom is None or not heights or None in heights:
        return
    edges = bottom + np.concatenate([[0.0], np.cumsum(heights)])
    _check_points_in_courses(xyz[:, 2], unplaced, edges, courses, raw, log)


def _check_extent(points, column, extent, key, nominal, log):
    """Is the points' extent of the size of the drawing's? Returns False after telling a problem."""
    ratio = extent / nominal
    found = f"the points are {extent:.4g} m apart (most of them), tank.{key} is {nominal:g} m"
    if 1 / UNIT_FACTOR <= ratio <= UNIT_FACTOR:
        if ratio > DOUBTFUL_EXTENT:
            expected = f"{found}: one of them in feet, or many points far off the tank?"
            log.warning(points.file, expected, None, column)
        return True
    large, small = ("the points", f"tank.{key}") if ratio > 1 else (f"tank.{key}", "the points")
    factor = max(ratio, 1 / ratio) if ratio > 0 else np.inf
    if 200 <= factor <= 5000:
        guess = f"about 1000 to 1: {large} in millimetres?"
    elif 20 <= factor < 200:
        guess = f"about 100 to 1: {large} in centimetres?"
    else:
        guess = f"{large} too large or {small} too small"
    log.problem(points.file, f"{found}; expected the same size in metres: {guess}", None, column)
    return False


def _check_points_in_courses(z, unplaced, edges, courses, raw, log):
    """Enough points in each course, even if all points that could not be read lie there?"""
    if not np.any((z >= edges[0]) & (z <= edges[-1])):
        expected = (
            f"no point lies on the shell, which goes from z = {edges[0]:g} to {edges[-1]:g} m;"
            f" expected points there, found z from {z.min():g} to {z.max():g} m"
        )
        _tell(log.problem, raw, "datum", "bottom_z_m", expected)
        return
    counts, _ = np.histogram(z, bins=edges)
    for row, name, count in zip(courses.rows, courses.of("course"), counts, strict=True):
        if count + unplaced < MIN_POINTS_PER_COURSE:
            expected = f"{count} points lie in course {name}, expected {MIN_POINTS_PER_COURSE}"
            log.problem(courses.file, expected + " or more", row, "course")
        elif count + unplaced < FEW_POINTS_PER_COURSE:
            expected = f"only {count} points lie in course {name}, expected"
            log.warning(courses.file, f"{expected} {FEW_POINTS_PER_COURSE} or more", row, "course")


def check_inputs(inputs, values, log):
    """uncertainty.csv: each input once, in its own unit, of a credible size, and of use here."""
    inside = values is not None and values["survey"]["side"] == "inside"
    _refuse_repeated(inputs, "input", log)
    given = zip(inputs.rows, inputs.of("input"), inputs.of("u"), inputs.of("unit"), strict=True)
    for row, name, u, unit in given:
        if None in (name, u, unit):
            continue
        expected_unit, _, largest, _ = INPUT_UNITS[name]
        if inside and name in ("plate_thickness", "paint"):
            expected = f"found {name}; expected only with side = outside: nothing is subtracted"
            log.problem(inputs.file, expected, row, "input")
        if unit != expected_unit:
            expected = f"found {unit!r}; expected {expected_unit!r} for {name}"
            log.problem(inputs.file, expected, row, "unit")
        elif u > largest:
            expected = f"found {u:g} {unit} for {name}; expected at most {largest:g} {unit}"
            log.problem(inputs.file, expected, row, "u")
