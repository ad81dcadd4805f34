"""Data of a record for the unrolled wall in the web page: points, or the map of a scanned wall.

`list_inspected` lists the points for inspection in the order of their distance from the wall:
rejected points, points with reduced weight, and points that a person decided to keep.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.report.blocks import Block
from tankcal.report.web import pack_numbers

MOST_POINTS = 4000  # largest number of drawn points
MOST_REJECTED = 2000  # largest number of drawn rejected points
LARGEST = 3.0  # largest drawn distance of a rejected point, in largest deviations of the wall


@dataclass(frozen=True)
class InspectedPoint:
    """A point that the outlier test or a person decided on.

    Attributes
    ----------
    name : str
        Name of the point.
    reason : str
        Code of the words `reasons`; "" for a kept point.
    azimuth_deg, height_m : float or None
        Azimuth about the axis, degrees, and height above the bottom, m; None without vertical wall.
    off_m : float or None
        Distance from the wall, positive outwards, m.
    w : float or None
        Normalised residual.
    is_kept : bool
        Whether a person decided to keep the point.
    """

    name: str
    reason: str
    azimuth_deg: float | None
    height_m: float | None
    off_m: float | None
    w: float | None
    is_kept: bool = False


def list_inspected(record):
    """Return the points for inspection (tuple of InspectedPoint), largest distance first."""
    place = _places(record) if record.get("shell") else _nowhere
    listed = [
        InspectedPoint(row["point"], row["reason"], *place(row), row["residual_m"], row["w"])
        for row in record["rejected"]
    ]
    points = {point["point"]: point for point in record["points"]}
    listed += [
        InspectedPoint(row["what"], "", *place(points[row["what"]]), row["off_m"], row["w"], True)
        for row in (record.get("overrulings") or {"each": ()})["each"]
        if row["decision"] == "keep" and row["kind"] == "point" and row["what"] in points
    ]
    return tuple(sorted(listed, key=lambda point: -abs(point.off_m or 0.0)))


def _places(record):
    """Return a function of a point: (azimuth in degrees, height above the bottom in m)."""
    shell, bottom_m = record["shell"], record["job"]["datum"]["bottom_z_m"]

    def place(point):
        # Position relative to the inclined axis at the height of the point.
        above = point["z_m"] - shell["z_m"]
        x = point["x_m"] - shell["x_m"] - shell["slope_x"] * above
        y = point["y_m"] - shell["y_m"] - shell["slope_y"] * above
        return float(np.degrees(np.arctan2(x, y)) % 360), point["z_m"] - bottom_m

    return place


def _nowhere(_point):
    return None, None


def reason_text(paper, point):
    """Return the reason for the inspection of a point in words."""
    if point.is_kept:
        return paper.word("overruling_decisions.keep")
    return paper.words["reasons"].get(point.reason, point.reason)


def wall_map_view(paper):
    """Block of the unrolled wall, which only the web page shows."""
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
            "azimuth_deg": pack_numbers(azimuth, "<f4"),
            "height_m": pack_numbers(height, "<f4"),
            "residual_m": pack_numbers(residual, "<f4"),
            "joints_m": [0.0, *(course["top_m"] for course in record["courses"])],
            "rejected": [
                {
                    "name": point.name,
                    "azimuth": round(point.azimuth_deg, 3),
                    "height": round(point.height_m, 4),
                    "off_mm": round(1e3 * (point.off_m or 0.0), 2),
                    "reason": reason_text(paper, point),
                    "is_kept": point.is_kept,
                }
                for point in list_inspected(record)[:MOST_REJECTED]
            ],
        }
    )


def limit_rejected(record, largest_m):
    """Return points for the three-dimensional view, [{name, azimuth, height, off_m}].

    The distance is limited to LARGEST times `largest_m`.
    """
    most = LARGEST * largest_m
    return [
        {
            "name": point.name,
            "azimuth": round(point.azimuth_deg, 3),
            "height": round(point.height_m, 4),
            "off_m": round(float(np.clip(point.off_m or 0.0, -most, most)), 5),
        }
        for point in list_inspected(record)[:MOST_REJECTED]
    ]


# ---- map of a scanned wall


HIDDEN = -32768  # code of a hidden cell, in tenths of a millimetre
_LARGEST = 32767  # largest deviation, in tenths of a millimetre


def cloud_map_view(paper):
    """Block of the map, which only the web page shows."""
    from tankcal.report import clouds  # of the method; imports matplotlib

    record = paper.record
    wall_map = record["clouds"]["map"]
    tenths = np.nan_to_num(10 * clouds.departures_mm(record), nan=HIDDEN).round()
    return Block(
        {
            "kind": "cloud_map",
            "text": paper.word("web.cloud_map_here"),
            "columns": len(wall_map["azimuth_edges_deg"]) - 1,
            "tenths": pack_numbers(np.clip(tenths, HIDDEN, _LARGEST), "<i2"),
            "azimuth_deg": pack_numbers(wall_map["azimuth_edges_deg"], "<f4"),
            "height_m": pack_numbers(wall_map["height_edges_m"], "<f4"),
            "joints_m": clouds.joints_m(record),
            "limit_mm": clouds.limit_mm(record),
            "hidden": [
                [
                    *interval,
                    obstruction["bottom_m"],
                    obstruction["top_m"],
                    paper.word(f"obstructions.{obstruction['guess']}"),
                ]
                for obstruction in record["clouds"]["obstructions"]
                for interval in clouds.azimuth_intervals(obstruction)
            ],
        }
    )
