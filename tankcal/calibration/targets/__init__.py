"""Measurement of targets in photographs: coded squares (ArUco, AprilTag) and white circles.

Measurement of targets in photographs, from picture files to image_points.csv.

image_points.csv and the list of refused candidates are written both, or neither.
"""

import io
import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal.calibration.targets.circles import eccentricity_px, read_circles
from tankcal.calibration.targets.coded import read_coded
from tankcal.calibration.targets.results import (
    CORNERS,
    ENCODINGS,
    REASONS,
    Circle,
    Marker,
    PhotoTargets,
    RefusedTarget,
    load_dictionary,
    match_circles_to_places,
    opencv,
    photo_name,
    read_names,
    read_picture,
    read_places,
    target_image,
    warn_of_unused,
)
from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.fields import Refused as InvalidName
from tankcal.job.tables import Log, shown
from tankcal.messages import join_with_or, message
from tankcal.text.delimited import write_guarded

__all__ = [
    "REASONS",
    "Circle",
    "ImagePoint",
    "Marker",
    "PhotoReading",
    "PhotoTargets",
    "RefusedTarget",
    "TargetReport",
    "TargetSettings",
    "eccentricity_px",
    "read_circles",
    "read_coded",
    "read_photographs",
    "target_image",
    "write_image_points",
]


WHAT = ("corners", "centres", "circles")
HEADINGS = ("photo", "point", "column_px", "line_px", "s_px")
REFUSED_HEADINGS = ("photo", "code", "id", "column_px", "line_px", "detail", "reason")
WARNED_CHANCE = 1e-4  # probability of a code in random cells above which a warning is given


@dataclass(frozen=True)
class TargetSettings:
    """Settings of the measurement.

    Attributes
    ----------
    what : str
        "corners" of coded targets (name-1 to name-4), their "centres", or "circles".
    dictionary : str
        Name of the dictionary of coded targets in OpenCV.
    names : Path or None
        CSV file with id and point. If None, the id is the name, and all ids of the dictionary are
        accepted.
    places : Path or None
        CSV file with photo, point, column_px, line_px, for circles.
    reach_px : float
        Largest distance of a circle from its approximate position, px.
    smallest_px : float or None
        Least side or diameter, px; by default 2.5 px per cell, or 6 px for circles.
    largest_px : float or None
        Largest diameter of circles, px; by default a tenth of the photo.
    bit_errors : int
        Largest number of wrong cells of a code.
    encoding : str
        Relation of grey values to light, one of pictures.ENCODINGS.
    """

    what: str = "corners"
    dictionary: str = "DICT_5X5_100"
    names: Path | None = None
    places: Path | None = None
    reach_px: float = 15.0
    smallest_px: float | None = None
    largest_px: float | None = None
    bit_errors: int = 0
    encoding: str = "by_file"


@dataclass(frozen=True)
class ImagePoint:
    """Measured image point: name, column and line (2,), standard deviation of each, px."""

    point: str
    place_px: np.ndarray
    sd_px: float


@dataclass(frozen=True)
class PhotoReading:
    """Result of the measurement of one photo.

    Attributes
    ----------
    photo : str
        Name of the photo.
    size_px : tuple of int
        Columns and lines.
    orientation : int
        Orientation tag of the file (1: no rotation). It is not applied.
    targets : tuple of str
        Names of the targets, without suffixes of corners.
    points : tuple of ImagePoint
        Image points.
    refused : tuple of RefusedTarget
        RefusedTarget candidates.
    """

    photo: str
    size_px: tuple
    orientation: int
    targets: tuple
    points: tuple
    refused: tuple


@dataclass(frozen=True)
class TargetReport:
    """Result of the measurement of several photos.

    Attributes
    ----------
    photos : tuple of PhotoReading
        Result for each photo.
    path, refused_path : Path
        Files of the image points and of the refused candidates.
    targets, points : int
        Number of targets and of image points in all photos.
    refused : dict
        {code of the reason: number of candidates}.
    warnings : tuple
        Warnings.
    """

    photos: tuple
    path: Path
    refused_path: Path
    targets: int
    points: int
    refused: dict
    warnings: tuple


def read_photographs(paths, out_csv, settings=None, replace=False, progress=None):
    """Measure targets in photographs and write image_points.csv.

    No file is written if there is a problem.

    Parameters
    ----------
    paths : sequence of path-like
        Picture files; the name of a photo is its file name without extension.
    out_csv : path-like
        Path of image_points.csv; refused candidates are written to ..._refused.csv in its folder.
    settings : TargetSettings, optional
        Settings; by default the corners of coded targets are measured.
    replace : bool, optional
        Whether existing files may be overwritten.
    progress : callable, optional
        Called as progress(text, done, total) before each photo and at the end.

    Returns
    -------
    TargetReport

    Raises
    ------
    InputError
        If files, names or settings are invalid; the error lists all problems.
    """
    settings, log = settings or TargetSettings(), Log()
    opencv()
    names, places = _read_settings(settings, log)
    check_free(out_csv, replace, log)
    titles = _name_photos(paths, log)
    if places:
        warn_of_unused(places, [title for _, title in titles], Path(settings.places).name, log)
    photos, encodings = [], Counter()
    for done, (path, title) in enumerate(titles):
        if progress:
            progress(title, done, len(titles))
        picture = read_picture(
            path, log, settings.encoding if settings.encoding in ENCODINGS else None
        )
        if picture is not None:
            encodings[picture.encoding] += 1
        if picture is not None and not log.problems:
            photos.append(_measure_photo(title, picture, settings, names, places, log))
    log.stop_if_problems()
    _warn_of_photos(photos, settings, names, log)
    if encodings["srgb"] and settings.encoding == "by_file":
        expected = message(
            "targets_srgb",
            "JPEG files ({count}): grey values are taken as sRGB; if that is wrong, edges "
            "are half a pixel off",
            count=encodings["srgb"],
        )
        log.warning("photographs", expected)
    written = write_image_points(photos, out_csv, replace)
    if progress:
        progress(message("targets_done", "done"), len(titles), len(titles))
    return TargetReport(
        tuple(photos),
        *written,
        sum(len(photo.targets) for photo in photos),
        sum(len(photo.points) for photo in photos),
        dict(Counter(candidate.code for photo in photos for candidate in photo.refused)),
        tuple(log.warnings),
    )


def _read_settings(settings, log):
    """Return {id: name} or None, and {photo: [Place]}; problems of the settings are logged."""
    for value, known, name in (
        (settings.what, WHAT, "what"),
        (settings.encoding, ENCODINGS, "encoding"),
    ):
        if value not in known:
            expected = message(
                "targets_choice",
                "found {found}; expected {known}",
                found=shown(value),
                known=join_with_or([*known]),
            )
            log.problem(name, expected)
    for name in ("reach_px", "smallest_px", "largest_px", "bit_errors"):
        value = getattr(settings, name)
        if value is not None and not 0 <= value < 1e5:
            log.problem(
                name,
                message(
                    "targets_number", "found {found:g}; expected a number of 0 or more", found=value
                ),
            )
    if settings.what == "circles":
        return _read_circle_places(settings, log)
    return _read_code_names(settings, log)


def _read_circle_places(settings, log):
    """Return None and {photo: [Place]}; problems of the settings are logged."""
    if settings.names is not None:
        log.problem(
            "names",
            message("targets_names_of_circles", "only for coded targets; circles have `places`"),
        )
    if settings.places is None:
        log.problem(
            "places",
            message(
                "targets_places_missing",
                "missing; expected approximate places, which give the circles their names",
            ),
        )
        return None, {}
    return None, read_places(Path(settings.places), log)


def _read_code_names(settings, log):
    """Return {id: name} or None, and no positions; problems of the settings are logged."""
    if settings.places is not None:
        log.problem(
            "places",
            message("targets_places_of_codes", "only for circles; coded targets have `names`"),
        )
    known = load_dictionary(settings.dictionary)
    if settings.names is None:
        return None, {}
    names = read_names(Path(settings.names), log, CORNERS if settings.what == "corners" else ())
    beyond = [number for number in names if number >= len(known.cells)]
    if beyond:
        listed = ", ".join(str(number) for number in beyond[:5])
        expected = message(
            "targets_beyond",
            "found {numbers}; expected 0 to {last} of {dictionary}",
            numbers=listed,
            last=len(known.cells) - 1,
            dictionary=known.name,
        )
        log.problem(Path(settings.names).name, expected, column="id")
    return names, {}


def _name_photos(paths, log):
    """Return [(path, name of the photo)]; invalid names are logged."""
    titles, file_of_title = [], {}
    for path in map(Path, paths):
        try:
            title = photo_name(path)
        except InvalidName as refusal:
            log.problem(
                path.name,
                message("targets_photo_name", "as the name of a photo: {refusal}", refusal=refusal),
            )
            continue
        if title in file_of_title:
            expected = message(
                "targets_photo_twice",
                "photo {photo!r} is already read from {file}; expected another file name",
                photo=title,
                file=file_of_title[title],
            )
            log.problem(path.name, expected)
        file_of_title.setdefault(title, path.name)
        titles.append((path, title))
    if not file_of_title and not log.problems:
        log.problem(
            "photographs",
            message("targets_none_given", "no photograph given; expected one or more"),
        )
    return titles


def _measure_photo(title, picture, settings, names, places, log):
    """Measure one picture; return a PhotoReading."""
    if settings.what == "circles":
        return _measure_circles(title, picture, settings, places.get(title, []), log)
    measured = read_coded(
        picture.image, settings.dictionary, names, settings.bit_errors, settings.smallest_px
    )
    named = [
        (target, str(target.id) if names is None else names[target.id])
        for target in measured.targets
    ]
    if settings.what == "centres":
        points = [ImagePoint(name, target.centre_px, target.centre_sd_px) for target, name in named]
    else:
        points = [
            ImagePoint(name + corner, place, float(sd))
            for target, name in named
            for corner, place, sd in zip(CORNERS, target.corners_px, target.sd_px, strict=True)
        ]
    targets = tuple(name for _, name in named)
    if measured.doubtful:
        listed = ", ".join(str(number) for number in measured.doubtful[:10])
        expected = message(
            "targets_mirror",
            "ids that read the same in a mirror image, with corners exchanged: {numbers}",
            numbers=listed,
        )
        log.warning(title, expected)
    return PhotoReading(
        title, measured.size_px, picture.orientation, targets, tuple(points), measured.refused
    )


def _measure_circles(title, picture, settings, places, log):
    """Measure circles in one picture and name them by positions; return a PhotoReading."""
    measured = read_circles(picture.image, settings.smallest_px or 6.0, settings.largest_px)
    named, refused, missing = match_circles_to_places(measured.targets, places, settings.reach_px)
    if missing:
        listed = ", ".join(repr(name) for name in missing[:5])
        expected = message(
            "targets_no_circle",
            "no circle within {reach:g} px of {count} places: {names}",
            reach=settings.reach_px,
            count=len(missing),
            names=listed,
        )
        log.warning(title, expected)
    points = tuple(ImagePoint(name, circle.centre_px, circle.sd_px) for name, circle in named)
    refused = [
        RefusedTarget(code, circle.centre_px, None, {"half_axis_px": float(circle.semi_axes_px[0])})
        for code, circle in refused
    ]
    return PhotoReading(
        title,
        measured.size_px,
        picture.orientation,
        tuple(name for name, _ in named),
        points,
        (*measured.refused, *refused),
    )


def _warn_of_photos(photos, settings, names, log):
    """Log warnings about photos without targets, rotation tags, sizes, names and chance codes."""
    for photo in photos:
        if not photo.targets:
            log.warning(photo.photo, message("targets_none_found", "no targets found"))
        if photo.orientation != 1:
            expected = message(
                "targets_turned",
                "the file asks for the picture to be rotated (orientation {orientation}); it "
                "is not rotated: columns and lines are those of the sensor",
                orientation=photo.orientation,
            )
            log.warning(photo.photo, expected)
    sizes = Counter(photo.size_px for photo in photos)
    if len(sizes) > 1:
        listed = ", ".join(f"{a} x {b} ({count})" for (a, b), count in sizes.most_common(5))
        log.warning(
            "photographs",
            message(
                "targets_sizes",
                "of several sizes: {sizes}; photos of one camera have one",
                sizes=listed,
            ),
        )
    _warn_of_names(photos, settings, names, log)
    if settings.what != "circles" and names is None:
        chance = load_dictionary(settings.dictionary).chance
        if chance > WARNED_CHANCE:
            expected = message(
                "targets_chance",
                "by chance, one of {frames:.0f} black frames with anything inside is read as "
                "a code; give the list of the ids that were placed",
                frames=1 / chance,
            )
            log.warning("dictionary", expected)


def _warn_of_names(photos, settings, names, log):
    """Log warnings about targets in a single photo, and listed names in no photo."""
    times = Counter(name for photo in photos for name in photo.targets)
    once = [name for name, count in times.items() if count == 1]
    if once and len(photos) > 1:
        listed = ", ".join(repr(name) for name in once[:10])
        log.warning(
            "photographs",
            message(
                "targets_once",
                "targets that are in one photo only: {count}: {names}",
                count=len(once),
                names=listed,
            ),
        )
    unseen = [name for name in (names or {}).values() if name not in times]
    if unseen:
        listed = ", ".join(repr(name) for name in unseen[:10])
        log.warning(
            Path(settings.names).name,
            message(
                "targets_unseen",
                "listed, but found in no photo: {count}: {names}",
                count=len(unseen),
                names=listed,
            ),
        )


def make_refused_path(path):
    """Path of the list of refused candidates: image_points_refused.csv for image_points.csv."""
    path = Path(path)
    return path.with_name(f"{path.stem}_refused.csv")


def _message_exists():
    return message(
        "targets_there_already",
        "already exists; expected another name, or the choice to replace it",
    )


def check_free(path, replace, log):
    """Log a problem if the folder is missing, or if a file exists and `replace` is false."""
    for file in (Path(path), make_refused_path(path)):
        if not file.parent.is_dir():
            log.problem(file.name, message("targets_no_folder", "its folder does not exist"))
            return
        if file.exists() and not replace:
            log.problem(file.name, _message_exists())


def write_image_points(photos, path, replace=False):
    """Write image_points.csv and the list of refused candidates.

    Parameters
    ----------
    photos : sequence of PhotoReading
        Results of the photos, in the order of the rows.
    path : path-like
        Path of image_points.csv.
    replace : bool, optional
        Whether existing files may be overwritten.

    Returns
    -------
    tuple of Path
        Paths of both files.

    Raises
    ------
    InputError
        If a file exists or cannot be written. No file is then written.
    """
    existing = [item.name for item in (Path(path), make_refused_path(path)) if item.exists()]
    if existing and not replace:
        expected = _message_exists()
        raise InputError([Problem(name, expected) for name in existing])
    rows = [
        (photo.photo, item.point, *(f"{x:.4f}" for x in item.place_px), f"{item.sd_px:.4f}")
        for photo in photos
        for item in photo.points
    ]
    refused = [_format_refused(photo.photo, item) for photo in photos for item in photo.refused]
    texts = {
        make_refused_path(path): _format_csv(REFUSED_HEADINGS, refused),
        Path(path): _format_csv(HEADINGS, rows),
    }
    drafts = {target: target.with_name(f".{target.name}.part") for target in texts}
    try:
        for target, text in texts.items():
            drafts[target].write_text(text, encoding="utf-8", newline="")
        for target, draft in drafts.items():
            os.replace(draft, target)
    except OSError as error:
        for draft in drafts.values():
            draft.unlink(missing_ok=True)
        raise InputError(
            Problem(
                Path(path).name,
                message(
                    "targets_not_written", "cannot be written ({reason})", reason=reason_of(error)
                ),
            )
        ) from None
    return Path(path), make_refused_path(path)


def _format_refused(photo, refused):
    """Cells of a refused candidate in the order of REFUSED_HEADINGS."""
    column, line = refused.place_px
    detail = "; ".join(f"{key} {value:.3g}" for key, value in refused.detail.items())
    number = "" if refused.id is None else refused.id
    return (
        photo,
        refused.code,
        number,
        f"{column:.1f}",
        f"{line:.1f}",
        detail,
        REASONS[refused.code],
    )


def _format_csv(headings, rows):
    """Format rows as CSV; a cell with a comma is quoted, and no cell contains a line break."""
    stream = io.StringIO()
    write_guarded(stream, [headings, *rows])
    return stream.getvalue()
