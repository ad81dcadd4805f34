"""fiducials.csv: comparator readings of fiducial marks, and what becomes of them."""

import numpy as np
from scipy.special import chdtri

from tankcal.camera.comparator import GROSS, KINDS, suspicion
from tankcal.errors import SolutionError
from tankcal.job.checking import has_rows, is_not_given, tell
from tankcal.job.checks.survey.files import refuse_undefined, tell_rows
from tankcal.job.contract.registers import MARKS
from tankcal.job.imagery import cameras_of_photos, readings_of_marks
from tankcal.job.tables import nearest
from tankcal.messages import join_with_and, join_with_or, list_some, message

LEVEL = 0.001  # of the tests of all photos together
GROWTH = 2.0  # of the sd of an image coordinate: a fourfold variance (Silva)
TOLD = 5
ALIKE = 2  # degrees of freedom with which the residuals of all marks are alike


def check_fiducials(files, imagery):
    """Marks, their readings, and what the transformations of `imagery` make of image points.

    Returns the photos whose image points say nothing, for their marks are told already.
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
    bad = _check_photos(files, table, of_photos, imagery)
    return bad | _check_images_of_comparator(files, table, of_photos)


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
    lacking = files.sound(table) & np.isnan(table.numbers("s_um"))
    if files.values is None or not lacking.any():
        return
    if is_not_given(files.raw, "adjustment", "image_sd_um"):
        expected = message(
            "mark_sd_missing",
            "missing; expected a value for the rows of {file} without s_um, the first of "
            "them row {row}",
            file=table.file,
            row=table.rows[int(np.argmax(lacking))],
        )
        tell(files.log.problem, files.raw, "adjustment", "image_sd_um", expected)


def _refuse_unknown_marks(files, table, of_photos):
    """A mark that its camera does not have; of a camera without marks once."""
    bare, told = {}, set()
    for row, photo, mark in zip(table.rows, table.of("photo"), table.of("mark"), strict=True):
        if photo not in of_photos or mark is None:
            continue
        camera, given = of_photos[photo]
        if not any(key.startswith(f"{MARKS}.") for key in _keys(files, camera)):
            bare.setdefault(camera, row)
        elif f"{MARKS}.{mark}" not in _keys(files, camera) and (camera, mark) not in told:
            told.add((camera, mark))
            hint = nearest(mark, given[MARKS])
            expected = message(
                "mark_unknown",
                "found {mark!r}; expected a mark of camera {camera!r} in cameras.toml{hint}",
                mark=mark,
                camera=camera,
                hint=hint,
            )
            files.log.problem(table.file, expected, row, "mark")
    for camera, row in bare.items():
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
    """The transformation of each photo; returns the photos that have none."""
    bare, turned, grown, bad = [], [], [], set()
    settings = {"image_sd_um": None} if files.values is None else files.values["adjustment"]
    settings = settings | {"image_sd_um": settings["image_sd_um"] or 1.0}  # one missing is told
    for photo, read in readings_of_marks(table, of_photos, settings).items():
        _warn_rejected(files, table, read.rejected)
        if not len(read.rows) and not read.rejected:
            continue
        if not _is_possible(files, table, photo, read):
            bad.add(photo)
            continue
        if len(set(read.names)) == KINDS[read.kind]:
            bare.append(photo)
        fit = imagery.fits.get(photo)
        if fit is None:
            continue
        if fit.transformation.is_mirrored:
            turned.append(photo)
        if fit.growth > GROWTH:
            grown.append((fit.growth, photo))
        _test_fit(files, table, photo, fit, read, len(imagery.fits))
    _warn_of_all(files, table, bare, turned, grown)
    return bad


def _is_possible(files, table, photo, read):
    """Can the marks of a photo be what they are said to be? What is told stops the job."""
    row = table.rows[read.rows[0]] if len(read.rows) else None
    names, fewest = list(dict.fromkeys(read.names)), KINDS[read.kind]
    if len(names) < fewest:
        left = message("left_over", " left") if read.rejected else ""
        expected = message(
            "marks_too_few",
            "photo {photo!r} has {count} marks{left}; expected {fewest} or more for "
            "fiducial_transformation = {of_kind}",
            photo=photo,
            count=len(names),
            left=left,
            fewest=fewest,
            of_kind=read.kind,
        )
        row = row if row is not None else read.rejected[0].row
        files.log.problem(table.file, expected, row, "mark")
        return False
    same = read.repeats
    found = suspicion(same.mean, read.marks_mm[same.first], read.kind)
    if found is None:
        try:
            read.fit(photo, None)
        except SolutionError as error:
            files.log.problem(
                table.file,
                message("of_photo", "photo {photo!r}: {error}", photo=photo, error=error.args[0]),
                row,
                "mark",
            )
            return False
        return True
    if found.marks:
        row = table.rows[read.rows[same.first[found.marks[0][0]]]]
    files.log.problem(table.file, _suspected(photo, found, names), row, "mark")
    return False


def _suspected(photo, found, names):
    """One line about a comparator.Suspicion."""
    named = [join_with_and([repr(names[i]) for i in group]) for group in found.marks]
    if found.what == "unit":
        times = 1 / found.size
        return message(
            "marks_in_other_unit",
            "the marks of photo {photo!r} were read {times:.4g} times as large as they are "
            "calibrated; expected millimetres both here and in cameras.toml",
            photo=photo,
            times=times,
        )
    if found.what == "sheared":
        share = 100 * (found.size - 1)
        return message(
            "marks_sheared",
            "the marks of photo {photo!r} give a transformation with a shear of {share:.2g} "
            "%: are marks confused?",
            photo=photo,
            share=share,
        )
    if found.what == "exchanged" and found.size < GROSS:
        marks = join_with_or(named)
        return message(
            "marks_exchanged",
            "the marks of photo {photo!r} fit no transformation of a comparator unless "
            "{marks} exchange their names",
            photo=photo,
            marks=marks,
        )
    return _misplaced(photo, found, named)


def _misplaced(photo, found, named):
    """One line about marks that are far from their calibrated places."""
    share = 100 * found.size
    start = message(
        "marks_off",
        "the marks of photo {photo!r} miss their calibrated places by {share:.2g} % of their "
        "extent",
        photo=photo,
        share=share,
    )
    if found.what == "mirrored":
        return message(
            "marks_mirrored",
            "{start}, and fit mirrored: the plate was read from the other side; change the "
            "sign of x, or set fiducial_transformation = affine",
            start=start,
        )
    if found.what == "exchanged":
        marks = join_with_or(named)
        return message(
            "marks_fit_exchanged",
            "{start}, and fit when {marks} are exchanged",
            start=start,
            marks=marks,
        )
    worst = named[0]
    if found.what == "wrong":
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


def _test_fit(files, table, photo, fit, read, photos):
    """A warning where the residuals of a photo's marks are larger than their sds say."""
    found = fit.transformation
    if found.dof < 1 or found.chi2 <= chdtri(found.dof, LEVEL / photos):
        return
    worst = int(np.argmax(np.abs(fit.residual_mm).max(axis=1)))
    of = message("no_single_mark", "which mark it is cannot be told")
    if found.dof > ALIKE:
        of = message("of_mark", "of mark {mark!r}", mark=fit.marks[worst])
    expected = message(
        "marks_fit_badly",
        "the marks of photo {photo!r} fit {times:.1f} times worse than their standard "
        "deviations say (largest residual {largest_um:.1f} um, {of}); the transformation "
        "therefore multiplies the sd of an image coordinate by up to {growth:.1f}",
        photo=photo,
        times=found.sigma0,
        largest_um=1e3 * np.abs(fit.residual_mm[worst]).max(),
        of=of,
        # what the variance of the transformation would be by its residuals
        growth=np.sqrt(1 + (fit.growth**2 - 1) * found.sigma0**2),
    )
    files.log.warning(table.file, expected, table.rows[read.rows[0]], "mark")


def _warn_rejected(files, table, rejected):
    for one in rejected:
        expected = message(
            "mark_rejected",
            "the {count} readings of mark {mark!r} of photo {photo!r} are rejected: their standard"
            " deviation of {sd_um:.1f} um exceeds reading_limit_um",
            count=one.count,
            mark=one.name,
            photo=one.photo,
            sd_um=1e3 * np.nanmax(one.sd_mm),
        )
        files.log.warning(table.file, expected, one.row, "mark")


def _warn_of_all(files, table, bare, turned, grown):
    if bare:
        expected = message(
            "marks_uncontrolled",
            "photos {photos} have no more marks than the transformation needs: a misread "
            "mark cannot be detected",
            photos=list_some(bare, TOLD),
        )
        files.log.warning(table.file, expected)
    if turned:
        expected = message(
            "read_mirrored",
            "photos {photos} were read mirrored; the transformation turns them back (was the "
            "plate turned over, or are marks exchanged?)",
            photos=list_some(turned, TOLD),
        )
        files.log.warning(table.file, expected)
    if grown:
        growth, photo = max(grown)
        expected = message(
            "transformation_coarse",
            "the transformation makes the sd of image coordinates up to {growth:.1f} times "
            "as large in photo {photo!r} (more than {limit:g} times in {photos} photos): the "
            "marks are too few, too close together or read too coarsely",
            growth=growth,
            photo=photo,
            limit=GROWTH,
            photos=len(grown),
        )
        files.log.warning(table.file, expected)


def _check_images_of_comparator(files, table, of_photos):
    """All photos of a camera are read on the comparator, or none; and in millimetres.

    Returns those that lack their marks.
    """
    images = files.tables["image_points"]
    read = set(table.of("photo"))
    cameras = {camera for photo, (camera, _) in of_photos.items() if photo in read}
    seen, lacking = {}, set()
    for row, photo in zip(images.rows, images.of("photo"), strict=True):
        seen.setdefault(photo, row)
    for photo, row in seen.items():
        if photo in of_photos and photo not in read and of_photos[photo][0] in cameras:
            expected = message(
                "photo_without_marks",
                "photo {photo!r} has no marks in {file}, others of its camera have; expected "
                "them for all",
                photo=photo,
                file=table.file,
            )
            files.log.problem(images.file, expected, row, "photo")
            lacking.add(photo)
    in_px = ~np.isnan(images.numbers("column_px")) | ~np.isnan(images.numbers("s_px"))
    in_px &= np.array([photo in read for photo in images.of("photo")], dtype=bool)
    expected = message(
        "pixels_beside_marks",
        "in pixels, in a photo whose marks are read in {file}; expected x_mm and y_mm of the "
        "same comparator",
        file=table.file,
    )
    tell_rows(files.log.problem, images, in_px, "column_px", expected)
    return lacking
