"""The worst deliveries of each minimum height."""

from tankcal.report import numbers
from tankcal.report.paper import Column
from tankcal.report.uncertainty.stated import same

WORST = ("absolute", "relative", "at_minimum")


def worst_rows(paper):
    """One row for each minimum height and way of being the worst, each delivery once."""
    return [
        found | {"minimum_m": one["minimum_m"], "which": paper.word(f"worst.{name}")}
        for one in paper.record["deliveries"]
        for name in WORST
        if (found := one[name]) and not (name == "relative" and same(found, one["at_minimum"]))
    ]


def worst(paper):
    """The table of the worst deliveries."""
    rows = worst_rows(paper)
    columns = [
        Column("minimum_m", "m", height=True),
        Column("which"),
        Column("high_m", "m", height=True, heading="dip_high"),
        Column("low_m", "m", height=True, heading="dip_low"),
        Column("volume_m3", "m3", u="U_m3", least=numbers.unit("m3").least),
        Column("U_m3", "m3", u="U_m3"),
        Column("k", decimals=2),
        Column("relative", "share", digits=2, align="right"),
    ]
    return [paper.table("worst_deliveries", rows, columns)]
