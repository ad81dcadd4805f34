"""Tables of reference lines: offsets, lines, levels, plummets."""

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
