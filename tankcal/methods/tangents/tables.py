"""Tables of tangents: set-ups, levels with perimeter and area, and all sights."""

from tankcal.report.tables.table import (
    CHECKS,
    COURSE,
    DEPARTURE,
    LEAST,
    LEVEL,
    PLACE,
    ROW,
    SETUP,
    Column,
    Table,
    counts_of,
)

_W = Column("w", decimals=2, heading="tangent_w", sheet="tangent_w")
_COUNTS = counts_of("tangents")

SETUPS = Table(
    "tangent_setups",
    (
        *PLACE,
        *_COUNTS,
        CHECKS,
        _W,
        Column("turn_rad", "rad arcsec", decimals=1, heading="tangent_turn",
               sheet="tangent_turn_arcsec"),
    ),
    rows=lambda record: record["tangents"]["setups"],
)  # fmt: skip

LEVELS = Table(
    "tangent_levels",
    (
        COURSE,
        LEVEL,
        *_COUNTS,
        LEAST,
        Column("order", decimals=0, heading="tangent_order", sheet="tangent_order"),
        Column("perimeter_m", "m", decimals=4, heading="tangent_perimeter",
               sheet="tangent_perimeter_m"),
        Column("area_m2", "m2", decimals=3, heading="tangent_area", sheet="tangent_area_m2"),
        Column("wall_area_m2", "m2", decimals=3, heading="tangent_wall_area",
               sheet="tangent_wall_area_m2"),
    ),
    rows=lambda record: record["tangents"]["levels"],
)  # fmt: skip

READINGS = Table(
    "tangent_readings",
    (
        ROW,
        SETUP,
        COURSE,
        LEVEL,
        Column("side", words="limbs", heading="tangent_side", sheet="tangent_side", width=9),
        Column("length_m", "m", decimals=2, heading="tangent_length", sheet="tangent_length_m"),
        DEPARTURE,
        _W,
        Column("redundancy", decimals=2, heading="tangent_redundancy",
               sheet="tangent_redundancy"),
        Column("mdb_m", "mm", decimals=1, heading="tangent_mdb", sheet="tangent_mdb_mm"),
        Column("used", words="yes_no", heading="tangent_used", sheet="tangent_used", width=8),
    ),
    rows=lambda record: record["tangents"]["readings"],
)  # fmt: skip
