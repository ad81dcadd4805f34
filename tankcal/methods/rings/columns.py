"""Columns of rings.csv: the rings of a horizontal cylinder from end A to end B."""

from tankcal.job.fields import Field

RINGS = (
    Field("ring", "name", "name of the ring of plates, from end A to end B", required=True),
    Field(
        "length_m",
        "number",
        "length of the ring along the axis, metres",
        required=True,
        low=0,
        above_low=True,
        high=50,
    ),
    Field(
        "thickness_mm",
        "number",
        "plate thickness, millimetres; blank: mean of the readings in the table thickness",
        low=0,
        high=100,
    ),
    Field("paint_mm", "number", "thickness of the paint, millimetres; blank: 0", low=0, high=10),
    Field(
        "lap",
        "choice",
        "lap of lap-jointed rings: inner or outer, for all rings or for none; only compared;"
        " blank: not known",
        choices=("inner", "outer"),
        in_full=True,
    ),
)
EXAMPLES = {
    "rings": [
        {"ring": "1", "length_m": 1.9, "thickness_mm": 8.0, "paint_mm": 0.3, "lap": "outer"},
        {"ring": "2", "length_m": 1.9, "thickness_mm": 8.0, "paint_mm": 0.3, "lap": "inner"},
    ],
}
