"""Keys of [bottom], columns of bottom.csv, and checks that the bottom is complete and plausible."""

import numpy as np

from tankcal.job.checking import has_rows, is_not_given, places_of, tell, zero_z
from tankcal.job.contract.ends import check_radii, depth_of_head, torispherical_keys
from tankcal.job.fields import VERTICAL, Field, choice, number
from tankcal.messages import message
from tankcal.tank.tips import FORMS as TIPS

OF_CLOUD = "cloud"  # form of a bottom that is modelled from scans
SHAPED = tuple(TIPS)
KEYS = (
    choice(
        "form",
        "form of the bottom; cloud: from scans of the inside; blank: points or liquid if"
        " bottom.csv has their columns, else flat",
        ("flat", "leaning", *SHAPED, "points", "liquid", OF_CLOUD),
        kinds=VERTICAL,
    ),
    number(
        "centre_z_m",
        "cone, dish, ellipsoidal, torispherical: z of the centre, in the frame of the points,"
        " metres; the edge is at datum.bottom_z_m",
        -1e5,
        1e5,
        kinds=VERTICAL,
    ),
    *torispherical_keys("", "", VERTICAL),
)


def _bottom(name, note, low, high, above_low=False):
    """Return an optional column of bottom.csv, filled in for every row or for none."""
    return Field(name, "number", note, in_full=True, low=low, high=high, above_low=above_low)


COLUMNS = (
    _bottom("x_m", "surveyed bottom: coordinate x, in the frame of the points, metres", -1e8, 1e8),
    _bottom("y_m", "surveyed bottom: coordinate y, in the frame of the points, metres", -1e8, 1e8),
    _bottom("z_m", "surveyed bottom: coordinate z, in the frame of the points, metres", -1e5, 1e5),
    _bottom("s_mm", "surveyed bottom: standard deviation of z, millimetres", 0, 1000, True),
    _bottom("level_m", "bottom measured with liquid: dip from the table's zero, metres", -100, 100),
    _bottom(
        "volume_m3", "bottom measured with liquid: volume below that dip, cubic metres", 0, 1e6
    ),
    _bottom(
        "u_m3",
        "bottom measured with liquid: standard uncertainty of the volume, cubic metres",
        0,
        1e5,
    ),
)

SURVEYED, MEASURED = ("x_m", "y_m", "z_m"), ("level_m", "volume_m3")
MIN_POINTS, MAX_POINTS = 12, 500  # number of points of a surveyed bottom surface
MIN_LEVELS = 2  # number of levels of a bottom measured with liquid
# Spread (rms) of the points over the diameter; a full disc has 0.25.
NARROW, PARTIAL = 0.01, 0.1
# Tolerance of the distance from the axis: factor of the nominal radius, and metres, because the
# actual radius differs from the nominal radius.
OUTSIDE_FACTOR, OUTSIDE_M = 1.05, 0.2
# Largest rise and largest usual depth of the bottom over the diameter; metres always permitted.
RISE_FACTOR, STEEP_FACTOR, LEAST_DEPTH_M = 0.1, 0.1, 0.5
# Largest depth of a head over the diameter.
DEEPEST = {"cone": 5.0, "dish": 0.5, "ellipsoidal": 2.0, "torispherical": 0.5}
# Volume of a slice over the volume of the full cross-section: problem above, warning below.
OVERFULL, EMPTY = 1.5, 0.5


def bottom_form(values, table):
    """Return the declared form of the bottom, else the form of the columns of bottom.csv."""
    form = values["bottom"]["form"]
    if form is not None or not has_rows(table):
        return form or "flat"
    return "liquid" if _filled_columns(table, MEASURED) else "points"


def _filled_columns(table, names):
    """Return the names of those columns that are filled in."""
    return [name for name in names if table.columns[name] is not None]


def check_bottom(values, table, points, extent, raw, log):
    """Check the keys and rows of the form of the bottom, and refuse those of other forms."""
    form = bottom_form(values, table)
    _check_centre(form, values, raw, log)
    if form not in ("points", "liquid"):
        if has_rows(table):
            expected = message(
                "bottom_rows_unused",
                "rows are given, but bottom.form = {form}; expected form points or liquid, "
                "or no rows",
                form=form,
            )
            log.problem(table.file, expected)
        return
    required = SURVEYED if form == "points" else MEASURED
    if not has_rows(table):
        expected = message(
            "bottom_rows_missing",
            "no rows; expected {wanted} for bottom.form = {form}",
            wanted=[*required],
            form=form,
        )
        log.problem(raw.file_of("bottom"), expected)
    elif _has_required_columns(table, form, required, log):
        if form == "points":
            _check_points(table, points, values, log)
        else:
            _check_volumes(table, values, extent, log)


def _has_required_columns(table, form, required, log):
    """Check that the table has all columns of its form and none of the other form."""
    surveyed, measured = (
        _filled_columns(table, (*SURVEYED, "s_mm")),
        _filled_columns(table, (*MEASURED, "u_m3")),
    )
    if surveyed and measured:
        expected = message(
            "bottom_of_two_forms",
            "given together with {measured}; expected surveyed points or measured volumes, "
            "not both",
            measured=measured[0],
        )
        log.problem(table.file, expected, None, surveyed[0])
        return False
    missing = [name for name in required if table.columns[name] is None]
    for name in missing:
        expected = message(
            "bottom_column_missing",
            "not given; expected {wanted} for a bottom of form {form}",
            wanted=[*required],
            form=form,
        )
        log.problem(table.file, expected, None, name)
    return not missing


def rise_of_bottom(values):
    """Return the height of a shaped bottom's centre above its edge, m; None if unknown."""
    given, diameter = values["bottom"], values["tank"]["nominal_diameter_m"]
    if given["centre_z_m"] is not None:
        edge = values["datum"]["bottom_z_m"]
        return None if edge is None else given["centre_z_m"] - edge
    depth = None if diameter is None else depth_of_head(given, None, diameter)
    return None if depth is None else -depth


def _check_centre(form, values, raw, log):
    """Check that the height and radii of the centre are given only for shaped bottoms."""
    given, edge = values["bottom"], values["datum"]["bottom_z_m"]
    centre = given["centre_z_m"]
    diameter = values["tank"]["nominal_diameter_m"]
    if form not in SHAPED:
        if centre is not None:
            expected = message(
                "bottom_centre_unused",
                "given for a bottom of form {form}; expected only for a cone or another head",
                form=form,
            )
            tell(log.problem, raw, "bottom", "centre_z_m", expected)
    elif form != "torispherical" and is_not_given(raw, "bottom", "centre_z_m"):
        expected = message(
            "bottom_centre_missing",
            "missing; expected the z of the centre of the {form}",
            form=form,
        )
        tell(log.problem, raw, "bottom", "centre_z_m", expected)
    rise = None if None in (centre, edge) else centre - edge
    depth = rise and abs(rise)
    check_radii("bottom", given, form, "centre_z_m", depth, diameter, raw, log)
    if None in (rise, diameter) or form not in SHAPED:
        return
    _check_rise(form, rise, diameter, values["tank"]["nominal_height_m"], raw, log)


def _check_rise(form, rise, diameter, height, raw, log):
    """Check the height of the centre above the edge, m, against diameter and height of the tank."""
    deepest = DEEPEST[form] * diameter
    highest = deepest if height is None else min(deepest, height)
    if not -deepest <= rise <= highest:
        expected = message(
            "bottom_centre_far",
            "{rise:+g} m from its edge (datum.bottom_z_m); expected at most {highest:g} m "
            "above, {deepest:g} m below: is it in another unit or frame?",
            rise=rise,
            highest=highest,
            deepest=deepest,
        )
        tell(log.problem, raw, "bottom", "centre_z_m", expected)
    elif abs(rise) > STEEP_FACTOR * diameter:
        expected = message(
            "bottom_steep",
            "{rise_m:+g} m from its edge (datum.bottom_z_m), which is steep: is it in the frame of"
            " the points?",
            rise_m=rise,
        )
        tell(log.warning, raw, "bottom", "centre_z_m", expected)
    elif rise == 0:
        expected = message(
            "bottom_flat", "at the height of the edge, so this {form} is flat", form=form
        )
        tell(log.warning, raw, "bottom", "centre_z_m", expected)


def _check_points(table, wall, values, log):
    """Check number, extent, place and depth of the points of a surveyed bottom."""
    xyz, diameter = places_of(table), values["tank"]["nominal_diameter_m"]
    if len(table.rows) + table.skipped < MIN_POINTS:
        expected = message(
            "bottom_few_points",
            "{count} points; expected {fewest} or more",
            count=len(table.rows),
            fewest=MIN_POINTS,
        )
        log.problem(table.file, expected)
        return
    if len(table.rows) > MAX_POINTS:
        expected = message(
            "bottom_many_points",
            "{count} points; expected at most {most}: thin the scan first",
            count=len(table.rows),
            most=MAX_POINTS,
        )
        log.problem(table.file, expected)
    if not len(xyz) or len(xyz) < len(table.rows) or diameter is None:
        return
    plan = xyz[:, :2] - xyz[:, :2].mean(axis=0)
    # The smaller singular value is the rms extent of the points in their narrowest direction.
    spread = float(np.linalg.svd(plan, compute_uv=False)[1] / np.sqrt(len(xyz)))
    if spread < NARROW * diameter:
        expected = message(
            "bottom_points_on_a_line",
            "all points lie in one place or on one line; expected points all over the bottom",
        )
        log.problem(table.file, expected, None, "x_m")
        return
    if spread < PARTIAL * diameter:
        expected = message(
            "bottom_partly_surveyed",
            "the points cover a small part of the bottom; expected points all over it",
        )
        log.warning(table.file, expected, None, "x_m")
    _refuse_same_places(table, xyz, log)
    if wall is not None:
        _check_places(table, xyz, places_of(wall), diameter, log)
    if values["datum"]["bottom_z_m"] is not None:
        _check_depths(table, xyz[:, 2] - values["datum"]["bottom_z_m"], diameter, log)


def _refuse_same_places(table, xyz, log):
    """Refuse points with equal x and y, through which no surface can be fitted."""
    first_row = {}
    for row, place in zip(table.rows, map(tuple, xyz[:, :2]), strict=True):
        if place in first_row:
            expected = message(
                "bottom_point_twice",
                "x and y of row {first_row} again; expected one point at each place",
                first_row=first_row[place],
            )
            log.problem(table.file, expected, row, "x_m")
        first_row.setdefault(place, row)


def _check_places(table, xyz, wall, diameter, log):
    """Check that the bottom points lie within the tank (axis estimated from wall points)."""
    if not len(wall):
        return
    # The percentiles exclude outliers of the wall.
    low, high = np.percentile(wall[:, :2], [5, 95], axis=0)
    distance = np.hypot(*(xyz[:, :2] - (low + high) / 2).T)
    allowed = OUTSIDE_FACTOR * diameter / 2 + OUTSIDE_M
    if np.min(high - low) < 0.85 * diameter:  # wall seen from one side: centre poorly known
        allowed = diameter + OUTSIDE_M
    radius = diameter / 2
    texts = [
        message(
            "bottom_point_outside",
            "{far:.4g} m from the axis; expected within the tank, a radius of {radius:g} m",
            far=far,
            radius=radius,
        )
        for far in distance
    ]
    _tell_rows(table, "x_m", distance > allowed, texts, log)


def _check_depths(table, rise, diameter, log):
    """Check the heights of the bottom points above the edge, m, against the diameter."""
    highest = max(LEAST_DEPTH_M, RISE_FACTOR * diameter)
    deepest = max(LEAST_DEPTH_M, diameter)
    texts = [_off_edge_message(z, highest, deepest) for z in rise]
    bad = (rise > highest) | (rise < -deepest)
    _tell_rows(table, "z_m", bad, texts, log)
    steep = np.min(rise) < -max(LEAST_DEPTH_M, STEEP_FACTOR * diameter)
    if steep and not np.any(bad):
        expected = message(
            "bottom_deep",
            "{depth_m:.4g} m below datum.bottom_z_m, which is deep: is it in metres?",
            depth_m=-np.min(rise),
        )
        log.warning(table.file, expected, table.rows[int(np.argmin(rise))], "z_m")


def _off_edge_message(z, highest, deepest):
    """Return the message for a point too high above or too deep below the edge."""
    if z > 0:
        return message(
            "bottom_point_high",
            "{z:.4g} m above datum.bottom_z_m; expected at most {highest:.4g} m above, "
            "{deepest:.4g} m below",
            z=z,
            highest=highest,
            deepest=deepest,
        )
    depth = -z
    return message(
        "bottom_point_deep",
        "{depth:.4g} m below datum.bottom_z_m; expected at most {highest:.4g} m above, "
        "{deepest:.4g} m below",
        depth=depth,
        highest=highest,
        deepest=deepest,
    )


def _tell_rows(table, column, bad, texts, log):
    """Report a problem for each bad row, or for the column if more than half are bad."""
    if 2 * np.sum(bad) > len(bad):
        first = texts[int(np.argmax(bad))]
        expected = message(
            "bottom_other_frame",
            "{first}: is it in millimetres, or in another frame than the points of the wall?",
            first=first,
        )
        log.problem(table.file, expected, None, column)
        return
    for row, text, is_bad in zip(table.rows, texts, bad, strict=True):
        if is_bad:
            log.problem(table.file, text, row, column)


def _check_volumes(table, values, extent, log):
    """Check levels and volumes of a bottom measured with liquid."""
    levels, volumes = table.of("level_m"), table.of("volume_m3")
    if len(table.rows) + table.skipped < MIN_LEVELS:
        log.problem(
            table.file,
            message(
                "bottom_few_levels",
                "{count} level; expected {fewest} or more",
                count=len(levels),
                fewest=MIN_LEVELS,
            ),
        )
        return
    if None in levels or None in volumes or table.skipped:
        return
    is_ascending = True
    for name, column in (("level_m", levels), ("volume_m3", volumes)):
        pairs = zip(table.rows[1:], column[:-1], column[1:], strict=True)
        for row, before, after in pairs:
            is_dry = name == "volume_m3" and after == before == 0
            if after <= before and not is_dry:
                expected = message(
                    "bottom_not_ascending",
                    "found {after:g} after {before:g}; expected ascending numbers",
                    after=after,
                    before=before,
                )
                log.problem(table.file, expected, row, name)
                is_ascending = False
    if is_ascending:
        _check_reach(table, levels, volumes, values, extent, log)
        _check_slices(table, levels, volumes, extent, log)


def _check_reach(table, levels, volumes, values, extent, log):
    """Check that the levels extend from the table's zero to the shell, without extrapolation."""
    shell, zero = values["datum"]["bottom_z_m"], zero_z(values)
    if levels[0] > 0 and volumes[0] > 0:
        expected = message(
            "bottom_begins_late",
            "begins at {levels:g}; expected a row at dip 0 or below it, or a volume of 0",
            levels=levels[0],
        )
        log.problem(table.file, expected, table.rows[0], "level_m")
    if None not in (shell, zero) and levels[-1] < shell - zero:
        expected = message(
            "bottom_ends_early",
            "ends at {levels:g}; expected levels up to the shell, {shell:g} m",
            levels=levels[-1],
            shell=shell - zero,
        )
        log.problem(table.file, expected, table.rows[-1], "level_m")
    if extent.top_m is not None and levels[-1] > extent.top_m:
        expected = message(
            "bottom_ends_late",
            "found {levels:g}; expected dips within the shell: is it in millimetres?",
            levels=levels[-1],
        )
        log.problem(table.file, expected, table.rows[-1], "level_m")


def _check_slices(table, levels, volumes, extent, log):
    """Check the volumes between successive levels against the full cross-section."""
    if extent.area_m2 is None:
        return
    full = extent.area_m2 * np.diff(levels)
    filled = np.diff(volumes) / full
    texts = [
        message(
            "bottom_overfull",
            "{dv:.4g} m3 more than the row above; expected about {v:.4g} m3, what the full "
            "cross-section holds there: is it in litres?",
            dv=dv,
            v=v,
        )
        for dv, v in zip(np.diff(volumes), full, strict=True)
    ]
    bad = np.append(False, filled > OVERFULL)
    for row, text, is_bad in zip(table.rows, ["", *texts], bad, strict=True):
        if is_bad:
            log.problem(table.file, text, row, "volume_m3")
    if not np.any(bad) and filled[-1] < EMPTY:
        expected = message(
            "bottom_hardly_filled",
            "{more_m3:.4g} m3 more than the row above; the full cross-section holds "
            "{full_m3:.4g} m3 there: is the bottom not covered yet, or is it in another unit?",
            more_m3=volumes[-1] - volumes[-2],
            full_m3=full[-1],
        )
        log.warning(table.file, expected, table.rows[-1], "volume_m3")
    largest_heel = extent.area_m2 * max(LEAST_DEPTH_M, np.sqrt(extent.area_m2))
    if not np.any(bad) and volumes[0] > largest_heel:
        expected = message(
            "bottom_heel",
            "found {heel:g}; expected a heel of at most {largest:.4g} m3",
            heel=volumes[0],
            largest=largest_heel,
        )
        log.problem(table.file, expected, table.rows[0], "volume_m3")
