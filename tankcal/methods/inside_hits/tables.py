"""Tables of wall hits inside horizontal tanks and spheres: set-ups, incidence, compared hits."""

from tankcal.methods.hits import tables as of_upright_tanks
from tankcal.report.tables.table import DEPARTURE, ROW, SETUP, Table

SETUPS = Table(
    "hit_setups",
    of_upright_tanks.SETUPS.columns,
    rows=lambda record: record["inside_hits"]["setups"],
)

INCIDENCE = Table(
    "hit_incidence",
    of_upright_tanks.INCIDENCE.columns,
    rows=lambda record: record["inside_hits"]["incidence"],
)

COMPARED = Table(
    "inside_hits_compared",
    (SETUP, ROW, DEPARTURE),
    rows=lambda record: record["inside_hits"]["compared"],
)
