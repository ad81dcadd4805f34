"""Checks of photos.csv, image_points.csv and film.csv: completeness, format, number of points."""

import numpy as np

from tankcal.job.cameras import image_frames
from tankcal.job.checking import has_rows, is_not_given, refuse_repeated, tell
from tankcal.job.checks.survey.fiducials import check_fiducials
from tankcal.job.checks.survey.files import refuse_undefined, tell_rows
from tankcal.job.imagery import imagery_of, is_surface, surfaces_of
from tankcal.messages import message

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
    for is_told, expected in (
        (
            is_given["camera"] & is_given["photo"],
            message("film_of_both", "camera and photo are both given; expected only one of them"),
        ),
        (
            ~is_given["camera"] & ~is_given["photo"],
            message("film_of_none", "blank; expected a camera, or a photo"),
        ),
    ):
        tell_rows(files.log.problem, table, is_valid & is_told, "camera", expected)
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
