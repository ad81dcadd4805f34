"""Checks of photos.csv, image_points.csv and film.csv: completeness, format, number of points."""

import numpy as np
from scipy.special import chdtri

from tankcal.camera.comparator import GROSS, KINDS, find_mark_error
from tankcal.errors import SolutionError
from tankcal.job.cameras import (
    cameras_of_photos,
    image_frames,
    imagery_of,
    is_surface,
    readings_of_marks,
    surfaces_of,
)
from tankcal.job.checking import has_rows, is_not_given, refuse_repeated, tell
from tankcal.job.checks.survey.readings import refuse_undefined, tell_rows
from tankcal.job.contract.registers import MARKS
from tankcal.job.tables import nearest
from tankcal.messages import join_with_and, join_with_or, list_some, message

# film.csv: unflatness of the film of a camera or a photo.

FLAT_UM = 0.5  # smaller heights of a film are probably in millimetres


def check_film(files, imagery):
    """Require one camera or photo for each film, and heights that define a surface."""
    table = files.tables["film"]
    if not has_rows(table):
        return
    is_valid = files.sound(table)
    is_given = {
        name: np.array([value is not None for value in table.of(name)], dtype=bool)
        for name in ("camera", "photo")
    }
    for is_wrong, expected in (
        (
            is_given["camera"] & is_given["photo"],
            message("film_of_both", "camera and photo are both given; expected only one of them"),
        ),
        (
            ~is_given["camera"] & ~is_given["photo"],
            message("film_of_none", "blank; expected a camera, or a photo"),
        ),
    ):
        tell_rows(files.log.problem, table, is_valid & is_wrong, "camera", expected)
    refuse_undefined(files, table, "camera", files.registers["cameras"], "cameras")
    photos = files.tables["photos"]
    defined = () if photos is None else dict.fromkeys(photos.of("photo"))
    refuse_undefined(files, table, "photo", defined, "photos")
    for (kind, name), (surface, row) in surfaces_of(table).items():
        if not is_surface(surface):
            expected = message(
                "film_without_surface",
                "the {count} places of the film of {of_kind} {name!r} do not define a "
                "surface; expected 3 or more, each once, not on one line",
                count=len(surface.xy_mm),
                of_kind=kind,
                name=name,
            )
            files.log.problem(table.file, expected, row, "x_mm")
        elif 0 < np.abs(surface.height_mm).max() * 1000 < FLAT_UM:
            expected = message(
                "film_flat",
                "all heights of the film of {name!r} are below {limit_um:g} um: are they in "
                "millimetres?",
                name=name,
                limit_um=FLAT_UM,
            )
            files.log.warning(table.file, expected, row, "height_um")
    _warn_beyond_film(table, imagery, files.log)


def _warn_beyond_film(table, imagery, log):
    for (_, name), (outside, count) in imagery.outside.items():
        if outside:
            expected = message(
                "beyond_film",
                "{beyond} of {count} image points of {name!r} lie outside the places of its film:"
                " the height of the nearest is taken",
                beyond=outside,
                count=count,
                name=name,
            )
            log.warning(table.file, expected)


MIN_POINTS = 3  # smallest number of points that determine an orientation
ANGLES = ("omega", "phi", "kappa")
COORDINATES = ("x_mm", "y_mm", "column_px", "line_px")


def check_images(files):
    """Check photos and their image points."""
    photos, images = files.tables["photos"], files.tables["image_points"]
    if photos is not None:
        refuse_repeated(photos, "photo", files.log)
        refuse_undefined(files, photos, "camera", files.registers["cameras"], "cameras")
        _check_orientations(files, photos)
    if has_rows(images):
        defined = () if photos is None else dict.fromkeys(photos.of("photo"))
        refuse_undefined(files, images, "photo", defined, "photos")
        _check_coordinates(files, images)
        _check_sds(files, images)
        adjustment = None if files.values is None else files.values["adjustment"]
        imagery = imagery_of(files.tables, files.registers["cameras"], adjustment)
        rejected = check_fiducials(files, imagery)
        check_film(files, imagery)
        _check_format(files, images, imagery, rejected)
    if photos is not None:
        _check_counts(files, photos, images)
    if has_rows(photos) and not has_rows(images) and not files.is_unreadable("image_points"):
        names = photos.of("photo")
        first, count = names[0], len(names) - 1
        expected = message(
            "photo_without_rows",
            "no rows; expected the image points of photo {first!r}",
            first=first,
        )
        if count:
            expected = message(
                "photos_without_rows",
                "no rows; expected the image points of photo {first!r} and {count} more photos",
                first=first,
                count=count,
            )
        files.log.problem("image_points.csv", expected)


def _check_orientations(files, photos):
    elements = [(f"{axis}_m", [f"{axis}_m"], [f"s{axis}_m"]) for axis in "xyz"]
    elements += [
        (
            f"{angle}_deg",
            [f"{angle}_{unit}" for unit in ("deg", "gon", "dms")],
            [f"s_{angle}_{unit}" for unit in ("deg", "gon")],
        )
        for angle in ANGLES
    ]
    is_valid = files.sound(photos)
    two_units = message("in_two_units", "given in two units; expected one")
    for column, values, sds in elements:
        count, count_sd = (
            sum(~np.isnan(photos.numbers(name)) for name in names) for names in (values, sds)
        )
        in_two = is_valid & (count > 1)
        tell_rows(files.log.problem, photos, in_two, column, two_units)
        in_two = is_valid & (count_sd > 1)
        tell_rows(files.log.problem, photos, in_two, sds[0], two_units)
        expected = message(
            "sd_without_value",
            "given without {column}; expected both, or no standard deviation",
            column=column,
        )
        alone = is_valid & (count == 0) & (count_sd > 0)
        tell_rows(files.log.problem, photos, alone, sds[0], expected)


def _check_coordinates(files, images):
    """Require both coordinates of each row, in millimetres or in pixels."""
    log, is_valid = files.log, files.sound(images)
    if all(images.columns[name] is None for name in COORDINATES) and is_valid.any():
        expected = message(
            "image_columns_missing",
            "missing columns; expected x_mm and y_mm, or column_px and line_px",
        )
        log.problem(images.file, expected)
        return
    x, y, column, line = (~np.isnan(images.numbers(name)) for name in COORDINATES)
    in_mm, in_px = x | y, column | line
    tell_rows(
        log.problem,
        images,
        is_valid & in_mm & in_px,
        "x_mm",
        message(
            "image_in_two_units",
            "x_mm and y_mm are given together with column_px and line_px; expected only one pair",
        ),
    )
    is_blank = is_valid & ~in_mm & ~in_px
    expected = message("image_blank", "blank; expected x_mm and y_mm, or column_px and line_px")
    tell_rows(log.problem, images, is_blank, "x_mm", expected)
    for is_given, other, name in (
        (x, y, "y_mm"),
        (y, x, "x_mm"),
        (column, line, "line_px"),
        (line, column, "column_px"),
    ):
        tell_rows(
            log.problem,
            images,
            is_valid & is_given & ~other & ~(in_mm & in_px),
            name,
            message("image_of_one", "blank; expected both coordinates"),
        )
    _, pixel = image_frames(images, files.tables["photos"], files.registers["cameras"])
    in_px |= ~np.isnan(images.numbers("s_px")) & np.isnan(images.numbers("sx_um"))
    _tell_cameras_without_pixels(files, images, in_px & np.isnan(pixel[:, 0]))


def _tell_cameras_without_pixels(files, images, is_missing):
    photos, cameras = files.tables["photos"], files.registers["cameras"]
    if photos is None:
        return
    of_photo = dict(zip(photos.of("photo"), photos.of("camera"), strict=True))
    names = {of_photo.get(images.of("photo")[place]) for place in np.flatnonzero(is_missing)}
    for name in sorted(names & set(cameras)):
        if not files.is_given("cameras", name, "pixel_um"):
            expected = message(
                "pixel_of_camera_missing",
                "missing; expected the size of a pixel: image points of this camera are in pixels",
            )
            files.tell_key(files.log.problem, "cameras", name, "pixel_um", expected)


def _check_sds(files, images):
    is_valid = files.sound(images)
    sx, sy, s_px = (~np.isnan(images.numbers(name)) for name in ("sx_um", "sy_um", "s_px"))
    for is_given, other, name in ((sx, sy, "sy_um"), (sy, sx, "sx_um")):
        expected = message("image_sd_of_one", "blank; expected both sx_um and sy_um, or none")
        tell_rows(files.log.problem, images, is_valid & is_given & ~other, name, expected)
    expected = message(
        "image_sd_in_two_units", "given together with sx_um; expected only one of them"
    )
    tell_rows(files.log.problem, images, is_valid & (sx | sy) & s_px, "s_px", expected)
    is_missing = is_valid & ~sx & ~sy & ~s_px
    if files.values is None or not is_missing.any():
        return
    if is_not_given(files.raw, "adjustment", "image_sd_um"):
        row = images.rows[int(np.argmax(is_missing))]
        expected = message(
            "image_sd_missing",
            "missing; expected the standard deviation of image coordinates, micrometres; "
            "rows of {file} without one: {count}, the first of them row {row}",
            file=images.file,
            count=int(is_missing.sum()),
            row=row,
        )
        tell(files.log.problem, files.raw, "adjustment", "image_sd_um", expected)


def _check_format(files, images, imagery, rejected):
    """Require image points within the format, except in rejected photos."""
    size, pixel = image_frames(images, files.tables["photos"], files.registers["cameras"])
    xy = imagery.xy_mm
    with np.errstate(invalid="ignore"):
        outside = np.abs(xy) > size / 2 * (1 + 1e-9)
        is_positive = np.nanmin(xy, axis=0, initial=np.inf) >= 0
    outside[[photo in rejected for photo in images.of("photo")]] = False
    if not outside.any():
        return
    in_px = ~np.isnan(images.numbers("column_px"))
    hint = ""
    if is_positive.all() and not in_px.any():
        hint = message("from_a_corner", ": is it counted from a corner instead of the middle?")
    for place in np.flatnonzero(outside.any(axis=1)):
        axis = int(np.argmax(outside[place]))
        column = (("column_px", "line_px") if in_px[place] else ("x_mm", "y_mm"))[axis]
        pixels = size[place, axis] / pixel[place, axis]
        if in_px[place] and np.isfinite(pixels):
            last = round(pixels) - 0.5
            allowed = message("pixels_allowed", "-0.5 to {last:g} pixels", last=last)
        else:
            half = size[place, axis] / 2
            allowed = message(
                "millimetres_allowed", "at most {half:g} mm from the middle", half=half
            )
        coordinate = images.of(column)[place]
        if images.of("photo")[place] in imagery.fits:
            coordinate = xy[place, axis]
            hint = message("after_transformation", " after the transformation")
        expected = message(
            "outside_format",
            "found {found:g}, outside the format; expected {allowed}{hint}",
            found=coordinate,
            allowed=allowed,
            hint=hint,
        )
        files.log.problem(images.file, expected, images.rows[place], column)


def _check_counts(files, photos, images):
    """Require three points in each photo, unless its orientation is known."""
    if images is None or images.skipped:
        return
    points, is_seen = {}, set(images.of("photo"))
    rows = zip(images.of("photo"), images.of("point"), images.of("use"), strict=True)
    for photo, point, use in rows:
        if use != "check":
            points.setdefault(photo, set()).add(point)
    sds = [f"s{axis}_m" for axis in "xyz"]
    known_elements = sum(~np.isnan(photos.numbers(name)) for name in sds)
    for angle in ANGLES:
        known_elements = known_elements + (
            ~np.isnan(photos.numbers(f"s_{angle}_deg"))
            | ~np.isnan(photos.numbers(f"s_{angle}_gon"))
        )
    for place, (row, name) in enumerate(zip(photos.rows, photos.of("photo"), strict=True)):
        count = len(points.get(name, ()))
        if name is None or count >= MIN_POINTS:
            continue
        if name not in is_seen:
            expected = message(
                "photo_without_points",
                "photo {photo!r} has no image points; it is left out",
                photo=name,
            )
            files.log.warning(photos.file, expected, row, "photo")
        elif known_elements[place] < 6:
            expected = message(
                "photo_of_few_points",
                "photo {name!r} has {count} image points; expected {fewest} or more, or a "
                "standard deviation for each of its six elements",
                name=name,
                count=count,
                fewest=MIN_POINTS,
            )
            if count == 1:
                expected = message(
                    "photo_of_one_point",
                    "photo {name!r} has 1 image point; expected {fewest} or more, or a standard "
                    "deviation for each of its six elements",
                    name=name,
                    fewest=MIN_POINTS,
                )
            files.log.problem(photos.file, expected, row, "photo")


# ---- fiducial marks

LEVEL = 0.001  # significance level of the tests of all photos together
GROWTH = 2.0  # largest factor of the sd of an image coordinate: fourfold variance (Silva)
TOLD = 5  # largest number of photos named in a message
ALIKE = 2  # up to so many degrees of freedom, residuals do not identify a mark


def check_fiducials(files, imagery):
    """Check marks, readings, and the transformations of `imagery`.

    Returns the photos whose image points are not checked further, because of faults of their marks.
    """
    table, cameras = files.tables["fiducials"], files.registers["cameras"]
    for name, given in cameras.items():
        _check_marks(files, name, given)
    if not has_rows(table):
        _warn_unused(files, cameras)
        return set()
    photos = files.tables["photos"]
    defined = () if photos is None else dict.fromkeys(photos.of("photo"))
    refuse_undefined(files, table, "photo", defined, "photos")
    _refuse_missing_sd(files, table)
    if photos is None:
        return set()
    of_photos = cameras_of_photos(photos, cameras)
    _refuse_unknown_marks(files, table, of_photos)
    rejected = _check_photos(files, table, of_photos, imagery)
    return rejected | _check_images_of_comparator(files, table, of_photos)


def _check_marks(files, name, given):
    places = {}
    for mark, place in given[MARKS].items():
        key = f"{MARKS}.{mark}"
        if len(place) != 2:
            expected = message(
                "mark_of_two",
                "{count} numbers; expected two, such as [-83.012, 0.021]",
                count=len(place),
            )
            files.tell_key(files.log.problem, "cameras", name, key, expected)
        elif place in places:
            expected = message(
                "marks_in_one_place",
                "at the same place as mark {other!r}; expected each mark at its own place",
                other=places[place],
            )
            files.tell_key(files.log.problem, "cameras", name, key, expected)
        places.setdefault(place, mark)


def _warn_unused(files, cameras):
    for name, given in cameras.items():
        if given[MARKS]:
            key = f"{MARKS}.{next(iter(given[MARKS]))}"
            expected = message(
                "marks_unread", "without effect: there are no readings of marks in fiducials.csv"
            )
            files.tell_key(files.log.warning, "cameras", name, key, expected)


def _refuse_missing_sd(files, table):
    is_missing = files.sound(table) & np.isnan(table.numbers("s_um"))
    if files.values is None or not is_missing.any():
        return
    if is_not_given(files.raw, "adjustment", "image_sd_um"):
        expected = message(
            "mark_sd_missing",
            "missing; expected a value for the rows of {file} without s_um, the first of "
            "them row {row}",
            file=table.file,
            row=table.rows[int(np.argmax(is_missing))],
        )
        tell(files.log.problem, files.raw, "adjustment", "image_sd_um", expected)


def _refuse_unknown_marks(files, table, of_photos):
    """Report marks that their camera lacks; once for a camera without marks."""
    without_marks, reported = {}, set()
    for row, photo, mark in zip(table.rows, table.of("photo"), table.of("mark"), strict=True):
        if photo not in of_photos or mark is None:
            continue
        camera, given = of_photos[photo]
        if not any(key.startswith(f"{MARKS}.") for key in _keys(files, camera)):
            without_marks.setdefault(camera, row)
        elif f"{MARKS}.{mark}" not in _keys(files, camera) and (camera, mark) not in reported:
            reported.add((camera, mark))
            hint = nearest(mark, given[MARKS])
            expected = message(
                "mark_unknown",
                "found {mark!r}; expected a mark of camera {camera!r} in cameras.toml{hint}",
                mark=mark,
                camera=camera,
                hint=hint,
            )
            files.log.problem(table.file, expected, row, "mark")
    for camera, row in without_marks.items():
        expected = message(
            "marks_not_calibrated",
            "marks of camera {camera!r}, which has none in cameras.toml; expected their "
            "calibrated coordinates there, as [cameras.{camera}.{marks}]",
            camera=camera,
            marks=MARKS,
        )
        files.log.problem(table.file, expected, row, "mark")


def _keys(files, camera):
    return files.raw.registers["cameras"].entries[camera]


def _check_photos(files, table, of_photos, imagery):
    """Check the transformation of each photo; returns the photos without one."""
    uncontrolled, mirrored, coarse, rejected = [], [], [], set()
    settings = {"image_sd_um": None} if files.values is None else files.values["adjustment"]
    settings = settings | {
        "image_sd_um": settings["image_sd_um"] or 1.0
    }  # a missing sd is reported already
    for photo, readings in readings_of_marks(table, of_photos, settings).items():
        _warn_rejected(files, table, readings.rejected)
        if not len(readings.rows) and not readings.rejected:
            continue
        if not _is_possible(files, table, photo, readings):
            rejected.add(photo)
            continue
        if len(set(readings.names)) == KINDS[readings.kind]:
            uncontrolled.append(photo)
        fit = imagery.fits.get(photo)
        if fit is None:
            continue
        if fit.transformation.is_mirrored:
            mirrored.append(photo)
        if fit.growth > GROWTH:
            coarse.append((fit.growth, photo))
        _test_fit(files, table, photo, fit, readings, len(imagery.fits))
    _warn_of_all(files, table, uncontrolled, mirrored, coarse)
    return rejected


def _is_possible(files, table, photo, readings):
    """Return False, after a problem, if the marks of a photo cannot be correct."""
    row = table.rows[readings.rows[0]] if len(readings.rows) else None
    names, fewest = list(dict.fromkeys(readings.names)), KINDS[readings.kind]
    if len(names) < fewest:
        left = message("left_over", " left") if readings.rejected else ""
        expected = message(
            "marks_too_few",
            "photo {photo!r} has {count} marks{left}; expected {fewest} or more for "
            "fiducial_transformation = {of_kind}",
            photo=photo,
            count=len(names),
            left=left,
            fewest=fewest,
            of_kind=readings.kind,
        )
        row = row if row is not None else readings.rejected[0].row
        files.log.problem(table.file, expected, row, "mark")
        return False
    repeated = readings.repeats
    suspected = find_mark_error(repeated.mean, readings.marks_mm[repeated.first], readings.kind)
    if suspected is None:
        try:
            readings.fit(photo, None)
        except SolutionError as error:
            files.log.problem(
                table.file,
                message("of_photo", "photo {photo!r}: {error}", photo=photo, error=error.args[0]),
                row,
                "mark",
            )
            return False
        return True
    if suspected.marks:
        row = table.rows[readings.rows[repeated.first[suspected.marks[0][0]]]]
    files.log.problem(table.file, _suspicion_message(photo, suspected, names), row, "mark")
    return False


def _suspicion_message(photo, suspicion_of_marks, names):
    """Message about a comparator.MarkError."""
    listed = [join_with_and([repr(names[i]) for i in group]) for group in suspicion_of_marks.marks]
    if suspicion_of_marks.what == "unit":
        times = 1 / suspicion_of_marks.size
        return message(
            "marks_in_other_unit",
            "the marks of photo {photo!r} were read {times:.4g} times as large as they are "
            "calibrated; expected millimetres both here and in cameras.toml",
            photo=photo,
            times=times,
        )
    if suspicion_of_marks.what == "sheared":
        share = 100 * (suspicion_of_marks.size - 1)
        return message(
            "marks_sheared",
            "the marks of photo {photo!r} give a transformation with a shear of {share:.2g} "
            "%: are marks confused?",
            photo=photo,
            share=share,
        )
    if suspicion_of_marks.what == "exchanged" and suspicion_of_marks.size < GROSS:
        marks = join_with_or(listed)
        return message(
            "marks_exchanged",
            "the marks of photo {photo!r} fit no transformation of a comparator unless "
            "{marks} exchange their names",
            photo=photo,
            marks=marks,
        )
    return _misplaced_marks_message(photo, suspicion_of_marks, listed)


def _misplaced_marks_message(photo, suspicion_of_marks, listed):
    """Message about marks far from their calibrated positions."""
    share = 100 * suspicion_of_marks.size
    start = message(
        "marks_off",
        "the marks of photo {photo!r} miss their calibrated places by {share:.2g} % of their "
        "extent",
        photo=photo,
        share=share,
    )
    if suspicion_of_marks.what == "mirrored":
        return message(
            "marks_mirrored",
            "{start}, and fit mirrored: the plate was read from the other side; change the "
            "sign of x, or set fiducial_transformation = affine",
            start=start,
        )
    if suspicion_of_marks.what == "exchanged":
        marks = join_with_or(listed)
        return message(
            "marks_fit_exchanged",
            "{start}, and fit when {marks} are exchanged",
            start=start,
            marks=marks,
        )
    worst = listed[0]
    if suspicion_of_marks.what == "wrong":
        return message(
            "mark_wrong",
            "{start}; without {worst} the others fit: is it misread, or is it another mark?",
            start=start,
            worst=worst,
        )
    return message(
        "marks_confused",
        "{start}, most of all {worst}: are marks confused, misread, or of another camera?",
        start=start,
        worst=worst,
    )


def _test_fit(files, table, photo, fit, readings, photos):
    """Warn if the residuals of the marks of a photo exceed their standard deviations."""
    fitted = fit.transformation
    if fitted.dof < 1 or fitted.chi2 <= chdtri(fitted.dof, LEVEL / photos):
        return
    worst = int(np.argmax(np.abs(fit.residual_mm).max(axis=1)))
    of_mark = message("no_single_mark", "which mark it is cannot be told")
    if fitted.dof > ALIKE:
        of_mark = message("of_mark", "of mark {mark!r}", mark=fit.marks[worst])
    expected = message(
        "marks_fit_badly",
        "the marks of photo {photo!r} fit {times:.1f} times worse than their standard "
        "deviations say (largest residual {largest_um:.1f} um, {of}); the transformation "
        "therefore multiplies the sd of an image coordinate by up to {growth:.1f}",
        photo=photo,
        times=fitted.sigma0,
        largest_um=1e3 * np.abs(fit.residual_mm[worst]).max(),
        of=of_mark,
        # variance of the transformation, scaled by its residuals
        growth=np.sqrt(1 + (fit.growth**2 - 1) * fitted.sigma0**2),
    )
    files.log.warning(table.file, expected, table.rows[readings.rows[0]], "mark")


def _warn_rejected(files, table, rejected):
    for mark in rejected:
        expected = message(
            "mark_rejected",
            "the {count} readings of mark {mark!r} of photo {photo!r} are rejected: their standard"
            " deviation of {sd_um:.1f} um exceeds reading_limit_um",
            count=mark.count,
            mark=mark.name,
            photo=mark.photo,
            sd_um=1e3 * np.nanmax(mark.sd_mm),
        )
        files.log.warning(table.file, expected, mark.row, "mark")


def _warn_of_all(files, table, uncontrolled, mirrored, coarse):
    if uncontrolled:
        expected = message(
            "marks_uncontrolled",
            "photos {photos} have no more marks than the transformation needs: a misread "
            "mark cannot be detected",
            photos=list_some(uncontrolled, TOLD),
        )
        files.log.warning(table.file, expected)
    if mirrored:
        expected = message(
            "read_mirrored",
            "photos {photos} were read mirrored; the transformation turns them back (was the "
            "plate turned over, or are marks exchanged?)",
            photos=list_some(mirrored, TOLD),
        )
        files.log.warning(table.file, expected)
    if coarse:
        growth, photo = max(coarse)
        expected = message(
            "transformation_coarse",
            "the transformation makes the sd of image coordinates up to {growth:.1f} times "
            "as large in photo {photo!r} (more than {limit:g} times in {photos} photos): the "
            "marks are too few, too close together or read too coarsely",
            growth=growth,
            photo=photo,
            limit=GROWTH,
            photos=len(coarse),
        )
        files.log.warning(table.file, expected)


def _check_images_of_comparator(files, table, of_photos):
    """Require comparator readings, in millimetres, for all photos of a camera or for none.

    Returns the photos without marks.
    """
    images = files.tables["image_points"]
    with_marks = set(table.of("photo"))
    cameras = {camera for photo, (camera, _) in of_photos.items() if photo in with_marks}
    first_rows, without_marks = {}, set()
    for row, photo in zip(images.rows, images.of("photo"), strict=True):
        first_rows.setdefault(photo, row)
    for photo, row in first_rows.items():
        if photo in of_photos and photo not in with_marks and of_photos[photo][0] in cameras:
            expected = message(
                "photo_without_marks",
                "photo {photo!r} has no marks in {file}, others of its camera have; expected "
                "them for all",
                photo=photo,
                file=table.file,
            )
            files.log.problem(images.file, expected, row, "photo")
            without_marks.add(photo)
    in_px = ~np.isnan(images.numbers("column_px")) | ~np.isnan(images.numbers("s_px"))
    in_px &= np.array([photo in with_marks for photo in images.of("photo")], dtype=bool)
    expected = message(
        "pixels_beside_marks",
        "in pixels, in a photo whose marks are read in {file}; expected x_mm and y_mm of the "
        "same comparator",
        file=table.file,
    )
    tell_rows(files.log.problem, images, in_px, "column_px", expected)
    return without_marks
