"""Tables of a tank of a ship: corrections of soundings, and the ends of what the pipe shows."""

from math import dist

from tankcal.report.tables.table import Column, Table

ROUNDING_M = 0.0005  # that a sounding is printed to


def _named(key, unit="", **more):
    return Column(key, unit, heading=f"ship_{key}", sheet=True, **more)


CELLS = Table(
    "ship_cells",
    (
        _named("trim_m", "m", decimals=2),
        _named("list_deg", "deg", decimals=2),
        _named("dry_m3", "m3", decimals=3, width=16),
        _named("full_m", "m", decimals=3, width=16),
        _named("largest_m", "mm", decimals=1, width=16),
        _named("largest_U_m", "mm", digits=2, width=16),
    ),
    rows=lambda record: [_cell(one) for one in record["ship"]["cells"]],
)


def _cell(one):
    kept = {key: one[key] for key in ("trim_m", "list_deg", "dry_m3", "full_m")}
    known = [place for place, value in enumerate(one["correction_m"]) if value is not None]
    if not known:
        return kept | {"largest_m": None, "largest_U_m": None}
    worst = max(known, key=lambda place: abs(one["correction_m"][place]))
    spread = [one["U_correction_m"][place] for place in known]
    return kept | {
        "largest_m": one["correction_m"][worst],
        "largest_U_m": max((U for U in spread if U is not None), default=None),
    }


def beyond_pipe(record):
    """(length of the pipe in m, trims and lists at which the tank becomes full beyond its end)."""
    ship = record["ship"]
    length_m = dist(ship["pipe_bottom_m"], ship["pipe_top_m"])
    beyond = [one["full_m"] for one in ship["cells"] if one["full_m"] > length_m + ROUNDING_M]
    return length_m, len(beyond)


def _filed(key, heading=None, unit=""):
    return Column(key, csv=heading or key, csv_unit=unit)


CORRECTIONS = Table(
    "ship_corrections",
    (
        _filed("trim_m"),
        _filed("list_deg"),
        _filed("sounding_m"),
        _filed("state"),
        _filed("correction_m", "correction_mm", "mm"),
        _filed("u_correction_m", "u_correction_mm", "mm"),
        _filed("U_correction_m", "U_correction_mm", "mm"),
        _filed("volume_m3"),
        _filed("u_m3"),
        _filed("U_m3"),
    ),
)
_OF_CELL = (
    "state",
    "correction_m",
    "u_correction_m",
    "U_correction_m",
    "volume_m3",
    "u_m3",
    "U_m3",
)


def corrections_columns(record):
    """{key: values} of all corrections, one row for each trim, list and sounding."""
    ship = record["ship"]
    count = len(ship["sounding_m"])
    found = {key: [] for key in ("trim_m", "list_deg", "sounding_m", *_OF_CELL)}
    for one in ship["cells"]:
        found["trim_m"] += [one["trim_m"]] * count
        found["list_deg"] += [one["list_deg"]] * count
        found["sounding_m"] += ship["sounding_m"]
        for key in _OF_CELL:
            found[key] += one[key]
    return found


def by_list(record):
    """[(list in degrees, its cells by trim)], as the matrices of papers have them."""
    cells = record["ship"]["cells"]
    return [
        (list_deg, [one for one in cells if one["list_deg"] == list_deg])
        for list_deg in record["ship"]["list_deg"]
    ]


def largest_U_m(cells, place):
    """The largest expanded uncertainty of the corrections of one sounding; None: there is none."""
    found = [one["U_correction_m"][place] for one in cells]
    return max((U for U in found if U is not None), default=None)
