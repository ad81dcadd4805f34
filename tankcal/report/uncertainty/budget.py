"""Budgets: line by line for the top row and a delivery, contributions for the others."""

from tankcal.pipeline.plot_style import even_groups
from tankcal.report import blocks
from tankcal.report.numbers import degrees_of_freedom, like_its_sd, symbol
from tankcal.report.tables import Column, Table
from tankcal.text.digits import NOTHING, decimals_of, fixed, shortest
from tankcal.text.words import name_of_input

ACROSS = 7  # volumes and deliveries beside each other
USEFUL = 0.995  # of U: an input that would change it less is not worth measuring better
UNLIMITED = "∞"  # degrees of freedom
LEAST_WRITTEN_OUT = 1e-4  # of a sensitivity in the workbook
SMALL = 5e-4  # share of the variance that prints as 0.0 %
# inputs whose note is a code: how their size is known
OF_WALL = ("bulge", "ovality", "seams", "oblateness", "legs")


def top(paper):
    """The budget of the top row, of the table alone."""
    capacity, lines = paper.record["capacity"], paper.record["budget"]
    values = {key: capacity[key][-1] for key in ("u_m3", "k", "U_m3", "dof")}
    height = paper.height(capacity["height_m"][-1])
    return [_table(paper, "budget", lines, values, height=height), *_notes(paper, lines)]


def first_delivery(paper):
    """The budget of the first delivery; nothing where there is none."""
    one = _first_delivery(paper)
    if one is None:
        return []
    table = _table(
        paper,
        "budget_delivery",
        [line for line in one["lines"] if abs(line["share"]) >= SMALL],
        one,
        high=paper.height(one["high_m"]),
        low=paper.height(one["low_m"]),
        volume=paper.number(one["volume_m3"], "m3", u=one["U_m3"]),
    )
    return [table]


def _first_delivery(paper):
    found = (one for one in paper.record.get("budgets", []) if one["low_m"] is not None)
    return next(found, None)


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
    """What was declared beside an input, and what it is correlated with."""
    return "; ".join(filter(None, [_beside(paper, line), *correlations(paper, [line])]))


def _beside(paper, line):
    """What was declared beside an input, or how the size of a part of the wall is known."""
    told = paper.words["told_by"] if line["input"] in OF_WALL else {}
    return told.get(line["note"], line["note"])


def _digits_of_sensitivity(line):
    """Four digits, or a power of ten where they would stand behind many zeros."""
    size = abs(line["sensitivity"] or 0)
    return "0.00E+00" if 0 < size < LEAST_WRITTEN_OUT else decimals_of(size, significant=4)


def budget_table(decimals):
    """The Table of the lines of a budget, its contributions with so many decimals."""
    of_u, as_number = {"u": "u", "decimals": 4, "digits": None}, {"text": None}
    return Table(
        "budget",
        (
            Column("input", text=lambda paper, line: paper.input_name(line), sheet="input",
                   width=38),
            Column("estimate", text=_estimate, align="right", sheet="estimate",
                   in_sheet=as_number | of_u),
            Column("u", digits=2, align="right", sheet="u_of_input", width=10, in_sheet=of_u),
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
    """What was declared beside the inputs, a sentence each."""
    texts = [
        paper.word("texts.input_note", input=paper.input_name(line), note=_beside(paper, line))
        for line in lines
        if line["note"] and line["note"] not in paper.input_name(line)
    ]
    texts += correlations(paper, lines)
    return [blocks.listing(texts)] if texts else []


def correlations(paper, lines):
    """A sentence for each input that is correlated with others."""
    found = []
    for line in lines:
        pairs = [
            f"{name_of_input(paper.words, name)}, r = {shortest(r, paper.marks)}"
            for name, r in line.get("correlations", [])
        ]
        if pairs:
            name = paper.input_name(line)
            found.append(paper.word("texts.correlated", input=name, others="; ".join(pairs)))
    return found


def others(paper):
    """Contributions of each input to each stated volume and delivery, some across a table."""
    budgets = paper.record.get("budgets", [])
    return [_matrix(paper, group) for group in even_groups(budgets, ACROSS)]


def _matrix(paper, budgets):
    names = [paper.input_name(line) for line in budgets[0]["lines"]]
    columns = [_contributions(paper, one, names) for one in budgets]
    totals = [paper.word(f"table_headings.{key}_of_all") for key in ("u", "k", "U")]
    rows = [list(row) for row in zip([*names, *totals], *columns, strict=True)]
    heads = [paper.word("table_headings.input"), *(_dips(paper, one) for one in budgets)]
    align = ["left", *["decimal"] * len(budgets)]
    caption = paper.word("captions.budget_matrix", unit=paper.volume_symbol)
    return blocks.table(heads, rows, caption, align, paper.marks.decimal)


def _contributions(paper, one, names):
    factor = paper.volume_factor
    digits = decimals_of(factor * one["u_m3"])
    known = {paper.input_name(line): factor * line["contribution_m3"] for line in one["lines"]}
    texts = [fixed(known.get(name), digits + 1, paper.marks) for name in names]
    k = fixed(one["k"], 2, paper.marks)
    u, U = (fixed(factor * one[key], digits, paper.marks) for key in ("u_m3", "U_m3"))
    return [*texts, u, k, U]


def _dips(paper, one):
    """The head of a column: a dip, and of a delivery below it the one that is subtracted."""
    below = "" if one["low_m"] is None else f"{paper.marks.minus} {paper.height(one['low_m'], '')}"
    return [paper.height(one["high_m"], ""), below]


def improvements(paper):
    """What is worth measuring better: U with half the u of an input, the most useful first."""
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
        if (least := min((one for one in row.values() if one is not None), default=1)) < USEFUL
    ]
    if not useful:
        return []
    columns = [Column(key, "share", decimals=1, nothing=NOTHING) for key in budgets]
    useful.sort(key=lambda row: row["least"])
    return [paper.table("improve", useful, [Column("input"), *columns])]
