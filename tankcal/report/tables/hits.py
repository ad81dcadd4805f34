"""Tables of wall hits: set-ups, common errors, rings, control targets, incidence.

Tables of tangents share the first columns.
"""

from tankcal.report.tables.table import Column, Table

# ---- columns common to hits and tangents

SETUP = Column("setup", heading="hit_setup", sheet="hit_setup", width=10)
INSTRUMENT = Column("instrument", heading="hit_instrument", sheet="hit_instrument", width=14)
PLACE = (
    SETUP,
    Column("station", heading="hit_station", sheet="hit_station", width=10),
    INSTRUMENT,
    Column("x_m", "m", decimals=3, heading="hit_x", sheet="hit_x_m"),
    Column("y_m", "m", decimals=3, heading="hit_y", sheet="hit_y_m"),
    Column("z_m", "m", decimals=3, heading="hit_z", sheet="hit_z_m"),
)
COURSE = Column("course", sheet="course", width=9)
LEVEL = Column("level_m", "m", decimals=3, sheet="strap_level_m")
CHECKS = Column("checks", decimals=0, heading="hits_compared", sheet="hits_compared")
LEAST = Column("least", decimals=0, heading="hits_least", sheet="hits_least")
ROW = Column("row", decimals=0, heading="hit_row", sheet="hit_row", width=8)
DEPARTURE = Column(
    "departure_m", "mm", decimals=2, heading="line_departure", sheet="line_departure_mm"
)


def counts_of(sights):
    """Return the columns of the numbers of used and rejected sights (key of the record)."""
    return (
        Column(sights, decimals=0, heading="hits_used", sheet="hits_used"),
        Column("rejected", decimals=0, heading="hits_rejected", sheet="hits_rejected"),
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

SHARED = Table(
    "hit_shared",
    (
        INSTRUMENT,
        Column("certificate", heading="tape_certificate", sheet="tape_certificate", width=14),
        Column("what", words="inputs", heading="hit_shared_what", sheet="hit_shared_what",
               width=22),
        Column("unit", heading="hit_shared_unit", sheet="hit_shared_unit", width=7),
        Column("u_before", decimals=2, heading="hit_u_before", sheet="hit_u_before"),
        Column("value", decimals=2, heading="hit_value", sheet="hit_value"),
        Column("u_after", decimals=2, heading="hit_u_after", sheet="hit_u_after"),
        Column("correlation", decimals=2, heading="hit_correlation", sheet="hit_correlation"),
    ),
    rows=lambda record: [
        {**error, "certificate": error["certificate"] or None} for error in record["hits"]["shared"]
    ],
)  # fmt: skip

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
