"""[adjustment]: what holds the frame must exist."""

import numpy as np

from tankcal.job.checks.common import has_rows, is_not_given, tell
from tankcal.job.checks.survey.names import all_points
from tankcal.job.datum import datum_point
from tankcal.job.tables import nearest
from tankcal.messages import joined, message

WITH_POINTS = ("minimal", "inner")


def check_datum(files):
    """datum_points and fixed_photo: given with the datum that they are for, and defined."""
    if files.values is None:
        return
    given = files.values["adjustment"]
    datum = given["datum"] or "control"
    if given["datum"] is None and not is_not_given(files.raw, "adjustment", "datum"):
        return  # a bad value, told already
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
        where = files.raw.file_of("photos")
        expected = message(
            "fixed_photo_unknown",
            "found {photo!r}; expected a photo of {where}{hint}",
            photo=photo,
            where=where,
            hint=nearest(photo, names),
        )
        _problem(files, "fixed_photo", expected)
    elif images is None or photo not in images.of("photo"):
        _problem(
            files,
            "fixed_photo",
            message(
                "fixed_photo_bare",
                "found {photo!r}; expected a photo with image points",
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
    names, seen = dict.fromkeys(all_points(files)), set()
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
        elif name in seen:
            _problem(
                files,
                "datum_points",
                message(
                    "datum_point_twice", "{name!r} stands there twice; expected once", name=name
                ),
            )
        elif datum == "minimal":
            _check_known(files, name, axes)
        seen.add(name)


def _check_known(files, name, axes):
    """A minimal datum holds points where control.csv says that they are."""
    control = files.tables["control"]
    if files.is_unreadable("control"):
        return
    known = ""
    if has_rows(control):
        is_it = [
            point == name and system is None
            for point, system in zip(control.of("point"), control.of("system"), strict=True)
        ]
        place = np.flatnonzero(is_it)
        known = "".join(
            axis for axis in "xyz" if not np.all(np.isnan(control.numbers(f"{axis}_m")[place]))
        )
    lacking = [axis for axis in axes if axis not in known]
    if lacking:
        axes = joined(lacking)
        expected = message(
            "datum_point_without",
            "{name!r} has no {axes} in control.csv; expected it there",
            name=name,
            axes=axes,
        )
        _problem(files, "datum_points", expected)
