"""Dips: rows of a table, labels and units, interpolation between rows, and the inverse reading.

rows          heights of the rows, rounding, ullage, and the dip of a volume; volumes in m3, L and
              bbl, dips in metres or in feet and inches, as numbers and text
straightness  error of straight lines between rows, and the step that meets a bound of it;
              proportional parts: volumes of the millimetres of a dip between two rows
"""

from tankcal.tank.dips.rows import (
    HEIGHT_STEPS_M,
    INCHES_PER_FOOT,
    METRES_PER_INCH,
    MOST_ROWS,
    TABLE_DECIMALS,
    VOLUME_UNITS_M3,
    Dips,
    dip_label,
    dips_of,
    parse_dip,
    round_each,
    table_heights,
    top_mark,
    ullage_m,
    volume_from_m3,
    volume_to_m3,
)
from tankcal.tank.dips.straightness import (
    LADDERS_M,
    ProportionalParts,
    Rows,
    Straightness,
    choose_rows,
    interpolation_errors,
    proportional_parts,
)

__all__ = [
    "HEIGHT_STEPS_M",
    "INCHES_PER_FOOT",
    "LADDERS_M",
    "METRES_PER_INCH",
    "MOST_ROWS",
    "TABLE_DECIMALS",
    "VOLUME_UNITS_M3",
    "Dips",
    "ProportionalParts",
    "Rows",
    "Straightness",
    "choose_rows",
    "dip_label",
    "dips_of",
    "interpolation_errors",
    "parse_dip",
    "proportional_parts",
    "round_each",
    "table_heights",
    "top_mark",
    "ullage_m",
    "volume_from_m3",
    "volume_to_m3",
]
