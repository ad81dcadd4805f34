"""Sheets of an adjusted survey: Adjustment, Points, Observations, Cameras."""

import numpy as np

from tankcal.record.columns import as_columns
from tankcal.report.tables.readings import GROUPS, MOST_IN_SHEET, READINGS, convert_units
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
from tankcal.report.workbook.sections import (
    HEAD_ROW,
    Facts,
    Sentences,
    SheetContent,
    cell_table,
    columns_of,
    set_widths,
    write_sheet,
)
from tankcal.text.digits import decimals_of
from tankcal.text.words import (
    datum_sentences,
    global_test_sentence,
    make_sentence,
    scale_sentence,
    snooping_sentence,
    verdict_sentences,
)

MOST_READINGS = MOST_IN_SHEET  # largest number of readings; largest |w| first
MOST_POINTS = MOST_IN_SHEET  # largest number of points; unused, then least precise points first
_LEAST = (34, 12)  # smallest widths of the columns of labels and values
_MOST_ASIDE = 50  # largest number of sentences on rejected points
_MOST_LETTERS = 200  # largest number of letters of a heading with names of photographs


def adjustment_sheet(book, record):
    """Write statistics, groups, datum, instruments and check points of the adjustment."""
    adjustment, words = record["adjustment"], book.words
    headings = words["headings"]
    rejections = [make_sentence(entry) for entry in adjustment["aside"][:_MOST_ASIDE]]
    groups, *tables = (
        cell_table(book, table, title=headings[title], is_optional=True)
        for title, table in (
            ("adjusted_groups", GROUPS),
            ("adjusted_instruments", INSTRUMENTS),
            ("adjusted_systems", SYSTEMS),
            ("adjusted_checks", CHECK_POINTS),
        )
    )
    sections = [
        Facts(_statistics(adjustment, words)),
        Sentences(datum_sentences(words, adjustment), title=headings["adjusted_datum"]),
        Sentences(rejections),
        groups,
        Sentences(verdict_sentences(words, adjustment)),
        *tables,
    ]
    write_sheet(book, SheetContent("adjustment", sections, least=_LEAST))


def _statistics(adjustment, words):
    """Return (label, value, number format or None) of the statistics with values."""
    precision, checks = adjustment["precision"] or {}, adjustment["check_points"] or {}
    lines = [
        ("adjusted_points", len(adjustment["points"]), "0"),
        ("observations", adjustment["observations"], "0"),
        ("unknowns", adjustment["unknowns"], "0"),
        ("redundancy", adjustment["redundancy"], "0"),
        ("iterations", adjustment["iterations"], "0"),
        ("snooping", snooping_sentence(words, adjustment), None),
        ("sigma0", adjustment["sigma0"], "0.000"),
        ("global_test", global_test_sentence(words, adjustment), None),
        ("cov_scale", scale_sentence(words, adjustment), None),
        _millimetres("mean_sd", precision.get("mean_sd_m")),
        _millimetres("spherical_sd", precision.get("spherical_sd_m")),
        _millimetres("quadratic_sd", precision.get("quadratic_sd_m")),
        ("extent", precision.get("extent_m"), '0.0 "m"'),
        ("proportional", precision.get("proportional"), '"1 : "0'),
        _millimetres("r_xyz", checks.get("r_xyz_m")),
        _millimetres("largest_difference", checks.get("largest_m")),
        _millimetres("mean_difference", checks.get("mean_m")),
    ]
    labels = words["labels"]
    return [(labels[key], value, shown) for key, value, shown in lines if value is not None]


def _millimetres(label, size_m):
    """Return the line of a size in mm with three digits, as in the working papers."""
    size = None if size_m is None else 1000.0 * size_m
    return label, size, number_format(decimals_of(size, significant=3), unit="mm")


# ---- points


def points_sheet(book, record):
    """Write the surveyed points with their residuals and reasons of rejection.

    Points of an adjusted survey have standard deviations and error ellipsoids. Without a tank they
    have no residuals.
    """
    has_tank = record["capacity"] is not None
    code = "points" if has_tank else "adjusted_points"
    points = as_columns(record["points"])
    used = sum(points["used"]) if has_tank else 0
    subtitle = book.word(f"texts.{code}_subtitle", count=points.count, used=used)
    shown = _weakest(points)
    if len(shown) == MOST_POINTS:
        subtitle = book.word("texts.weakest_points", text=subtitle, shown=len(shown))
    without_sds = {} if record["adjustment"] else {f"s{axis}_m": {"sheet": None} for axis in "xyz"}
    muted = [index for index, row in enumerate(shown) if has_tank and not row["used"]]
    points = cell_table(
        book,
        POINTS.but(**without_sds),
        point_rows(record, shown),
        muted=muted,
        is_optional=True,
    )
    write_sheet(book, SheetContent(code, [points], subtitle, is_filtered=True))


def _weakest(points):
    """Return the rows; at most MOST_POINTS: unused points first, then the least precise."""
    if points.count >= MOST_POINTS:
        covariance = points.arrays["cov_m2"]
        is_known = covariance.ndim > 1
        # Trace of the covariance matrix of each point.
        variance = np.nan_to_num(np.einsum("nii->n", covariance)) if is_known else 0.0
        rank = np.lexsort((np.broadcast_to(-variance, points.count), points.arrays["used"]))
        points = points.take(np.sort(rank[:MOST_POINTS]))
    return list(points.rows())


# ---- observations


def observations_sheet(book, record):
    """Write a row for each reading; rejected readings are grey."""
    readings = as_columns(record["adjustment"]["residuals"])
    count = readings.count
    subtitle = book.word("texts.residuals_subtitle")
    if count > MOST_READINGS:
        subtitle = book.word("texts.worst_subtitle", shown=MOST_READINGS, all=count)
        size = np.abs(np.nan_to_num(readings.arrays["w"]))
        rank = np.lexsort((-size, ~readings.arrays["removed"]))
        readings = readings.take(np.sort(rank[:MOST_READINGS]))
    rows = list(convert_units(readings).rows())
    muted = [i for i, row in enumerate(rows) if row["removed"]]
    table = cell_table(book, READINGS, rows, name="observations", muted=muted)
    write_sheet(book, SheetContent("observations", [table], subtitle, is_filtered=True))


# ---- cameras and photographs


def cameras_sheet(book, record):
    """Write interior orientation with correlations, and photographs; no sheet without them."""
    adjustment = record["adjustment"]
    if not adjustment["photos"]:
        return
    sheet = book.sheet("cameras", landscape=True)
    photos = columns_of(book, PHOTOS)
    cameras = [
        columns_of(book, camera_table(camera["free"], book.words), camera_rows(camera))
        for camera in adjustment["cameras"]
    ]
    widths = set_widths(book, sheet, photos, *cameras)
    title = book.words["headings"]["adjusted_photos"]
    book.heading(sheet, HEAD_ROW, title, len(photos))
    row = HEAD_ROW + 1
    row = book.table(sheet, row, "photos", photos, autofilter=True, widths=widths) + 2
    for number, (camera, columns) in enumerate(zip(adjustment["cameras"], cameras, strict=True), 1):
        book.heading(sheet, row, _name_of_camera(camera), len(photos))
        book.put(sheet, row + 1, 0, _model_of_camera(book, camera))
        row = book.table(sheet, row + 2, f"camera_{number}", columns, widths=widths) + 2


def _name_of_camera(camera):
    if camera["photos"] is None:
        return camera["camera"]
    return f"{camera['camera']}: {', '.join(map(str, camera['photos']))}"[:_MOST_LETTERS]


def _model_of_camera(book, camera):
    """Return the convention of the distortion and the form of the affinity in words."""
    words, form = book.words, camera["affinity"]
    convention = words["conventions"][camera["convention"]]
    affinity = words["camera"]["affinities"].get(form, form)
    return book.word("texts.affinity", convention=convention, affinity=affinity)
