"""Drawings of results for notebooks, by name."""

from typing import TYPE_CHECKING

import numpy as np

from tankcal.survey import Adjustment

LEVELS_OF_A_COURSE = 21  # heights of a course at which its wall is drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(result, what: str | None = None) -> "Figure":
    """Draw a result or an adjusted survey as a matplotlib Figure.

    Parameters
    ----------
    result : Result or Adjustment
        For an Adjustment, the points are drawn in plan with their error ellipses.
    what : {"capacity", "budget", "sections", "residuals", "wall", "field"}, optional
        Drawing of a Result. "capacity" (default): litres per centimetre and U against the dip.
        "budget": uncertainty budget at the top. For a surveyed wall, "sections": sections about
        their circles; "residuals": residuals of the points; "wall": residuals on the unrolled wall;
        "field": the wall of the table.

    Returns
    -------
    Figure

    Raises
    ------
    ValueError
        For an unknown name, or a drawing of the wall without a surveyed wall.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"))
    >>> tankcal.plot(result, "wall").get_size_inches().tolist()
    [6.5, 2.6]
    """
    if isinstance(result, Adjustment):
        if what is not None:
            raise ValueError(f"found {what!r}; an adjusted survey has one drawing: name none")
        return _draw(_network, result)
    what = what or "capacity"
    if what not in _DRAWINGS:
        raise ValueError(f"found {what!r}; expected one of {', '.join(_DRAWINGS)}")
    if what in _OF_THE_WALL and result.wall is None:
        raise ValueError(f"no wall was surveyed: there is no drawing of its {what}")
    return _draw(_DRAWINGS[what], result)


def _draw(draw, result):
    # matplotlib is loaded when something is drawn
    from tankcal.report.plots import figures as plots

    return draw(plots, result)


def _network(plots, adjustment):
    covariance = adjustment.covariance_m2[:, :2, :2]
    return plots.network(adjustment.names, adjustment.xyz_m[:, :2], covariance)


def _capacity(plots, result):
    table = result.table
    return plots.capacity_curves(table.height_m, table.area_m2, result.intervals.U_m3)


def _budget(plots, result):
    lines = result.budget().lines
    return plots.budget_bars([(line.name, line.share, line.is_default) for line in lines])


def _sections(plots, result):
    return plots.polar(_rings(plots, result), most=len(result.wall.sections))[0]


def _residuals(plots, result):
    return plots.residual_panels(_rings(plots, result), most=len(result.wall.sections))[0]


def _wall(plots, result):
    """Residuals on the unrolled wall."""
    wall, rings = result.wall, _rings(plots, result)
    members = np.concatenate([section.group.members for section in wall.sections])
    height_m = result.job.points.xyz_m[wall.accepted[members], 2] - result.job.datum.bottom_z_m
    azimuth = np.concatenate([ring.azimuth_deg for ring in rings])
    residual = np.concatenate([ring.residual_m for ring in rings])
    return plots.deviation_map(azimuth, height_m, residual, wall.joints_m)


def _field(plots, result):
    """Wall of the table, unrolled."""
    wall, field = result.wall, result.wall.field
    zeta, joints = np.linspace(-1, 1, LEVELS_OF_A_COURSE), wall.joints_m
    outlines = field.outlines_at(zeta)
    departures = outlines - outlines.mean(axis=(1, 2), keepdims=True)
    middle, half = (joints[1:] + joints[:-1]) / 2, np.diff(joints) / 2
    heights = middle[:, None] + half[:, None] * zeta
    sites = field.sites
    height_of_sites = middle[sites.course] + half[sites.course] * sites.zeta
    azimuth_deg = np.append(np.degrees(field.grid_rad), 360.0)
    rows = departures.reshape(-1, departures.shape[2])
    return plots.field_map(
        azimuth_deg,
        heights.ravel(),
        # The first azimuth is repeated at 360 degrees to close the turn.
        np.column_stack([rows, rows[:, 0]]),
        (np.degrees(sites.azimuth_rad) % 360, height_of_sites),
        joints,
    )


def _rings(plots, result):
    """`Ring`s of the sections of a result."""
    every_degree = np.arange(360.0)
    return [
        plots.Ring(
            section.group.name,
            f"{section.group.height_m:.3f} m",
            section.circle.radius_m,
            np.degrees(section.outline.azimuth_rad) % 360,
            section.circle.residuals_m,
            every_degree,
            section.outline.radius_m(np.radians(every_degree)),
        )
        for section in result.wall.sections
    ]


_DRAWINGS = {
    "capacity": _capacity,
    "budget": _budget,
    "sections": _sections,
    "residuals": _residuals,
    "wall": _wall,
    "field": _field,
}
_OF_THE_WALL = ("sections", "residuals", "wall", "field")
