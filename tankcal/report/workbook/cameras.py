"""The sheet Cameras and photos of an adjusted survey."""

from tankcal.report.numbers import powers
from tankcal.report.workbook.look import ANGLES, number_format, sd_digits, values_of
from tankcal.report.workbook.tables import set_widths
from tankcal.text.digits import decimals_of, decimals_of_mantissa, decimals_of_rows

_HEAD_ROW = 3
_MOST_LETTERS = 200  # of the names of photographs in a heading


def cameras_sheet(book, record):
    """Interior orientation with correlations, and the photographs; no sheet without any."""
    a = record["adjustment"]
    if not a["photos"]:
        return
    sheet = book.sheet("cameras", landscape=True)
    photos = _photos(book, a["photos"])
    cameras = [_camera(book, camera) for camera in a["cameras"]]
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


def _photos(book, rows):
    places = [(axis, f"{axis}_m", f"s{axis}_m") for axis in "xyz"]
    turns = [(sign, f"{key}_deg", f"s_{key}_deg") for sign, key in ANGLES]

    def to_digits_of_sd(code, axis, key, sd):
        digits = decimals_of_rows(values_of(rows, sd), most=6, unknown=4)
        return book.column(code, values_of(rows, key), digits, axis=axis)

    def sds(code, axis, key, factor):
        values = values_of(rows, key, factor)
        return book.column(code, values, sd_digits(values), 10, axis=axis)

    return [
        book.column("photo", values_of(rows, "photo"), None, 16),
        book.column("camera", values_of(rows, "camera"), None, 16),
        *(to_digits_of_sd("of_m", axis, key, sd) for axis, key, sd in places),
        *(to_digits_of_sd("of_deg", sign, key, sd) for sign, key, sd in turns),
        *(sds("sd_of_mm", axis, sd, 1e3) for axis, _, sd in places),
        *(sds("sd_of_arcsec", sign, sd, 3600.0) for sign, _, sd in turns),
        book.column("points", values_of(rows, "points"), 0, 9),
        book.column("rms_um", values_of(rows, "rms_mm", 1e3), 1, 9),
    ]


def _camera(book, camera):
    words, parameters = book.words, camera["parameters"]
    names = words["parameters"]
    formats = [
        _formats(*one) for one in zip(parameters, camera["values"], camera["sds"], strict=True)
    ]
    form, form_of_sd = zip(*formats, strict=True)
    columns = [
        book.column("parameter", [names.get(one, one) for one in parameters]),
        book.column("unit", [powers(one) for one in camera["units"]], None, 8),
        book.column("estimated", camera["values"], list(form), 14),
        book.column("sd", [sd or None for sd in camera["sds"]], list(form_of_sd)),
        book.column("one_value_for", [words["scopes"][one] for one in camera["scopes"]], None, 14),
        book.column("state", [words["states"][one] for one in camera["states"]], None, 10),
        book.column("edge_um", camera["edge_um"], 1),
    ]
    for place, name in enumerate(camera["free"]):
        r = [
            camera["correlation"][camera["free"].index(one)][place] if one in camera["free"]
            else None for one in parameters
        ]  # fmt: skip
        columns.append(book.column("r_with", r, 2, 10, name=names.get(name, name)))
    return columns


def _formats(name, value, sd):
    """Number formats of a parameter and of its sd: lengths plain, all else with powers of ten."""
    if name.startswith(("c", "x0", "y0")):
        return (number_format(decimals_of(sd)),) * 2
    found = (decimals_of_mantissa(value, sd), decimals_of_mantissa(sd, sd))
    return tuple(number_format(digits, power=True) for digits in found)
