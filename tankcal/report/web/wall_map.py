"""What the unrolled wall of the page needs of a record: its points, and those that were rejected.

`looked_at` lists what a person may want to look at one by one: rejected points, those that count by
half, and those that somebody decided to keep, from the largest distance down.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.report.blocks import Block
from tankcal.report.web.packing import packed

MOST_POINTS = 4000  # that are drawn
MOST_REJECTED = 2000
LARGEST = 3.0  # times the largest deviation of the wall: so far off a rejected point is drawn


@dataclass(frozen=True)
class LookedAt:
    """A point that a search or a person decided about.

    Attributes
    ----------
    name, reason : str
        The reason is a code of the words `reasons`; "" of a point that was kept.
    azimuth_deg, height_m : float or None
        About the axis, and above the bottom; None where there is no upright wall.
    off_m, w : float or None
        From the wall, outwards, m; normalised residual.
    is_kept : bool
        By a decision.
    """

    name: str
    reason: str
    azimuth_deg: float | None
    height_m: float | None
    off_m: float | None
    w: float | None
    is_kept: bool = False


def looked_at(record):
    """`LookedAt` of the points of a wall."""
    place = _places(record) if record.get("shell") else _nowhere
    found = [
        LookedAt(one["point"], one["reason"], *place(one), one["residual_m"], one["w"])
        for one in record["rejected"]
    ]
    points = {one["point"]: one for one in record["points"]}
    found += [
        LookedAt(one["what"], "", *place(points[one["what"]]), one["off_m"], one["w"], True)
        for one in (record.get("overrulings") or {"each": ()})["each"]
        if one["decision"] == "keep" and one["kind"] == "point" and one["what"] in points
    ]
    return tuple(sorted(found, key=lambda one: -abs(one.off_m or 0.0)))


def _places(record):
    """A function from a point to its (azimuth in degrees, height above the bottom)."""
    shell, bottom_m = record["shell"], record["job"]["datum"]["bottom_z_m"]

    def place(point):
        above = point["z_m"] - shell["z_m"]
        x = point["x_m"] - shell["x_m"] - shell["slope_x"] * above
        y = point["y_m"] - shell["y_m"] - shell["slope_y"] * above
        return float(np.degrees(np.arctan2(x, y)) % 360), point["z_m"] - bottom_m

    return place


def _nowhere(_point):
    return None, None


def why(paper, one):
    """Why a point is looked at, in words."""
    if one.is_kept:
        return paper.word("overruling_decisions.keep")
    return paper.words["reasons"].get(one.reason, one.reason)


def wall_map_view(paper):
    """The block of the unrolled wall, for the record of a paper: shown on the page only."""
    record = paper.record
    z_m = {point["point"]: point["z_m"] for point in record["points"]}
    bottom_m = record["job"]["datum"]["bottom_z_m"]
    rows = [
        (str(name), azimuth, z_m[name] - bottom_m, residual)
        for section in record["sections"]
        for name, azimuth, residual in zip(
            section["points"], section["azimuth_deg"], section["residual_m"], strict=True
        )
    ]
    rows = rows[:: -(-len(rows) // MOST_POINTS) or 1]
    names, azimuth, height, residual = zip(*rows, strict=True)
    return Block(
        {
            "kind": "wall_map",
            "text": paper.word("web.wall_map_here"),
            "names": list(names),
            "azimuth_deg": packed(azimuth, "<f4"),
            "height_m": packed(height, "<f4"),
            "residual_m": packed(residual, "<f4"),
            "joints_m": [0.0, *(course["top_m"] for course in record["courses"])],
            "rejected": [
                {
                    "name": one.name,
                    "azimuth": round(one.azimuth_deg, 3),
                    "height": round(one.height_m, 4),
                    "off_mm": round(1e3 * (one.off_m or 0.0), 2),
                    "reason": why(paper, one),
                    "is_kept": one.is_kept,
                }
                for one in looked_at(record)[:MOST_REJECTED]
            ],
        }
    )


def rejected_in_space(record, largest_m):
    """[{name, azimuth, height, off_m}] for the three-dimensional view, at most so far off."""
    most = LARGEST * largest_m
    return [
        {
            "name": one.name,
            "azimuth": round(one.azimuth_deg, 3),
            "height": round(one.height_m, 4),
            "off_m": round(float(np.clip(one.off_m or 0.0, -most, most)), 5),
        }
        for one in looked_at(record)[:MOST_REJECTED]
    ]
