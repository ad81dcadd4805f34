"""The simulation: how it was made, and where it validates the GUM interval."""

from itertools import groupby

from tankcal.record.plain_data import rows_of
from tankcal.report import blocks
from tankcal.report.tables import Column, Table
from tankcal.report.uncertainty import method
from tankcal.text.digits import LITRE_DECIMALS
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


def _differences():
    return [
        *(Column(key, "m3", digits=2, align="right") for key in ("d_low", "d_high")),
        Column("tolerance", "m3", digits=1, heading="tolerance_m3", align="right"),
    ]


RANGES = Table(
    "ranges",
    (
        Column("low_m", "m", height=True, heading="range_low"),
        Column("high_m", "m", height=True, heading="range_high"),
        Column("count", decimals=0, heading="rows"),
        Column("validated", words="validated", heading="interval_code"),
        Column("at_m", "m", height=True),
        *_differences(),
        Column("share", "share", digits=2, heading="d_percent", align="right"),
    ),
    rows=ranges,
)
DELIVERIES = Table(
    "simulated_deliveries",
    (
        Column("high_m", "m", height=True, heading="dip_high"),
        Column("low_m", "m", height=True, heading="dip_low"),
        *(
            Column(key, "m3", u="U_m3", least=LITRE_DECIMALS)
            for key in ("volume_m3", "low", "high")
        ),
        *_differences(),
        Column("validated", words="validated", heading="interval_code"),
    ),
    rows=lambda record: [
        {**one, **one["monte_carlo"]} for one in record["budgets"] if one["monte_carlo"] is not None
    ],
)


def simulated_columns(record):
    """Every row of the table as it was simulated, beside the GUM's interval: {key: values}."""
    capacity, rows = record["capacity"], record["monte_carlo"]["rows"]
    pairs = list(zip(capacity["volume_m3"], capacity["U_m3"], strict=True))
    return rows | {
        "height_m": capacity["height_m"],
        "stated_U_m3": capacity["stated_U_m3"],
        "gum_low": [one - expanded for one, expanded in pairs],
        "gum_high": [one + expanded for one, expanded in pairs],
    }


_LITRES = {"u": "stated_U_m3", "least": LITRE_DECIMALS, "width": 10}
SIMULATED = Table(
    "monte_carlo",
    (
        Column("height_m", "m", height=True, sheet="dip_height_m", width=9),
        Column("value", sheet="mean_m3", **_LITRES),
        Column("u", u="u", sheet="u_m3", width=10),
        *(
            Column(key, sheet=code, **_LITRES)
            for key, code in (
                *(("low", "from_m3"), ("high", "to_m3")),
                *(("gum_low", "gum_from_m3"), ("gum_high", "gum_to_m3")),
            )
        ),
        Column("d_low", digits=2, most=6, sheet="lower_difference_m3", width=10),
        Column("d_high", digits=2, most=6, sheet="upper_difference_m3", width=10),
        Column("tolerance", digits=1, most=6, sheet="tolerance_m3", width=10),
        Column("validated", sheet="validated", width=10),
        Column("sure", sheet="sure"),
        Column("draws", decimals=0, sheet="draws", width=8),
    ),
    rows=lambda record: rows_of(simulated_columns(record)),
)


def range_blocks(paper):
    """The table of the ranges."""
    found = ranges(paper.record)
    shown = found[:MOST_RANGES]
    table = paper.show(RANGES, shown)
    if len(shown) == len(found):
        return [table]
    return [table, paper.paragraph("only_first_ranges", shown=len(shown), all=len(found))]


def delivery_blocks(paper):
    """The table of the deliveries that were simulated; nothing where there are none."""
    rows = DELIVERIES.rows(paper.record)
    return [paper.show(DELIVERIES, rows), *_why(paper, rows)] if rows else []


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
