"""Tables of tangents: set-ups, levels with perimeter and area, every sight."""

from tankcal.report.tables.table import Column, Table

_SETUP = Column("setup", heading="hit_setup", sheet="hit_setup", width=10)
_COURSE = Column("course", sheet="course", width=9)
_LEVEL = Column("level_m", "m", decimals=3, sheet="strap_level_m")
_W = Column("w", decimals=2, heading="tangent_w", sheet="tangent_w")
_COUNTS = (
    Column("tangents", decimals=0, heading="hits_used", sheet="hits_used"),
    Column("rejected", decimals=0, heading="hits_rejected", sheet="hits_rejected"),
)

SETUPS = Table(
    "tangent_setups",
    (
        _SETUP,
        Column("station", heading="hit_station", sheet="hit_station", width=10),
        Column("instrument", heading="hit_instrument", sheet="hit_instrument", width=14),
        Column("x_m", "m", decimals=3, heading="hit_x", sheet="hit_x_m"),
        Column("y_m", "m", decimals=3, heading="hit_y", sheet="hit_y_m"),
        Column("z_m", "m", decimals=3, heading="hit_z", sheet="hit_z_m"),
        *_COUNTS,
        Column("checks", decimals=0, heading="hits_compared", sheet="hits_compared"),
        _W,
        Column("turn_rad", "rad arcsec", decimals=1, heading="tangent_turn",
               sheet="tangent_turn_arcsec"),
    ),
    rows=lambda record: record["tangents"]["setups"],
)  # fmt: skip

LEVELS = Table(
    "tangent_levels",
    (
        _COURSE,
        _LEVEL,
        *_COUNTS,
        Column("least", decimals=0, heading="hits_least", sheet="hits_least"),
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
        Column("row", decimals=0, heading="hit_row", sheet="hit_row", width=8),
        _SETUP,
        _COURSE,
        _LEVEL,
        Column("side", words="limbs", heading="tangent_side", sheet="tangent_side", width=9),
        Column("length_m", "m", decimals=2, heading="tangent_length", sheet="tangent_length_m"),
        Column("departure_m", "mm", decimals=2, heading="line_departure",
               sheet="line_departure_mm"),
        _W,
        Column("redundancy", decimals=2, heading="tangent_redundancy",
               sheet="tangent_redundancy"),
        Column("mdb_m", "mm", decimals=1, heading="tangent_mdb", sheet="tangent_mdb_mm"),
        Column("used", words="yes_no", heading="tangent_used", sheet="tangent_used", width=8),
    ),
    rows=lambda record: record["tangents"]["readings"],
)  # fmt: skip
