"""The part of the record for inspections: the shape of an upright wall.

It contains radii and deviations from the vertical with u and degrees of freedom, but no verdict, so
that any rule can be applied later. u includes the common errors of the values.
"""

import numpy as np

from tankcal.pipeline.tanks.vertical import nominal_inside_m
from tankcal.pipeline.wall.shape import wall_shape_of
from tankcal.record.schema import Finite, Saved, key


class ShapeLevel(Saved):
    """Inside radii of a level about its own centre, at the temperature of the survey."""

    height_m: Finite = key("above the bottom of the shell")
    course: int = key("from the bottom, 1 first")
    is_low: bool = key("whether it is the level 0.3 m above the bottom weld")
    centre_x_m: float | None = key("in the survey's frame; null: not known")
    centre_y_m: float | None = key("in the survey's frame; null: not known")
    azimuth_deg: list[Finite] = key("of each place, clockwise from +y")
    radius_m: list[Finite] = key("plate and paint taken off")
    u_mm: list[Finite] = key("standard uncertainty")
    dof: list[float] = key("degrees of freedom; null: infinite")


class ShapePlumb(Saved):
    """Deviations of an upper level from the vertical of a lower level, along the generatrices."""

    course: int | None = key("from the bottom, 1 first; null: several courses")
    low_m: Finite = key("height of the lower level above the bottom of the shell")
    high_m: Finite = key("height of the upper level")
    azimuth_deg: list[Finite] = key("of each generatrix, clockwise from +y")
    is_read: list[bool] = key("whether both ends have a reading; otherwise one is estimated")
    departure_mm: list[Finite] = key("outwards positive")
    u_mm: list[Finite] = key("standard uncertainty")
    dof: list[float] = key("degrees of freedom; null: infinite")


class ShapeAxis(Saved):
    """The centre of the highest level relative to that of the lowest."""

    low_m: Finite = key("height of the lowest level above the bottom of the shell")
    high_m: Finite = key("height of the highest level")
    x_mm: Finite = key("from the lower centre to the upper")
    y_mm: Finite = key("from the lower centre to the upper")
    u_mm: Finite = key("standard uncertainty along their direction")
    dof: float = key("degrees of freedom; null: infinite")


class ShapeSetAside(Saved):
    """A rejected point near the wall: of a fitting, a blunder, or a dent."""

    point: str = key("name")
    height_m: Finite = key("above the bottom of the shell")
    azimuth_deg: Finite = key("about the axis, clockwise from +y")
    residual_mm: Finite = key("outwards from the wall by the other points")


class WallShapeRecord(Saved):
    """The shape of an upright wall, for inspections."""

    state: str = key('"as_found": loaded as it was surveyed; "unloaded": head taken off')
    set_aside: list[ShapeSetAside] = key("rejected points near the wall")
    nominal_radius_m: Finite = key("inside, by the drawing")
    levels: list[ShapeLevel] = key("from the bottom up")
    plumbs: list[ShapePlumb] = key("each level with a known centre against the lowest of these")
    axis: ShapeAxis | None = key("null: fewer than two centres are known")
    courses: list[ShapePlumb] = key("those with two levels far enough apart")


def shape_record(job, wall):
    """Return the `WallShapeRecord` of a wall.

    Parameters
    ----------
    job : Job
        The computed job.
    wall : pipeline.wall.surveyed.Wall or None

    Returns
    -------
    WallShapeRecord or None
        None if no upright wall was surveyed by points.
    """
    shape = wall_shape_of(job, wall)
    if shape is None:
        return None
    heights = [level.height_m for level in shape.levels]
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
                point.point, point.height_m, np.degrees(point.azimuth_rad), 1000 * point.residual_m
            )
            for point in shape.set_aside
        ],
        nominal_inside_m(job, job.courses[0]),
        [_level(*level) for level in zip(shape.levels, shape.radii, shape.centres_m, strict=True)],
        [_plumb(plumb, heights, None) for plumb in shape.plumbs],
        axis,
        [_plumb(plumb, heights, shape.levels[plumb.low].course + 1) for plumb in shape.courses],
    )


def _level(level, radii, centre):
    x, y = (None, None) if centre is None else centre
    return ShapeLevel(
        level.height_m, level.course + 1, level.is_low, x, y, np.degrees(level.azimuth_rad),
        radii.value_m, 1000 * radii.u_m, radii.dof,
    )  # fmt: skip


def _plumb(plumb, heights, course):
    figures, azimuth_deg = plumb.figures, np.degrees(plumb.azimuth_rad)
    return ShapePlumb(
        course, heights[plumb.low], heights[plumb.high], azimuth_deg, plumb.is_read,
        1000 * figures.value_m, 1000 * figures.u_m, figures.dof,
    )  # fmt: skip
