"""Saved part of reference lines, and the tables that print it: offsets, levels, plummets, lean."""

from dataclasses import replace

import numpy as np

from tankcal.record.schema import Saved, key
from tankcal.report import blocks
from tankcal.report.tables.table import Column, Table
from tankcal.survey.reference_line import collimation_by_faces
from tankcal.units import FULL_TURN


class OffsetReading(Saved):
    """An offset of the wall from a line of sight."""

    line: str = key("name")
    course: str = key("of the level")
    level_m: float = key("above the table's zero")
    face: int = key("1, or 2: the plummet turned by half a turn")
    reference: bool = key("whether it was read at the reference level")
    offset_m: float = key("as read")
    sd_m: float = key("of one reading")
    departure_m: float | None = key(
        "outwards, from the wall by all other readings; null: only compared"
    )
    w: float | None = key("departure over its sd; null: only compared, or uncontrolled")
    mdb_m: float | None = key("smallest blunder that the test detects; null if w is null")
    state: str = key('"used", "rejected" (by w) or "check" (only compared)')
    row: int | None = key("of the file")


class SightLine(Saved):
    """A line of sight."""

    line: str = key("name")
    azimuth_rad: float = key("of its position, clockwise from +y")
    plummet: str = key("name of its instrument")
    side: str = key('"outside" or "inside"')
    offsets: int = key("adjusted and not rejected")
    rejected: int = key("offsets that were rejected")


class LevelOfLines(Saved):
    """Estimates from the offsets of one level alone."""

    course: str = key("of the level")
    level_m: float = key("above the table's zero")
    lines: int = key("number of lines with an offset")
    rise_m: float = key("mean radius less that of the reference level")
    radius_m: float = key("mean radius, outside, as adjusted with the wall")
    centre_x_m: float = key("its centre less that of the reference level, towards +x")
    centre_y_m: float = key("its centre less that of the reference level, towards +y")


class PlummetUsed(Saved):
    """A plummet and its collimation."""

    plummet: str = key('name; "": not described')
    certificate: str = key('its number; "": not given')
    u_declared_rad: float | None = key("declared standard uncertainty; null: not declared")
    collimation_rad: float = key("as adjusted; above 0: away from the axis of the tank")
    u_rad: float = key("its standard uncertainty after the adjustment")
    by_faces_rad: float | None = key("from the difference of both faces alone; null: one face")


class LinesRecord(Saved):
    """Offsets from lines of sight round the tank, and their results."""

    offsets: list[OffsetReading] = key("in the order of the file")
    lines: list[SightLine] = key("in the order of the file")
    levels: list[LevelOfLines] = key("from the bottom up, without the reference level")
    plummets: list[PlummetUsed] = key("of the lines")
    reference_level_m: float = key("mean height of the readings at the reference level")
    reference_course: str = key("of the reference level")
    lean_x: float | None = key("slope of the axis towards +x; null: one level alone")
    lean_y: float | None = key("slope of the axis towards +y")
    lean_azimuth_rad: float | None = key("direction of the lean, clockwise from +y")
    lean_sd: float | None = key(
        "standard uncertainty of both slopes, by the scatter of the centres"
    )
    points_lean_x: float | None = key(
        "lean by points measured in addition to the lines, towards +x; null: none", default=None
    )
    points_lean_y: float | None = key("lean by these points towards +y", default=None)
    lean_w: float | None = key(
        "length of the difference of both leans over its standard deviation", default=None
    )


def save_lines(result):
    """`LinesRecord` of a result."""
    from tankcal.methods.lines.warnings import compare_leans, levels_and_lean

    lines = result.job.lines
    offsets = _offsets(result)
    levels, lean = levels_and_lean(result.job, result.read)
    names = [course.name for course in result.job.courses]
    test = None if result.wall is None else compare_leans(lean, result.wall.shell)
    return LinesRecord(
        offsets=offsets,
        lines=_sight_lines(lines, offsets),
        levels=[
            LevelOfLines(
                course=level.course,
                level_m=level.level_m,
                lines=level.lines,
                rise_m=level.rise_m,
                radius_m=result.read.radius_at(names.index(level.course), level.level_m),
                centre_x_m=level.centre_m[0],
                centre_y_m=level.centre_m[1],
            )
            for level in levels
        ],
        plummets=_plummets(result),
        reference_level_m=lines.reference_m,
        reference_course=next(offset.course for offset in lines.offsets if offset.reference),
        lean_x=lean.x,
        lean_y=lean.y,
        lean_azimuth_rad=np.arctan2(lean.x, lean.y) % FULL_TURN,
        lean_sd=lean.sd,
        points_lean_x=None if test is None else float(test.of_points[0]),
        points_lean_y=None if test is None else float(test.of_points[1]),
        lean_w=None if test is None else test.w,
    )


def _offsets(result):
    """Return `OffsetReading` of each offset; only adjusted offsets have tests."""
    wall, offsets = result.read, result.job.lines.offsets
    is_offset = wall.are("offsets")
    w, mdb_m, accepted = wall.tests_of("offsets")
    tests = dict(
        zip(
            wall.places[is_offset],
            zip(wall.tested.departure_m[is_offset], w, mdb_m, accepted, strict=True),
            strict=True,
        )
    )
    rows = []
    for index, offset in enumerate(offsets):
        departure_m, w, mdb_m, accepted = tests.get(index, (np.nan, np.nan, np.nan, None))
        state = "check" if accepted is None else "used" if accepted else "rejected"
        rows.append(
            OffsetReading(
                line=offset.line,
                course=offset.course,
                level_m=offset.level_m,
                face=offset.face,
                reference=offset.reference,
                offset_m=offset.offset_m,
                sd_m=offset.sd_m,
                departure_m=departure_m if np.isfinite(w) else None,
                w=w,
                mdb_m=mdb_m,
                state=state,
                row=offset.row,
            )
        )
    return rows


def _sight_lines(lines, offsets):
    """Return `SightLine` of each line, with the number of its used and rejected offsets."""
    states = {}
    for offset in offsets:
        states.setdefault(offset.line, []).append(offset.state)
    return [
        SightLine(
            line=name,
            azimuth_rad=line.azimuth_rad,
            plummet=line.instrument,
            side="inside" if line.inside else "outside",
            offsets=states[name].count("used"),
            rejected=states[name].count("rejected"),
        )
        for name, line in lines.lines.items()
    ]


def _plummets(result):
    """Return `PlummetUsed` of each plummet."""
    lines, rows = result.job.lines, []
    adjusted = [offset for offset in lines.offsets if not offset.check]
    for name, plummet in lines.plummets.items():
        collimation_rad, u_rad = result.read.collimations.get(name, (0.0, 0.0))
        by_faces = collimation_by_faces(lines, adjusted, name)
        rows.append(
            PlummetUsed(
                plummet=name,
                certificate=plummet.certificate,
                u_declared_rad=plummet.u_collimation_rad,
                collimation_rad=float(collimation_rad),
                u_rad=float(u_rad),
                by_faces_rad=None if by_faces is None else float(by_faces[0]),
            )
        )
    return rows


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
    ranks = [(row["state"] != "rejected", -abs(row["w"] or 0.0)) for row in rows]
    order = sorted(range(len(rows)), key=ranks.__getitem__)
    rejected = sum(offset["state"] == "rejected" for offset in rows)
    chosen = [rows[i] for i in order[: max(MOST_SHOWN, rejected)]]
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
