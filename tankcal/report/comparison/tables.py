"""The tables of a comparison, declared once for paper, page, workbook and CSV; their rows."""

from tankcal.report.tables import Column, Table
from tankcal.text.digits import LITRE_DECIMALS

CODES = ("zero", "temperature", "head", "roof", "rounding")  # of the steps, in their order
DECIMALS = {"C": 1, "kg/m3": 1}  # of units of steps; else FINE
FINE = 4  # decimals of what adds up: a tenth of a litre
MOST_ROWS = 50  # of the selection that a PDF shows
NICE_M = (0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 5.0)  # between the dips of a selection
NEAR_M = 1e-6

_LITRES = {"decimals": LITRE_DECIMALS}
_SHOWN = {"sheet": True, "width": 11}


def _volume(key, csv=True, **more):
    return Column(key, "m3", **_LITRES, **_SHOWN, csv=key if csv else None, **more)


def symbol_of(unit):
    """A unit of the file as it is printed."""
    return {"C": "°C", "m3": "m³", "kg/m3": "kg/m³"}.get(unit, unit)


def _decimals(row):
    return DECIMALS.get(row["unit"], FINE)


STEPS = Table(
    "steps",
    (
        Column("step", words="steps", sheet=True, width=20),
        Column("source", words="sources", sheet=True, width=24),
        Column("former", decimals=_decimals, sheet=True, width=12),
        Column("new", decimals=_decimals, sheet=True, width=12),
        Column("unit", text=lambda paper, row: symbol_of(row["unit"]), sheet=True, width=9),
        Column("top_m3", "m3", decimals=FINE, heading="at_top", **_SHOWN),
        Column("largest_m3", "m3", decimals=FINE, heading="largest", **_SHOWN),
        Column("largest_at_m", "m", height=True, heading="at_dip", **_SHOWN),
    ),
)

ROWS = Table(
    "compared_rows",
    (
        Column("height_m", "m", height=True, csv="height_m", **_SHOWN),
        _volume("former_m3"),
        _volume("former_on_basis_m3"),
        _volume("new_m3"),
        Column("d_m3", "m3", decimals=LITRE_DECIMALS, csv="d_m3", **_SHOWN),
        Column("U_former_m3", "m3", u="U_former_m3", decimals=3, csv="U_former_m3", **_SHOWN),
        Column("U_new_m3", "m3", u="U_new_m3", decimals=3, csv="U_new_m3", **_SHOWN),
        Column("E_n", decimals=2, csv="E_n", **_SHOWN),
        Column("c_limit", decimals=2, on="", csv="c_limit", **_SHOWN),
        Column("for_use", on="", csv="for_use", sheet=True, width=9),
    ),
    rows=lambda found: rows_by_dip(found["rows"]),
)

WATERFALL = Table(
    "waterfall",
    (
        Column("height_m", "m", height=True, csv="height_m", **_SHOWN),
        *(
            Column(f"{key}_m3", "m3", decimals=FINE, csv=f"{key}_m3", **_SHOWN)
            for key in ("former", *CODES, "tank", "new")
        ),
    ),
    rows=lambda found: found["waterfall"],
)

DELIVERIES = Table(
    "worst_deliveries",
    (
        Column("minimum_m", "m", decimals=1, csv="minimum_m", **_SHOWN),
        Column("by", words="worst_by", csv="by", **_SHOWN),
        Column("high_m", "m", height=True, csv="high_m", **_SHOWN),
        Column("low_m", "m", height=True, csv="low_m", **_SHOWN),
        _volume("former_m3", heading="former_on_basis_m3"),
        _volume("new_m3"),
        Column("d_m3", "m3", decimals=LITRE_DECIMALS, csv="d_m3", **_SHOWN),
        Column("relative", "share", decimals=3, csv="relative", **_SHOWN),
        Column("U_former_m3", "m3", u="U_former_m3", decimals=3, csv="U_former_m3", **_SHOWN),
        Column("U_new_m3", "m3", u="U_new_m3", decimals=3, csv="U_new_m3", **_SHOWN),
        Column("E_n", decimals=2, csv="E_n", **_SHOWN),
        Column("c_limit", decimals=2, on="", csv="c_limit", **_SHOWN),
    ),
    rows=lambda found: found["deliveries"],
)

COURSES = Table(
    "compared_courses",
    (
        Column("course", decimals=0, csv="course", sheet=True, width=9),
        Column("bottom_m", "m", decimals=3, csv="bottom_m", **_SHOWN),
        Column("top_m", "m", decimals=3, csv="top_m", **_SHOWN),
        Column("former_m", "m", decimals=5, csv="former_m", **_SHOWN),
        Column("new_m", "m", decimals=5, csv="new_m", **_SHOWN),
        Column("d_m", "mm", decimals=2, csv="d_m", **_SHOWN),
        Column("u_m", "mm", decimals=2, csv="u_m", **_SHOWN),
        Column("u_rounding_m", "mm", decimals=3, csv="u_rounding_m", **_SHOWN),
        Column("w", decimals=2, csv="w", **_SHOWN),
    ),
    rows=lambda found: found["courses"],
)


def step_rows(paper):
    """Rows of STEPS; what was not made says why in place of where its values are from."""
    return [
        one | {"step": one["code"], "source": one["source"] or one["state"]}
        for one in paper.found["steps"]
    ]


def rows_by_dip(columns):
    """The rows, a dict each, of what is saved column by column."""
    keys = [key for key, values in columns.items() if values]
    return [
        dict(zip(keys, values, strict=True))
        for values in zip(*(columns[key] for key in keys), strict=True)
    ]


def steps_done(found):
    """Codes of the steps that move some volume or were made, in their order."""
    return [one["code"] for one in found["steps"] if one["state"] == "done" or one["largest_m3"]]


def waterfall_of(found):
    """The table WATERFALL without the steps that move nothing."""
    kept = steps_done(found)
    left_out = {f"{code}_m3" for code in CODES if code not in kept}
    return WATERFALL.only(*(one.key for one in WATERFALL.columns if one.key not in left_out))


def worst_row(found):
    """The row with the largest |E_n| that is judged; by |d| where no U is known; None: no row."""
    judged = [
        row
        for row in rows_by_dip(found["rows"])
        if row["for_use"] and row["height_m"] >= found["judged_from_m"]
    ]
    known = [row for row in judged if row["E_n"] is not None]
    if known:
        return max(known, key=lambda row: abs(row["E_n"]))
    return max(judged, key=lambda row: abs(row["d_m3"]), default=None)


def selected(found, most=MOST_ROWS):
    """Rows for a page: even dips, both ends, the joints of courses, the worst; all when few."""
    rows = rows_by_dip(found["rows"])
    if len(rows) <= most:
        return rows
    joints = [one["top_m"] for one in found["courses"]]
    chosen = {0, len(rows) - 1, *_even(rows, most - len(joints) - 3)}
    chosen |= {_nearest(rows, joint) for joint in joints}
    worst = worst_row(found)
    if worst is not None:
        chosen.add(_nearest(rows, worst["height_m"]))
    return [rows[place] for place in sorted(chosen)]


def _even(rows, most):
    """Places of rows at round dips, evenly apart; of every so manyth row where there are none."""
    most = max(most, 2)
    span = rows[-1]["height_m"] - rows[0]["height_m"]
    step = next((one for one in NICE_M if span / one <= most), span)
    round_ones = [
        place
        for place, row in enumerate(rows)
        if abs(row["height_m"] / step - round(row["height_m"] / step)) * step < NEAR_M
    ]
    every = -(-len(rows) // most)
    return round_ones if len(round_ones) >= most // 4 else range(0, len(rows), every)


def _nearest(rows, height_m):
    return min(range(len(rows)), key=lambda place: abs(rows[place]["height_m"] - height_m))
