"""The part of the record that says what reference lines showed: offsets, levels, plummets, lean."""

import numpy as np

from tankcal.pipeline.line_checks import compare_leans, levels_and_lean
from tankcal.record.schema import Saved, key
from tankcal.survey.reference_line import collimation_by_faces
from tankcal.units import FULL_TURN


class OffsetReading(Saved):
    """An offset of the wall from a line of sight."""

    line: str = key("name")
    course: str = key("that it is on")
    level_m: float = key("above the table's zero")
    face: int = key("1, or 2: the plummet turned by half a turn")
    reference: bool = key("whether it was read at the reference level")
    offset_m: float = key("as read")
    sd_m: float = key("of one reading")
    departure_m: float | None = key("outwards, from what all others show; null: only compared")
    w: float | None = key("that over its sd; null: only compared, or uncontrolled")
    mdb_m: float | None = key("smallest blunder that this test finds; null: as for w")
    state: str = key('"used", "rejected" (by w) or "check" (only compared)')
    row: int | None = key("of the file")


class SightLine(Saved):
    """A line of sight."""

    line: str = key("name")
    azimuth_rad: float = key("where it stands, clockwise from +y")
    plummet: str = key("name of its instrument")
    side: str = key('"outside" or "inside"')
    offsets: int = key("adjusted and not rejected")
    rejected: int = key("offsets that were rejected")


class LevelOfLines(Saved):
    """What the offsets of one level say by themselves."""

    course: str = key("that it is on")
    level_m: float = key("above the table's zero")
    lines: int = key("that read it")
    rise_m: float = key("mean radius less that of the reference level")
    radius_m: float = key("mean radius there, outside, as adjusted with the wall")
    centre_x_m: float = key("of its centre from that of the reference level, towards +x")
    centre_y_m: float = key("the same towards +y")


class PlummetUsed(Saved):
    """A plummet and its collimation."""

    plummet: str = key('name; "": nobody described it')
    certificate: str = key('its number; "": not given')
    u_declared_rad: float | None = key("standard uncertainty that was given; null: none was")
    collimation_rad: float = key("as adjusted; above 0: away from the axis of the tank")
    u_rad: float = key("its standard uncertainty after the adjustment")
    by_faces_rad: float | None = key("by the difference of both faces alone; null: one face")


class LinesRecord(Saved):
    """Offsets from lines of sight round the tank, and what they show."""

    offsets: list[OffsetReading] = key("in the order of the file")
    lines: list[SightLine] = key("in the order of the file")
    levels: list[LevelOfLines] = key("from the bottom up, without the reference level")
    plummets: list[PlummetUsed] = key("that the lines were made by")
    reference_level_m: float = key("mean height of the readings at the reference level")
    reference_course: str = key("that it is on")
    lean_x: float | None = key("slope of the axis towards +x; null: one level alone")
    lean_y: float | None = key("the same towards +y")
    lean_azimuth_rad: float | None = key("where it leans to, clockwise from +y")
    lean_sd: float | None = key("standard uncertainty of both, by the scatter of the centres")
    points_lean_x: float | None = key(
        "lean that points beside the lines show, towards +x; null: none do", default=None
    )
    points_lean_y: float | None = key("the same towards +y", default=None)
    lean_w: float | None = key(
        "length of the difference of both leans over its standard deviation", default=None
    )


def lines_of(result):
    """`LinesRecord` of a result; None where there are no lines."""
    given = result.job.lines
    if given is None:
        return None
    offsets = _offsets(result)
    levels, lean = levels_and_lean(result.job, result.read)
    names = [course.name for course in result.job.courses]
    test = None if result.wall is None else compare_leans(lean, result.wall.shell)
    return LinesRecord(
        offsets=offsets,
        lines=_lines(given, offsets),
        levels=[
            LevelOfLines(
                course=one.course,
                level_m=one.level_m,
                lines=one.lines,
                rise_m=one.rise_m,
                radius_m=result.read.radius_at(names.index(one.course), one.level_m),
                centre_x_m=one.centre_m[0],
                centre_y_m=one.centre_m[1],
            )
            for one in levels
        ],
        plummets=_plummets(result),
        reference_level_m=given.reference_m,
        reference_course=next(one.course for one in given.offsets if one.reference),
        lean_x=lean.x,
        lean_y=lean.y,
        lean_azimuth_rad=np.arctan2(lean.x, lean.y) % FULL_TURN,
        lean_sd=lean.sd,
        points_lean_x=None if test is None else float(test.of_points[0]),
        points_lean_y=None if test is None else float(test.of_points[1]),
        lean_w=None if test is None else test.w,
    )


def _offsets(result):
    wall, given = result.read, result.job.lines.offsets
    mine = wall.are("offsets")
    w, mdb, accepted = wall.tests_of("offsets")
    found = dict(
        zip(wall.places[mine], zip(wall.tested.departure_m[mine], w, mdb, accepted, strict=True),
            strict=True)
    )  # fmt: skip
    rows = []
    for place, one in enumerate(given):
        away, of_w, least, kept = found.get(place, (np.nan, np.nan, np.nan, None))
        state = "check" if kept is None else "used" if kept else "rejected"
        rows.append(
            OffsetReading(
                line=one.line,
                course=one.course,
                level_m=one.level_m,
                face=one.face,
                reference=one.reference,
                offset_m=one.offset_m,
                sd_m=one.sd_m,
                departure_m=away if np.isfinite(of_w) else None,
                w=of_w,
                mdb_m=least,
                state=state,
                row=one.row,
            )
        )
    return rows


def _lines(given, offsets):
    states = {}
    for one in offsets:
        states.setdefault(one.line, []).append(one.state)
    return [
        SightLine(
            line=name,
            azimuth_rad=line.azimuth_rad,
            plummet=line.instrument,
            side="inside" if line.inside else "outside",
            offsets=states[name].count("used"),
            rejected=states[name].count("rejected"),
        )
        for name, line in given.lines.items()
    ]


def _plummets(result):
    given, found = result.job.lines, []
    used = [one for one in given.offsets if not one.check]
    for name, plummet in given.plummets.items():
        kappa, u = result.read.collimations.get(name, (0.0, 0.0))
        by_faces = collimation_by_faces(given, used, name)
        found.append(
            PlummetUsed(
                plummet=name,
                certificate=plummet.certificate,
                u_declared_rad=plummet.u_collimation_rad,
                collimation_rad=float(kappa),
                u_rad=float(u),
                by_faces_rad=None if by_faces is None else float(by_faces[0]),
            )
        )
    return found
