"""Columns of points.csv, and checks of its names, coordinates, sections and standard deviations."""

from tankcal.job.checking import refuse_repeated, tiny_sd
from tankcal.job.contract.shorthand import number, positive
from tankcal.job.fields import Field
from tankcal.messages import message


def _sd(axis):
    """Return the column of the standard deviation of a coordinate."""
    return positive(
        f"s{axis}_mm",
        f"standard deviation of {axis}, millimetres; for all points or for none",
        1000,
        in_full=True,
    )


def _coordinate(axis, limit):
    """Return the column of a coordinate."""
    note = f"coordinate {axis}, metres"
    return number(f"{axis}_m", note, -limit, limit, required=True)


COLUMNS = (
    Field("point", "name", "name of the point, unique in the file", required=True),
    _coordinate("x", 1e8),
    _coordinate("y", 1e8),
    _coordinate("z", 1e5),
    _sd("x"),
    _sd("y"),
    _sd("z"),
    Field("section", "name", "name of the ring of points; blank: assigned by height"),
    Field("generatrix", "name", "name of the vertical line of points"),
)

MAX_POINTS = 50_000  # the record contains every point
# If all standard deviations are below: warning, problem (probably in another unit).
TINY_SD_MM, SURELY_TINY_SD_MM = 0.01, 0.0001


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
