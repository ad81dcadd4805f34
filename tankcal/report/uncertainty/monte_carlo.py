"""The simulation: how it was made, and where it validates the GUM interval."""

from itertools import groupby

from tankcal.report import blocks, numbers
from tankcal.report.paper import Column
from tankcal.report.uncertainty import method
from tankcal.text.words import name_of_input

MOST_RANGES = 40


def facts(paper):
    """Labels and texts: seed, tolerance, draws, what is curved, how many rows are validated."""
    simulation = paper.record["monte_carlo"]
    rows = simulation["rows"]
    every = len(rows["validated"])
    validated = paper.word("texts.of", count=simulation["validated"], all=every)
    counts = {
        "rows_not_sure": rows["sure"].count(False),
        "rows_not_reached": rows["reached"].count(False),
        "rows_bent": rows["bent"].count(True),
    }
    return [
        ("seed", str(simulation["seed"])),
        ("probability", paper.percent(simulation["probability"])),
        ("tolerance", paper.word("texts.tolerance", digits=simulation["digits"])),
        ("draws", method.draws(paper)),
        ("curved", _curved(paper) or paper.word("texts.none_curved")),
        ("rows_validated", validated),
        *((key, paper.number(count, decimals=0)) for key, count in counts.items()),
    ]


def _curved(paper):
    pairs = paper.record["monte_carlo"]["curved"]
    names = [[name_of_input(paper.words, one) for one in pair] for pair in pairs]
    return "; ".join(
        one if one == other else paper.word("texts.with_each_other", one=one, other=other)
        for one, other in names
    )


def ranges(record):
    """Rows one after the other with the same verdict: one row each, with its largest difference.

    Keys low_m, high_m, count, validated; of the row with the largest difference at_m, d_low,
    d_high, tolerance (None: U is 0), U_m3 and share, that difference over the GUM's U (None).
    """
    capacity, rows = record["capacity"], record["monte_carlo"]["rows"]
    places = range(len(rows["validated"]))
    return [
        _range(capacity, rows, list(group))
        for _, group in groupby(places, key=lambda row: rows["validated"][row])
    ]


def _range(capacity, rows, places):
    at = max(places, key=lambda row: max(rows["d_low"][row], rows["d_high"][row]))
    U = capacity["U_m3"][at]
    return {
        "low_m": capacity["height_m"][places[0]],
        "high_m": capacity["height_m"][places[-1]],
        "count": len(places),
        "validated": rows["validated"][at],
        "at_m": capacity["height_m"][at],
        "U_m3": U,
        "share": max(rows["d_low"][at], rows["d_high"][at]) / U if U else None,
        **{key: rows[key][at] for key in ("d_low", "d_high", "tolerance")},
    }


def range_blocks(paper):
    """The table of the ranges."""
    found = ranges(paper.record)
    columns = [
        Column("low_m", "m", height=True, heading="range_low"),
        Column("high_m", "m", height=True, heading="range_high"),
        Column("count", decimals=0, heading="rows"),
        Column("validated", words="validated", heading="interval_code"),
        Column("at_m", "m", height=True),
        *_differences("m3"),
        Column("share", "share", digits=2, heading="d_percent", align="right"),
    ]
    shown = found[:MOST_RANGES]
    table = paper.table("ranges", shown, columns)
    if len(shown) == len(found):
        return [table]
    return [table, paper.paragraph("only_first_ranges", shown=len(shown), all=len(found))]


def _differences(unit):
    return [
        *(Column(key, unit, digits=2, align="right") for key in ("d_low", "d_high")),
        Column("tolerance", unit, digits=1, heading="tolerance_m3", align="right"),
    ]


def delivery_blocks(paper):
    """The table of the deliveries that were simulated; nothing where there are none."""
    rows = [
        {**one, **one["monte_carlo"]}
        for one in paper.record["budgets"]
        if one["monte_carlo"] is not None
    ]
    if not rows:
        return []
    of_ends = {"u": "U_m3", "least": numbers.unit("m3").least}
    columns = [
        Column("high_m", "m", height=True, heading="dip_high"),
        Column("low_m", "m", height=True, heading="dip_low"),
        *(Column(key, "m3", **of_ends) for key in ("volume_m3", "low", "high")),
        *_differences("m3"),
        Column("validated", words="validated", heading="interval_code"),
    ]
    return [paper.table("simulated_deliveries", rows, columns), *_why(paper, rows)]


def _why(paper, rows):
    """What it means that deliveries are not validated; nothing where all are."""
    failed = [one for one in rows if not one["validated"] and one["U_m3"]]
    if not failed:
        return []
    off = [max(one["d_low"], one["d_high"]) for one in failed]
    share = max(d / one["U_m3"] for d, one in zip(off, failed, strict=True))
    sentence = paper.word(
        "texts.why_not_validated",
        digits=paper.record["monte_carlo"]["digits"],
        difference=paper.number(max(off), "m3", digits=2),
        share=paper.number(share, "share", digits=2),
    )
    return [blocks.paragraph(sentence)]
