"""Names of targets: coded targets by a list of ids, circles by approximate positions."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.field_values import read_value
from tankcal.job.fields import Field, Refused, is_blank
from tankcal.job.folder import read_csv
from tankcal.job.tables import MAX_FILE_BYTES, nearest, read_bytes, shown
from tankcal.messages import message

ID = Field(
    "id", "number", message("targets_note_id", "number of the code"), required=True, low=0, high=1e6
)
POINT = Field("point", "name", message("targets_note_point", "name of the point"), required=True)
NAMES = (ID, POINT)
PLACES = (
    Field(
        "photo",
        "name",
        message("targets_note_photo", "the photo, its file without the ending"),
        required=True,
    ),
    POINT,
    Field(
        "column_px",
        "number",
        message("targets_note_column", "approximate column, pixels"),
        required=True,
        low=-1e6,
        high=1e6,
    ),
    Field(
        "line_px",
        "number",
        message("targets_note_line", "approximate line, pixels"),
        required=True,
        low=-1e6,
        high=1e6,
    ),
)
CORNERS = ("-1", "-2", "-3", "-4")  # top left of the marker as printed, then clockwise


def read_names(path, log, suffixes=()):
    """Read {id: name} from a CSV file with the columns id and point; problems are logged.

    Parameters
    ----------
    path : Path
        Path of the file.
    log : Log
        Receives the problems.
    suffixes : sequence of str, optional
        Suffixes with which each name must also be valid.

    Returns
    -------
    dict
    """
    names, first = {}, {}
    for file, row, (number, point) in _rows(path, NAMES, log):
        if number != int(number):
            log.problem(
                file,
                message(
                    "targets_not_whole", "found {found:g}; expected a whole number", found=number
                ),
                row,
                "id",
            )
            continue
        for value, column in ((int(number), "id"), (point, "point")):
            if (column, value) in first:
                expected = message(
                    "targets_twice",
                    "{found!r} is already in row {row}; expected once",
                    found=value,
                    row=first[column, value],
                )
                log.problem(file, expected, row, column)
            first.setdefault((column, value), row)
        try:
            for suffix in suffixes:
                read_value(POINT, point + suffix)
        except Refused as refusal:
            log.problem(
                file,
                message(
                    "targets_with_corner",
                    "with the ending of a corner: {refusal}",
                    refusal=refusal.text,
                ),
                row,
                "point",
            )
        names[int(number)] = point
    return names


@dataclass(frozen=True)
class Place:
    """Approximate position of a point in a photo, px, and its row in the file."""

    point: str
    place_px: np.ndarray
    row: int


def read_places(path, log):
    """Read {photo: [Place]} from a CSV file with photo, point, column_px, line_px."""
    places, first = {}, {}
    for file, row, (photo, point, column, line) in _rows(path, PLACES, log):
        if (photo, point) in first:
            expected = message(
                "targets_place_twice",
                "{point!r} is already in row {first_row}; expected once in photo {photo!r}",
                point=point,
                first_row=first[photo, point],
                photo=photo,
            )
            log.problem(file, expected, row, "point")
        first.setdefault((photo, point), row)
        places.setdefault(photo, []).append(Place(point, np.array([column, line]), row))
    return places


def warn_of_unused(places, photos, file, log):
    """Log a warning for each photo of `places` that is not among the given photos.

    Parameters
    ----------
    places : dict
        {photo: [Place]} from `read_places`.
    photos : sequence of str
        Names of the given photos.
    file : str
        Name of the file of the positions.
    log : Log
        Receives the warnings.
    """
    for photo in places:
        if photo not in photos:
            hint = nearest(photo, photos)
            expected = message(
                "targets_unused_photo",
                "found {found}; expected one of the photos given{hint}; the row is not used",
                found=shown(photo),
                hint=hint,
            )
            log.warning(file, expected, places[photo][0].row, "photo")


def _rows(path, fields, log):
    """Yield (file, row, values) of the valid rows; problems are logged."""
    data = read_bytes(path, log, MAX_FILE_BYTES)
    table = None if data is None else read_csv(path.name, data, ",", ".", log)
    if table is None:
        return
    missing = [field for field in fields if field.name not in table.headings]
    for field in missing:
        expected = message(
            "targets_missing_column", "missing column; expected {wanted}", wanted=field.wanted()
        )
        log.problem(table.file, expected, table.heading_row, field.name)
    if missing:
        return
    places = [table.headings.index(field.name) for field in fields]
    for row, cells in zip(table.row_numbers, table.rows, strict=True):
        values = []
        for field, place in zip(fields, places, strict=True):
            try:
                if is_blank(cells[place]):
                    raise Refused(
                        message(
                            "targets_blank",
                            "blank; expected {expected}",
                            expected=field.expectation(),
                        )
                    )
                values.append(read_value(field, cells[place], table.decimal))
            except Refused as refusal:
                log.problem(table.file, refusal.text, row, field.name)
        if len(values) == len(fields):
            yield table.file, row, values


def match_circles_to_places(circles, places, reach_px):
    """Assign circles to approximate positions, each at most once.

    A position with two circles within reach, or a circle with two positions, is ambiguous.

    Parameters
    ----------
    circles : sequence of Circle
        Circles of a photo.
    places : sequence of Place
        Approximate positions in the photo.
    reach_px : float
        Largest distance of a circle from its approximate position, px.

    Returns
    -------
    named : list of (str, Circle)
        Point and circle.
    refused : list of (str, Circle)
        Code of the reason and circle.
    missing : list of str
        Points without a circle.
    """
    if not circles or not places:
        return [], [("unnamed", circle) for circle in circles], [place.point for place in places]
    middles = np.array([circle.centre_px for circle in circles])
    approximate = np.array([place.place_px for place in places])
    near = np.hypot(*(middles[:, None] - approximate).transpose(2, 0, 1)) <= reach_px
    per_circle, per_place = near.sum(axis=1), near.sum(axis=0)
    named, refused = [], []
    for i, circle in enumerate(circles):
        if per_circle[i] == 0:
            refused.append(("unnamed", circle))
        elif per_circle[i] > 1 or per_place[near[i]].max() > 1:
            refused.append(("ambiguous", circle))
        else:
            named.append((places[int(np.argmax(near[i]))].point, circle))
    missing = [place.point for place, count in zip(places, per_place, strict=True) if not count]
    return named, refused, missing
