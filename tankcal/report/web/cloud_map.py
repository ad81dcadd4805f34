"""Data of a record for the map of the scanned wall in the web page."""

import numpy as np

from tankcal.report.blocks import Block
from tankcal.report.clouds import departures_mm, joints_m, limit_mm, of_turn
from tankcal.report.web.packing import packed

HIDDEN = -32768  # code of a hidden cell, in tenths of a millimetre
_LARGEST = 32767  # largest deviation, in tenths of a millimetre


def cloud_map_view(paper):
    """Block of the map, which only the web page shows."""
    record = paper.record
    wall_map = record["clouds"]["map"]
    tenths = np.nan_to_num(10 * departures_mm(record), nan=HIDDEN).round()
    return Block(
        {
            "kind": "cloud_map",
            "text": paper.word("web.cloud_map_here"),
            "columns": len(wall_map["azimuth_edges_deg"]) - 1,
            "tenths": packed(np.clip(tenths, HIDDEN, _LARGEST), "<i2"),
            "azimuth_deg": packed(wall_map["azimuth_edges_deg"], "<f4"),
            "height_m": packed(wall_map["height_edges_m"], "<f4"),
            "joints_m": joints_m(record),
            "limit_mm": limit_mm(record),
            "hidden": [
                [
                    *interval,
                    obstruction["bottom_m"],
                    obstruction["top_m"],
                    paper.word(f"obstructions.{obstruction['guess']}"),
                ]
                for obstruction in record["clouds"]["obstructions"]
                for interval in of_turn(obstruction)
            ],
        }
    )
