"""photos.csv and image_points.csv: complete, in the format, and enough points in each photo."""

import numpy as np

from tankcal.job.cameras import image_frames
from tankcal.job.checks.common import has_rows, is_not_given, refuse_repeated, tell
from tankcal.job.checks.survey.fiducials import check_fiducials
from tankcal.job.checks.survey.files import refuse_undefined, tell_rows
from tankcal.job.checks.survey.film import check_film
from tankcal.job.imagery import imagery_of
from tankcal.messages import message

MIN_POINTS = 3
ANGLES = ("omega", "phi", "kappa")
COORDINATES = ("x_mm", "y_mm", "column_px", "line_px")
IN_MM, IN_PX = "x_mm and y_mm", "column_px and line_px"


def check_images(files):
    """Photos and their image points."""
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
        told = check_fiducials(files, imagery)
        check_film(files, imagery)
        _check_format(files, images, imagery, told)
    if photos is not None:
        _check_counts(files, photos, images)
    if has_rows(photos) and not has_rows(images) and not files.is_unreadable("image_points"):
        names = photos.of("photo")
        more = f" and {len(names) - 1} more photos" if len(names) > 1 else ""
        expected = f"no rows; expected the image points of photo {names[0]!r}{more}"
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
    sound = files.sound(photos)
    for column, values, sds in elements:
        count, count_sd = (
            sum(~np.isnan(photos.numbers(name)) for name in names) for names in (values, sds)
        )
        in_two = sound & (count > 1)
        tell_rows(files.log.problem, photos, in_two, column, "in two units; expected one")
        in_two = sound & (count_sd > 1)
        tell_rows(files.log.problem, photos, in_two, sds[0], "in two units; expected one")
        expected = f"given without {column}; expected both, or no standard deviation"
        alone = sound & (count == 0) & (count_sd > 0)
        tell_rows(files.log.problem, photos, alone, sds[0], expected)


def _check_coordinates(files, images):
    """Each row in millimetres or in pixels, both coordinates."""
    log, sound = files.log, files.sound(images)
    if all(images.columns[name] is None for name in COORDINATES) and sound.any():
        log.problem(images.file, f"missing columns; expected {IN_MM}, or {IN_PX}")
        return
    x, y, column, line = (~np.isnan(images.numbers(name)) for name in COORDINATES)
    in_mm, in_px = x | y, column | line
    tell_rows(
        log.problem,
        images,
        sound & in_mm & in_px,
        "x_mm",
        f"{IN_MM} and {IN_PX} given; expected one of them",
    )
    nothing = sound & ~in_mm & ~in_px
    tell_rows(log.problem, images, nothing, "x_mm", f"blank; expected {IN_MM}, or {IN_PX}")
    for one, other, name in (
        (x, y, "y_mm"),
        (y, x, "x_mm"),
        (column, line, "line_px"),
        (line, column, "column_px"),
    ):
        tell_rows(
            log.problem,
            images,
            sound & one & ~other & ~(in_mm & in_px),
            name,
            "blank; expected both coordinates",
        )
    _, pixel = image_frames(images, files.tables["photos"], files.registers["cameras"])
    in_px |= ~np.isnan(images.numbers("s_px")) & np.isnan(images.numbers("sx_um"))
    _tell_cameras_without_pixels(files, images, in_px & np.isnan(pixel[:, 0]))


def _tell_cameras_without_pixels(files, images, lacking):
    photos, cameras = files.tables["photos"], files.registers["cameras"]
    if photos is None:
        return
    of_photo = dict(zip(photos.of("photo"), photos.of("camera"), strict=True))
    names = {of_photo.get(images.of("photo")[place]) for place in np.flatnonzero(lacking)}
    for name in sorted(names & set(cameras)):
        if not files.is_given("cameras", name, "pixel_um"):
            expected = "missing; image points of this camera are in pixels"
            files.tell_key(files.log.problem, "cameras", name, "pixel_um", expected)


def _check_sds(files, images):
    sound = files.sound(images)
    sx, sy, s_px = (~np.isnan(images.numbers(name)) for name in ("sx_um", "sy_um", "s_px"))
    for one, other, name in ((sx, sy, "sy_um"), (sy, sx, "sx_um")):
        expected = "blank; expected both sx_um and sy_um, or none"
        tell_rows(files.log.problem, images, sound & one & ~other, name, expected)
    expected = "given beside sx_um; expected one of them"
    tell_rows(files.log.problem, images, sound & (sx | sy) & s_px, "s_px", expected)
    lacking = sound & ~sx & ~sy & ~s_px
    if files.values is None or not lacking.any():
        return
    if is_not_given(files.raw, "adjustment", "image_sd_um"):
        row = images.rows[int(np.argmax(lacking))]
        expected = (
            "missing; expected the standard deviation of image coordinates, micrometres; rows of"
            f" {images.file} that carry none: {int(lacking.sum())}, the first of them row {row}"
        )
        tell(files.log.problem, files.raw, "adjustment", "image_sd_um", expected)


def _check_format(files, images, imagery, told):
    """Image points within the format, but for those of photos that are told already."""
    size, pixel = image_frames(images, files.tables["photos"], files.registers["cameras"])
    xy = imagery.xy_mm
    with np.errstate(invalid="ignore"):
        outside = np.abs(xy) > size / 2 * (1 + 1e-9)
        of_corner = np.nanmin(xy, axis=0, initial=np.inf) >= 0
    outside[[photo in told for photo in images.of("photo")]] = False
    if not outside.any():
        return
    in_px = ~np.isnan(images.numbers("column_px"))
    hint = ""
    if of_corner.all() and not in_px.any():
        hint = ": counted from a corner instead of the middle?"
    for place in np.flatnonzero(outside.any(axis=1)):
        axis = int(np.argmax(outside[place]))
        column = (("column_px", "line_px") if in_px[place] else ("x_mm", "y_mm"))[axis]
        pixels = size[place, axis] / pixel[place, axis]
        if in_px[place] and np.isfinite(pixels):
            count = round(pixels)
            allowed = f"-0.5 to {count - 0.5:g} pixels"
        else:
            allowed = f"at most {size[place, axis] / 2:g} mm from the middle"
        found = images.of(column)[place]
        if images.of("photo")[place] in imagery.fits:
            found, hint = xy[place, axis], " after the transformation"
        expected = f"found {found:g}, outside the format; expected {allowed}{hint}"
        files.log.problem(images.file, expected, images.rows[place], column)


def _check_counts(files, photos, images):
    """Three points fix a photo; fewer do where its orientation is known."""
    if images is None or images.skipped:
        return
    points, is_seen = {}, set(images.of("photo"))
    rows = zip(images.of("photo"), images.of("point"), images.of("use"), strict=True)
    for photo, point, use in rows:
        if use != "check":
            points.setdefault(photo, set()).add(point)
    sds = [f"s{axis}_m" for axis in "xyz"]
    known = sum(~np.isnan(photos.numbers(name)) for name in sds)
    for angle in ANGLES:
        known = known + (
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
        elif known[place] < 6:
            expected = (
                f"photo {name!r} has {count} image point{'' if count == 1 else 's'}; expected"
                f" {MIN_POINTS} or more, or a standard deviation for each of its six elements"
            )
            files.log.problem(photos.file, expected, row, "photo")
