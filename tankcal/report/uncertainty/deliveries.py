"""Deliveries with the largest uncertainty, for each minimum height."""

from tankcal.report.tables import Column, Table
from tankcal.report.uncertainty.budget import UNLIMITED
from tankcal.report.uncertainty.stated import same
from tankcal.text.digits import LITRE_DECIMALS

# Keys of the worst deliveries in the record.
WORST = ("absolute", "relative", "at_minimum")


def worst_rows(paper):
    """Return a row for each minimum height and criterion, each delivery once (list of dict)."""
    return [
        delivery | {"minimum_m": entry["minimum_m"], "which": paper.word(f"worst.{name}")}
        for entry in paper.record["deliveries"]
        for name in WORST
        if (delivery := entry[name])
        and not (name == "relative" and same(delivery, entry["at_minimum"]))
    ]


def worst(paper):
    """Table of the worst deliveries."""
    return [paper.show(WORST_DELIVERIES, worst_rows(paper))]


WORST_DELIVERIES = Table(
    "worst_deliveries",
    (
        Column("minimum_m", "m", height=True, sheet="at_least_m"),
        Column("which", sheet="largest", width=44),
        Column("high_m", "m", height=True, heading="dip_high", sheet="from_dip_m"),
        Column("low_m", "m", height=True, heading="dip_low", sheet="down_to_m"),
        Column("volume_m3", "m3", u="U_m3", least=LITRE_DECIMALS, sheet="volume_m3", width=14),
        Column("U_m3", "m3", u="U_m3", sheet="U_m3"),
        Column("k", decimals=2, sheet="k", width=10),
        Column("relative", "share", digits=2, align="right", sheet="relative"),
        Column("u_m3", "m3", u="u_m3", on="", sheet="standard_u_m3", width=14),
        Column("dof", decimals=0, nothing=UNLIMITED, on="", sheet="dof"),
    ),
    last={"sheet": "minimum_m u_m3 dof which"},
)
