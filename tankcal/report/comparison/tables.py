"""Tables of a comparison, declared once for PDF, web page, workbook and CSV, and their rows."""

from tankcal.report.tables import Column, Table
from tankcal.text.digits import LITRE_DECIMALS

CODES = ("zero", "temperature", "head", "roof", "rounding")  # of the steps, in their order
DECIMALS = {"C": 1, "kg/m3": 1}  # decimals by unit of a step; FINE for other units
FINE = 4  # decimals of volumes that add up: 0.1 L
MOST_ROWS = 50  # number of rows in the selection of a PDF
ROUND_STEPS_M = (0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 5.0)  # steps of a selection
NEAR_M = 1e-6  # largest distance of a dip from a round dip

_SHOWN = {"sheet": True, "width": 11}


def _volume(key, **more):
    return Column(key, "m3", decimals=LITRE_DECIMALS, csv=key, **_SHOWN, **more)


def unit_symbol(unit):
    """Return the printed symbol of a unit of the file."""
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
        Column("unit", text=lambda paper, row: unit_symbol(row["unit"]), sheet=True, width=9),
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
    rows=lambda comparison: rows_by_dip(comparison["rows"]),
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
    rows=lambda comparison: comparison["waterfall"],
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
    rows=lambda comparison: comparison["deliveries"],
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
    rows=lambda comparison: comparison["courses"],
)


def step_rows(paper):
    """Return rows of STEPS; the source of an omitted step is the reason for its omission."""
    return [
        step | {"step": step["code"], "source": step["source"] or step["state"]}
        for step in paper.record["steps"]
    ]


def rows_by_dip(columns):
    """Return a dict for each row of a table saved by columns; empty columns are left out."""
    keys = [key for key, values in columns.items() if values]
    return [
        dict(zip(keys, values, strict=True))
        for values in zip(*(columns[key] for key in keys), strict=True)
    ]


def shown_steps(comparison):
    """Return the codes of the steps that were made or change a volume, in order."""
    return [
        step["code"]
        for step in comparison["steps"]
        if step["state"] == "done" or step["largest_m3"]
    ]


def waterfall_table(comparison):
    """Return the table WATERFALL without the steps that change no volume."""
    left_out = {f"{code}_m3" for code in CODES} - {f"{code}_m3" for code in shown_steps(comparison)}
    keys = [column.key for column in WATERFALL.columns if column.key not in left_out]
    return WATERFALL.only(*keys)


def worst_row(comparison):
    """Return the judged row with the largest |E_n|, or the largest |d| if no U is known.

    None if no row is judged.
    """
    judged = [
        row
        for row in rows_by_dip(comparison["rows"])
        if row["for_use"] and row["height_m"] >= comparison["judged_from_m"]
    ]
    known = [row for row in judged if row["E_n"] is not None]
    if known:
        return max(known, key=lambda row: abs(row["E_n"]))
    return max(judged, key=lambda row: abs(row["d_m3"]), default=None)


def select_rows(comparison, most=MOST_ROWS):
    """Return rows for a page: even dips, both ends, the joints of courses and the worst row.

    All rows are returned if there are at most `most`.
    """
    rows = rows_by_dip(comparison["rows"])
    if len(rows) <= most:
        return rows
    joints = [course["top_m"] for course in comparison["courses"]]
    # Three places are reserved: both ends and the worst row.
    places = {0, len(rows) - 1, *_even_places(rows, most - len(joints) - 3)}
    places |= {_nearest_place(rows, joint) for joint in joints}
    worst = worst_row(comparison)
    if worst is not None:
        places.add(_nearest_place(rows, worst["height_m"]))
    return [rows[place] for place in sorted(places)]


def _even_places(rows, most):
    """Return the places of rows at round dips, or of every n-th row if few dips are round."""
    most = max(most, 2)
    span = rows[-1]["height_m"] - rows[0]["height_m"]
    step = next((step for step in ROUND_STEPS_M if span / step <= most), span)
    is_round = [
        abs(row["height_m"] / step - round(row["height_m"] / step)) * step < NEAR_M for row in rows
    ]
    if sum(is_round) >= most // 4:
        return [place for place in range(len(rows)) if is_round[place]]
    return range(0, len(rows), -(-len(rows) // most))


def _nearest_place(rows, height_m):
    return min(range(len(rows)), key=lambda place: abs(rows[place]["height_m"] - height_m))
