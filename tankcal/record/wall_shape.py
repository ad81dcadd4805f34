"""The part of the record that an inspection is made of: the shape of an upright wall.

Radii and departures from the plumb with u and degrees of freedom, not yet judged: any rule can
judge them, also in ten years. What the figures have in common is in them already.
"""

import numpy as np

from tankcal.pipeline.tanks.vertical import nominal_inside_m
from tankcal.pipeline.wall_shape import wall_shape_of
from tankcal.record.schema import Finite, Saved, key


class ShapeLevel(Saved):
    """Inside radii of a level about its own centre, at the temperature of the survey."""

    height_m: Finite = key("above the bottom of the shell")
    course: int = key("from the bottom, 1 first")
    is_low: bool = key("whether it is the one 0.3 m above the bottom weld")
    centre_x_m: float | None = key("in the survey's frame; null: not known")
    centre_y_m: float | None = key("in the survey's frame; null: not known")
    azimuth_deg: list[Finite] = key("of each place, clockwise from +y")
    radius_m: list[Finite] = key("plate and paint taken off")
    u_mm: list[Finite] = key("standard uncertainty")
    dof: list[float] = key("degrees of freedom; null: infinite")


class ShapePlumb(Saved):
    """Departures of an upper level from the plumb of a lower one, along the generatrices."""

    course: int | None = key("from the bottom, 1 first; null: of more than one")
    low_m: Finite = key("height of the lower level above the bottom of the shell")
    high_m: Finite = key("height of the upper level")
    azimuth_deg: list[Finite] = key("of each generatrix, clockwise from +y")
    is_read: list[bool] = key("whether there is a reading at both ends; else one is estimated")
    departure_mm: list[Finite] = key("outwards positive")
    u_mm: list[Finite] = key("standard uncertainty")
    dof: list[float] = key("degrees of freedom; null: infinite")


class ShapeAxis(Saved):
    """The centre of the highest level against that of the lowest."""

    low_m: Finite = key("height of the lowest level above the bottom of the shell")
    high_m: Finite = key("height of the highest level")
    x_mm: Finite = key("from the lower centre to the upper")
    y_mm: Finite = key("from the lower centre to the upper")
    u_mm: Finite = key("standard uncertainty along their direction")
    dof: float = key("degrees of freedom; null: infinite")


class ShapeSetAside(Saved):
    """A point near the wall that was not taken for it: of a fitting, a slip, or a dent."""

    point: str = key("name")
    height_m: Finite = key("above the bottom of the shell")
    azimuth_deg: Finite = key("about the axis, clockwise from +y")
    residual_mm: Finite = key("outwards from the wall as the other points show it")


class WallShapeRecord(Saved):
    """The shape of an upright wall, for inspections."""

    state: str = key('"as_found": loaded as it was surveyed; "unloaded": head taken off')
    set_aside: list[ShapeSetAside] = key("points near the wall that are not judged")
    nominal_radius_m: Finite = key("inside, by the drawing")
    levels: list[ShapeLevel] = key("from the bottom up")
    plumbs: list[ShapePlumb] = key("each level with a known centre against the lowest of these")
    axis: ShapeAxis | None = key("null: fewer than two centres are known")
    courses: list[ShapePlumb] = key("those with two levels far enough apart")


def shape_record(job, wall):
    """The `WallShapeRecord` of a wall; None where no upright wall was surveyed by points.

    Parameters
    ----------
    job : Job
        As it was computed.
    wall : pipeline.surveyed_wall.Wall or None
    """
    shape = wall_shape_of(job, wall)
    if shape is None:
        return None
    heights = [one.height_m for one in shape.levels]
    axis = None
    if shape.axis is not None:
        low, high = shape.plumbs[-1].low, shape.plumbs[-1].high
        x, y, _ = 1000 * shape.axis.value_m
        axis = ShapeAxis(heights[low], heights[high], x, y,
                         1000 * shape.axis.u_m[2], shape.axis.dof[2])  # fmt: skip
    return WallShapeRecord(
        shape.state,
        [
            ShapeSetAside(
                one.point, one.height_m, np.degrees(one.azimuth_rad), 1000 * one.residual_m
            )
            for one in shape.set_aside
        ],
        nominal_inside_m(job, job.courses[0]),
        [_level(*one) for one in zip(shape.levels, shape.radii, shape.centres_m, strict=True)],
        [_plumb(one, heights, None) for one in shape.plumbs],
        axis,
        [_plumb(one, heights, shape.levels[one.low].course + 1) for one in shape.courses],
    )


def _level(level, radii, centre):
    x, y = (None, None) if centre is None else centre
    return ShapeLevel(
        level.height_m, level.course + 1, level.is_low, x, y, np.degrees(level.azimuth_rad),
        radii.value_m, 1000 * radii.u_m, radii.dof,
    )  # fmt: skip


def _plumb(one, heights, course):
    found, azimuth = one.figures, np.degrees(one.azimuth_rad)
    return ShapePlumb(
        course, heights[one.low], heights[one.high], azimuth, one.is_read,
        1000 * found.value_m, 1000 * found.u_m, found.dof,
    )  # fmt: skip
