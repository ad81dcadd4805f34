"""Budgets: complete for the top row and one delivery, contributions for all others."""

from tankcal.report import blocks
from tankcal.report.numbers import degrees_of_freedom, like_its_sd, symbol
from tankcal.report.plots.style import even_groups
from tankcal.report.tables import Column, Table
from tankcal.report.uncertainty.stated import UNLIMITED
from tankcal.text.digits import NOTHING, decimals_of, fixed, shortest
from tankcal.text.words import name_of_input

ACROSS = 7  # largest number of volumes and deliveries in a table
USEFUL = 0.995  # largest ratio of U, after halving the u of an input, that is reported
LEAST_WRITTEN_OUT = 1e-4  # smallest sensitivity without a power of ten in the workbook
SMALL = 5e-4  # share of the variance that is printed as 0.0 %
# Inputs whose note is a code for the source of their size.
OF_WALL = ("bulge", "ovality", "seams", "oblateness", "legs")


def top(paper):
    """Blocks of the budget of the top row of the table."""
    capacity, lines = paper.record["capacity"], paper.record["budget"]
    values = {key: capacity[key][-1] for key in ("u_m3", "k", "U_m3", "dof")}
    height = paper.height(capacity["height_m"][-1])
    return [_table(paper, "budget", lines, values, height=height), *_notes(paper, lines)]


def first_delivery(paper):
    """Blocks of the budget of the first delivery; [] without deliveries."""
    delivery = _first_delivery(paper)
    if delivery is None:
        return []
    table = _table(
        paper,
        "budget_delivery",
        [line for line in delivery["lines"] if abs(line["share"]) >= SMALL],
        delivery,
        high=paper.height(delivery["high_m"]),
        low=paper.height(delivery["low_m"]),
        volume=paper.number(delivery["volume_m3"], "m3", u=delivery["U_m3"]),
    )
    return [table]


def _first_delivery(paper):
    deliveries = (
        budget for budget in paper.record.get("budgets", []) if budget["low_m"] is not None
    )
    return next(deliveries, None)


def _table(paper, name, lines, values, /, **places):
    u, U = (paper.number(values[key], "m3", u=values["u_m3"]) for key in ("u_m3", "U_m3"))
    k, nu = paper.number(values["k"], decimals=2), degrees_of_freedom(values["dof"], paper.marks)
    table = budget_table(decimals_of(values["U_m3"]) + 1)
    return paper.show(table, lines, on=name, u=u, U=U, k=k, nu=nu, **places)


def _distribution(paper, line):
    return paper.words["distributions"].get(line["distribution"], line["distribution"])


def _estimate(paper, line):
    estimate = line.get("estimate")
    return None if estimate is None else like_its_sd(estimate, line["u"], paper.marks)


def _note(paper, line):
    """Return the remarks on an input: note of the job, and correlations."""
    return "; ".join(filter(None, [_note_of_input(paper, line), *correlations(paper, [line])]))


def _note_of_input(paper, line):
    """Return the note of an input; codes of deviations of the wall are translated."""
    sources = paper.words["told_by"] if line["input"] in OF_WALL else {}
    return sources.get(line["note"], line["note"])


def _digits_of_sensitivity(line):
    """Return four significant digits, or a format with a power of ten for small values."""
    size = abs(line["sensitivity"] or 0)
    return "0.00E+00" if 0 < size < LEAST_WRITTEN_OUT else decimals_of(size, significant=4)


def budget_table(decimals):
    """Return the Table of a budget, with `decimals` for its contributions."""
    by_u, as_number = {"u": "u", "decimals": 4, "digits": None}, {"text": None}
    return Table(
        "budget",
        (
            Column("input", text=lambda paper, line: paper.input_name(line), sheet="input",
                   width=38),
            Column("estimate", text=_estimate, align="right", sheet="estimate",
                   in_sheet=as_number | by_u),
            Column("u", digits=2, align="right", sheet="u_of_input", width=10, in_sheet=by_u),
            Column("unit", text=lambda paper, line: symbol(line["unit"]), sheet="unit", width=9),
            Column("how", text=lambda paper, line: f"{line['type']}, {_distribution(paper, line)}"),
            Column("type", on="", sheet="type", width=7),
            Column("distribution", text=_distribution, on="", sheet="distribution", width=13),
            Column("dof", text=lambda paper, line: degrees_of_freedom(line["dof"], paper.marks),
                   align="right", sheet="dof", width=9,
                   in_sheet=as_number | {"decimals": 0, "nothing": UNLIMITED}),
            Column("sensitivity", "m3/unit", digits=3, align="right", sheet="sensitivity",
                   width=10, in_sheet={"digits": None, "decimals": _digits_of_sensitivity}),
            Column("sensitivity_unit", text=lambda paper, line: symbol(line["sensitivity_unit"]),
                   on="", sheet="sensitivity_unit", width=11),
            Column("contribution_m3", "m3", decimals=decimals, sheet="contribution_m3", width=10),
            Column("share", "share", decimals=1, sheet="share", width=9),
            Column("halved", "share", decimals=1, on="", sheet="halved", width=10),
            Column("note", text=_note, on="", sheet="note", width=40),
        ),
        rows=lambda record: record["budget"],
    )  # fmt: skip


def _notes(paper, lines):
    """Block of sentences on notes and correlations of the inputs; [] without any."""
    texts = [
        paper.word(
            "texts.input_note", input=paper.input_name(line), note=_note_of_input(paper, line)
        )
        for line in lines
        if line["note"] and line["note"] not in paper.input_name(line)
    ]
    texts += correlations(paper, lines)
    return [blocks.listing(texts)] if texts else []


def correlations(paper, lines):
    """Return a sentence for each input with correlations (list of str)."""
    sentences = []
    for line in lines:
        pairs = [
            f"{name_of_input(paper.words, name)}, r = {shortest(r, paper.marks)}"
            for name, r in line.get("correlations", [])
        ]
        if pairs:
            name = paper.input_name(line)
            sentences.append(paper.word("texts.correlated", input=name, others="; ".join(pairs)))
    return sentences


def others(paper):
    """Tables of the contributions of the inputs to all stated volumes and deliveries."""
    budgets = paper.record.get("budgets", [])
    return [_matrix(paper, group) for group in even_groups(budgets, ACROSS)]


def _matrix(paper, budgets):
    """Return a table: a row per input, a column per volume or delivery."""
    names = [paper.input_name(line) for line in budgets[0]["lines"]]
    columns = [_contributions(paper, budget, names) for budget in budgets]
    totals = [paper.word(f"table_headings.{key}_of_all") for key in ("u", "k", "U")]
    rows = [list(row) for row in zip([*names, *totals], *columns, strict=True)]
    heads = [paper.word("table_headings.input"), *(_dips(paper, budget) for budget in budgets)]
    align = ["left", *["decimal"] * len(budgets)]
    caption = paper.word("captions.budget_matrix", unit=paper.volume_symbol)
    return blocks.table(heads, rows, caption, align, paper.marks.decimal)


def _contributions(paper, budget, names):
    """Return the column of a volume or delivery: contributions, u, k and U as texts."""
    factor = paper.volume_factor
    digits = decimals_of(factor * budget["u_m3"])
    known = {paper.input_name(line): factor * line["contribution_m3"] for line in budget["lines"]}
    texts = [fixed(known.get(name), digits + 1, paper.marks) for name in names]
    k = fixed(budget["k"], 2, paper.marks)
    u, U = (fixed(factor * budget[key], digits, paper.marks) for key in ("u_m3", "U_m3"))
    return [*texts, u, k, U]


def _dips(paper, budget):
    """Return the heading of a column: the dip, and the lower dip of a delivery below it."""
    below = (
        ""
        if budget["low_m"] is None
        else f"{paper.marks.minus} {paper.height(budget['low_m'], '')}"
    )
    return [paper.height(budget["high_m"], ""), below]


def improvements(paper):
    """Table of U after halving the u of each input, largest reduction first; [] if none."""
    budgets = {"halved_top": paper.record["budget"]}
    delivery = _first_delivery(paper)
    if delivery is not None:
        budgets["halved_delivery"] = delivery["lines"]
    rows = {}
    for key, lines in budgets.items():
        for line in lines:
            rows.setdefault(paper.input_name(line), {})[key] = line.get("halved")
    useful = [
        {"input": name, **row, "least": least}
        for name, row in rows.items()
        if (least := min((U for U in row.values() if U is not None), default=1)) < USEFUL
    ]
    if not useful:
        return []
    columns = [Column(key, "share", decimals=1, nothing=NOTHING) for key in budgets]
    useful.sort(key=lambda row: row["least"])
    return [paper.table("improve", useful, [Column("input"), *columns])]
