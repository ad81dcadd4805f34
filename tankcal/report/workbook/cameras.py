"""The sheet Cameras and photos of an adjusted survey."""

from tankcal.report.tables.survey import PHOTOS, camera_rows, camera_table
from tankcal.report.workbook.tables import columns_of, set_widths

_HEAD_ROW = 3
_MOST_LETTERS = 200  # of the names of photographs in a heading


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
        book.heading(sheet, row, _name(camera), len(photos))
        book.put(sheet, row + 1, 0, _model(book, camera))
        row = book.table(sheet, row + 2, f"camera_{number}", columns, widths=widths) + 2


def _name(camera):
    if camera["photos"] is None:
        return camera["camera"]
    return f"{camera['camera']}: {', '.join(map(str, camera['photos']))}"[:_MOST_LETTERS]


def _model(book, camera):
    """The convention of its distortion, and the form of its affinity."""
    words, form = book.words, camera["affinity"]
    convention = words["conventions"][camera["convention"]]
    affinity = words["camera"]["affinities"].get(form, form)
    return book.word("texts.affinity", convention=convention, affinity=affinity)
