"""Columns common to the tables of wall hits and of tangents."""

from tankcal.report.tables.table import Column

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


def certificates_of_setups(setups):
    """Return {instrument: certificate} of saved set-ups."""
    named = [setup for setup in setups if setup["instrument"]]
    return {setup["instrument"]: setup["certificate"] for setup in named}
