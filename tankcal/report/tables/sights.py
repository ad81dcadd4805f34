"""Columns common to the tables of wall hits, tangents and clouds."""

from tankcal.report.tables.table import Column, Table

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


def counts_of(sights):
    """Return the columns of the numbers of used and rejected sights (key of the record)."""
    return (
        Column(sights, decimals=0, heading="hits_used", sheet="hits_used"),
        Column("rejected", decimals=0, heading="hits_rejected", sheet="hits_rejected"),
    )


def certificates_of_setups(setups):
    """Return {instrument: certificate} of saved set-ups."""
    named = [setup for setup in setups if setup["instrument"]]
    return {setup["instrument"]: setup["certificate"] for setup in named}
