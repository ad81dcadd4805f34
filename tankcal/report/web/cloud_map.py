"""What the map of the page needs of a record: the wall that scans show, unrolled."""

import numpy as np

from tankcal.report.blocks import Block
from tankcal.report.clouds import departures_mm, joints_m, limit_mm, of_turn
from tankcal.report.web.packing import packed

HIDDEN = -32768  # in tenths of a millimetre: no scan shows the wall there
_LARGEST = 32767


def cloud_map_view(paper):
    """The block of the map, for the record of a paper: shown on the page only."""
    record = paper.record
    drawn = record["clouds"]["map"]
    tenths = np.nan_to_num(10 * departures_mm(record), nan=HIDDEN).round()
    return Block(
        {
            "kind": "cloud_map",
            "text": paper.word("web.cloud_map_here"),
            "columns": len(drawn["azimuth_edges_deg"]) - 1,
            "tenths": packed(np.clip(tenths, HIDDEN, _LARGEST), "<i2"),
            "azimuth_deg": packed(drawn["azimuth_edges_deg"], "<f4"),
            "height_m": packed(drawn["height_edges_m"], "<f4"),
            "joints_m": joints_m(record),
            "limit_mm": limit_mm(record),
            "hidden": [
                [*turn, one["bottom_m"], one["top_m"], paper.word(f"obstructions.{one['guess']}")]
                for one in record["clouds"]["obstructions"]
                for turn in of_turn(one)
            ],
        }
    )
