"""Tables of wall hits: set-ups, common errors, rings, control targets, incidence."""

from tankcal.report.tables import table
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

# ---- tables of hits

_SECTION = Column("section", sheet="section", width=10)
_COUNTS = counts_of("hits")

SETUPS = Table(
    "hit_setups",
    (
        *PLACE,
        Column("tie", words="ties_of_setups", heading="hit_tie", sheet="hit_tie", width=16),
        *_COUNTS,
        CHECKS,
    ),
    rows=lambda record: record["hits"]["setups"],
)  # fmt: skip

SHARED = table.SHARED  # also the basis of a table of clouds

RINGS = Table(
    "hit_rings",
    (
        _SECTION,
        COURSE,
        LEVEL,
        *_COUNTS,
        LEAST,
    ),
    rows=lambda record: record["hits"]["rings"],
)  # fmt: skip

INCIDENCE = Table(
    "hit_incidence",
    (
        Column("low_deg", decimals=0, heading="incidence_low", sheet="incidence_low_deg"),
        Column("high_deg", decimals=0, heading="incidence_high", sheet="incidence_high_deg"),
        Column("hits", decimals=0, heading="hits_read", sheet="hits_read"),
    ),
    rows=lambda record: record["hits"]["incidence"],
)  # fmt: skip

CONTROL = Table(
    "hit_control",
    (
        SETUP,
        Column("target", heading="hit_target", sheet="hit_target", width=10),
        Column("elapsed_h", decimals=2, heading="control_hours", sheet="control_hours"),
        Column("direction_rad", "rad arcsec", decimals=1, heading="control_direction",
               sheet="control_direction_arcsec"),
        Column("zenith_rad", "rad arcsec", decimals=1, heading="control_zenith",
               sheet="control_zenith_arcsec"),
        Column("distance_m", "mm", decimals=1, heading="control_distance",
               sheet="control_distance_mm"),
    ),
    rows=lambda record: record["hits"]["control"],
)  # fmt: skip

DRIFTS = Table(
    "hit_drifts",
    (
        SETUP,
        Column("hours", decimals=2, heading="drift_hours", sheet="drift_hours"),
        Column("direction_rad_h", "rad arcsec", decimals=2, heading="drift_direction",
               sheet="drift_direction_arcsec"),
        Column("zenith_rad_h", "rad arcsec", decimals=2, heading="drift_zenith",
               sheet="drift_zenith_arcsec"),
    ),
    rows=lambda record: record["hits"]["drifts"],
)  # fmt: skip

COMPARED = Table(
    "hit_compared",
    (
        SETUP,
        ROW,
        _SECTION,
        DEPARTURE,
    ),
    rows=lambda record: record["hits"]["compared"],
)  # fmt: skip
