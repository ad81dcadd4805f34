"""Where the dips are taken: on paper and in the sketch, from what the record has of it."""

from dataclasses import dataclass
from math import atan2, degrees, hypot


@dataclass(frozen=True)
class DipPoint:
    """A declared dip point.

    share        where it lies in the tank seen from the side: from the axis (0) to the wall (1) of
                 an upright tank, from the start (0) to the end (1) of a lying cylinder
    off_m        distance from the axis; None for a lying tank
    azimuth_deg  from the axis, clockwise from +y; None for a lying tank
    along_m      along the axis of a lying tank, from the start of the cylinder at A; else None
    """

    share: float
    off_m: float | None = None
    azimuth_deg: float | None = None
    along_m: float | None = None


def dip_point(record):
    """The DipPoint of a record; None where none was declared or the kind of tank has none."""
    kind, datum = record["job"]["tank"]["kind"], record["job"]["datum"]
    if kind == "horizontal":
        sizes = {one["code"]: one["value"] for one in record["solid"]}
        along = sizes["dip_from_a"]
        share = along / sizes["cylinder_length"]
        return DipPoint(min(max(share, 0.0), 1.0), along_m=along)
    if kind != "vertical" or datum.get("dip_x_m") is None:
        return None
    axis_m = record["shell"] or {"x_m": 0.0, "y_m": 0.0}  # a strapped tank: from its own axis
    east, north = (datum[f"dip_{axis}_m"] - axis_m[f"{axis}_m"] for axis in "xy")
    off = hypot(east, north)
    share = min(off / record["courses"][0]["inside_radius_m"], 1.0)
    return DipPoint(share, off, degrees(atan2(east, north)) % 360)


def dip_point_text(paper):
    """Where it is, in words; None for a kind of tank that has no dip point to declare."""
    kind, datum = paper.record["job"]["tank"]["kind"], paper.record["job"]["datum"]
    if kind not in ("vertical", "horizontal"):
        return None
    found = dip_point(paper.record)
    if found is None:
        return paper.word("texts.dip_point_open")
    if found.along_m is not None:
        along = paper.number(found.along_m, "m", decimals=3)
        return paper.word("texts.dip_point_along", along=along)
    x, y = (paper.number(datum[key], "m", decimals=3) for key in ("dip_x_m", "dip_y_m"))
    off = paper.number(found.off_m, "m", decimals=3)
    azimuth = paper.number(found.azimuth_deg, "deg", decimals=0)
    return paper.word("texts.dip_point", x=x, y=y, off=off, azimuth=azimuth)
