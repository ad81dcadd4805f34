"""The sheets of an adjusted survey: Adjustment, Points, Observations, Cameras and photos."""

import numpy as np

from tankcal.record.columns import as_columns
from tankcal.report.tables.readings import GROUPS, MOST_IN_SHEET, READINGS, in_their_units
from tankcal.report.tables.survey import (
    CHECK_POINTS,
    INSTRUMENTS,
    PHOTOS,
    POINTS,
    SYSTEMS,
    camera_rows,
    camera_table,
    point_rows,
)
from tankcal.report.workbook.look import number_format
from tankcal.report.workbook.tables import columns_of, set_widths
from tankcal.text.digits import decimals_of
from tankcal.text.words import (
    datum_sentences,
    global_test_sentence,
    make_sentence,
    scale_sentence,
    snooping_sentence,
    verdict_sentences,
)

MOST_READINGS = MOST_IN_SHEET  # of the sheet: those with the largest |w|
MOST_POINTS = MOST_IN_SHEET  # of the sheet: those that were not used, then the weakest
_LEAST = (34, 12)  # widths of the first columns, where labels and values stand
_HEAD_ROW = 3
_MOST_ASIDE = 50  # sentences on points that were rejected
_MOST_LETTERS = 200  # of the names of photographs in a heading


def adjustment_sheet(book, record):
    """Statistics, groups, datum, instruments and check points of the adjustment."""
    a, words = record["adjustment"], book.words
    tables = [
        ("adjusted_groups", "groups", columns_of(book, GROUPS)),
        ("adjusted_instruments", "instruments", columns_of(book, INSTRUMENTS)),
        ("adjusted_systems", "systems", columns_of(book, SYSTEMS)),
        ("adjusted_checks", "check_points", columns_of(book, CHECK_POINTS)),
    ]
    sheet = book.sheet("adjustment", landscape=True)
    widths = set_widths(book, sheet, *(columns for _, _, columns in tables), least=_LEAST)
    row = _facts(book, sheet, _HEAD_ROW, _statistics(a, words), widths)
    book.heading(sheet, row, words["headings"]["adjusted_datum"], len(widths))
    row = _sentences(book, sheet, row + 1, datum_sentences(words, a), widths)
    aside = [make_sentence(one) for one in a["aside"][:_MOST_ASIDE]]
    row = _sentences(book, sheet, row, aside, widths)
    for title, name, columns in tables:
        if columns[0].cells:
            book.heading(sheet, row, words["headings"][title], len(columns))
            row = book.table(sheet, row + 1, name, columns, widths=widths) + 2
        if name == "groups":
            row = _sentences(book, sheet, row, verdict_sentences(words, a), widths)


def _statistics(a, words):
    """(label key, value, number format or None)."""
    p, checks = a["precision"] or {}, a["check_points"] or {}
    lines = [
        ("adjusted_points", len(a["points"]), "0"),
        ("observations", a["observations"], "0"),
        ("unknowns", a["unknowns"], "0"),
        ("redundancy", a["redundancy"], "0"),
        ("iterations", a["iterations"], "0"),
        ("snooping", snooping_sentence(words, a), None),
        ("sigma0", a["sigma0"], "0.000"),
        ("global_test", global_test_sentence(words, a), None),
        ("cov_scale", scale_sentence(words, a), None),
        _millimetres("mean_sd", p.get("mean_sd_m")),
        _millimetres("spherical_sd", p.get("spherical_sd_m")),
        _millimetres("quadratic_sd", p.get("quadratic_sd_m")),
        ("extent", p.get("extent_m"), '0.0 "m"'),
        ("proportional", p.get("proportional"), '"1 : "0'),
        _millimetres("r_xyz", checks.get("r_xyz_m")),
        _millimetres("largest_difference", checks.get("largest_m")),
        _millimetres("mean_difference", checks.get("mean_m")),
    ]
    return [line for line in lines if line[1] is not None]


def _millimetres(label, size_m):
    """A line with a size in mm, with three digits as in the working papers."""
    size = None if size_m is None else 1000.0 * size_m
    return label, size, number_format(decimals_of(size, significant=3), unit="mm")


def _facts(book, sheet, row, lines, widths):
    """A line for each label and value; texts over the columns at the right of the labels."""
    for label, value, shown in lines:
        if shown is None:
            book.paragraph_in(sheet, row, 1, value, widths[1:])
        else:
            book.put(sheet, row, 1, value, num_format=shown, align="left", valign="top")
        book.label(sheet, row, book.words["labels"][label], widths[0])
        row += 1
    return row + 1


def _sentences(book, sheet, row, sentences, widths):
    """A paragraph each; returns the next row, after an empty one where there is any."""
    for sentence in sentences:
        book.paragraph(sheet, row, sentence, widths)
        row += 1
    return row + bool(sentences)


# ---- points


def points_sheet(book, record):
    """Every surveyed point with its residual, and why it was rejected when it was.

    Of an adjusted survey with sds and error ellipsoids; without a tank with nothing else.
    """
    of_tank = record["capacity"] is not None
    code = "points" if of_tank else "adjusted_points"
    points = as_columns(record["points"])
    used = sum(points["used"]) if of_tank else 0
    subtitle = book.word(f"texts.{code}_subtitle", count=points.count, used=used)
    shown = _weakest(points)
    if len(shown) == MOST_POINTS:
        subtitle = book.word("texts.weakest_points", text=subtitle, shown=len(shown))
    sheet = book.sheet(code, subtitle, landscape=True)
    without_sds = {} if record["adjustment"] else {f"s{axis}_m": {"sheet": None} for axis in "xyz"}
    columns = columns_of(book, POINTS.but(**without_sds), point_rows(record, shown))
    set_widths(book, sheet, columns)
    muted = [index for index, row in enumerate(shown) if of_tank and not row["used"]]
    if shown:
        book.table(sheet, _HEAD_ROW, "points", columns, muted=muted, autofilter=True)
    book.freeze(sheet, _HEAD_ROW, 1)


def _weakest(points):
    """Rows, in their order; of very many those not used, then those with the largest sds."""
    if points.count >= MOST_POINTS:
        covariance = points.arrays["cov_m2"]
        is_known = covariance.ndim > 1
        variance = np.nan_to_num(np.einsum("nii->n", covariance)) if is_known else 0.0
        rank = np.lexsort((np.broadcast_to(-variance, points.count), points.arrays["used"]))
        points = points.take(np.sort(rank[:MOST_POINTS]))
    return list(points.rows())


# ---- observations


def observations_sheet(book, record):
    """One row a reading, to be filtered; those rejected stand back and say so."""
    readings = as_columns(record["adjustment"]["residuals"])
    count = readings.count
    subtitle = book.word("texts.residuals_subtitle")
    if count > MOST_READINGS:
        subtitle = book.word("texts.worst_subtitle", shown=MOST_READINGS, all=count)
        readings = _worst(readings)
    rows = list(in_their_units(readings).rows())
    sheet = book.sheet("observations", subtitle, landscape=True)
    columns = columns_of(book, READINGS, rows)
    set_widths(book, sheet, columns)
    muted = [i for i, row in enumerate(rows) if row["removed"]]
    book.table(sheet, _HEAD_ROW, "observations", columns, muted=muted, autofilter=True)
    book.freeze(sheet, _HEAD_ROW, 1)


def _worst(readings):
    """The worst readings, in their order: those rejected first, then by test quantity."""
    size = np.abs(np.nan_to_num(readings.arrays["w"]))
    rank = np.lexsort((-size, ~readings.arrays["removed"]))
    return readings.take(np.sort(rank[:MOST_READINGS]))


# ---- cameras and photographs


def cameras_sheet(book, record):
    """Interior orientation with correlations, and the photographs; no sheet without any."""
    a = record["adjustment"]
    if not a["photos"]:
        return
    sheet = book.sheet("cameras", landscape=True)
    photos = columns_of(book, PHOTOS)
    cameras = [
        columns_of(book, camera_table(camera["free"], book.words), camera_rows(camera))
        for camera in a["cameras"]
    ]
    widths = set_widths(book, sheet, photos, *cameras)
    title = book.words["headings"]["adjusted_photos"]
    book.heading(sheet, _HEAD_ROW, title, len(photos))
    row = _HEAD_ROW + 1
    row = book.table(sheet, row, "photos", photos, autofilter=True, widths=widths) + 2
    for number, (camera, columns) in enumerate(zip(a["cameras"], cameras, strict=True), 1):
        book.heading(sheet, row, _name_of_camera(camera), len(photos))
        book.put(sheet, row + 1, 0, _model_of_camera(book, camera))
        row = book.table(sheet, row + 2, f"camera_{number}", columns, widths=widths) + 2


def _name_of_camera(camera):
    if camera["photos"] is None:
        return camera["camera"]
    return f"{camera['camera']}: {', '.join(map(str, camera['photos']))}"[:_MOST_LETTERS]


def _model_of_camera(book, camera):
    """The convention of its distortion, and the form of its affinity."""
    words, form = book.words, camera["affinity"]
    convention = words["conventions"][camera["convention"]]
    affinity = words["camera"]["affinities"].get(form, form)
    return book.word("texts.affinity", convention=convention, affinity=affinity)
