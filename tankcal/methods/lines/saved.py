"""The part of the record on reference lines: offsets, levels, plummets, lean."""

import numpy as np

from tankcal.record.schema import Saved, key
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
