"""Points, drawing and courses: checks of their tables as a whole, and `Points` in SI."""

import numpy as np

from tankcal.job.checking import (
    UNIT_FACTOR,
    course_heights,
    has_rows,
    places_of,
    refuse_repeated,
    tell,
    tiny_sd,
)
from tankcal.job.checks.extent import has_shape, is_completed
from tankcal.job.covariance import check_covariance, read_covariance
from tankcal.job.entries import kind_of
from tankcal.job.plausibility import MIN_POINTS_PER_COURSE
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.messages import message
from tankcal.survey.points import Points
from tankcal.survey.reference_line import courses_with_radius

FEW_POINTS_PER_COURSE = 10  # fewer points cause a warning
# Smallest number of points on the wall of a lying tank.
MIN_POINTS_OF_SCAN = {"horizontal": 20, "sphere": 12}
DOUBTFUL_EXTENT = 1.5  # width of the points over that of the tank: feet, or clutter
LARGEST_SPHERE_M = 100  # largest diameter of a sphere without a nominal diameter
MAX_POINTS = 50_000  # the record contains every point
# If all standard deviations are below: warning, problem (probably in another unit).
TINY_SD_MM, SURELY_TINY_SD_MM = 0.01, 0.0001


def check_points_of(values, tables, raw, log):
    """Check points.csv and points_cov.npz with the settings; parameters as for `Method.check`."""
    kind, points = kind_of(raw), tables["points"]
    # Any measurement of the shape of the wall replaces the points.
    needs_points = kind == "vertical" and not has_shape(tables)
    if points is not None and (needs_points or has_rows(points)):
        check_points(points, log)
    if values is not None and kind == "vertical" and points is not None:
        check_cylinder(points, tables, values, raw, log)
    elif values is not None and has_rows(points):
        check_scan(points, values, kind, raw, log)
    _check_points_covariance(points, raw, log)


def check_points(points, log):
    """Check number, names, places, sections and standard deviations of the points."""
    if not points.rows and not points.skipped:
        log.problem(
            points.file,
            message("no_points_at_all", "no rows; expected one row for each surveyed point"),
        )
        return
    if len(points.rows) > MAX_POINTS:
        expected = message(
            "points_too_many",
            "{count} points; expected at most {most}, because the record contains every point:"
            " declare the files of a larger scan in clouds.toml",
            count=len(points.rows),
            most=MAX_POINTS,
        )
        log.problem(points.file, expected)
    refuse_repeated(points, "point", log)
    _warn_same_places(points, log)
    _refuse_some_sections(points, log)
    sds = ("sx_mm", "sy_mm", "sz_mm")
    given = [name for name in sds if points.columns[name] is not None]
    for name in sds:
        if given and name not in given:
            expected = message(
                "sd_of_some_axes",
                "missing, but {given} is given; expected both, for all points or for none",
                given=given[0],
            )
            log.problem(points.file, expected, None, name)
    for name in given:
        values = [sd for sd in points.of(name) if sd is not None]
        if values and max(values) < TINY_SD_MM:
            report = log.problem if max(values) < SURELY_TINY_SD_MM else log.warning
            report(points.file, tiny_sd("mm", max(values)), None, name)


def _warn_same_places(points, log):
    """Warn of points with equal coordinates."""
    first_row = {}
    places = zip(points.of("x_m"), points.of("y_m"), points.of("z_m"), strict=True)
    for row, place in zip(points.rows, places, strict=True):
        if None in place:
            continue
        if place in first_row:
            expected = message(
                "same_coordinates",
                "coordinates of row {row} again; counted once",
                row=first_row[place],
            )
            log.warning(points.file, expected, row, "x_m")
        else:
            first_row[place] = row


def _refuse_some_sections(points, log):
    """Refuse sections of some points only, because the other points would be assigned by height."""
    sections = points.of("section")
    if not any(sections):
        return
    for row, section in zip(points.rows, sections, strict=True):
        if not section:
            expected = message(
                "section_of_some_points",
                "blank; expected a section for every point or for none (placed by height)",
            )
            log.problem(points.file, expected, row, "section")


def check_cylinder(points, tables, values, raw, log):
    """Check points, drawing and courses of a vertical tank.

    Each course needs enough points, unless circumferences or reference lines determine its radius.
    """
    courses = tables["courses"]
    xyz = places_of(points)
    unplaced = points.skipped + len(points.rows) - len(xyz)
    tank, bottom = values["tank"], values["datum"]["bottom_z_m"]
    if not len(xyz):
        return
    diameter, height = tank["nominal_diameter_m"], tank["nominal_height_m"]
    # Percentiles exclude clutter from the size of the points.
    low, high = np.percentile(xyz, [5, 95], axis=0)
    width, rise = float(np.max(high[:2] - low[:2])), float(high[2] - low[2])
    is_same_unit = True
    if diameter is not None and len(xyz) >= MIN_POINTS_PER_COURSE:
        is_same_unit = check_extent(points, "x_m", width, "tank.nominal_diameter_m", diameter, log)
    if height is not None and rise > UNIT_FACTOR * height:
        is_same_unit = check_extent(points, "z_m", rise, "tank.nominal_height_m", height, log)
    heights = course_heights(courses)
    if not is_same_unit or bottom is None or heights is None:
        return
    edges = bottom + np.concatenate([[0.0], np.cumsum(heights)])
    _check_points_in_courses(xyz[:, 2], unplaced, edges, tables, raw, log)


def check_scan(points, values, kind, raw, log):
    """Check the points of a lying tank or a sphere: number, unit and frame of the datum."""
    xyz = places_of(points)
    unplaced = points.skipped + len(points.rows) - len(xyz)
    if len(xyz) + unplaced < MIN_POINTS_OF_SCAN.get(kind, 0):
        expected = message(
            "scan_of_few_points",
            "{count} points; expected {fewest} or more on the wall",
            count=len(xyz),
            fewest=MIN_POINTS_OF_SCAN[kind],
        )
        log.problem(points.file, expected)
        return
    if len(xyz) < MIN_POINTS_PER_COURSE or kind is None:
        return
    low, high = np.percentile(xyz, [5, 95], axis=0)
    across, key = float(np.max(high - low)), "tank.nominal_diameter_m"
    nominal = values["tank"]["nominal_diameter_m"]
    if kind == "horizontal":
        across, key = float(np.hypot(*(high - low)[:2])), "horizontal.length_m"
        nominal = values["horizontal"]["length_m"]
    if nominal is not None:
        if not check_extent(points, "x_m", across, key, nominal, log):
            return
    elif across > LARGEST_SPHERE_M:
        expected = message(
            "scan_too_wide",
            "the points are {across:.4g} m apart; expected at most {most} m: is it in millimetres?",
            across=across,
            most=LARGEST_SPHERE_M,
        )
        log.problem(points.file, expected, None, "x_m")
        return
    plate, rise = values["datum"]["dip_plate_z_m"], high[2] - low[2]
    if plate is not None and not low[2] - rise - 1 <= plate <= high[2]:
        expected = message(
            "plate_far_from_points",
            "found {plate:g}; the points lie from z = {low:.4g} to {high:.4g} m, expected it "
            "close to them",
            plate=plate,
            low=low[2],
            high=high[2],
        )
        tell(log.problem, raw, "datum", "dip_plate_z_m", expected)


def check_extent(points, column, extent, key, nominal, log):
    """Compare the size of the points with the drawing.

    Parameters
    ----------
    points : ColumnValues
        Table of points.
    column : str
        Column of the message.
    extent, nominal : float
        Size of the points and nominal dimension, m.
    key : str
        Key of the nominal dimension.
    log : Log
        Receives problem or warning.

    Returns
    -------
    bool
        False after a problem.
    """
    ratio = extent / nominal
    comparison = message(
        "extent_beside_nominal",
        "the points are {extent:.4g} m apart (most of them), {key} is {nominal:g} m",
        extent=extent,
        key=key,
        nominal=nominal,
    )
    if 1 / UNIT_FACTOR <= ratio <= UNIT_FACTOR:
        if ratio > DOUBTFUL_EXTENT:
            expected = message(
                "points_too_wide",
                "the points are {extent_m:.4g} m apart (most of them), {key} is {nominal_m:g} m:"
                " one of them in feet, or many points far off the tank?",
                extent_m=extent,
                key=key,
                nominal_m=nominal,
            )
            log.warning(points.file, expected, None, column)
        return True
    the_points = message("the_points", "the points")
    large, small = (the_points, key) if ratio > 1 else (key, the_points)
    factor = max(ratio, 1 / ratio) if ratio > 0 else np.inf
    if 200 <= factor <= 5000:
        guess = message("thousand_to_one", "about 1000 to 1: {large} in millimetres?", large=large)
    elif 20 <= factor < 200:
        guess = message("hundred_to_one", "about 100 to 1: {large} in centimetres?", large=large)
    else:
        guess = message(
            "large_beside_small", "{large} too large or {small} too small", large=large, small=small
        )
    expected = message(
        "other_size",
        "{found}; expected the same size in metres: {guess}",
        found=comparison,
        guess=guess,
    )
    log.problem(points.file, expected, None, column)
    return False


def _check_points_in_courses(z, unplaced, edges, tables, raw, log):
    """Require enough points in each course, counting unreadable points in every course."""
    courses = tables["courses"]
    if not np.any((z >= edges[0]) & (z <= edges[-1])):
        expected = message(
            "no_point_on_shell",
            "no point lies on the shell, which goes from z = {shell_low:g} to {shell_high:g} m; "
            "expected points there, found z from {low:g} to {high:g} m",
            shell_low=edges[0],
            shell_high=edges[-1],
            low=z.min(),
            high=z.max(),
        )
        tell(log.problem, raw, "datum", "bottom_z_m", expected)
        return
    counts, _ = np.histogram(z, bins=edges)
    names = np.array(courses.of("course"))
    with_points = set(names[counts + unplaced >= MIN_POINTS_PER_COURSE].tolist())
    determined = courses_with_radius(
        with_points, _courses_of(tables["circumferences"]), _courses_of(tables["offsets"])
    )
    known = is_completed(tables)  # radii of courses that were not measured again
    for row, name, count in zip(courses.rows, courses.of("course"), counts, strict=True):
        if (name in determined - with_points or known) and not count:
            continue
        if count + unplaced < MIN_POINTS_PER_COURSE:
            expected = message(
                "too_few_points_in_course",
                "{count} points lie in course {name}, expected {fewest} or more",
                count=count,
                name=name,
                fewest=MIN_POINTS_PER_COURSE,
            )
            log.problem(courses.file, expected, row, "course")
        elif count + unplaced < FEW_POINTS_PER_COURSE:
            expected = message(
                "few_points_in_course",
                "only {count} points lie in course {course}, expected {advised} or more",
                count=count,
                course=name,
                advised=FEW_POINTS_PER_COURSE,
            )
            log.warning(courses.file, expected, row, "course")


def _courses_of(table):
    """Names of the courses in the rows of a table that are not checks."""
    if table is None:
        return set()
    pairs = zip(table.of("course"), table.of("use"), strict=True)
    return {name for name, use in pairs if use != "check"}


def _check_points_covariance(points, raw, log):
    """Check the covariance matrix of the points, if there is one."""
    data = raw.archives.get(COVARIANCE_FILE)
    if data is None:
        return
    if points is None:
        is_unreadable = "points" in raw.tables and raw.tables["points"] is None
        if not is_unreadable:
            expected = message(
                "covariance_without_points",
                "given without its points; expected points.csv beside it",
            )
            log.problem(COVARIANCE_FILE, expected)
        return
    if points.columns["sx_mm"] is not None:
        expected = message(
            "covariance_beside_sds",
            "given together with sx_mm, sy_mm, sz_mm of the points; expected only one of them",
        )
        log.problem(COVARIANCE_FILE, expected)
    check_covariance(data, points.of("point"), log)


def make_points(tables, raw):
    """Build `Points` from tables and registers without problems."""
    table, covariance = tables["points"], raw.archives.get(COVARIANCE_FILE)
    sd_m = None
    if table.columns["sx_mm"] is not None:
        sd_m = np.column_stack([table.of(f"s{axis}_mm") for axis in "xyz"]).astype(float) / 1000
    return Points(
        names=tuple(table.of("point")),
        xyz_m=np.column_stack([table.of(f"{axis}_m") for axis in "xyz"]).astype(float),
        sd_m=sd_m,
        covariance_m2=None if covariance is None else read_covariance(covariance),
        section=tuple(table.of("section")),
        generatrix=tuple(table.of("generatrix")),
        rows=table.rows,
    )
