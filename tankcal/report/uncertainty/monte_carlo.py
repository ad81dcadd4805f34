"""The Monte Carlo simulation and the validation of the GUM intervals."""

from itertools import groupby

from tankcal.record.columns import rows_of
from tankcal.report import blocks
from tankcal.report.tables import Column, Table
from tankcal.report.uncertainty.stated import MARK, flag_simulated
from tankcal.text.digits import LITRE_DECIMALS
from tankcal.text.words import name_of_input

MOST_RANGES = 40  # largest number of ranges in the papers


def facts(paper):
    """Return labels and texts: seed, tolerance, draws, nonlinear inputs, validated rows."""
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
        ("draws", draws(paper)),
        ("curved", _curvature_text(paper) or paper.word("texts.none_curved")),
        ("rows_validated", validated),
        *((key, paper.number(count, decimals=0)) for key, count in counts.items()),
    ]


def sentence(paper):
    """Return a sentence on the draws, the model, and the rows in which both intervals agree."""
    simulation = paper.record["monte_carlo"]
    rows = len(paper.record["capacity"]["volume_m3"])
    drawn = simulation.get("drawn", rows)
    return paper.word(
        "texts.simulated",
        seed=str(simulation["seed"]),
        draws=draws(paper),
        drawn=drawn,
        all=rows,
        others=paper.word("texts.others_follow") if drawn < rows else "",
        verdict=_verdict(paper),
    )


def draws(paper):
    """Return the number of draws per row, or its range, in words."""
    drawn = paper.record["monte_carlo"]["rows"]["draws"]
    low, high = min(drawn), max(drawn)
    if low == high:
        return paper.number(low, decimals=0)
    return paper.word("texts.draws", low=low, high=high)


def _verdict(paper):
    """Return a sentence on the number of rows in which the GUM interval is validated."""
    simulated = flag_simulated(paper.record["capacity"])
    if not any(simulated):
        return paper.word("texts.agrees_all")
    if all(simulated):
        return paper.word("texts.agrees_none")
    count = simulated.count(False)
    return paper.word("texts.agrees_some", count=count, all=len(simulated), mark=MARK)


def _curvature_text(paper):
    pairs = paper.record["monte_carlo"]["curved"]
    names = [[name_of_input(paper.words, name) for name in pair] for pair in pairs]
    return "; ".join(
        first if first == second else paper.word("texts.with_each_other", one=first, other=second)
        for first, second in names
    )


def ranges(record):
    """Return a row for each range of successive table rows with equal verdict (list of dict).

    The keys are low_m, high_m, count and validated. The keys at_m, d_low, d_high, tolerance (None
    if U is 0), U_m3 and share refer to the table row with the largest difference. share is this
    difference relative to the U of the GUM (or None).
    """
    capacity, rows = record["capacity"], record["monte_carlo"]["rows"]
    indices = range(len(rows["validated"]))
    return [
        _range(capacity, rows, list(group))
        for _, group in groupby(indices, key=lambda row: rows["validated"][row])
    ]


def _range(capacity, rows, indices):
    largest = max(indices, key=lambda row: max(rows["d_low"][row], rows["d_high"][row]))
    U = capacity["U_m3"][largest]
    return {
        "low_m": capacity["height_m"][indices[0]],
        "high_m": capacity["height_m"][indices[-1]],
        "count": len(indices),
        "validated": rows["validated"][largest],
        "at_m": capacity["height_m"][largest],
        "U_m3": U,
        "share": max(rows["d_low"][largest], rows["d_high"][largest]) / U if U else None,
        **{key: rows[key][largest] for key in ("d_low", "d_high", "tolerance")},
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
        {**budget, **budget["monte_carlo"]}
        for budget in record["budgets"]
        if budget["monte_carlo"] is not None
    ],
)


def simulated_columns(record):
    """Return the simulated rows with their GUM intervals, {key: values}."""
    capacity, rows = record["capacity"], record["monte_carlo"]["rows"]
    pairs = list(zip(capacity["volume_m3"], capacity["U_m3"], strict=True))
    return rows | {
        "height_m": capacity["height_m"],
        "stated_U_m3": capacity["stated_U_m3"],
        "gum_low": [volume - expanded for volume, expanded in pairs],
        "gum_high": [volume + expanded for volume, expanded in pairs],
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
    """Sentence on the simulation, and table of the ranges of rows with equal verdict."""
    rows = ranges(paper.record)
    shown = rows[:MOST_RANGES]
    shown_blocks = [blocks.paragraph(sentence(paper)), paper.show(RANGES, shown)]
    if len(shown) < len(rows):
        shown_blocks.append(paper.paragraph("only_first_ranges", shown=len(shown), all=len(rows)))
    every = (*rows, *DELIVERIES.rows(paper.record))
    if not all(row["validated"] for row in every):
        digits = paper.record["monte_carlo"]["digits"]
        shown_blocks.append(paper.paragraph("why_not_validated", digits=digits))
    return shown_blocks


def delivery_blocks(paper):
    """Table of the simulated deliveries; [] if there are none."""
    rows = DELIVERIES.rows(paper.record)
    return [paper.show(DELIVERIES, rows), *_difference(paper, rows)] if rows else []


def _difference(paper, rows):
    """Paragraph on the difference of deliveries that are not validated; [] if all are."""
    failed_rows = [row for row in rows if not row["validated"] and row["U_m3"]]
    if not failed_rows:
        return []
    differences = [max(row["d_low"], row["d_high"]) for row in failed_rows]
    share = max(d / row["U_m3"] for d, row in zip(differences, failed_rows, strict=True))
    return [
        paper.paragraph(
            "difference_of_deliveries",
            difference=paper.number(max(differences), "m3", digits=2),
            share=paper.number(share, "share", digits=2),
        )
    ]
