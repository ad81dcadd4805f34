"""The dip point of a record, for reports and the sketch."""

from dataclasses import dataclass
from math import atan2, degrees, hypot


@dataclass(frozen=True)
class DipPoint:
    """A declared dip point.

    Attributes
    ----------
    share : float
        Relative position. Vertical tank: from the axis (0) to the wall (1). Horizontal tank: from
        the start (0) to the end (1) of the cylinder.
    off_m : float or None
        Distance from the axis, m; None for a horizontal tank.
    azimuth_deg : float or None
        Azimuth from the axis, clockwise from +y, degrees; None for a horizontal tank.
    along_m : float or None
        Distance along the axis of a horizontal tank, from the start of the cylinder at A, m; None
        for a vertical tank.
    """

    share: float
    off_m: float | None = None
    azimuth_deg: float | None = None
    along_m: float | None = None


def dip_point(record):
    """Return the DipPoint of a record, or None if no dip point is declared."""
    kind, datum = record["job"]["tank"]["kind"], record["job"]["datum"]
    if kind == "horizontal":
        sizes = {size["code"]: size["value"] for size in record["solid"]}
        along = sizes["dip_from_a"]
        share = along / sizes["cylinder_length"]
        return DipPoint(min(max(share, 0.0), 1.0), along_m=along)
    if kind != "vertical" or datum.get("dip_x_m") is None:
        return None
    axis_m = record["shell"] or {"x_m": 0.0, "y_m": 0.0}  # strapped tank: the axis is the origin
    east, north = (datum[f"dip_{axis}_m"] - axis_m[f"{axis}_m"] for axis in "xy")
    off = hypot(east, north)
    share = min(off / record["courses"][0]["inside_radius_m"], 1.0)
    return DipPoint(share, off, degrees(atan2(east, north)) % 360)


def dip_point_text(paper):
    """Return the position of the dip point in words; None for kinds of tank without dip point."""
    kind, datum = paper.record["job"]["tank"]["kind"], paper.record["job"]["datum"]
    if kind not in ("vertical", "horizontal"):
        return None
    point = dip_point(paper.record)
    if point is None:
        return paper.word("texts.dip_point_open")
    if point.along_m is not None:
        along = paper.number(point.along_m, "m", decimals=3)
        return paper.word("texts.dip_point_along", along=along)
    x, y = (paper.number(datum[key], "m", decimals=3) for key in ("dip_x_m", "dip_y_m"))
    off = paper.number(point.off_m, "m", decimals=3)
    azimuth = paper.number(point.azimuth_deg, "deg", decimals=0)
    return paper.word("texts.dip_point", x=x, y=y, off=off, azimuth=azimuth)
