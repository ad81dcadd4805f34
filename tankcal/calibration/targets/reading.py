"""Photographs in, image_points.csv out: the whole way, for any number of photos."""

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
CHANCE_TOLD = 1e-4  # that random cells are a code


@dataclass(frozen=True)
class Wanted:
    """What to read.

    Attributes
    ----------
    what : str
        "corners" of coded targets (name-1 .. name-4), their "centres", or "circles".
    dictionary : str
        Of coded targets, as OpenCV calls it.
    names : Path or None
        Path of a CSV file with id and point, or None: the number is the name, and every id of
        the dictionary is accepted.
    places : Path or None
        Of circles: path of a CSV file with photo, point, column_px, line_px.
    reach_px : float
        Of circles: how far one may be from its approximate place.
    smallest_px : float or None
        Least side, or diameter; None: 2.5 px a cell, or 6.
    largest_px : float or None
        Of circles: largest diameter; None: a tenth of the photo.
    bit_errors : int
        Cells of a code that may be wrong.
    encoding : str
        One of pictures.ENCODINGS: how grey values stand for light.
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
    """What was read and written.

    Attributes
    ----------
    photos : tuple
        PhotoReadings.
    path, refused_path : Path
        Files that were written.
    targets, points : int
        How many, over all photos.
    refused : dict
        {reason code: how many}.
    warnings : tuple
        Problems that stop nothing.
    """

    photos: tuple
    path: Path
    refused_path: Path
    targets: int
    points: int
    refused: dict
    warnings: tuple


def read_photographs(paths, out_csv, wanted=None, replace=False, progress=None):
    """Read targets in photographs and write image_points.csv: a Reading. All or nothing.

    Parameters
    ----------
    paths
        Of the pictures; a photo's name is that of its file, without the ending.
    out_csv
        Path of image_points.csv; what was refused goes to ..._refused.csv beside it.
    wanted : Wanted, optional
        What to read; None: the corners of coded targets.
    replace : optional
        Whether files that are there may be overwritten.
    progress : callable, optional
        Called as progress(text, done, total) before each photo and at the end.

    Raises
    ------
    InputError
        With everything that is wrong with files, names and settings.
    """
    wanted, log = wanted or Wanted(), Log()
    opencv()
    names, places = _lists(wanted, log)
    check_free(out_csv, replace, log)
    titles = _titles(paths, log)
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
            photos.append(_photo(title, picture, wanted, names, places, log))
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
        dict(Counter(one.code for photo in photos for one in photo.refused)),
        tuple(log.warnings),
    )


def _lists(wanted, log):
    """({id: name} or None, {photo: [Place]}); what is wrong with the settings goes to `log`."""
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


def _titles(paths, log):
    """[(path, name of the photo)]; names that cannot be used go to `log`."""
    found, seen = [], {}
    for path in map(Path, paths):
        try:
            title = photo_name(path)
        except BadName as refusal:
            log.problem(
                path.name,
                message("targets_photo_name", "as the name of a photo: {refusal}", refusal=refusal),
            )
            continue
        if title in seen:
            expected = message(
                "targets_photo_twice",
                "photo {photo!r} is already read from {file}; expected another file name",
                photo=title,
                file=seen[title],
            )
            log.problem(path.name, expected)
        seen.setdefault(title, path.name)
        found.append((path, title))
    if not seen and not log.problems:
        log.problem(
            "photographs",
            message("targets_none_given", "no photograph given; expected one or more"),
        )
    return found


def _photo(title, picture, wanted, names, places, log):
    """PhotoReading of one picture."""
    if wanted.what == "circles":
        return _photo_of_circles(title, picture, wanted, places.get(title, []), log)
    found = read_coded(
        picture.image, wanted.dictionary, names, wanted.bit_errors, wanted.smallest_px
    )
    named = [(one, str(one.id) if names is None else names[one.id]) for one in found.targets]
    if wanted.what == "centres":
        points = [ImagePoint(name, one.centre_px, one.centre_sd_px) for one, name in named]
    else:
        points = [
            ImagePoint(name + corner, place, float(sd))
            for one, name in named
            for corner, place, sd in zip(CORNERS, one.corners_px, one.sd_px, strict=True)
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


def _photo_of_circles(title, picture, wanted, places, log):
    found = read_circles(picture.image, wanted.smallest_px or 6.0, wanted.largest_px)
    named, refused, lacking = match_circles_to_places(found.targets, places, wanted.reach_px)
    if lacking:
        listed = ", ".join(repr(name) for name in lacking[:5])
        expected = message(
            "targets_no_circle",
            "no circle within {reach:g} px of {count} places: {names}",
            reach=wanted.reach_px,
            count=len(lacking),
            names=listed,
        )
        log.warning(title, expected)
    points = tuple(ImagePoint(name, one.centre_px, one.sd_px) for name, one in named)
    refused = [
        Refused(code, one.centre_px, None, {"half_axis_px": float(one.semi_axes_px[0])})
        for code, one in refused
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
    """Tell what deserves a look."""
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
        if chance > CHANCE_TOLD:
            expected = message(
                "targets_chance",
                "by chance, one of {frames:.0f} black frames with anything inside is read as "
                "a code; give the list of the ids that were placed",
                frames=1 / chance,
            )
            log.warning("dictionary", expected)


def _warn_of_names(photos, wanted, names, log):
    """Targets in one photo only, and names of the list in none."""
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
