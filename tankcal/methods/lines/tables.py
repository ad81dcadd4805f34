"""Tables of reference lines: offsets (by rows and by levels), lines, levels, plummets."""

from dataclasses import replace

from tankcal.report import blocks
from tankcal.report.tables.table import Column, Table

OFFSETS = Table(
    "offsets",
    (
        Column("line", sheet="line", width=8, csv="line"),
        Column("course", sheet="course", width=9, csv="course"),
        Column("level_m", "m", decimals=3, sheet="strap_level_m", csv="level_m"),
        Column("face", decimals=0, sheet="face", width=7, csv="face"),
        Column("reference", words="yes_no", sheet="reference_level", csv="reference", on=""),
        Column("offset_m", "mm", decimals=2, heading="line_offset", sheet="line_offset_mm",
               csv="offset_mm", csv_unit="mm"),
        Column("sd_m", "mm", decimals=2, heading="strap_sd", sheet="strap_sd_mm", csv="s_mm",
               csv_unit="mm"),
        Column("departure_m", "mm", decimals=2, heading="line_departure",
               sheet="line_departure_mm", csv="departure_mm", csv_unit="mm"),
        Column("w", decimals=1, sheet="w", width=8, csv="w"),
        Column("mdb_m", "mm", decimals=1, heading="mdb", sheet="strap_mdb_mm", csv="mdb_mm",
               csv_unit="mm"),
        Column("state", words="states_of_offsets", heading="line_state", sheet="line_state",
               width=11, csv="state"),
    ),
    rows=lambda record: record["lines"]["offsets"],
    csv_style="%.6f",
)  # fmt: skip

LINES = Table(
    "lines",
    (
        Column("line", sheet="line", width=8),
        Column("azimuth_rad", "rad deg", decimals=2, heading="line_azimuth",
               sheet="line_azimuth_deg"),
        Column("plummet", sheet="plummet", width=12),
        Column("side", words="sides_of_lines", heading="line_side", sheet="line_side", width=10),
        Column("offsets", decimals=0, heading="line_offsets", sheet="line_offsets"),
        Column("rejected", decimals=0, heading="line_rejected", sheet="line_rejected"),
    ),
    rows=lambda record: record["lines"]["lines"],
)  # fmt: skip

LEVELS = Table(
    "levels",
    (
        Column("course", sheet="course", width=9),
        Column("level_m", "m", decimals=3, sheet="strap_level_m"),
        Column("lines", decimals=0, heading="level_lines", sheet="level_lines", width=8),
        Column("rise_m", "mm", decimals=2, heading="level_rise", sheet="level_rise_mm"),
        Column("radius_m", "m", decimals=5, heading="outside_radius_m", sheet="outside_radius_m"),
        Column("centre_x_m", "mm", decimals=1, heading="level_x", sheet="level_x_mm"),
        Column("centre_y_m", "mm", decimals=1, heading="level_y", sheet="level_y_mm"),
    ),
    rows=lambda record: record["lines"]["levels"],
)  # fmt: skip

PLUMMETS = Table(
    "plummets",
    (
        Column("plummet", sheet="plummet", width=12),
        Column("certificate", heading="tape_certificate", sheet="tape_certificate", width=14),
        Column("u_declared_rad", "rad arcsec", decimals=1, heading="plummet_u_declared",
               sheet="plummet_u_declared_arcsec"),
        Column("collimation_rad", "rad arcsec", decimals=2, heading="plummet_collimation",
               sheet="plummet_collimation_arcsec"),
        Column("u_rad", "rad arcsec", decimals=2, heading="plummet_u", sheet="plummet_u_arcsec"),
        Column("by_faces_rad", "rad arcsec", decimals=2, heading="plummet_by_faces",
               sheet="plummet_by_faces_arcsec"),
    ),
    rows=lambda record: [
        {**plummet, **{key: plummet[key] or None for key in ("plummet", "certificate")}}
        for plummet in record["lines"]["plummets"]
    ],
)  # fmt: skip


def lean_of_points(paper):
    """Return facts [(label, text)] on the lean by points and its test against the lines."""
    record = paper.record["lines"]
    if record.get("lean_w") is None:  # None, or absent in records of earlier versions
        return []
    leans = [
        (key, paper.number(record[key], "mm/m", decimals=2))
        for key in ("points_lean_x", "points_lean_y")
    ]
    return [*leans, ("lean_w", paper.number(record["lean_w"], decimals=1))]


# ---- offsets by level: a row per level and face, a column per line


ACROSS, LETTERS = 12, 72  # largest number of lines in a table, and of letters of their names
MOST_SHOWN = 20  # offsets shown with their tests, including the rejected offsets
# Format of an offset by its state.
MARKS = {"used": "{}", "rejected": "{}*", "check": "({})"}


def offsets_by_level(paper):
    """Tables of all observed offsets, several lines per table (list of Block).

    Repeated readings have separate rows. The workbook and offsets.csv list the offsets row by row.
    """
    record = paper.record["lines"]
    names = [line["line"] for line in record["lines"]]
    decimals = 1 + any(
        abs(value - round(value, 1)) > 1e-6
        for value in [1000 * offset["offset_m"] for offset in record["offsets"]]
    )
    readings = _group_by_place(record["offsets"])
    tables = []
    across = max(1, min(ACROSS, LETTERS // max(map(len, names))))
    for start in range(0, len(names), across):
        shown = names[start : start + across]
        rows = [
            [course, paper.number(level_m, decimals=3), str(face),
             *(_cell(paper, cells.get(name), decimals) for name in shown)]
            for (course, level_m, face, _), cells in readings.items()
            if cells.keys() & set(shown)
        ]  # fmt: skip
        heads = [(paper.word(f"table_headings.{key}"), unit)
                 for key, unit in (("course", ""), ("level_m", "m"), ("face", ""))]  # fmt: skip
        heads += [(name, "mm") for name in shown]
        align = ["left", "right", "right", *["right"] * len(shown)]
        caption = paper.word("captions.offsets_by_level")
        tables.append(blocks.table(heads, rows, caption, align, paper.marks.decimal))
    return tables


def largest_departures(record):
    """Return the Table of the rejected offsets and of the offsets with the largest |w|."""
    rows = record["lines"]["offsets"]
    ranked = sorted(rows, key=lambda row: (row["state"] != "rejected", -abs(row["w"] or 0.0)))
    rejected = sum(offset["state"] == "rejected" for offset in rows)
    chosen = ranked[: max(MOST_SHOWN, rejected)]
    return replace(OFFSETS, rows=lambda record: chosen)


def _group_by_place(offsets):
    """Return {(course, level, face, number of the repetition): {line: offset}}, from below."""
    readings, counts = {}, {}
    for offset in offsets:
        place = offset["course"], round(offset["level_m"], 3), offset["face"]
        repetition = counts[place, offset["line"]] = counts.get((place, offset["line"]), -1) + 1
        readings.setdefault((*place, repetition), {})[offset["line"]] = offset
    return dict(sorted(readings.items(), key=lambda item: (item[0][1], item[0][3], item[0][2])))


def _cell(paper, offset, decimals):
    if offset is None:
        return None
    text = paper.number(1000 * offset["offset_m"], decimals=decimals)
    return MARKS[offset["state"]].format(text)
