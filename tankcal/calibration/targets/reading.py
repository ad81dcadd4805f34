"""Measurement of targets in photographs, from picture files to image_points.csv."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from tankcal.calibration.targets.circles import read_circles
from tankcal.calibration.targets.coded import read_coded
from tankcal.calibration.targets.dictionaries import dictionary_of
from tankcal.calibration.targets.found import Refused
from tankcal.calibration.targets.naming import (
    CORNERS,
    match_circles_to_places,
    read_names,
    read_places,
    warn_of_unused,
)
from tankcal.calibration.targets.opencv import opencv
from tankcal.calibration.targets.pictures import ENCODINGS, photo_name, read_picture
from tankcal.calibration.targets.writing import (
    ImagePoint,
    PhotoReading,
    check_free,
    write_image_points,
)
from tankcal.job.fields import Refused as BadName
from tankcal.job.tables import Log, shown
from tankcal.messages import join_with_or, message

WHAT = ("corners", "centres", "circles")
WARNED_CHANCE = 1e-4  # probability of a code in random cells above which a warning is given


@dataclass(frozen=True)
class Wanted:
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
class Reading:
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


def read_photographs(paths, out_csv, wanted=None, replace=False, progress=None):
    """Measure targets in photographs and write image_points.csv.

    No file is written if there is a problem.

    Parameters
    ----------
    paths : sequence of path-like
        Picture files; the name of a photo is its file name without extension.
    out_csv : path-like
        Path of image_points.csv; refused candidates are written to ..._refused.csv in its folder.
    wanted : Wanted, optional
        Settings; by default the corners of coded targets are measured.
    replace : bool, optional
        Whether existing files may be overwritten.
    progress : callable, optional
        Called as progress(text, done, total) before each photo and at the end.

    Returns
    -------
    Reading

    Raises
    ------
    InputError
        If files, names or settings are invalid; the error lists all problems.
    """
    wanted, log = wanted or Wanted(), Log()
    opencv()
    names, places = _read_settings(wanted, log)
    check_free(out_csv, replace, log)
    titles = _name_photos(paths, log)
    if places:
        warn_of_unused(places, [title for _, title in titles], Path(wanted.places).name, log)
    photos, encodings = [], Counter()
    for done, (path, title) in enumerate(titles):
        if progress:
            progress(title, done, len(titles))
        picture = read_picture(path, log, wanted.encoding if wanted.encoding in ENCODINGS else None)
        if picture is not None:
            encodings[picture.encoding] += 1
        if picture is not None and not log.problems:
            photos.append(_measure_photo(title, picture, wanted, names, places, log))
    log.stop_if_problems()
    _warn(photos, wanted, names, log)
    if encodings["srgb"] and wanted.encoding == "by_file":
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
    return Reading(
        tuple(photos),
        *written,
        sum(len(photo.targets) for photo in photos),
        sum(len(photo.points) for photo in photos),
        dict(Counter(candidate.code for photo in photos for candidate in photo.refused)),
        tuple(log.warnings),
    )


def _read_settings(wanted, log):
    """Return {id: name} or None, and {photo: [Place]}; problems of the settings are logged."""
    for value, known, name in (
        (wanted.what, WHAT, "what"),
        (wanted.encoding, ENCODINGS, "encoding"),
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
        value = getattr(wanted, name)
        if value is not None and not 0 <= value < 1e5:
            log.problem(
                name,
                message(
                    "targets_number", "found {found:g}; expected a number of 0 or more", found=value
                ),
            )
    return _places_of_circles(wanted, log) if wanted.what == "circles" else _names(wanted, log)


def _places_of_circles(wanted, log):
    if wanted.names is not None:
        log.problem(
            "names",
            message("targets_names_of_circles", "only for coded targets; circles have `places`"),
        )
    if wanted.places is None:
        log.problem(
            "places",
            message(
                "targets_places_missing",
                "missing; expected approximate places, which give the circles their names",
            ),
        )
        return None, {}
    return None, read_places(Path(wanted.places), log)


def _names(wanted, log):
    if wanted.places is not None:
        log.problem(
            "places",
            message("targets_places_of_codes", "only for circles; coded targets have `names`"),
        )
    known = dictionary_of(wanted.dictionary)
    if wanted.names is None:
        return None, {}
    names = read_names(Path(wanted.names), log, CORNERS if wanted.what == "corners" else ())
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
        log.problem(Path(wanted.names).name, expected, column="id")
    return names, {}


def _name_photos(paths, log):
    """Return [(path, name of the photo)]; invalid names are logged."""
    titles, file_of_title = [], {}
    for path in map(Path, paths):
        try:
            title = photo_name(path)
        except BadName as refusal:
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


def _measure_photo(title, picture, wanted, names, places, log):
    """Measure one picture; return a PhotoReading."""
    if wanted.what == "circles":
        return _measure_circles(title, picture, wanted, places.get(title, []), log)
    found = read_coded(
        picture.image, wanted.dictionary, names, wanted.bit_errors, wanted.smallest_px
    )
    named = [
        (target, str(target.id) if names is None else names[target.id]) for target in found.targets
    ]
    if wanted.what == "centres":
        points = [ImagePoint(name, target.centre_px, target.centre_sd_px) for target, name in named]
    else:
        points = [
            ImagePoint(name + corner, place, float(sd))
            for target, name in named
            for corner, place, sd in zip(CORNERS, target.corners_px, target.sd_px, strict=True)
        ]
    targets = tuple(name for _, name in named)
    if found.doubtful:
        listed = ", ".join(str(number) for number in found.doubtful[:10])
        expected = message(
            "targets_mirror",
            "ids that read the same in a mirror image, with corners exchanged: {numbers}",
            numbers=listed,
        )
        log.warning(title, expected)
    return PhotoReading(
        title, found.size_px, picture.orientation, targets, tuple(points), found.refused
    )


def _measure_circles(title, picture, wanted, places, log):
    found = read_circles(picture.image, wanted.smallest_px or 6.0, wanted.largest_px)
    named, refused, missing = match_circles_to_places(found.targets, places, wanted.reach_px)
    if missing:
        listed = ", ".join(repr(name) for name in missing[:5])
        expected = message(
            "targets_no_circle",
            "no circle within {reach:g} px of {count} places: {names}",
            reach=wanted.reach_px,
            count=len(missing),
            names=listed,
        )
        log.warning(title, expected)
    points = tuple(ImagePoint(name, circle.centre_px, circle.sd_px) for name, circle in named)
    refused = [
        Refused(code, circle.centre_px, None, {"half_axis_px": float(circle.semi_axes_px[0])})
        for code, circle in refused
    ]
    return PhotoReading(
        title,
        found.size_px,
        picture.orientation,
        tuple(name for name, _ in named),
        points,
        (*found.refused, *refused),
    )


def _warn(photos, wanted, names, log):
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
    _warn_of_names(photos, wanted, names, log)
    if wanted.what != "circles" and names is None:
        chance = dictionary_of(wanted.dictionary).chance
        if chance > WARNED_CHANCE:
            expected = message(
                "targets_chance",
                "by chance, one of {frames:.0f} black frames with anything inside is read as "
                "a code; give the list of the ids that were placed",
                frames=1 / chance,
            )
            log.warning("dictionary", expected)


def _warn_of_names(photos, wanted, names, log):
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
            Path(wanted.names).name,
            message(
                "targets_unseen",
                "listed, but found in no photo: {count}: {names}",
                count=len(unseen),
                names=listed,
            ),
        )
