"""All checks of the files of a survey, in the order of their reports."""

import numpy as np

from tankcal.job.cameras import datum_point
from tankcal.job.checking import has_rows, is_not_given, refuse_repeated, tell
from tankcal.job.checks.survey.cameras import check_cameras, check_depth_of_field
from tankcal.job.checks.survey.doubtful import check_doubtful
from tankcal.job.checks.survey.images import check_images
from tankcal.job.checks.survey.readings import (
    SurveyFiles,
    all_points,
    check_correlated,
    check_instruments,
    check_names,
    check_readings,
    check_stadia,
    observed_names,
    tell_rows,
)
from tankcal.job.contract.observations import ANGLES, READINGS
from tankcal.job.tables import nearest
from tankcal.messages import join_with_and, list_some, message
from tankcal.survey.observations import KINDS


def check_files(values, tables, registers, raw, log, reported):
    """Check the files of a survey.

    Parameters
    ----------
    values, tables, registers, raw, log
        As for `checks.check_all`.
    reported : frozenset of (str, int)
        File and row of each problem reported before.
    """
    files = SurveyFiles(values, tables, registers, raw, log, reported)
    check_cameras(files)
    check_depth_of_field(files)
    check_instruments(files)
    check_images(files)
    check_readings(files)
    check_stadia(files)
    check_known(files)
    check_names(files)
    check_held(files)
    check_correlated(files)
    check_datum(files)
    check_doubtful(files)


# ---- checks of the datum in [adjustment], and of control, check points and targets


# control.csv, check.csv and targets.csv: unique points, sds of given coordinates only.

MOST_NAMED = 5  # largest number of points named in a message


def check_known(files):
    """Check known points and targets."""
    observed = observed_names(files)
    for name in ("control", "check"):
        table = files.tables[name]
        if has_rows(table):
            _refuse_point_twice(files, table)
            _check_coordinates(files, table)
            _warn_unobserved(files, table, observed, _bear_on_nothing)
    targets = files.tables["targets"]
    if has_rows(targets):
        refuse_repeated(targets, "point", files.log)
        _warn_unobserved(files, targets, observed, _unobserved_message)
    _warn_control_that_checks(files)


def _refuse_point_twice(files, table):
    first = {}
    for row, point, system in zip(table.rows, table.of("point"), table.of("system"), strict=True):
        first_row = first.setdefault((point, system), row)
        if point is not None and first_row != row:
            within = (
                ""
                if system is None
                else message("within_system", " in system {system!r}", system=system)
            )
            expected = message(
                "known_twice",
                "{point!r} is already given{within}, in row {row}; expected once",
                point=point,
                within=within,
                row=first_row,
            )
            files.log.problem(table.file, expected, row, "point")


def _check_coordinates(files, table):
    is_valid, has_coordinate = files.sound(table), np.zeros(len(table.rows), dtype=bool)
    for axis in "xyz":
        value, sd = (~np.isnan(table.numbers(name)) for name in (f"{axis}_m", f"s{axis}_mm"))
        has_coordinate |= value
        expected = message(
            "known_sd_without_value",
            "given without {axis}_m; expected both, or no standard deviation",
            axis=axis,
        )
        tell_rows(files.log.problem, table, is_valid & sd & ~value, f"s{axis}_mm", expected)
    expected = message("no_coordinate", "no coordinate; expected at least one")
    tell_rows(files.log.problem, table, is_valid & ~has_coordinate, "x_m", expected)


def _bear_on_nothing(names):
    return message(
        "known_unobserved",
        "not observed by anything, so they have no effect: {points}",
        points=names,
    )


def _unobserved_message(names):
    return message(
        "targets_unobserved", "not observed by anything, left out: {points}", points=names
    )


def _warn_unobserved(files, table, observed, message_about):
    """Warn about points without observations; message_about(names) returns the message."""
    if any(files.is_unreadable(name) for name in ("image_points", "setups", "directions")):
        return
    unobserved = [
        (row, point)
        for row, point in zip(table.rows, table.of("point"), strict=True)
        if point is not None and point not in observed
    ]
    if unobserved:
        names = list_some([point for _, point in unobserved], MOST_NAMED)
        files.log.warning(table.file, message_about(names), unobserved[0][0], "point")


def _warn_control_that_checks(files):
    """Warn about a check point that is also a control point, so not independent."""
    control, check = files.tables["control"], files.tables["check"]
    if not has_rows(control) or not has_rows(check):
        return
    used = {
        (point, system)
        for point, system, use in zip(
            control.of("point"), control.of("system"), control.of("use"), strict=True
        )
        if use != "check"
    }
    for row, point, system in zip(check.rows, check.of("point"), check.of("system"), strict=True):
        if (point, system) in used:
            expected = message(
                "check_is_control",
                "{point!r} is also a control point, so it is not an independent check",
                point=point,
            )
            files.log.warning(check.file, expected, row, "point")


# Values held (sd 0) twice: contradictory, or without a remaining unknown.

SAME_M, SAME_DEG = 1e-9, 1e-9  # largest difference of equal values


def check_held(files):
    """Check exact observations between held points, and observations held at two values."""
    held = _held_axes(files)
    for name in READINGS:
        table = files.tables[name]
        if not has_rows(table) or "setup" in table.columns or name == "vectors":
            continue
        sd = table.numbers("s_arcsec" if name in ANGLES else "s_mm")
        exact = (sd == 0) & np.array([use != "check" for use in table.of("use")], dtype=bool)
        if exact.any():
            places = np.flatnonzero(exact)
            _refuse_between_held(files, name, table, places, held)
            _refuse_two_values(files, name, table, places)


def _held_axes(files):
    """{point: its axes held by control.csv, as text}."""
    control = files.tables["control"]
    if not has_rows(control):
        return {}
    sds = [control.numbers(f"s{axis}_mm") == 0 for axis in "xyz"]
    rows = zip(control.of("point"), control.of("system"), control.of("use"), *sds, strict=True)
    return {
        point: "".join(axis for axis, is_held in zip("xyz", axes, strict=True) if is_held)
        for point, system, use, *axes in rows
        if system is None and use != "check"
    }


def _ends(name, table):
    columns = ("at", "from", "to") if name == "horizontal_angles" else ("from", "to")
    return [table.of(column) for column in columns]


def _refuse_between_held(files, name, table, places, held):
    sd_column = "s_arcsec" if name in ANGLES else "s_mm"
    is_horizontal = (
        [kind == "horizontal" for kind in table.of("kind")] if name == "distances" else None
    )
    ends = _ends(name, table)
    for place in places:
        points = [column[place] for column in ends]
        # An observation is determined only if all its axes are held at all its points.
        axes = "xy" if is_horizontal and is_horizontal[place] else KINDS[name].axes
        if all(set(axes) <= set(held.get(point, "")) for point in points):
            listed = join_with_and([repr(point) for point in points])
            expected = message(
                "held_already",
                "found 0, but {named} are already held ({axes} in control.csv); expected a "
                "standard deviation above 0, or no such row",
                named=listed,
                axes=axes,
            )
            files.log.problem(table.file, expected, table.rows[place], sd_column)


def _refuse_two_values(files, name, table, places):
    """Report a quantity held at two values; the direction of a distance is irrelevant."""
    if name == "plumb_lines":
        return
    if name in ANGLES:
        columns = [f"{ANGLES[name]}_{unit}" for unit in ("deg", "gon", "dms")]
        tolerance = SAME_DEG
    else:
        columns, tolerance = ["dz_m" if name == "height_differences" else "distance_m"], SAME_M
    values = np.column_stack([table.numbers(column) for column in columns])
    kinds = table.of("kind") if name == "distances" else [None] * len(values)
    ends, first = _ends(name, table), {}
    for place in places:
        points = tuple(column[place] for column in ends)
        if None in points:
            continue
        key = (kinds[place] or "spatial", *(sorted(points) if name == "distances" else points))
        earlier = first.setdefault(key, place)
        if not np.allclose(values[earlier], values[place], rtol=0, atol=tolerance, equal_nan=True):
            expected = message(
                "held_at_two",
                "not the value at which row {row} holds it; expected one value, or a "
                "standard deviation above 0",
                row=table.rows[earlier],
            )
            files.log.problem(table.file, expected, table.rows[place], "to")


WITH_POINTS = ("minimal", "inner")


def check_datum(files):
    """Check datum_points and fixed_photo: used by the datum, and defined."""
    if files.values is None:
        return
    given = files.values["adjustment"]
    datum = given["datum"] or "control"
    if given["datum"] is None and not is_not_given(files.raw, "adjustment", "datum"):
        return  # an invalid value, reported already
    _check_photo(files, datum, given["fixed_photo"])
    if given["datum_points"] is not None:
        _check_points(files, datum, given["datum_points"])


def _problem(files, key, expected):
    tell(files.log.problem, files.raw, "adjustment", key, expected)


def _check_photo(files, datum, photo):
    if datum != "fixed_photo":
        if photo is not None:
            expected = message(
                "fixed_photo_unused",
                "given with datum = {datum}; expected only with datum = fixed_photo",
                datum=datum,
            )
            _problem(files, "fixed_photo", expected)
        return
    if is_not_given(files.raw, "adjustment", "fixed_photo"):
        expected = message(
            "fixed_photo_missing", "missing; expected the photo that holds the datum"
        )
        _problem(files, "fixed_photo", expected)
    photos, images = files.tables["photos"], files.tables["image_points"]
    if photo is None or files.is_unreadable("photos") or files.is_unreadable("image_points"):
        return
    names = [] if photos is None else [name for name in photos.of("photo") if name]
    if photo not in names:
        file = files.raw.file_of("photos")
        expected = message(
            "fixed_photo_unknown",
            "found {photo!r}; expected a photo of {where}{hint}",
            photo=photo,
            where=file,
            hint=nearest(photo, names),
        )
        _problem(files, "fixed_photo", expected)
    elif images is None or photo not in images.of("photo"):
        _problem(
            files,
            "fixed_photo",
            message(
                "fixed_photo_bare",
                "found {photo!r}, which has no image points; expected a photo with image points",
                photo=photo,
            ),
        )


def _check_points(files, datum, texts):
    if datum not in WITH_POINTS:
        expected = message(
            "datum_points_unused",
            "given with datum = {datum}; expected only with minimal or inner",
            datum=datum,
        )
        _problem(files, "datum_points", expected)
        return
    names, listed = dict.fromkeys(all_points(files)), set()
    for text in texts:
        name, axes = datum_point(text)
        if not axes:
            expected = message(
                "datum_axes",
                "found {text!r}; expected axes such as {name}:xy or {name}:z, each once",
                text=text,
                name=name,
            )
            _problem(files, "datum_points", expected)
        elif name not in names:
            expected = message(
                "datum_point_unknown",
                "found {name!r}; expected a point of the survey{hint}",
                name=name,
                hint=nearest(name, names),
            )
            _problem(files, "datum_points", expected)
        elif name in listed:
            _problem(
                files,
                "datum_points",
                message("datum_point_twice", "{name!r} is given twice; expected once", name=name),
            )
        elif datum == "minimal":
            _check_known(files, name, axes)
        listed.add(name)


def _check_known(files, name, axes):
    """Require coordinates in control.csv for the points of a minimal datum."""
    control = files.tables["control"]
    if files.is_unreadable("control"):
        return
    known_axes = ""
    if has_rows(control):
        is_point = [
            point == name and system is None
            for point, system in zip(control.of("point"), control.of("system"), strict=True)
        ]
        place = np.flatnonzero(is_point)
        known_axes = "".join(
            axis for axis in "xyz" if not np.all(np.isnan(control.numbers(f"{axis}_m")[place]))
        )
    missing = [axis for axis in axes if axis not in known_axes]
    if missing:
        axes = join_with_and(missing)
        expected = message(
            "datum_point_without",
            "{name!r} has no {axes} in control.csv; expected coordinates there",
            name=name,
            axes=axes,
        )
        _problem(files, "datum_points", expected)
